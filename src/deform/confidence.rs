//! How likely a fit is a good one.
//!
//! In go the figures of a fit ([`Evidence`]); out come two chances:
//!
//! - [`of_agreement`]: the chance that the mask agrees with the one an expert would draw by a Jaccard
//!   index of 0.75 or more;
//! - [`of_motion`]: the chance that the patient moved during the scan.
//!
//! Both are logistic functions of a weighted sum of terms. The weights are maximum-likelihood
//! estimates with a ridge of 1 on the standardised terms.
//!
//! Calibrated on 128 fits of simulated hearts with the built-in model: the 19 cases of the cohort,
//! and hearts of the simulator's seeds 411 and 701 (all kinds) and 702 (motion, hot right ventricle,
//! infarcts), 24 of them below 0.75. Such hearts are over-represented, so the chance is on the
//! cautious side. Left out one by one, the chance separates good from bad fits with an area under
//! the curve of 0.90 (0.93 for a Jaccard index of 0.65). The confidence of the search alone reaches
//! 0.64, [`Fit::merit`](super::Fit::merit) 0.85, the residual 0.86, the share of active sensors 0.84;
//! residual, merit and search add nothing to the terms used. Of the fits given a chance above 0.9
//! 95 % are good, between 0.5 and 0.9 85 %, between 0.25 and 0.5 38 %, below 0.25 none.
//!
//! The chance for the anatomical wall comes from the 95 of these fits that are not of seed 702 (14
//! below 0.75; area under the curve 0.86), that of motion from all of them (18 with a displacement
//! of 6 to 26 mm; 0.93).
//!
//! Not guaranteed: that a displaced heart is noticed. A displacement for a third of the scan or less
//! leaves an image of one heart in one place, which may not be its place in another image.

use super::evidence::Evidence;
use super::parameters::WallEdge;

/// One term of a weighted sum.
struct Term {
    /// Mean of the term over the calibration set.
    centre: f64,
    /// Its standard deviation there.
    scale: f64,
    /// Its weight, after it was centred and scaled.
    weight: f64,
}

const fn term(centre: f64, scale: f64, weight: f64) -> Term {
    Term {
        centre,
        scale,
        weight,
    }
}

/// Standardised terms are kept within this many standard deviations: nothing is known beyond.
const FARTHEST: f64 = 4.0;

/// Constant and terms of a bad fit of the apparent wall (Jaccard index below 0.75).
const BAD: (f64, [Term; 5]) = (
    -2.398,
    [
        // share of the surface with edges
        term(0.7528, 0.1566, -1.150),
        // ln(spread of the thickness / mm)
        term(0.6052, 0.1529, 0.687),
        // strain
        term(0.1047, 0.0256, 0.816),
        // ln(unroundness)
        term(-2.3825, 0.2261, 0.942),
        // hollowness
        term(0.5459, 0.1207, -0.147),
    ],
);

/// Constant and terms of a bad fit of the anatomical wall, likewise.
const BAD_ANATOMICAL: (f64, [Term; 5]) = (
    -2.741,
    [
        // share of the surface with edges
        term(0.7820, 0.1417, -1.539),
        // ln(spread of the thickness / mm)
        term(0.5694, 0.1211, 0.539),
        // strain
        term(0.0987, 0.0198, 0.096),
        // ln(unroundness)
        term(-2.4118, 0.2312, 0.602),
        // hollowness
        term(0.5639, 0.1082, -0.254),
    ],
);

/// Constant and terms of motion.
const MOTION: (f64, [Term; 6]) = (
    -3.008,
    [
        // share of the surface with edges
        term(0.7528, 0.1566, -0.766),
        // ln(spread of the thickness / mm)
        term(0.6052, 0.1529, 0.722),
        // ln(cavity / ml)
        term(3.9583, 0.6254, -0.338),
        // slenderness
        term(2.3624, 0.1983, 0.836),
        // ln(unroundness)
        term(-2.3825, 0.2261, 1.125),
        // offset
        term(0.0200, 0.0101, 0.603),
    ],
);

/// The chance that a fit's mask of the wall with this `edge` has a Jaccard index of 0.75 or more,
/// 0..=1: with an expert's mask drawn on the image (apparent) or with the wall itself (anatomical).
pub fn of_agreement(e: &Evidence, edge: WallEdge) -> f64 {
    let values = [
        e.active,
        e.thickness_spread.max(0.1).ln(),
        e.strain,
        e.unroundness.max(1e-3).ln(),
        e.hollowness,
    ];
    let (constant, terms) = match edge {
        WallEdge::Apparent => &BAD,
        WallEdge::Anatomical => &BAD_ANATOMICAL,
    };
    1.0 - logistic(*constant, terms, &values)
}

/// The chance that the patient moved during the scan, 0..=1.
pub fn of_motion(e: &Evidence) -> f64 {
    let values = [
        e.active,
        e.thickness_spread.max(0.1).ln(),
        e.cavity_ml.max(0.1).ln(),
        e.slenderness,
        e.unroundness.max(1e-3).ln(),
        e.offset,
    ];
    logistic(MOTION.0, &MOTION.1, &values)
}

fn logistic<const N: usize>(constant: f64, terms: &[Term; N], values: &[f64; N]) -> f64 {
    let sum: f64 = terms
        .iter()
        .zip(values)
        .map(|(t, value)| t.weight * ((value - t.centre) / t.scale).clamp(-FARTHEST, FARTHEST))
        .sum();
    1.0 / (1.0 + (-constant - sum).exp())
}
