//! `generate`, and the models that it makes.

use crate::arrays::{self, MeshArrays};
use crate::errors::{Stopped, broken, exception, refused, stopped};
use crate::files::formats;
use crate::run::{How, run};
use crate::values::table;
use crate::volumes::NativeVolume;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use ventriform::base::progress::{Monitor, Plan};
use ventriform::image::volume::{self, Provenance, ReadLimits, ReadOptions};
use ventriform::mesh::part::Part;
use ventriform::parameters::ModelParameters;
use ventriform::results::export::open_part::open_part;
use ventriform::results::export::{self, Format, Metadata};
use ventriform::runs::pipeline::{self, Model};

/// A model, with whose scan it is of.
#[pyclass(frozen, module = "ventriform._native")]
pub struct NativeModel {
    /// The model.
    pub model: Model,
    /// The description that its files hold, with the distance of every vertex to the surface.
    metadata: Metadata,
    scan: Option<Provenance>,
}

/// The content of a model's pickle: vertices and triangles of the model and of its surface, the part of each triangle,
/// the report, the Frame of Reference UID, and whose scan it is.
type ModelState = (
    [(Vec<[f64; 3]>, Vec<[u32; 3]>); 2],
    Vec<u8>,
    String,
    Option<String>,
    Option<String>,
);

impl NativeModel {
    fn new(model: Model, scan: Option<Provenance>, monitor: &Monitor<'_>) -> Result<Self, Stopped> {
        let surface = model.measured_surface();
        let metadata = model.metadata_with_distance(&surface, monitor)?;
        Ok(Self {
            model,
            metadata,
            scan,
        })
    }
}

/// A model of the volume.
#[pyfunction]
#[pyo3(signature = (volume, parameters, how))]
pub fn generate(
    py: Python<'_>,
    volume: Py<NativeVolume>,
    parameters: &Bound<'_, PyDict>,
    how: How<'_>,
) -> PyResult<NativeModel> {
    let parameters: ModelParameters = table(parameters)?;
    let files = &volume.get().files;
    run(py, Plan::GENERATION, &how, |monitor| {
        let limits = ReadLimits::default();
        let made = pipeline::generate(files, &parameters, &limits, monitor);
        let model = made.map_err(|error| stopped(&error))?;
        let options = ReadOptions {
            frame: parameters.frame,
        };
        let scan = volume::provenance(files, &options, &limits, monitor);
        NativeModel::new(model, scan.map_err(|error| stopped(&error))?, monitor)
    })
}

#[pymethods]
impl NativeModel {
    /// Vertices, LPS mm, and triangles.
    fn mesh<'py>(&self, py: Python<'py>) -> PyResult<MeshArrays<'py>> {
        arrays::mesh(py, &self.model.mesh)
    }

    /// The iso-surface that the model approximates.
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<MeshArrays<'py>> {
        arrays::mesh(py, &self.model.reference)
    }

    /// The number of the part of the wall that each triangle is of; empty for other objects.
    fn parts(&self) -> Vec<u8> {
        self.model.parts.iter().map(|part| part.number()).collect()
    }

    /// The report as JSON.
    fn report(&self) -> String {
        self.model.report.to_json_text()
    }

    /// The report as a page; without patient, study and series if `deidentify`.
    fn page(&self, py: Python<'_>, deidentify: bool) -> PyResult<String> {
        run(py, Plan::GENERATION, &How::default(), |monitor| {
            let closeness = self.model.closeness(monitor)?;
            let scan = self.scan.as_ref().filter(|_| !deidentify);
            Ok(self.model.report_html(Some(&closeness), scan))
        })
    }

    /// The bytes of the model's file in a format, or of one part of it.
    #[pyo3(signature = (format, part=None))]
    fn encode(&self, py: Python<'_>, format: String, part: Option<String>) -> PyResult<Vec<u8>> {
        run(py, Plan::GENERATION, &How::default(), |_| {
            let [format] = formats(&[format])?[..] else {
                return Err(Stopped::Cancelled);
            };
            let (mesh, metadata) = match part {
                None => (self.model.mesh.clone(), self.metadata.clone()),
                Some(name) => {
                    let part = Part::named(&name).ok_or_else(|| {
                        let words = Part::ALL.map(Part::as_str).join(", ");
                        let reason = format!("`{name}` is no part of a wall");
                        Stopped::Failed(refused("part", reason, &format!("Give one of {words}.")))
                    })?;
                    open_part(&self.model.mesh, &self.metadata, part).ok_or_else(|| {
                        let reason = "only models of a left ventricle's wall have parts";
                        Stopped::Failed(refused("part", reason, "Leave it out."))
                    })?
                }
            };
            encoded(format, &mesh, &metadata)
        })
    }

    /// The content of a pickle.
    fn state(&self) -> PyResult<ModelState> {
        let flat = |mesh: &ventriform::TriMesh| {
            let vertices = mesh.vertices.iter().map(|p| [p.x, p.y, p.z]);
            (vertices.collect(), mesh.triangles.clone())
        };
        let scan = self.scan.as_ref().map(serde_json::to_string).transpose();
        Ok((
            [flat(&self.model.mesh), flat(&self.model.reference)],
            self.parts(),
            self.report(),
            self.model.frame_of_reference_uid.clone(),
            scan.unwrap_or_default(),
        ))
    }

    /// The model that a pickle holds.
    #[staticmethod]
    fn restored(py: Python<'_>, state: ModelState) -> PyResult<Self> {
        let ([mesh, reference], parts, report, uid, scan) = state;
        let unusable = |reason: String| {
            let fix = "Unpickle with the version that pickled it.";
            exception(py, &refused("pickle", reason, fix))
        };
        let report = serde_json::from_str(&report).map_err(|e| unusable(e.to_string()))?;
        let scan = scan.as_deref().map(serde_json::from_str).transpose();
        let part = |number: u8| Part::ALL.into_iter().find(|part| part.number() == number);
        let model = Model {
            mesh: arrays::to_mesh(py, &mesh.0, &mesh.1)?,
            reference: arrays::to_mesh(py, &reference.0, &reference.1)?,
            parts: parts.into_iter().filter_map(part).collect(),
            report,
            frame_of_reference_uid: uid,
        };
        let scan = scan.map_err(|e| unusable(e.to_string()))?;
        run(py, Plan::GENERATION, &How::default(), |monitor| {
            Self::new(model, scan, monitor)
        })
    }
}

fn encoded(
    format: Format,
    mesh: &ventriform::TriMesh,
    metadata: &Metadata,
) -> Result<Vec<u8>, Stopped> {
    export::encode(format, mesh, metadata).map_err(|error| Stopped::Failed(broken(error)))
}
