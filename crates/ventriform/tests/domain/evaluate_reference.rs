//! Our models against the reference model, a surface thinned out by quadric error, at the
//! same number of points and on simulated hearts.
//!
//! Fitness only: which of them segments better depends on the cohort (`docs/log/evaluation.md`).

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use ventriform::base::progress::Monitor;
use ventriform::image::volume::Volume;
use ventriform::image::volume::phantom::{PhantomParameters, phantom};
use ventriform::mesh::TriMesh;
use ventriform::mesh::decimate::decimate;
use ventriform::mesh::intersections::self_intersections;
use ventriform::parameters::ModelParameters;
use ventriform::surface;
use ventriform::surface::optimise::{self, Reference};
use ventriform::surface::retile;

fn heart(seed: u64) -> Volume {
    let parameters = PhantomParameters {
        shape: [64; 3],
        spacing_mm: [4.0; 3],
        length_mm: 80.0 + 4.0 * (seed % 4) as f64,
        width_mm: 62.0 + 3.0 * (seed % 3) as f64,
        seed,
        ..PhantomParameters::default()
    };
    phantom(&parameters, &Monitor::silent()).unwrap().volume
}

/// Our model and the reference model of `points` points, and how fit they are.
fn models(volume: &Volume, points: usize) -> [(TriMesh, f64); 2] {
    let monitor = Monitor::silent();
    let pairs = [("points", points.to_string())];
    let parameters =
        ModelParameters::from_pairs(pairs.iter().map(|(n, t)| (*n, t.as_str()))).unwrap();
    let surface = surface::extract(volume, &parameters.surface, &monitor).unwrap();
    let reference = Reference::new(&surface);
    let tiled = retile::retile(&surface, &parameters.retile, &monitor).unwrap();
    let ours = optimise::optimise(&tiled, &reference, &parameters.optimise, &monitor).unwrap();
    let thinned = decimate(&surface.mesh, points, &monitor).unwrap();
    [ours.mesh, thinned].map(|mesh| {
        let fitness = optimise::assess(&mesh, &reference, [1.0; 4]).unwrap();
        (mesh, fitness.normalised)
    })
}

#[test]
fn our_models_are_fitter_than_the_reference_of_as_many_points() {
    for points in [67, 110] {
        for seed in [1, 2] {
            let [(ours, fitness), (reference, plain)] = models(&heart(seed), points);
            assert!(
                fitness > 1.05 * plain,
                "{points} points: fitness {fitness} against {plain}"
            );
            for mesh in [&ours, &reference] {
                assert_eq!(mesh.vertices.len(), points);
                assert_eq!(
                    self_intersections(mesh),
                    Vec::<[ventriform::mesh::FaceId; 2]>::new()
                );
            }
        }
    }
}
