//! Lists in pages, newest first; each page says where the next one begins.

/// Which page of a list to return.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ListRequest {
    /// Only rows with a smaller sequence number; `None` for the first page.
    pub before: Option<i64>,
    /// Largest number of rows.
    pub limit: u32,
}

/// A page of a list, and the bytes that it takes; see [`ListRequest::planned`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PagePlan {
    /// The page, with as many rows as [`PAGE_BYTES`] allow.
    pub page: ListRequest,
    /// The stored bytes of its rows.
    pub bytes: u64,
}

/// A row that is read only if it has no more stored bytes than its reader has memory for.
#[derive(Debug, Clone, PartialEq)]
pub enum Bounded<T> {
    /// The row.
    Read(T),
    /// It has this many stored bytes.
    Larger(u64),
    /// There is no such row.
    Missing,
}

/// Stored bytes after which a page ends: ten jobs of a thousand cases, five volumes of two thousand files, or a hundred
/// rows of 20 KiB. Only a page of one row may have more.
pub const PAGE_BYTES: u64 = 2 << 20;

impl ListRequest {
    /// The plan of a page whose rows have these sequence numbers and stored bytes, that of the next page's first row
    /// included.
    pub fn planned(self, rows: impl IntoIterator<Item = (i64, u64)>) -> PagePlan {
        let (mut count, mut bytes, mut page) = (0, 0_u64, self);
        for (sequence, size) in rows {
            if count == 0 {
                // What is added from now on would come first.
                page.before = Some(sequence.saturating_add(1));
            } else if bytes.saturating_add(size) > PAGE_BYTES {
                break;
            }
            if count == self.limit {
                break;
            }
            count += 1;
            bytes = bytes.saturating_add(size);
        }
        page.limit = count.max(1);
        PagePlan { page, bytes }
    }
}

/// One page of a list.
#[derive(Debug, Clone)]
pub struct ListPage<T> {
    /// The rows, newest first.
    pub items: Vec<T>,
    /// [`ListRequest::before`] for the next page; `None` on the last page.
    pub next: Option<i64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_ends_at_its_limit_or_at_its_bytes_and_has_one_row_at_least() {
        let request = |limit| ListRequest {
            before: None,
            limit,
        };
        let plan = |limit, sizes: &[u64]| {
            let rows = sizes.iter().enumerate();
            let rows = rows.map(|(place, size)| (100 - place as i64, *size));
            let PagePlan { page, bytes } = request(limit).planned(rows);
            (page.before, page.limit, bytes)
        };
        assert_eq!(plan(2, &[5, 6, 7]), (Some(101), 2, 11));
        assert_eq!(plan(9, &[5, 6, 7]), (Some(101), 3, 18));
        assert_eq!(plan(9, &[PAGE_BYTES - 5, 5, 1]), (Some(101), 2, PAGE_BYTES));
        assert_eq!(
            plan(9, &[2 * PAGE_BYTES, 1]),
            (Some(101), 1, 2 * PAGE_BYTES)
        );
        assert_eq!(plan(9, &[]), (None, 1, 0));
    }
}
