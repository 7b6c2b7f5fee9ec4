//! One bright body: where to start for organs other than the ventricle.
//!
//! The largest connected part (6-neighbours) of the coarse picture above 40 % of its
//! maximum, or the part nearest to the hinted centre. Its centroid and volume give shift and scale;
//! it shows no reliable rotation, which is left to the alignment.
//!
//! In a map of several labels, the label nearest to the hinted centre, or else the most frequent
//! one, is taken as a mask; the others count as background.

use super::error::LocateError;
use super::hints::Hints;
use crate::base::geometry::Vec3;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::field::Field;
use crate::image::grid::survey::label_map;
use crate::image::grid::volume::Volume;
use std::collections::BTreeMap;

/// Samples of the coarse picture, mm.
const COARSE_VOXEL_MM: f64 = 4.0;
/// Share of the maximum that belongs to the body.
const BODY_LEVEL_SHARE: f32 = 0.4;

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
/// [`LocateError::Blank`] if no value is positive, [`LocateError::HintOutside`] if no part lies in
/// the hinted region.
pub fn find(volume: &Volume, hints: &Hints, monitor: &Monitor) -> Result<Blob, LocateError> {
    let field = Field::coarse(volume, None, COARSE_VOXEL_MM, monitor)?;
    let level = BODY_LEVEL_SHARE * field.values().iter().fold(0f32, |a, b| a.max(*b));
    if !(level > 0.0) {
        return Err(LocateError::Blank);
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
    best.ok_or(LocateError::HintOutside)
}

/// The mask of one label of a map that has several; `None` for any other volume.
///
/// # Errors
/// [`Cancelled`].
pub fn one_label(
    volume: &Volume,
    hints: &Hints,
    monitor: &Monitor,
) -> Result<Option<Volume>, Cancelled> {
    // A body in a constant background has two values as well; a map has unlabelled voxels.
    let several =
        |l: &BTreeMap<i64, usize>| l.len() > 1 && l.values().sum::<usize>() < volume.voxels.len();
    let Some(labels) = label_map(volume, monitor)?.filter(several) else {
        return Ok(None);
    };
    let most = labels
        .iter()
        .max_by_key(|(label, count)| (**count, -**label));
    let label = match hints.centre {
        Some(centre) => nearest_label(volume, &centre),
        None => most.map(|(label, _)| *label as f32),
    };
    Ok(label.map(|label| Volume {
        voxels: volume
            .voxels
            .iter()
            .map(|v| f32::from(u8::from(*v == label)))
            .collect(),
        shape: volume.shape,
        frame: volume.frame.clone(),
        integral: true,
    }))
}

/// The label of the labelled voxel nearest to `centre`.
fn nearest_label(volume: &Volume, centre: &Vec3) -> Option<f32> {
    let [nx, ny, _] = volume.shape;
    let labelled = (0..volume.voxels.len()).filter(|v| volume.voxels[*v] != 0.0);
    let distance = |v: usize| {
        let index = [v % nx, v / nx % ny, v / (nx * ny)].map(|x| x as f64);
        (volume.frame.to_patient(&Vec3::from(index)) - centre).norm_squared()
    };
    labelled
        .map(|v| (distance(v), volume.voxels[v]))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, label)| label)
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

#[cfg(test)]
mod tests {
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::image::locate::body::*;

    /// Two balls side by side: label 1 small on the left (+x), label 3 large on the right.
    fn map() -> Volume {
        let shape = [40, 24, 24];
        let frame = VoxelToPatient::centred(shape, [4.0; 3], Vec3::zeros()).unwrap();
        let inside = |p: &Vec3, x: f64, radius: f64| (p - Vec3::new(x, 0.0, 0.0)).norm() < radius;
        let label = |p: &Vec3| match (inside(p, 40.0, 24.0), inside(p, -30.0, 36.0)) {
            (true, _) => 1.0,
            (_, true) => 3.0,
            _ => 0.0,
        };
        Volume {
            integral: true,
            ..Volume::sampled(shape, frame, label)
        }
    }

    #[test]
    fn one_label_is_looked_at_and_the_centre_says_which() {
        let volume = map();
        let found = |centre: Option<Vec3>| {
            let hints = Hints {
                centre,
                ..Hints::default()
            };
            let mask = one_label(&volume, &hints, &Monitor::silent())
                .unwrap()
                .unwrap();
            find(&mask, &hints, &Monitor::silent()).unwrap()
        };
        assert!((found(None).centre.x + 30.0).abs() < 1.0);
        assert!((found(Some(Vec3::new(44.0, 5.0, 0.0))).centre.x - 40.0).abs() < 1.0);
        let mut mask = volume.clone();
        mask.voxels.iter_mut().for_each(|v| *v = v.min(1.0));
        let none = one_label(&mask, &Hints::default(), &Monitor::silent()).unwrap();
        assert!(none.is_none(), "one label is a mask already");
    }
}
