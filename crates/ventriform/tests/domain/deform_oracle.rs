//! The implicit integrator against an explicit one that shares no code with its solver.
//!
//! Semi-implicit Euler on m x'' = -g m x' + elastic forces + sensor forces, with the forces
//! computed as gradients of the energies and with small steps, ends in the state in which the
//! implicit steps end. The states are not equal to the last digit: the implicit run fixes the mean
//! of its sensors' readings after some steps, the reference reads them before every step.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::heart::deform::dynamics::{self, Motion, StopReason};
use ventriform::heart::deform::elastic::{Elastic, Stiffness};
use ventriform::heart::deform::sensors::{
    self, EdgeShift, PER_TRIANGLE, SensorKind, SensorSettings,
};
use ventriform::heart::model::area_shares;
use ventriform::heart::model::struts::struts;
use ventriform::image::grid::field::Field;
use ventriform::image::volume::Volume;
use ventriform::mesh::{TriMesh, shapes};

const SPACING_MM: f64 = 4.0;

/// A thick-walled half ellipsoid, smooth in space: 1 in the wall, 0 elsewhere.
fn patient() -> Volume {
    let shape = [32; 3];
    let frame =
        VoxelToPatient::centred(shape, [SPACING_MM; 3], Vec3::new(0.0, 0.0, -25.0)).unwrap();
    let edge = |distance: f64| (0.5 + distance / 12.0).clamp(0.0, 1.0);
    let mut volume = Volume::sampled(shape, frame, |p| {
        let shell = |long: f64, wide: f64| {
            let r = Vec3::new(p.x / wide, p.y / (0.93 * wide), p.z / long).norm();
            edge((1.0 - r) * wide)
        };
        (shell(66.0, 33.0) - shell(53.0, 20.0)) * edge(2.0 - p.z)
    });
    volume.voxels = Field::new(&volume, None, 3.0).values().to_vec();
    volume
}

/// Steps of the reference integrator until it rests.
fn explicit(start: &TriMesh, body: &Elastic, field: &Field, look: &SensorSettings) -> TriMesh {
    const TOTAL_MASS: f64 = 1.0;
    const DAMPING_RATE: f64 = 1.0;
    const TIME_STEP: f64 = 0.4;
    let masses: Vec<f64> = area_shares(start).iter().map(|s| s * TOTAL_MASS).collect();
    let corners = sensors::barycentric();
    let mut mesh = start.clone();
    let mut velocity = vec![Vec3::zeros(); masses.len()];
    for _ in 0..250 {
        let mut forces = body.forces(&mesh.vertices);
        for (s, r) in sensors::read(&mesh, field, look, &Monitor::silent())
            .unwrap()
            .iter()
            .enumerate()
        {
            let pull = r.normal * (r.share * r.weight * r.offset);
            let triangle = mesh.triangles[s / PER_TRIANGLE];
            for (node, w) in triangle.iter().zip(&corners[s % PER_TRIANGLE]) {
                forces[*node as usize] += pull * *w;
            }
        }
        for node in 0..masses.len() {
            let acceleration = forces[node] / masses[node] - velocity[node] * DAMPING_RATE;
            velocity[node] += acceleration * TIME_STEP;
            mesh.vertices[node] += velocity[node] * TIME_STEP;
        }
    }
    let fastest = velocity.iter().map(Vec3::norm).fold(0.0, f64::max);
    assert!(
        fastest < 0.05,
        "still moving by {fastest} mm a unit of time"
    );
    mesh
}

#[test]
fn explicit_and_implicit_steps_end_in_the_same_state() {
    let volume = patient();
    let field = Field::new(&volume, None, 2.0);
    let start = shapes::cup(62.0, 30.0, 13.0, 10);
    let body = Elastic::new(
        &start,
        &struts(&start, &Monitor::silent()).unwrap(),
        Stiffness::default(),
    );
    for kind in [SensorKind::Gradient, SensorKind::HalfMaximum] {
        let look = SensorSettings {
            kind,
            reach: 7.0,
            level: 0.5,
            ceiling: 2.0,
            shift: EdgeShift {
                inner: 0.0,
                outer: 0.0,
                rim: 0.0,
                axis: [Vec3::zeros(), Vec3::new(0.0, 0.0, -40.0)],
            },
            blind: None,
        };
        let motion = Motion {
            last_reach: look.reach,
            tolerance: 0.01,
            ..Motion::default()
        };
        let monitor = Monitor::silent();
        let implicit = dynamics::run(&start, &body, &field, &look, &[], &motion, &monitor).unwrap();
        assert_eq!(implicit.reason, StopReason::Converged);
        let reference = explicit(&start, &body, &field, &look);
        let pairs = || reference.vertices.iter().zip(&implicit.mesh.vertices);
        let moved: f64 = reference
            .vertices
            .iter()
            .zip(&start.vertices)
            .map(|(p, q)| (p - q).norm())
            .sum::<f64>()
            / start.vertices.len() as f64;
        let apart = pairs().map(|(p, q)| (p - q).norm()).sum::<f64>() / start.vertices.len() as f64;
        let farthest = pairs().map(|(p, q)| (p - q).norm()).fold(0.0, f64::max);
        // Both move far (4.7 and 4.1 mm) and end close together: 0.147 and 0.134 voxels apart in
        // the mean, 0.31 at most. They cannot be equal, because one rests on the mean of twelve
        // readings and the other on the last one.
        assert!(moved > 4.0, "{moved}");
        assert!(
            apart < 0.15 * SPACING_MM,
            "{kind:?}: {apart} mm in the mean"
        );
        assert!(
            farthest < 0.35 * SPACING_MM,
            "{kind:?}: {farthest} mm at most"
        );
    }
}
