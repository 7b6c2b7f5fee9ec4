//! `surface::extract` from the outside: what it finds, what it says, what it refuses.

#![allow(clippy::unwrap_used)] // Helpers state expectations by panicking too.

use nalgebra::Matrix3;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::{CancelToken, Monitor, Silent};
use ventriform::image::volume::Volume;
use ventriform::mesh::{shapes, topology};
use ventriform::surface::{
    IsoLevel, Isolate, Surface, SurfaceError, SurfaceParameters, TopologyMode, VolumeKind, extract,
    from_mesh,
};

fn volume(shape: [usize; 3], spacing: [f64; 3], value: impl Fn(Vec3) -> f64) -> Volume {
    let frame = VoxelToPatient::centred(shape, spacing, Vec3::zeros()).unwrap();
    Volume::sampled(shape, frame, |p| value(*p))
}

/// A blurred wall round the origin, open towards +z; 1 in its middle.
fn ventricle(p: Vec3) -> f64 {
    let q = Vec3::new(p.x, p.y, p.z * 0.75);
    let open = ((p.z - 22.0) / 4.0).max(0.0);
    (-((q.norm() - 26.0) / 6.0).powi(2) - open * open).exp()
}

/// A solid, hot organ of 50 mm radius that touches the ventricle from below.
fn liver(p: Vec3) -> f64 {
    let d = (p - Vec3::new(-72.0, 15.0, -20.0)).norm();
    2.0 / (1.0 + ((d - 42.0) / 3.0).exp())
}

fn run(volume: &Volume, parameters: &SurfaceParameters) -> Result<Surface, SurfaceError> {
    let result = extract(volume, parameters, &Monitor::silent());
    if let Ok(surface) = &result {
        let census = topology::check(&surface.mesh).unwrap();
        assert_eq!(
            census.euler_characteristic,
            surface.facts.euler_characteristic
        );
        assert!(surface.mesh.volume() > 0.0);
        assert_eq!(surface.working.len(), surface.mesh.vertices.len());
        assert!(
            surface
                .mesh
                .vertices
                .iter()
                .all(|v| v.iter().all(|x| x.is_finite()))
        );
    }
    result
}

fn with(isolate: Isolate, iso: IsoLevel) -> SurfaceParameters {
    SurfaceParameters {
        isolate,
        iso,
        ..SurfaceParameters::default()
    }
}

#[test]
fn the_ventricle_is_found_beside_a_hotter_liver_that_touches_it() {
    let scene = volume([64, 64, 56], [4.0; 3], |p| {
        ventricle(p).max(liver(p)) + 0.05
    });
    let alone = volume([64, 64, 56], [4.0; 3], |p| ventricle(p) + 0.05);
    let (found, expected) = (
        run(&scene, &SurfaceParameters::default()).unwrap(),
        run(&alone, &SurfaceParameters::default()).unwrap(),
    );
    assert!(found.facts.ventricle_score.unwrap() > 0.2);
    assert_eq!(found.facts.euler_characteristic, 2);
    let ratio = found.facts.region_ml / expected.facts.region_ml;
    assert!((0.85..1.15).contains(&ratio), "{:?}", found.facts);
    assert!(found.mesh.vertices.iter().all(|v| v.norm() < 60.0));
    assert!((found.facts.iso_fraction - 0.5).abs() < 1e-6);
}

#[test]
fn the_surface_does_not_depend_on_how_the_array_is_turned() {
    let straight = volume([60, 56, 52], [4.0; 3], |p| ventricle(p) + 0.05);
    let reference = run(&straight, &SurfaceParameters::default()).unwrap();
    // The same field sampled by a mirrored, permuted, oblique array.
    let turn = nalgebra::Rotation3::from_euler_angles(0.3, -0.5, 0.8).into_inner();
    let linear = turn * Matrix3::new(0.0, -4.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, -4.0);
    for sign in [1.0, -1.0] {
        let mut linear = linear;
        linear.set_column(0, &(linear.column(0) * sign));
        let half = Vec3::new(29.5, 27.5, 25.5);
        let frame = VoxelToPatient::new(linear, -(linear * half)).unwrap();
        let mut other = straight.clone();
        for (n, v) in other.voxels.iter_mut().enumerate() {
            let index = [n % 60, n / 60 % 56, n / 3360].map(|x| x as f64);
            *v = (ventricle(frame.to_patient(&Vec3::from(index))) + 0.05) as f32;
        }
        other.frame = frame;
        let surface = run(&other, &SurfaceParameters::default()).unwrap();
        assert_eq!(surface.facts.euler_characteristic, 2);
        let ratio = surface.mesh.volume() / reference.mesh.volume();
        assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    }
}

#[test]
fn fine_and_flat_voxels_give_the_same_ventricle() {
    let volumes = [
        volume([60, 60, 60], [3.0; 3], |p| ventricle(p) + 0.05),
        volume([100, 100, 100], [1.7; 3], |p| ventricle(p) + 0.05),
        volume([150, 60, 15], [1.2, 3.0, 12.0], |p| ventricle(p) + 0.05),
    ];
    let ml = volumes.map(|v| {
        let surface = run(&v, &SurfaceParameters::default()).unwrap();
        assert!(
            surface.facts.ventricle_score.is_some(),
            "{:?}",
            surface.facts
        );
        surface.mesh.volume()
    });
    assert!((ml[1] / ml[0] - 1.0).abs() < 0.03, "{ml:?}");
    assert!((ml[2] / ml[0] - 1.0).abs() < 0.15, "{ml:?}");
}

#[test]
fn without_a_ventricle_the_largest_part_is_taken_and_said() {
    let ball = volume([40; 3], [4.0; 3], |p| {
        1.0 / (1.0 + ((p.norm() - 50.0) / 3.0).exp())
    });
    let surface = run(&ball, &SurfaceParameters::default()).unwrap();
    assert_eq!(surface.facts.ventricle_score, None);
    assert!(
        surface
            .facts
            .warnings
            .iter()
            .any(|w| w.contains("no left ventricle"))
    );
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 50f64.powi(3);
    assert!((surface.mesh.volume() / exact - 1.0).abs() < 0.05);
}

#[test]
fn labels_are_taken_by_number_or_by_size() {
    let ball = |p: Vec3, x: f64, r: f64| (p - Vec3::new(x, 0.0, 0.0)).norm() < r;
    let mut map = volume([60, 40, 40], [2.0; 3], |p| {
        if ball(p, -30.0, 24.0) {
            4.0
        } else if ball(p, 30.0, 15.0) {
            7.0
        } else {
            0.0
        }
    });
    map.integral = true;
    let largest = run(&map, &SurfaceParameters::default()).unwrap();
    assert_eq!(
        (largest.facts.label, largest.facts.kind),
        (Some(4), VolumeKind::Labels)
    );
    assert!(
        largest
            .facts
            .warnings
            .iter()
            .any(|w| w.contains("4 (") && w.contains("7 ("))
    );
    let seven = run(&map, &with(Isolate::Label(7), IsoLevel::Auto)).unwrap();
    let sphere = |r: f64| 4.0 / 3.0 * std::f64::consts::PI * f64::powi(r, 3);
    // The mask itself has 1.8 % fewer voxels than the ball.
    let mask = map.voxels.iter().filter(|&&v| v == 7.0).count() as f64 * 8.0;
    assert!((seven.mesh.volume() / mask - 1.0).abs() < 0.02);
    assert!((mask / sphere(15.0) - 1.0).abs() < 0.03);
    assert!(
        seven
            .mesh
            .vertices
            .iter()
            .all(|v| ((v - Vec3::new(30.0, 0.0, 0.0)).norm() - 15.0).abs() < 1.5)
    );
    assert!((largest.mesh.volume() / sphere(24.0) - 1.0).abs() < 0.03);
    let missing = run(&map, &with(Isolate::Label(5), IsoLevel::Auto)).unwrap_err();
    assert!(missing.to_string().contains("4 (") && missing.to_string().contains("label 5"));
}

/// A ball of `inside` in `outside`, as whole numbers of a label map.
fn ball_of(inside: f32, outside: f32) -> Volume {
    let mut map = volume([24; 3], [3.0; 3], |p| f64::from(u8::from(p.norm() < 20.0)));
    for v in &mut map.voxels {
        *v = if *v > 0.0 { inside } else { outside };
    }
    map.integral = true;
    map
}

#[test]
fn the_object_is_what_the_background_surrounds_whatever_their_numbers() {
    let plain = run(&ball_of(1.0, 0.0), &SurfaceParameters::default()).unwrap();
    for (inside, outside) in [
        (1.0, -1.0),
        (0.0, -1.0),
        (3.0, -1024.0),
        (0.0, 255.0),
        (2.0, 1.0),
        (-1.0, 0.0),
        (1.0, f32::NAN),
        (576_073_728.0, 0.0),
    ] {
        let map = ball_of(inside, outside);
        let found = run(&map, &SurfaceParameters::default()).unwrap();
        assert_eq!(found.mesh, plain.mesh, "{inside} in {outside}");
        assert_eq!(found.facts.label, Some(inside as i64));
        assert_eq!(found.facts.kind, VolumeKind::Mask);
        let named = run(&map, &with(Isolate::Label(inside as i64), IsoLevel::Auto)).unwrap();
        assert_eq!(named.mesh, plain.mesh);
        let background = found
            .facts
            .warnings
            .iter()
            .any(|w| w.contains("background"));
        assert_eq!(background, outside != 0.0 && !outside.is_nan());
    }
    // A float cannot hold this number, so the voxels are not it.
    let refused = run(
        &ball_of(576_073_728.0, 0.0),
        &with(Isolate::Label(576_073_729), IsoLevel::Auto),
    );
    assert!(matches!(
        refused,
        Err(SurfaceError::InexactLabel { label: 576_073_729 })
    ));
}

#[test]
fn of_many_labels_any_can_be_named_and_none_is_guessed() {
    let mut map = volume([24; 3], [2.0; 3], |_| 0.0);
    for (n, v) in map.voxels.iter_mut().enumerate() {
        let [i, j, k] = [n % 24, n / 24 % 24, n / 576].map(|x| x / 3);
        *v = (1 + i + 8 * (j + 8 * k)) as f32;
    }
    map.integral = true;
    for label in [1, 300, 512] {
        let one = run(&map, &with(Isolate::Label(label), IsoLevel::Auto)).unwrap();
        let off = one.mesh.volume() / (27.0 * 8.0) - 1.0;
        assert!(off.abs() < 0.01, "{label}: {off}");
    }
    let refused = run(&map, &with(Isolate::Label(9999), IsoLevel::Auto)).unwrap_err();
    assert!(refused.to_string().contains("1 (27 voxels)"), "{refused}");
    assert!(refused.to_string().contains("472 more"), "{refused}");
    let refused = run(&map, &SurfaceParameters::default()).unwrap_err();
    assert!(
        matches!(refused, SurfaceError::LabelNeeded { .. }),
        "{refused}"
    );
    assert_eq!(refused.field(), Some("label"));
}

/// A distance that is negative inside, an object darker than its surroundings: the surface of the volume
/// turned over, with the figures of the volume itself.
#[test]
fn what_lies_below_an_iso_value_is_an_object_too() {
    let distance = |p: Vec3| (p - Vec3::new(3.0, -2.0, 1.0)).norm() - 19.0;
    let inside = volume([30; 3], [2.5; 3], |p| -distance(p));
    let outside = volume([30; 3], [2.5; 3], distance);
    for (isolate, level) in [
        (Isolate::Auto, 0.0),
        (Isolate::Largest, -2.0),
        (Isolate::None, 1.5),
        (Isolate::Seed([15, 14, 15]), 0.0),
    ] {
        let above = Isolate::Largest;
        let above = if isolate == Isolate::Auto {
            above
        } else {
            isolate
        };
        let expected = run(&inside, &with(above, IsoLevel::Absolute(-level))).unwrap();
        let found = run(&outside, &with(isolate, IsoLevel::Below(level))).unwrap();
        assert_eq!(found.mesh, expected.mesh);
        assert_eq!(found.facts.iso_value, level);
        assert!(found.facts.range[0] < 0.0 && found.facts.range[1] > 15.0);
        let radius = 19.0 + level;
        let sphere = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
        assert!((found.mesh.volume() / sphere - 1.0).abs() < 0.02);
    }
    let refused = run(&outside, &with(Isolate::Largest, IsoLevel::Below(-30.0))).unwrap_err();
    assert!(
        matches!(refused, SurfaceError::NoSurface { iso, .. } if iso == -30.0),
        "{refused}"
    );
    let refused = run(
        &ball_of(1.0, 0.0),
        &with(Isolate::Label(1), IsoLevel::Below(0.5)),
    );
    assert!(matches!(refused, Err(SurfaceError::BadIso { .. })));
    // Taken for bright, the distance's object is the surroundings, and a warning says how to turn that over.
    let turned = run(&outside, &with(Isolate::Largest, IsoLevel::Absolute(0.0))).unwrap();
    assert!(turned.facts.warnings.iter().any(|w| w.contains("below:0")));
}

#[test]
fn box_seed_largest_and_none_choose_what_they_say() {
    let two = volume([50, 30, 30], [2.0; 3], |p| {
        let left = 20.0 - (p - Vec3::new(-22.0, 0.0, 0.0)).norm();
        let right = 12.0 - (p - Vec3::new(25.0, 0.0, 0.0)).norm();
        left.max(right) + 100.0
    });
    let iso = IsoLevel::Absolute(100.0);
    let keep = |isolate| SurfaceParameters {
        topology: TopologyMode::Keep,
        ..with(isolate, iso)
    };
    let all = run(&two, &keep(Isolate::None)).unwrap();
    assert_eq!(
        (all.facts.components, all.facts.euler_characteristic),
        (2, 4)
    );
    let ball = run(&two, &with(Isolate::None, iso)).unwrap();
    assert_eq!(
        (ball.facts.components, ball.facts.components_before),
        (1, 2)
    );
    assert!(
        ball.facts
            .warnings
            .iter()
            .any(|w| w.contains("further components"))
    );
    let largest = run(&two, &keep(Isolate::Largest)).unwrap();
    assert!(largest.mesh.vertices.iter().all(|v| v.x < 0.0));
    let seed = run(&two, &keep(Isolate::Seed([37, 15, 15]))).unwrap();
    assert!(seed.mesh.vertices.iter().all(|v| v.x > 0.0));
    let boxed = run(&two, &keep(Isolate::Box([27, 0, 0], [49, 29, 29]))).unwrap();
    assert_eq!(boxed.mesh.volume(), seed.mesh.volume());
    let refused = run(&two, &keep(Isolate::Seed([25, 0, 0])));
    assert!(matches!(refused, Err(SurfaceError::SeedOutside { .. })));
    let refused = run(&two, &keep(Isolate::Box([5, 0, 0], [4, 9, 9])));
    assert!(matches!(refused, Err(SurfaceError::EmptyBox { .. })));
    let refused = run(&two, &keep(Isolate::Seed([50, 0, 0])));
    assert!(matches!(refused, Err(SurfaceError::OutsideVolume { .. })));
}

#[test]
fn topology_is_repaired_or_kept_and_always_reported() {
    let ring = volume([40, 40, 20], [2.0; 3], |p| {
        9.0 - (p.xy().norm() - 22.0).hypot(p.z) + 50.0
    });
    let iso = IsoLevel::Absolute(50.0);
    let keep = SurfaceParameters {
        topology: TopologyMode::Keep,
        ..with(Isolate::None, iso)
    };
    let kept = run(&ring, &keep).unwrap();
    assert_eq!((kept.facts.genus, kept.facts.handles_before), (1, 1));
    let cut = run(&ring, &with(Isolate::None, iso)).unwrap();
    assert_eq!((cut.facts.genus, cut.facts.handles_before), (0, 1));
    assert!(cut.facts.voxels_cut + cut.facts.voxels_filled > 0);
    assert!(cut.facts.warnings.iter().any(|w| w.contains("1 handles")));
}

#[test]
fn plateaus_missing_values_and_borders_are_survived_and_said() {
    let steps = volume(
        [20; 3],
        [2.0; 3],
        |p| if p.norm() < 14.0 { 2.0 } else { 1.0 } + if p.x > 0.0 { 1.0 } else { 0.0 },
    );
    let plateau = run(&steps, &with(Isolate::Largest, IsoLevel::Absolute(2.0))).unwrap();
    assert!(plateau.facts.touches_border);
    assert!(plateau.facts.warnings.iter().any(|w| w.contains("border")));
    let mut missing = volume([20; 3], [2.0; 3], |p| 30.0 - p.norm());
    for n in (0..8000).step_by(37) {
        missing.voxels[n] = f32::NAN;
    }
    let surface = run(&missing, &with(Isolate::Largest, IsoLevel::Absolute(15.0))).unwrap();
    assert!(surface.facts.warnings.iter().any(|w| w.contains("NaN")));
    run(&missing, &SurfaceParameters::default()).unwrap();
}

#[test]
fn hopeless_volumes_and_parameters_are_refused_by_name() {
    let error = |v: &Volume, p: &SurfaceParameters| run(v, p).unwrap_err();
    let auto = SurfaceParameters::default();
    let flat = volume([5; 3], [1.0; 3], |_| 3.0);
    assert_eq!(error(&flat, &auto), SurfaceError::Constant { value: 3.0 });
    let nothing = volume([5; 3], [1.0; 3], |_| f64::NAN);
    assert_eq!(
        error(&nothing, &auto),
        SurfaceError::NoFiniteVoxel { voxels: 125 }
    );
    let slope = volume([5; 3], [1.0; 3], |p| p.x + 0.25);
    for value in [9.0, -9.0] {
        let refused = error(&slope, &with(Isolate::None, IsoLevel::Absolute(value)));
        assert!(
            refused.to_string().contains("from -1.75 to 2.25"),
            "{refused}"
        );
    }
    for iso in [
        IsoLevel::Fraction(1.2),
        IsoLevel::Fraction(f64::NAN),
        IsoLevel::Absolute(f64::INFINITY),
    ] {
        assert!(matches!(
            error(&slope, &with(Isolate::None, iso)),
            SurfaceError::BadIso { .. }
        ));
    }
    let rough = SurfaceParameters {
        mask_smoothing: 4.0,
        ..auto.clone()
    };
    assert!(matches!(
        error(&slope, &rough),
        SurfaceError::BadSmoothing { .. }
    ));
    let mut short = slope.clone();
    short.voxels.pop();
    assert!(matches!(
        error(&short, &auto),
        SurfaceError::BadShape { .. }
    ));
    let token = CancelToken::new();
    token.cancel();
    let stopped = extract(&slope, &auto, &Monitor::new(&Silent, token));
    assert!(matches!(stopped, Err(SurfaceError::Cancelled(_))));
}

#[test]
fn thread_count_does_not_show() {
    let scene = volume([64, 64, 56], [4.0; 3], |p| {
        ventricle(p).max(liver(p)) + 0.05 + 0.03 * (p.x * 3.1 + p.y * 5.7 + p.z * 9.3).sin()
    });
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| run(&scene, &SurfaceParameters::default()).unwrap())
    };
    let one = on(1);
    for threads in [2, 7, 16] {
        let many = on(threads);
        assert_eq!(many.mesh, one.mesh);
        assert_eq!(many.working, one.working);
        assert_eq!(many.facts, one.facts);
    }
}

#[test]
fn tiny_and_long_volumes_do_not_panic() {
    for shape in [[3, 3, 3], [1, 1, 2], [1024, 3, 3], [3, 3, 200]] {
        let odd = volume(shape, [1.0, 10.0, 3.0], |p| {
            (p.x * 0.7).sin() + p.y * 0.01 + p.z * 0.02
        });
        for isolate in [Isolate::Auto, Isolate::None, Isolate::Largest] {
            let _ = run(&odd, &with(isolate, IsoLevel::Auto));
        }
    }
}

#[test]
fn any_closed_mesh_is_taken_over() {
    let torus = shapes::torus(30.0, 10.0, 40, 20);
    let surface = from_mesh(torus.clone(), 2.0).unwrap();
    assert_eq!((surface.facts.genus, surface.mesh.vertices.len()), (1, 800));
    let mut open = torus.clone();
    open.triangles.pop();
    assert!(matches!(
        from_mesh(open, 2.0),
        Err(SurfaceError::NotClosed(_))
    ));
    let mut bad = torus;
    bad.vertices[3].y = f64::NAN;
    assert!(matches!(
        from_mesh(bad, 2.0),
        Err(SurfaceError::BadVertex { vertex: 3 })
    ));
}
