//! `limit` and `cursor` of lists.

use super::memory::charge;
use super::problem::{Answer, Problem};
use super::request::{query_pairs, refuse_unknown};
use ventriform_service::records::{ListPage, ListRequest};

/// Entries of a page unless `limit` says otherwise.
const DEFAULT_PAGE_ITEMS: u32 = 20;
/// Greatest `limit`.
const MAX_PAGE_ITEMS: u32 = 100;

/// Memory for one entry of a page: its row, what is made of it, and its JSON. Labels of 16 KiB are the largest part.
const ENTRY_MEMORY: u64 = 64 << 10;

/// The page that a query asks for, for which the request is charged, and the values of the list's `own`
/// parameters.
pub async fn list_query<const N: usize>(
    query: Option<&str>,
    own: [&'static str; N],
) -> Answer<(ListRequest, [Option<String>; N])> {
    page_of(query_pairs(query), own).await
}

/// As [`list_query`], of the pairs of the query.
pub async fn page_of<const N: usize>(
    pairs: Vec<(String, String)>,
    own: [&'static str; N],
) -> Answer<(ListRequest, [Option<String>; N])> {
    let known: Vec<&str> = ["limit", "cursor"].into_iter().chain(own).collect();
    refuse_unknown(&pairs, &known)?;
    let value = |name: &str| {
        pairs
            .iter()
            .find(|(n, _)| n == name)
            .map(|(_, value)| value.clone())
    };
    let page = ListRequest {
        before: value("cursor").map(|c| parse_cursor(&c)).transpose()?,
        limit: value("limit").map_or(Ok(DEFAULT_PAGE_ITEMS), |l| parse_limit(&l))?,
    };
    charge(ENTRY_MEMORY * u64::from(page.limit)).await?;
    Ok((page, own.map(value)))
}

fn parse_limit(text: &str) -> Answer<u32> {
    match text.parse() {
        Ok(limit @ 1..=MAX_PAGE_ITEMS) => Ok(limit),
        _ => Err(Problem::bad_request(
            "invalid-parameter",
            format!("`limit` must be a whole number from 1 to {MAX_PAGE_ITEMS}."),
        )
        .at("limit")
        .fix(format!(
            "Give a whole number from 1 to {MAX_PAGE_ITEMS}, or leave `limit` out for {DEFAULT_PAGE_ITEMS}."
        ))),
    }
}

fn parse_cursor(text: &str) -> Answer<i64> {
    text.parse()
        .ok()
        .filter(|sequence| *sequence > 0)
        .ok_or_else(|| {
            Problem::bad_request(
                "invalid-parameter",
                "`cursor` is not a cursor of this service.",
            )
            .at("cursor")
            .fix("Use `next_cursor` of the previous page unchanged.")
        })
}

/// The cursor of the next page; `None` on the last.
pub fn next_cursor<T>(page: &ListPage<T>) -> Option<String> {
    page.next.map(|sequence| sequence.to_string())
}
