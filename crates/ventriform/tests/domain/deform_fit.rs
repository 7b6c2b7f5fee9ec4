//! The spring-mass fit against shapes whose answer is known.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use nalgebra::Rotation3;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::bvh::Bvh;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::{CancelToken, Monitor, Silent};
use ventriform::heart::deform::dynamics::{self, Motion, StopReason};
use ventriform::heart::deform::elastic::{Elastic, Stiffness};
use ventriform::heart::deform::sensors::{EdgeShift, SensorKind, SensorSettings};
use ventriform::heart::deform::{DeformError, DeformParameters, ThroughPoint, WallEdge};
use ventriform::heart::fit::{Fit, fit};
use ventriform::heart::judge::Flag;
use ventriform::heart::judge::flags::DarkPart;
use ventriform::heart::model::struts::struts;
use ventriform::heart::model::{Organ, Template, TemplateError};
use ventriform::image::grid::agreement::compare;
use ventriform::image::grid::field::Field;
use ventriform::image::grid::voxelise::voxelise;
use ventriform::image::locate::{Hints, LocateError};
use ventriform::image::volume::Volume;
use ventriform::mesh::{TriMesh, shapes};
use ventriform::runs::segmentation::{OrganSearch, fit_built_in};
use ventriform::surface::optimise::Reference;
use ventriform::surface::{self, Denoise, IsoLevel, SurfaceParameters};

const SPACING_MM: f64 = 3.5;

/// A volume of `n`³ voxels about the origin with `value` at every centre, blurred by
/// `sigma` mm.
fn picture(n: usize, sigma: f64, value: impl Fn(&Vec3) -> f64) -> Volume {
    let frame = VoxelToPatient::centred([n; 3], [SPACING_MM; 3], Vec3::zeros()).unwrap();
    let mut volume = Volume::sampled([n; 3], frame, value);
    volume.voxels = Field::new(&volume, None, sigma).values().to_vec();
    volume
}

/// The value of a ball's indicator, antialiased over a voxel.
fn ball(p: &Vec3, centre: &Vec3, radius: f64) -> f64 {
    ((radius - (p - centre).norm()) / SPACING_MM + 0.5).clamp(0.0, 1.0)
}

/// A ventricle-like cup at `centre` with its apex along `axis`.
fn cup(centre: Vec3, axis: Vec3, scale: f64) -> TriMesh {
    placed(shapes::cup(70.0, 31.0, 13.0, 14), centre, axis, scale)
}

fn placed(mut mesh: TriMesh, centre: Vec3, axis: Vec3, scale: f64) -> TriMesh {
    let turn = Rotation3::rotation_between(&-Vec3::z(), &axis).unwrap();
    for p in &mut mesh.vertices {
        *p = centre + turn * (*p + Vec3::new(0.0, 0.0, 35.0)) * scale;
    }
    mesh
}

/// A blurred image of `wall`: 1 in the wall, multiplied by `uptake` at each point.
fn scan(wall: &TriMesh, n: usize, uptake: impl Fn(&Vec3) -> f64) -> Volume {
    let frame = VoxelToPatient::centred([n; 3], [SPACING_MM; 3], Vec3::zeros()).unwrap();
    let mask = voxelise(wall, [n; 3], &frame, &Monitor::silent()).unwrap();
    let mut volume = picture(n, 0.0, |_| 0.0);
    for (v, inside) in mask.voxels.iter().enumerate() {
        let index = [v % n, v / n % n, v / (n * n)];
        let p = frame.to_patient(&Vec3::from(index.map(|x| x as f64)));
        volume.voxels[v] = (uptake(&p) * f64::from(u8::from(*inside)) + 0.08) as f32;
    }
    volume.voxels = Field::new(&volume, None, 4.5).values().to_vec();
    volume
}

fn axis() -> Vec3 {
    Vec3::new(0.64, -0.61, -0.44).normalize()
}

fn ventricle(mesh: TriMesh) -> Template {
    Template::new(mesh, Organ::LeftVentricle, &Monitor::silent()).unwrap()
}

fn jaccard(mesh: &TriMesh, truth: &TriMesh, volume: &Volume) -> f64 {
    let mask = |m: &TriMesh| voxelise(m, volume.shape, &volume.frame, &Monitor::silent()).unwrap();
    compare(
        &mask(mesh),
        &mask(truth),
        volume.frame.spacing(),
        &Monitor::silent(),
    )
    .unwrap()
    .jaccard
}

#[test]
fn a_sphere_grows_onto_a_sphere_and_a_shifted_one_comes_back() {
    for (radius, centre, hint) in [
        (30.0, Vec3::zeros(), None),
        (
            30.0,
            Vec3::new(6.0, -4.0, 3.0),
            Some(Vec3::new(1.0, 1.0, -2.0)),
        ),
    ] {
        let volume = picture(40, 2.0, |p| ball(p, &centre, radius));
        let model = shapes::icosphere(20.0, 2);
        let template = Template::new(model, Organ::Generic, &Monitor::silent()).unwrap();
        let parameters = DeformParameters {
            blur: 0.0,
            hints: Hints {
                centre: hint,
                ..Hints::default()
            },
            ..DeformParameters::default()
        };
        let fit = fit(&volume, &template, &parameters, &Monitor::silent()).unwrap();
        assert_eq!(fit.model.reason, StopReason::Converged);
        // A polyhedron that follows the sphere in the mean has corners outside and faces
        // inside: compare the radius of equal volume.
        let found = (3.0 * fit.model.mesh.volume() / (4.0 * std::f64::consts::PI)).cbrt();
        // Blur of 2 mm moves the steepest slope of a ball inward by sigma²/R.
        let edge = radius - 4.0 / radius;
        assert!(
            (found - edge).abs() < 0.1 * SPACING_MM,
            "{found} for {edge}"
        );
        let middle: Vec3 = fit.model.mesh.vertices.iter().sum::<Vec3>() / 162.0;
        assert!((middle - centre).norm() < 0.1 * SPACING_MM, "{middle}");
    }
}

#[test]
fn energy_never_rises_without_external_forces() {
    let mesh = shapes::cup(60.0, 30.0, 12.0, 16);
    let body = Elastic::new(
        &mesh,
        &struts(&mesh, &Monitor::silent()).unwrap(),
        Stiffness::default(),
    );
    let mut start = mesh.clone();
    for (i, p) in start.vertices.iter_mut().enumerate() {
        let t = i as f64;
        *p += Vec3::new((t * 1.3).sin(), (t * 0.7).cos(), (t * 2.1).sin()) * 4.0;
    }
    let empty = Field::new(&picture(20, 0.0, |_| 1.0), None, 0.0);
    let look = SensorSettings {
        kind: SensorKind::Gradient,
        reach: 8.0,
        level: 0.5,
        ceiling: 2.0,
        shift: EdgeShift {
            inner: 0.0,
            outer: 0.0,
            rim: 0.0,
            axis: [Vec3::zeros(); 2],
        },
        blind: None,
    };
    for damping in [0.0, 1.0] {
        let motion = Motion {
            damping,
            ..Motion::default()
        };
        let moved = dynamics::run(
            &start,
            &body,
            &empty,
            &look,
            &[],
            &motion,
            &Monitor::silent(),
        )
        .unwrap();
        assert!(moved.energy.len() > 5);
        for pair in moved.energy.windows(2) {
            assert!(pair[1] <= pair[0] * (1.0 + 1e-9), "{pair:?}");
        }
        assert!(moved.energy.last().unwrap() < &(0.05 * moved.energy[0]));
    }
}

#[test]
fn a_ventricle_is_found_and_fitted_beside_a_hotter_organ() {
    let truth = cup(Vec3::new(25.0, -10.0, 12.0), axis(), 0.95);
    let mut volume = scan(&truth, 64, |_| 1.0);
    // A liver twice as hot whose edge touches the inferior wall.
    let liver = Vec3::new(-30.0, 15.0, -58.0);
    let hot = picture(64, 4.5, |p| 2.0 * ball(p, &liver, 50.0));
    for (v, h) in volume.voxels.iter_mut().zip(&hot.voxels) {
        *v += h;
    }
    let template = ventricle(cup(
        Vec3::zeros(),
        Vec3::new(0.2, -0.9, -0.3).normalize(),
        1.1,
    ));
    let parameters = DeformParameters::default();
    let first = fit(&volume, &template, &parameters, &Monitor::silent()).unwrap();
    assert!(jaccard(&first.model.mesh, &truth, &volume) > 0.75);
    assert!(
        first.judgement.confidence > 0.5,
        "{}",
        first.judgement.confidence
    );
    assert_eq!(
        first.model.self_intersections + first.model.turned_triangles,
        0
    );
    let again = fit(&volume, &template, &parameters, &Monitor::silent()).unwrap();
    assert_eq!(first.model.mesh, again.model.mesh);
}

#[test]
fn a_defect_without_any_uptake_does_not_draw_the_surface_inward() {
    let centre = Vec3::new(10.0, -5.0, 8.0);
    let truth = cup(centre, axis(), 1.0);
    let healthy = scan(&truth, 56, |_| 1.0);
    // Half the circumference for a third of the length: three segments and more.
    let across = axis().cross(&Vec3::z()).normalize();
    let defect = scan(&truth, 56, |p| {
        let r = p - centre;
        let along = r.dot(&axis());
        let radial = r - axis() * along;
        let facing = radial.normalize().dot(&across);
        if facing > 0.0 && (-5.0..20.0).contains(&along) {
            0.0
        } else {
            1.0
        }
    });
    let template = ventricle(cup(
        Vec3::zeros(),
        Vec3::new(0.2, -0.9, -0.3).normalize(),
        1.05,
    ));
    let parameters = DeformParameters::default();
    let volumes = [&healthy, &defect].map(|v| {
        let fit = fit(v, &template, &parameters, &Monitor::silent()).unwrap();
        let agreement = jaccard(&fit.model.mesh, &truth, v);
        assert!(agreement > 0.7, "{agreement}");
        fit.model.wall_ml
    });
    assert!((volumes[1] / volumes[0] - 1.0).abs() < 0.1, "{volumes:?}");
}

#[test]
fn a_turned_and_moved_patient_gives_the_same_volume() {
    let template = ventricle(cup(Vec3::zeros(), axis(), 1.0));
    let mut volumes = Vec::new();
    for (degrees, shift) in [(0.0f64, 0.0), (15.0, 1.1), (30.0, 0.4), (-30.0, 2.3)] {
        let turn = Rotation3::from_euler_angles(0.0, degrees.to_radians(), 0.0);
        let truth = cup(
            Vec3::new(5.0 + shift, -8.0, 3.0 - shift),
            turn * axis(),
            1.08,
        );
        let volume = scan(&truth, 56, |_| 1.0);
        let fit = fit(
            &volume,
            &template,
            &DeformParameters::default(),
            &Monitor::silent(),
        )
        .unwrap();
        volumes.push(fit.model.wall_ml);
    }
    let mean = volumes.iter().sum::<f64>() / 4.0;
    let sd = (volumes.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 4.0).sqrt();
    assert!(sd / mean < 0.05, "{volumes:?}");
}

#[test]
fn the_anatomical_edge_subtracts_what_blur_adds() {
    let thin = shapes::cup(70.0, 31.0, 8.0, 14);
    let truth = placed(thin, Vec3::new(5.0, -8.0, 3.0), axis(), 1.05);
    let volume = scan(&truth, 56, |_| 1.0);
    let template = ventricle(cup(Vec3::zeros(), axis(), 1.0));
    // `scan` blurs by 4.5 mm of standard deviation.
    let agreement = [WallEdge::Apparent, WallEdge::Anatomical].map(|edge| {
        let parameters = DeformParameters {
            edge,
            resolution: Some(4.5 * 2.355),
            ..DeformParameters::default()
        };
        let fit = fit(&volume, &template, &parameters, &Monitor::silent()).unwrap();
        assert_eq!(fit.model.self_intersections + fit.model.turned_triangles, 0);
        jaccard(&fit.model.mesh, &truth, &volume)
    });
    assert!(agreement[1] > agreement[0] + 0.02, "{agreement:?}");
}

/// Mean signed distances, mm, of the triangles' centres from the surface of `edge`, where the wall faces
/// inward and outward; outward of the wall is positive.
fn beyond(mesh: &TriMesh, edge: &Reference, centre: &Vec3, axis: &Vec3) -> [f64; 2] {
    let mut sums = [[0.0; 2]; 2];
    for t in 0..mesh.triangles.len() {
        let corners = mesh.corners(t);
        let place = (corners[0] + corners[1] + corners[2]) / 3.0;
        let normal = mesh.area_normal(t);
        let r = place - centre;
        let along = r.dot(axis);
        // Not the rim, and not the apex, where the axis has no sides.
        if !(-20.0..20.0).contains(&along) {
            continue;
        }
        let side = usize::from((r - axis * along).dot(&normal) > 0.0);
        let found = edge.bvh.closest(&place).unwrap();
        let distance = (place - found.point).dot(&normal.normalize());
        let area = normal.norm();
        sums[side][0] += area * distance;
        sums[side][1] += area;
    }
    sums.map(|[sum, area]| sum / area)
}

/// Sensors of every kind find an edge that lies beside the apparent one, by distances that were measured
/// and are taken off: without that the sides lie up to 1.3 mm off, and 0.9 mm apart.
#[test]
fn both_sides_of_a_clear_wall_lie_at_its_apparent_edge() {
    let centre = Vec3::new(5.0, -8.0, 3.0);
    let truth = cup(centre, axis(), 1.05);
    let volume = scan(&truth, 56, |_| 1.0);
    let hottest = volume.voxels.iter().copied().fold(0.0, f32::max);
    let apparent = SurfaceParameters {
        iso: IsoLevel::Absolute(f64::midpoint(f64::from(hottest), 0.08)),
        denoise: Denoise::Off,
        ..SurfaceParameters::default()
    };
    let monitor = Monitor::silent();
    let apparent = Reference::new(&surface::extract(&volume, &apparent, &monitor).unwrap());
    let template = ventricle(cup(Vec3::zeros(), axis(), 1.0));
    let [half_maximum, gradient] = [SensorKind::HalfMaximum, SensorKind::Gradient].map(|sensor| {
        let parameters = DeformParameters {
            sensor,
            ..DeformParameters::default()
        };
        let fit = fit(&volume, &template, &parameters, &monitor).unwrap();
        beyond(&fit.model.mesh, &apparent, &centre, &axis())
    });
    for (a, b) in half_maximum.iter().zip(&gradient) {
        let all = format!("{half_maximum:?} {gradient:?}");
        assert!(a.abs() < 0.5 && b.abs() < 0.5, "{all}");
        assert!((a - b).abs() < 0.4, "{all}");
    }
}

#[test]
fn a_margin_moves_both_sides_and_the_rim_outwards() {
    let centre = Vec3::new(5.0, -8.0, 3.0);
    let truth = cup(centre, axis(), 1.05);
    let volume = scan(&truth, 56, |_| 1.0);
    let template = ventricle(cup(Vec3::zeros(), axis(), 1.0));
    let monitor = Monitor::silent();
    let edge = |mesh: TriMesh| Reference::new(&surface::Surface::exact(mesh, SPACING_MM));
    let truth = edge(truth);
    let places = [-2.0, 2.0].map(|margin| {
        let parameters = DeformParameters {
            margin,
            ..DeformParameters::default()
        };
        let mesh = fit(&volume, &template, &parameters, &monitor)
            .unwrap()
            .model
            .mesh;
        let [inner, outer] = beyond(&mesh, &truth, &centre, &axis());
        let basal = mesh.vertices.iter().map(|p| -(p - centre).dot(&axis()));
        [inner, outer, basal.fold(f64::MIN, f64::max)]
    });
    // The springs give way to some of the 4 mm.
    for (narrow, wide) in places[0].iter().zip(&places[1]) {
        let moved = wide - narrow;
        assert!((2.5..5.0).contains(&moved), "{places:?}");
    }
}

/// The surface passes through the points that a person sets, on the side that they name, and what lies far from them
/// stays.
#[test]
fn the_wall_passes_through_the_points_that_a_person_sets() {
    let truth = cup(Vec3::zeros(), axis(), 1.0);
    let template = ventricle(cup(Vec3::zeros(), axis(), 0.95));
    let volume = scan(&truth, 44, |_| 1.0);
    let fitted = |through: Vec<ThroughPoint>| {
        let parameters = DeformParameters {
            through,
            ..DeformParameters::default()
        };
        fit(&volume, &template, &parameters, &Monitor::silent())
    };
    let plain = fitted(Vec::new()).unwrap().model;
    let before = plain.apparent_mesh().clone();
    let middle: Vec3 = before.vertices.iter().sum::<Vec3>() / before.vertices.len() as f64;
    let across = axis().cross(&Vec3::z()).normalize();
    let distance = |mesh: &TriMesh, place: &Vec3| {
        let tree = Bvh::new(&mesh.vertices, &mesh.triangles);
        tree.closest(place).unwrap().squared_distance.sqrt()
    };
    // Where a ray from the long axis meets the inner and the outer surface.
    let side = |outer: bool| {
        let range = if outer { 22.0..45.0 } else { 5.0..27.0 };
        let steps = (0..400)
            .map(|n| f64::from(n) / 8.0)
            .filter(|t| range.contains(t));
        let off = |t: &f64| distance(&before, &(middle + across * *t));
        steps.min_by(|a, b| off(a).total_cmp(&off(b))).unwrap()
    };
    for (outer, way) in [(true, 6.0), (true, -4.0), (false, -6.0), (false, 4.0)] {
        let place = middle + across * (side(outer) + way);
        let model = fitted(vec![ThroughPoint { outer, place }]).unwrap().model;
        let after = model.apparent_mesh();
        let off = distance(after, &place);
        assert!(off < 1.0, "outer {outer}, {way}: {off} mm from the point");
        assert_eq!(model.self_intersections, 0);
        let far = before.vertices.iter().zip(&after.vertices);
        let far = far.filter(|(p, _)| (**p - place).norm() > 45.0);
        let moved = far.map(|(p, q)| (p - q).norm()).fold(0.0, f64::max);
        assert!(
            moved < 1.5,
            "outer {outer}, {way}: {moved} mm far from the point"
        );
    }
    let far = middle + across * 120.0;
    let error = fitted(vec![ThroughPoint {
        outer: true,
        place: far,
    }]);
    assert!(matches!(
        error.unwrap_err(),
        DeformError::PointTooFar { outer: true, .. }
    ));
}

#[test]
fn support_springs_are_refused_where_their_number_would_be_too_large() {
    let volume = picture(40, 2.0, |p| ball(p, &Vec3::zeros(), 30.0));
    let token = CancelToken::new();
    token.cancel();
    // Nothing but the check is done.
    let cancelled = Monitor::new(&Silent, token);
    let result = |detail: u32, support: f64| {
        let model = shapes::icosphere(20.0, detail);
        let template = Template::new(model, Organ::Generic, &Monitor::silent()).unwrap();
        let mut parameters = DeformParameters::default();
        parameters.stiffness.support = support;
        fit(&volume, &template, &parameters, &cancelled).unwrap_err()
    };
    let nodes = shapes::icosphere(20.0, 4).vertices.len();
    let refused = result(4, 0.02);
    assert!(
        matches!(refused, DeformError::TooManyNodes { nodes: n, limit } if n == nodes && limit < n),
        "{refused}"
    );
    for (detail, support) in [(4, 0.0), (3, 0.02)] {
        let error = result(detail, support);
        assert!(
            !matches!(error, DeformError::TooManyNodes { .. }),
            "{error}"
        );
    }
}

#[test]
fn merit_falls_with_misfit_strain_and_doubts_and_rises_with_what_is_seen() {
    let volume = picture(40, 2.0, |p| ball(p, &Vec3::zeros(), 30.0));
    let model = shapes::icosphere(20.0, 2);
    let template = Template::new(model, Organ::Generic, &Monitor::silent()).unwrap();
    let parameters = DeformParameters::default();
    let found = fit(&volume, &template, &parameters, &Monitor::silent()).unwrap();
    let merit = |change: &dyn Fn(&mut Fit)| {
        let mut fit = found.clone();
        change(&mut fit);
        fit.merit()
    };
    let usual = merit(&|fit| fit.model.strain = 0.0);
    let falls = |change: &dyn Fn(&mut Fit), by: f64| {
        let changed = merit(&|fit| {
            fit.model.strain = 0.0;
            change(fit);
        });
        assert!(
            (usual - changed - by).abs() < 1e-12,
            "{usual} {changed} {by}"
        );
    };
    falls(&|fit| fit.model.active -= 0.1, 0.1);
    falls(&|fit| fit.model.residual += 1.0, 0.05);
    falls(&|fit| fit.model.strain = 0.04, 0.1);
    falls(
        &|fit| {
            fit.judgement
                .flags
                .push(Flag::UncertainPlace { confidence: 0.1 })
        },
        0.02,
    );
    // A model that ends short of a dark apex, or of the image's end, does not see it.
    falls(
        &|fit| {
            fit.judgement.flags.extend([
                Flag::DarkApex {
                    uptake: 0.3,
                    part: DarkPart::Sector { degrees: 90.0 },
                },
                Flag::FieldOfView { area_cm2: 20.0 },
            ])
        },
        0.0,
    );
}

#[test]
fn merit_falls_with_the_change_of_length_where_the_apex_does_not_show() {
    let template = ventricle(cup(Vec3::zeros(), axis(), 1.0));
    let volume = scan(&cup(Vec3::new(5.0, -8.0, 3.0), axis(), 1.05), 56, |_| 1.0);
    let parameters = DeformParameters::default();
    let mut found = fit(&volume, &template, &parameters, &Monitor::silent()).unwrap();
    let long_axis = found.model.localisation.as_ref().unwrap().cup.axis;
    let mut merit = |by: f64, offset: f64, dark: bool| {
        let place = found.model.localisation.as_mut().unwrap();
        place.dark_apex = dark.then_some(0.2);
        // The whole scene moves along the axis, which changes no length.
        place.cup.centre += long_axis * offset;
        for p in &mut found.model.mesh.vertices {
            *p += long_axis * offset;
        }
        found.model.displacements.fill(long_axis * by);
        found.merit()
    };
    let usual = merit(0.0, 0.0, false);
    assert_eq!(merit(10.0, 0.0, false), usual);
    assert_eq!(merit(0.0, 0.0, true), usual);
    for by in [-10.0, 10.0] {
        let near = merit(by, 0.0, true);
        // Half the logarithm of about 80 mm over 90 mm or 70 mm.
        assert!((0.03..0.12).contains(&(usual - near)), "{near} {usual}");
        let far = merit(by, 300.0, true);
        assert!((near - far).abs() < 1e-9, "{near} {far}");
    }
}

/// Correlated noise: the output of a linear congruential generator, blurred.
fn noise(seed: u64, sigma: f64) -> Volume {
    let mut state = seed;
    let mut volume = picture(40, 0.0, |_| 0.0);
    for v in &mut volume.voxels {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        *v = (state >> 40) as f32 / (1u64 << 24) as f32;
    }
    volume.voxels = Field::new(&volume, None, sigma).values().to_vec();
    volume
}

#[test]
fn a_volume_without_a_heart_is_an_error() {
    let template = ventricle(cup(Vec3::zeros(), axis(), 1.0));
    let parameters = DeformParameters::default();
    let fit_to = |volume: &Volume| fit(volume, &template, &parameters, &Monitor::silent());
    let blank = picture(40, 0.0, |_| 7.0);
    assert!(matches!(
        fit_to(&blank),
        Err(DeformError::Localise(LocateError::Blank))
    ));
    let shell = |p: &Vec3, radius: f64, wall: f64| {
        ball(p, &Vec3::zeros(), radius) - ball(p, &Vec3::zeros(), radius - wall)
    };
    // A solid ball; a closed shell like a stomach; a larger one like a skull or a cortex; a ring.
    let others = [
        ("ball", picture(40, 4.5, |p| ball(p, &Vec3::zeros(), 40.0))),
        ("stomach", picture(40, 4.5, |p| shell(p, 38.0, 10.0))),
        (
            "brain",
            picture(50, 4.5, |p| {
                shell(&Vec3::new(p.x, 0.8 * p.y, p.z), 66.0, 16.0)
            }),
        ),
        (
            "torus",
            picture(40, 4.5, |p| {
                let tube = Vec3::new(p.x.hypot(p.y) - 35.0, 0.0, p.z);
                ball(&tube, &Vec3::zeros(), 10.0)
            }),
        ),
        ("noise", noise(1, 0.0)),
        ("smooth noise", noise(2, 4.0)),
        ("smoother noise", noise(3, 8.0)),
    ];
    for (name, volume) in &others {
        match fit_to(volume) {
            Err(DeformError::Localise(LocateError::NoHeart { .. })) => {}
            other => panic!("{name}: {:?}", other.map(|f| f.model.localisation)),
        }
    }
}

#[test]
fn bad_input_is_named() {
    let template = ventricle(cup(Vec3::zeros(), axis(), 1.0));
    let volume = picture(24, 0.0, |p| ball(p, &Vec3::zeros(), 20.0));
    let try_with = |change: &dyn Fn(&mut DeformParameters)| {
        let mut parameters = DeformParameters::default();
        change(&mut parameters);
        fit(&volume, &template, &parameters, &Monitor::silent()).unwrap_err()
    };
    assert!(matches!(
        try_with(&|p| p.reach = f64::NAN),
        DeformError::Parameter { field: "reach", .. }
    ));
    assert!(matches!(
        try_with(&|p| p.motion.time_step = 0.0),
        DeformError::Parameter {
            field: "motion.time_step",
            ..
        }
    ));
    assert_eq!(
        try_with(&|p| p.hints.centre = Some(Vec3::new(f64::INFINITY, 0.0, 0.0))),
        DeformError::HintNotFinite
    );
    let sphere = shapes::icosphere(30.0, 2);
    assert!(matches!(
        Template::new(sphere, Organ::LeftVentricle, &Monitor::silent()),
        Err(TemplateError::NoCup { .. })
    ));
    let mut open = shapes::icosphere(30.0, 2);
    open.triangles.pop();
    assert!(matches!(
        Template::new(open, Organ::Generic, &Monitor::silent()),
        Err(TemplateError::Topology(_))
    ));
}

#[test]
fn a_cancelled_fit_ends() {
    let token = CancelToken::new();
    token.cancel();
    let monitor = Monitor::new(&Silent, token);
    let template = ventricle(cup(Vec3::zeros(), axis(), 1.0));
    let volume = picture(24, 0.0, |p| ball(p, &Vec3::zeros(), 20.0));
    assert!(fit(&volume, &template, &DeformParameters::default(), &monitor).is_err());
}

/// The hearts are fitted side by side: the thread that fits each of them changes nothing.
#[test]
fn the_built_in_hearts_fit_alike_on_any_number_of_threads() {
    let volume = scan(&cup(Vec3::zeros(), axis(), 1.0), 56, |_| 1.0);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let fit = pool.install(|| {
            let (parameters, mut search) = (DeformParameters::default(), OrganSearch::default());
            fit_built_in(&volume, &parameters, &mut search, &Monitor::silent())
        });
        let Fit { model, judgement } = fit.unwrap();
        (model.mesh, model.readings, judgement.confidence)
    };
    let one = on(1);
    assert_eq!(one, on(2));
    assert_eq!(one, on(8));
}
