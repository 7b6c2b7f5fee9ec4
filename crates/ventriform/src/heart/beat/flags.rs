//! Reasons to look closer at a beat.

use super::beside::ActivityBeside;
use super::study::COUNT_LOSS_LEFT_OUT_SHARE;

/// Share of the orders of the gates that may be as smooth as theirs.
const ORDERS_AS_SMOOTH: f64 = 0.2;
/// EF below which noise alone would show as much, per cent.
const LEAST_EF_PERCENT: f64 = 5.0;
/// Share of the wall that may be too dark to show its motion.
const DARK_SHARE: f64 = 0.03;
/// End-systolic volume below which blur fills the cavity, ml.
const SMALL_ESV_ML: f64 = 20.0;
/// Share of the wall that must have a phase.
const MOVING_SHARE: f64 = 2.0 / 3.0;
/// Scatter of the phases by noise alone that may be, degrees: a third of a delay of 30 degrees.
const PHASE_NOISE_DEGREES: f64 = 10.0;
/// Share of the voxels about the wall that may lie outside of the volume.
const OUTSIDE_SHARE: f64 = 0.01;
/// Motion of a segment outward that is told, mm.
const OUTWARD_MOTION_MM: f64 = -1.0;
/// Share of a given mass by which that of the wall may differ.
const MASS_SHARE: f64 = 0.03;
/// Share of its counts that a gate may have too many.
const COUNT_GAIN_SHARE: f64 = 0.10;
/// Share of the beats that may be rejected.
const REJECTED_SHARE: f64 = 0.2;

/// A reason to look closer at a beat.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BeatFlag {
    /// The gates are not moments of one beat.
    #[error(
        "the gates show no beat: {:.0} % of their orders follow each other as smoothly as theirs, and the cavity \
         changes by {ef_percent:.0} %. They may be shuffled, repeated or not gated; EF is not given",
        100.0 * orders_as_smooth
    )]
    NoContraction {
        /// Share of the orders that are as smooth.
        orders_as_smooth: f64,
        /// Change of the cavity, per cent of the largest.
        ef_percent: f64,
    },
    /// Gates lack so many counts that the curve leaves them out.
    #[error(
        "gates lack more than {:.0} % of their counts, as after irregular beats: {}; they were left out of the curve",
        100.0 * COUNT_LOSS_LEFT_OUT_SHARE,
        losses_text(losses)
    )]
    CountLoss {
        /// Gates, from 1, and the share that each lacks.
        losses: Vec<(usize, f64)>,
    },
    /// A part of the wall is too dark to show its motion.
    #[error(
        "{:.0} % of the wall takes up too little to show how it moves; little motion was assumed there, so EF \
         and the figures of these segments are less certain",
        100.0 * share
    )]
    DarkWall {
        /// Share of the wall.
        share: f64,
    },
    /// The cavity is so small that blur fills it at end systole.
    #[error(
        "the end-systolic volume is {esv_ml:.0} ml: blur fills so small a cavity, and EF is less certain"
    )]
    SmallHeart {
        /// End-systolic volume, ml.
        esv_ml: f64,
    },
    /// Much of the wall has no phase, or noise scatters the phases.
    #[error("{}", phase_text(*moving_share, *noise_degrees))]
    PhaseUnreliable {
        /// Share of the wall that has a phase.
        moving_share: f64,
        /// Scatter of the phases by noise alone, degrees.
        noise_degrees: f64,
    },
    /// The wall's surroundings leave the volume.
    #[error(
        "{:.0} % of the heart's surroundings lie outside of the volume; the beat is seen in part only",
        100.0 * share
    )]
    LeavesField {
        /// Share of the voxels about the wall.
        share: f64,
    },
    /// Many beats were rejected.
    #[error(
        "{:.0} % of the beats were rejected: the heart beat irregularly, and the gates show the rest",
        100.0 * share
    )]
    BeatsRejected {
        /// Share of the beats, 0..=1.
        share: f64,
    },
    /// The wall did not get the mass that the caller gave.
    #[error(
        "the wall was to have {given_g:.0} g and has {found_g:.0} g: for so much or so little muscle it would have to \
         be thicker or thinner than walls are; make sure that the mass is that of this heart's left ventricle"
    )]
    MassNotMet {
        /// As given, g.
        given_g: f64,
        /// Of the wall, g.
        found_g: f64,
    },
    /// A gate has more counts than the others.
    #[error(
        "gates have more counts than the others, as after a fault of sorting: {}; each was scaled to the usual counts \
         of a gate",
        losses_text(gains)
    )]
    CountGain {
        /// Gates, from 1, and the share that each has too many.
        gains: Vec<(usize, f64)>,
    },
    /// Activity beside the wall changes over the beat.
    #[error(
        "beside segment {}, {:.0} mm outside of the wall, is activity of up to {:.0} % of the wall's uptake that \
         changes over the beat by {:.0} % of it: gut that moves may be taken for motion of the wall",
        .0.segment,
        .0.distance_mm,
        100.0 * .0.greatest,
        100.0 * .0.change
    )]
    ActivityBesideWall(ActivityBeside),
    /// Segments move outward.
    #[error(
        "segments move outward from end diastole to end systole: {}",
        motions_text(segments)
    )]
    OutwardMotion {
        /// Segments and their motion inward, mm.
        segments: Vec<(usize, f64)>,
    },
}

impl BeatFlag {
    /// The flag's name in reports.
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoContraction { .. } => "no_contraction",
            Self::CountLoss { .. } => "count_loss",
            Self::DarkWall { .. } => "dark_wall",
            Self::SmallHeart { .. } => "small_heart",
            Self::PhaseUnreliable { .. } => "phase_unreliable",
            Self::LeavesField { .. } => "leaves_field",
            Self::BeatsRejected { .. } => "beats_rejected",
            Self::MassNotMet { .. } => "mass_not_met",
            Self::CountGain { .. } => "count_gain",
            Self::ActivityBesideWall(_) => "activity_beside_wall",
            Self::OutwardMotion { .. } => "outward_motion",
        }
    }

    /// The flag of a study of which the file says that this share of the beats was rejected.
    pub fn of_rejected(share: f64) -> Option<Self> {
        (share > REJECTED_SHARE).then_some(Self::BeatsRejected { share })
    }

    /// The flag of a wall of `found_g` that was to have `given_g`.
    pub fn of_mass(given_g: f64, found_g: f64) -> Option<Self> {
        let off = (found_g / given_g - 1.0).abs();
        (off > MASS_SHARE).then_some(Self::MassNotMet { given_g, found_g })
    }

    /// Whether the gates are no beat, so that no EF is given.
    pub fn denies_a_beat(&self) -> bool {
        matches!(self, Self::NoContraction { .. })
    }
}

/// The facts that raise the flags of a beat.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FlagFacts<'a> {
    /// Share of the orders of the gates that are as smooth as theirs.
    pub orders_as_smooth: f64,
    /// Change of the cavity, per cent of the largest.
    pub ef_percent: f64,
    /// Share of the usual counts that each gate lacks.
    pub losses: &'a [f64],
    /// Share of the wall that is too dark to show its motion.
    pub dark_share: f64,
    /// End-systolic volume, ml.
    pub esv_ml: f64,
    /// Share of the wall that has a phase.
    pub moving_share: f64,
    /// Scatter of the phases by noise alone, degrees.
    pub phase_noise_degrees: f64,
    /// Share of the voxels about the wall outside of the volume.
    pub share_outside: f64,
    /// Activity beside the wall that changes over the beat.
    pub beside: Option<ActivityBeside>,
    /// Segments and their motion inward, mm.
    pub motions: Vec<(usize, f64)>,
}

/// The flags of a beat.
pub(super) fn raised(facts: &FlagFacts<'_>) -> Vec<BeatFlag> {
    let FlagFacts {
        orders_as_smooth,
        ef_percent,
        esv_ml,
        moving_share,
        phase_noise_degrees: noise_degrees,
        ..
    } = *facts;
    let no_beat = orders_as_smooth > ORDERS_AS_SMOOTH || ef_percent < LEAST_EF_PERCENT;
    let beyond = |sign: f64, limit: f64| -> Vec<(usize, f64)> {
        (facts.losses.iter().enumerate())
            .map(|(gate, loss)| (gate + 1, sign * loss))
            .filter(|(_, share)| *share > limit)
            .collect()
    };
    let losses = beyond(1.0, COUNT_LOSS_LEFT_OUT_SHARE);
    let gains = beyond(-1.0, COUNT_GAIN_SHARE);
    let dark = facts.dark_share;
    let outside = facts.share_outside;
    let outward: Vec<(usize, f64)> = (facts.motions.iter().copied())
        .filter(|(_, motion)| *motion < OUTWARD_MOTION_MM)
        .collect();
    [
        no_beat.then_some(BeatFlag::NoContraction {
            orders_as_smooth,
            ef_percent,
        }),
        (!losses.is_empty()).then_some(BeatFlag::CountLoss { losses }),
        (!gains.is_empty()).then_some(BeatFlag::CountGain { gains }),
        (dark > DARK_SHARE).then_some(BeatFlag::DarkWall { share: dark }),
        (esv_ml < SMALL_ESV_ML).then_some(BeatFlag::SmallHeart { esv_ml }),
        (moving_share < MOVING_SHARE || noise_degrees > PHASE_NOISE_DEGREES).then_some(
            BeatFlag::PhaseUnreliable {
                moving_share,
                noise_degrees,
            },
        ),
        (outside > OUTSIDE_SHARE).then_some(BeatFlag::LeavesField { share: outside }),
        facts.beside.map(BeatFlag::ActivityBesideWall),
        (!outward.is_empty()).then_some(BeatFlag::OutwardMotion { segments: outward }),
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn phase_text(moving_share: f64, noise_degrees: f64) -> String {
    let still = (moving_share < MOVING_SHARE).then(|| {
        format!(
            "{:.0} % of the wall moves too little to have a phase; mean, deviation and bandwidth are those of the rest",
            100.0 * (1.0 - moving_share)
        )
    });
    let noisy = (noise_degrees > PHASE_NOISE_DEGREES).then(|| {
        format!(
            "the noise of the gates alone scatters the phases by {noise_degrees:.0} degrees: the wall moves too little \
             for so few counts"
        )
    });
    let texts: Vec<String> = still.into_iter().chain(noisy).collect();
    texts.join("; ")
}

fn losses_text(losses: &[(usize, f64)]) -> String {
    let text = |(gate, loss): &(usize, f64)| format!("gate {gate} {:.0} %", 100.0 * loss);
    losses.iter().map(text).collect::<Vec<_>>().join(", ")
}

fn motions_text(segments: &[(usize, f64)]) -> String {
    let text = |(segment, motion): &(usize, f64)| format!("segment {segment} {:.1} mm", -motion);
    segments.iter().map(text).collect::<Vec<_>>().join(", ")
}
