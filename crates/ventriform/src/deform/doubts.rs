//! Which flags a fit gets.

use super::confidence;
use super::dynamics::StopReason;
use super::evidence::Evidence;
use super::fit::Fit;
use super::flags::Flag;
use crate::geometry::Vec3;
use crate::grid::Volume;

/// The reasons to doubt `fit`; volume, thickness, length and strain are judged for a ventricle only.
pub(super) fn flags(fit: &Fit, volume: &Volume, ventricle: bool) -> Vec<Flag> {
    let mut flags = Vec::new();
    let confidence = fit.place_confidence();
    if confidence < UNSURE_PLACE {
        flags.push(Flag::UncertainPlace { confidence });
    }
    if ventricle && let Some(values) = few_values(volume) {
        flags.push(Flag::LabelMap { values });
    }
    flags.extend(unlike_calibrated(fit));
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

/// Confidence of the place below which it is doubted. Of 174 fits of simulated hearts (the calibrating seeds of
/// [`confidence`]) six have less, one of them a fit beside the heart with 0.58; the next one above has 0.64.
const UNSURE_PLACE: f64 = 0.6;
/// Chance of a good fit below which the fit is doubted. Of the calibrating seeds' fits of 0.75 or more (105 by the
/// apparent wall, 94 by the anatomical one) it costs flags on 4 and 9 more than a limit of 0.5 would. Fits below 0.65
/// that nothing else doubts reach 0.58 there, and reached 0.62 on a set judged before.
const UNCERTAIN: f64 = 0.7;
/// Chance of motion from which on it is reported: 17 of 18 simulated scans with a displacement of 6 to 26 mm
/// reach it, and 1 of 81 without (calibrating seeds). By the shape of the wall alone: 21 of 24, and 9 of 150.
const MOVED: f64 = 0.25;
/// Scatter of the wall's distance from the axis, over its mean, from which on a ventricle whose
/// septum bulges is doubted. Of 127 fits of simulated hearts, 125 have less; one of the others is the
/// one that took the right ventricle's wall.
const OUT_OF_ROUND: f64 = 0.15;
/// Distance of the septum from the axis over that of the free wall, likewise; half of all hearts
/// have more than 1.015.
const BULGING: f64 = 1.03;
/// How far the septum may lie outside the circle through the free wall, as a share of its radius, before
/// it is asked whether it is the right ventricle's wall: 14 of 127 fits of simulated hearts and 6 of 24
/// phantoms exceed it (calibrating seeds).
const OVERSHOOTING: f64 = 0.1;
/// The same, from which on the result is doubted. Of those phantoms the three whose anatomical wall has a Jaccard
/// index below 0.7 lie at 0.19 and above, the others at 0.13 and below; 5 of the 127 hearts lie above.
const FAR_OUTSIDE: f64 = 0.16;
/// The misfit of the other sensors without those of the septum, as a share of that with them, below which
/// the septum was the right ventricle's wall. In phantoms where it was the share is 0.37 to 0.65, in two
/// simulated hearts 0.69 to 0.87; where it was not, a share below 0.85 does harm only in a heart without
/// [`MOST`] of its edges. The Jaccard index of the anatomical wall rises in seven phantoms and one heart from 0.61 to
/// 0.76 to 0.77 to 0.85 (calibrating seeds).
const CLEARER: f64 = 0.85;
/// Share of the surface whose edges must be seen before the septum is left out: the rest has to tell where
/// it lies.
const MOST: f64 = 0.5;

fn out_of_round(e: &Evidence) -> bool {
    e.unroundness > OUT_OF_ROUND && e.septal_bulge > BULGING
}

/// Whether the septum of `fit` lies so far out that it may be the right ventricle's wall. Then it is fitted
/// again without the sensors of the septum.
pub(super) fn bulges(fit: &Fit) -> bool {
    let far = |e: &Evidence| out_of_round(e) || e.septal_overshoot > OVERSHOOTING;
    fit.evidence.as_ref().is_some_and(far)
}

/// Whether `other`, the fit without the sensors of the septum, is more likely right than `fit`, whose septum
/// [`bulges`]: the rest of the wall is met better. Where the septum is out of round as well, the greater confidence
/// is enough: of the calibrating seeds' 51 hearts with a hot right ventricle that raises the five worst from
/// Jaccard indices of 0.53 to 0.59 to 0.64 to 0.77; one heart of another kind would fall from 0.83 to 0.69 were
/// it enough from an unroundness of 0.11 on.
pub(super) fn is_clearer(other: &Fit, fit: &Fit) -> bool {
    let met_better = fit.active >= MOST && other.residual < CLEARER * fit.residual;
    let out_of_round = fit.evidence.as_ref().is_some_and(out_of_round);
    met_better || (out_of_round && other.confidence > fit.confidence)
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

fn unlike_calibrated(fit: &Fit) -> Vec<Flag> {
    let Some(evidence) = fit.evidence else {
        return Vec::new();
    };
    let mut flags: Vec<Flag> = uncertain(fit.confidence, evidence).into_iter().collect();
    let chance = confidence::of_motion(&evidence);
    if chance >= MOVED {
        flags.push(Flag::Motion { chance, evidence });
    }
    if out_of_round(&evidence) || evidence.septal_overshoot > FAR_OUTSIDE {
        flags.push(Flag::RightVentricle { evidence });
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
    // Hearts: 2.37 with a standard deviation of 0.19 (174 calibrating fits), 1.9 to 2.9.
    let slenderness = fit.evidence.map_or(2.4, |e| e.slenderness);
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
        ("the length over the outer radius", slenderness, 1.7, 3.1),
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

#[cfg(test)]
mod tests {
    use super::super::test_fits::ball;
    use super::*;

    #[test]
    fn each_reason_to_doubt_raises_its_flag_alone() {
        let (volume, found) = ball();
        let raised = |change: &dyn Fn(&mut Fit)| {
            let mut fit = found.clone();
            change(&mut fit);
            let flags = flags(&fit, &volume, false);
            let codes: Vec<&str> = flags.iter().map(Flag::code).collect();
            // Nobody searched for the place.
            assert_eq!(codes[0], "uncertain_place");
            codes[1..].join(" ")
        };
        assert_eq!(raised(&|_| {}), "");
        assert_eq!(raised(&|fit| fit.active = 0.51), "");
        assert_eq!(raised(&|fit| fit.active = 0.49), "poor_contrast");
        assert_eq!(raised(&|fit| fit.self_intersections = 1), "folded");
        assert_eq!(raised(&|fit| fit.turned_triangles = 1), "folded");
        for reason in [StopReason::MaxIterations, StopReason::Diverged] {
            assert_eq!(raised(&|fit| fit.reason = reason), "not_at_rest");
        }
        let beyond = |x: f64| raised(&|fit| fit.mesh.vertices[7] = Vec3::new(x, 0.0, 0.0));
        assert_eq!(beyond(68.0), "");
        for x in [-68.5, 68.5, 100.0] {
            assert_eq!(beyond(x), "touches_border");
        }
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
                (values < IMAGE_VALUES).then_some(values)
            );
        }
    }
}
