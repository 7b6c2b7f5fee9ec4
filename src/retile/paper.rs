//! The paper's method: random points, repulsion, mutual tessellation, removal of the old vertices.
//!
//! In: the surface and N. Out: N points on it, joined to triangles, or the reason why not. If the
//! points cannot be joined, the next of several seeds is tried.

use super::domain::Domain;
use super::surface_samples::WeightedSamples;
use super::tessellate::{TessellateError, tessellate};
use super::{
    RetileError, RetileFacts, RetileParameters, SurfacePoint, Tiled, placement, quotas, repulsion,
    sizing, too_few,
};
use crate::mesh::TriMesh;
use crate::progress::{Monitor, Stage};
use crate::surface::Surface;

/// Number of seeds tried before re-tiling fails.
const SEEDS: u64 = 4;

/// Fraction of the stage's time that repulsion takes.
const REPULSION_SHARE: f64 = 0.6;

/// Re-tiles `surface` by the paper's method.
pub(super) fn retile(
    surface: &Surface,
    parameters: &RetileParameters,
    monitor: &Monitor,
) -> Result<Tiled, RetileError> {
    let least = quotas::least_points(&surface.mesh);
    let run = PaperRun::new(surface, parameters, monitor)?;
    if parameters.points < least {
        return Err(refusal(&run, None));
    }
    tile(&run, SEEDS)?.map_err(|error| refusal(&run, Some(error)))
}

/// Tries the paper's method with `seeds` seeds; `None` if it fails with all of them.
pub(super) fn attempt(
    surface: &Surface,
    parameters: &RetileParameters,
    seeds: u64,
    monitor: &Monitor,
) -> Result<Option<Tiled>, RetileError> {
    let run = PaperRun::new(surface, parameters, monitor)?;
    Ok(tile(&run, seeds)?.ok())
}

/// Tries one seed after the other, at least one. If all fail, the inner error is that of the
/// last.
fn tile(run: &PaperRun, seeds: u64) -> Result<Result<Tiled, TessellateError>, RetileError> {
    let mut attempt = 0;
    loop {
        let points = spread(run, run.parameters.points, attempt)?;
        attempt += 1;
        match join(run, &points) {
            Ok(mesh) => {
                let facts = RetileFacts {
                    repulsion_rounds: run.parameters.repulsion_iterations,
                    attempts: attempt as usize,
                    ..RetileFacts::default()
                };
                let sizing = points
                    .iter()
                    .map(|p| run.domain.interpolate(&run.spacing, p))
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

/// What all seeds share.
struct PaperRun<'a> {
    surface: &'a Surface,
    parameters: &'a RetileParameters,
    monitor: &'a Monitor<'a>,
    /// The smoothed surface W.
    domain: Domain,
    /// Wanted relative spacing at every vertex.
    spacing: Vec<f64>,
}

impl<'a> PaperRun<'a> {
    fn new(
        surface: &'a Surface,
        parameters: &'a RetileParameters,
        monitor: &'a Monitor<'a>,
    ) -> Result<Self, RetileError> {
        let (mesh, working) = (&surface.mesh, &surface.working);
        let domain = Domain::new(working.clone(), mesh.triangles.clone())?;
        let samples = WeightedSamples::new(&mesh.vertices, working, &mesh.triangles, 0);
        Ok(Self {
            surface,
            parameters,
            monitor,
            domain,
            spacing: sizing::spacing(&samples, parameters, parameters.points),
        })
    }
}

/// The points after repulsion; every `attempt` has its own seed.
fn spread(run: &PaperRun, count: usize, attempt: u64) -> Result<Vec<SurfacePoint>, RetileError> {
    let seed = run.parameters.seed.wrapping_add(attempt << 32);
    let mut points = placement::place(&run.surface.mesh, &run.domain, &run.spacing, count, seed);
    repulsion::repel(
        &run.domain,
        &run.spacing,
        &mut points,
        run.parameters,
        |share| {
            if attempt == 0 {
                run.monitor.report(Stage::Retile, REPULSION_SHARE * share)
            } else {
                run.monitor.check()
            }
        },
    )?;
    Ok(points)
}

fn join(run: &PaperRun, points: &[SurfacePoint]) -> Result<TriMesh, TessellateError> {
    let mesh = &run.surface.mesh;
    tessellate(&mesh.vertices, &mesh.triangles, points, run.monitor)
}

/// The error after the last seed failed. If N points are too few for the topology, it names a
/// number that suffices.
fn refusal(run: &PaperRun, last: Option<TessellateError>) -> RetileError {
    match last {
        Some(TessellateError::OpenSurface(defect)) => RetileError::OpenSurface(defect),
        Some(TessellateError::SelfIntersecting { pairs, mesh, .. }) => {
            let [t, _] = pairs[0];
            let [a, b, c] = mesh.corners(t.index());
            RetileError::SelfIntersecting {
                points: run.parameters.points,
                place: ((a + b + c) / 3.0).into(),
            }
        }
        _ => too_few(run.surface, run.parameters, |larger| {
            let run = PaperRun::new(run.surface, larger, run.monitor)?;
            match join(&run, &spread(&run, larger.points, 0)?) {
                Ok(_) => Ok(true),
                Err(TessellateError::Cancelled(cancelled)) => Err(cancelled.into()),
                Err(_) => Ok(false),
            }
        }),
    }
}
