//! Lists in pages, newest first; each page says where the next one begins.

/// Which page of a list to return.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ListRequest {
    /// Only rows with a smaller sequence number; `None` for the first page.
    pub before: Option<i64>,
    /// Largest number of rows.
    pub limit: u32,
}

/// One page of a list.
#[derive(Debug, Clone)]
pub struct ListPage<T> {
    /// The rows, newest first.
    pub items: Vec<T>,
    /// [`ListRequest::before`] for the next page; `None` on the last page.
    pub next: Option<i64>,
}

impl<T> ListPage<T> {
    /// Makes a page of rows that were queried with a limit of `limit + 1`: the extra row only
    /// tells that there is a next page.
    pub fn cut(mut items: Vec<T>, limit: u32, sequence: impl Fn(&T) -> i64) -> Self {
        let limit = limit as usize;
        let more = items.len() > limit;
        items.truncate(limit);
        let next = items.last().filter(|_| more).map(sequence);
        Self { items, next }
    }
}
