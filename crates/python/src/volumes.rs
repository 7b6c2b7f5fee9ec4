//! Volumes that Python holds: files, bytes or arrays.

use crate::arrays::{affine, voxels};
use crate::errors::{exception, refused, stopped};
use crate::run::{How, run};
use crate::values::table;
use numpy::{PyArray3, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;
use std::sync::OnceLock;
use ventriform::base::progress::Plan;
use ventriform::image::grid::{Affine, ArrayError, Volume};
use ventriform::image::reconstruct::Reconstruction;
use ventriform::image::volume::{self, ReadLimits, ReadOptions, VolumeFacts, VolumeFile};
use ventriform::results::report::FileFacts;

/// A volume, or the gates of a study. Its files are read when somebody asks for what is in them.
#[pyclass(frozen, module = "ventriform._native")]
pub struct NativeVolume {
    /// Its files, or its arrays in their place.
    pub files: Vec<VolumeFile>,
    facts: OnceLock<VolumeFacts>,
}

impl NativeVolume {
    fn new(files: Vec<VolumeFile>) -> Self {
        let facts = OnceLock::new();
        Self { files, facts }
    }

    /// The facts about the files, every voxel of which is decoded the first time.
    fn known(&self, py: Python<'_>) -> PyResult<&VolumeFacts> {
        self.known_by(py, &How::default())
    }

    fn known_by(&self, py: Python<'_>, how: &How<'_>) -> PyResult<&VolumeFacts> {
        if let Some(facts) = self.facts.get() {
            return Ok(facts);
        }
        let facts = run(py, Plan::SEGMENTATION, how, |monitor| {
            let facts = volume::inspect(&self.files, &ReadLimits::default(), monitor);
            facts.map_err(|error| stopped(&error))
        })?;
        Ok(self.facts.get_or_init(|| facts))
    }
}

/// The volume of projections, or those of their gates, reconstructed as the parameters say.
#[pyfunction]
#[pyo3(signature = (volume, parameters, summed, how))]
pub fn reconstruct(
    py: Python<'_>,
    volume: Py<NativeVolume>,
    parameters: &Bound<'_, PyDict>,
    summed: bool,
    how: How<'_>,
) -> PyResult<NativeVolume> {
    let parameters: Reconstruction = table(parameters)?;
    let files = &volume.get().files;
    let made = run(py, Plan::SEGMENTATION, &how, |monitor| {
        let limits = ReadLimits::default();
        let made = volume::reconstructed(files, &parameters, summed, &limits, monitor);
        made.map_err(|error| stopped(&error))
    })?;
    let volumes = VolumeFile::of_arrays("the reconstruction", made.volumes);
    Ok(NativeVolume::new(vec![volumes]))
}

/// Voxels and their affine to LPS mm.
type PlacedVoxels<'py> = (Bound<'py, PyArray3<f32>>, [[f64; 4]; 4]);

#[pymethods]
impl NativeVolume {
    /// The volume in files; a folder stands for the files in it.
    #[staticmethod]
    fn from_paths(py: Python<'_>, paths: Vec<PathBuf>) -> PyResult<Self> {
        let files = run(py, Plan::SEGMENTATION, &How::default(), |_| {
            VolumeFile::given(&paths, &ReadLimits::default()).map_err(|error| stopped(&error))
        })?;
        Ok(Self::new(files))
    }

    /// The volume in files of these names and bytes.
    #[staticmethod]
    fn from_bytes(files: Vec<(String, Vec<u8>)>) -> Self {
        let files = files.into_iter();
        let files = files.map(|(name, bytes)| VolumeFile::in_memory(name, bytes));
        Self::new(files.collect())
    }

    /// The voxels of an array (i, j, k), or (i, j, k, gate), in Fortran order; `lps` is the affine to LPS mm.
    #[staticmethod]
    fn from_array(
        py: Python<'_>,
        array: PyReadonlyArrayDyn<'_, f32>,
        lps: [[f64; 4]; 4],
    ) -> PyResult<Self> {
        let shape = array.shape().to_vec();
        let spatial: Option<[usize; 3]> = shape.get(..3).and_then(|s| s.try_into().ok());
        let refuse = |reason: String| {
            let fix = "Give an array (i, j, k), or (i, j, k, gate), with at least one voxel.";
            exception(py, &refused("array", reason, fix))
        };
        let (Some(spatial), true) = (spatial, shape.len() <= 4 && !shape.contains(&0)) else {
            return Err(refuse(format!("the array has the shape {shape:?}")));
        };
        let values = match array.as_slice() {
            Ok(values) if array.is_fortran_contiguous() => values,
            _ => return Err(refuse("the array is not in Fortran order".into())),
        };
        let volumes = values.chunks(spatial.iter().product());
        let volumes = volumes.map(|voxels| {
            let made = Volume::from_array(voxels.to_vec(), spatial, Affine::Lps(lps));
            made.map_err(|error| {
                let field = match error {
                    ArrayError::LastRow { .. } | ArrayError::Affine(_) => "affine",
                    _ => "array",
                };
                let fix = match field {
                    "affine" => "Give an invertible 4x4 matrix from voxel indices to millimetres.",
                    _ => "Use NaN for missing values.",
                };
                exception(py, &refused(field, error, fix))
            })
        });
        let volumes: Vec<Volume> = volumes.collect::<PyResult<_>>()?;
        Ok(Self::new(vec![VolumeFile::of_arrays("the array", volumes)]))
    }

    /// Name and path, or name and bytes, of each of the files; none for arrays.
    fn files<'py>(&self, py: Python<'py>) -> PyResult<Vec<(String, Bound<'py, PyAny>)>> {
        let stored = self.files.iter().filter_map(|file| {
            let content = match (file.path(), file.memory()) {
                (Some(path), _) => path.as_os_str().into_bound_py_any(py),
                (None, Some(bytes)) => Ok(PyBytes::new(py, bytes).into_any()),
                (None, None) => return None,
            };
            Some(content.map(|content| (file.name().to_owned(), content)))
        });
        stored.collect()
    }

    /// Decodes every voxel, so that files that cannot be used are refused.
    fn inspect(&self, py: Python<'_>, how: How<'_>) -> PyResult<()> {
        self.known_by(py, &how).map(|_| ())
    }

    /// Format, values and place, as JSON.
    fn facts(&self, py: Python<'_>) -> PyResult<String> {
        let facts = FileFacts::from_facts(self.known(py)?);
        Ok(serde_json::to_string(&facts).unwrap_or_default())
    }

    /// Warnings about the files.
    fn warnings(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        Ok(self.known(py)?.warnings.clone())
    }

    /// Voxels along i, j, k.
    fn shape(&self, py: Python<'_>) -> PyResult<[usize; 3]> {
        Ok(self.known(py)?.shape)
    }

    /// Number of volumes.
    fn frames(&self, py: Python<'_>) -> PyResult<usize> {
        Ok(self.known(py)?.frames)
    }

    /// The affine from voxel indices to LPS mm, by rows.
    fn affine(&self, py: Python<'_>) -> PyResult<[[f64; 4]; 4]> {
        let matrix = &self.known(py)?.affine_lps;
        Ok([0, 1, 2, 3].map(|r| [0, 1, 2, 3].map(|c| matrix[(r, c)])))
    }

    /// The voxels of a frame, or of the only volume, or of the sum of the gates; and their affine.
    #[pyo3(signature = (frame=None))]
    fn voxels<'py>(&self, py: Python<'py>, frame: Option<usize>) -> PyResult<PlacedVoxels<'py>> {
        let read = run(py, Plan::SEGMENTATION, &How::default(), |monitor| {
            let options = ReadOptions { frame };
            let read = volume::read(&self.files, &options, &ReadLimits::default(), monitor);
            Ok(read.map_err(|error| stopped(&error))?.volume)
        })?;
        let place = affine(&read.frame);
        Ok((voxels(py, read.voxels, read.shape)?, place))
    }
}
