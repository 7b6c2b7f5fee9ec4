//! Whether a figure was taken on cases that had a part in what is judged.

/// The relation of a case to what is judged on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sample {
    /// It had a part in making or choosing it: the figure is optimistic.
    InSample,
    /// It had none.
    HeldOut,
}

impl Sample {
    /// That of a figure over cases of this sample and of `other`.
    pub fn and(self, other: Self) -> Self {
        match (self, other) {
            (Sample::HeldOut, Sample::HeldOut) => Sample::HeldOut,
            _ => Sample::InSample,
        }
    }

    /// The word in tables, files and pages.
    pub fn as_str(self) -> &'static str {
        match self {
            Sample::InSample => "in-sample",
            Sample::HeldOut => "held-out",
        }
    }
}
