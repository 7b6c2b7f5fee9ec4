//! The models of a cohort's templates: ours at every number of points, before and after fit
//! and flips, and the reference model. For Figure 3, flips and fit are also judged each without the other.

use super::cohort::Cohort;
use super::parameters::{EvaluationParameters, ascending};
use super::rows::{ModelKind, ModelRow, Variant, average};
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::model::{Organ, Template};
use crate::image::volume::given_mask::GivenMaskError;
use crate::mesh::TriMesh;
use crate::mesh::decimate::decimate;
use crate::parameters::{ModelParameters, ParameterError};
use crate::results::export::{self, Format, Metadata};
use crate::runs::pipeline::starts;
use crate::surface::optimise::{
    self, FitnessForm, Gain, LeastSquaresParameters, OptimiseParameters, Reference,
};
use crate::surface::{self, Surface, SurfaceError};
use rayon::prelude::*;
use std::path::PathBuf;

/// A model of a template, ready to be fitted.
pub struct CohortModel {
    /// The case that it was made from.
    pub template: String,
    /// Its kind.
    pub kind: ModelKind,
    /// Its figures for Figure 3, after those of the single steps that led to it.
    pub rows: Vec<ModelRow>,
    /// The model prepared for fitting.
    pub ready: Template,
    /// The model as a JSON file.
    pub json: Vec<u8>,
}

impl CohortModel {
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

/// Why a model could not be made.
#[derive(Debug, thiserror::Error)]
enum ModelError {
    #[error("its files are gone")]
    Gone,
    #[error("{}: {error}", path.display())]
    Read {
        path: PathBuf,
        error: Box<GivenMaskError>,
    },
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    #[error("{0}. {fix}", fix = .0.fix)]
    Parameter(#[from] ParameterError),
    #[error("{what}: {error}")]
    Step {
        what: String,
        error: Box<dyn std::error::Error + Send + Sync>,
    },
}

/// Puts the step before the error of a stage.
fn during<E: std::error::Error + Send + Sync + 'static>(
    what: impl FnOnce() -> String,
) -> impl FnOnce(E) -> ModelError {
    move |error| ModelError::Step {
        what: what(),
        error: error.into(),
    }
}

/// The models of a cohort's templates.
pub struct CohortModels {
    /// Those that were made.
    pub models: Vec<CohortModel>,
    /// For each that could not be made, the template and the reason.
    pub problems: Vec<(String, String)>,
}

/// Makes every model that `parameters` ask for.
///
/// # Errors
/// [`Cancelled`].
pub fn build(
    cohort: &Cohort,
    parameters: &EvaluationParameters,
    monitor: &Monitor<'_>,
) -> Result<CohortModels, Cancelled> {
    let made: Vec<Vec<Result<CohortModel, ModelError>>> = cohort
        .templates
        .par_iter()
        .map(|case| {
            let made = of_template(cohort, case, parameters, monitor);
            made.unwrap_or_else(|error| vec![Err(error)])
        })
        .collect();
    // A model that was not made because of the caller is no problem of its template.
    monitor.check()?;
    let (mut models, mut problems) = (Vec::new(), Vec::new());
    for (case, made) in cohort.templates.iter().zip(made) {
        for model in made {
            match model {
                Ok(model) => models.push(model),
                Err(error) => problems.push((case.clone(), format!("no model: {error}"))),
            }
        }
    }
    Ok(CohortModels { models, problems })
}

fn of_template(
    cohort: &Cohort,
    case: &str,
    parameters: &EvaluationParameters,
    monitor: &Monitor<'_>,
) -> Result<Vec<Result<CohortModel, ModelError>>, ModelError> {
    let (path, _) = cohort.source(case).ok_or(ModelError::Gone)?;
    let reading = cohort.read_source(case, &path, monitor);
    let reading = reading.map_err(|error| ModelError::Read {
        path,
        error: Box::new(error),
    })?;
    let defaults = parameters.model_parameters(None)?;
    let surface = surface::extract(&reading.volume, &defaults.surface, monitor)?;
    let source = TemplateSurface {
        case,
        reference: Reference::new(&surface),
        surface,
        monitor,
    };
    let makes = |variant: Variant| parameters.variants.contains(&variant);
    let mut models = Vec::new();
    if makes(Variant::Reference) {
        for points in ascending(&parameters.reference_points) {
            models.push(source.thin_out(points));
        }
    }
    for points in ascending(&parameters.points) {
        let made = parameters
            .model_parameters(Some(points))
            .map_err(ModelError::from)
            .and_then(|own| source.retile(points, &own));
        match made {
            Ok(made) => models.extend(made.into_iter().filter(|m| makes(m.kind.variant)).map(Ok)),
            Err(error) => models.push(Err(error)),
        }
    }
    Ok(models)
}

/// One template's surface, which all its models are made of.
struct TemplateSurface<'a> {
    case: &'a str,
    surface: Surface,
    reference: Reference,
    monitor: &'a Monitor<'a>,
}

impl TemplateSurface<'_> {
    fn thin_out(&self, points: usize) -> Result<CohortModel, ModelError> {
        let mesh = decimate(&self.surface.mesh, points, self.monitor)
            .map_err(during(|| format!("the reference model of {points} points")))?;
        self.finish(mesh, Variant::Reference, points)
    }

    fn retile(
        &self,
        points: usize,
        parameters: &ModelParameters,
    ) -> Result<[CohortModel; 2], ModelError> {
        let monitor = self.monitor;
        let what = || format!("{points} points");
        let tiled = starts::tile(&self.surface, parameters, monitor).map_err(during(what))?;
        let best = starts::best(tiled, &self.reference, parameters, monitor, |_| {})
            .map_err(during(what))?;
        let papers = OptimiseParameters {
            fitness: FitnessForm::Raw,
            gain: Gain::Local,
            guard: 0.0,
            fit: LeastSquaresParameters {
                rounds: 0,
                ..LeastSquaresParameters::default()
            },
            ..OptimiseParameters::default()
        };
        let flipped = optimise::optimise(&best.tiled, &self.reference, &papers, monitor)
            .map_err(during(what))?;
        let mut steps = vec![self.row(&flipped.mesh, Variant::Flipped, points)?];
        if parameters.optimise.fit.rounds > 0 {
            steps.push(self.row(&best.optimised.fitted_mesh, Variant::Fitted, points)?);
        }
        let retiled = self.finish(best.tiled.mesh, Variant::Retiled, points)?;
        let mut optimised = self.finish(best.optimised.mesh, Variant::Optimised, points)?;
        optimised.rows.splice(0..0, steps);
        Ok([retiled, optimised])
    }

    /// The figures of `mesh` for Figure 3.
    fn row(&self, mesh: &TriMesh, variant: Variant, points: usize) -> Result<ModelRow, ModelError> {
        let what = || format!("{} model of {points} points", variant.as_str());
        let fitness = optimise::assess(mesh, &self.reference, [1.0; 4]).map_err(during(what))?;
        let shapes: Vec<f64> = mesh.radius_ratios().collect();
        Ok(ModelRow {
            template: self.case.to_owned(),
            kind: ModelKind { variant, points },
            raw: fitness.raw,
            normalised: fitness.normalised,
            robust: fitness.robust,
            shape: average(&shapes).unwrap_or(0.0),
            worst_shape: shapes.iter().copied().fold(1.0, f64::min),
        })
    }

    /// Measures `mesh` and prepares it for fitting.
    fn finish(
        &self,
        mesh: TriMesh,
        variant: Variant,
        points: usize,
    ) -> Result<CohortModel, ModelError> {
        let what = || format!("{} model of {points} points", variant.as_str());
        let row = self.row(&mesh, variant, points)?;
        let title = format!("{}, {} of {points} points", self.case, variant.title());
        let json =
            export::encode(Format::Json, &mesh, &Metadata::new(title)).map_err(during(what))?;
        let ready =
            Template::new(mesh, Organ::LeftVentricle, self.monitor).map_err(during(what))?;
        Ok(CohortModel {
            template: self.case.to_owned(),
            kind: row.kind,
            rows: vec![row],
            ready,
            json,
        })
    }
}
