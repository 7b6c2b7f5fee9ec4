//! The chances of a good fit, of motion and of a heart.
//!
//! In go the figures of a fit ([`Evidence`]), or of several fits to one volume; out come chances, 0..=1:
//!
//! - [`of_agreement`]: that the mask agrees with the one an expert would draw by a Jaccard index of 0.75 or more;
//!   [`of_set`]: the same of the best of several fits;
//! - [`of_motion`]: that the patient moved during the scan;
//! - [`of_heart`]: that what was fitted is a left ventricle.
//!
//! 1. All are [logistic models](super::logistic) whose constants `scripts/measure/calibrate.py` estimates from fits to
//!    simulated hearts ([`calibration`]). Hearts that are hard to fit are over-represented, so the chances are
//!    cautious.
//! 2. Of several fits the mean logarithm of the odds scatters less than that of one.
//! 3. The projections of the image ([`Views::gain`]) join the chances.
//!
//! Guaranteed: a chance rises or falls with each figure alone but the size of the cavity: fits of very small and very
//! large hearts are worse than others. Not guaranteed: that a displaced heart is noticed. A
//! displacement in the last views only leaves an image of one heart in one position, which may not be its position in
//! another image. docs/log/confidence.md has the sets, the areas under the curve, and what else was tried.

use super::calibration::{self, USUAL_CAVITY_ML};
use super::evidence::Evidence;
use super::motion::Views;
use crate::heart::deform::{FittedModel, WallEdge};

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
    let bad_fit = match edge {
        WallEdge::Apparent => &calibration::BAD_FIT_APPARENT,
        WallEdge::Anatomical => &calibration::BAD_FIT_ANATOMICAL,
    };
    1.0 - bad_fit.probability(&values)
}

/// The logarithm of [`Views::gain`], from about that of a patient at rest on.
fn log_gain(views: &Views) -> f64 {
    (views.gain.clamp(0.0, 1.0) + 0.01).ln()
}

/// The chance that the best of several fits to one volume has a Jaccard index of 0.75 or more, from the
/// `chances` that [`of_agreement`] gives each for the wall with this `edge`, 0 for one that failed, and the
/// evidence of the best one.
pub fn of_set(chances: &[f64], best: &Evidence, edge: WallEdge) -> f64 {
    let sum: f64 = chances.iter().map(|chance| log_odds(*chance)).sum();
    let mean = sum / chances.len().max(1) as f64;
    let size = (best.cavity_ml.max(1.0) / USUAL_CAVITY_ML).ln();
    let square = size * size;
    match &best.views {
        None => match edge {
            WallEdge::Apparent => &calibration::GOOD_SET_APPARENT,
            WallEdge::Anatomical => &calibration::GOOD_SET_ANATOMICAL,
        }
        .unlimited_probability(&[mean, size, square]),
        Some(views) => match edge {
            WallEdge::Apparent => &calibration::GOOD_SET_APPARENT_BY_PROJECTIONS,
            WallEdge::Anatomical => &calibration::GOOD_SET_ANATOMICAL_BY_PROJECTIONS,
        }
        .unlimited_probability(&[mean, size, square, best.dark, log_gain(views)]),
    }
}

/// Factor of the chance of a good fit whose position was found by a part of the wall alone: of 13 such fits
/// to hearts that are refused without a hint, whose chances have a mean of 0.64, 3 have a Jaccard index of 0.75 or
/// more (12 infarcts and a turned heart of the simulator's seeds 2101, 2103, 4102 and 4202).
const PARTIAL_WALL_FACTOR: f64 = 0.35;

/// The chance of a good fit of `model`, which has this `chance` by all else, in view of how its position was found.
pub(super) fn in_view_of_search(chance: f64, model: &FittedModel) -> f64 {
    match &model.localisation {
        Some(found) if found.infarcted => PARTIAL_WALL_FACTOR * chance,
        _ => chance,
    }
}

/// The confidence of a model's position, 0 (a guess) to 1: that of the search for a ventricle, lowered where few
/// sensors see an edge. 0.5 or less for other organs.
pub fn of_position(model: &FittedModel) -> f64 {
    let search = model.localisation.as_ref().map_or(0.5, |l| l.confidence);
    search * (model.active / 0.5).min(1.0)
}

/// The logarithm of the odds of a chance, between those of about 1 and 99 per cent.
pub fn log_odds(chance: f64) -> f64 {
    ((chance + 0.01) / (1.01 - chance)).ln()
}

/// The chance that the patient moved during the scan, 0..=1: by the shape of the wall, and by the projections.
pub fn of_motion(e: &Evidence) -> f64 {
    let values = [
        e.active,
        e.thickness_spread.max(0.1).ln(),
        e.cavity_ml.max(0.1).ln(),
        e.slenderness,
        e.unroundness.max(1e-3).ln(),
        e.offset,
        e.dark,
        e.beside,
    ];
    let by_shape = calibration::MOTION_BY_SHAPE.probability(&values);
    e.views.as_ref().map_or(by_shape, |views| {
        let values = [log_gain(views), log_odds(by_shape)];
        calibration::MOTION_BY_PROJECTIONS.unlimited_probability(&values)
    })
}

/// The chance that what was fitted is a left ventricle in its position, 0..=1, where the search has the confidence
/// `search`; `None` where the wall projects to nothing.
///
/// No image without a heart is as dark within a ring as a ventricle and shows the fitted wall in all projections.
pub fn of_heart(e: &Evidence, search: f64) -> Option<f64> {
    let views = e.views.as_ref()?;
    let values = [e.hollowness, views.agreement, search];
    Some(calibration::HEART_FITTED.probability(&values))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evidence(gain: Option<f64>) -> Evidence {
        Evidence {
            active: 0.8,
            residual: 0.7,
            strain: 0.14,
            hollowness: 0.55,
            cavity_ml: 60.0,
            thickness_spread: 1.5,
            unroundness: 0.08,
            offset: 0.01,
            slenderness: 2.4,
            septal_bulge: 1.0,
            septal_overshoot: 0.0,
            dark: 0.05,
            beside: 0.02,
            views: gain.map(views),
        }
    }

    fn views(gain: f64) -> Views {
        Views {
            agreement: 0.9,
            gain,
            displacement: 12.0,
            share: 0.4,
        }
    }

    #[test]
    fn the_more_two_places_explain_the_likelier_is_motion_and_the_less_a_good_fit() {
        let gains = [0.0, 0.02, 0.05, 0.1, 0.3, 1.0];
        let moved = gains.map(|gain| of_motion(&evidence(Some(gain))));
        assert!(
            moved.is_sorted() && moved[0] < 0.01 && moved[5] > 0.9,
            "{moved:?}"
        );
        for edge in [WallEdge::Apparent, WallEdge::Anatomical] {
            let good = gains.map(|gain| of_set(&[0.9; 4], &evidence(Some(gain)), edge));
            assert!(good.is_sorted_by(|a, b| a > b), "{good:?}");
            let [low, high] =
                [0.3, 0.9].map(|chance| of_set(&[chance; 4], &evidence(Some(0.02)), edge));
            assert!(low < high);
        }
        assert!(of_motion(&evidence(None)) < 0.2);
    }

    /// A cavity far from the usual size speaks against the fit of the anatomical wall, and dark wall against both.
    #[test]
    fn large_hearts_and_dark_walls_are_doubted() {
        let chance = |cavity_ml: f64, dark: f64, edge| {
            let best = Evidence {
                cavity_ml,
                dark,
                ..evidence(Some(0.012))
            };
            of_set(&[0.8; 4], &best, edge)
        };
        for edge in [WallEdge::Apparent, WallEdge::Anatomical] {
            let usual = chance(55.0, 0.05, edge);
            assert!(chance(250.0, 0.05, edge) < usual - 0.1);
            assert!(chance(55.0, 0.3, edge) < usual - 0.02);
        }
    }

    /// A fit whose figures are about the means of the hearts that the chances are calibrated on.
    fn usual() -> Evidence {
        Evidence {
            active: 0.75,
            strain: 0.105,
            hollowness: 0.55,
            thickness_spread: 1.83,
            unroundness: 0.0925,
            cavity_ml: 50.0,
            offset: 0.0152,
            slenderness: 2.37,
            dark: 0.081,
            beside: 0.055,
            ..evidence(None)
        }
    }

    /// Calibrated on hearts of which about a fifth of the fits are bad and a seventh moved; hearts in the
    /// middle are better than the mean.
    #[test]
    fn the_usual_heart_has_about_the_chances_of_the_calibration() {
        let good = [WallEdge::Apparent, WallEdge::Anatomical].map(|e| of_agreement(&usual(), e));
        assert!(good[0] > 0.9 && good[0] < 0.95, "{good:?}");
        assert!(good[1] > 0.8 && good[1] < 0.88, "{good:?}");
        let moved = of_motion(&usual());
        assert!(moved > 0.05 && moved < 0.15, "{moved}");
    }

    /// Each figure moves each chance the way that it tells good from bad.
    #[test]
    fn every_figure_moves_the_chances_its_own_way() {
        type Change = fn(&mut Evidence);
        let changed = |change: Change| {
            let mut e = usual();
            change(&mut e);
            e
        };
        let worse: [Change; 4] = [
            |e| e.active -= 0.15,
            |e| e.thickness_spread *= 1.15,
            |e| e.strain += 0.025,
            |e| e.unroundness *= 1.25,
        ];
        for edge in [WallEdge::Apparent, WallEdge::Anatomical] {
            for change in worse {
                let chances = [usual(), changed(change)].map(|e| of_agreement(&e, edge));
                assert!(chances[1] < chances[0] - 0.01, "{chances:?}");
            }
        }
        let likelier: [Change; 8] = [
            |e| e.active -= 0.15,
            |e| e.thickness_spread *= 1.15,
            |e| e.cavity_ml *= 1.8,
            |e| e.slenderness += 0.19,
            |e| e.unroundness *= 1.25,
            |e| e.offset += 0.009,
            // What else makes a wall uneven.
            |e| e.dark -= 0.08,
            |e| e.beside -= 0.05,
        ];
        for change in likelier {
            let chances = [usual(), changed(change)].map(|e| of_motion(&e));
            assert!(chances[1] > chances[0] + 0.005, "{chances:?}");
        }
    }

    #[test]
    fn the_odds_are_those_of_the_chance_and_end_at_about_one_per_cent() {
        for chance in [0.1, 0.35, 0.5, 0.9] {
            let exact = f64::ln(chance / (1.0 - chance));
            assert!((log_odds(chance) - exact).abs() < 0.1);
            assert!((log_odds(chance) + log_odds(1.0 - chance)).abs() < 1e-12);
        }
        assert!((log_odds(1.0) - 101f64.ln()).abs() < 1e-9);
        assert!((log_odds(0.0) + 101f64.ln()).abs() < 1e-9);
    }

    /// Fits that agree on their chance about keep it, whatever their number and where the views are those of a patient
    /// at rest (whose gain is .012 in the median); a failed one takes some of it away.
    #[test]
    fn fits_that_are_all_good_make_a_good_set() {
        for edge in [WallEdge::Apparent, WallEdge::Anatomical] {
            for chances in [&[0.9][..], &[0.9; 4]] {
                for gain in [None, Some(0.012)] {
                    let set = of_set(chances, &evidence(gain), edge);
                    assert!((set - 0.9).abs() < 0.08, "{set}");
                }
            }
            let of = |chances: &[f64]| of_set(chances, &evidence(None), edge);
            let [two, alike] = [[0.9, 0.1], [0.5, 0.5]].map(|c| of(&c));
            assert!((two - alike).abs() < 1e-9);
            assert!(of(&[0.9, 0.9, 0.0]) < 0.7);
            assert!((0.3..0.6).contains(&of(&[])));
        }
    }

    #[test]
    fn the_logarithm_of_the_gain_has_ends() {
        let of = |gain: f64| log_gain(&views(gain));
        assert_eq!((of(-1.0), of(5.0)), (of(0.0), of(1.0)));
        assert!((of(0.0) - 0.01f64.ln()).abs() < 1e-9 && (of(0.24) - 0.25f64.ln()).abs() < 1e-9);
    }

    /// Logistic regression: what either changes of the odds does not depend on the other.
    #[test]
    fn shape_and_projections_each_change_the_odds_of_motion() {
        let odds = |active: f64, gain: f64| {
            let chance = of_motion(&Evidence {
                active,
                ..evidence(Some(gain))
            });
            (chance / (1.0 - chance)).ln()
        };
        let by_shape = [0.02, 0.2].map(|gain| odds(0.6, gain) - odds(0.9, gain));
        let by_gain = [0.6, 0.9].map(|active| odds(active, 0.2) - odds(active, 0.02));
        assert!(by_shape[0] > 0.1 && (by_shape[0] - by_shape[1]).abs() < 1e-6);
        assert!(by_gain[0] > 1.0 && (by_gain[0] - by_gain[1]).abs() < 1e-6);
        // At rest the projections speak against what the shape of a usual heart leaves open.
        let usual = |gain: Option<f64>| {
            of_motion(&Evidence {
                views: gain.map(views),
                ..usual()
            })
        };
        assert!(usual(Some(0.012)) < 0.5 * usual(None));
        assert!(usual(Some(0.2)) > 2.0 * usual(None));
    }

    /// Three of 13 fits whose chances had a mean of 0.64 were good.
    #[test]
    fn a_position_found_by_a_part_of_the_wall_leaves_the_chance_of_such_fits() {
        assert!((PARTIAL_WALL_FACTOR * 0.64 - 3.0 / 13.0).abs() < 0.02);
    }

    #[test]
    fn what_is_solid_or_missing_in_the_projections_is_no_heart() {
        let chance = |hollowness: f64, agreement: f64, search: f64| {
            let mut evidence = evidence(Some(0.02));
            evidence.hollowness = hollowness;
            if let Some(views) = &mut evidence.views {
                views.agreement = agreement;
            }
            of_heart(&evidence, search).unwrap()
        };
        // A usual heart, and one whose apex is so dark that the search hardly believes in it.
        assert!(chance(0.55, 0.9, 1.0) > 0.99 && chance(0.57, 0.86, 0.26) > 0.5);
        // What is found in scans without a heart lacks one or the other, whatever the search says.
        assert!(chance(0.22, 0.59, 0.64) < 0.5 && chance(0.52, 0.35, 0.9) < 0.5);
        assert!(chance(0.15, 0.75, 0.7) < 0.5);
        assert!(of_heart(&evidence(None), 1.0).is_none());
    }
}
