//! The stages in order: from the files of a volume to a model.
//!
//! [`generate`] reads, surfaces, re-tiles, optimises and measures: the stage calls in order,
//! nothing else. The stages guarantee what they hand on; the last look is
//! [`Report::is_sound`], and a model that is not sound is an error, never a result.

pub mod starts;

use crate::export::Metadata;
use crate::mesh::TriMesh;
use crate::optimise::{OptimiseError, Reference};
use crate::parameters::{ModelParameters, Parameters};
use crate::progress::{Cancelled, Monitor, Stage};
use crate::report::{self, Closeness, Report, ReportInput};
use crate::retile::RetileError;
use crate::surface::{self, SurfaceError};
use crate::volume::{self, ReadLimits, ReadOptions, Reading, VolumeError, VolumeFile};

/// A finished model.
#[derive(Debug, Clone)]
pub struct Model {
    /// Exactly N vertices, LPS millimetres, closed, facing outward.
    pub mesh: TriMesh,
    /// The iso-surface that it stands for.
    pub reference: TriMesh,
    /// What it is worth.
    pub report: Report,
}

impl Model {
    /// What a mesh file says of the model besides the mesh.
    pub fn metadata(&self) -> Metadata {
        Metadata {
            quality: self.report.quality_summary(),
            ..Metadata::new("Left ventricle")
        }
    }

    /// How far it lies from its surface, place by place: what the page is coloured by.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn closeness(&self, monitor: &Monitor) -> Result<Closeness, Cancelled> {
        Closeness::of(&self.mesh, &self.reference, monitor)
    }

    /// The report as a self-contained page; with `closeness`, also coloured by it.
    pub fn report_html(&self, closeness: Option<&Closeness>) -> String {
        report::html(&self.report, &self.mesh, closeness)
    }
}

/// Which stage failed, and why.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PipelineError {
    /// The files hold no usable volume.
    #[error(transparent)]
    Volume(VolumeError),
    /// The volume has no usable surface.
    #[error(transparent)]
    Surface(SurfaceError),
    /// The surface cannot be re-tiled as asked.
    #[error(transparent)]
    Retile(RetileError),
    /// The mesh cannot be optimised.
    #[error(transparent)]
    Optimise(OptimiseError),
    /// The model broke a promise; it is withheld.
    #[error("the model is not sound: {}", doubts.join(" "))]
    Unsound {
        /// What is wrong with it, in sentences.
        doubts: Vec<String>,
    },
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl PipelineError {
    /// Whether the work ended because it was asked to, in whichever stage.
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

    /// The parameter, or the field of the file, that the error is about.
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
/// See [`PipelineError`].
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
    let reading = volume::read(files, &options, limits, monitor).map_err(PipelineError::Volume)?;
    let read_ms = monitor.now_ms() - start;
    from_reading(&reading, parameters, read_ms, monitor)
}

/// Makes a model of a volume in memory; `read_ms` is what reading took, for the report.
///
/// # Errors
/// See [`PipelineError`].
pub fn from_reading(
    reading: &Reading,
    parameters: &ModelParameters,
    read_ms: f64,
    monitor: &Monitor,
) -> Result<Model, PipelineError> {
    let mut laps = Laps::new(read_ms, monitor);
    let surface = surface::extract(&reading.volume, &parameters.surface, monitor)
        .map_err(PipelineError::Surface)?;
    laps.end(Stage::Surface);
    // Neither needs the other.
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
    let mut report = Report::new(ReportInput {
        input: report::input(&reading.facts),
        parameters: parameters.to_json().into(),
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
            doubts: report.warnings,
        });
    }
    report
        .warnings
        .splice(0..0, reading.facts.warnings.iter().cloned());
    Ok(Model {
        mesh: made.optimised.mesh,
        reference: surface.mesh,
        report,
    })
}

/// Times of the stages by the observer's clock.
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
