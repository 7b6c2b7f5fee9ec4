//! A septum that bulges towards the right ventricle, whose wall beside a septum without uptake looks like one.
//!
//! In go the figures of a fit; out come whether it is to be made again without the septum's sensors
//! ([`bulges`]), and which of both fits is more likely right ([`is_better_without`]).

use super::Fit;
use super::evidence::Evidence;

/// Least [`Evidence::unroundness`] of a ventricle that is flagged where its septum bulges. Of 127 fits of simulated
/// hearts, 125 have less; one of the others is the one that took the right ventricle's wall.
const FLAGGED_UNROUNDNESS: f64 = 0.15;
/// Least [`Evidence::septal_bulge`] of such a ventricle; half of all hearts have more than 1.015.
const FLAGGED_SEPTAL_BULGE: f64 = 1.03;
/// Least [`Evidence::septal_overshoot`] of a septum that is flagged. Of 24 phantoms the three whose anatomical wall has
/// a Jaccard index below 0.7 lie at 0.19 and above, the others at 0.13 and below; 5 of 127 simulated hearts lie above.
const FLAGGED_SEPTAL_OVERSHOOT: f64 = 0.16;
/// Least [`Evidence::septal_overshoot`] of a heart that is fitted again without the septum's sensors: 14 of 127 fits of
/// simulated hearts and 6 of 24 phantoms exceed it (calibrating seeds).
const REFITTED_SEPTAL_OVERSHOOT: f64 = 0.1;
/// Greatest misfit of the other sensors without those of the septum, as a share of that with them, at which
/// the septum was the right ventricle's wall. In phantoms where it was the share is 0.37 to 0.65, in two
/// simulated hearts 0.69 to 0.87; where it was not, a share below 0.85 does harm only in a heart without
/// [`MIN_EDGE_SHARE`] of its edges. The Jaccard index of the anatomical wall rises in seven phantoms and one heart from
/// 0.61 to 0.76 to 0.77 to 0.85 (calibrating seeds).
const MAX_RESIDUAL_RATIO: f64 = 0.85;
/// Share of the surface whose edges must be seen before the septum is left out: the rest has to determine where
/// it lies.
const MIN_EDGE_SHARE: f64 = 0.5;

/// `true` if the distance of the wall from the axis scatters and the septum is the farther side.
fn is_out_of_round(e: &Evidence) -> bool {
    e.unroundness > FLAGGED_UNROUNDNESS && e.septal_bulge > FLAGGED_SEPTAL_BULGE
}

/// `true` if the septum lies so far out that the fit is flagged for it.
pub(super) fn is_flagged(e: &Evidence) -> bool {
    is_out_of_round(e) || e.septal_overshoot > FLAGGED_SEPTAL_OVERSHOOT
}

/// `true` if the septum of `fit` lies so far out that it may be the right ventricle's wall. Then it is fitted
/// again without the sensors of the septum.
pub fn bulges(fit: &Fit) -> bool {
    let far = |e: &Evidence| is_out_of_round(e) || e.septal_overshoot > REFITTED_SEPTAL_OVERSHOOT;
    fit.judgement.evidence.as_ref().is_some_and(far)
}

/// `true` if `other`, the fit without the sensors of the septum, is more likely right than `fit`, whose septum
/// [`bulges`]: the rest of the wall is met better. Where the septum is out of round as well, the greater confidence
/// is enough: of the calibrating seeds' 51 hearts with a hot right ventricle that raises the five worst from
/// Jaccard indices of 0.53 to 0.59 to 0.64 to 0.77; one heart of another kind would fall from 0.83 to 0.69 were
/// it enough from an unroundness of 0.11 on.
pub fn is_better_without(other: &Fit, fit: &Fit) -> bool {
    let [residual, other_residual] = [fit, other].map(|fit| fit.model.residual);
    let met_better =
        fit.model.active >= MIN_EDGE_SHARE && other_residual < MAX_RESIDUAL_RATIO * residual;
    let out_of_round = fit.judgement.evidence.as_ref().is_some_and(is_out_of_round);
    met_better || (out_of_round && other.judgement.confidence > fit.judgement.confidence)
}
