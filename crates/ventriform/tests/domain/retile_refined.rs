//! The refined method on many surfaces. A result has exactly N vertices, evenly distributed; it is
//! closed, has the topology of the surface, does not intersect itself, and does not depend on the
//! number of threads.

use rand::RngExt;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::random::{Purpose, stream};
use ventriform::base::progress::Monitor;
use ventriform::mesh::intersections::self_intersections;
use ventriform::mesh::{TriMesh, shapes, topology};
use ventriform::surface::retile::{RetileError, RetileParameters, Tiled, retile};
use ventriform::surface::{Surface, from_mesh};

fn surface(mesh: TriMesh) -> Surface {
    from_mesh(mesh, 1.0).expect("a closed shape")
}

fn refined(surface: &Surface, points: usize, seed: u64) -> Result<Tiled, RetileError> {
    let parameters = RetileParameters {
        points,
        seed,
        ..RetileParameters::default()
    };
    retile(surface, &parameters, &Monitor::silent())
}

fn check(surface: &Surface, points: usize, tiled: &Tiled) {
    assert_eq!(tiled.mesh.vertices.len(), points);
    assert_eq!(tiled.sizing.len(), points);
    let before = topology::check(&surface.mesh).expect("closed");
    let after = topology::check(&tiled.mesh).expect("closed");
    assert_eq!(before.euler_characteristic, after.euler_characteristic);
    assert_eq!(before.components, after.components);
    assert!(tiled.mesh.volume() > 0.0);
    assert_eq!(
        self_intersections(&tiled.mesh),
        Vec::<[ventriform::mesh::FaceId; 2]>::new()
    );
}

fn radius_ratios(mesh: &TriMesh) -> (f64, f64) {
    let (sum, least) = mesh
        .radius_ratios()
        .fold((0.0, 1.0f64), |(s, m), r| (s + r, m.min(r)));
    (sum / mesh.triangles.len() as f64, least)
}

/// A random shape, stretched, bent and with noise.
fn any_surface(seed: u64) -> Surface {
    let mut random = stream(seed, Purpose::PhantomShape);
    let mut draw = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
    let mut mesh = match seed % 4 {
        0 => shapes::icosphere(20.0, 3),
        1 => shapes::torus(30.0, draw(6.0, 20.0), 48, 20),
        2 => shapes::cup(draw(30.0, 80.0), 30.0, draw(4.0, 14.0), 36),
        _ => shapes::icosphere(25.0, 4),
    };
    let stretch = Vec3::new(draw(0.5, 1.5), draw(0.5, 1.5), draw(0.5, 1.5));
    let (bend, rough) = (draw(0.0, 0.01), draw(0.0, 0.3));
    for v in &mut mesh.vertices {
        v.component_mul_assign(&stretch);
        v.x += bend * v.z * v.z;
        *v += Vec3::new(
            draw(-rough, rough),
            draw(-rough, rough),
            draw(-rough, rough),
        );
    }
    surface(mesh)
}

#[test]
fn any_surface_is_retiled_or_the_error_names_a_sufficient_number() {
    let mut refused = 0;
    for seed in 0..120 {
        let surface = any_surface(seed);
        let points = [12, 20, 35, 67, 150, 300][seed as usize % 6];
        match refined(&surface, points, seed) {
            Ok(tiled) => check(&surface, points, &tiled),
            Err(RetileError::TooFewPoints { needed, .. }) => {
                refused += 1;
                assert!(needed > points);
                check(
                    &surface,
                    needed,
                    &refined(&surface, needed, seed).expect("enough"),
                );
            }
            Err(error) => panic!("seed {seed}: {error}"),
        }
    }
    assert!(refused <= 12, "{refused} of 120 refused");
}

#[test]
fn twelve_points_on_a_sphere_are_an_icosahedron() {
    let surface = surface(shapes::icosphere(20.0, 4));
    let tiled = refined(&surface, 12, 1).expect("a sphere takes twelve points");
    check(&surface, 12, &tiled);
    let mut valence = [0; 12];
    for v in tiled.mesh.triangles.iter().flatten() {
        valence[*v as usize] += 1;
    }
    assert_eq!(valence, [5; 12]);
    let (_, least) = radius_ratios(&tiled.mesh);
    assert!(least > 0.99, "{least}");
}

#[test]
fn triangles_are_nearly_equilateral() {
    let surface = surface(shapes::cup(60.0, 30.0, 11.0, 64));
    let tiled = refined(&surface, 150, 1).expect("a cup takes 150 points");
    let (mean, least) = radius_ratios(&tiled.mesh);
    assert!(mean > 0.955 && least > 0.6, "{mean} {least}");
}

#[test]
fn points_are_denser_where_curvature_is_high() {
    let surface = surface(shapes::cup(60.0, 30.0, 8.0, 64));
    let with = |adaptive| {
        let parameters = RetileParameters {
            points: 200,
            adaptive,
            adaptive_from: 0.0,
            ..RetileParameters::default()
        };
        retile(&surface, &parameters, &Monitor::silent()).expect("200 points")
    };
    let (even, tiled) = (with(0.0), with(0.5));
    check(&surface, 200, &tiled);
    let rim = |mesh: &TriMesh| mesh.vertices.iter().filter(|v| v.z > -2.0).count();
    assert!(rim(&tiled.mesh) > rim(&even.mesh) * 5 / 4);
    assert!(tiled.sizing.iter().all(|h| (0.3..3.0).contains(h)));
}

#[test]
fn more_points_than_the_surface_has_vertices() {
    let surface = surface(shapes::icosphere(20.0, 2));
    check(
        &surface,
        5000,
        &refined(&surface, 5000, 1).expect("5000 points"),
    );
}

#[test]
fn several_components_share_the_points() {
    let mut mesh = shapes::icosphere(20.0, 3);
    let first = mesh.vertices.len() as u32;
    let torus = shapes::torus(15.0, 5.0, 40, 20);
    let far = Vec3::new(60.0, 0.0, 0.0);
    mesh.vertices.extend(torus.vertices.iter().map(|v| v + far));
    let moved = torus.triangles.iter().map(|t| t.map(|v| v + first));
    mesh.triangles.extend(moved);
    let surface = surface(mesh);
    check(
        &surface,
        150,
        &refined(&surface, 150, 1).expect("150 points"),
    );
}

#[test]
fn results_depend_on_the_seed_but_not_on_the_number_of_threads() {
    let surface = surface(shapes::cup(60.0, 30.0, 11.0, 80));
    // The cells of 700 points are relaxed from coarse to fine.
    for points in [400, 700] {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("threads");
            pool.install(|| refined(&surface, points, 5).expect("a mesh").mesh)
        };
        let one = on(1);
        assert_eq!(one.vertices.len(), points);
        assert_eq!(one, on(2));
        assert_eq!(one, on(16));
        assert_ne!(one, refined(&surface, points, 6).expect("a mesh").mesh);
    }
}

#[test]
fn errors_name_the_parameter_out_of_range() {
    let surface = surface(shapes::icosphere(20.0, 3));
    let with = |change: &dyn Fn(&mut RetileParameters)| {
        let mut parameters = RetileParameters::default();
        change(&mut parameters);
        retile(&surface, &parameters, &Monitor::silent()).map(|t| t.facts.attempts)
    };
    assert!(matches!(
        with(&|p| p.points = 11),
        Err(RetileError::TooFewPoints { needed: 12, .. })
    ));
    assert!(matches!(
        with(&|p| p.points = 50_001),
        Err(RetileError::TooManyPoints { limit: 50_000, .. })
    ));
    assert!(matches!(
        with(&|p| p.adaptive = f64::NAN),
        Err(RetileError::BadParameter {
            name: "adaptive",
            ..
        })
    ));
    assert!(matches!(
        with(&|p| p.repulsion_strength = 0.0),
        Err(RetileError::BadParameter {
            name: "repulsion_strength",
            ..
        })
    ));
}
