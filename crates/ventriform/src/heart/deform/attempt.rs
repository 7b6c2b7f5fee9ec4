//! Runs of the motion, repeated with a stiffer model while the result is folded.

use super::anatomical::BlurredImage;
use super::base_plane::{self, rim_heights};
use super::dynamics::{self, MotionResult};
use super::elastic::Elastic;
use super::fitted_model::{FittedModel, WallSurface, WallSurfaces};
use super::parameters::DeformParameters;
use super::sensors::{SensorReading, SensorSettings};
use super::setup::FitSetup;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::model::Template;
use crate::heart::model::wall::{self, VentricleWall};
use crate::image::locate::patient_orientation::{OrientationSource, PatientOrientation};
use crate::mesh::TriMesh;
use crate::mesh::intersections::self_intersections;

/// Repetitions of a folded fit.
const MAX_RETRIES: usize = 3;
/// Factor of the stiffness from one repetition to the next.
const STIFFNESS_FACTOR: f64 = 4.0;

/// One run of the motion and its folds.
pub struct Attempt {
    moved: MotionResult,
    strain: f64,
    intersections: usize,
    turned: usize,
    runs: usize,
}

impl Attempt {
    /// Repeats the motion with a stiffer model until nothing is folded; the least folded run
    /// otherwise.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn best(
        aligned: &TriMesh,
        template: &Template,
        setup: &FitSetup,
        parameters: &DeformParameters,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let wide = setup.sensors(parameters, parameters.sensor);
        let near = SensorSettings {
            reach: (0.8 * wide.reach).max(parameters.motion.last_reach),
            ..wide
        };
        let mut best: Option<Self> = None;
        for run in 1..=1 + MAX_RETRIES {
            let stiffness = parameters
                .stiffness
                .times(STIFFNESS_FACTOR.powi(run as i32 - 1));
            let body = Elastic::new(aligned, &template.struts, stiffness);
            let moved = dynamics::run(
                aligned,
                &body,
                &setup.field,
                &near,
                &parameters.through,
                &parameters.motion,
                monitor,
            )?;
            let attempt = Self {
                strain: body.strain(&moved.mesh.vertices),
                intersections: self_intersections(&moved.mesh).len(),
                turned: turned(aligned, &moved.mesh),
                moved,
                runs: run,
            };
            let faults = attempt.faults();
            let better = best.as_ref().is_none_or(|b| faults < b.faults());
            if better {
                best = Some(attempt);
            }
            if let Some(best) = &mut best {
                best.runs = run;
            }
            if faults == 0 {
                break;
            }
        }
        Ok(best.expect("the loop runs at least once and takes its first attempt"))
    }

    fn faults(&self) -> usize {
        self.intersections + self.turned
    }

    /// The fitted model: the run's result with the base plane put, and both walls of a ventricle.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn into_model(
        self,
        template: &Template,
        setup: &FitSetup,
        aligned: &TriMesh,
        parameters: &DeformParameters,
        monitor: &Monitor,
    ) -> Result<FittedModel, Cancelled> {
        let orientation = setup.patient_orientation;
        let (active, residual) = edges_seen(&self.moved.readings);
        let cup = template
            .cup
            .map(|cup| wall::carried(&cup, &template.mesh, &self.moved.mesh));
        let wall_of = |mesh: &TriMesh| {
            cup.map(|cup| VentricleWall::new(mesh, &cup, &orientation.superior, monitor))
                .transpose()
        };
        let sensed_wall = wall_of(&self.moved.mesh)?;
        let sensed_rim_mm =
            cup.and_then(|cup| rim_heights(&self.moved.mesh, &cup, &orientation.superior));
        let settles = settles_rim(&orientation, parameters);
        let seen = cup.zip(sensed_wall.as_ref()).filter(|_| settles);
        let rim_evidence = seen.and_then(|(cup, wall)| {
            let (mesh, field) = (&self.moved.mesh, &setup.field);
            base_plane::rim_evidence(mesh, &cup, &orientation.superior, wall, field)
        });
        let settled = cup.and_then(|cup| {
            let (mesh, superior) = (&self.moved.mesh, &orientation.superior);
            match &parameters.base {
                Some(base) => base_plane::put(mesh, &cup, superior, base),
                None if settles => base_plane::settled(mesh, &cup, superior, rim_evidence.as_ref()),
                None => None,
            }
        });
        let (mesh, wall) = match settled {
            Some(mesh) => {
                let wall = wall_of(&mesh)?;
                (mesh, wall)
            }
            None => (self.moved.mesh, sensed_wall.clone()),
        };
        let posed = &setup.posed.vertices;
        let displacements = mesh.vertices.iter().zip(posed).map(|(p, q)| p - q);
        let displacements = displacements.collect();
        let turned_triangles = turned(aligned, &mesh);
        let wall_ml = mesh.volume() / 1000.0;
        let (shown, surfaces) = match (wall, &cup) {
            (Some(wall), Some(cup)) => {
                let apparent = WallSurface {
                    mesh,
                    wall,
                    wall_ml,
                };
                let image = BlurredImage {
                    field: &setup.field,
                    smoothness_mm: setup.smoothness_mm,
                    noise_length_mm: setup.noise_length_mm,
                    resolution_mm: parameters.resolution,
                };
                let both = WallSurfaces::new(
                    apparent,
                    cup,
                    &orientation,
                    &image,
                    parameters.muscle_ml,
                    monitor,
                )?;
                let shown = both.at_edge(parameters.edge).clone();
                ((shown.mesh, Some(shown.wall), shown.wall_ml), Some(both))
            }
            _ => ((mesh, None, wall_ml), None),
        };
        let (mesh, wall, wall_ml) = shown;
        Ok(FittedModel {
            mesh,
            displacements,
            localisation: setup.localisation.clone(),
            cup,
            patient_orientation: cup.map(|_| orientation),
            wall,
            wall_ml,
            surfaces,
            sensed_wall,
            sensed_rim_mm,
            rim_evidence,
            smoothness_mm: setup.smoothness_mm,
            noise_length_mm: setup.noise_length_mm,
            readings: self.moved.readings,
            scale: setup.pose.scale(),
            rotation: *setup.pose.rotation(),
            reason: self.moved.reason,
            iterations: self.moved.iterations,
            runs: self.runs,
            energy: self.moved.energy,
            residual,
            active,
            strain: self.strain,
            self_intersections: self.intersections,
            turned_triangles,
        })
    }
}

/// Whether anatomy and image together put a ventricle's rim: where nobody has given its base, and its sides are known.
fn settles_rim(orientation: &PatientOrientation, parameters: &DeformParameters) -> bool {
    parameters.base.is_none() && orientation.source != OrientationSource::Unknown
}

/// The share of area whose sensors see an edge, and the weighted rms distance to the edges, mm;
/// infinite without any edge.
fn edges_seen(readings: &[SensorReading]) -> (f64, f64) {
    let seen: f64 = readings.iter().map(|r| r.share * r.weight).sum();
    let misfit: f64 = readings
        .iter()
        .map(|r| r.share * r.weight * r.offset * r.offset)
        .sum();
    let active = readings
        .iter()
        .filter(|r| r.weight > 0.25)
        .map(|r| r.share)
        .sum::<f64>();
    let residual = if seen > 0.0 {
        (misfit / seen).sqrt()
    } else {
        f64::INFINITY
    };
    (active, residual)
}

/// The number of triangles whose normal turned by 90 degrees or more from `before` to `now`.
fn turned(before: &TriMesh, now: &TriMesh) -> usize {
    (0..now.triangles.len())
        .filter(|t| before.area_normal(*t).dot(&now.area_normal(*t)) <= 0.0)
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;

    /// Readings of a quarter and of three quarters of the area.
    fn readings(weights: [f64; 2], offsets: [f64; 2]) -> [SensorReading; 2] {
        let reading = |share: f64, weight: f64, offset: f64| SensorReading {
            place: Vec3::zeros(),
            normal: Vec3::z(),
            offset,
            weight,
            share,
        };
        [
            reading(0.25, weights[0], offsets[0]),
            reading(0.75, weights[1], offsets[1]),
        ]
    }

    /// The distance is the root of the mean square, each sensor counting by area and weight.
    #[test]
    fn edges_are_seen_where_the_weight_says_so_and_as_far_as_they_lie() {
        let (active, residual) = edges_seen(&readings([1.0, 1.0], [-3.0, 3.0]));
        assert!(active == 1.0 && (residual - 3.0).abs() < 1e-12);
        let (active, residual) = edges_seen(&readings([0.6, 0.2], [4.0, -1.0]));
        assert_eq!(active, 0.25);
        // Both count alike: 0.25 times 0.6 is 0.75 times 0.2.
        assert!((residual - f64::midpoint(16.0, 1.0).sqrt()).abs() < 1e-12);
        let (active, residual) = edges_seen(&readings([0.0, 0.0], [1.0, 1.0]));
        assert!(active == 0.0 && residual.is_infinite());
    }
}
