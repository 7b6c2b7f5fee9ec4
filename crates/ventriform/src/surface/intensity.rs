//! The object among intensities: the left ventricle, or what lies above an iso-value.
//!
//! [`locate::find`] searches the ventricle; the wall about its cavity ([`region`](super::region))
//! gives the reference that fractions refer to. Where no ventricle is recognised, or another part
//! is selected, the reference is the box's own and connected parts are chosen.

use super::object::Object;
use super::region::WallShell;
use super::{IsoLevel, Isolate, SurfaceError, SurfaceFacts, SurfaceParameters, iso_value};
use crate::base::progress::Monitor;
use crate::image::grid::Volume;
use crate::image::grid::components::Components;
use crate::image::grid::labels::Labels;
use crate::image::grid::size::OddSize;
use crate::image::grid::survey::Survey;
use crate::image::locate::rays::{PLAUSIBLE_SCORE, UNCERTAIN_SCORE};
use crate::image::locate::{self, LocateError};

/// Chooses the ventricle, or the part that `parameters` select.
///
/// # Errors
/// [`SurfaceError`] if no voxel reaches the iso-value, or the seed does not.
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
        return Ok(Object::whole(volume, labels, iso));
    }
    let (origin, extent) = match parameters.isolate {
        Isolate::Box(first, last) => (first, [0, 1, 2].map(|r| last[r] - first[r] + 1)),
        _ => ([0; 3], volume.shape),
    };
    let reference = iso_value::reference_in_box(volume, origin, extent, survey, monitor)?;
    let iso = iso_value::choose(parameters.iso, reference, survey)?;
    iso_value::note(facts, iso, reference);
    facts.otsu = Some(f64::from(iso_value::otsu_in_box(
        volume, origin, extent, survey, monitor,
    )?));
    let mut labels = Labels::threshold(&volume.voxels, volume.shape, origin, extent, iso);
    if labels.count() == 0 {
        return Err(iso_value::no_surface(iso, survey));
    }
    if !matches!(
        parameters.isolate,
        Isolate::Auto | Isolate::Largest | Isolate::Seed(_)
    ) {
        return Ok(Object::whole(volume, labels, iso));
    }
    let components = Components::of_inside(&labels, monitor)?;
    let one = match parameters.isolate {
        Isolate::Seed(seed) => {
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
        _ => components.largest(),
    };
    if let Some(one) = one {
        components.paint(&mut labels, false, |c| c != one, monitor)?;
    }
    Ok(Object::whole(volume, labels, iso))
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
    let found = match locate::find(volume, &parameters.hints, monitor) {
        Ok(heart) => heart.cavity(monitor)?,
        Err(LocateError::Cancelled(e)) => return Err(e.into()),
        Err(LocateError::HintOutside) => return Err(SurfaceError::HintOutside),
        Err(LocateError::HotVoxels(found)) => {
            facts.warnings.push(found.to_string());
            None
        }
        Err(_) => None,
    };
    let Some(cavity) = found.filter(|c| c.score >= PLAUSIBLE_SCORE) else {
        let size = OddSize::from_volume(volume).map_or_else(String::new, |size| size.to_string());
        facts.warnings.push(format!(
            "no left ventricle was recognised; the largest connected part was taken instead{size}"
        ));
        return Ok(None);
    };
    facts.ventricle_score = Some(cavity.score);
    if cavity.score < UNCERTAIN_SCORE {
        facts.warnings.push(format!(
            "the left ventricle was recognised with little certainty (score {:.2} of 1): look whether the region is \
             right, or give a box or a seed",
            cavity.score
        ));
    }
    let wall = WallShell::new(volume, &cavity, monitor)?;
    let asked = iso_value::choose(parameters.iso, wall.reference, survey)?;
    let Some(region) = wall.region(asked, monitor)? else {
        return Err(iso_value::no_surface(asked, survey));
    };
    let (iso, region) = if parameters.iso == IsoLevel::Auto {
        iso_value::move_from(volume, &wall, asked, region, facts, monitor)?
    } else {
        (asked, region)
    };
    iso_value::note(facts, iso, wall.reference);
    facts.otsu = Some(f64::from(iso_value::otsu_in_box(
        volume,
        region.labels.origin,
        region.labels.extent,
        survey,
        monitor,
    )?));
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
            "{} voxels of the wall are not connected to the rest at the iso-value and were left out (a defect splits \
             the wall); a lower iso-value may join them",
            region.loose_voxels
        ));
    }
    Ok(Some(region.labels))
}
