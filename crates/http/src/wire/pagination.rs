//! `limit` and `cursor` of lists.

use crate::wire::memory::charge_page;
use crate::wire::problem::Answer;
use crate::wire::query::parsed;
use serde::{Deserialize, Deserializer};
use utoipa::IntoParams;
use ventriform_service::base::records::{ListPage, ListRequest};

/// Entries of a page unless `limit` says otherwise.
const DEFAULT_PAGE_ITEMS: u32 = 20;
/// Greatest `limit`.
const MAX_PAGE_ITEMS: u32 = 100;

/// The page of a list that is asked for.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct PageQuery {
    /// Greatest number of entries of the page
    #[serde(default, deserialize_with = "limit")]
    #[param(value_type = Option<usize>, minimum = 1, maximum = 100, default = 20)]
    limit: Option<u32>,
    /// `next_cursor` of the previous page
    #[serde(default, deserialize_with = "cursor")]
    #[param(value_type = Option<String>, pattern = "^[1-9][0-9]{0,17}$")]
    cursor: Option<i64>,
}

impl PageQuery {
    /// The page as the stores take it, for which the request is charged.
    ///
    /// # Errors
    /// 503 if there is no memory for it.
    pub async fn charged(self) -> Answer<ListRequest> {
        let limit = self.limit.unwrap_or(DEFAULT_PAGE_ITEMS);
        charge_page(limit).await?;
        Ok(ListRequest {
            before: self.cursor,
            limit,
        })
    }
}

fn limit<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<u32>, D::Error> {
    let allowed = |text: &str| (text.parse().ok()).filter(|n| (1..=MAX_PAGE_ITEMS).contains(n));
    let expected = format!("a whole number from 1 to {MAX_PAGE_ITEMS}");
    parsed(deserializer, allowed, &expected).map(Some)
}

fn cursor<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<i64>, D::Error> {
    let allowed = |text: &str| (text.parse().ok()).filter(|sequence| *sequence > 0);
    let expected = "`next_cursor` of the previous page, unchanged";
    parsed(deserializer, allowed, expected).map(Some)
}

/// The cursor of the next page; `None` on the last.
pub fn next_cursor<T>(page: &ListPage<T>) -> Option<String> {
    page.next.map(|sequence| sequence.to_string())
}
