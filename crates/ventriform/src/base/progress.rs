//! Progress reports and cancellation.
//!
//! Every stage takes a [`Monitor`]. It reports its completed fraction through it, which also
//! checks the cancel token: a report returns [`Cancelled`] once the token was raised. The library
//! itself uses no clock and no terminal; the caller provides an [`Observer`] (a progress bar, a
//! row of the jobs table, a test).
//!
//! Guaranteed: progress of a whole job never decreases ([`TotalProgress`]). A stage checks the token at
//! least every 50 ms; a step over a whole surface at once takes longer where that has over half a million
//! triangles (.1 s a million).

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Every stage that work can have, in order. A [`Plan`] lists the stages of one kind of work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stage {
    /// Decoding files into voxels.
    Read,
    /// Region, iso-value, Marching Cubes.
    Surface,
    /// Placing points on the surface and joining them to triangles.
    Retile,
    /// Least-squares fit and edge flips.
    Optimise,
    /// Searching for the organ in the volume.
    Localise,
    /// Placing the model as a rigid body.
    Align,
    /// Deforming the model until it comes to rest.
    Deform,
    /// Fitting one wall to all gates of a beat.
    Beat,
    /// Sampling the wall for the polar map.
    Polar,
    /// Measuring the result.
    Report,
    /// Encoding the files.
    Export,
}

impl Stage {
    /// Every stage, in order.
    pub const ALL: [Stage; 11] = [
        Stage::Read,
        Stage::Surface,
        Stage::Retile,
        Stage::Optimise,
        Stage::Localise,
        Stage::Align,
        Stage::Deform,
        Stage::Beat,
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
            Stage::Beat => "beat",
            Stage::Polar => "polar",
            Stage::Report => "report",
            Stage::Export => "export",
        }
    }
}

/// The stages of one kind of work, each with its approximate share of the total time for a 128³
/// volume and 150 points. The shares add up to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan(pub &'static [(Stage, f64)]);

impl Plan {
    /// Making a model from a volume.
    pub const GENERATION: Plan = Plan(&[
        (Stage::Read, 0.08),
        (Stage::Surface, 0.2),
        (Stage::Retile, 0.37),
        (Stage::Optimise, 0.23),
        (Stage::Report, 0.09),
        (Stage::Export, 0.03),
    ]);

    /// Segmenting a volume by fitting models.
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

impl Plan {
    /// A reading: what is stated, written beside the report.
    pub const READING: Plan = Plan(&[(Stage::Report, 1.0)]);

    /// A serial comparison: every scan by itself, and again from the common heart.
    pub const SERIAL: Plan = Plan(&[
        (Stage::Read, 0.05),
        (Stage::Localise, 0.3),
        (Stage::Align, 0.1),
        (Stage::Deform, 0.2),
        (Stage::Beat, 0.2),
        (Stage::Polar, 0.05),
        (Stage::Report, 0.05),
        (Stage::Export, 0.05),
    ]);

    /// A beat: the gates' sum segmented and measured, and one wall fitted to all gates.
    pub const BEAT: Plan = Plan(&[
        (Stage::Read, 0.05),
        (Stage::Localise, 0.08),
        (Stage::Align, 0.02),
        (Stage::Deform, 0.08),
        (Stage::Polar, 0.03),
        (Stage::Report, 0.04),
        (Stage::Beat, 0.67),
        (Stage::Export, 0.03),
    ]);
}

impl Plan {
    /// A comparison of two scans: each segmented, or a beat made of it.
    pub const COMPARISON: Plan = Plan(&[
        (Stage::Read, 0.08),
        (Stage::Localise, 0.2),
        (Stage::Align, 0.05),
        (Stage::Deform, 0.2),
        (Stage::Polar, 0.05),
        (Stage::Report, 0.05),
        (Stage::Beat, 0.33),
        (Stage::Export, 0.04),
    ]);
}

impl Plan {
    /// Normal limits: every scan of a cohort fitted, and the limits of what they show.
    pub const NORMALS: Plan = Plan(&[
        (Stage::Deform, 0.97),
        (Stage::Report, 0.02),
        (Stage::Export, 0.01),
    ]);
}

/// The completed fraction of a [`Plan`]. It never decreases, although stages may be repeated: when
/// several models are fitted one after the other, each goes through the same stages.
#[derive(Debug)]
pub struct TotalProgress {
    plan: Plan,
    done: Mutex<Vec<f64>>,
}

impl TotalProgress {
    /// The progress of work that has not begun.
    pub fn new(plan: Plan) -> Self {
        Self {
            done: Mutex::new(vec![0.0; plan.0.len()]),
            plan,
        }
    }

    /// Records that at least `fraction` of `stage` and of every stage before it is completed.
    /// Returns the completed fraction of the whole, 0..=1.
    pub fn advance(&self, stage: Stage, fraction: f64) -> f64 {
        // A panic cannot leave the list half changed: its numbers are written one at a time.
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

/// The work was cancelled and produced nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// A flag that any thread can raise to cancel the work that holds a clone of it.
#[derive(Debug, Clone, Default)]
pub struct CancelToken(Arc<AtomicBool>);

impl CancelToken {
    /// A token that is not raised.
    pub fn new() -> Self {
        Self::default()
    }

    /// Raises the flag. This cannot be undone.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the flag was raised.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Receives progress reports, from any of the computing threads, at most a few hundred per stage.
pub trait Observer: Sync {
    /// `fraction` (0..=1) of `stage` is completed.
    fn progress(&self, stage: Stage, fraction: f64);

    /// Milliseconds since an arbitrary fixed moment, used for the timings in reports. By default
    /// there is no clock, and all timings are zero.
    fn now_ms(&self) -> f64 {
        0.0
    }
}

/// An observer that ignores all reports.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {
    fn progress(&self, _: Stage, _: f64) {}
}

/// The observer and the cancel token of a stage.
#[derive(Clone)]
pub struct Monitor<'a> {
    observer: &'a dyn Observer,
    cancel: CancelToken,
    /// The fraction of every stage that was completed before this monitor's work, and the fraction
    /// that is this monitor's work.
    span: (f64, f64),
}

impl<'a> Monitor<'a> {
    /// A monitor with this observer and cancel token.
    pub fn new(observer: &'a dyn Observer, cancel: CancelToken) -> Self {
        Self {
            observer,
            cancel,
            span: (0.0, 1.0),
        }
    }

    /// A monitor without an observer that is never cancelled.
    pub fn silent() -> Monitor<'static> {
        Monitor {
            observer: &Silent,
            cancel: CancelToken::new(),
            span: (0.0, 1.0),
        }
    }

    /// A monitor without an observer, with the same cancel token: for work that is not a stage of
    /// the whole.
    #[must_use]
    pub fn without_observer(&self) -> Monitor<'static> {
        Monitor {
            cancel: self.cancel.clone(),
            ..Monitor::silent()
        }
    }

    /// The monitor for part `index` of `count` equal parts: reports of its stages are scaled to
    /// that part of each stage of the whole.
    #[must_use]
    pub fn part(&self, index: usize, count: usize) -> Self {
        let own = self.span.1 / count.max(1) as f64;
        Self {
            observer: self.observer,
            cancel: self.cancel.clone(),
            span: (self.span.0 + own * index as f64, own),
        }
    }

    /// Reports that `fraction` (0..=1) of `stage` is completed.
    ///
    /// # Errors
    /// [`Cancelled`] if the token was raised; the stage must return at once.
    pub fn report(&self, stage: Stage, fraction: f64) -> Result<(), Cancelled> {
        self.check()?;
        let (before, own) = self.span;
        self.observer
            .progress(stage, before + own * fraction.clamp(0.0, 1.0));
        Ok(())
    }

    /// Checks the token without a report; cheap enough for inner loops. A stage checks at least
    /// every 50 ms.
    ///
    /// # Errors
    /// [`Cancelled`] if the token was raised.
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.cancel.is_cancelled() {
            Err(Cancelled)
        } else {
            Ok(())
        }
    }

    /// Whether the work goes on: the token was not raised.
    pub fn goes_on(&self) -> impl Fn() -> bool {
        || self.check().is_ok()
    }

    /// The time of the observer's clock in milliseconds.
    pub fn now_ms(&self) -> f64 {
        self.observer.now_ms()
    }
}

/// The progress of equal parts of a whole that are worked on at the same time: of each stage the whole has completed
/// the mean of what its parts have.
pub struct ConcurrentParts<'a> {
    whole: &'a Monitor<'a>,
    /// The completed fraction of every stage of [`Stage::ALL`], for each part.
    done: Mutex<Vec<[f64; Stage::ALL.len()]>>,
}

/// The observer of one of [`ConcurrentParts`].
pub struct ConcurrentPart<'a> {
    parts: &'a ConcurrentParts<'a>,
    index: usize,
}

impl<'a> ConcurrentParts<'a> {
    /// `count` parts of the work of `whole`, of which nothing is completed.
    pub fn new(whole: &'a Monitor<'a>, count: usize) -> Self {
        Self {
            whole,
            done: Mutex::new(vec![[0.0; Stage::ALL.len()]; count]),
        }
    }

    /// The observer of part `index`; a monitor of it needs [`ConcurrentPart::monitor`].
    pub fn part(&'a self, index: usize) -> ConcurrentPart<'a> {
        ConcurrentPart { parts: self, index }
    }
}

impl ConcurrentPart<'_> {
    /// A monitor of the part that is cancelled with the whole.
    pub fn monitor(&self) -> Monitor<'_> {
        Monitor::new(self, self.parts.whole.cancel.clone())
    }
}

impl Observer for ConcurrentPart<'_> {
    fn progress(&self, stage: Stage, fraction: f64) {
        // A panic cannot leave the list half changed: its numbers are written one at a time.
        let mut done = self
            .parts
            .done
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let parts = done.len() as f64;
        let mut sum = 0.0;
        for (index, part) in done.iter_mut().enumerate() {
            let part = &mut part[stage as usize];
            if index == self.index {
                *part = part.max(fraction);
            }
            sum += *part;
        }
        let whole = self.parts.whole;
        let (before, own) = whole.span;
        // Reported under the lock, so that the fraction of a stage never decreases.
        whole.observer.progress(stage, before + own * sum / parts);
    }

    fn now_ms(&self) -> f64 {
        self.parts.whole.now_ms()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two parts side by side: the whole has completed the mean of them, whoever reports first.
    #[test]
    fn concurrent_parts_add_up_to_the_whole() {
        struct Kept(Mutex<Vec<(Stage, f64)>>);
        impl Observer for Kept {
            fn progress(&self, stage: Stage, fraction: f64) {
                self.0.lock().unwrap().push((stage, fraction));
            }
            fn now_ms(&self) -> f64 {
                7.0
            }
        }
        let (kept, token) = (Kept(Mutex::default()), CancelToken::new());
        let whole = Monitor::new(&kept, token.clone()).part(1, 2);
        let parts = ConcurrentParts::new(&whole, 2);
        let (first, second) = (parts.part(0), parts.part(1));
        second.monitor().report(Stage::Align, 1.0).unwrap();
        first.monitor().report(Stage::Align, 0.5).unwrap();
        // A stage that is repeated takes nothing back.
        second.monitor().report(Stage::Align, 0.0).unwrap();
        first.monitor().report(Stage::Deform, 1.0).unwrap();
        first.monitor().report(Stage::Align, 1.0).unwrap();
        assert!(second.monitor().now_ms() == 7.0);
        let expected = [
            (Stage::Align, 0.75),
            (Stage::Align, 0.875),
            (Stage::Align, 0.875),
            (Stage::Deform, 0.75),
            (Stage::Align, 1.0),
        ];
        assert_eq!(*kept.0.lock().unwrap(), expected);
        token.cancel();
        assert_eq!(first.monitor().report(Stage::Deform, 1.0), Err(Cancelled));
    }

    #[test]
    fn the_completed_fraction_grows_from_zero_to_one() {
        for plan in [
            Plan::GENERATION,
            Plan::SEGMENTATION,
            Plan::BEAT,
            Plan::COMPARISON,
            Plan::NORMALS,
        ] {
            let total = TotalProgress::new(plan);
            let mut last = 0.0;
            for (stage, _) in plan.0 {
                for fraction in [0.0, 0.5, 1.0] {
                    let now = total.advance(*stage, fraction);
                    assert!(now >= last - 1e-12);
                    last = now;
                }
            }
            assert!((last - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn repeated_stages_never_decrease_the_completed_fraction() {
        struct Kept(TotalProgress, Mutex<Vec<f64>>);
        impl Observer for Kept {
            fn progress(&self, stage: Stage, fraction: f64) {
                let whole = self.0.advance(stage, fraction);
                self.1.lock().unwrap().push(whole);
            }
        }
        let kept = Kept(TotalProgress::new(Plan::SEGMENTATION), Mutex::default());
        let monitor = Monitor::new(&kept, CancelToken::new());
        for part in 0..3 {
            let monitor = monitor.part(part, 3);
            for stage in [Stage::Localise, Stage::Align, Stage::Deform] {
                monitor.report(stage, 1.0).unwrap();
            }
        }
        let seen = kept.1.into_inner().unwrap();
        assert!(seen.windows(2).all(|w| w[0] <= w[1]), "{seen:?}");
        assert!((seen[8] - 0.85).abs() < 1e-12, "{seen:?}");
    }
}
