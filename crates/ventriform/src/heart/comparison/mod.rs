//! The wall's uptake at stress beside that at rest: what is lost only under stress.
//!
//! In: the polar maps of two scans of one heart, of one model ([`Sides`]). Out: their [`Change`].
//!
//! 1. The stress map is turned about the long axis if the maps then agree significantly better ([`Turn`]).
//! 2. Stress is scaled to rest by the places that did not change ([`matched`](crate::heart::normals::matched) with the rest
//!    map in place of the normal mean), never by each map's maximum.
//! 3. The difference, rest less stress, is smoothed over the wall. How much it differs where nothing changed is
//!    estimated from the pair itself (`noise.rs`).
//! 4. Wall whose loss at stress noise does not explain is reversible, as far as half of the depth of the loss
//!    (`border.rs`); wall below the threshold of the rest map in both is fixed.
//! 5. Draws of correlated noise give each share and each score an interval and a verdict ([`Answers`],
//!    [`ScoreAnswers`]).
//! 6. Changes of the beat, where both scans are gated, have the errors of hearts whose beat did not change
//!    (`beat_change.rs`).
//!
//! [`ComparisonFlag`] names what makes a comparison doubtful.
//!
//! Guaranteed: a scan multiplied by a factor gives the same figures.
//!
//! Not guaranteed: without normal limits it is not known what is normal: a defect at rest that fills under stress
//! shows as a negative difference and counts as reverse redistribution. No category is derived.

mod answers;
mod beat_calibration;
pub mod beat_change;
mod border;
mod calibration;
mod difference;
mod figure_change;
mod flags;
mod noise;
mod scale;
mod scores;
mod side_by_side;
mod turn;

pub use answers::{Answer, Answers, FEW_COUNTS_LOSS_PERCENT, Verdict};
pub use difference::{Change, ComparedSegment, ComparedTerritory, PartFigures};
pub use figure_change::{ChangeError, ChangingFigure, FigureChange};
pub(in crate::heart) use figure_change::{by_difference, by_share};
pub use flags::{ComparisonFlag, Reason, WhichScan};
pub use noise::Noise;
pub use scale::Sides;
pub use scores::ScoreAnswers;
pub use turn::Turn;
