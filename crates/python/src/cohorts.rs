//! `calibrate`, `normals build` and `evaluate`: work on folders of cases.

use crate::errors::{Stopped, broken, refused, stopped};
use crate::run::{How, Tell, run, run_steps};
use crate::values::with_fit;
use crate::volumes::NativeVolume;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;
use std::path::PathBuf;
use ventriform::base::progress::Plan;
use ventriform::heart::deform::DeformParameters;
use ventriform::heart::deform::elastic::{Stiffness, SupportScaling};
use ventriform::image::volume::ReadLimits;
use ventriform::image::volume::given_mask::MaskChoice;
use ventriform::mesh::files::{MeshFrame, MeshStatement, MeshUnit};
use ventriform::parameters::CalibrationChoice;
use ventriform::runs::evaluate::calibration::{
    Calibration, CalibrationCase, CalibrationError, CaseFigures, calibrate as learn, cases_of,
};
use ventriform::runs::evaluate::normals::{self, BuildError, NormalsOptions};
use ventriform::runs::evaluate::parameters::InSample;
use ventriform::runs::evaluate::rows::Variant;
use ventriform::runs::evaluate::sample::Sample;
use ventriform::runs::evaluate::{
    Cohort, EvaluateError, EvaluationObserver, EvaluationParameters, EvaluationStep,
    evaluate as judge,
};

/// The cases that a reader's profile is learnt on.
#[derive(FromPyObject)]
pub enum GivenCases {
    /// Name, scan and mask of each.
    Cases(Vec<(String, Py<NativeVolume>, Py<NativeVolume>)>),
    /// The folder that they are in.
    Folder(PathBuf),
}

impl GivenCases {
    fn cases(self, mask: &str) -> Result<Vec<CalibrationCase>, CalibrationError> {
        match self {
            GivenCases::Cases(cases) => {
                let case = |(name, scan, mask): (String, Py<NativeVolume>, Py<NativeVolume>)| {
                    let [scan, mask] = [scan, mask].map(|volume| volume.get().files.clone());
                    CalibrationCase { name, scan, mask }
                };
                Ok(cases.into_iter().map(case).collect())
            }
            GivenCases::Folder(folder) => {
                cases_of(&folder, mask).map_err(|error| CalibrationError::Folder { folder, error })
            }
        }
    }
}

/// The text of the profile, and the table of cases and problems as JSON.
#[pyfunction]
#[pyo3(signature = (cohort, mask, parameters, how))]
pub fn calibrate(
    py: Python<'_>,
    cohort: GivenCases,
    mask: String,
    parameters: &Bound<'_, PyDict>,
    how: How<'_>,
) -> PyResult<(String, String)> {
    let parameters = with_fit::<CalibrationChoice>(parameters)?.fit;
    let fix = match &cohort {
        GivenCases::Folder(_) => {
            "Give a folder with a folder for each case, which holds a scan and a mask."
        }
        GivenCases::Cases(_) => "Give a scan and a reader's mask of it for each case.",
    };
    run_steps(py, &how, move |tell, monitor| {
        let no_cohort = |error| match error {
            CalibrationError::Cancelled(cancelled) => Stopped::from(cancelled),
            error => Stopped::Failed(refused("cohort", error, fix)),
        };
        let cases = cohort.cases(&mask).map_err(no_cohort)?;
        let made = learn(&cases, &parameters, &|share| tell("fit", share), monitor);
        let made = made.map_err(no_cohort)?;
        Ok((made.profile.to_json(), cases_table(&made)))
    })
}

fn cases_table(made: &Calibration) -> String {
    let finite = |x: f64| Some(x).filter(|x| x.is_finite());
    let figures = |f: &CaseFigures| {
        json!({
            "jaccard": f.jaccard,
            "contour_distance_voxels": finite(f.contour),
            "wall_ml": f.wall_ml,
            "cavity_ml": finite(f.cavity_ml),
        })
    };
    let rows = made.rows.iter().map(|row| {
        json!({
            "case": row.case,
            "reader_ml": row.reader_ml,
            "without": figures(&row.without),
            "held_out": made.figures(row, Sample::HeldOut).as_ref().map(figures),
            "in_sample": made.figures(row, Sample::InSample).as_ref().map(figures),
        })
    });
    json!({
        "cases": rows.collect::<Vec<_>>(),
        "problems": made.problems,
    })
    .to_string()
}

/// The text of normal limits, built of healthy people's scans.
#[pyfunction]
#[pyo3(signature = (cohort, parameters, how))]
pub fn build_normals(
    py: Python<'_>,
    cohort: PathBuf,
    parameters: &Bound<'_, PyDict>,
    how: How<'_>,
) -> PyResult<String> {
    let options = NormalsOptions {
        parameters: with_fit(parameters)?,
        program_version: env!("CARGO_PKG_VERSION").to_owned(),
        limits: ReadLimits::default(),
    };
    run(py, Plan::NORMALS, &how, |monitor| {
        let made = normals::build(&cohort, &options, &|_, _| (), monitor);
        Ok(made.map_err(no_limits)?.to_json())
    })
}

fn no_limits(error: BuildError) -> Stopped {
    match stopped(&error) {
        Stopped::Cancelled => Stopped::Cancelled,
        Stopped::Failed(failure) if failure.fix.is_some() => Stopped::Failed(failure.at("cohort")),
        Stopped::Failed(_) => {
            let fix = "Give a folder with cohort.csv and the scans that it names.";
            Stopped::Failed(refused("cohort", error, fix))
        }
    }
}

/// The choices of an evaluation.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct EvaluationOrder {
    cohort: PathBuf,
    out: PathBuf,
    points: Vec<usize>,
    reference_points: Vec<usize>,
    models: Vec<String>,
    method: String,
    manual: Option<String>,
    label: Option<String>,
    resample: bool,
    mesh_unit: Option<String>,
    mesh_frame: Option<String>,
    leave_one_out: bool,
    in_sample: Vec<String>,
    align: bool,
    support: f64,
    support_radius: f64,
    support_scaling: String,
    program: Vec<u8>,
}

impl EvaluationOrder {
    /// How models are fitted.
    fn deform(&self) -> DeformParameters {
        DeformParameters {
            align: self.align,
            stiffness: Stiffness {
                support: self.support,
                support_radius: self.support_radius,
                support_scaling: match self.support_scaling.as_str() {
                    "per-node" => SupportScaling::PerNode,
                    _ => SupportScaling::Fixed,
                },
                ..Stiffness::default()
            },
            ..DeformParameters::default()
        }
    }
}

struct Told<'a>(Tell<'a>);

impl EvaluationObserver for Told<'_> {
    fn progress(&self, step: EvaluationStep, fraction: f64) {
        (self.0)(step.as_str(), fraction);
    }
}

/// Fits models to every patient of a cohort and writes tables, plots and pictures; gives the problems.
#[pyfunction]
#[pyo3(signature = (order, how))]
pub fn evaluate(
    py: Python<'_>,
    order: EvaluationOrder,
    how: How<'_>,
) -> PyResult<Vec<(String, String)>> {
    run_steps(py, &how, move |tell, monitor| {
        let refuse = |error: EvaluateError| match error {
            EvaluateError::Cancelled(cancelled) => Stopped::from(cancelled),
            EvaluateError::ModelParameter(error) => stopped(&error),
            EvaluateError::FitParameter(error) => stopped(&error),
            error => Stopped::Failed(refused("cohort", error, "")),
        };
        let deform = order.deform();
        let parameters = EvaluationParameters {
            points: order.points,
            reference_points: order.reference_points,
            variants: variants(&order.models)?,
            method: order.method,
            deform,
            in_sample: match order.in_sample.as_slice() {
                [word] if word == "all" => InSample::All,
                names => InSample::Named(names.to_vec()),
            },
            leave_one_out: order.leave_one_out,
        };
        parameters.validate().map_err(refuse)?;
        let cohort = Cohort::open(&order.cohort, order.manual.as_deref());
        let mut cohort = cohort.map_err(|error| {
            let fix = "Give a folder with a folder for each case.";
            Stopped::Failed(refused("cohort", error, fix))
        })?;
        cohort.masks = MaskChoice {
            label: order.label.as_deref().map(|text| {
                let Ok(label) = text.parse();
                label
            }),
            resample: order.resample,
            mesh: MeshStatement {
                unit: order.mesh_unit.as_deref().and_then(MeshUnit::named),
                frame: order.mesh_frame.as_deref().and_then(MeshFrame::named),
            },
        };
        if parameters.leave_one_out {
            cohort.judge_templates();
        }
        let made = judge(
            &cohort,
            &parameters,
            &order.program,
            &order.out,
            &Told(tell),
            monitor,
        );
        let made = made.map_err(refuse)?;
        if !made.has_fit() {
            let reason = "no fit succeeded; see the reasons in evaluation.html";
            return Err(Stopped::Failed(broken(reason)));
        }
        Ok(made.problems)
    })
}

fn variants(names: &[String]) -> Result<Vec<Variant>, Stopped> {
    let known = [
        Variant::Reference,
        Variant::Retiled,
        Variant::Optimised,
        Variant::Auto,
    ];
    let variant = |name: &String| {
        let found = known.into_iter().find(|known| known.as_str() == name);
        found.ok_or_else(|| {
            let words = known.map(Variant::as_str).join(", ");
            let reason = format!("`{name}` is no kind of model");
            Stopped::Failed(refused("models", reason, &format!("Give some of {words}.")))
        })
    };
    names.iter().map(variant).collect()
}
