//! `ventriform evaluate` and `ventriform templates`: the paper's evaluation on a cohort.
//!
//! A cohort is a folder with one folder for each case (`spect.nii.gz`, `lv_expert_img.nii.gz`,
//! `lv_truth.nii.gz`) and a `manifest.json` that says which cases are templates; without it,
//! cases whose names begin with `t` are. Results of single fits are kept in `fits/`, and a
//! run that was stopped goes on where it was.

use super::Bar;
use super::segment::read;
use crate::deform::DeformParameters;
use crate::deform::template::{Organ, Template};
use crate::deform::voxelise::{Mask, voxelise};
use crate::evaluate::masks::{Agreement, compare};
use crate::evaluate::table::{self, ModelRow, Row};
use crate::export::{self, Format};
use crate::parameters::ModelParameters;
use crate::pipeline::{self, Model};
use crate::progress::Monitor;
use crate::segmentation::on_grid;
use crate::volume::{Reading, Volume};
use anyhow::{Context, Result, bail};
use clap::{Args, Subcommand};
use rayon::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Builds the template models, fits them to every patient, writes tables and plots.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  ventriform evaluate --cohort cohort --points 67,110,150,200,300 --out evaluation
Writes models/, fits/, fits.csv, figure3.csv, evaluation.json and evaluation.html. Fits that
are there already are not made again.")]
pub struct EvaluateArgs {
    /// The cohort's folder
    #[arg(long, value_name = "DIR")]
    cohort: PathBuf,
    /// Numbers of points
    #[arg(
        long,
        value_name = "N,...",
        value_delimiter = ',',
        default_value = "67,110,150,200,300"
    )]
    points: Vec<usize>,
    /// Where the results go (made where missing)
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Keeps the library of models.
#[derive(Debug, Args)]
pub struct TemplatesArgs {
    #[command(subcommand)]
    action: TemplatesAction,
}

#[derive(Debug, Subcommand)]
enum TemplatesAction {
    /// Makes the models of a cohort's template cases: scans by threshold, masks where a case
    /// is called manual
    Build {
        /// The cohort's folder
        #[arg(long, value_name = "DIR")]
        cohort: PathBuf,
        /// Numbers of points
        #[arg(
            long,
            value_name = "N,...",
            value_delimiter = ',',
            default_value = "150"
        )]
        points: Vec<usize>,
        /// Where the models go, as CASE_N.json (made where missing)
        #[arg(short, long = "output", value_name = "DIR")]
        output: PathBuf,
    },
    /// Adds models to the library of a service that does not run just now
    Import(super::library::ImportArgs),
}

/// Runs `ventriform templates`.
///
/// # Errors
/// What reading, generating or the file system says.
pub fn run_templates(args: &TemplatesArgs) -> Result<()> {
    let (cohort, points, output) = match &args.action {
        TemplatesAction::Build {
            cohort,
            points,
            output,
        } => (cohort, points, output),
        TemplatesAction::Import(args) => return super::library::import(args),
    };
    let cohort = Cohort::open(cohort)?;
    make_folder(output)?;
    for n in points {
        for case in &cohort.templates {
            let (model, _) = build(&cohort, case, *n)?;
            write_model(output, case, *n, &model)?;
            eprintln!("{case}_{n}.json written");
        }
    }
    Ok(())
}

/// Runs `ventriform evaluate`.
///
/// # Errors
/// What reading, generating or the file system says; a fit that fails is a row with its
/// reason, not an error.
pub fn run(args: &EvaluateArgs) -> Result<()> {
    let cohort = Cohort::open(&args.cohort)?;
    let (models_folder, fits) = (args.out.join("models"), args.out.join("fits"));
    make_folder(&models_folder)?;
    make_folder(&fits)?;
    let (models, figure3) = models(&cohort, &args.points, &models_folder)?;
    let bar = Bar::start();
    let done = AtomicUsize::new(0);
    let rows: Vec<Vec<Row>> = cohort
        .patients
        .par_iter()
        .map(|case| {
            let rows = fit_case(&cohort, case, &models, &fits);
            let count = 1 + done.fetch_add(1, Ordering::Relaxed);
            bar.show("fit", count as f64 / cohort.patients.len() as f64);
            rows
        })
        .collect::<Result<_>>()?;
    bar.finish();
    let rows: Vec<Row> = rows.into_iter().flatten().collect();
    write_results(&args.out, &rows, &figure3)?;
    for n in &args.points {
        let mean = |name| table::mean(&rows, None, *n, name).unwrap_or(f64::NAN);
        eprintln!(
            "N = {n}: Jaccard {:.3}, contour distance {:.3} voxels; against the truth {:.3}",
            mean("jaccard"),
            mean("contour_distance_voxels"),
            mean("jaccard_truth")
        );
    }
    Ok(())
}

fn write_results(out: &Path, rows: &[Row], figure3: &[ModelRow]) -> Result<()> {
    write(&out.join("fits.csv"), table::csv(rows).as_bytes())?;
    write(
        &out.join("figure3.csv"),
        table::figure3_csv(figure3).as_bytes(),
    )?;
    let json = serde_json::to_vec_pretty(&table::to_json(rows, figure3))?;
    write(&out.join("evaluation.json"), &json)?;
    write(
        &out.join("evaluation.html"),
        table::html(rows, figure3).as_bytes(),
    )
}

/// A cohort's folder and who is who in it.
struct Cohort {
    folder: PathBuf,
    templates: Vec<String>,
    patients: Vec<String>,
}

impl Cohort {
    fn open(folder: &Path) -> Result<Self> {
        let mut names = Vec::new();
        let entries = std::fs::read_dir(folder).with_context(|| format!("{}", folder.display()))?;
        for entry in entries {
            let path = entry?.path();
            if path.join("spect.nii.gz").is_file()
                && let Some(name) = path.file_name()
            {
                names.push(name.to_string_lossy().into_owned());
            }
        }
        names.sort();
        let listed = listed_templates(&folder.join("manifest.json"))?;
        let (templates, patients): (Vec<_>, Vec<_>) =
            names.into_iter().partition(|n| match &listed {
                Some(listed) => listed.contains(n),
                None => n.starts_with('t'),
            });
        if templates.is_empty() || patients.is_empty() {
            bail!(
                "{}: {} template and {} other cases with a spect.nii.gz; both are needed",
                folder.display(),
                templates.len(),
                patients.len()
            );
        }
        Ok(Self {
            folder: folder.to_path_buf(),
            templates,
            patients,
        })
    }

    fn volume(&self, case: &str, file: &str) -> Result<Reading> {
        read(
            &[self.folder.join(case).join(file)],
            None,
            &Monitor::silent(),
        )
    }
}

/// The cases with the role `template`, where there is a manifest.
fn listed_templates(path: &Path) -> Result<Option<Vec<String>>> {
    if !path.is_file() {
        return Ok(None);
    }
    let text = std::fs::read(path).with_context(|| format!("{}", path.display()))?;
    let manifest: Value =
        serde_json::from_slice(&text).with_context(|| format!("{}", path.display()))?;
    let cases = manifest.get("cases").unwrap_or(&manifest);
    let Some(cases) = cases.as_array() else {
        return Ok(None);
    };
    let templates = cases
        .iter()
        .filter(|c| c["role"] == "template")
        .filter_map(|c| c["case"].as_str().map(str::to_owned))
        .collect();
    Ok(Some(templates))
}

/// A model ready to be fitted, by template and number of points.
struct Ready {
    case: String,
    points: usize,
    template: Template,
}

fn models(cohort: &Cohort, points: &[usize], folder: &Path) -> Result<(Vec<Ready>, Vec<ModelRow>)> {
    let mut ready = Vec::new();
    let mut figure3 = Vec::new();
    for n in points {
        for case in &cohort.templates {
            let (model, row) = build(cohort, case, *n)?;
            write_model(folder, case, *n, &model)?;
            figure3.push(row);
            let template = Template::new(model.mesh, Organ::LeftVentricle, &Monitor::silent())
                .with_context(|| format!("the model of {case} with {n} points"))?;
            ready.push(Ready {
                case: case.clone(),
                points: *n,
                template,
            });
        }
    }
    Ok((ready, figure3))
}

/// The case whose model comes from the manual mask, as in the paper: two scans by threshold,
/// one mask, one phantom.
const MANUAL: &str = "t3";

fn build(cohort: &Cohort, case: &str, points: usize) -> Result<(Model, ModelRow)> {
    let manual = case == MANUAL
        && cohort
            .folder
            .join(case)
            .join("lv_expert_img.nii.gz")
            .is_file();
    let file = if manual {
        "lv_expert_img.nii.gz"
    } else {
        "spect.nii.gz"
    };
    let reading = cohort.volume(case, file)?;
    let pairs = [("points", points.to_string())];
    let parameters = ModelParameters::from_pairs(pairs.iter().map(|(n, t)| (*n, t.as_str())))
        .map_err(|e| anyhow::anyhow!("{e}. {}", e.fix))?;
    let model = pipeline::from_reading(&reading, &parameters, 0.0, &Monitor::silent())
        .with_context(|| format!("the model of {case} with {points} points"))?;
    let forms = &model.report.fitness.forms;
    let row = ModelRow {
        template: case.to_owned(),
        points,
        retiled: [forms.retiled.raw, forms.retiled.normalised],
        optimised: [forms.optimised.raw, forms.optimised.normalised],
    };
    Ok((model, row))
}

fn write_model(folder: &Path, case: &str, points: usize, model: &Model) -> Result<()> {
    let bytes = export::encode(Format::Json, &model.mesh, &model.metadata())?;
    write(&folder.join(format!("{case}_{points}.json")), &bytes)
}

/// Names of the figures of a row.
const FIGURES: [&str; 12] = [
    "jaccard",
    "contour_distance_voxels",
    "contour_distance_mm",
    "dice",
    "hausdorff95_mm",
    "jaccard_truth",
    "contour_distance_voxels_truth",
    "confidence",
    "iterations",
    "wall_ml",
    "cavity_ml",
    "flags",
];

fn fit_case(cohort: &Cohort, case: &str, models: &[Ready], fits: &Path) -> Result<Vec<Row>> {
    let mut patient: Option<Patient> = None;
    let mut rows = Vec::new();
    for model in models {
        let path = fits.join(format!("{case}_{}_{}.json", model.case, model.points));
        if let Some(row) = kept(&path, case, model) {
            rows.push(row);
            continue;
        }
        let patient = match &patient {
            Some(patient) => patient,
            None => patient.insert(Patient::read(cohort, case)?),
        };
        let row = patient.fit(case, model);
        write(&path, &serde_json::to_vec_pretty(&table::row_json(&row))?)?;
        rows.push(row);
    }
    Ok(rows)
}

/// A row of an earlier run; one that cannot be read is made again.
fn kept(path: &Path, case: &str, model: &Ready) -> Option<Row> {
    let value: Value = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
    Some(Row {
        template: model.case.clone(),
        points: model.points,
        case: case.to_owned(),
        reason: value["reason"].as_str()?.to_owned(),
        figures: FIGURES.iter().map(|f| (*f, value[*f].as_f64())).collect(),
    })
}

struct Patient {
    volume: Volume,
    expert: Option<Mask>,
    truth: Option<Mask>,
}

impl Patient {
    fn read(cohort: &Cohort, case: &str) -> Result<Self> {
        let volume = cohort.volume(case, "spect.nii.gz")?.volume;
        let gold = |file: &str| -> Result<Option<Mask>> {
            if !cohort.folder.join(case).join(file).is_file() {
                return Ok(None);
            }
            let mask = cohort.volume(case, file)?.volume;
            Ok(Some(
                on_grid(&mask, &volume).with_context(|| format!("{case}/{file}"))?,
            ))
        };
        Ok(Self {
            expert: gold("lv_expert_img.nii.gz")?,
            truth: gold("lv_truth.nii.gz")?,
            volume,
        })
    }

    fn fit(&self, case: &str, model: &Ready) -> Row {
        let row = |reason: String, values: [Option<f64>; 12]| Row {
            template: model.case.clone(),
            points: model.points,
            case: case.to_owned(),
            reason,
            figures: FIGURES.into_iter().zip(values).collect(),
        };
        let parameters = DeformParameters::default();
        let monitor = Monitor::silent();
        let fit = match crate::deform::fit(&self.volume, &model.template, &parameters, &monitor) {
            Ok(fit) => fit,
            Err(error) => return row(error.to_string(), [None; 12]),
        };
        let mask = voxelise(&fit.mesh, self.volume.shape, &self.volume.frame);
        let against = |gold: &Option<Mask>| -> Option<Agreement> {
            compare(&mask, gold.as_ref()?, self.volume.frame.spacing()).ok()
        };
        let (expert, truth) = (against(&self.expert), against(&self.truth));
        let contours = |a: &Option<Agreement>| a.as_ref().and_then(|a| a.contours);
        row(
            fit.reason.as_str().to_owned(),
            [
                expert.as_ref().map(|a| a.jaccard),
                contours(&expert).map(|c| c.mean_voxels),
                contours(&expert).map(|c| c.mean_mm),
                expert.as_ref().map(|a| a.dice),
                contours(&expert).map(|c| c.hausdorff95_mm),
                truth.as_ref().map(|a| a.jaccard),
                contours(&truth).map(|c| c.mean_voxels),
                Some(fit.confidence),
                Some(fit.iterations as f64),
                Some(fit.wall_ml),
                fit.wall.as_ref().map(|w| w.cavity_ml),
                Some(fit.flags.len() as f64),
            ],
        )
    }
}

fn make_folder(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).with_context(|| format!("cannot make {}", path.display()))
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}
