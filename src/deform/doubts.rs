//! Which flags a fit gets.

use super::confidence;
use super::dynamics::StopReason;
use super::evidence::Evidence;
use super::fit::Fit;
use super::flags::Flag;
use super::parameters::WallEdge;
use crate::geometry::Vec3;
use crate::grid::Volume;

/// The reasons to doubt `fit`, whose wall with this `edge` is shown; volume, thickness, length and
/// strain are judged for a ventricle only.
pub(super) fn flags(fit: &Fit, volume: &Volume, ventricle: bool, edge: WallEdge) -> Vec<Flag> {
    let mut flags = Vec::new();
    let confidence = fit.place_confidence();
    if confidence < 0.4 {
        flags.push(Flag::UncertainPlace { confidence });
    }
    if ventricle && let Some(values) = few_values(volume) {
        flags.push(Flag::LabelMap { values });
    }
    flags.extend(unlike_calibrated(fit, edge));
    if let Some(uptake) = fit.localisation.as_ref().and_then(|l| l.dark_apex) {
        flags.push(Flag::DarkApex { uptake });
    }
    if matches!(fit.reason, StopReason::MaxIterations | StopReason::Diverged) {
        flags.push(Flag::NotAtRest { reason: fit.reason });
    }
    if fit.self_intersections + fit.turned_triangles > 0 {
        flags.push(Flag::Folded {
            intersections: fit.self_intersections,
            turned: fit.turned_triangles,
        });
    }
    if fit.active < 0.5 {
        flags.push(Flag::PoorContrast { active: fit.active });
    }
    let outside = fit
        .mesh
        .vertices
        .iter()
        .filter(|p| at_border_or_beyond(volume, p))
        .count();
    if outside > 0 {
        let share = 100.0 * outside as f64 / fit.mesh.vertices.len() as f64;
        flags.push(Flag::TouchesBorder { share });
    }
    if ventricle {
        flags.extend(implausible(fit));
    }
    flags
}

/// Chance of a good fit below which the fit is doubted.
const UNCERTAIN: f64 = 0.5;
/// Chance of motion from which on it is reported: 21 of 24 simulated scans with a displacement of 6 to
/// 26 mm reach it, and 9 of 150 without, two of which fit badly (calibrating seeds, each left out).
const MOVED: f64 = 0.25;
/// Scatter of the wall's distance from the axis, over its mean, from which on a ventricle whose
/// septum bulges is doubted. Of 127 fits of simulated hearts, 125 have less; one of the others is the
/// one that took the right ventricle's wall.
const OUT_OF_ROUND: f64 = 0.15;
/// Distance of the septum from the axis over that of the free wall, likewise; half of all hearts
/// have more than 1.015.
const BULGING: f64 = 1.03;
/// Whether the septum of `fit` lies so far out that it may be the right ventricle's wall. Then it is fitted
/// again without the sensors of the septum: of the calibrating seeds' 51 hearts with a hot right
/// ventricle that raises the five worst from Jaccard indices of 0.53 to 0.59 to 0.64 to 0.77. Below
/// [`OUT_OF_ROUND`] it does harm: from 0.11 on, one heart of another kind falls from 0.83 to 0.69.
pub(super) fn bulges(fit: &Fit) -> bool {
    let bulging = |e: Evidence| e.unroundness > OUT_OF_ROUND && e.septal_bulge > BULGING;
    fit.evidence.is_some_and(bulging)
}

/// Lets the confidence of `fit`, which has changed, decide again whether the fit is doubted for it.
pub(super) fn doubt_again(fit: &mut Fit) {
    if fit.flags.iter().any(|f| matches!(f, Flag::LabelMap { .. })) {
        fit.confidence = fit.confidence.min(0.5);
    }
    let before = |f: &Flag| matches!(f, Flag::UncertainPlace { .. } | Flag::LabelMap { .. });
    fit.flags
        .retain(|f| !matches!(f, Flag::UncertainFit { .. }));
    let place = fit.flags.iter().take_while(|f| before(f)).count();
    let flag = fit.evidence.and_then(|e| uncertain(fit.confidence, e));
    fit.flags.splice(place..place, flag);
}

fn uncertain(chance: f64, evidence: Evidence) -> Option<Flag> {
    (chance < UNCERTAIN).then_some(Flag::UncertainFit { chance, evidence })
}

fn unlike_calibrated(fit: &Fit, edge: WallEdge) -> Vec<Flag> {
    let Some(evidence) = fit.evidence else {
        return Vec::new();
    };
    let chance = confidence::of_agreement(&evidence, edge);
    let mut flags: Vec<Flag> = uncertain(chance, evidence).into_iter().collect();
    let chance = confidence::of_motion(&evidence);
    if chance >= MOVED {
        flags.push(Flag::Motion { chance, evidence });
    }
    let (unroundness, bulge) = (evidence.unroundness, evidence.septal_bulge);
    if unroundness > OUT_OF_ROUND && bulge > BULGING {
        flags.push(Flag::RightVentricle { unroundness, bulge });
    }
    flags
}

/// Different values, from which on a volume is taken for an image.
const IMAGE_VALUES: usize = 9;

/// The number of different finite values of a volume that holds fewer than an image does.
fn few_values(volume: &Volume) -> Option<usize> {
    let mut seen: Vec<f32> = Vec::with_capacity(IMAGE_VALUES);
    for value in volume.voxels.iter().filter(|v| v.is_finite()) {
        if !seen.contains(value) {
            seen.push(*value);
            if seen.len() == IMAGE_VALUES {
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

fn implausible(fit: &Fit) -> Vec<Flag> {
    let Some(wall) = &fit.wall else {
        return Vec::new();
    };
    let length = wall.extent[1] - wall.extent[0];
    let mut flags: Vec<Flag> = [
        ("the wall's volume in ml", fit.wall_ml, 50.0, 400.0),
        ("the cavity's volume in ml", wall.cavity_ml, 5.0, 450.0),
        (
            "the wall's mean thickness in mm",
            wall.thickness,
            10.0,
            20.0,
        ),
        ("the length in mm", length, 45.0, 140.0),
        (
            "the strain in per cent",
            100.0 * fit.strain.sqrt(),
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
