//! Lists in pieces: newest first, each piece telling where the next begins.

/// Which piece is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PageRequest {
    /// Only rows with a smaller sequence number.
    pub before: Option<i64>,
    /// At most so many.
    pub limit: u32,
}

/// A piece of a list.
#[derive(Debug, Clone)]
pub struct Page<T> {
    /// The rows, newest first.
    pub items: Vec<T>,
    /// [`PageRequest::before`] of the next piece, where there is one.
    pub next: Option<i64>,
}

impl<T> Page<T> {
    /// Cuts a list that was asked for with one row more than `limit`.
    pub fn cut(mut items: Vec<T>, limit: u32, sequence: impl Fn(&T) -> i64) -> Self {
        let limit = limit as usize;
        let more = items.len() > limit;
        items.truncate(limit);
        let next = items.last().filter(|_| more).map(sequence);
        Self { items, next }
    }
}
