//! Normal limits: a scan's polar map against the maps of healthy people.
//!
//! In: a [`PolarMap`](crate::heart::polar::PolarMap), the kind of the scan ([`ScanKind`]) and a file of limits
//! ([`NormalLimits`]), built from healthy people's maps ([`group_of`]). Out: how far each place lies below the normal
//! mean ([`Perfusion`]), with extent, severity and scores.
//!
//! 1. The group of the file with the scan's sex, protocol, tracer and attenuation correction is looked up
//!    ([`NormalLimits::group`]); another one is refused.
//! 2. Scale and pattern of the scan are fitted to the places that look normal ([`matched`]), never to the scan's own
//!    maximum: those within [`MATCHED_Z`] standard deviations, again and again until they stay the same. The pattern
//!    ([`Coefficients`]) is what healthy people vary in as a whole, such as their attenuation.
//! 3. With the normal mean m of a place in this scan, the standard deviation s and the scaled uptake x: `z = (x - m)
//!    / s`, deficit `d = 1 - x / m`, limit `l = Z_LIMIT s / m`. Its score rises from 0 at the limit to 4 at
//!    [`DEFICIT_OF_FULL_SCORE`].
//! 4. Extent is the share of the wall's area beyond the limit, severity the mean of |z| there, the deficit score the
//!    mean of the places' scores in per cent of 4. A segment's score is the rounded mean of its places' scores; the
//!    summed score is the sum over the 17 segments, its per cent that of 68.
//!
//! Places that the scan's map masks (beyond the muscle's end) and those that too few healthy people have are in no
//! figure.
//!
//! Guaranteed: a scan multiplied by a factor has the same figures; an edited file of limits is refused.
//!
//! Not guaranteed: limits hold for the camera, reconstruction and filter of the scans that they were built from. The
//! deficit score is like a total perfusion deficit (TPD), but not comparable with that of other programs. No category
//! is derived, and no limit is known that no file states.

mod build;
mod document;
mod error;
mod flags;
mod kind;
mod matching;
mod pattern;
mod perfusion;
mod place_limits;
mod sizes;
#[cfg(test)]
mod tests;

pub use build::{GroupError, GroupKind, HealthyScan, group_of, limits_of};
pub(crate) use document::names_protocol;
pub use document::{
    ExcludedCase, GlobalLimit, LeftOut, LimitMap, MOST_NORMALS_BYTES, NormalCase, NormalGroup,
    NormalLimits, Specificity,
};
pub use error::NormalsError;
pub(crate) use flags::KIND_NOT_STATED;
pub use flags::NormalsFlag;
pub use kind::{GroupSex, ScanKind, Sex, yes_or_no};
pub use matching::{MATCHED_Z, Matched, matched};
pub use pattern::{Coefficients, PATTERN_TERMS, TermMatrix};
pub use perfusion::{
    DEFICIT_OF_FULL_SCORE, FigureBeside, HeartFigure, NoisyScores, NormalsUsed, Perfusion,
    SegmentPerfusion, TerritoryPerfusion, Z_LIMIT, apply, summed_percent,
};
pub use place_limits::{PlaceLimits, ScanPlaces};
pub use sizes::{FEW_CASES, FEWEST_CASES, NORMALS_SCHEMA_VERSION};
