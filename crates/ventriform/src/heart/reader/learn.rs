//! From the distances measured on some masks to a profile.
//!
//! Of each distance: the mean over the masks, times n / (n + s²/t²), where n is the number of masks, s
//! their standard deviation and t how far readers differ at all ([`READER_OFFSETS_MM`]). That is the mean of the
//! posterior if readers scatter by t about zero, and the masks of one reader by s about the reader. As
//! few masks say little about s, [`PRIOR_MASKS`] masks with the spread that is usual ([`MASK_SPREAD_MM`]) are
//! added to it. A mean that is smaller than its own standard error cannot be told from none and is not
//! applied.
//!
//! Of the level likewise, drawn towards the usual one ([`USUAL_LEVEL`]).

use super::profile::{ReaderLevel, ReaderOffset, ReaderOffsets};

/// Distances of readers' edges from the fitted ones, in the order of [`ReaderOffsets`], mm.
///
/// With the spread below, a profile of one mask applies a third of what that mask showed. Two real masks,
/// perhaps of two readers, that were drawn 2.5 and 0.8 mm outside the fitted edge are the reason: the
/// whole of the first would harm the second.
pub const READER_OFFSETS_MM: [f64; 3] = [1.5, 1.5, 3.0];
/// Usual standard deviation over the masks of one reader, mm.
pub const MASK_SPREAD_MM: [f64; 3] = [2.0, 2.0, 4.0];
/// As many masks stand behind [`MASK_SPREAD_MM`].
pub const PRIOR_MASKS: f64 = 3.0;

/// The profile's distances, from those measured on each mask. `None` without a mask.
pub fn learn(measured: &[ReaderOffsets]) -> Option<[ReaderOffset; 3]> {
    if measured.is_empty() {
        return None;
    }
    let n = measured.len() as f64;
    Some([0, 1, 2].map(|which| {
        let values: Vec<f64> = measured.iter().map(|m| m.to_array()[which]).collect();
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        let usual = MASK_SPREAD_MM[which] * MASK_SPREAD_MM[which];
        let variance = (squares + PRIOR_MASKS * usual) / (n - 1.0 + PRIOR_MASKS);
        let share = n / (n + variance / (READER_OFFSETS_MM[which] * READER_OFFSETS_MM[which]));
        let told = mean.abs() >= (variance / n).sqrt();
        let share = if told { share } else { 0.0 };
        let spread = if n > 1.0 {
            (squares / (n - 1.0)).sqrt()
        } else {
            0.0
        };
        ReaderOffset {
            value: rounded(mean * share),
            mean: rounded(mean),
            spread: rounded(spread),
        }
    }))
}

/// The level of a reader of whom nothing is known: half of the wall's uptake, where the edge of a sharp wall lies after
/// blur.
pub const USUAL_LEVEL: f64 = 0.5;
/// Standard deviation of readers' levels about the usual one, and of the masks of one reader. Both are assumed: two
/// masks, whose levels were equal to a hundredth, say little of either.
pub const READER_LEVEL_SD: f64 = 0.1;
/// See [`READER_LEVEL_SD`].
pub const MASK_LEVEL_SD: f64 = 0.05;

/// The profile's level, from those of each mask; without a mask the usual one.
pub fn learn_level(levels: &[f64]) -> ReaderLevel {
    let n = levels.len() as f64;
    if levels.is_empty() {
        return ReaderLevel {
            value: USUAL_LEVEL,
            mean: USUAL_LEVEL,
            spread: 0.0,
        };
    }
    let mean = levels.iter().sum::<f64>() / n;
    let squares: f64 = levels.iter().map(|level| (level - mean).powi(2)).sum();
    let usual = MASK_LEVEL_SD * MASK_LEVEL_SD;
    let variance = (squares + PRIOR_MASKS * usual) / (n - 1.0 + PRIOR_MASKS);
    let share = n / (n + variance / (READER_LEVEL_SD * READER_LEVEL_SD));
    let spread = if n > 1.0 { squares / (n - 1.0) } else { 0.0 };
    ReaderLevel {
        value: rounded(USUAL_LEVEL + share * (mean - USUAL_LEVEL)),
        mean: rounded(mean),
        spread: rounded(spread.sqrt()),
    }
}

/// To a thousandth of a millimetre, or of the reference.
fn rounded(x: f64) -> f64 {
    (1e3 * x).round() / 1e3 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn learnt(values: &[f64]) -> ReaderOffset {
        let measured: Vec<ReaderOffsets> = values
            .iter()
            .map(|v| ReaderOffsets::from_array([*v, 0.0, 0.0]))
            .collect();
        learn(&measured).unwrap()[0]
    }

    #[test]
    fn a_level_is_drawn_towards_the_usual_one() {
        assert_eq!(learn_level(&[]).value, USUAL_LEVEL);
        let one = learn_level(&[0.6]);
        assert!((0.55..0.6).contains(&one.value), "{one:?}");
        let many = learn_level(&[0.6; 30]);
        assert!((0.598..=0.6).contains(&many.value), "{many:?}");
        let odd = learn_level(&[0.9, 0.3]);
        assert!(odd.value < learn_level(&[0.6, 0.6]).value, "{odd:?}");
    }

    #[test]
    fn few_masks_are_believed_less_than_many() {
        let one = learnt(&[2.0]);
        assert!((0.6..0.9).contains(&one.value), "{one:?}");
        let many = learnt(&[2.0; 30]);
        assert!((1.95..=2.0).contains(&many.value), "{many:?}");
        assert_eq!((many.mean, many.spread), (2.0, 0.0));
        assert_eq!(learnt(&[1.0]).value, 0.0);
        assert_eq!(learnt(&[1.0, -1.2, 0.9, -0.5]).value, 0.0);
        let odd = learnt(&[5.0, -1.0]);
        assert!(odd.value < learnt(&[2.0, 2.0]).value, "{odd:?}");
        assert_eq!(learn(&[]), None);
    }
}
