//! Moves the vertices off the reference surface S so that the whole model lies closest to it.
//!
//! A model whose vertices stand on S cuts every bulge off and loses volume. Here the vertices
//! may leave S. Each round solves one sparse least-squares problem for their displacements:
//!
//! 1. distance: every sample of S is drawn to its partner on the model along S's normal;
//! 2. the model's own edge midpoints and triangle centres are drawn to S alike;
//! 3. shape: every triangle is drawn to the equilateral triangle that fits it best, within
//!    its own plane;
//! 4. bends: how the model bends is to change little from vertex to vertex;
//! 5. volume: the whole is to enclose what S encloses;
//! 6. damping: a little weight on staying put.
//!
//! Steps have momentum (Polyak's heavy ball): vertices slide slowly along S, where only the
//! triangles' shapes and far samples pull, and momentum gets them further in as many rounds.
//! The last rounds go without, so that the vertices come to rest.
//!
//! After every second round edges are flipped where that betters shapes and valences; in the
//! first half of the rounds irregular vertices are moved together until they cancel.
//!
//! Guaranteed: no triangle turns over in a round and none comes to pierce another; where a
//! step would do so, the vertices concerned make half of it, or less, or none.

mod advance;
mod bends;
mod equations;
mod polish;
mod samples;
mod terms;

use advance::advance;
use samples::{Sample, find_partners, follow_partners, spread};

use super::connectivity::Connectivity;
use super::{FitParameters, Reference};
use crate::geometry::Vec3;
use crate::mesh::TriMesh;
use crate::progress::{Cancelled, Monitor, Stage};

/// Last rounds, without momentum.
const CALM_ROUNDS: usize = 5;

/// The mesh on its way, and what it is drawn to.
struct Model<'a> {
    vertices: Vec<Vec3>,
    connectivity: Connectivity,
    samples: Vec<Sample>,
    /// For the midpoints and the centre of each triangle the triangle of the reference that was
    /// closest in the last round: where the next search begins.
    near: Vec<[Option<u32>; 4]>,
    sizing: &'a [f64],
    reference: &'a Reference,
    /// That of the reference, mm³.
    volume: f64,
    /// A voxel's size against the model's edges, at most 1: how much of what it could follow is
    /// the grid's and the noise's.
    fineness: f64,
    parameters: &'a FitParameters,
}

/// The fitted mesh.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// Moved vertices, flipped triangles.
    pub mesh: TriMesh,
    /// Rounds run.
    pub rounds: usize,
    /// Edges flipped on the way.
    pub flips: usize,
    /// Steps that had to be shortened.
    pub shortened: usize,
}

/// Fits the mesh of `connectivity` with vertices at `start` to `reference`; `sizing` is the
/// wanted relative spacing at each vertex.
///
/// # Errors
/// [`Cancelled`].
pub fn fit(
    start: &[Vec3],
    connectivity: Connectivity,
    sizing: &[f64],
    reference: &Reference,
    parameters: &FitParameters,
    monitor: &Monitor,
) -> Result<Fitted, Cancelled> {
    let count = parameters.samples_per_triangle * connectivity.triangles().len();
    let lengths = reference.lengths(connectivity.triangles().len());
    let mut model = Model {
        vertices: start.to_vec(),
        connectivity,
        samples: spread(reference, count),
        near: Vec::new(),
        sizing,
        reference,
        volume: reference.mesh.volume(),
        fineness: (lengths.voxel / lengths.edge).min(1.0),
        parameters,
    };
    find_partners(&mut model);
    let (mut flips, mut shortened) = (0, 0);
    let mut velocity = vec![Vec3::zeros(); start.len()];
    for round in 0..parameters.rounds {
        let fraction = round as f64 / (parameters.rounds + 1) as f64;
        monitor.report(Stage::Optimise, fraction)?;
        let mut step = terms::displacement(&mut model, monitor)?;
        if round + CALM_ROUNDS < parameters.rounds {
            for (step, velocity) in step.iter_mut().zip(&velocity) {
                *step += velocity * parameters.momentum;
            }
        }
        velocity.copy_from_slice(&model.vertices);
        shortened += usize::from(advance(&mut model.vertices, &model.connectivity, &step));
        for (velocity, vertex) in velocity.iter_mut().zip(&model.vertices) {
            *velocity = vertex - *velocity;
        }
        monitor.check()?;
        if round % 2 == 1 && round + 1 < parameters.rounds {
            // Early, so that enough rounds are left to even the triangles out.
            let early = 2 * round < parameters.rounds;
            let glide = if early { parameters.glide } else { 0 };
            flips += polish::polish(&mut model, glide, monitor)?;
            monitor.check()?;
        }
        follow_partners(&mut model);
    }
    Ok(Fitted {
        mesh: TriMesh {
            vertices: model.vertices,
            triangles: model.connectivity.into_triangles(),
        },
        rounds: parameters.rounds,
        flips,
        shortened,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::intersections::self_intersections;
    use crate::mesh::shapes;
    use crate::surface::Surface;

    fn reference(mesh: TriMesh) -> Reference {
        Reference::new(&Surface::exact(mesh, 2.0))
    }

    fn fitted(start: &TriMesh, reference: &Reference, parameters: &FitParameters) -> Fitted {
        let n = start.vertices.len();
        let connectivity = Connectivity::new(n, start.triangles.clone()).unwrap();
        let monitor = Monitor::silent();
        let sizing = vec![1.0; n];
        fit(
            &start.vertices,
            connectivity,
            &sizing,
            reference,
            parameters,
            &monitor,
        )
        .unwrap()
    }

    fn stretched(mut mesh: TriMesh, axes: [f64; 3]) -> TriMesh {
        for v in &mut mesh.vertices {
            v.component_mul_assign(&Vec3::from(axes));
        }
        mesh
    }

    #[test]
    fn spheres_and_ellipsoids_get_their_volume_back() {
        for axes in [[1.0, 1.0, 1.0], [1.0, 1.3, 0.8]] {
            let reference = reference(stretched(shapes::icosphere(30.0, 5), axes));
            let start = stretched(shapes::icosphere(30.0, 2), axes);
            let exact = reference.mesh.volume();
            assert!(start.volume() / exact < 0.98);
            let found = fitted(&start, &reference, &FitParameters::default());
            let error = found.mesh.volume() / exact - 1.0;
            assert!(error.abs() < 1e-3, "{error}");
        }
    }

    #[test]
    fn the_fitted_mesh_lies_closer_to_the_surface_than_one_with_vertices_on_it() {
        let reference = reference(shapes::cup(60.0, 30.0, 10.0, 90));
        let start = shapes::cup(60.0, 30.0, 10.0, 16);
        let found = fitted(&start, &reference, &FitParameters::default());
        let (parameters, sizing) = (FitParameters::default(), Vec::new());
        let mean_distance = |mesh: &TriMesh| {
            let model = model(mesh, &reference, &parameters, &sizing);
            let distance = |s: &Sample| {
                let ids = mesh.triangles[s.triangle as usize];
                let place: Vec3 = (0..3)
                    .map(|k| mesh.vertices[ids[k] as usize] * s.barycentric[k])
                    .sum();
                (place - s.point).norm()
            };
            model.samples.iter().map(distance).sum::<f64>() / model.samples.len() as f64
        };
        let (before, after) = (mean_distance(&start), mean_distance(&found.mesh));
        assert!(after < 0.5 * before, "{before} {after}");
    }

    /// Walls much thinner than the triangles are long: the sheets must stay apart.
    #[test]
    fn thin_shells_are_not_pierced() {
        for wall in [1.5, 3.0, 6.0] {
            let reference = reference(shapes::cup(60.0, 30.0, wall, 90));
            let start = shapes::cup(60.0, 30.0, wall, 14);
            let known = self_intersections(&start);
            let parameters = FitParameters::default();
            let found = fitted(&start, &reference, &parameters);
            let pairs = self_intersections(&found.mesh);
            assert!(pairs.len() <= known.len(), "wall {wall}: {pairs:?}");
            crate::mesh::topology::check(&found.mesh).unwrap();
            for t in 0..found.mesh.triangles.len() {
                let [a, b, c] = found.mesh.corners(t);
                let nearest = reference.bvh.closest(&((a + b + c) / 3.0)).unwrap();
                let distance = nearest.squared_distance.sqrt();
                assert!(distance < 4.0, "wall {wall}: {t} is {distance} mm off");
            }
        }
    }

    #[test]
    fn a_step_through_the_opposite_wall_is_shortened() {
        let mesh = shapes::cup(60.0, 30.0, 4.0, 24);
        let n = mesh.vertices.len();
        let connectivity = Connectivity::new(n, mesh.triangles.clone()).unwrap();
        let mut vertices = mesh.vertices.clone();
        let mut step = vec![Vec3::zeros(); n];
        // The outer apex jumps 20 mm up, through the cavity's floor.
        step[0].z = 20.0;
        assert!(advance(&mut vertices, &connectivity, &step));
        assert!(vertices[0].z - mesh.vertices[0].z < 4.0);
        let moved = TriMesh {
            vertices,
            triangles: mesh.triangles,
        };
        assert!(self_intersections(&moved).is_empty());
    }

    fn model<'a>(
        mesh: &TriMesh,
        reference: &'a Reference,
        parameters: &'a FitParameters,
        sizing: &'a [f64],
    ) -> Model<'a> {
        let mut model = Model {
            vertices: mesh.vertices.clone(),
            connectivity: Connectivity::new(mesh.vertices.len(), mesh.triangles.clone()).unwrap(),
            samples: spread(reference, 5000),
            near: Vec::new(),
            sizing,
            reference,
            volume: reference.mesh.volume(),
            fineness: 0.2,
            parameters,
        };
        find_partners(&mut model);
        model
    }

    #[test]
    fn polishing_flips_mend_a_disturbed_sphere() {
        let reference = reference(shapes::icosphere(30.0, 4));
        let mesh = shapes::icosphere(30.0, 2);
        let n = mesh.vertices.len();
        let (parameters, sizing) = (FitParameters::default(), vec![1.0; n]);
        let mut model = model(&mesh, &reference, &parameters, &sizing);
        for h in [10, 100, 200, 300, 400] {
            model.connectivity.flip(h);
        }
        follow_partners(&mut model);
        assert!(irregularity(&model.connectivity) > 12);
        assert!(polish::polish(&mut model, 0, &Monitor::silent()).unwrap() >= 5);
        assert_eq!(irregularity(&model.connectivity), 12);
    }

    /// Σ (valence - 6)²: 12 on a sphere whose only irregular vertices are twelve fives.
    fn irregularity(connectivity: &Connectivity) -> u32 {
        (0..)
            .zip(connectivity.triangles().iter().flatten())
            .map(|(h, _)| connectivity.valence(connectivity.origin(h)))
            // Every vertex is met once for each triangle round it.
            .map(|valence| 420 * valence.abs_diff(6).pow(2) / valence)
            .sum::<u32>()
            / 420
    }

    /// Two pairs of irregular vertices that have travelled apart: no single flip helps.
    #[test]
    fn gliding_brings_separated_irregular_vertices_together() {
        let reference = reference(shapes::icosphere(30.0, 4));
        let mesh = shapes::icosphere(30.0, 3);
        let n = mesh.vertices.len();
        let (parameters, sizing) = (FitParameters::default(), vec![1.0; n]);
        let fresh = model(&mesh, &reference, &parameters, &sizing);
        let after = |connectivity: &Connectivity, h: u32| {
            let mut flipped = connectivity.clone();
            let legal = flipped.can_flip(h)
                && super::super::legality::replacement(&mesh.vertices, &flipped.quad(h), 0.0)
                    .is_some();
            legal.then(|| {
                flipped.flip(h);
                flipped
            })
        };
        let stuck = |connectivity: &Connectivity| {
            let now = irregularity(connectivity);
            let mut flips = connectivity.edges().filter_map(|h| after(connectivity, h));
            flips.all(|flipped| irregularity(&flipped) >= now)
        };
        let torn = fresh.connectivity.edges().find_map(|first| {
            let pair = after(&fresh.connectivity, first)?;
            let near = pair.around(pair.origin(first)).collect::<Vec<u32>>();
            near.into_iter().find_map(|second| {
                let apart = after(&pair, second)?;
                (irregularity(&apart) == irregularity(&pair) && stuck(&apart)).then_some(apart)
            })
        });
        let mut model = fresh;
        model.connectivity = torn.unwrap();
        follow_partners(&mut model);
        assert!(irregularity(&model.connectivity) > 12);
        polish::polish(&mut model, 3, &Monitor::silent()).unwrap();
        assert_eq!(irregularity(&model.connectivity), 12);
    }
}
