//! Every model fitted to every patient, in parallel over the patients.
//!
//! The organ is searched once in each patient, and each fit goes through the same functions as
//! [`crate::runs::segmentation`]. The result of every fit is written to a [`record`]; a result whose
//! record has the right key is read and not computed again.

use super::cohort::{Cohort, mask_on, read_volume};
use super::cohort_fit::CohortFit;
use super::error::EvaluateError;
use super::files::write_whole;
use super::models::CohortModel;
use super::observer::{EvaluationObserver, EvaluationStep};
use super::record::{self, Key};
use super::rows::{FitOutcome, FitRow, Gold, ModelKind, Variant};
use super::sample::Sample;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::deform::DeformParameters;
use crate::heart::judge::Fit;
use crate::image::grid::agreement::compare;
use crate::image::grid::voxelise::{Mask, voxelise};
use crate::image::volume::given_mask::MaskChoice;
use crate::image::volume::{Volume, VolumeFile};
use crate::results::export::{self, Format, Metadata};
use crate::runs::segmentation::{OrganSearch, built_in, fit_built_in};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Bytes of the program that are hashed between two looks at the cancel token.
const PROGRAM_BYTES_PER_CHECK: usize = 1 << 22;

/// All fits of one patient.
pub struct PatientFits {
    /// The patient's name.
    pub case: String,
    /// Whether the patient has a file for each of [`Gold::ALL`].
    pub golds: [bool; 2],
    /// One for each model, in the order of the models.
    pub fits: Vec<CohortFit>,
    /// The fit that `auto` keeps of the built-in hearts.
    pub auto: Option<CohortFit>,
    /// Problems of the patient's files or fits.
    pub problems: Vec<String>,
}

/// Input that all fits of a run share.
pub struct FitRun<'a> {
    /// Parameters of the fits.
    pub parameters: &'a DeformParameters,
    /// Whether the fit that `auto` keeps is a result too.
    pub auto: bool,
    /// Bytes that identify the program: results of another program are computed again.
    pub program: &'a [u8],
    /// Where records and fitted meshes go.
    pub folder: &'a Path,
    /// Which structure of the gold standards is meant.
    pub masks: &'a MaskChoice,
}

/// Fits all `models` to all patients of `cohort`.
///
/// # Errors
/// Where a record or a mesh cannot be written. A fit that fails is a result.
pub fn fit_all(
    cohort: &Cohort,
    models: &[CohortModel],
    run: &FitRun<'_>,
    observer: &dyn EvaluationObserver,
    monitor: &Monitor<'_>,
) -> Result<Vec<PatientFits>, EvaluateError> {
    let mut key = Key::new();
    for part in run.program.chunks(PROGRAM_BYTES_PER_CHECK) {
        monitor.check()?;
        key = key.and(part);
    }
    let done = AtomicUsize::new(0);
    let all = (cohort.patients.len() * (models.len() + usize::from(run.auto))).max(1);
    let advance = || {
        let count = 1 + done.fetch_add(1, Ordering::Relaxed);
        observer.progress(EvaluationStep::Fits, count as f64 / all as f64);
    };
    cohort
        .patients
        .par_iter()
        // Patients take long, and not equally long: each is a piece of work of its own.
        .with_max_len(1)
        .map(|case| {
            let files = PatientFiles::read(cohort, case);
            let key = files
                .add_to(key.clone())
                .and(format!("{:?}", run.parameters).as_bytes())
                .and(format!("{:?}", run.masks).as_bytes());
            let work = PatientWork {
                case,
                run,
                key,
                monitor,
            };
            work.fit_all(&files, models, &advance)
        })
        .collect()
}

/// A patient's files as bytes.
struct PatientFiles {
    scan: Result<Vec<u8>, String>,
    golds: [Option<Vec<u8>>; 2],
    paths: [Option<PathBuf>; 3],
}

impl PatientFiles {
    fn read(cohort: &Cohort, case: &str) -> Self {
        let scan = cohort.scan(case);
        let bytes = match &scan {
            Some(path) => std::fs::read(path).map_err(|e| e.to_string()),
            None => Err("its scan is gone".to_owned()),
        };
        let paths = Gold::ALL.map(|gold| cohort.gold(case, gold));
        let golds = paths.clone().map(|p| p.and_then(|p| std::fs::read(p).ok()));
        let [expert, truth] = paths;
        Self {
            scan: bytes,
            golds,
            paths: [scan, expert, truth],
        }
    }

    fn add_to(&self, key: Key) -> Key {
        let scan = match &self.scan {
            Ok(bytes) => key.and(bytes),
            Err(reason) => key.and(reason.as_bytes()),
        };
        self.golds.iter().fold(scan, |key, gold| match gold {
            Some(bytes) => key.and(b"gold").and(bytes),
            None => key.and(b"none"),
        })
    }
}

/// One patient's part of the run.
struct PatientWork<'a> {
    case: &'a str,
    run: &'a FitRun<'a>,
    key: Key,
    monitor: &'a Monitor<'a>,
}

impl PatientWork<'_> {
    fn fit_all(
        &self,
        files: &PatientFiles,
        models: &[CohortModel],
        advance: &impl Fn(),
    ) -> Result<PatientFits, EvaluateError> {
        // Read when the first fit is needed that has no record.
        let mut images: Option<PatientImages> = None;
        let mut patient = PatientFits {
            case: self.case.to_owned(),
            golds: files.golds.each_ref().map(Option::is_some),
            fits: Vec::new(),
            auto: None,
            problems: Vec::new(),
        };
        for model in models {
            let name = format!("{}_{}", self.case, model.name());
            let path = self.run.folder.join(format!("{name}.json"));
            let key = self.key.clone().and(&model.json).text();
            let fit = match record::read(&path, &key) {
                Some(kept) => kept,
                None => {
                    let images = self.images(files, &mut images)?;
                    let fit = images.fit(model, self.run.parameters, self.monitor)?;
                    self.write_mesh(&name, model, &fit)?;
                    record::write(&path, &key, &fit)?;
                    fit
                }
            };
            patient.fits.push(fit);
            advance();
        }
        if self.run.auto {
            let path = self.run.folder.join(format!("{}_auto.json", self.case));
            let key = self.key.clone().and(b"auto").text();
            let fit = match record::read(&path, &key) {
                Some(kept) => kept,
                None => {
                    let images = self.images(files, &mut images)?;
                    let fit = images.fit_auto(self.run.parameters, self.monitor)?;
                    record::write(&path, &key, &fit)?;
                    fit
                }
            };
            patient.auto = Some(fit);
            advance();
        }
        let golds = images
            .iter()
            .flat_map(|images| Gold::ALL.into_iter().zip(&images.golds));
        for (gold, mask) in golds {
            if let Some(Err(reason)) = mask {
                patient
                    .problems
                    .push(format!("{} cannot be used: {reason}", gold.file()));
            }
        }
        patient.note_problems(models);
        Ok(patient)
    }

    /// The patient's images, which are read when the first fit needs them.
    fn images<'i>(
        &self,
        files: &PatientFiles,
        read: &'i mut Option<PatientImages>,
    ) -> Result<&'i mut PatientImages, Cancelled> {
        let images = match read.take() {
            Some(images) => images,
            None => PatientImages::read(files, self.run.masks, self.monitor)?,
        };
        Ok(read.insert(images))
    }

    /// Writes the fitted mesh, for `ventriform statistics` and for viewers.
    fn write_mesh(
        &self,
        name: &str,
        model: &CohortModel,
        fit: &CohortFit,
    ) -> Result<(), EvaluateError> {
        if fit.vertices.is_empty() {
            return Ok(());
        }
        let mesh = fit.mesh(model);
        let title = format!("{} fitted to {}", model.name(), self.case);
        let bytes = export::encode(Format::Json, &mesh, &Metadata::new(title))?;
        write_whole(&self.run.folder.join(format!("{name}.mesh.json")), &bytes)
    }
}

impl PatientFits {
    /// The patient's rows of the table, but for models made of the patient; `sample` is the patient's.
    pub fn rows<'a>(
        &'a self,
        models: &'a [CohortModel],
        sample: Sample,
    ) -> impl Iterator<Item = FitRow> + 'a {
        let row = move |template: &str, kind: ModelKind, fit: &CohortFit| FitRow {
            template: template.to_owned(),
            kind,
            case: self.case.clone(),
            sample,
            outcome: fit.outcome.clone(),
            agreed: fit.agreed,
            golds: self.golds,
            figures: fit.figures.clone(),
        };
        let pairs = models.iter().zip(&self.fits);
        let own = pairs
            .filter(|(model, _)| model.template != self.case)
            .map(move |(model, fit)| row(&model.template, model.kind, fit));
        let auto = self.auto.as_ref().map(move |fit| {
            let kind = ModelKind {
                variant: Variant::Auto,
                points: built_in::HEART_POINTS,
            };
            row(built_in::NAME_PREFIX, kind, fit)
        });
        own.chain(auto)
    }

    /// Notes every fit that was lost, and once each problem that all fits of the patient have.
    fn note_problems(&mut self, models: &[CohortModel]) {
        let own = models.iter().map(CohortModel::name).zip(&self.fits);
        let auto = self.auto.iter().map(|fit| ("auto".to_owned(), fit));
        for (name, fit) in own.chain(auto) {
            let problem = match &fit.outcome {
                FitOutcome::Fitted(_) => None,
                FitOutcome::Lost(reason) => Some(format!("{name} lost: {reason}")),
                FitOutcome::Unreadable(reason) => Some(format!("not read: {reason}")),
            };
            let gold = Gold::ALL.into_iter().filter_map(|gold| {
                let unusable = self.golds[gold as usize]
                    && fit.agreed[gold as usize].is_none()
                    && matches!(fit.outcome, FitOutcome::Fitted(_));
                let what = format!("{} cannot be used", gold.file());
                let told = self
                    .problems
                    .iter()
                    .any(|problem| problem.starts_with(&what));
                (unusable && !told).then_some(what)
            });
            let gold: Vec<String> = gold.collect();
            for problem in problem.into_iter().chain(gold) {
                if !self.problems.contains(&problem) {
                    self.problems.push(problem);
                }
            }
        }
    }
}

/// A patient's volume, and the gold standards on its grid.
struct PatientImages {
    volume: Result<Volume, String>,
    /// The problem of a gold standard that cannot be used.
    golds: [Option<Result<Mask, String>>; 2],
    search: OrganSearch,
}

impl PatientImages {
    fn read(
        files: &PatientFiles,
        masks: &MaskChoice,
        monitor: &Monitor<'_>,
    ) -> Result<Self, Cancelled> {
        let [scan, golds @ ..] = &files.paths;
        let volume = match (scan, &files.scan) {
            (Some(path), Ok(_)) => read_volume(path, monitor)
                .map(|reading| reading.volume)
                .map_err(|error| error.to_string()),
            (_, Err(reason)) => Err(reason.clone()),
            (None, Ok(_)) => Err("its scan is gone".to_owned()),
        };
        let golds = golds.each_ref().map(|path| {
            let files = [VolumeFile::at(path.as_ref()?)];
            let mask = mask_on(&files, masks, volume.as_ref().ok()?, monitor);
            Some(mask.map_err(|error| error.to_string()))
        });
        // A file that was not read because of the caller is no problem of the file.
        monitor.check()?;
        Ok(Self {
            volume,
            golds,
            search: OrganSearch::default(),
        })
    }

    fn fit(
        &mut self,
        model: &CohortModel,
        parameters: &DeformParameters,
        monitor: &Monitor<'_>,
    ) -> Result<CohortFit, Cancelled> {
        let make = |search: &mut OrganSearch, volume: &Volume| {
            let fit = search.fit(volume, &model.ready, parameters, monitor);
            fit.map_err(|error| error.to_string())
        };
        self.measured(make, monitor)
    }

    fn fit_auto(
        &mut self,
        parameters: &DeformParameters,
        monitor: &Monitor<'_>,
    ) -> Result<CohortFit, Cancelled> {
        let make = |search: &mut OrganSearch, volume: &Volume| {
            let fit = fit_built_in(volume, parameters, search, monitor);
            fit.map_err(|error| error.to_string())
        };
        self.measured(make, monitor)
    }

    /// The fit that `make` makes of the volume, measured against the gold standards.
    fn measured(
        &mut self,
        make: impl FnOnce(&mut OrganSearch, &Volume) -> Result<Fit, String>,
        monitor: &Monitor<'_>,
    ) -> Result<CohortFit, Cancelled> {
        let without_fit = |outcome| Ok(CohortFit::without_fit(outcome));
        let volume = match &self.volume {
            Ok(volume) => volume,
            Err(reason) => return without_fit(FitOutcome::Unreadable(reason.clone())),
        };
        let made = make(&mut self.search, volume);
        // A fit that ended because of the caller is not lost.
        monitor.check()?;
        let fit = match made {
            Ok(fit) => fit,
            Err(reason) => return without_fit(FitOutcome::Lost(reason)),
        };
        let mask = voxelise(&fit.model.mesh, volume.shape, &volume.frame, monitor)?;
        let spacing = volume.frame.spacing();
        let agreements = (self.golds.each_ref())
            .map(|gold| compare(&mask, gold.as_ref()?.as_ref().ok()?, spacing, monitor).ok());
        monitor.check()?;
        Ok(CohortFit::new(&fit, agreements))
    }
}
