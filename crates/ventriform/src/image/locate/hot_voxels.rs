//! Single voxels that outshine a volume, as damaged values do.
//!
//! The search for the heart measures brightness by the volume's greatest value. In a blurred image that is the peak of
//! something as wide as the blur. In: a volume. Out: [`Outshone`] where a few voxels are many times brighter than as
//! many millilitres as the smallest source takes up. The border's artefacts of real scans, hot gut and bladders are
//! not.

use crate::image::grid::volume::Volume;

/// How many times brighter than the rest the greatest value is. A point source has less, blurred by 10 mm or more.
const TIMES: f32 = 8.0;
/// Volume of the brightest voxels that are set apart from the rest, ml.
const APART_ML: f64 = 1.0;
/// Least number of them.
const LEAST_APART: usize = 12;

/// A few voxels outshine all others.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "{count} voxel(s) outshine all others: that at {index:?} (i, j, k from 0) holds {value}, {:.0} times as much as \
     the rest, which reaches {rest}: damaged values, of no scan",
    value / rest
)]
pub struct Outshone {
    /// Number of the voxels that are brighter than the rest by that factor.
    pub count: usize,
    /// Index of the brightest, from 0.
    pub index: [usize; 3],
    /// Its value.
    pub value: f32,
    /// The greatest value of the rest.
    pub rest: f32,
}

/// Checks that no few voxels outshine the rest.
///
/// # Errors
/// [`Outshone`].
pub(super) fn check(volume: &Volume) -> Result<(), Outshone> {
    let brightest = volume
        .voxels
        .iter()
        .copied()
        .filter(|v| v.is_finite())
        .fold(0.0, f32::max);
    let level = brightest / TIMES;
    let mut bright: Vec<usize> = Vec::new();
    let apart = ((APART_ML * 1000.0 / volume.frame.voxel_volume()) as usize).max(LEAST_APART);
    for (number, value) in volume.voxels.iter().enumerate() {
        if value.is_finite() && *value > level {
            bright.push(number);
            if bright.len() > apart {
                return Ok(());
            }
        }
    }
    let rest = volume
        .voxels
        .iter()
        .copied()
        .filter(|v| *v <= level)
        .fold(0.0, f32::max);
    let hottest = bright
        .iter()
        .copied()
        .max_by(|a, b| volume.voxels[*a].total_cmp(&volume.voxels[*b]));
    let [nx, ny, _] = volume.shape;
    match hottest {
        Some(number) if rest > 0.0 => Err(Outshone {
            count: bright.len(),
            index: [number % nx, number / nx % ny, number / (nx * ny)],
            value: volume.voxels[number],
            rest,
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::base::geometry::frame::VoxelToPatient;

    /// A source blurred with this full width at half maximum, in voxels of `spacing`, in a dim background.
    fn source(fwhm_mm: f64, spacing: f64) -> Volume {
        let shape = [24; 3];
        let frame = VoxelToPatient::centred(shape, [spacing; 3], Vec3::zeros()).unwrap();
        let sigma = fwhm_mm / (8.0 * 2_f64.ln()).sqrt();
        let off = Vec3::repeat(spacing / 2.0);
        Volume::sampled(shape, frame, |p| {
            1.0 + 5000.0 * (-(p - off).norm_squared() / (2.0 * sigma * sigma)).exp()
        })
    }

    #[test]
    fn a_point_source_is_none_and_a_few_damaged_voxels_are() {
        for spacing in [2.0, 4.0, 6.4] {
            let scan = source(12.0, spacing);
            assert_eq!(check(&scan), Ok(()), "{spacing}");
            let greatest = scan.voxels.iter().copied().fold(0.0, f32::max);
            for (damaged, times) in [(1, 20.0), (1, 1e6), (3, 20.0), (8, 1e4)] {
                let mut volume = scan.clone();
                for number in 0..damaged {
                    volume.voxels[100 + number] = greatest * times;
                }
                let found = check(&volume).unwrap_err();
                assert_eq!(
                    (found.count, found.rest),
                    (damaged, greatest),
                    "{spacing} {times}"
                );
                assert!((100..100 + damaged).contains(
                    &found.index[0].wrapping_add(24 * (found.index[1] + 24 * found.index[2]))
                ));
            }
            // Artefacts at the border of real scans reach a few times as much as the heart.
            let mut border = source(25.0, spacing);
            border.voxels[5] = 3.0 * border.voxels.iter().copied().fold(0.0, f32::max);
            assert_eq!(check(&border), Ok(()));
        }
    }

    #[test]
    fn nothing_and_a_map_of_labels_are_not_outshone() {
        let mut volume = source(12.0, 4.0);
        for value in [0.0, -3.0, f32::NAN, 1.0] {
            volume.voxels.fill(value);
            assert_eq!(check(&volume), Ok(()));
        }
        volume.voxels.fill(0.0);
        volume.voxels[7] = 1.0;
        assert_eq!(check(&volume), Ok(()));
    }
}
