//! The object among intensities: the left ventricle, or what lies above an iso-value.
//!
//! [`left_ventricle`] is asked first; its [`region`] gives the reference that fractions refer
//! to. Where no ventricle is recognised, or something else was asked for, the reference is the
//! box's own and connected parts are chosen.

use super::object::{self, Object};
use super::{IsoLevel, Isolate, SurfaceError, SurfaceFacts, SurfaceParameters, region};
use crate::grid::components::Components;
use crate::grid::labels::Labels;
use crate::grid::survey;
use crate::grid::survey::Survey;
use crate::locate::cavity as left_ventricle;
use crate::locate::cavity::{DOUBTFUL, PLAUSIBLE};
use crate::progress::Monitor;
use crate::volume::Volume;

/// Enclosed voids from which on the cavity counts as closed, ml.
const CLOSED_ML: f64 = 2.0;

/// Chooses the ventricle, or the part that was asked for.
///
/// # Errors
/// Where nothing reaches the iso-value, or the seed does not.
pub(super) fn select<'a>(
    volume: &'a Volume,
    parameters: &SurfaceParameters,
    survey: &Survey,
    facts: &mut SurfaceFacts,
    monitor: &Monitor,
) -> Result<Object<'a>, SurfaceError> {
    if parameters.isolate == Isolate::Auto
        && let Some(labels) = find_ventricle(volume, parameters, survey, facts, monitor)?
    {
        let iso = facts.iso_value as f32;
        return Ok(object::whole(volume, labels, iso));
    }
    let (origin, extent) = match parameters.isolate {
        Isolate::Box(first, last) => (first, [0, 1, 2].map(|r| last[r] - first[r] + 1)),
        _ => ([0; 3], volume.shape),
    };
    let reference = reference_in_box(volume, origin, extent, survey);
    let iso = iso_value(parameters.iso, reference, survey)?;
    note_iso(facts, iso, reference);
    facts.otsu = Some(f64::from(otsu_in_box(volume, origin, extent, survey)));
    let mut labels = Labels::threshold(&volume.voxels, volume.shape, origin, extent, iso);
    if labels.count() == 0 {
        return Err(no_surface(iso, survey));
    }
    let one = match parameters.isolate {
        Isolate::Auto | Isolate::Largest => Components::of_inside(&labels).largest(),
        Isolate::Seed(seed) => {
            let components = Components::of_inside(&labels);
            let chosen = components.containing(&labels, seed);
            if chosen.is_none() {
                return Err(SurfaceError::SeedOutside {
                    seed,
                    value: volume.at(seed[0], seed[1], seed[2]),
                    iso: f64::from(iso),
                });
            }
            chosen
        }
        _ => None,
    };
    if let Some(one) = one {
        Components::of_inside(&labels).paint(&mut labels, false, |c| c != one);
    }
    Ok(object::whole(volume, labels, iso))
}

fn no_surface(iso: f32, survey: &Survey) -> SurfaceError {
    SurfaceError::NoSurface {
        iso: f64::from(iso),
        minimum: survey.minimum,
        maximum: survey.maximum,
    }
}

fn note_iso(facts: &mut SurfaceFacts, iso: f32, reference: f32) {
    facts.iso_value = f64::from(iso);
    facts.reference = f64::from(reference);
    facts.iso_fraction = f64::from(iso) / f64::from(reference);
}

/// The iso-value asked for; half the reference by default.
fn iso_value(level: IsoLevel, reference: f32, survey: &Survey) -> Result<f32, SurfaceError> {
    let iso = match level {
        IsoLevel::Auto => 0.5 * reference,
        IsoLevel::Fraction(f) => f as f32 * reference,
        IsoLevel::Absolute(v) => v as f32,
    };
    if iso > survey.maximum || iso <= survey.minimum {
        return Err(no_surface(iso, survey));
    }
    Ok(iso)
}

/// The region of the left ventricle with its iso-value noted in `facts`, or `None` (and a
/// warning) where none was found.
fn find_ventricle(
    volume: &Volume,
    parameters: &SurfaceParameters,
    survey: &Survey,
    facts: &mut SurfaceFacts,
    monitor: &Monitor,
) -> Result<Option<Labels>, SurfaceError> {
    let found = left_ventricle::find(volume, survey, monitor)?;
    let Some(ventricle) = found.filter(|v| v.score >= PLAUSIBLE) else {
        facts.warnings.push(
            "no left ventricle was recognised; the largest connected part was taken instead".into(),
        );
        return Ok(None);
    };
    facts.ventricle_score = Some(ventricle.score);
    if ventricle.score < DOUBTFUL {
        facts.warnings.push(format!(
            "the left ventricle was recognised with little certainty (score {:.2} of 1): look whether the region is right, or give a box or a seed",
            ventricle.score
        ));
    }
    let wall = region::Wall::new(volume, &ventricle);
    let asked = iso_value(parameters.iso, wall.reference, survey)?;
    let Some(region) = wall.region(asked, monitor)? else {
        return Err(no_surface(asked, survey));
    };
    let (iso, region) = if parameters.iso == IsoLevel::Auto {
        move_iso(volume, &wall, asked, region, facts, monitor)?
    } else {
        (asked, region)
    };
    note_iso(facts, iso, wall.reference);
    facts.otsu = Some(f64::from(otsu_in_box(
        volume,
        region.labels.origin,
        region.labels.extent,
        survey,
    )));
    facts.neighbour_voxels_cut = region.cut_voxels;
    facts.neighbour_cut_mm2 = region.cut_area;
    if region.cut_voxels > 0 {
        facts.warnings.push(format!(
            "a neighbouring organ touches the ventricle at the iso-value; it was cut off along {:.0} mm²",
            region.cut_area
        ));
    }
    if region.loose_voxels > region.labels.count() / 20 {
        facts.warnings.push(format!(
            "{} voxels of the wall are not connected to the rest at the iso-value and were left out (a defect splits the wall); a lower iso-value may join them",
            region.loose_voxels
        ));
    }
    Ok(Some(region.labels))
}

/// Moves the automatic iso-value where half the reference tears the wall (down to 0.35) or
/// closes the cavity (up to 0.6), and says so. Where that does not help it stays.
fn move_iso(
    volume: &Volume,
    wall: &region::Wall,
    iso: f32,
    region: region::Region,
    facts: &mut SurfaceFacts,
    monitor: &Monitor,
) -> Result<(f32, region::Region), SurfaceError> {
    let enclosed_ml =
        |r: &region::Region| r.enclosed_voxels() as f64 * volume.frame.voxel_volume() / 1000.0;
    let (fractions, why): (&[f32], _) = if region.is_torn() {
        (&[0.45, 0.4, 0.35], "the wall falls into pieces")
    } else if enclosed_ml(&region) > CLOSED_ML {
        (&[0.55, 0.6], "the cavity closes at the base")
    } else {
        return Ok((iso, region));
    };
    for &fraction in fractions {
        let level = fraction * wall.reference;
        if let Some(moved) = wall.region(level, monitor)?
            && !moved.is_torn()
            && enclosed_ml(&moved) <= CLOSED_ML
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
fn reference_in_box(
    volume: &Volume,
    origin: [usize; 3],
    extent: [usize; 3],
    survey: &Survey,
) -> f32 {
    let values = || rows_in_box(volume, origin, extent).flatten().copied();
    let highest = values()
        .filter(|v| v.is_finite())
        .fold(survey.minimum, f32::max);
    let floor = if highest > 0.0 {
        0.3 * highest
    } else {
        survey.minimum
    };
    // A histogram instead of a sorted copy: the box may be the whole of a large volume.
    const BINS: usize = 4096;
    let width = f64::from(highest) - f64::from(floor);
    if !(width > 0.0) {
        return highest;
    }
    let mut histogram = vec![0u64; BINS];
    for v in values().filter(|v| v.is_finite() && *v > floor) {
        let bin = ((f64::from(v) - f64::from(floor)) / width * BINS as f64) as usize;
        histogram[bin.min(BINS - 1)] += 1;
    }
    let total: u64 = histogram.iter().sum();
    let mut below = 0;
    for (bin, n) in histogram.iter().enumerate() {
        below += n;
        if 100 * below >= 98 * total {
            return (f64::from(floor) + (bin as f64 + 0.5) / BINS as f64 * width) as f32;
        }
    }
    highest
}

fn otsu_in_box(volume: &Volume, origin: [usize; 3], extent: [usize; 3], survey: &Survey) -> f32 {
    let rows: Vec<&[f32]> = rows_in_box(volume, origin, extent).collect();
    survey::otsu(&rows, survey.minimum, survey.maximum)
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
