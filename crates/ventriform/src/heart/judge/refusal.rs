//! Whether what was fitted is a heart at all.
//!
//! In go a fitted model and its judgement; out comes [`LocateError::NoHeart`] with the reason where it is more likely
//! none. [`confidence::of_heart`] decides, or, in a map of labels and where the wall projects to nothing, limits
//! on edges, search and chance. Not guaranteed: a hot right ventricle alone may be taken for a left one.

use super::Judgement;
use super::confidence;
use super::flags::Flag;
use crate::heart::deform::FittedModel;
use crate::image::locate::{Hints, LocateError, NotAHeart};

/// Where [`confidence::of_heart`] does not decide, a fitted model is no heart if less than this share of its
/// area sees an edge, and the edges are farther away than this (weighted rms, mm). Hearts have at least 0.63 or at most
/// 1.15, also with 100 % defects over seven segments; noise has at most 0.51 and at least 1.6.
const NO_WALL_EDGE_LIMITS: (f64, f64) = (0.57, 1.3);

/// Likewise, if the search's confidence and the chance of a good fit are below one
/// of these pairs. Hearts that fit badly, for motion or infarcts, are found with 0.32 at least, and
/// with 0.58 where the chance is below the second limit; what was found in scans without a heart had
/// 0.38 at most.
const UNLIKELY_HEART_LIMITS: [(f64, f64); 2] = [(0.3, 0.25), (0.5, 0.05)];
/// Least chance of a heart ([`confidence::of_heart`]). Of 106 fits of hearts one has less (motion; Jaccard index 0.21),
/// of 59 fits to scans without one or beside it all but one, which took a hot right ventricle (calibrating seeds).
const MIN_HEART_PROBABILITY: f64 = 0.5;
/// In a map of labels, or with a greater share of the model beyond the volume (per cent), the search's
/// confidence does not count.
const MAX_OUTSIDE_PERCENT: f64 = 50.0;

/// Refuses a ventricle that is more likely none: by [`confidence::of_heart`], or, in a map of labels and
/// where the wall projects to nothing, one whose model found no wall or that neither the search nor the fit
/// believes in. A hint says that it is there.
///
/// # Errors
/// [`LocateError::NoHeart`].
pub fn require_heart(
    model: &FittedModel,
    judgement: &Judgement,
    hints: &Hints,
) -> Result<(), LocateError> {
    let Some(found) = &model.localisation else {
        return Ok(());
    };
    match why_no_heart(model, judgement, found.confidence) {
        Some(reason) if hints.centre.is_none() => Err(LocateError::NoHeart {
            centre: found.cup.centre.into(),
            correlation: found.correlation,
            reason,
            size: None,
        }),
        _ => Ok(()),
    }
}

/// Why this is no heart, which the search found with the confidence `search`.
fn why_no_heart(model: &FittedModel, judgement: &Judgement, search: f64) -> Option<NotAHeart> {
    let misled = judgement.flags.iter().any(|flag| match flag {
        Flag::LabelMap { .. } => true,
        Flag::TouchesBorder { share } => *share > MAX_OUTSIDE_PERCENT,
        _ => false,
    });
    if !misled
        && let Some(evidence) = &judgement.evidence
        && let Some(views) = &evidence.views
        && let Some(chance) = confidence::of_heart(evidence, search)
    {
        return (chance < MIN_HEART_PROBABILITY).then_some(NotAHeart::Unseen {
            hollowness: evidence.hollowness,
            agreement: views.agreement,
            search,
            chance,
        });
    }
    let (active, residual, chance) = (model.active, model.residual, judgement.confidence);
    if active < NO_WALL_EDGE_LIMITS.0 && !(residual < NO_WALL_EDGE_LIMITS.1) {
        return Some(NotAHeart::Edgeless { active, residual });
    }
    let believed = if misled { 0.0 } else { search };
    UNLIKELY_HEART_LIMITS
        .iter()
        .any(|(limit, least)| believed < *limit && chance < *least)
        .then_some(NotAHeart::Unlikely { search, chance })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::heart::judge::Fit;
    use crate::heart::judge::test_fits::ball;
    use crate::image::locate::cup::Cup;
    use crate::image::locate::localisation::Localisation;

    #[test]
    fn what_has_no_edges_or_no_chance_is_no_heart() {
        let (_, found) = ball();
        assert!(found.judgement.evidence.is_none());
        let reason = |active: f64, residual: f64, search: f64, chance: f64, share: f64| {
            let mut fit = found.clone();
            (fit.model.active, fit.model.residual) = (active, residual);
            fit.judgement.confidence = chance;
            fit.judgement.flags.push(Flag::TouchesBorder { share });
            match why_no_heart(&fit.model, &fit.judgement, search) {
                None => "",
                Some(NotAHeart::Edgeless { .. }) => "edgeless",
                Some(NotAHeart::Unlikely { .. }) => "unlikely",
                Some(_) => "another",
            }
        };
        assert_eq!(reason(0.9, 1.0, 0.9, 0.9, 1.0), "");
        // Few edges, and far ones.
        assert_eq!(reason(0.5, 1.4, 0.9, 0.9, 1.0), "edgeless");
        assert_eq!(reason(0.5, f64::NAN, 0.9, 0.9, 1.0), "edgeless");
        assert_eq!(reason(0.5, 1.2, 0.9, 0.9, 1.0), "");
        assert_eq!(reason(0.6, 1.4, 0.9, 0.9, 1.0), "");
        for (limit, least) in UNLIKELY_HEART_LIMITS {
            assert_eq!(
                reason(0.9, 1.0, limit - 0.01, least - 0.01, 1.0),
                "unlikely"
            );
            assert_eq!(reason(0.9, 1.0, limit, least, 1.0), "");
        }
        // The search does not count where most of the model lies beyond the volume.
        assert_eq!(reason(0.9, 1.0, 0.9, 0.2, MAX_OUTSIDE_PERCENT), "");
        assert_eq!(
            reason(0.9, 1.0, 0.9, 0.2, MAX_OUTSIDE_PERCENT + 1.0),
            "unlikely"
        );
    }

    #[test]
    fn a_hint_and_what_is_no_ventricle_are_believed() {
        let (_, mut fit) = ball();
        let hinted = Hints {
            centre: Some(Vec3::zeros()),
            ..Hints::default()
        };
        let required = |fit: &Fit, hints: &Hints| require_heart(&fit.model, &fit.judgement, hints);
        (fit.model.active, fit.model.residual) = (0.1, 9.0);
        assert!(required(&fit, &Hints::default()).is_ok());
        let centre = Vec3::new(1.0, 2.0, 3.0);
        fit.model.localisation = Some(Localisation {
            cup: Cup {
                centre,
                axis: Vec3::z(),
                length: 70.0,
                breadth: 1.0,
            },
            correlation: 0.8,
            wall: 1.0,
            hollowness: 0.5,
            dark_apex: None,
            runner_up: None,
            infarcted: false,
            confidence: 0.9,
        });
        assert!(required(&fit, &hinted).is_ok());
        let Err(LocateError::NoHeart { centre: at, .. }) = required(&fit, &Hints::default()) else {
            panic!("a model without edges is no heart");
        };
        assert_eq!(Vec3::from(at), centre);
        (
            fit.model.active,
            fit.model.residual,
            fit.judgement.confidence,
        ) = (0.9, 1.0, 0.9);
        assert!(required(&fit, &Hints::default()).is_ok());
    }
}
