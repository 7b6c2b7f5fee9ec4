//! The rules by which a fit gets its flags.

use super::confidence;
use super::dark_apex::{self, DarkApex};
use super::evidence::Evidence;
use super::exchanged_axes;
use super::field_of_view;
use super::flags::{ApexDirection, DarkPart, Flag};
use super::liver_side;
use super::septum;
use super::values;
use crate::base::geometry::Vec3;
use crate::heart::deform::dynamics::StopReason;
use crate::heart::deform::wall_thickness::WallThickness;
use crate::heart::deform::{FittedModel, Orbit, WallSurfaces};
use crate::image::grid::Volume;
use crate::image::locate::patient_orientation::OrientationSource;

/// Confidence of the position below which it is flagged. Of 174 fits of simulated hearts (the calibrating seeds of
/// [`confidence`]) six have less, one of them a fit beside the heart with 0.58; the next one above has 0.64.
const POSITION_FLAG_CONFIDENCE: f64 = 0.6;
/// Chance of a good fit below which the fit is flagged. Of the calibrating seeds' fits of 0.75 or more (105 by the
/// apparent wall, 94 by the anatomical one) it costs flags on 4 and 9 more than a limit of 0.5 would. Fits below 0.65
/// without any other flag reach 0.58 there, and reached 0.62 on a set judged before.
const FIT_FLAG_PROBABILITY: f64 = 0.7;
/// Chance of motion from which on it is flagged where it is known that the camera turned: 17 of 18 simulated scans with
/// a displacement of 6 to 26 mm reach it, and 1 of 81 without (calibrating seeds). By the shape of the wall alone: 21
/// of 24, and 9 of 150.
const MOTION_FLAG_PROBABILITY: f64 = 0.25;
/// The same where it is not known how the camera turned: cameras that see all angles at once have no views before and
/// after a motion, and two real scans of such cameras have a chance of 0.29 and more.
const MOTION_FLAG_PROBABILITY_OF_UNKNOWN_ORBIT: f64 = 0.5;

/// Thickness beyond that of usual walls that look so from which on a wall is flagged, mm. Held out: of 38 walls of more
/// than 15 mm 32 are flagged, of 47 usual hearts none (docs/log/walls.md).
const THICK_WALL_MM: f64 = 3.0;
/// Length of the interval of a wall's mean thickness beyond which the thickness counts as assumed, mm. Held out: 1 of 48
/// usual hearts, half of the walls of 5 to 22 mm.
const ASSUMED_INTERVAL_MM: f64 = 10.0;

/// The flags of `model`, fitted to `volume`, judged by `evidence`, and by it a good fit with this `chance`, with a
/// camera that turned by `orbit`. The number of values, volumes, thickness, length and strain are judged for a
/// ventricle only.
pub(super) fn flags(
    model: &FittedModel,
    evidence: Option<&Evidence>,
    chance: f64,
    volume: &Volume,
    ventricle: bool,
    orbit: Orbit,
) -> Vec<Flag> {
    let mut flags = Vec::new();
    let confidence = confidence::of_position(model);
    if confidence < POSITION_FLAG_CONFIDENCE {
        flags.push(Flag::UncertainPlace { confidence });
    }
    if ventricle && let Some(values) = few_values(volume) {
        flags.push(Flag::LabelMap { values });
    }
    flags.extend(
        evidence
            .into_iter()
            .flat_map(|e| of_evidence(e, chance, orbit)),
    );
    flags.extend(dark_apex(model, volume));
    flags.extend(of_motion_to_rest(model));
    let mesh = model.apparent_mesh();
    let outside = |p: &&Vec3| at_border_or_beyond(volume, p);
    let outside = mesh.vertices.iter().filter(outside).count();
    if outside > 0 {
        let share = 100.0 * outside as f64 / mesh.vertices.len() as f64;
        flags.push(Flag::TouchesBorder { share });
    }
    if ventricle {
        flags.extend(of_values(model, volume));
        flags.extend(cut(model, volume));
        flags.extend(mirrored(model, volume));
        flags.extend(implausible(model, evidence));
        let thickness = model.surfaces.as_ref().and_then(|both| both.thickness);
        flags.extend(thickness.into_iter().flat_map(of_thickness));
    }
    flags
}

/// Flags of what is known of the wall's thickness.
fn of_thickness(thickness: WallThickness) -> impl Iterator<Item = Flag> {
    let [least, greatest] = thickness.interval_mm;
    let thick = thickness.mean_mm > thickness.look.usual_mm + THICK_WALL_MM;
    let assumed = greatest - least > ASSUMED_INTERVAL_MM;
    let thick = thick.then_some(Flag::ThickWall(thickness));
    let assumed = assumed.then_some(Flag::ThicknessAssumed(thickness));
    thick.into_iter().chain(assumed)
}

/// Flags of values that are no counts; none for a map of labels, whose values are none by design.
fn of_values(model: &FittedModel, volume: &Volume) -> Vec<Flag> {
    let Some(wall) = model
        .sensed_wall
        .as_ref()
        .filter(|_| few_values(volume).is_none())
    else {
        return Vec::new();
    };
    let voxels = values::voxels_of(wall, volume);
    let uptake = field_of_view::bright_uptake(wall, volume);
    let saturated = values::saturation(&voxels, volume).map(Flag::Saturated);
    let background = values::background(volume, uptake).map(Flag::Background);
    let hot = values::hot_voxels(&voxels, volume).map(Flag::HotVoxels);
    saturated.into_iter().chain(background).chain(hot).collect()
}

/// `flags` with the one of an uncertain fit as this `chance` wants it.
pub(super) fn with_chance(mut flags: Vec<Flag>, chance: f64, evidence: &Evidence) -> Vec<Flag> {
    let before = |f: &Flag| matches!(f, Flag::UncertainPlace { .. } | Flag::LabelMap { .. });
    flags.retain(|f| !matches!(f, Flag::UncertainFit { .. }));
    let at = flags.iter().take_while(|f| before(f)).count();
    flags.splice(at..at, uncertain(chance, evidence));
    flags
}

/// The chance of a good fit that got these `flags`: it is calibrated on images of uptake that lie in the patient as
/// they say, and at most 0.5 in a map of labels, in an image whose values are no counts, and in one that looks
/// mirrored.
pub(super) fn limited(chance: f64, flags: &[Flag]) -> f64 {
    let outside_of_calibration = |flag: &Flag| {
        matches!(
            flag,
            Flag::LabelMap { .. }
                | Flag::Saturated(_)
                | Flag::Background(_)
                | Flag::HotVoxels(_)
                | Flag::Mirrored { .. }
                | Flag::ExchangedAxes { .. }
                | Flag::LiverOnTheLeft { .. }
        )
    };
    if flags.iter().any(outside_of_calibration) {
        chance.min(0.5)
    } else {
        chance
    }
}

fn uncertain(chance: f64, evidence: &Evidence) -> Option<Flag> {
    let evidence = *evidence;
    (chance < FIT_FLAG_PROBABILITY).then_some(Flag::UncertainFit { chance, evidence })
}

fn of_evidence(evidence: &Evidence, chance: f64, orbit: Orbit) -> Vec<Flag> {
    let mut flags: Vec<Flag> = uncertain(chance, evidence).into_iter().collect();
    let (chance, evidence) = (confidence::of_motion(evidence), *evidence);
    if chance >= motion_flag_probability(orbit) {
        flags.push(Flag::Motion { chance, evidence });
    }
    if septum::is_flagged(&evidence) {
        flags.push(Flag::RightVentricle { evidence });
    }
    flags
}

/// The chance of motion from which on it is flagged.
fn motion_flag_probability(orbit: Orbit) -> f64 {
    match orbit {
        Orbit::Half | Orbit::Full => MOTION_FLAG_PROBABILITY,
        Orbit::Auto => MOTION_FLAG_PROBABILITY_OF_UNKNOWN_ORBIT,
        Orbit::None => f64::INFINITY,
    }
}

/// The flag of an apex that was not seen by the search, or is dark on the fitted wall, all round or in part.
fn dark_apex(model: &FittedModel, volume: &Volume) -> Option<Flag> {
    let found = model.localisation.as_ref()?;
    let in_search = found.dark_apex.map(|uptake| Flag::DarkApex {
        uptake,
        part: DarkPart::Whole,
    });
    in_search.or_else(|| {
        let wall = model.sensed_wall.as_ref()?;
        let DarkApex { uptake, part } = dark_apex::dark_apex(model.apparent_mesh(), wall, volume)?;
        Some(Flag::DarkApex { uptake, part })
    })
}

/// Flags of how the model came to rest, and of the edges that it met.
fn of_motion_to_rest(model: &FittedModel) -> Vec<Flag> {
    let mut flags = Vec::new();
    let reason = model.reason;
    if matches!(reason, StopReason::MaxIterations | StopReason::Diverged) {
        flags.push(Flag::NotAtRest { reason });
    }
    if model.self_intersections + model.turned_triangles > 0 {
        flags.push(Flag::Folded {
            intersections: model.self_intersections,
            turned: model.turned_triangles,
        });
    }
    if model.active < 0.5 {
        let active = model.active;
        flags.push(Flag::PoorContrast { active });
    }
    flags
}

/// Area of a cut image beside the wall from which on it is flagged, cm². Cuts 8 mm deep into the wall of 19 simulated
/// hearts from two sides have 16 and more, none of the whole scans any; one (filtered backprojection, whose negative
/// values are 0) has 5 for steps of a quarter of the uptake.
const CUT_FLAG_AREA_CM2: f64 = 4.0;

/// The flag of an image that ends in the wall.
fn cut(model: &FittedModel, volume: &Volume) -> Option<Flag> {
    let wall = model.sensed_wall.as_ref()?;
    let area_cm2 = field_of_view::cut_area_cm2(model.apparent_mesh(), wall, volume);
    (area_cm2 >= CUT_FLAG_AREA_CM2).then_some(Flag::FieldOfView { area_cm2 })
}

/// Part of the long axis's direction to the patient's right, or to the back, from which on a heart is flagged. Axes
/// point 5 degrees or more to the left and to the front in simulated hearts and in all real scans that were looked at;
/// a fitted axis is off by some degrees.
const MIRRORED_SINE: f64 = 0.1;
/// The same upward: horizontal hearts lie nearly level.
const UPWARD_SINE: f64 = 0.2;
/// Greatest angle of the patient's superior direction to the frame's at which the frame's x tells left from right.
const UPRIGHT_COSINE: f64 = 0.7;

/// Part of the long axis's direction to the patient's left up to which the apex leaves left and right open, so that the
/// liver's side is asked: 14 degrees. Usual hearts point 27 degrees and more to the left.
const OPEN_SIDE_SINE: f64 = 0.25;
/// Share of the bright activity below the heart by which the left outweighs the right from which on a heart is flagged.
/// In 65 simulated scans (seed 8801) the right outweighs the left by 0.02 and more, in four real ones by 0.46 and more.
const LIVER_FLAG_SHARE: f64 = 0.25;

/// The flag of an apex that points to the right, to the back or up in a frame that claims a patient, of surroundings
/// that show two exchanged axes, or of a liver on the left below an apex that hardly points to a side.
fn mirrored(model: &FittedModel, volume: &Volume) -> Option<Flag> {
    let (cup, orientation) = (model.cup.as_ref()?, model.patient_orientation.as_ref()?);
    let claims =
        orientation.source != OrientationSource::Unknown && orientation.superior.z > UPRIGHT_COSINE;
    if !claims {
        return None;
    }
    let axis = cup.axis;
    let directions = [
        (ApexDirection::Right, -axis.x, MIRRORED_SINE),
        (ApexDirection::Posterior, axis.y, MIRRORED_SINE),
        (ApexDirection::Superior, axis.z, UPWARD_SINE),
    ];
    let apex = directions.into_iter().find(|(_, part, most)| part > most);
    if let Some((towards, part, _)) = apex {
        let degrees = part.clamp(-1.0, 1.0).asin().to_degrees();
        return Some(Flag::Mirrored { towards, degrees });
    }
    let wall = model.sensed_wall.as_ref()?;
    let uptake = field_of_view::bright_uptake(wall, volume);
    // Where the background is not at zero, shares of the uptake show neither body nor liver.
    let exchanged = exchanged_axes::exchanged(volume, &cup.centre, uptake)
        .filter(|_| values::background(volume, uptake).is_none());
    if let Some((pair, score)) = exchanged {
        return Some(Flag::ExchangedAxes { pair, score });
    }
    if axis.x > OPEN_SIDE_SINE {
        return None;
    }
    let right = liver_side::liver_side(volume, cup, uptake)?;
    (right <= -LIVER_FLAG_SHARE).then_some(Flag::LiverOnTheLeft {
        share: 0.5 - 0.5 * right,
    })
}

/// Number of different values from which on a volume is taken for an image.
const MIN_IMAGE_VALUES: usize = 9;

/// The number of different finite values of a volume that holds fewer than an image does.
fn few_values(volume: &Volume) -> Option<usize> {
    let mut seen: Vec<f32> = Vec::with_capacity(MIN_IMAGE_VALUES);
    for value in volume.voxels.iter().filter(|v| v.is_finite()) {
        if !seen.contains(value) {
            seen.push(*value);
            if seen.len() == MIN_IMAGE_VALUES {
                return None;
            }
        }
    }
    Some(seen.len())
}

fn at_border_or_beyond(volume: &Volume, p: &Vec3) -> bool {
    let index = volume.frame.to_voxel(p);
    (0..3).any(|a| index[a] <= 0.0 || index[a] >= volume.shape[a] as f64 - 1.0)
}

/// Mean thicknesses of apparent walls, least and greatest, mm. Smooth filters make every wall look thick: good fits have
/// up to 25.2 mm with those of the simulator, and 18.0 to 21.7 with filters of one real scan.
const MEAN_THICKNESS_MM: [f64; 2] = [10.0, 26.0];

/// Flags of the apparent wall's volumes, thickness and length, and of the strain.
fn implausible(model: &FittedModel, evidence: Option<&Evidence>) -> Vec<Flag> {
    let Some(WallSurfaces { apparent, .. }) = &model.surfaces else {
        return Vec::new();
    };
    let wall = &apparent.wall;
    let length = wall.extent[1] - wall.extent[0];
    // Hearts: 2.37 with a standard deviation of 0.19 (174 calibrating fits), 1.9 to 2.9.
    let slenderness = evidence.map_or(2.4, |e| e.slenderness);
    let mut flags: Vec<Flag> = [
        ("the wall's volume in ml", apparent.wall_ml, 50.0, 400.0),
        ("the cavity's volume in ml", wall.cavity_ml, 5.0, 450.0),
        (
            "the wall's mean thickness in mm",
            wall.thickness,
            MEAN_THICKNESS_MM[0],
            MEAN_THICKNESS_MM[1],
        ),
        ("the length in mm", length, 45.0, 140.0),
        ("the length over the outer radius", slenderness, 1.7, 3.1),
        (
            "the strain in per cent",
            100.0 * model.strain.sqrt(),
            0.0,
            45.0,
        ),
    ]
    .into_iter()
    .filter(|(_, value, least, most)| !(least..=most).contains(&value))
    .map(|(what, value, least, most)| Flag::ImplausibleShape {
        what,
        value,
        least,
        most,
    })
    .collect();
    if wall.gaps > 0.25 {
        flags.push(Flag::ValvePlane { gaps: wall.gaps });
    }
    flags
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heart::judge::Fit;
    use crate::heart::judge::test_fits::ball;

    #[test]
    fn each_reason_for_a_flag_raises_its_flag_alone() {
        let (volume, found) = ball();
        let raised = |change: &dyn Fn(&mut Fit)| {
            let mut fit = found.clone();
            change(&mut fit);
            let (model, judgement) = (&fit.model, &fit.judgement);
            let chance = judgement.confidence;
            let flags = flags(model, None, chance, &volume, false, Orbit::Auto);
            let codes: Vec<&str> = flags.iter().map(Flag::code).collect();
            // Nobody searched for the place.
            assert_eq!(codes[0], "uncertain_place");
            codes[1..].join(" ")
        };
        assert_eq!(raised(&|_| {}), "");
        assert_eq!(raised(&|fit| fit.model.active = 0.51), "");
        assert_eq!(raised(&|fit| fit.model.active = 0.49), "poor_contrast");
        assert_eq!(raised(&|fit| fit.model.self_intersections = 1), "folded");
        assert_eq!(raised(&|fit| fit.model.turned_triangles = 1), "folded");
        for reason in [StopReason::MaxIterations, StopReason::Diverged] {
            assert_eq!(raised(&|fit| fit.model.reason = reason), "not_at_rest");
        }
        let beyond = |x: f64| raised(&|fit| fit.model.mesh.vertices[7] = Vec3::new(x, 0.0, 0.0));
        assert_eq!(beyond(68.0), "");
        for x in [-68.5, 68.5, 100.0] {
            assert_eq!(beyond(x), "touches_border");
        }
    }

    /// Motion is told only where the camera turned, and with more reserve where that is not known.
    #[test]
    fn motion_is_flagged_by_how_the_camera_turned() {
        let [none, unknown, half, full] =
            [Orbit::None, Orbit::Auto, Orbit::Half, Orbit::Full].map(motion_flag_probability);
        assert!(none > 1.0 && none > unknown && unknown > half);
        assert_eq!(half, full);
        for (degrees, orbit) in [
            (0.0, Some(Orbit::None)),
            (180.0, Some(Orbit::Half)),
            (90.0, Some(Orbit::Half)),
            (360.0, Some(Orbit::Full)),
            (3.0, None),
            (1e6, None),
            (f64::NAN, None),
        ] {
            assert_eq!(Orbit::of_arc(degrees), orbit, "{degrees}");
        }
        assert_eq!(Orbit::Auto.or_stated(Some(Orbit::Half)), Orbit::Half);
        assert_eq!(Orbit::Auto.or_stated(None), Orbit::Auto);
        assert_eq!(Orbit::None.or_stated(Some(Orbit::Half)), Orbit::None);
    }

    #[test]
    fn few_different_values_are_no_image() {
        let (mut volume, _) = ball();
        assert_eq!(few_values(&volume), None);
        for values in [1, 8, 9] {
            for (number, voxel) in volume.voxels.iter_mut().enumerate() {
                *voxel = (number % values) as f32;
            }
            volume.voxels[5] = f32::NAN;
            assert_eq!(
                few_values(&volume),
                (values < MIN_IMAGE_VALUES).then_some(values)
            );
        }
    }
}
