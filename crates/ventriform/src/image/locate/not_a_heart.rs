//! Reasons why a candidate is not a heart, and their limits.

/// Least correlation of a heart with a cup. Simulated and clinical hearts reach 0.76 to
/// 0.99; where the heart was erased from five scans, the best other structure had 0.61 to 0.66.
pub(super) const MIN_CORRELATION: f64 = 0.6;
/// Hollowness below which a body counts as solid. Hearts: 0.45 to 0.76; the others: 0.08 to 0.15.
pub(super) const MIN_HOLLOWNESS: f64 = 0.2;
/// Share of the wall's value above which the base counts as closed. Hearts: 0.2 to 0.7 (the
/// latter in a scan with a background of half the heart's uptake); spherical shells, brains
/// and stomachs: 1.0 and more.
pub(super) const MAX_LID_SHARE: f64 = 0.85;

/// Why a candidate is not a heart.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NotAHeart {
    /// The image does not look like a cup there.
    #[error("correlates {correlation:.2} with a ventricle's wall ({MIN_CORRELATION:.2} is needed)")]
    Unlike {
        /// Correlation with a cup.
        correlation: f64,
    },
    /// It has no cavity.
    #[error("is hollow by {hollowness:.2} ({MIN_HOLLOWNESS:.2} is needed)")]
    Solid {
        /// 1 - cavity / wall.
        hollowness: f64,
    },
    /// It is closed at the base.
    #[error(
        "is closed at the base: {lid:.2} of the wall's value there (at most {MAX_LID_SHARE:.2})"
    )]
    Closed {
        /// Value across the base, wall = 1.
        lid: f64,
    },
    /// The fitted model found no wall.
    #[error(
        "has no wall: {:.0} % of the fitted surface see an edge, {residual:.1} mm from it in \
         the mean",
        100.0 * active
    )]
    Edgeless {
        /// Share of the fitted model's area that sees an edge.
        active: f64,
        /// Weighted rms distance of those edges, mm.
        residual: f64,
    },
    /// The cavity, the projections and the search together speak against it.
    #[error(
        "is no heart: it is hollow by {hollowness:.2}, the projections of the image agree with the fitted wall by \
         {agreement:.2}, and the search has a confidence of {search:.2}: a chance of {:.0} %",
        100.0 * chance
    )]
    Unseen {
        /// 1 - cavity / wall.
        hollowness: f64,
        /// Mean correlation of image and fitted wall in the projections, -1..=1.
        agreement: f64,
        /// Confidence of the search, 0..=1.
        search: f64,
        /// Chance of a heart, 0..=1.
        chance: f64,
    },
    /// Both the search and the fitted model give it little confidence.
    #[error(
        "is no heart: the search has a confidence of {search:.2}, and the model fitted there a chance \
         of {:.0} % to be right",
        100.0 * chance
    )]
    Unlikely {
        /// Confidence of the search, 0..=1.
        search: f64,
        /// Chance of a good fit, 0..=1.
        chance: f64,
    },
}
