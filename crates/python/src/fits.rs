//! `segment`, `beat` and `compare`: the commands with the same steps, and their files.

use crate::arrays::{affine, mesh, positions, voxels};
use crate::errors::{Stopped, refused, stopped};
use crate::files::{Files, formats, named, unwritable};
use crate::given::{GivenModel, GivenModels, files, normals, reader};
use crate::run::{How, run};
use crate::values::{table, with_fit};
use crate::volumes::NativeVolume;
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use ventriform::base::progress::Plan;
use ventriform::image::volume::{Provenance, ReadLimits, VolumeError};
use ventriform::mesh::files::MeshStatement;
use ventriform::parameters::{BeatChoice, ComparisonChoice, FitParameters, SerialChoice};
use ventriform::results::export::Part;
use ventriform::results::export::dicom::{Deidentification, Moment, StatedIdentity};
use ventriform::runs::gated::{self, GatedOrder};
use ventriform::runs::objects::{self, ObjectChoice, ObjectError};
use ventriform::runs::rest_stress::{self, ComparisonOrder};
use ventriform::runs::segmentation::{self, SegmentationOrder};
use ventriform::runs::serial::{self, SerialOrder};

/// The inputs of a fit beside its parameters.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct FitOrder {
    /// The models to fit.
    model: Vec<GivenModel>,
    /// The formats of the meshes' files.
    formats: Vec<String>,
    /// Parts of the wall that become files of their own.
    parts: Vec<String>,
    /// The text of normal limits to compare with.
    normals: Option<Vec<u8>>,
    /// An expert's mask.
    expert: Option<Py<NativeVolume>>,
    /// Name and text of a reader's profile.
    reader: Option<(String, Vec<u8>)>,
    /// Whether the page names nobody.
    deidentify: bool,
    /// The DICOM objects to make.
    dicom: Option<GivenObjects>,
}

/// What is stated of DICOM objects.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct GivenObjects {
    /// Patient and study, by the names of [`StatedIdentity`]'s fields, as JSON.
    stated: String,
    /// The secret that new UIDs are derived from, if the identity is to be removed.
    secret: Option<Vec<u8>>,
    /// Date and time, as DICOM writes them, UTC.
    made: (String, String),
}

impl FitOrder {
    /// The choice of DICOM objects, and what is stated of patient and study for the page; nothing if that names nobody.
    fn objects(&mut self) -> Result<(Option<ObjectChoice>, Option<StatedIdentity>), Stopped> {
        let Some(given) = self.dicom.take() else {
            return Ok((None, (!self.deidentify).then(StatedIdentity::default)));
        };
        let stated: StatedIdentity = serde_json::from_str(&given.stated)
            .map_err(|error| Stopped::Failed(refused("dicom", error, "")))?;
        let (date, time) = given.made;
        let choice = ObjectChoice {
            stated: stated.clone(),
            deidentify: given.secret.map(|secret| Deidentification { secret }),
            made: Moment { date, time },
        };
        Ok((Some(choice), (!self.deidentify).then_some(stated)))
    }
}

/// What fails if an identity is unknown.
fn unordered(error: ObjectError) -> Stopped {
    stopped(&error)
}

fn files_of(py: Python<'_>, files: Files) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    for (name, bytes) in files {
        dict.set_item(name, PyBytes::new(py, &bytes))?;
    }
    Ok(dict)
}

/// The left ventricle, or another organ, of the volume.
#[pyfunction]
#[pyo3(signature = (volume, order, parameters, how))]
pub fn segment<'py>(
    py: Python<'py>,
    volume: Py<NativeVolume>,
    mut order: FitOrder,
    parameters: &Bound<'py, PyDict>,
    how: How<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let parameters: FitParameters = table(parameters)?;
    let objects = order.objects();
    let scan = &volume.get().files;
    let expert = order.expert.map(|expert| expert.get().files.clone());
    let (given, profile, limits_given) =
        (GivenModels::new(order.model), order.reader, order.normals);
    let (names, parts) = (order.formats, order.parts);
    let (made, files) = run(py, Plan::SEGMENTATION, &how, |monitor| {
        let (objects, stated) = objects?;
        let limits = ReadLimits::default();
        let formats = formats(&names)?;
        let objects = objects.map(|o| o.order(scan, parameters.frame, &limits, monitor));
        let objects = objects.transpose().map_err(unordered)?;
        let (auto, models) = given.read(&parameters.mask.mesh, monitor)?;
        let normals = normals(limits_given)?;
        let whose =
            found(stated.map(|s| objects::whose(scan, parameters.frame, &s, &limits, monitor)))?;
        let order = SegmentationOrder {
            volume: scan,
            expert: expert.as_deref(),
            auto,
            models,
            reader: reader(profile)?,
            normals: normals.as_ref(),
            parameters: &parameters,
        };
        let made = segmentation::from_files(&order, &limits, monitor);
        let made = made.map_err(|error| stopped(&error))?;
        let mut files = made.files(&formats, None, monitor).map_err(unwritable)?;
        for name in &parts {
            let part = Part::named(name).ok_or_else(|| no_part(name))?;
            let cut = made.part_files(part, &formats, monitor);
            files.extend(cut.map_err(unwritable)?);
        }
        files.push(made.page(&files, whose.as_ref()));
        if let Some(order) = objects {
            let objects = made.dicom_files(&order.source_scan(&made));
            files.extend(objects.map_err(|error| stopped(&error))?);
        }
        Ok((made, named(files)))
    })?;
    let segmentation = made.segmentation;
    let fit = &segmentation.fit.model;
    let edge = made.parameters.deform.edge;
    let volume = &made.reading.volume;
    let result = PyDict::new(py);
    result.set_item("files", files_of(py, files)?)?;
    result.set_item("affine", affine(&volume.frame))?;
    result.set_item("shown", edge.as_str())?;
    result.set_item("mesh", mesh(py, &fit.mesh)?)?;
    if let (Some(surface), Some(mask)) = (fit.other_surface(edge), segmentation.other_mask) {
        result.set_item("other", edge.other().as_str())?;
        result.set_item("other_mesh", mesh(py, &surface.mesh)?)?;
        result.set_item("other_mask", voxels(py, mask.voxels, volume.shape)?)?;
    }
    let mask = segmentation.mask.voxels;
    result.set_item("mask", voxels(py, mask, volume.shape)?)?;
    Ok(result)
}

fn no_part(name: &str) -> Stopped {
    let words = Part::ALL.map(Part::as_str).join(", ");
    let reason = format!("`{name}` is no part of a wall");
    Stopped::Failed(refused("parts", reason, &format!("Give some of {words}.")))
}

/// One wall in motion of the gates.
#[pyfunction]
#[pyo3(signature = (gates, order, parameters, how))]
pub fn beat<'py>(
    py: Python<'py>,
    gates: Vec<Py<NativeVolume>>,
    mut order: FitOrder,
    parameters: &Bound<'py, PyDict>,
    how: How<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let parameters = with_fit::<BeatChoice>(parameters)?;
    let objects = order.objects();
    let gates = files(&gates);
    let (given, limits_given) = (GivenModels::new(order.model), order.normals);
    let names = order.formats;
    let (made, files) = run(py, Plan::BEAT, &how, |monitor| {
        let (objects, stated) = objects?;
        let limits = ReadLimits::default();
        let formats = formats(&names)?;
        let objects = objects.map(|o| o.order_of_gates(&gates, &limits, monitor));
        let objects = objects.transpose().map_err(unordered)?;
        let whose = found(stated.map(|s| objects::whose_gates(&gates, &s, &limits, monitor)))?;
        let (auto, models) = given.read(&MeshStatement::default(), monitor)?;
        let normals = normals(limits_given)?;
        let order = GatedOrder {
            gates: &gates,
            auto,
            models,
            normals: normals.as_ref(),
            parameters: &parameters.fit,
            choice: parameters.choice,
        };
        let made = gated::from_files(&order, &limits, monitor);
        let made = made.map_err(|error| stopped(&error))?;
        let mut files = made.files(&formats, monitor).map_err(unwritable)?;
        files.push(made.page(&files, whose.as_ref()));
        if let Some(order) = objects {
            let objects = made.dicom_files(&order.of_beat(&made));
            files.extend(objects.map_err(|error| stopped(&error))?);
        }
        Ok((made, named(files)))
    })?;
    let result = PyDict::new(py);
    result.set_item("files", files_of(py, files)?)?;
    if let Some(gate) = made.reading.gates.first() {
        result.set_item("affine", affine(&gate.frame))?;
    }
    let meshes = made.meshes.iter();
    let vertices: Vec<Bound<'py, PyArray2<f64>>> = meshes
        .map(|mesh| positions(py, &mesh.vertices))
        .collect::<PyResult<_>>()?;
    result.set_item("vertices", vertices)?;
    if let Some(first) = made.meshes.first() {
        result.set_item("faces", crate::arrays::corners(py, &first.triangles)?)?;
    }
    Ok(result)
}

/// Whose scan a page names, if it names somebody.
fn found(
    whose: Option<Result<Option<Provenance>, VolumeError>>,
) -> Result<Option<Provenance>, Stopped> {
    let whose = whose.transpose().map_err(|error| stopped(&error))?;
    Ok(whose.flatten())
}

/// Rest and stress of one patient.
#[pyfunction]
#[pyo3(signature = (stress, rest, order, parameters, how))]
pub fn compare<'py>(
    py: Python<'py>,
    stress: Vec<Py<NativeVolume>>,
    rest: Vec<Py<NativeVolume>>,
    mut order: FitOrder,
    parameters: &Bound<'py, PyDict>,
    how: How<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let parameters = with_fit::<ComparisonChoice>(parameters)?;
    let objects = order.objects();
    let (stress, rest) = (files(&stress), files(&rest));
    let (given, limits_given) = (GivenModels::new(order.model), order.normals);
    let names = order.formats;
    let files = run(py, Plan::COMPARISON, &how, |monitor| {
        let (objects, stated) = objects?;
        let limits = ReadLimits::default();
        let formats = formats(&names)?;
        let objects = objects.map(|o| o.order_of_pair([&stress, &rest], &limits, monitor));
        let objects = objects.transpose().map_err(unordered)?;
        let whose = found(stated.map(|s| objects::whose_either(&stress, &s, &limits, monitor)))?;
        let (auto, models) = given.read(&MeshStatement::default(), monitor)?;
        let normals = normals(limits_given)?;
        let order = ComparisonOrder {
            stress: &stress,
            rest: &rest,
            auto,
            models,
            normals: normals.as_ref(),
            parameters: &parameters,
        };
        let made = rest_stress::from_files(&order, &limits, monitor);
        let made = made.map_err(|error| stopped(&error))?;
        let mut files = made.files(&formats, monitor).map_err(unwritable)?;
        files.push(made.page(&files, whose.as_ref()));
        if let Some([stress, rest]) = objects {
            let scans = [
                stress.of_compared(&made.stress),
                rest.of_compared(&made.rest),
            ];
            let objects = made.dicom_files(&scans, &files);
            files.extend(objects.map_err(|error| stopped(&error))?);
        }
        Ok(named(files))
    })?;
    let result = PyDict::new(py);
    result.set_item("files", files_of(py, files)?)?;
    Ok(result)
}

/// Scans of one patient over the years.
#[pyfunction]
#[pyo3(name = "serial", signature = (scans, order, parameters, how))]
pub fn serial_comparison<'py>(
    py: Python<'py>,
    scans: Vec<Vec<Py<NativeVolume>>>,
    mut order: FitOrder,
    parameters: &Bound<'py, PyDict>,
    how: How<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let parameters = with_fit::<SerialChoice>(parameters)?;
    let objects = order.objects();
    let scans: Vec<_> = scans.iter().map(|scan| files(scan)).collect();
    let (given, limits_given) = (GivenModels::new(order.model), order.normals);
    let names = order.formats;
    let files = run(py, Plan::SERIAL, &how, |monitor| {
        let (objects, stated) = objects?;
        let limits = ReadLimits::default();
        let formats = formats(&names)?;
        let objects = objects.map(|o| o.order_of_scans(&scans, &limits, monitor));
        let objects = objects.transpose().map_err(unordered)?;
        let whose = stated.zip(scans.first());
        let whose =
            found(whose.map(|(s, first)| objects::whose_either(first, &s, &limits, monitor)))?;
        let (auto, models) = given.read(&MeshStatement::default(), monitor)?;
        let normals = normals(limits_given)?;
        let order = SerialOrder {
            scans: &scans,
            auto,
            models,
            normals: normals.as_ref(),
            parameters: &parameters,
        };
        let made = serial::from_files(&order, &limits, monitor);
        let made = made.map_err(|error| stopped(&error))?;
        let mut files = made.files(&formats, monitor).map_err(unwritable)?;
        files.push(made.page(&files, whose.as_ref()));
        if let Some(orders) = objects {
            let objects = made.dicom_files(&objects::of_serial(&orders, &made));
            files.extend(objects.map_err(|error| stopped(&error))?);
        }
        Ok(named(files))
    })?;
    let result = PyDict::new(py);
    result.set_item("files", files_of(py, files)?)?;
    Ok(result)
}
