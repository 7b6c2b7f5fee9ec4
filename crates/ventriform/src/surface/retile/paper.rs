//! The paper's method: random points, repulsion, mutual tessellation, removal of the old vertices.
//!
//! In: the surface and N. Out: N points on it, joined to triangles, or the reason why not. If the
//! points cannot be joined, the next of several seeds is tried.
//!
//! The new mesh then replaces the old one and the procedure is repeated until the result is good:
//! the points of the last mesh push each other again with the full force of the first round, and
//! are joined anew. It ends when [`MAX_STALE_REPEATS`] repetitions in a row have not raised the mean radius
//! ratio 2r/R of the best mesh by a fraction of [`LEAST_RISE`] together, or after
//! [`RetileParameters::repeats`]; the best mesh is kept. Unlike in the paper's words the points stay
//! on the surface S: a mesh of N points that takes the place of S cuts off its bulges, and each
//! repetition would lose 12, 5 and 2.5 % of the volume at N = 67, 150 and 300.

use super::domain::Domain;
use super::surface_samples::WeightedSamples;
use super::tessellate::{TessellateError, tessellate};
use super::{
    RetileError, RetileFacts, RetileParameters, SurfacePoint, Tiled, placement, quotas, repulsion,
    sizing, too_few,
};
use crate::base::progress::{Cancelled, Monitor, Stage};
use crate::mesh::TriMesh;
use crate::surface::Surface;

/// Number of seeds tried before re-tiling fails.
const MAX_SEEDS: u64 = 4;

/// Fraction of the stage's time that repulsion takes.
const REPULSION_SHARE: f64 = 0.6;

/// Number of repetitions in a row without a rise after which the result is good.
const MAX_STALE_REPEATS: usize = 3;

/// Smallest relative rise of the mean radius ratio that counts.
const LEAST_RISE: f64 = 0.002;

/// Re-tiles `surface` by the paper's method.
pub(super) fn retile(
    surface: &Surface,
    parameters: &RetileParameters,
    monitor: &Monitor,
) -> Result<Tiled, RetileError> {
    let least = quotas::least_points(surface);
    let run = PaperRun::new(surface, parameters, monitor)?;
    if parameters.points < least {
        return Err(refusal(&run, None));
    }
    tile(&run, MAX_SEEDS)?.map_err(|error| refusal(&run, Some(error)))
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
                let best = repeat(run, points, mesh)?;
                let facts = RetileFacts {
                    repulsion_rounds: run.parameters.repulsion_iterations,
                    repeats: best.repeats,
                    attempts: attempt as usize,
                    ..RetileFacts::default()
                };
                let sizing = best
                    .points
                    .iter()
                    .map(|p| run.domain.interpolate(&run.spacing, p))
                    .collect();
                return Ok(Ok(Tiled {
                    mesh: best.mesh,
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

/// The best mesh of all repetitions.
struct BestTiling {
    points: Vec<SurfacePoint>,
    mesh: TriMesh,
    /// Its mean radius ratio.
    ratio: f64,
    /// Number of repetitions that were run.
    repeats: usize,
}

/// Repeats repulsion and tessellation from the points of the last mesh until the result is good.
fn repeat(
    run: &PaperRun,
    points: Vec<SurfacePoint>,
    mesh: TriMesh,
) -> Result<BestTiling, RetileError> {
    let mut last = points.clone();
    let mut best = BestTiling {
        ratio: mean_radius_ratio(&mesh),
        points,
        mesh,
        repeats: 0,
    };
    // The ratio that a rise is measured from, and the repetitions since.
    let (mut from, mut waited) = (best.ratio, 0);
    while best.repeats < run.parameters.repeats && waited < MAX_STALE_REPEATS {
        best.repeats += 1;
        waited += 1;
        push_apart(run, &mut last, |_| run.monitor.check())?;
        let mesh = match join(run, &last) {
            Ok(mesh) => mesh,
            Err(TessellateError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(_) => continue,
        };
        let ratio = mean_radius_ratio(&mesh);
        if ratio > best.ratio {
            best.points.clone_from(&last);
            (best.mesh, best.ratio) = (mesh, ratio);
        }
        if best.ratio > from * (1.0 + LEAST_RISE) {
            (from, waited) = (best.ratio, 0);
        }
    }
    Ok(best)
}

fn mean_radius_ratio(mesh: &TriMesh) -> f64 {
    mesh.radius_ratios().sum::<f64>() / mesh.triangles.len() as f64
}

/// Input that all seeds share.
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
            spacing: sizing::spacing(&samples, parameters, parameters.points, monitor)?,
        })
    }
}

/// The points after repulsion; every `attempt` has its own seed.
fn spread(run: &PaperRun, count: usize, attempt: u64) -> Result<Vec<SurfacePoint>, RetileError> {
    let seed = run.parameters.seed.wrapping_add(attempt << 32);
    let mut points = placement::place(&run.surface.mesh, &run.domain, &run.spacing, count, seed);
    push_apart(run, &mut points, |share| {
        if attempt == 0 {
            run.monitor.report(Stage::Retile, REPULSION_SHARE * share)
        } else {
            run.monitor.check()
        }
    })?;
    Ok(points)
}

/// All rounds of repulsion, from full force on.
fn push_apart(
    run: &PaperRun,
    points: &mut Vec<SurfacePoint>,
    tick: impl Fn(f64) -> Result<(), Cancelled> + Sync,
) -> Result<(), Cancelled> {
    repulsion::repel(&run.domain, &run.spacing, points, run.parameters, tick)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::mesh::{FaceId, shapes};
    use crate::surface::from_mesh;
    use crate::surface::retile::tessellate::test_surfaces::{moved, together};

    fn ball() -> Surface {
        from_mesh(shapes::icosphere(20.0, 2), 1.0).expect("closed")
    }

    fn parameters(repeats: usize) -> RetileParameters {
        RetileParameters {
            points: 40,
            repulsion_iterations: 4,
            repeats,
            ..RetileParameters::default()
        }
    }

    #[test]
    fn the_mean_radius_ratio_is_that_of_all_triangles() {
        assert!((mean_radius_ratio(&shapes::icosphere(3.0, 0)) - 1.0).abs() < 1e-12);
        let mut mesh = shapes::tetrahedron(1.0);
        mesh.vertices[0] *= 3.0;
        let ratios = [0, 1, 2, 3].map(|t| {
            let [a, b, c] = mesh.corners(t);
            let sides = [(a - b).norm(), (b - c).norm(), (c - a).norm()];
            let half = sides.iter().sum::<f64>() / 2.0;
            let area = mesh.area_normal(t).norm() / 2.0;
            let (inscribed, circumscribed) =
                (area / half, sides.iter().product::<f64>() / 4.0 / area);
            2.0 * inscribed / circumscribed
        });
        assert!((mean_radius_ratio(&mesh) - ratios.iter().sum::<f64>() / 4.0).abs() < 1e-12);
    }

    /// All repetitions one after the other, and when and with which of them the procedure ends by its rules.
    #[test]
    fn the_procedure_is_repeated_until_the_triangles_no_longer_improve() {
        let surface = from_mesh(shapes::icosphere(20.0, 1), 1.0).unwrap();
        let mut ended = [0; 2];
        for seed in 0..4 {
            let parameters = RetileParameters {
                points: 20,
                seed,
                repulsion_iterations: 4 + 6 * (seed % 2) as usize,
                ..parameters(10)
            };
            let monitor = Monitor::silent();
            let run = PaperRun::new(&surface, &parameters, &monitor).unwrap();
            let start = spread(&run, 20, 0).unwrap();
            let mut meshes = vec![(start.clone(), join(&run, &start).unwrap())];
            let mut points = start.clone();
            for _ in 0..10 {
                push_apart(&run, &mut points, |_| Ok(())).unwrap();
                meshes.push((points.clone(), join(&run, &points).unwrap()));
            }
            let ratios: Vec<f64> = meshes.iter().map(|m| mean_radius_ratio(&m.1)).collect();
            let best_until = |n: usize| ratios[..=n].iter().copied().fold(0.0, f64::max);
            let mut risen = 0;
            let mut expected = 10;
            for n in 1..=10 {
                if best_until(n) > best_until(risen) * (1.0 + LEAST_RISE) {
                    risen = n;
                } else if n == risen + MAX_STALE_REPEATS {
                    expected = n;
                    break;
                }
            }
            let best = repeat(&run, start, meshes[0].1.clone()).unwrap();
            assert_eq!(best.repeats, expected, "{ratios:?}");
            assert_eq!(best.ratio, best_until(expected));
            let which = ratios.iter().position(|r| *r == best.ratio).unwrap();
            assert_eq!(
                (&best.points, &best.mesh),
                (&meshes[which].0, &meshes[which].1)
            );
            ended[usize::from(expected < 10)] += 1;
        }
        assert!(ended[1] > 1, "{ended:?}");
    }

    #[test]
    fn what_was_done_is_counted() {
        let surface = ball();
        for repeats in [0, 2] {
            let tiled = retile(&surface, &parameters(repeats), &Monitor::silent()).unwrap();
            assert_eq!(tiled.facts.repeats, repeats);
            assert_eq!((tiled.facts.repulsion_rounds, tiled.facts.attempts), (4, 1));
            assert_eq!((tiled.mesh.vertices.len(), tiled.sizing.len()), (40, 40));
        }
        let one = attempt(&surface, &parameters(1), 1, &Monitor::silent()).unwrap();
        assert_eq!(one.unwrap().mesh.vertices.len(), 40);
    }

    #[test]
    fn every_attempt_has_points_of_its_own() {
        let (surface, parameters, monitor) = (ball(), parameters(0), Monitor::silent());
        let run = PaperRun::new(&surface, &parameters, &monitor).unwrap();
        let spread = |attempt| spread(&run, 40, attempt).unwrap();
        assert_eq!(spread(1), spread(1));
        assert!(spread(0) != spread(1) && spread(1) != spread(2));
        let other = RetileParameters {
            seed: 2,
            ..parameters.clone()
        };
        let other = PaperRun::new(&surface, &other, &monitor).unwrap();
        assert!(super::spread(&other, 40, 0).unwrap() != spread(1));
    }

    #[test]
    fn the_refusal_says_what_the_last_seed_failed_at() {
        let (surface, parameters, monitor) = (ball(), parameters(0), Monitor::silent());
        let run = PaperRun::new(&surface, &parameters, &monitor).unwrap();
        let mesh = shapes::cup(60.0, 30.0, 9.0, 12);
        let error = TessellateError::SelfIntersecting {
            pairs: vec![[FaceId(7), FaceId(9)], [FaceId(8), FaceId(11)]],
            mesh: Box::new(mesh.clone()),
        };
        let RetileError::SelfIntersecting { points, place } = refusal(&run, Some(error)) else {
            panic!("the mesh intersects itself");
        };
        let middle = mesh.corners(7).iter().sum::<Vec3>() / 3.0;
        assert_eq!(points, 40);
        assert!((middle - Vec3::from(place)).norm() < 1e-9);
        let defect = crate::mesh::topology::MeshDefect::UnusedVertex {
            vertex: crate::mesh::VertexId(4),
        };
        assert_eq!(
            refusal(&run, Some(TessellateError::OpenSurface(defect))),
            RetileError::OpenSurface(defect)
        );
        let stuck = TessellateError::Stuck {
            vertices: Vec::new(),
        };
        for last in [None, Some(stuck)] {
            let RetileError::TooFewPoints { points, needed } = refusal(&run, last) else {
                panic!("a ball can be tiled");
            };
            assert_eq!((points, needed), (40, 41));
        }
    }

    /// Keeps what is reported.
    #[derive(Default)]
    struct Heard(std::sync::Mutex<Vec<f64>>);

    impl crate::base::progress::Observer for Heard {
        fn progress(&self, _: Stage, fraction: f64) {
            self.0.lock().expect("no report panics").push(fraction);
        }
    }

    /// Repulsion takes the first part of the stage. Later attempts report nothing, so that progress never falls.
    #[test]
    fn the_first_attempt_reports_its_rounds() {
        let (surface, parameters, heard) = (ball(), parameters(0), Heard::default());
        let monitor = Monitor::new(&heard, crate::base::progress::CancelToken::new());
        let run = PaperRun::new(&surface, &parameters, &monitor).unwrap();
        spread(&run, 40, 0).unwrap();
        let mut shares = std::mem::take(&mut *heard.0.lock().unwrap());
        shares.sort_by(f64::total_cmp);
        shares.dedup();
        assert_eq!(shares.len(), 4);
        for (k, share) in (0..).zip(&shares) {
            assert!(
                (share - 0.6 * f64::from(k) / 4.0).abs() < 1e-9,
                "{shares:?}"
            );
        }
        spread(&run, 40, 1).unwrap();
        assert!(heard.0.lock().unwrap().is_empty());
    }

    /// Two balls that reach into each other cannot be tiled with any seed.
    #[test]
    fn trying_ends_with_the_last_seed() {
        let balls = [0.0, 6.1].map(|x| moved(shapes::icosphere(10.0, 1), Vec3::repeat(x)));
        let surface = from_mesh(together(&balls), 1.0).unwrap();
        for seeds in [1, 3] {
            let tried = attempt(&surface, &parameters(0), seeds, &Monitor::silent()).unwrap();
            assert!(tried.is_none());
        }
    }

    /// Three balls have a mesh of twelve points, four on each.
    #[test]
    fn the_least_number_of_points_is_enough_to_try() {
        let balls = [0.0, 20.0, 40.0].map(|x| moved(shapes::icosphere(5.0, 1), Vec3::repeat(x)));
        let surface = from_mesh(together(&balls), 1.0).unwrap();
        let tile = |points| {
            let parameters = RetileParameters {
                points,
                ..parameters(0)
            };
            retile(&surface, &parameters, &Monitor::silent())
        };
        assert_eq!(tile(12).unwrap().mesh.triangles.len(), 12);
        assert!(tile(11).is_err());
    }
}
