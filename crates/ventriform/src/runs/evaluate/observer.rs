//! The progress of an evaluation, for its caller.

/// The steps of an evaluation, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EvaluationStep {
    /// Making the models of the templates.
    Models,
    /// Fitting them to the patients.
    Fits,
    /// Drawing slices of the fits.
    Pictures,
}

impl EvaluationStep {
    /// A word for a progress bar.
    pub fn as_str(self) -> &'static str {
        match self {
            EvaluationStep::Models => "models",
            EvaluationStep::Fits => "fit",
            EvaluationStep::Pictures => "pictures",
        }
    }
}

/// Receives the progress of an evaluation, from any of its threads.
pub trait EvaluationObserver: Sync {
    /// `fraction` of `step` is done, 0..=1.
    fn progress(&self, step: EvaluationStep, fraction: f64);
}
