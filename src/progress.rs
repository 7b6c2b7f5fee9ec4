//! How long work tells where it is, and how it is told to stop.
//!
//! Every stage takes a [`Monitor`], reports fractions of itself through it and thereby looks
//! at the cancel token. The domain knows no clock and no terminal: an [`Observer`] given by
//! the caller does (a progress bar, a job row, a test).

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The stages of all work, in order; which of them a piece of work has is in its [`Plan`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stage {
    /// Decoding the files into voxels.
    Read,
    /// Region, iso-value, Marching Cubes.
    Surface,
    /// Points and their tessellation.
    Retile,
    /// Least-squares fit and edge flips.
    Optimise,
    /// Finding the organ in the volume.
    Localise,
    /// Placing the model as a whole.
    Align,
    /// Letting the model move until it rests.
    Deform,
    /// Sampling the wall for the polar map.
    Polar,
    /// Measuring the result.
    Report,
    /// Writing the formats.
    Export,
}

impl Stage {
    /// Every stage.
    pub const ALL: [Stage; 10] = [
        Stage::Read,
        Stage::Surface,
        Stage::Retile,
        Stage::Optimise,
        Stage::Localise,
        Stage::Align,
        Stage::Deform,
        Stage::Polar,
        Stage::Report,
        Stage::Export,
    ];

    /// The stage's name in reports, job states and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Stage::Read => "read",
            Stage::Surface => "surface",
            Stage::Retile => "retile",
            Stage::Optimise => "optimise",
            Stage::Localise => "localise",
            Stage::Align => "align",
            Stage::Deform => "deform",
            Stage::Polar => "polar",
            Stage::Report => "report",
            Stage::Export => "export",
        }
    }
}

/// The stages of one kind of work with the share of the time that each takes, roughly, on a
/// 128³ volume and 150 points: for one bar over all of them. Shares add up to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan(pub &'static [(Stage, f64)]);

impl Plan {
    /// From a volume to a model.
    pub const GENERATION: Plan = Plan(&[
        (Stage::Read, 0.08),
        (Stage::Surface, 0.2),
        (Stage::Retile, 0.37),
        (Stage::Optimise, 0.23),
        (Stage::Report, 0.09),
        (Stage::Export, 0.03),
    ]);

    /// From a volume and models to a segmentation.
    pub const SEGMENTATION: Plan = Plan(&[
        (Stage::Read, 0.1),
        (Stage::Localise, 0.35),
        (Stage::Align, 0.1),
        (Stage::Deform, 0.3),
        (Stage::Polar, 0.05),
        (Stage::Report, 0.05),
        (Stage::Export, 0.05),
    ]);
}

/// How much of a [`Plan`] is done. Never falls, though stages may come again: several models
/// are fitted one after the other, each in all stages.
#[derive(Debug)]
pub struct Gauge {
    plan: Plan,
    done: Mutex<Vec<f64>>,
}

impl Gauge {
    /// Nothing is done yet.
    pub fn new(plan: Plan) -> Self {
        Self {
            done: Mutex::new(vec![0.0; plan.0.len()]),
            plan,
        }
    }

    /// `fraction` of `stage` is done, and so much of every stage before it. Returns how much
    /// of the whole is, 0..=1.
    pub fn advance(&self, stage: Stage, fraction: f64) -> f64 {
        // The list is whole after any panic: numbers are written one by one.
        let mut done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(at) = self.plan.0.iter().position(|(s, _)| *s == stage) {
            for part in &mut done[..=at] {
                *part = part.max(fraction.clamp(0.0, 1.0));
            }
        }
        let shares = self.plan.0.iter().map(|(_, share)| share);
        shares
            .zip(done.iter())
            .map(|(share, part)| share * part)
            .sum()
    }
}

/// The caller asked for an end; nothing was produced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// A flag that any thread may raise to end the work that holds a clone of it.
#[derive(Debug, Clone, Default)]
pub struct CancelToken(Arc<AtomicBool>);

impl CancelToken {
    /// A token that nobody has raised yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Asks the work to end. Cannot be taken back.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the end was asked for.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Hears of progress. Called from whichever thread works, at most some hundred times a stage.
pub trait Observer: Sync {
    /// `fraction` of `stage` is done, 0..=1.
    fn progress(&self, stage: Stage, fraction: f64);

    /// Milliseconds since any fixed moment; the report's timings come from here. The
    /// default has no clock, and all timings are zero.
    fn now_ms(&self) -> f64 {
        0.0
    }
}

/// An observer that hears nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {
    fn progress(&self, _: Stage, _: f64) {}
}

/// What a stage is handed: someone to tell, and a token to look at.
#[derive(Clone)]
pub struct Monitor<'a> {
    observer: &'a dyn Observer,
    cancel: CancelToken,
    /// Share of every stage that was done before this monitor's work, and the share that is
    /// this monitor's.
    span: (f64, f64),
}

impl<'a> Monitor<'a> {
    /// A monitor that tells `observer` and obeys `cancel`.
    pub fn new(observer: &'a dyn Observer, cancel: CancelToken) -> Self {
        Self {
            observer,
            cancel,
            span: (0.0, 1.0),
        }
    }

    /// A monitor that tells nobody and is never cancelled.
    pub fn silent() -> Monitor<'static> {
        Monitor {
            observer: &Silent,
            cancel: CancelToken::new(),
            span: (0.0, 1.0),
        }
    }

    /// A monitor that tells nobody and obeys the same token: for work that is no stage of
    /// the whole's.
    #[must_use]
    pub fn untold(&self) -> Monitor<'static> {
        Monitor {
            cancel: self.cancel.clone(),
            ..Monitor::silent()
        }
    }

    /// The monitor for piece `index` of `count` alike: its stages are that part of the whole's.
    #[must_use]
    pub fn piece(&self, index: usize, count: usize) -> Self {
        let own = self.span.1 / count.max(1) as f64;
        Self {
            observer: self.observer,
            cancel: self.cancel.clone(),
            span: (self.span.0 + own * index as f64, own),
        }
    }

    /// Says that `fraction` (0..=1) of `stage` is done.
    ///
    /// # Errors
    /// [`Cancelled`] where the token was raised: return at once.
    pub fn report(&self, stage: Stage, fraction: f64) -> Result<(), Cancelled> {
        self.check()?;
        let (before, own) = self.span;
        self.observer
            .progress(stage, before + own * fraction.clamp(0.0, 1.0));
        Ok(())
    }

    /// Looks at the token alone; cheap enough for inner loops. A stage looks at least every
    /// 50 ms.
    ///
    /// # Errors
    /// [`Cancelled`] where the token was raised.
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.cancel.is_cancelled() {
            Err(Cancelled)
        } else {
            Ok(())
        }
    }

    /// The observer's clock, milliseconds.
    pub fn now_ms(&self) -> f64 {
        self.observer.now_ms()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_whole_grows_from_nothing_to_everything() {
        for plan in [Plan::GENERATION, Plan::SEGMENTATION] {
            let gauge = Gauge::new(plan);
            let mut last = 0.0;
            for (stage, _) in plan.0 {
                for fraction in [0.0, 0.5, 1.0] {
                    let now = gauge.advance(*stage, fraction);
                    assert!(now >= last - 1e-12);
                    last = now;
                }
            }
            assert!((last - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn pieces_go_through_the_stages_again_and_the_whole_never_falls() {
        struct Kept(Gauge, Mutex<Vec<f64>>);
        impl Observer for Kept {
            fn progress(&self, stage: Stage, fraction: f64) {
                let whole = self.0.advance(stage, fraction);
                self.1.lock().unwrap().push(whole);
            }
        }
        let kept = Kept(Gauge::new(Plan::SEGMENTATION), Mutex::default());
        let monitor = Monitor::new(&kept, CancelToken::new());
        for piece in 0..3 {
            let monitor = monitor.piece(piece, 3);
            for stage in [Stage::Localise, Stage::Align, Stage::Deform] {
                monitor.report(stage, 1.0).unwrap();
            }
        }
        let seen = kept.1.into_inner().unwrap();
        assert!(seen.windows(2).all(|w| w[0] <= w[1]), "{seen:?}");
        assert!((seen[8] - 0.85).abs() < 1e-12, "{seen:?}");
    }
}
