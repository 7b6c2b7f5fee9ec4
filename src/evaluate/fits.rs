//! Every model fitted to every patient, in parallel over the patients.

use crate::cli::Bar;
use crate::deform::{DeformError, DeformParameters, Place, fit_at};
use crate::evaluate::cohort::{Cohort, read_volume};
use crate::evaluate::models::Model;
use crate::evaluate::record;
use crate::evaluate::record::Key;
use crate::evaluate::rows::{Agreed, Gold, Outcome, Row};
use crate::evaluate::table::rounded;
use crate::export::{self, Format, Metadata};
use crate::geometry::Vec3;
use crate::grid::agreement::compare;
use crate::grid::voxelise::{Mask, voxelise};
use crate::locate::cup::Cup;
use crate::mesh::TriMesh;
use crate::progress::Monitor;
use crate::segmentation::on_grid;
use crate::segmentation::slices;
use crate::segmentation::slices::Cut;
use crate::volume::Volume;
use anyhow::{Context, Result};
use rayon::prelude::*;
use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What became of one fit. All numbers are [`rounded`], so that a result is the same whether
/// it was just made or read again.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// How it went.
    pub outcome: Outcome,
    /// Agreement with [`Gold::ALL`].
    pub agreed: [Option<Agreed>; 2],
    /// What the fit says of itself.
    pub figures: BTreeMap<String, f64>,
    /// The long axis.
    pub cup: Option<Cup>,
    /// The fitted nodes, LPS mm.
    pub vertices: Vec<Vec3>,
}

/// All fits of one patient.
pub struct Patient {
    /// Its name.
    pub case: String,
    /// Which gold standards it has.
    pub golds: [bool; 2],
    /// One for each model, in the models' order.
    pub fits: Vec<Fitted>,
    /// What is the matter with its files.
    pub problems: Vec<String>,
}

impl Patient {
    /// Its rows of the table.
    pub fn rows<'a>(&'a self, models: &'a [Model]) -> impl Iterator<Item = Row> + 'a {
        models.iter().zip(&self.fits).map(|(model, fitted)| Row {
            template: model.template.clone(),
            kind: model.kind,
            case: self.case.clone(),
            outcome: fitted.outcome.clone(),
            agreed: fitted.agreed,
            golds: self.golds,
            figures: fitted.figures.clone(),
        })
    }
}

/// Fits all `models` to all patients of `cohort`; `folder` keeps what is done.
pub fn run(
    cohort: &Cohort,
    models: &[Model],
    parameters: &DeformParameters,
    folder: &Path,
    bar: &Bar,
) -> Result<Vec<Patient>> {
    let program = Key::of_this_program();
    let done = AtomicUsize::new(0);
    let all = (cohort.patients.len() * models.len()).max(1);
    let advance = || {
        let count = 1 + done.fetch_add(1, Ordering::Relaxed);
        bar.show("fit", count as f64 / all as f64);
    };
    cohort
        .patients
        .par_iter()
        // One patient is one piece of work: they take long, and not equally long.
        .with_max_len(1)
        .map(|case| {
            let files = Files::read(cohort, case)?;
            let key = files.add_to(program.clone());
            let key = key.and(format!("{parameters:?}").as_bytes());
            let desk = Desk {
                case,
                folder,
                parameters,
                key,
            };
            desk.fit_all(&files, models, &advance)
        })
        .collect()
}

/// A patient's files as they lie on disk.
struct Files {
    scan: std::result::Result<Vec<u8>, String>,
    golds: [Option<Vec<u8>>; 2],
    paths: [Option<std::path::PathBuf>; 3],
}

impl Files {
    fn read(cohort: &Cohort, case: &str) -> Result<Self> {
        let scan = cohort.scan(case);
        let bytes = match &scan {
            Some(path) => std::fs::read(path).map_err(|e| e.to_string()),
            None => Err("its scan is gone".to_owned()),
        };
        let paths = Gold::ALL.map(|gold| cohort.gold(case, gold));
        let golds = paths.clone().map(|p| p.and_then(|p| std::fs::read(p).ok()));
        let [expert, truth] = paths;
        Ok(Self {
            scan: bytes,
            golds,
            paths: [scan, expert, truth],
        })
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

/// One patient's work.
struct Desk<'a> {
    case: &'a str,
    folder: &'a Path,
    parameters: &'a DeformParameters,
    key: Key,
}

impl Desk<'_> {
    fn fit_all(&self, files: &Files, models: &[Model], advance: &impl Fn()) -> Result<Patient> {
        // Read when the first fit is needed that is not there yet.
        let mut scene: Option<Scene> = None;
        let mut patient = Patient {
            case: self.case.to_owned(),
            golds: files.golds.each_ref().map(Option::is_some),
            fits: Vec::new(),
            problems: Vec::new(),
        };
        for model in models {
            let name = format!("{}_{}", self.case, model.name());
            let path = self.folder.join(format!("{name}.json"));
            let key = self.key.clone().and(&model.json).text();
            let fitted = match record::read(&path, &key) {
                Some(kept) => kept,
                None => {
                    let scene = scene.get_or_insert_with(|| Scene::read(files));
                    let fitted = scene.fit(model, self.parameters);
                    self.write_mesh(&name, model, &fitted)?;
                    record::write(&path, &key, &fitted)?;
                    fitted
                }
            };
            patient.fits.push(fitted);
            advance();
        }
        patient.note_problems(models);
        Ok(patient)
    }

    /// The fitted mesh, for `ventriform statistics` and whoever wants to look at it.
    fn write_mesh(&self, name: &str, model: &Model, fitted: &Fitted) -> Result<()> {
        if fitted.vertices.is_empty() {
            return Ok(());
        }
        let mesh = fitted.mesh(model);
        let title = format!("{} fitted to {}", model.name(), self.case);
        let bytes = export::encode(Format::Json, &mesh, &Metadata::new(title))?;
        record::write_file(&self.folder.join(format!("{name}.mesh.json")), &bytes)
    }
}

impl Patient {
    /// Says which fits were lost, and once what every fit of the patient complains of.
    fn note_problems(&mut self, models: &[Model]) {
        for (model, fitted) in models.iter().zip(&self.fits) {
            let problem = match &fitted.outcome {
                Outcome::Fitted(_) => None,
                Outcome::Lost(reason) => Some(format!("{} lost: {reason}", model.name())),
                Outcome::Unreadable(reason) => Some(format!("not read: {reason}")),
            };
            let gold = Gold::ALL.into_iter().filter_map(|gold| {
                let unusable = self.golds[gold as usize]
                    && fitted.agreed[gold as usize].is_none()
                    && matches!(fitted.outcome, Outcome::Fitted(_));
                unusable.then(|| format!("{} cannot be used", gold.file()))
            });
            for problem in problem.into_iter().chain(gold) {
                if !self.problems.contains(&problem) {
                    self.problems.push(problem);
                }
            }
        }
    }
}

impl Fitted {
    /// The fitted mesh.
    pub fn mesh(&self, model: &Model) -> TriMesh {
        TriMesh {
            vertices: self.vertices.clone(),
            triangles: model.ready.mesh.triangles.clone(),
        }
    }

    fn without_fit(outcome: Outcome) -> Self {
        Self {
            outcome,
            agreed: [None; 2],
            figures: BTreeMap::new(),
            cup: None,
            vertices: Vec::new(),
        }
    }
}

/// A patient's volume with its gold standards on the same grid.
pub struct Scene {
    volume: std::result::Result<Volume, String>,
    golds: [Option<Mask>; 2],
    /// Where the ventricle is, once it was looked for.
    place: OnceCell<std::result::Result<Place, DeformError>>,
}

impl Scene {
    fn read(files: &Files) -> Self {
        let [scan, golds @ ..] = &files.paths;
        let volume = match (scan, &files.scan) {
            (Some(path), Ok(_)) => read_volume(path).map(|r| r.volume).map_err(|e| {
                // The path is the case's; the reason is what matters.
                format!("{}", e.root_cause())
            }),
            (_, Err(reason)) => Err(reason.clone()),
            (None, Ok(_)) => Err("its scan is gone".to_owned()),
        };
        let golds = golds.each_ref().map(|path| {
            let mask = read_volume(path.as_ref()?).ok()?.volume;
            on_grid(&mask, volume.as_ref().ok()?, &Monitor::silent()).ok()
        });
        Self {
            volume,
            golds,
            place: OnceCell::new(),
        }
    }

    fn fit(&self, model: &Model, parameters: &DeformParameters) -> Fitted {
        let volume = match &self.volume {
            Ok(volume) => volume,
            Err(reason) => return Fitted::without_fit(Outcome::Unreadable(reason.clone())),
        };
        let silent = Monitor::silent();
        let place = self
            .place
            .get_or_init(|| Place::find(volume, &model.ready, parameters, &silent));
        let found = match place
            .as_ref()
            .map_err(Clone::clone)
            .and_then(|place| fit_at(place, volume, &model.ready, parameters, &silent))
        {
            Ok(found) => found,
            Err(error) => return Fitted::without_fit(Outcome::Lost(error.to_string())),
        };
        let mask = voxelise(&found.mesh, volume.shape, &volume.frame);
        let spacing = volume.frame.spacing();
        let agreed = self.golds.each_ref().map(|gold| {
            let a = compare(&mask, gold.as_ref()?, spacing, &silent).ok()?;
            Some(Agreed {
                jaccard: rounded(a.jaccard),
                contour_voxels: a.contours.map(|c| rounded(c.mean_voxels)),
                contour_mm: a.contours.map(|c| rounded(c.mean_mm)),
                dice: rounded(a.dice),
                hausdorff95_mm: a.contours.map(|c| rounded(c.hausdorff95_mm)),
            })
        });
        let mut figures = BTreeMap::from([
            ("confidence", found.confidence),
            ("merit", found.merit()),
            ("iterations", found.iterations as f64),
            ("self_intersections", found.self_intersections as f64),
            ("wall_ml", found.wall_ml),
            ("flags", found.flags.len() as f64),
        ]);
        if let Some(wall) = &found.wall {
            figures.insert("cavity_ml", wall.cavity_ml);
        }
        let figures = figures
            .into_iter()
            .filter(|(_, value)| value.is_finite())
            .map(|(name, value)| (name.to_owned(), rounded(value)))
            .collect();
        Fitted {
            outcome: Outcome::Fitted(found.reason.as_str().to_owned()),
            agreed,
            figures,
            cup: found.cup.map(|c| Cup {
                centre: c.centre.map(rounded),
                axis: c.axis.map(rounded),
                length: rounded(c.length),
                breadth: rounded(c.breadth),
            }),
            vertices: found.mesh.vertices.iter().map(|v| v.map(rounded)).collect(),
        }
    }
}

/// The picture of a patient with one of its fits; `None` where there is none to show.
pub fn picture(
    cohort: &Cohort,
    case: &str,
    model: &Model,
    fitted: &Fitted,
) -> Result<Option<Vec<u8>>> {
    let (Some(cup), Some(scan)) = (&fitted.cup, cohort.scan(case)) else {
        return Ok(None);
    };
    let volume = read_volume(&scan)
        .context("the scan was readable a moment ago")?
        .volume;
    let expert = cohort.gold(case, Gold::Expert).and_then(|path| {
        on_grid(
            &read_volume(&path).ok()?.volume,
            &volume,
            &Monitor::silent(),
        )
        .ok()
    });
    let mesh = fitted.mesh(model);
    let (cut, silent) = (Cut::heart(cup, &Vec3::z()), Monitor::silent());
    let png = slices::png(&volume, &mesh, &cut, expert.as_ref(), &silent)?;
    Ok(Some(png))
}
