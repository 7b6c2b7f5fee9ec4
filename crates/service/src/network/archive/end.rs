//! The outcomes of attempts to fetch and to deliver.

use std::sync::atomic::{AtomicU64, Ordering};

/// The outcome of an attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExchangeEnd {
    /// The series or object was transferred.
    Done,
    /// It was there already.
    Present,
    /// It failed and will be tried again.
    Failed,
    /// It failed for good.
    GivenUp,
}

impl ExchangeEnd {
    /// The names of all ends.
    pub const END_NAMES: [&'static str; 4] = ["done", "present", "failed", "given-up"];

    /// Its name in metrics.
    pub fn as_str(self) -> &'static str {
        Self::END_NAMES[self.index()]
    }

    fn index(self) -> usize {
        match self {
            ExchangeEnd::Done => 0,
            ExchangeEnd::Present => 1,
            ExchangeEnd::Failed => 2,
            ExchangeEnd::GivenUp => 3,
        }
    }
}

/// Counts of attempts since the start, by how they ended.
#[derive(Debug, Default)]
pub struct ExchangeCounts([AtomicU64; ExchangeEnd::END_NAMES.len()]);

impl ExchangeCounts {
    /// The attempts by how they ended.
    pub fn all(&self) -> impl Iterator<Item = (&'static str, u64)> {
        let counts = self.0.iter().map(|count| count.load(Ordering::Relaxed));
        ExchangeEnd::END_NAMES.into_iter().zip(counts)
    }

    pub(super) fn add(&self, end: ExchangeEnd) {
        self.0[end.index()].fetch_add(1, Ordering::Relaxed);
    }
}
