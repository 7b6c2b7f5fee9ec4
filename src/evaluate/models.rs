//! The models of a cohort's templates: ours at every number of points, before and after fit
//! and flips, and the reference model.

use crate::cli::evaluate::EvaluateArgs;
use crate::decimate::decimate;
use crate::deform::template::{Organ, Template};
use crate::evaluate::cohort::{Cohort, read_volume};
use crate::evaluate::rows::{Kind, ModelRow, Variant, average};
use crate::export::{self, Format, Metadata};
use crate::geometry::triangle::radius_ratio;
use crate::mesh::TriMesh;
use crate::optimise::{self, Reference};
use crate::parameters::ModelParameters;
use crate::pipeline::starts;
use crate::progress::Monitor;
use crate::surface::{self, Surface};
use anyhow::{Context, Result};
use rayon::prelude::*;

/// A model, ready to be fitted.
pub struct Model {
    /// The case that it was made from.
    pub template: String,
    /// Its kind.
    pub kind: Kind,
    /// Its place in Figure 3.
    pub row: ModelRow,
    /// Prepared for fitting.
    pub ready: Template,
    /// Its file.
    pub json: Vec<u8>,
}

impl Model {
    /// The name of its file and of its fits' files.
    pub fn name(&self) -> String {
        format!(
            "{}_{}_{}",
            self.template,
            self.kind.variant.as_str(),
            self.kind.points
        )
    }
}

/// Makes every model that `args` asks for; what cannot be made becomes a problem.
pub fn build(cohort: &Cohort, args: &EvaluateArgs) -> (Vec<Model>, Vec<(String, String)>) {
    let made: Vec<Vec<Result<Model>>> = cohort
        .templates
        .par_iter()
        .map(|case| of_template(cohort, case, args).unwrap_or_else(|error| vec![Err(error)]))
        .collect();
    let (mut models, mut problems) = (Vec::new(), Vec::new());
    for (case, made) in cohort.templates.iter().zip(made) {
        for model in made {
            match model {
                Ok(model) => models.push(model),
                Err(error) => problems.push((case.clone(), format!("no model: {error:#}"))),
            }
        }
    }
    (models, problems)
}

fn of_template(cohort: &Cohort, case: &str, args: &EvaluateArgs) -> Result<Vec<Result<Model>>> {
    let (path, _) = cohort.source(case).context("its files are gone")?;
    let reading = read_volume(&path)?;
    let parameters = args.model_parameters(None)?;
    let surface = surface::extract(&reading.volume, &parameters.surface, &Monitor::silent())?;
    let workshop = Workshop {
        case,
        reference: Reference::new(&surface),
        surface,
    };
    let mut models = Vec::new();
    if args.makes(Variant::Reference) {
        for points in args.reference_points() {
            models.push(workshop.thin_out(points));
        }
    }
    for points in args.cohort.points() {
        let made = args
            .model_parameters(Some(points))
            .and_then(|p| workshop.retile(points, &p));
        match made {
            Ok(made) => models.extend(
                made.into_iter()
                    .filter(|m| args.makes(m.kind.variant))
                    .map(Ok),
            ),
            Err(error) => models.push(Err(error)),
        }
    }
    Ok(models)
}

/// One template's surface, which all its models are made of.
struct Workshop<'a> {
    case: &'a str,
    surface: Surface,
    reference: Reference,
}

impl Workshop<'_> {
    fn thin_out(&self, points: usize) -> Result<Model> {
        let mesh = decimate(&self.surface.mesh, points, &Monitor::silent())
            .with_context(|| format!("the reference model of {points} points"))?;
        self.finish(mesh, Variant::Reference, points)
    }

    fn retile(&self, points: usize, parameters: &ModelParameters) -> Result<[Model; 2]> {
        let monitor = Monitor::silent();
        let context = || format!("{points} points");
        let tiled = starts::tile(&self.surface, parameters, &monitor).with_context(context)?;
        let best = starts::best(tiled, &self.reference, parameters, &monitor, |_| {})
            .with_context(context)?;
        Ok([
            self.finish(best.tiled.mesh, Variant::Retiled, points)?,
            self.finish(best.optimised.mesh, Variant::Optimised, points)?,
        ])
    }

    fn finish(&self, mesh: TriMesh, variant: Variant, points: usize) -> Result<Model> {
        let context = || format!("{} model of {points} points", variant.as_str());
        let fitness = optimise::assess(&mesh, &self.reference, [1.0; 4]).with_context(context)?;
        let shapes: Vec<f64> = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                radius_ratio(&a, &b, &c)
            })
            .collect();
        let kind = Kind { variant, points };
        let row = ModelRow {
            template: self.case.to_owned(),
            kind,
            raw: fitness.raw,
            normalised: fitness.normalised,
            robust: fitness.robust,
            shape: average(&shapes).unwrap_or(0.0),
            worst_shape: shapes.iter().copied().fold(1.0, f64::min),
        };
        let title = format!("{}, {} of {points} points", self.case, variant.title());
        let json = export::encode(Format::Json, &mesh, &Metadata::new(title))?;
        let ready =
            Template::new(mesh, Organ::LeftVentricle, &Monitor::silent()).with_context(context)?;
        Ok(Model {
            template: self.case.to_owned(),
            kind,
            row,
            ready,
            json,
        })
    }
}
