//! Runs of the motion, repeated with a stiffer model while the result is folded.

use super::confidence;
use super::doubts;
use super::dynamics::{self, Moved};
use super::elastic::Elastic;
use super::evidence::{Edges, Evidence};
use super::fit::Fit;
use super::flags::Flag;
use super::parameters::DeformParameters;
use super::rim;
use super::sensors::{PER_TRIANGLE, SensorReading, SensorSettings};
use super::setup::FitSetup;
use super::uncertainty::NodeEvidence;
use super::views::Views;
use crate::geometry::Vec3;
use crate::grid::Volume;
use crate::locate::patient_orientation::OrientationSource;
use crate::mesh::TriMesh;
use crate::mesh::intersections::self_intersections;
use crate::model::wall::{self, ROWS, VentricleWall};
use crate::model::{Organ, Template};
use crate::progress::{Cancelled, Monitor};

/// Repetitions of a folded fit.
const RETRIES: usize = 3;
/// Factor of the stiffness from one repetition to the next.
const STIFFER: f64 = 4.0;

/// One run of the motion and its folds.
pub struct Attempt {
    moved: Moved,
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
        for run in 1..=1 + RETRIES {
            let stiffness = parameters.stiffness.times(STIFFER.powi(run as i32 - 1));
            let body = Elastic::new(aligned, &template.struts, stiffness);
            let moved = dynamics::run(
                aligned,
                &body,
                &setup.field,
                &near,
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

    /// The figures of the run.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn into_fit(
        self,
        volume: &Volume,
        template: &Template,
        setup: &FitSetup,
        aligned: &TriMesh,
        parameters: &DeformParameters,
        monitor: &Monitor,
    ) -> Result<Fit, Cancelled> {
        let orientation = setup.patient_orientation;
        let (active, residual) = edges_seen(&self.moved.readings);
        let cup = template
            .cup
            .map(|cup| wall::carried(&cup, &template.mesh, &self.moved.mesh));
        let wall_of = |mesh: &TriMesh| {
            cup.map(|cup| VentricleWall::new(mesh, &cup, &orientation.superior, monitor))
                .transpose()
        };
        // The confidence is calibrated on the wall as the sensors left it, before its rim moves.
        let felt = wall_of(&self.moved.mesh)?;
        let superior = &orientation.superior;
        let settled = match &parameters.base {
            Some(base) => cup.and_then(|cup| rim::put(&self.moved.mesh, &cup, superior, base)),
            None => cup
                .filter(|_| orientation.source != OrientationSource::Unknown)
                .and_then(|cup| rim::settled(&self.moved.mesh, &cup, superior)),
        };
        let (mesh, wall) = match settled {
            Some(mesh) => {
                let wall = wall_of(&mesh)?;
                (mesh, wall)
            }
            None => (self.moved.mesh, felt.clone()),
        };
        let posed = &setup.posed.vertices;
        let mut fit = Fit {
            displacements: mesh
                .vertices
                .iter()
                .zip(posed)
                .map(|(p, q)| p - q)
                .collect(),
            cup,
            scale: setup.pose.scale(),
            rotation: *setup.pose.rotation(),
            confidence: 0.0,
            evidence: None,
            nodes: Vec::new(),
            localisation: setup.localisation.clone(),
            reason: self.moved.reason,
            iterations: self.moved.iterations,
            runs: self.runs,
            energy: self.moved.energy,
            residual,
            active,
            strain: self.strain,
            self_intersections: self.intersections,
            turned_triangles: turned(aligned, &mesh),
            wall_ml: mesh.volume() / 1000.0,
            surfaces: None,
            patient_orientation: cup.map(|_| setup.patient_orientation),
            wall,
            mesh,
            flags: Vec::new(),
        };
        if let (Some(wall), Some(found)) = (&felt, &fit.localisation) {
            let edges = Edges {
                active,
                residual,
                strain: fit.strain.sqrt(),
            };
            let views = match orientation.source {
                OrientationSource::Unknown => None,
                _ => Views::of(&fit.mesh, superior, volume, monitor)?,
            };
            fit.evidence = Evidence::of(wall, &edges, found.hollowness, &setup.field, views);
            fit.nodes = nodes_seen(&fit.mesh, wall, &self.moved.readings);
        }
        let chance = match &fit.evidence {
            Some(evidence) => confidence::of_agreement(evidence, parameters.edge),
            None => fit.place_confidence().min(0.5),
        };
        fit.confidence = fit.chance_there(chance);
        let ventricle = template.organ == Organ::LeftVentricle;
        fit.flags = doubts::flags(&fit, volume, ventricle);
        // The chance is calibrated on images of uptake.
        if fit.flags.iter().any(|f| matches!(f, Flag::LabelMap { .. })) {
            fit.confidence = fit.confidence.min(0.5);
        }
        Ok(fit)
    }
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

/// What the sensors say of each node of `mesh`, whose place along the wall is that in `wall`.
fn nodes_seen(
    mesh: &TriMesh,
    wall: &VentricleWall,
    readings: &[SensorReading],
) -> Vec<NodeEvidence> {
    let mut sums = vec![[0.0; 2]; mesh.vertices.len()];
    for (triangle, sensors) in mesh
        .triangles
        .iter()
        .zip(readings.chunks_exact(PER_TRIANGLE))
    {
        for node in triangle {
            let [seen, share] = &mut sums[*node as usize];
            *seen += sensors.iter().map(|r| r.weight * r.share).sum::<f64>();
            *share += sensors.iter().map(|r| r.share).sum::<f64>();
        }
    }
    let of = |(p, [seen, share]): (&Vec3, [f64; 2])| NodeEvidence {
        seen: if share > 0.0 { seen / share } else { 0.0 },
        way: ((wall.place(p).row + 0.5) / ROWS as f64).clamp(0.0, 1.0),
        spread: None,
    };
    mesh.vertices.iter().zip(sums).map(of).collect()
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
