//! A progress bar, shown only on a terminal.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::time::Instant;
use ventriform::base::progress::{Observer, Plan, Stage, TotalProgress};

const BAR_STEPS: u64 = 1000;

/// Shows the stage and the progress on standard error, and measures the time.
pub struct Bar {
    bar: ProgressBar,
    gauge: TotalProgress,
    start: Instant,
}

impl Bar {
    /// A bar for the stages of making a model.
    pub fn start() -> Self {
        Self::over(Plan::GENERATION)
    }

    /// A bar for the stages of `plan`. It is hidden if standard error is not a terminal.
    pub fn over(plan: Plan) -> Self {
        let target = if std::io::stderr().is_terminal() {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        let bar = ProgressBar::with_draw_target(Some(BAR_STEPS), target);
        let style = ProgressStyle::with_template("{msg:<9} [{bar:40}] {percent:>3} %");
        if let Ok(style) = style {
            bar.set_style(style.progress_chars("=> "));
        }
        Self {
            bar,
            gauge: TotalProgress::new(plan),
            start: Instant::now(),
        }
    }

    /// Shows the name of a stage, and `fraction` (0 to 1) of the whole as done.
    pub fn show(&self, stage: &str, fraction: f64) {
        self.bar.set_message(stage.to_owned());
        self.bar
            .set_position((fraction.clamp(0.0, 1.0) * BAR_STEPS as f64) as u64);
    }

    /// Removes the bar from the screen.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Observer for Bar {
    fn progress(&self, stage: Stage, fraction: f64) {
        self.show(stage.as_str(), self.gauge.advance(stage, fraction));
    }

    fn now_ms(&self) -> f64 {
        self.start.elapsed().as_secs_f64() * 1e3
    }
}
