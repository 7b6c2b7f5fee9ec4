//! A progress bar on a terminal, silence elsewhere.

use crate::progress::{Observer, Stage};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::time::Instant;

/// Shares of the whole that the stages take, as seen on a 128³ volume and 150 points.
const SHARES: [(Stage, f64); 6] = [
    (Stage::Read, 0.1),
    (Stage::Surface, 0.2),
    (Stage::Retile, 0.4),
    (Stage::Optimise, 0.2),
    (Stage::Report, 0.08),
    (Stage::Export, 0.02),
];

const STEPS: u64 = 1000;

/// Shows stages and fractions on standard error, and keeps the time.
pub struct Bar {
    bar: ProgressBar,
    start: Instant,
}

impl Bar {
    /// A bar that hides itself where standard error is no terminal.
    pub fn start() -> Self {
        let target = if std::io::stderr().is_terminal() {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        let bar = ProgressBar::with_draw_target(Some(STEPS), target);
        let style = ProgressStyle::with_template("{msg:<9} [{bar:40}] {percent:>3} %");
        if let Ok(style) = style {
            bar.set_style(style.progress_chars("=> "));
        }
        Self {
            bar,
            start: Instant::now(),
        }
    }

    /// Shows `fraction` (0..=1) of the whole under the name `stage`.
    pub fn show(&self, stage: &str, fraction: f64) {
        self.bar.set_message(stage.to_owned());
        self.bar
            .set_position((fraction.clamp(0.0, 1.0) * STEPS as f64) as u64);
    }

    /// Takes the bar off the screen.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// How much of the whole is done when `fraction` of `stage` is.
pub fn overall(stage: Stage, fraction: f64) -> f64 {
    let before: f64 = SHARES
        .iter()
        .take_while(|(s, _)| *s != stage)
        .map(|(_, share)| share)
        .sum();
    let own = SHARES
        .iter()
        .find(|(s, _)| *s == stage)
        .map_or(0.0, |(_, share)| *share);
    before + own * fraction
}

impl Observer for Bar {
    fn progress(&self, stage: Stage, fraction: f64) {
        self.show(stage.as_str(), overall(stage, fraction));
    }

    fn now_ms(&self) -> f64 {
        self.start.elapsed().as_secs_f64() * 1e3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_whole_grows_from_nothing_to_everything() {
        let mut last = 0.0;
        for stage in Stage::ALL {
            for fraction in [0.0, 0.5, 1.0] {
                let now = overall(stage, fraction);
                assert!(now >= last - 1e-12);
                last = now;
            }
        }
        assert!((last - 1.0).abs() < 1e-12);
    }
}
