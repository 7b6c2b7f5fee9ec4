//! Volumes that are left out of the gates they lie among.

/// Volumes of a file of gates that are left out, counted from 0.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct LeftOut {
    /// Volumes that are no gates: sums, means and repeated ends.
    pub extra: Vec<usize>,
    /// Gates that tell nothing, whose place in the beat remains: too many counts, repeats.
    pub lost: Vec<usize>,
}

impl LeftOut {
    /// Whether volume number `frame` is left out.
    pub(super) fn has(&self, frame: usize) -> bool {
        self.extra.contains(&frame) || self.lost.contains(&frame)
    }

    /// Number of volumes.
    pub(super) fn count(&self) -> usize {
        self.extra.len() + self.lost.len()
    }
}
