//! The start for organs that are no ventricle: one bright body.
//!
//! The largest connected part (6-neighbours) of the coarse picture above 40 % of its
//! maximum, or the part that holds the hinted centre. Its centroid and volume give shift and
//! scale; the turn is left to the alignment, because an intensity blob shows none reliably.

use super::cup::Cup;
use super::field::Field;
use super::localise::{Hints, LocaliseError};
use super::template::Pose;
use crate::geometry::Vec3;
use crate::mesh::TriMesh;
use crate::progress::Monitor;
use crate::volume::Volume;

/// Samples of the coarse picture, mm.
const COARSE: f64 = 4.0;
/// Share of the maximum that belongs to the body.
const LEVEL: f32 = 0.4;

/// A bright body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blob {
    /// Its centroid, LPS mm.
    pub centre: Vec3,
    /// Its volume, mm³.
    pub volume: f64,
    /// Its mean value.
    pub uptake: f64,
}

/// Finds the body in `volume`.
///
/// # Errors
/// [`LocaliseError::Blank`] where nothing is bright, [`LocaliseError::HintOutside`] where the
/// hints leave nothing of it.
pub fn find(volume: &Volume, hints: &Hints, monitor: &Monitor) -> Result<Blob, LocaliseError> {
    let field = Field::coarse(volume, COARSE);
    monitor.check()?;
    let level = LEVEL * field.values().iter().fold(0f32, |a, b| a.max(*b));
    if !(level > 0.0) {
        return Err(LocaliseError::Blank);
    }
    let mut label = vec![0u32; field.values().len()];
    let mut best: Option<Blob> = None;
    for seed in 0..label.len() {
        if label[seed] == 0 && field.values()[seed] > level {
            let blob = flood(&field, level, seed, &mut label);
            let distance = |b: &Blob| hints.centre.map_or(0.0, |c| (b.centre - c).norm());
            let inside = hints
                .region
                .as_ref()
                .is_none_or(|r| r.squared_distance(&blob.centre) == 0.0);
            let better = best.as_ref().is_none_or(|b| match hints.centre {
                Some(_) => distance(&blob) < distance(b),
                None => blob.volume > b.volume,
            });
            if inside && better {
                best = Some(blob);
            }
        }
    }
    best.ok_or(LocaliseError::HintOutside)
}

/// Marks and measures the part above `level` that holds `seed`.
fn flood(field: &Field, level: f32, seed: usize, label: &mut [u32]) -> Blob {
    let [nx, ny, nz] = field.shape();
    let (mut count, mut sum, mut value) = (0usize, Vec3::zeros(), 0.0);
    let mut stack = vec![seed];
    label[seed] = 1;
    while let Some(v) = stack.pop() {
        let (i, j, k) = (v % nx, v / nx % ny, v / (nx * ny));
        count += 1;
        sum += field.to_patient(&Vec3::new(i as f64, j as f64, k as f64));
        value += f64::from(field.values()[v]);
        let mut visit = |admitted: bool, other: usize| {
            if admitted && label[other] == 0 && field.values()[other] > level {
                label[other] = 1;
                stack.push(other);
            }
        };
        visit(i > 0, v.wrapping_sub(1));
        visit(i + 1 < nx, v + 1);
        visit(j > 0, v.wrapping_sub(nx));
        visit(j + 1 < ny, v + nx);
        visit(k > 0, v.wrapping_sub(nx * ny));
        visit(k + 1 < nz, v + nx * ny);
    }
    Blob {
        centre: sum / count as f64,
        volume: count as f64 * field.spacing().iter().product::<f64>(),
        uptake: value / count as f64,
    }
}

impl Blob {
    /// The pose that gives `mesh` this centre and volume.
    pub fn pose(&self, mesh: &TriMesh) -> Pose {
        let centroid: Vec3 = mesh.vertices.iter().sum::<Vec3>() / mesh.vertices.len() as f64;
        let place = |centre: Vec3, volume: f64| Cup {
            centre,
            axis: Vec3::z(),
            length: volume.cbrt(),
            breadth: 1.0,
        };
        Pose::between(
            &place(centroid, mesh.volume()),
            &place(self.centre, self.volume),
            0.0,
        )
    }
}
