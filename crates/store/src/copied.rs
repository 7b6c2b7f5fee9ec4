//! The outcome of copying an item.

/// The outcome of an item, or of a received object.
pub(super) enum Copied {
    /// It was copied.
    Now,
    /// The target had it.
    Before,
    /// It is missing or damaged: how.
    Not(String),
}
