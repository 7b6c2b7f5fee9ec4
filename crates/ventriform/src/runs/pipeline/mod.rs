//! From a volume to a model: the stages in order.
//!
//! In: the files of a volume ([`generate`]), a volume that was read ([`from_reading`]) or a volume in
//! memory ([`generate_from`]), and [`ModelParameters`]. Out: a [`Model`]. The steps:
//!
//! 1. `volume` reads the files.
//! 2. `surface` extracts the iso-surface of the ventricle's wall.
//! 3. `retile` covers it with exactly N points, once for each start ([`starts`]).
//! 4. `optimise` fits the triangles and flips edges; the best start is kept.
//! 5. `report` measures the model.
//!
//! Guaranteed: a model is returned only if [`ModelReport::is_sound`]; otherwise there is an error.

pub mod starts;

use crate::base::progress::{Cancelled, Monitor, Stage};
use crate::heart::model::{TemplateError, cup_about_middle, wall_parts};
use crate::image::volume::Provenance;
use crate::image::volume::{
    self, ReadLimits, ReadOptions, Reading, Volume, VolumeError, VolumeFacts, VolumeFile,
};
use crate::mesh::TriMesh;
use crate::mesh::part::Part;
use crate::parameters::{ModelParameters, Parameters};
use crate::results::export::{Metadata, VertexField};
use crate::results::report::{
    self, Closeness, FileFacts, MeasuredSurface, ModelReport, ReportInput,
};
use crate::surface::optimise::{OptimiseError, Reference};
use crate::surface::retile::RetileError;
use crate::surface::{self, IsoLevel, Isolate, SurfaceError};

/// A model of one volume.
#[derive(Debug, Clone)]
pub struct Model {
    /// The model: exactly N vertices in LPS millimetres; closed, with outward-facing triangles.
    pub mesh: TriMesh,
    /// The iso-surface that the model approximates, LPS millimetres.
    pub reference: TriMesh,
    /// The part of the wall that each triangle of `mesh` is of; empty unless the model shows a left ventricle.
    pub parts: Vec<Part>,
    /// Figures about the model and how it was made.
    pub report: ModelReport,
    /// DICOM Frame of Reference UID of the volume, if it lies in one.
    pub frame_of_reference_uid: Option<String>,
}

impl Model {
    /// The metadata that mesh files store with the model.
    pub fn metadata(&self) -> Metadata {
        Metadata {
            frame_of_reference_uid: self.frame_of_reference_uid.clone(),
            quality: self.report.quality_summary(),
            parts: self.parts.clone(),
            ..Metadata::new("Left ventricle")
        }
    }

    /// The surface that the model approximates, ready to measure distances from it.
    pub fn measured_surface(&self) -> MeasuredSurface<'_> {
        MeasuredSurface::new(&self.reference)
    }

    /// The metadata with the distance of every vertex to its `surface`, which formats with colours show.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn metadata_with_distance(
        &self,
        surface: &MeasuredSurface<'_>,
        monitor: &Monitor,
    ) -> Result<Metadata, Cancelled> {
        let values = surface.of_vertices(&self.mesh, monitor)?;
        Ok(Metadata {
            field: Some(VertexField {
                name: "Distance",
                colours: report::vertex_colours(&values),
                values,
            }),
            ..self.metadata()
        })
    }

    /// Distances between the model and its surface, by which the page is coloured.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn closeness(&self, monitor: &Monitor) -> Result<Closeness, Cancelled> {
        self.measured_surface().closeness(&self.mesh, monitor)
    }

    /// The report as a self-contained HTML page, coloured by `closeness` if given. It names patient,
    /// study and series as far as `scan` does.
    pub fn report_html(&self, closeness: Option<&Closeness>, scan: Option<&Provenance>) -> String {
        report::model_page(&self.report, &self.mesh, closeness, scan)
    }
}

/// Why there is no model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PipelineError {
    /// The files contain no usable volume.
    #[error(transparent)]
    Volume(VolumeError),
    /// No surface could be extracted from the volume.
    #[error(transparent)]
    Surface(SurfaceError),
    /// The surface could not be re-tiled with these parameters.
    #[error(transparent)]
    Retile(RetileError),
    /// The mesh could not be optimised.
    #[error(transparent)]
    Optimise(OptimiseError),
    /// The finished model failed its checks.
    #[error("the model is not sound: {}", flags.join(" "))]
    Unsound {
        /// The failed checks, in sentences.
        flags: Vec<String>,
    },
    /// The caller cancelled the work.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl PipelineError {
    /// Whether the caller cancelled the work, in any stage.
    pub fn is_cancelled(&self) -> bool {
        matches!(
            self,
            PipelineError::Cancelled(_)
                | PipelineError::Volume(VolumeError::Cancelled(_))
                | PipelineError::Surface(SurfaceError::Cancelled(_))
                | PipelineError::Retile(RetileError::Cancelled(_))
                | PipelineError::Optimise(OptimiseError::Cancelled(_))
        )
    }

    /// The parameter or the header field that the error is about.
    pub fn field(&self) -> Option<&'static str> {
        match self {
            PipelineError::Volume(e) => e.field(),
            PipelineError::Surface(e) => e.field(),
            PipelineError::Retile(RetileError::Cancelled(_)) => None,
            PipelineError::Retile(_) => Some("points"),
            _ => None,
        }
    }
}

/// Makes a model of the volume in `files`.
///
/// # Errors
/// [`PipelineError`].
pub fn generate(
    files: &[VolumeFile],
    parameters: &ModelParameters,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Model, PipelineError> {
    let start = monitor.now_ms();
    let options = ReadOptions {
        frame: parameters.frame,
    };
    let mut reading = volume::read(files, &options, limits, monitor)
        .and_then(Reading::usable)
        .map_err(PipelineError::Volume)?;
    let told_apart = tell_apart(files, &mut reading, parameters, limits, monitor)?;
    let read_ms = monitor.now_ms() - start;
    let (volume, facts) = (&reading.volume, &reading.facts);
    Ok(Model {
        frame_of_reference_uid: reading.frame_of_reference().map(str::to_owned),
        ..from_volume(volume, facts, parameters, told_apart, read_ms, monitor)?
    })
}

/// Replaces labels beyond 2^24, which the volume's 32-bit floats do not tell apart, by 1 for the voxels
/// of the object's label and 0 for all others, and returns that label. Other volumes stay as they are.
fn tell_apart(
    files: &[VolumeFile],
    reading: &mut Reading,
    parameters: &ModelParameters,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Option<i64>, PipelineError> {
    if !volume::labels_are_rounded(reading) {
        return Ok(None);
    }
    let labels = reading.facts.intensity.labels.iter().flatten();
    let present: Vec<(i64, usize)> = labels.map(|l| (l.label, l.voxels as usize)).collect();
    let surface = &parameters.surface;
    let label = match (surface.isolate, &present[..]) {
        (Isolate::Label(label), _) => label,
        (Isolate::Auto, [(label, _)]) if surface.iso == IsoLevel::Auto => *label,
        (Isolate::Auto, [_, ..]) if surface.iso == IsoLevel::Auto => {
            return Err(PipelineError::Surface(SurfaceError::LabelNeeded {
                present,
            }));
        }
        _ => return Ok(None),
    };
    let carries = volume::voxels_of_label(files, reading, label, limits, monitor);
    let carries = carries.map_err(PipelineError::Volume)?;
    if !carries.contains(&true) {
        let error = SurfaceError::NoSuchLabel { label, present };
        return Err(PipelineError::Surface(error));
    }
    for (voxel, carries) in reading.volume.voxels.iter_mut().zip(carries) {
        *voxel = f32::from(u8::from(carries));
    }
    Ok(Some(label))
}

/// Makes a model of a volume in memory, for example one made by [`Volume::from_array`]. For a volume
/// from a file prefer [`generate`] or [`from_reading`], whose reports describe the file.
///
/// # Errors
/// [`PipelineError`].
pub fn generate_from(
    volume: &Volume,
    parameters: &ModelParameters,
    monitor: &Monitor,
) -> Result<Model, PipelineError> {
    let facts = volume::describe(volume).map_err(PipelineError::Volume)?;
    from_volume(volume, &facts, parameters, None, 0.0, monitor)
}

/// Makes a model of a volume that was read; `read_ms` is the time that reading took, for the report.
/// Labels beyond 2^24 are told apart by [`generate`] alone.
///
/// # Errors
/// [`PipelineError`].
pub fn from_reading(
    reading: &Reading,
    parameters: &ModelParameters,
    read_ms: f64,
    monitor: &Monitor,
) -> Result<Model, PipelineError> {
    let (volume, facts) = (&reading.volume, &reading.facts);
    Ok(Model {
        frame_of_reference_uid: reading.frame_of_reference().map(str::to_owned),
        ..from_volume(volume, facts, parameters, None, read_ms, monitor)?
    })
}

/// As [`from_reading`]. `told_apart` is the label for which a 1 stands in `volume`, if it is not the
/// volume of `facts` itself.
fn from_volume(
    volume: &Volume,
    facts: &VolumeFacts,
    parameters: &ModelParameters,
    told_apart: Option<i64>,
    read_ms: f64,
    monitor: &Monitor,
) -> Result<Model, PipelineError> {
    // All steps on a thread of the pool: from another one, each of some hundred parallel steps would be handed over and
    // waited for.
    rayon::scope(|_| {
        let mut laps = Laps::new(read_ms, monitor);
        let mut extracted = parameters.surface.clone();
        if told_apart.is_some() {
            extracted.isolate = Isolate::Label(1);
        }
        let surface = surface::extract(volume, &extracted, monitor);
        let mut surface = surface.map_err(PipelineError::Surface)?;
        if let Some(label) = told_apart {
            surface.facts.label = Some(label);
            surface.facts.range = [facts.intensity.minimum, facts.intensity.maximum].map(f64::from);
        }
        laps.end(Stage::Surface);
        // The two are independent.
        let (tiled, reference) = rayon::join(
            || starts::tile(&surface, parameters, monitor),
            || Reference::new(&surface),
        );
        let tiled = tiled.map_err(PipelineError::Retile)?;
        laps.end(Stage::Retile);
        let made = starts::best(tiled, &reference, parameters, monitor, |stage| {
            laps.end(stage)
        })
        .map_err(PipelineError::Optimise)?;
        let mut report = ModelReport::new(ReportInput {
            input: FileFacts::from_facts(facts),
            parameters: parameters.to_json(),
            surface: &surface,
            tiled: &made.tiled,
            optimised: &made.optimised,
            optimise_parameters: &parameters.optimise,
            measures: made.measures,
            starts: made.starts,
            timings_ms: laps.times,
        });
        if !report.is_sound() {
            return Err(PipelineError::Unsound {
                flags: report.warnings,
            });
        }
        report.warnings.splice(0..0, facts.warnings.iter().cloned());
        let mesh = made.optimised.mesh;
        Ok(Model {
            parts: parts(&mesh, parameters, facts, monitor)?,
            mesh,
            reference: surface.mesh,
            report,
            frame_of_reference_uid: None,
        })
    })
}

/// The parts of the wall of a left ventricle, which a model of a volume of intensities shows unless the caller
/// chose another structure.
fn parts(
    mesh: &TriMesh,
    parameters: &ModelParameters,
    facts: &VolumeFacts,
    monitor: &Monitor,
) -> Result<Vec<Part>, Cancelled> {
    if parameters.surface.isolate != Isolate::Auto || facts.intensity.labels.is_some() {
        return Ok(Vec::new());
    }
    // The long axis is found in the model alone, as that of a template is. A model without one has no parts.
    let parts = match cup_about_middle(mesh, monitor) {
        Ok(cup) => wall_parts(mesh, &cup, monitor)?,
        Err(TemplateError::Cancelled(cancelled)) => return Err(cancelled),
        Err(_) => None,
    };
    Ok(parts.unwrap_or_default())
}

/// Durations of the stages by the observer's clock.
struct Laps<'a, 'b> {
    monitor: &'a Monitor<'b>,
    last: f64,
    times: Vec<(String, f64)>,
}

impl<'a, 'b> Laps<'a, 'b> {
    fn new(read_ms: f64, monitor: &'a Monitor<'b>) -> Self {
        Self {
            monitor,
            last: monitor.now_ms(),
            times: vec![(Stage::Read.as_str().to_owned(), read_ms)],
        }
    }

    fn end(&mut self, stage: Stage) {
        let now = self.monitor.now_ms();
        self.times
            .push((stage.as_str().to_owned(), now - self.last));
        self.last = now;
    }
}
