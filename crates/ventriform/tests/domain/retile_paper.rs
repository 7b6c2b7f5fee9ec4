//! The paper's method on whole surfaces. A result has exactly N vertices, is closed and has the
//! topology of the surface.

use std::sync::Mutex;
use ventriform::base::geometry::Vec3;
use ventriform::base::progress::{CancelToken, Monitor, Observer, Silent, Stage};
use ventriform::mesh::intersections::self_intersections;
use ventriform::mesh::{TriMesh, shapes, topology};
use ventriform::surface::retile::{Method, RetileError, RetileParameters, Tiled, retile};
use ventriform::surface::{Surface, from_mesh};

fn surface(mesh: TriMesh) -> Surface {
    from_mesh(mesh, 1.0).expect("a closed shape")
}

fn paper(surface: &Surface, points: usize, seed: u64) -> Result<Tiled, RetileError> {
    let parameters = RetileParameters {
        points,
        seed,
        method: Method::Paper,
        ..RetileParameters::default()
    };
    retile(surface, &parameters, &Monitor::silent())
}

fn check(surface: &Surface, points: usize, tiled: &Tiled) {
    assert_eq!(tiled.mesh.vertices.len(), points);
    assert_eq!(tiled.sizing.len(), points);
    let (before, after) = (
        topology::check(&surface.mesh).expect("closed"),
        topology::check(&tiled.mesh).expect("closed"),
    );
    assert_eq!(before.euler_characteristic, after.euler_characteristic);
    assert_eq!(before.components, after.components);
    assert!(tiled.mesh.volume() > 0.0);
    assert_eq!(
        self_intersections(&tiled.mesh),
        Vec::<[ventriform::mesh::FaceId; 2]>::new()
    );
}

#[test]
fn spheres_cups_and_tori_are_retiled() {
    for (mesh, counts) in [
        (shapes::icosphere(20.0, 3), [12, 67, 150]),
        (shapes::cup(60.0, 30.0, 11.0, 40), [40, 67, 150]),
        (shapes::torus(30.0, 12.0, 40, 20), [40, 110, 300]),
    ] {
        let surface = surface(mesh);
        for (seed, points) in (1..).zip(counts) {
            check(&surface, points, &paper(&surface, points, seed).unwrap());
        }
    }
}

/// Keeps what is reported.
#[derive(Default)]
struct Heard(Mutex<Vec<f64>>);

impl Observer for Heard {
    fn progress(&self, _: Stage, fraction: f64) {
        let mut heard = self.0.lock().expect("no thread panicked");
        heard.push(fraction);
    }
}

#[test]
fn repulsion_reports_its_progress() {
    let surface = surface(shapes::icosphere(20.0, 3));
    let heard = Heard::default();
    let monitor = Monitor::new(&heard, CancelToken::new());
    let parameters = RetileParameters {
        points: 67,
        method: Method::Paper,
        ..RetileParameters::default()
    };
    retile(&surface, &parameters, &monitor).unwrap();
    let heard = heard.0.into_inner().unwrap();
    assert!(heard.is_sorted(), "{heard:?}");
    let within = heard.iter().filter(|x| (0.05..0.55).contains(*x)).count();
    assert!(within >= 10, "{heard:?}");
}

#[test]
fn repulsion_spreads_points_over_the_sphere() {
    let surface = surface(shapes::icosphere(20.0, 4));
    let tiled = paper(&surface, 150, 3).unwrap();
    let nearest = |p: &Vec3| {
        tiled
            .mesh
            .vertices
            .iter()
            .map(|q| (p - q).norm())
            .filter(|d| *d > 0.0)
            .fold(f64::INFINITY, f64::min)
    };
    let least = tiled
        .mesh
        .vertices
        .iter()
        .map(nearest)
        .fold(f64::INFINITY, f64::min);
    // In a hexagonal lattice the distance is 1.07 √(A/N); random points come as close as 0.04.
    let spacing = (surface.mesh.area() / 150.0).sqrt();
    assert!(least > 0.7 * spacing, "{}", least / spacing);
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
    check(&surface, 120, &paper(&surface, 120, 1).unwrap());
}

#[test]
fn the_error_for_too_few_points_names_a_sufficient_number() {
    // Any triangulation of a torus has at least 7 vertices.
    let mut mesh = shapes::torus(30.0, 12.0, 30, 15);
    let first = mesh.vertices.len() as u32;
    let high = Vec3::new(0.0, 0.0, 60.0);
    let raised: Vec<Vec3> = mesh.vertices.iter().map(|v| v + high).collect();
    let moved: Vec<[u32; 3]> = (mesh.triangles.iter())
        .map(|t| t.map(|v| v + first))
        .collect();
    mesh.vertices.extend(raised);
    mesh.triangles.extend(moved);
    let surface = surface(mesh);
    let Err(RetileError::TooFewPoints { points, needed }) = paper(&surface, 12, 1) else {
        panic!("12 points are too few for two tori");
    };
    assert!(points == 12 && needed >= 14);
    check(&surface, needed, &paper(&surface, needed, 1).unwrap());
}

#[test]
fn few_points_suffice_for_a_thin_ring() {
    let surface = surface(shapes::torus(60.0, 4.0, 120, 10));
    check(&surface, 12, &paper(&surface, 12, 1).unwrap());
}

#[test]
fn results_depend_on_the_seed_but_not_on_the_number_of_threads() {
    let surface = surface(shapes::cup(60.0, 30.0, 11.0, 40));
    let on = |threads: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
            .install(|| paper(&surface, 100, 5).unwrap().mesh)
    };
    let one = on(1);
    assert_eq!(one, on(3));
    assert_eq!(one, on(16));
    assert_ne!(one, paper(&surface, 100, 6).unwrap().mesh);
}

#[test]
fn cancelling_ends_the_work() {
    let token = CancelToken::new();
    token.cancel();
    let surface = surface(shapes::icosphere(20.0, 3));
    let parameters = RetileParameters {
        method: Method::Paper,
        ..RetileParameters::default()
    };
    assert!(matches!(
        retile(&surface, &parameters, &Monitor::new(&Silent, token)),
        Err(RetileError::Cancelled(_))
    ));
}
