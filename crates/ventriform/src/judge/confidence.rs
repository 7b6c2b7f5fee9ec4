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
//! Calibrated on 139 fits of simulated hearts with the built-in model: the cohort, and hearts of the
//! simulator's seeds 411 and 701 (all kinds) and 702 (motion, hot right ventricle, infarcts). Of the
//! apparent wall 25 of them lie below 0.75, of the anatomical wall 36. Such hearts are
//! over-represented, so the chance is on the cautious side. Left out one by one, the chance separates
//! good from bad fits with an area under the curve of 0.89 for both walls; on 72 held-out hearts
//! (seeds 801 and 802, 7 and 14 below 0.75) with 0.85. The terms were chosen among 14 sets by the
//! former figure. The confidence of the search alone reaches 0.64,
//! [`Fit::merit`](super::Fit::merit) 0.85, the residual 0.86, the share of active sensors 0.84 (on
//! the fits of an earlier version); beside the terms used, the residual adds nothing.
//! docs/evaluation.md has the table.
//!
//! Of several fits to one volume, [`of_set`] takes the mean logarithm of the odds, which scatters less
//! than that of one fit: over the four built-in hearts the area under the curve of [`of_agreement`] rises
//! from 0.896 to 0.916 (apparent wall) and from 0.885 to 0.902 (anatomical), each case left out. Its
//! constants come from 174 fits: the cohort and the simulator's seeds 411, 701, 702, 703 (hot right
//! ventricle) and 704 (motion and others). The distance of the fits from each other was tried as a term
//! in six forms and adds nothing (0.916 and 0.906 with it): where a fit is bad, all start from
//! the same wrong place. Nor do figures of the profiles across the wall (34 were tried one by one).
//!
//! The chance of motion by the shape of the wall comes from the same 174 fits (24 with a displacement of 6 to
//! 26 mm). Two of its terms tell what else makes a wall uneven: infarcts ([`Evidence::dark`]) and neighbours
//! ([`Evidence::beside`]). With them the area under the curve is 0.97, each case left out, without them 0.89.
//!
//! Where it is known how the patient lay, the projections of the image ([`Views::gain`]) join both chances. Those weights
//! come from 99 fits of the simulator's seeds 911, 1101 and 1102 (18 with motion of 6 to 26 mm; 24 and 33 below 0.75,
//! apparent and anatomical wall). Each case left out, the area under the curve of motion rises from 0.89 to 0.997,
//! that of the apparent wall from 0.79 to 0.87, of the anatomical one from 0.83 to 0.90. The agreement of the views, the
//! displacement and the slenderness were tried beside it and add nothing. docs/evaluation.md has the held-out figures.
//!
//! The chance of a good anatomical wall knows the size of the cavity besides: 115 fits (the cohort and the
//! simulator's seeds 2101, 2103, 2104; 28 below 0.75). Each left out, the area under the curve rises from 0.82 to 0.89.
//!
//! The chance of a heart ([`of_heart`]) comes from 106 fits of hearts and 59 of what was found beside one, in scans
//! without one, or where it was erased and the right ventricle is not hot (the same cohort and seeds). Each left out, an
//! even chance tells all but two apart. The share of active sensors and the residual were tried beside its terms and
//! add nothing.
//!
//! Not guaranteed: that a displaced heart is noticed. A displacement in the last views only leaves an image of one
//! heart in one place, which may not be its place in another image.

use super::evidence::Evidence;
use super::motion::Views;
use crate::deform::{FittedModel, WallEdge};

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
    -2.524,
    [
        // share of the surface with edges
        term(0.7538, 0.1554, -1.118),
        // ln(spread of the thickness / mm)
        term(0.6063, 0.1388, 0.774),
        // strain
        term(0.1049, 0.0258, 0.211),
        // ln(unroundness)
        term(-2.3805, 0.2250, 1.320),
        // hollowness
        term(0.5492, 0.1123, 0.082),
    ],
);

/// Constant and terms of a bad fit of the anatomical wall, likewise.
const BAD_ANATOMICAL: (f64, [Term; 5]) = (
    -1.639,
    [
        // share of the surface with edges
        term(0.7538, 0.1554, -1.307),
        // ln(spread of the thickness / mm)
        term(0.6063, 0.1388, 1.008),
        // strain
        term(0.1049, 0.0258, 0.678),
        // ln(unroundness)
        term(-2.3805, 0.2250, 0.632),
        // hollowness
        term(0.5492, 0.1123, 0.152),
    ],
);

/// Constant and terms of motion.
const MOTION: (f64, [Term; 8]) = (
    -3.360,
    [
        // share of the surface with edges
        term(0.7465, 0.1530, -1.727),
        // ln(spread of the thickness / mm)
        term(0.4669, 0.1528, 0.984),
        // ln(cavity / ml)
        term(3.9231, 0.6107, 0.154),
        // slenderness
        term(2.3731, 0.1880, 0.599),
        // ln(unroundness)
        term(-2.4416, 0.2221, 1.009),
        // offset
        term(0.0152, 0.0087, 0.278),
        // dark share of the wall
        term(0.0808, 0.1147, -1.688),
        // share of the wall with something beside it
        term(0.0550, 0.0624, -1.612),
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

/// Constant and factor of the mean logarithm of the odds, apparent and anatomical wall, where it is unknown
/// how the patient lay.
const OF_SET: [[f64; 2]; 2] = [[-0.236, 1.096], [0.05, 0.953]];

/// Constant and factors of the mean logarithm of the odds and of [`doubling`], apparent wall.
const OF_SET_AND_VIEWS: [f64; 3] = [-3.413, 0.444, -1.207];
/// The same of the anatomical wall, and the factor of the logarithm of the cavity / ml: the thin wall of a large heart
/// agrees less with a fitted one that lies off by as much.
const OF_SET_VIEWS_AND_SIZE: [f64; 4] = [2.683, 0.840, -0.950, -1.537];

/// Constant and factors of [`doubling`] and of the logarithm of the odds by the shape, in the chance of motion.
const MOTION_BY_VIEWS: [f64; 3] = [6.559, 2.550, 0.438];

/// The logarithm of the gain by two places of the wall ([`Views::gain`]), from about that of a patient at rest on.
fn doubling(views: &Views) -> f64 {
    (views.gain.clamp(0.0, 1.0) + 0.01).ln()
}

/// The chance that the best of several fits to one volume has a Jaccard index of 0.75 or more, from the
/// `chances` that [`of_agreement`] gives each for the wall with this `edge`, 0 for one that failed, and the
/// evidence of the best one.
pub fn of_set(chances: &[f64], best: &Evidence, edge: WallEdge) -> f64 {
    let sum: f64 = chances.iter().map(|chance| log_odds(*chance)).sum();
    let mean = sum / chances.len().max(1) as f64;
    let odds = match (&best.views, edge) {
        (None, WallEdge::Apparent) => OF_SET[0][0] + OF_SET[0][1] * mean,
        (None, WallEdge::Anatomical) => OF_SET[1][0] + OF_SET[1][1] * mean,
        (Some(views), WallEdge::Apparent) => {
            let [constant, factor, of_doubling] = OF_SET_AND_VIEWS;
            constant + factor * mean + of_doubling * doubling(views)
        }
        (Some(views), WallEdge::Anatomical) => {
            let [constant, factor, of_doubling, of_size] = OF_SET_VIEWS_AND_SIZE;
            let size = best.cavity_ml.max(1.0).ln();
            constant + factor * mean + of_doubling * doubling(views) + of_size * size
        }
    };
    1.0 / (1.0 + (-odds).exp())
}

/// The chance of a good fit where a part of the wall alone told its place, from that of the others: of 13 such fits
/// to hearts that are refused without a hint, whose chances have a mean of 0.64, 3 have a Jaccard index of 0.75 or
/// more (12 infarcts and a turned heart of the simulator's seeds 2101, 2103, 4102 and 4202).
pub fn of_a_part(chance: f64) -> f64 {
    0.35 * chance
}

/// The chance of a good fit of `model`, which has this `chance` by all else, in view of what told its position.
pub(super) fn in_view_of_search(chance: f64, model: &FittedModel) -> f64 {
    match &model.localisation {
        Some(found) if found.infarcted => of_a_part(chance),
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

/// The chance that the patient moved during the scan, 0..=1: by the shape of the wall, and by the projections
/// where it is known how the patient lay.
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
    let by_shape = logistic(MOTION.0, &MOTION.1, &values);
    let Some(views) = &e.views else {
        return by_shape;
    };
    let [constant, of_doubling, of_shape] = MOTION_BY_VIEWS;
    let odds = constant + of_doubling * doubling(views) + of_shape * log_odds(by_shape);
    1.0 / (1.0 + (-odds).exp())
}

/// Constant and terms of a heart.
const HEART: (f64, [Term; 3]) = (
    1.58,
    [
        // hollowness
        term(0.437, 0.171, 1.66),
        // agreement of the views
        term(0.760, 0.203, 2.28),
        // confidence of the search
        term(0.718, 0.364, 1.36),
    ],
);

/// The chance that what was fitted is a left ventricle in its place, 0..=1, where the search has the confidence
/// `search`; `None` where it is unknown how the patient lay.
///
/// No image without a heart is as dark within a ring as a ventricle and shows the fitted wall in all projections.
pub fn of_heart(e: &Evidence, search: f64) -> Option<f64> {
    let views = e.views.as_ref()?;
    let values = [e.hollowness, views.agreement, search];
    Some(logistic(HEART.0, &HEART.1, &values))
}

fn logistic<const N: usize>(constant: f64, terms: &[Term; N], values: &[f64; N]) -> f64 {
    let sum: f64 = terms
        .iter()
        .zip(values)
        .map(|(t, value)| t.weight * ((value - t.centre) / t.scale).clamp(-FARTHEST, FARTHEST))
        .sum();
    1.0 / (1.0 + (-constant - sum).exp())
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
    fn figures_far_from_all_that_is_known_count_as_four_deviations() {
        let terms = [term(2.0, 4.0, -3.0), term(1.0, 0.5, 0.7)];
        let odds = |values: [f64; 2]| {
            let chance = logistic(0.5, &terms, &values);
            (chance / (1.0 - chance)).ln()
        };
        assert!((odds([2.0, 1.0]) - 0.5).abs() < 1e-9);
        assert!((odds([6.0, 1.0]) - (0.5 - 3.0)).abs() < 1e-9);
        assert!((odds([2.0, 0.5]) - (0.5 - 0.7)).abs() < 1e-9);
        assert!((odds([2.0, 99.0]) - (0.5 + 4.0 * 0.7)).abs() < 1e-9);
        assert!((odds([-99.0, 1.0]) - (0.5 + 4.0 * 3.0)).abs() < 1e-6);
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

    /// Fits that agree on their chance keep it, whatever their number and where the views are those of a patient
    /// at rest (whose gain is .012 in the median); a failed one takes some of it away.
    #[test]
    fn fits_that_are_all_good_make_a_good_set() {
        for edge in [WallEdge::Apparent, WallEdge::Anatomical] {
            for chances in [&[0.9][..], &[0.9; 4]] {
                for gain in [None, Some(0.012)] {
                    let set = of_set(chances, &evidence(gain), edge);
                    assert!((set - 0.9).abs() < 0.05, "{set}");
                }
            }
            let of = |chances: &[f64]| of_set(chances, &evidence(None), edge);
            let [two, alike] = [[0.9, 0.1], [0.5, 0.5]].map(|c| of(&c));
            assert!((two - alike).abs() < 1e-9);
            assert!(of(&[0.9, 0.9, 0.0]) < 0.7);
            assert!((0.4..0.6).contains(&of(&[])));
        }
    }

    #[test]
    fn the_logarithm_of_the_gain_has_ends() {
        let of = |gain: f64| doubling(&views(gain));
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
    fn a_place_told_by_a_part_of_the_wall_leaves_the_chance_of_such_fits() {
        assert!((of_a_part(0.64) - 3.0 / 13.0).abs() < 0.02);
        assert!(of_a_part(0.3) < of_a_part(0.9) && of_a_part(1.0) < 0.5);
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
