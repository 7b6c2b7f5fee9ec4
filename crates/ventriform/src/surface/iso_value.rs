//! The iso-value among intensities: where the surface lies between dark and bright.
//!
//! In: the level in the parameters ([`IsoLevel`]) and the reference that fractions refer to: the
//! wall's intensity where a ventricle was found ([`region`]), else the box's. Out: the iso-value.
//!
//! 1. [`choose`]: half the reference by default.
//! 2. [`move_from`]: where half the reference tears the wall or closes the cavity, other
//!    fractions near by are tried.

use super::{IsoLevel, SurfaceError, SurfaceFacts, region};
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::Volume;
use crate::image::grid::survey::{self, Survey};

/// Volume of enclosed voids above which the cavity counts as closed, ml.
const CLOSED_ML: f64 = 2.0;

pub(super) fn no_surface(iso: f32, survey: &Survey) -> SurfaceError {
    SurfaceError::NoSurface {
        iso: f64::from(iso),
        minimum: survey.minimum,
        maximum: survey.maximum,
    }
}

pub(super) fn note(facts: &mut SurfaceFacts, iso: f32, reference: f32) {
    facts.iso_value = f64::from(iso);
    facts.reference = f64::from(reference);
    facts.iso_fraction = f64::from(iso) / f64::from(reference);
}

/// The iso-value of `level`; half the reference by default.
pub(super) fn choose(
    level: IsoLevel,
    reference: f32,
    survey: &Survey,
) -> Result<f32, SurfaceError> {
    let iso = match level {
        IsoLevel::Auto => 0.5 * reference,
        IsoLevel::Fraction(f) => f as f32 * reference,
        IsoLevel::Absolute(v) => v as f32,
        // `extract` turns the volume over first.
        IsoLevel::Below(v) => -v as f32,
    };
    if iso > survey.maximum || iso <= survey.minimum {
        return Err(no_surface(iso, survey));
    }
    Ok(iso)
}

/// Moves the automatic iso-value where half the reference tears the wall (down to 0.35) or
/// closes the cavity (up to 0.6), and adds a warning. Where no fraction helps, it is kept.
pub(super) fn move_from(
    volume: &Volume,
    wall: &region::WallShell,
    iso: f32,
    region: region::Region,
    facts: &mut SurfaceFacts,
    monitor: &Monitor,
) -> Result<(f32, region::Region), SurfaceError> {
    let voxel_ml = volume.frame.voxel_volume() / 1000.0;
    let enclosed_ml = |r: &region::Region| {
        let voxels = r.enclosed_voxels(monitor)?;
        Ok::<f64, Cancelled>(voxels as f64 * voxel_ml)
    };
    let (fractions, why): (&[f32], _) = if region.is_torn() {
        (&[0.45, 0.4, 0.35], "the wall falls into pieces")
    } else if enclosed_ml(&region)? > CLOSED_ML {
        (&[0.55, 0.6], "the cavity closes at the base")
    } else {
        return Ok((iso, region));
    };
    for &fraction in fractions {
        let level = fraction * wall.reference;
        if let Some(moved) = wall.region(level, monitor)?
            && !moved.is_torn()
            && enclosed_ml(&moved)? <= CLOSED_ML
        {
            facts.warnings.push(format!(
                "at half the reference intensity {why}; the iso-value was moved to {fraction} of it"
            ));
            return Ok((level, moved));
        }
    }
    facts.warnings.push(format!(
        "at half the reference intensity {why}, and at no iso-value near by does it not"
    ));
    Ok((iso, region))
}

/// 98th percentile of the voxels above 0.3 of the box's maximum.
///
/// # Errors
/// [`Cancelled`].
pub(super) fn reference_in_box(
    volume: &Volume,
    origin: [usize; 3],
    extent: [usize; 3],
    survey: &Survey,
    monitor: &Monitor,
) -> Result<f32, Cancelled> {
    let mut highest = survey.minimum;
    for row in rows_in_box(volume, origin, extent) {
        monitor.check()?;
        highest = row
            .iter()
            .copied()
            .filter(|v| v.is_finite())
            .fold(highest, f32::max);
    }
    let floor = if highest > 0.0 {
        0.3 * highest
    } else {
        survey.minimum
    };
    // A histogram instead of a sorted copy: the box may be the whole of a large volume.
    const HISTOGRAM_BINS: usize = 4096;
    let width = f64::from(highest) - f64::from(floor);
    if !(width > 0.0) {
        return Ok(highest);
    }
    let mut histogram = vec![0u64; HISTOGRAM_BINS];
    for row in rows_in_box(volume, origin, extent) {
        monitor.check()?;
        for v in row.iter().filter(|v| v.is_finite() && **v > floor) {
            let bin = ((f64::from(*v) - f64::from(floor)) / width * HISTOGRAM_BINS as f64) as usize;
            histogram[bin.min(HISTOGRAM_BINS - 1)] += 1;
        }
    }
    let total: u64 = histogram.iter().sum();
    let mut below = 0;
    for (bin, n) in histogram.iter().enumerate() {
        below += n;
        if 100 * below >= 98 * total {
            let share = (bin as f64 + 0.5) / HISTOGRAM_BINS as f64;
            return Ok((f64::from(floor) + share * width) as f32);
        }
    }
    Ok(highest)
}

pub(super) fn otsu_in_box(
    volume: &Volume,
    origin: [usize; 3],
    extent: [usize; 3],
    survey: &Survey,
    monitor: &Monitor,
) -> Result<f32, Cancelled> {
    let rows: Vec<&[f32]> = rows_in_box(volume, origin, extent).collect();
    survey::otsu(&rows, survey.minimum, survey.maximum, monitor)
}

fn rows_in_box(
    volume: &Volume,
    origin: [usize; 3],
    extent: [usize; 3],
) -> impl Iterator<Item = &[f32]> {
    let [nx, ny, _] = volume.shape;
    (0..extent[1] * extent[2]).map(move |row| {
        let (j, k) = (row % extent[1] + origin[1], row / extent[1] + origin[2]);
        let start = origin[0] + nx * (j + ny * k);
        &volume.voxels[start..start + extent[0]]
    })
}
