//! The inputs of a fit beside its parameters: models, a reader's profile, normal limits, other volumes.

use crate::errors::{Stopped, refused, stopped};
use crate::models::NativeModel;
use crate::volumes::NativeVolume;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use ventriform::base::progress::Monitor;
use ventriform::heart::normals::NormalLimits;
use ventriform::heart::reader::ReaderProfile;
use ventriform::image::volume::{ReadLimits, VolumeFile};
use ventriform::mesh::files::{self, MeshFileError, MeshStatement};
use ventriform::parameters::FitParameters;
use ventriform::runs::advice::advice;
use ventriform::runs::segmentation::{NamedMesh, NamedReader};

/// A model to fit: `auto`, the path of a mesh, or a model with its name.
#[derive(FromPyObject)]
pub enum GivenModel {
    /// A model in memory.
    Made(String, Py<NativeModel>),
    /// The word for the built-in hearts, or a path.
    Path(PathBuf),
}

/// Models to fit, that can be read without the interpreter.
pub struct GivenModels {
    auto: bool,
    models: Vec<ModelSource>,
}

enum ModelSource {
    Path(PathBuf),
    Mesh(NamedMesh),
}

impl GivenModels {
    /// The models of `given`.
    pub fn new(given: Vec<GivenModel>) -> Self {
        let is_auto = |path: &Path| path.as_os_str() == FitParameters::AUTO_MODEL;
        let mut auto = false;
        let mut models = Vec::new();
        for model in given {
            match model {
                GivenModel::Path(path) if is_auto(&path) => auto = true,
                GivenModel::Path(path) => models.push(ModelSource::Path(path)),
                GivenModel::Made(name, model) => models.push(ModelSource::Mesh(NamedMesh {
                    name,
                    mesh: model.get().model.mesh.clone(),
                    required: true,
                })),
            }
        }
        Self { auto, models }
    }

    /// Whether the built-in hearts are fitted, and the others, read.
    pub fn read(
        self,
        stated: &MeshStatement,
        monitor: &Monitor<'_>,
    ) -> Result<(bool, Vec<NamedMesh>), Stopped> {
        let read = self.models.into_iter().map(|model| match model {
            ModelSource::Mesh(mesh) => Ok(mesh),
            ModelSource::Path(path) => mesh(&path, stated, monitor),
        });
        Ok((self.auto, read.collect::<Result<_, _>>()?))
    }
}

fn mesh(path: &Path, stated: &MeshStatement, monitor: &Monitor<'_>) -> Result<NamedMesh, Stopped> {
    let limit = ReadLimits::default().mesh_bytes;
    let size = std::fs::metadata(path)
        .map_err(|error| unreadable("model", path, &error))?
        .len();
    if size > limit {
        let reason = format!("{}: the file has {size} bytes", path.display());
        let fix = format!("A mesh may have {limit} bytes.");
        return Err(Stopped::Failed(refused("model", reason, &fix)));
    }
    let bytes = std::fs::read(path).map_err(|error| unreadable("model", path, &error))?;
    let read = files::read_where_silent(&bytes, stated, limit, monitor);
    let read = read.map_err(|error| match error {
        MeshFileError::Cancelled(cancelled) => Stopped::from(cancelled),
        error => {
            let reason = format!("{}: {error}", path.display());
            Stopped::Failed(refused("model", reason, &advice(&error)))
        }
    })?;
    Ok(NamedMesh {
        name: stem(path),
        mesh: read.mesh,
        required: true,
    })
}

fn stem(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or(path.as_os_str());
    stem.to_string_lossy().into_owned()
}

fn unreadable(field: &str, path: &Path, error: &std::io::Error) -> Stopped {
    let reason = format!("{}: {error}", path.display());
    Stopped::Failed(refused(
        field,
        reason,
        "Give the path of a file that can be read.",
    ))
}

/// A reader's profile with its name, from the text that `calibrate` makes.
pub fn reader(given: Option<(String, Vec<u8>)>) -> Result<Option<NamedReader>, Stopped> {
    given
        .map(|(name, text)| {
            let profile = ReaderProfile::from_json(&text).map_err(|error| stopped(&error))?;
            Ok(NamedReader { name, profile })
        })
        .transpose()
}

/// Normal limits, from the text that `normals build` makes.
pub fn normals(given: Option<Vec<u8>>) -> Result<Option<NormalLimits>, Stopped> {
    let read = |text: Vec<u8>| NormalLimits::from_json(&text).map_err(|error| stopped(&error));
    given.map(read).transpose()
}

/// The files of several volumes that Python holds.
pub fn files(volumes: &[Py<NativeVolume>]) -> Vec<VolumeFile> {
    let each = volumes.iter().map(|volume| volume.get().files.as_slice());
    each.flatten().cloned().collect()
}
