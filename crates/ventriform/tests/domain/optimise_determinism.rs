//! The optimised mesh has the same bytes for any number of threads.

use ventriform::base::geometry::Vec3;
use ventriform::base::progress::Monitor;
use ventriform::mesh::{TriMesh, shapes};
use ventriform::surface::Surface;
use ventriform::surface::optimise::{OptimiseParameters, Optimised, Reference, optimise};
use ventriform::surface::retile::{RetileFacts, Tiled};

fn stretched(mut mesh: TriMesh) -> TriMesh {
    for v in &mut mesh.vertices {
        v.component_mul_assign(&Vec3::new(1.0, 1.4, 0.8));
    }
    mesh
}

fn run(start: &TriMesh, surface: &Surface, threads: usize) -> Optimised {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("a pool of threads");
    let tiled = Tiled {
        sizing: vec![1.0; start.vertices.len()],
        mesh: start.clone(),
        facts: RetileFacts::default(),
    };
    pool.install(|| {
        let reference = Reference::new(surface);
        let parameters = OptimiseParameters::default();
        optimise(&tiled, &reference, &parameters, &Monitor::silent()).expect("a closed start")
    })
}

#[test]
fn the_outcome_does_not_depend_on_the_number_of_threads() {
    let mesh = stretched(shapes::icosphere(30.0, 4));
    let surface = Surface::exact(mesh, 2.0);
    let start = stretched(shapes::icosphere(30.0, 2));
    let one = run(&start, &surface, 1);
    assert!(one.facts.fit_rounds > 0 && one.optimised.robust > one.retiled.robust);
    for threads in [2, 5, 16] {
        let many = run(&start, &surface, threads);
        assert_eq!(one.mesh, many.mesh);
        assert_eq!(one.optimised, many.optimised);
    }
}
