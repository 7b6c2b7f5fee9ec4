//! A cohort's folder: who is in it, and in which files.
//!
//! Each case has a folder of its own with `spect.nii.gz` (or `.nii`, `.dcm`) and, where they are
//! known, the gold standards of [`Gold`], as volumes or as meshes (`.stl`, `.ply` ...). `manifest.json`, a list of
//! `{"case", "role"}` (or an object with such a list under `cases`), says which cases are templates: those with the
//! role `template`. Without a manifest, cases whose names begin with `t` are templates. A missing
//! file does not end the run: it is noted in [`Cohort::problems`].

use super::rows::Gold;
use crate::base::progress::Monitor;
use crate::image::grid::voxelise::Mask;
use crate::image::volume::given_mask::{GivenMaskError, MaskChoice, read_mask};
use crate::image::volume::{
    self, ReadLimits, ReadOptions, Reading, Volume, VolumeError, VolumeFile,
};
use crate::mesh::files::MeshFormat;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

/// Why a folder is no cohort.
#[derive(Debug, thiserror::Error)]
pub enum CohortError {
    /// The folder cannot be read.
    #[error("{}: {error}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// There is no template, or no patient.
    #[error(
        "{}: {templates} template and {patients} other cases with a spect.nii.gz; both are needed",
        folder.display()
    )]
    TooFewCases {
        /// The folder.
        folder: PathBuf,
        /// Templates with a scan.
        templates: usize,
        /// Other cases with a scan.
        patients: usize,
    },
    /// The template that was named for the manual mask does not exist or has no such mask.
    #[error("there is no template {name} with a {}", Gold::Expert.file())]
    NoManualMask {
        /// The name.
        name: String,
    },
}

/// A cohort's folder and its cases.
#[derive(Debug)]
pub struct Cohort {
    folder: PathBuf,
    /// Cases that models are made of, by name.
    pub templates: Vec<String>,
    /// Cases that models are fitted to, by name.
    pub patients: Vec<String>,
    /// The template whose model comes from its expert's mask, if any.
    pub manual: Option<String>,
    /// Which structure of the masks is meant, and whether masks on other grids are resampled.
    pub masks: MaskChoice,
    /// Cases, and what is wrong with each.
    pub problems: Vec<(String, String)>,
}

/// Name of a scan's file without its ending.
const SCAN_STEM: &str = "spect";

impl Cohort {
    /// Reads the manifest and the names of the files of `folder`. `manual` names the template
    /// whose model is to come from the expert's mask. Default, as in the paper (two scans by
    /// threshold, one manual mask, one phantom): the third template, if it has such a mask.
    ///
    /// # Errors
    /// [`CohortError`].
    pub fn open(folder: &Path, manual: Option<&str>) -> Result<Self, CohortError> {
        let mut cohort = Self {
            folder: folder.to_path_buf(),
            templates: Vec::new(),
            patients: Vec::new(),
            manual: None,
            masks: MaskChoice::default(),
            problems: Vec::new(),
        };
        let roles = cohort.roles();
        for name in cohort.names(&roles)? {
            if cohort.file(&name, SCAN_STEM).is_none() {
                cohort.problem(&name, "it has no spect.nii.gz");
                continue;
            }
            let is_template = match &roles {
                Some(roles) => roles.get(&name).is_some_and(|r| r == "template"),
                None => name.starts_with('t'),
            };
            if is_template {
                cohort.templates.push(name);
            } else {
                cohort.patients.push(name);
            }
        }
        cohort.choose_manual(manual)?;
        for name in cohort.patients.clone() {
            for gold in Gold::ALL {
                if cohort.gold(&name, gold).is_none() {
                    cohort.problem(&name, &format!("it has no {}", gold.file()));
                }
            }
        }
        if cohort.templates.is_empty() || cohort.patients.is_empty() {
            return Err(CohortError::TooFewCases {
                folder: cohort.folder,
                templates: cohort.templates.len(),
                patients: cohort.patients.len(),
            });
        }
        Ok(cohort)
    }

    /// Makes templates patients, too: each is judged by the models of the others.
    pub fn judge_templates(&mut self) {
        self.patients.extend(self.templates.iter().cloned());
        self.patients.sort();
        self.patients.dedup();
    }

    fn problem(&mut self, case: &str, what: &str) {
        self.problems.push((case.to_owned(), what.to_owned()));
    }

    /// The cases of the manifest and of the folder, sorted by name.
    fn names(&self, roles: &Option<BTreeMap<String, String>>) -> Result<Vec<String>, CohortError> {
        let unreadable = |error| CohortError::Folder {
            folder: self.folder.clone(),
            error,
        };
        let mut names: Vec<String> = roles.iter().flat_map(|r| r.keys().cloned()).collect();
        for entry in std::fs::read_dir(&self.folder).map_err(unreadable)? {
            let name = entry
                .map_err(unreadable)?
                .file_name()
                .to_string_lossy()
                .into_owned();
            let stems = [SCAN_STEM, "lv_truth", "lv_expert_img"];
            if stems.iter().any(|stem| self.file(&name, stem).is_some()) {
                names.push(name);
            }
        }
        names.sort();
        names.dedup();
        Ok(names)
    }

    /// The role of every case of the manifest; `None` without a readable manifest.
    fn roles(&mut self) -> Option<BTreeMap<String, String>> {
        let path = self.folder.join("manifest.json");
        if !path.is_file() {
            return None;
        }
        let parsed = std::fs::read(&path)
            .map_err(|e| e.to_string())
            .and_then(|text| serde_json::from_slice(&text).map_err(|e| e.to_string()));
        let manifest: Value = match parsed {
            Ok(manifest) => manifest,
            Err(error) => {
                let what =
                    format!("cannot be read ({error}); templates are recognised by their names");
                self.problem("manifest.json", &what);
                return None;
            }
        };
        let Some(cases) = manifest.get("cases").unwrap_or(&manifest).as_array() else {
            self.problem(
                "manifest.json",
                "holds no list of cases; templates are recognised by their names",
            );
            return None;
        };
        let role = |c: &Value| {
            let name = c["case"].as_str()?;
            // A name must not lead out of the cohort's folder.
            let plain = !name.is_empty() && !name.contains(['/', '\\']) && name != "..";
            plain.then(|| {
                (
                    name.to_owned(),
                    c["role"].as_str().unwrap_or_default().to_owned(),
                )
            })
        };
        Some(cases.iter().filter_map(role).collect())
    }

    fn choose_manual(&mut self, asked: Option<&str>) -> Result<(), CohortError> {
        let has_mask = |name: &String| self.gold(name, Gold::Expert).is_some();
        self.manual = match asked {
            Some(name) => {
                let found = self.templates.iter().find(|t| *t == name).cloned();
                let missing = || CohortError::NoManualMask { name: name.into() };
                Some(found.filter(has_mask).ok_or_else(missing)?)
            }
            None => self.templates.get(2).cloned().filter(has_mask),
        };
        Ok(())
    }

    /// The file `stem` of a case, in the first format that exists.
    fn file(&self, case: &str, stem: &str) -> Option<PathBuf> {
        case_file(&self.folder, case, stem)
    }

    /// A case's scan.
    pub fn scan(&self, case: &str) -> Option<PathBuf> {
        self.file(case, SCAN_STEM)
    }

    /// A case's gold standard.
    pub fn gold(&self, case: &str, gold: Gold) -> Option<PathBuf> {
        mask_file(&self.folder, case, gold.file().strip_suffix(".nii.gz")?)
    }

    /// Source of a template's model: the file and its kind.
    pub fn source(&self, template: &str) -> Option<(PathBuf, &'static str)> {
        if self.manual.as_deref() == Some(template) {
            let mask = self.gold(template, Gold::Expert)?;
            Some((mask, "the expert's manual mask"))
        } else {
            Some((self.scan(template)?, "the scan, by threshold"))
        }
    }

    /// Reads the file that a template's model is made of; of a mask, the structure of
    /// [`Cohort::masks`].
    ///
    /// # Errors
    /// [`GivenMaskError`], of a scan always [`GivenMaskError::File`].
    pub fn read_source(
        &self,
        template: &str,
        path: &Path,
        monitor: &Monitor,
    ) -> Result<Reading, GivenMaskError> {
        let mut reading = read_volume(path, monitor).map_err(GivenMaskError::File)?;
        if self.manual.as_deref() == Some(template) {
            let (files, limits) = ([VolumeFile::at(path)], ReadLimits::default());
            let mask = read_mask(&files, &self.masks, &limits, monitor)?;
            reading.volume = mask.to_volume();
        }
        Ok(reading)
    }
}

/// Reads the mask in `files` and brings it to the grid of `volume`.
///
/// # Errors
/// [`GivenMaskError`].
pub fn mask_on(
    files: &[VolumeFile],
    choice: &MaskChoice,
    volume: &Volume,
    monitor: &Monitor,
) -> Result<Mask, GivenMaskError> {
    let grid = (volume.shape, &volume.frame);
    let given = read_mask(files, choice, &ReadLimits::default(), monitor)?;
    Ok(given.on(grid, choice.resample, monitor)?.mask)
}

/// The file `stem` of the folder `case` in `folder`, in the first format that exists.
pub fn case_file(folder: &Path, case: &str, stem: &str) -> Option<PathBuf> {
    ["nii.gz", "nii", "dcm"]
        .iter()
        .map(|ending| folder.join(case).join(format!("{stem}.{ending}")))
        .find(|path| path.is_file())
}

/// The mask `stem` of the folder `case` in `folder`: a volume, or a mesh.
pub fn mask_file(folder: &Path, case: &str, stem: &str) -> Option<PathBuf> {
    case_file(folder, case, stem).or_else(|| {
        MeshFormat::FILE_EXTENSIONS
            .iter()
            .map(|ending| folder.join(case).join(format!("{stem}.{ending}")))
            .find(|path| path.is_file())
    })
}

/// Reads a volume of a cohort: a file of one frame.
///
/// # Errors
/// [`VolumeError`].
pub fn read_volume(path: &Path, monitor: &Monitor) -> Result<Reading, VolumeError> {
    let (options, limits) = (ReadOptions::default(), ReadLimits::default());
    volume::read(&[VolumeFile::at(path)], &options, &limits, monitor)
}

#[cfg(test)]
mod tests {
    use crate::runs::evaluate::cohort::*;

    fn folder_of(files: &[&str], manifest: Option<&str>) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"").unwrap();
        }
        if let Some(text) = manifest {
            std::fs::write(folder.path().join("manifest.json"), text).unwrap();
        }
        folder
    }

    const CASE_FILES: [&str; 6] = [
        "t1/spect.nii.gz",
        "t1/lv_expert_img.nii.gz",
        "b/spect.nii",
        "b/lv_truth.nii.gz",
        "c/lv_truth.nii.gz",
        "notes/readme.txt",
    ];

    #[test]
    fn without_a_manifest_names_decide() {
        let folder = folder_of(&CASE_FILES, None);
        let cohort = Cohort::open(folder.path(), None).unwrap();
        assert_eq!(
            (&cohort.templates[..], &cohort.patients[..]),
            (&["t1".to_owned()][..], &["b".to_owned()][..])
        );
        let cases: Vec<&str> = cohort.problems.iter().map(|p| p.0.as_str()).collect();
        assert_eq!(cases, ["c", "b"], "{:?}", cohort.problems);
        assert_eq!(cohort.manual, None);
        let manual = Cohort::open(folder.path(), Some("t1")).unwrap().manual;
        assert_eq!(manual.as_deref(), Some("t1"));
        assert!(Cohort::open(folder.path(), Some("b")).is_err());
    }

    #[test]
    fn a_manifest_decides_and_its_missing_cases_are_named() {
        let text = r#"[{"case":"b","role":"template"},{"case":"t1","role":"test"},
                       {"case":"gone","role":"test"},{"case":"../x","role":"test"}]"#;
        let folder = folder_of(&CASE_FILES, Some(text));
        let cohort = Cohort::open(folder.path(), None).unwrap();
        assert_eq!(cohort.templates, ["b"]);
        assert_eq!(cohort.patients, ["t1"]);
        assert!(cohort.problems.iter().any(|p| p.0 == "gone"));
        assert!(!cohort.problems.iter().any(|p| p.0.contains('x')));
    }

    #[test]
    fn a_broken_manifest_is_a_problem_and_not_the_end() {
        let folder = folder_of(&CASE_FILES, Some("{"));
        let cohort = Cohort::open(folder.path(), None).unwrap();
        assert_eq!(cohort.templates, ["t1"]);
        assert_eq!(cohort.problems[0].0, "manifest.json");
        let lone = folder_of(&CASE_FILES[..1], None);
        assert!(Cohort::open(lone.path(), None).is_err());
    }
}
