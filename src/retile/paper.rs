//! The paper's route: repulsion, mutual tessellation, removal of the old vertices.

use super::domain::Domain;
use super::samples::Samples;
use super::tessellate::{TessellateError, tessellate};
use super::{
    RetileError, RetileFacts, RetileParameters, SurfacePoint, Tiled, placement, quotas, repulsion,
    sizing, too_few,
};
use crate::mesh::TriMesh;
use crate::progress::{Monitor, Stage};
use crate::surface::Surface;

/// Seeds tried before the surface is refused.
const SEEDS: u64 = 4;

/// Share of the stage that repulsion takes.
const REPULSION_SHARE: f64 = 0.6;

/// Re-tiles `surface` as the paper does.
pub(super) fn retile(
    surface: &Surface,
    parameters: &RetileParameters,
    monitor: &Monitor,
) -> Result<Tiled, RetileError> {
    let least = quotas::least_points(&surface.mesh);
    let job = Job::new(surface, parameters, monitor)?;
    if parameters.points < least {
        return Err(refusal(&job, None));
    }
    tile(&job, SEEDS)?.map_err(|error| refusal(&job, Some(error)))
}

/// The same where another route gave up: `None` where this one must, too, with so many seeds.
pub(super) fn attempt(
    surface: &Surface,
    parameters: &RetileParameters,
    seeds: u64,
    monitor: &Monitor,
) -> Result<Option<Tiled>, RetileError> {
    let job = Job::new(surface, parameters, monitor)?;
    Ok(tile(&job, seeds)?.ok())
}

/// Tries one seed after the other, at least one; the last one's failure where all fail.
fn tile(job: &Job, seeds: u64) -> Result<Result<Tiled, TessellateError>, RetileError> {
    let mut attempt = 0;
    loop {
        let points = spread(job, job.parameters.points, attempt)?;
        attempt += 1;
        match join(job, &points) {
            Ok(mesh) => {
                let facts = RetileFacts {
                    repulsion_rounds: job.parameters.repulsion_iterations,
                    attempts: attempt as usize,
                    ..RetileFacts::default()
                };
                let sizing = points
                    .iter()
                    .map(|p| job.domain.interpolate(&job.spacing, p))
                    .collect();
                return Ok(Ok(Tiled {
                    mesh,
                    sizing,
                    facts,
                }));
            }
            Err(TessellateError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(error) if attempt >= seeds => return Ok(Err(error)),
            Err(_) => {}
        }
    }
}

struct Job<'a> {
    surface: &'a Surface,
    parameters: &'a RetileParameters,
    monitor: &'a Monitor<'a>,
    /// W.
    domain: Domain,
    /// Relative spacing wanted at every vertex.
    spacing: Vec<f64>,
}

impl<'a> Job<'a> {
    fn new(
        surface: &'a Surface,
        parameters: &'a RetileParameters,
        monitor: &'a Monitor<'a>,
    ) -> Result<Self, RetileError> {
        let (mesh, working) = (&surface.mesh, &surface.working);
        let domain = Domain::new(working.clone(), mesh.triangles.clone())?;
        let samples = Samples::new(&mesh.vertices, working, &mesh.triangles, 0);
        Ok(Self {
            surface,
            parameters,
            monitor,
            domain,
            spacing: sizing::spacing(&samples, parameters, parameters.points),
        })
    }
}

/// Points after repulsion; `attempt` changes the seed.
fn spread(job: &Job, count: usize, attempt: u64) -> Result<Vec<SurfacePoint>, RetileError> {
    let seed = job.parameters.seed.wrapping_add(attempt << 32);
    let mut points = placement::place(&job.surface.mesh, &job.domain, &job.spacing, count, seed);
    repulsion::repel(
        &job.domain,
        &job.spacing,
        &mut points,
        job.parameters,
        |share| {
            if attempt == 0 {
                job.monitor.report(Stage::Retile, REPULSION_SHARE * share)
            } else {
                job.monitor.check()
            }
        },
    )?;
    Ok(points)
}

fn join(job: &Job, points: &[SurfacePoint]) -> Result<TriMesh, TessellateError> {
    let mesh = &job.surface.mesh;
    tessellate(&mesh.vertices, &mesh.triangles, points, job.monitor)
}

/// The error to give up with: for a topology that N points do not carry, a number that does.
fn refusal(job: &Job, last: Option<TessellateError>) -> RetileError {
    match last {
        Some(TessellateError::OpenSurface(defect)) => RetileError::OpenSurface(defect),
        Some(TessellateError::SelfIntersecting { pairs, mesh, .. }) => {
            let [t, _] = pairs[0];
            let [a, b, c] = mesh.corners(t as usize);
            RetileError::SelfIntersecting {
                points: job.parameters.points,
                place: ((a + b + c) / 3.0).into(),
            }
        }
        _ => too_few(job.surface, job.parameters, |larger| {
            let job = Job::new(job.surface, larger, job.monitor)?;
            match join(&job, &spread(&job, larger.points, 0)?) {
                Ok(_) => Ok(true),
                Err(TessellateError::Cancelled(cancelled)) => Err(cancelled.into()),
                Err(_) => Ok(false),
            }
        }),
    }
}
