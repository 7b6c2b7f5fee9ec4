//! How long work tells where it is, and how it is told to stop.
//!
//! Every stage takes a [`Monitor`], reports fractions of itself through it and thereby looks
//! at the cancel token. The domain knows no clock and no terminal: an [`Observer`] given by
//! the caller does (a progress bar, a job row, a test).

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The stages of a model's making, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stage {
    /// Decoding the file into voxels.
    Read,
    /// Region, iso-value, Marching Cubes.
    Surface,
    /// Points and their tessellation.
    Retile,
    /// Least-squares fit and edge flips.
    Optimise,
    /// Measuring the result.
    Report,
    /// Writing the formats.
    Export,
}

impl Stage {
    /// Every stage in the order in which a volume meets them.
    pub const ALL: [Stage; 6] = [
        Stage::Read,
        Stage::Surface,
        Stage::Retile,
        Stage::Optimise,
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
            Stage::Report => "report",
            Stage::Export => "export",
        }
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
}

impl<'a> Monitor<'a> {
    /// A monitor that tells `observer` and obeys `cancel`.
    pub fn new(observer: &'a dyn Observer, cancel: CancelToken) -> Self {
        Self { observer, cancel }
    }

    /// A monitor that tells nobody and is never cancelled.
    pub fn silent() -> Monitor<'static> {
        Monitor {
            observer: &Silent,
            cancel: CancelToken::new(),
        }
    }

    /// Says that `fraction` (0..=1) of `stage` is done.
    ///
    /// # Errors
    /// [`Cancelled`] where the token was raised: return at once.
    pub fn report(&self, stage: Stage, fraction: f64) -> Result<(), Cancelled> {
        self.check()?;
        self.observer.progress(stage, fraction.clamp(0.0, 1.0));
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
