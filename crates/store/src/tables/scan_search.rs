//! The list of scans, searched and ordered (`migrations/0003_scan_search.sql`).
//!
//! In: a filter, and the row at which the page before ended. Out: the rows of a page. One statement reads the table
//! `listed_scans` in the order of the list, from an index that begins with the tenant and ends with the sequence
//! number, and leaves it when the page is full. So a page without conditions costs its own rows, whatever its order; a
//! search for what is rare reads the rows of the tenant once. What finds few rows by an index of its own (labels,
//! study, series, accession number, a result's id, jobs) is looked up first.
//!
//! Not guaranteed: letters beyond A to Z are found in the forms of [`forms`] alone, and are ordered by their code.

use super::catalogue::{Columns, HELD_VOLUME};
use super::pages::push_tags;
use super::rows;
use super::scans::push_scan;
use crate::database::SqlStore;
use crate::query::{QueryBuilder, query};
use async_trait::async_trait;
use std::collections::HashMap;
use ventriform_service::base::records::{
    FoundScans, ItemFilter, JobOnScan, ListRequest, MadeOfScan, Owned, PAGE_BYTES, Resource,
    ScanLists, ScanOrder, ScanSearch, SearchedWords, StoreResult, StoredVolume, TagFilter, Tenant,
};

/// The volumes of scans that [`push_scan`] finds.
const VOLUMES_OF_SCANS: &str = "holdings AS x WHERE x.tenant = c.tenant AND x.id = c.volume";

/// Where a list is in its order.
#[derive(Debug, Clone)]
pub(super) enum Place {
    /// At that sequence number, the newest first.
    Sequence(i64),
    /// At that number of bytes, and sequence number.
    Bytes(i64, i64),
    /// At that text, and sequence number.
    Text(String, i64),
}

/// The column of an order, and whether its greatest value comes first.
fn column(order: ScanOrder) -> (&'static str, bool) {
    match order {
        ScanOrder::Newest => ("sequence", true),
        ScanOrder::StudyDate => ("study_date", true),
        ScanOrder::Patient => ("patient", false),
        ScanOrder::Name => ("name", false),
        ScanOrder::Largest => ("bytes", true),
    }
}

#[async_trait]
impl ScanLists for SqlStore {
    async fn find_scans(
        &self,
        tenant: &Tenant,
        filter: &ItemFilter,
        page: ListRequest,
    ) -> StoreResult<Option<FoundScans>> {
        let after = match page.before {
            None => None,
            Some(sequence) => match self
                .place_in_list(tenant, filter.search.order, sequence)
                .await?
            {
                None => return Ok(None),
                found => found,
            },
        };
        let statement = found(tenant, filter, after.as_ref(), page.limit).build();
        let rows = statement.fetch_all(&self.readers).await?;
        let row = |row: crate::query::DbRow| {
            let bytes: i64 = row.try_get("bytes")?;
            Ok((row.try_get("sequence")?, rows::unsigned(bytes)))
        };
        Ok(Some(page_of(rows::all(rows, row)?, page.limit)))
    }

    async fn volumes_at(
        &self,
        tenant: &Tenant,
        sequences: &[i64],
    ) -> StoreResult<Vec<Owned<StoredVolume>>> {
        if sequences.is_empty() {
            return Ok(Vec::new());
        }
        let mut query = HELD_VOLUME.query(Columns::All);
        query
            .push(" WHERE h.tenant = ")
            .push_bind(tenant.to_string());
        query.push(" AND h.sequence IN (");
        for (n, sequence) in sequences.iter().enumerate() {
            query.push(if n == 0 { "" } else { ", " });
            query.push_bind(*sequence);
        }
        query.push(")");
        let rows = query.build().fetch_all(&self.readers).await?;
        let mut read = rows::all(rows, |row| rows::held(row, rows::volume))?;
        let places: HashMap<i64, usize> = (0..).zip(sequences).map(|(n, s)| (*s, n)).collect();
        read.sort_by_key(|volume| places.get(&volume.sequence).copied());
        Ok(read)
    }
}

impl SqlStore {
    /// Where the row with that sequence number is in a list; `None` if it is not there to tell.
    async fn place_in_list(
        &self,
        tenant: &Tenant,
        order: ScanOrder,
        sequence: i64,
    ) -> StoreResult<Option<Place>> {
        let (column, _) = column(order);
        if order == ScanOrder::Newest {
            return Ok(Some(Place::Sequence(sequence)));
        }
        let row = query(format!(
            "SELECT {column} FROM listed_scans WHERE tenant = $1 AND sequence = $2"
        ))
        .bind(tenant.as_str())
        .bind(sequence)
        .fetch_optional(&self.readers)
        .await?;
        let place = |row: crate::query::DbRow| {
            Ok(match order {
                ScanOrder::Largest => Place::Bytes(row.try_get(0)?, sequence),
                _ => Place::Text(row.try_get(0)?, sequence),
            })
        };
        row.map(place).transpose()
    }
}

/// The rows of a page, from those found with a limit of one more than requested; at most [`PAGE_BYTES`], but one row.
fn page_of(found: Vec<(i64, u64)>, limit: u32) -> FoundScans {
    let (mut sequences, mut bytes) = (Vec::new(), 0_u64);
    let count = found.len();
    for (sequence, size) in found {
        let full = !sequences.is_empty() && bytes.saturating_add(size) > PAGE_BYTES;
        if full || sequences.len() == limit as usize {
            break;
        }
        sequences.push(sequence);
        bytes = bytes.saturating_add(size);
    }
    let next = sequences.last().filter(|_| sequences.len() < count);
    FoundScans {
        next: next.copied(),
        sequences,
        bytes,
    }
}

/// The sequence numbers and bytes of a page's rows and of the one after it.
pub(super) fn found(
    tenant: &Tenant,
    filter: &ItemFilter,
    after: Option<&Place>,
    limit: u32,
) -> QueryBuilder {
    let (column, descends) = column(filter.search.order);
    let bytes = HELD_VOLUME.bytes();
    let mut query = QueryBuilder::new(format!(
        "SELECT l.sequence, {bytes} AS bytes
         FROM (SELECT l.sequence, l.tenant, l.volume, l.{column} AS place FROM listed_scans AS l
               WHERE l.tenant = "
    ));
    query.push_bind(tenant.to_string());
    push_place(&mut query, (column, descends), after);
    push_search(&mut query, tenant, &filter.search);
    push_names(&mut query, tenant, &filter.tags);
    push_scan(&mut query, ("l.", VOLUMES_OF_SCANS), tenant, &filter.scan);
    let order = match (column, descends) {
        ("sequence", _) => "l.sequence DESC".to_owned(),
        (_, true) => format!("l.{column} DESC, l.sequence DESC"),
        (_, false) => format!("l.{column}, l.sequence"),
    };
    query.push(" ORDER BY ").push(&order).push(" LIMIT ");
    query.push_bind(i64::from(limit) + 1);
    query.push(
        ") AS l JOIN holdings AS h ON h.sequence = l.sequence JOIN volumes AS v ON v.id = l.volume
         LEFT JOIN scans AS c ON c.tenant = l.tenant AND c.volume = l.volume ORDER BY ",
    );
    query.push(match descends {
        true => "l.place DESC, l.sequence DESC",
        false => "l.place, l.sequence",
    });
    query
}

/// Adds the place after which the page begins.
fn push_place(query: &mut QueryBuilder, by: (&str, bool), after: Option<&Place>) {
    let (column, descends) = by;
    let than = if descends { " < " } else { " > " };
    let sequence = match after {
        None => return,
        Some(Place::Sequence(sequence)) => {
            query.push(" AND l.sequence < ").push_bind(*sequence);
            return;
        }
        Some(Place::Bytes(_, sequence) | Place::Text(_, sequence)) => *sequence,
    };
    query.push(" AND (l.").push(column).push(", l.sequence)");
    query.push(than).push("(");
    if let Some(Place::Text(text, _)) = after {
        query.push_bind(text);
    }
    if let Some(Place::Bytes(bytes, _)) = after {
        query.push_bind(*bytes);
    }
    query.push(", ").push_bind(sequence).push(")");
}

/// Adds the conditions of a search.
fn push_search(query: &mut QueryBuilder, tenant: &Tenant, search: &ScanSearch) {
    if let Some(words) = &search.words {
        push_words(query, tenant, words);
    }
    query.push(match search.made {
        Some(MadeOfScan::Model) => " AND l.models > 0",
        Some(MadeOfScan::Segmentation) => " AND l.segmentations > 0",
        Some(MadeOfScan::Beat) => " AND l.beats > 0",
        Some(MadeOfScan::Comparison) => " AND l.comparisons > 0",
        Some(MadeOfScan::Nothing) => {
            " AND l.models = 0 AND l.segmentations = 0 AND l.beats = 0 AND l.comparisons = 0"
        }
        None => "",
    });
    if let Some(job) = search.job {
        query.push(" AND l.volume IN (SELECT volume FROM jobs WHERE tenant = ");
        query.push_bind(tenant.to_string());
        query.push(match job {
            JobOnScan::Unfinished => " AND state IN ('queued', 'running'))",
            JobOnScan::Failed => " AND state = 'failed')",
        });
    }
    let role = search.rest_or_stress.map(|role| role.as_str().to_owned());
    let texts = [
        (" AND l.modality = ", &search.modality),
        (" AND l.rest_or_stress = ", &role),
        (" AND l.patient_id = ", &search.patient),
        (" AND l.study_date >= ", &search.study_date_from),
        (
            " AND l.study_date != '' AND l.study_date <= ",
            &search.study_date_to,
        ),
    ];
    for (condition, value) in texts {
        if let Some(value) = value {
            query.push(condition).push_bind(value);
        }
    }
    let moments = [
        (" AND l.created_at > ", search.created_after),
        (" AND l.created_at < ", search.created_before),
    ];
    for (condition, moment) in moments {
        if let Some(moment) = moment {
            query.push(condition).push_bind(moment);
        }
    }
}

/// Adds the names that the tenant gave.
fn push_names(query: &mut QueryBuilder, tenant: &Tenant, tags: &TagFilter) {
    if let Some(external_id) = &tags.external_id {
        query.push(" AND l.sequence IN (SELECT sequence FROM holdings WHERE tenant = ");
        query.push_bind(tenant.to_string());
        query.push(" AND external_id = ").push_bind(external_id);
        query.push(" AND kind = 'volume')");
    }
    let labels = TagFilter {
        external_id: None,
        labels: tags.labels.clone(),
    };
    push_tags(query, "l.", tenant, Resource::Volume, &labels);
}

/// Adds that every word is part of a text about the scan, or begins its id, or that of something made of it.
fn push_words(query: &mut QueryBuilder, tenant: &Tenant, searched: &SearchedWords) {
    let column = match searched.personal {
        true => "l.personal_words",
        false => "l.words",
    };
    for word in &searched.words {
        query.push(" AND (");
        for (n, form) in forms(word).into_iter().enumerate() {
            query.push(if n == 0 { "" } else { " OR " }).push(column);
            query.push(" LIKE ").push_bind(part(&form));
            query.push(" ESCAPE '\\'");
        }
        push_id(query, tenant, &word.to_ascii_lowercase());
        query.push(")");
    }
}

/// Fewest digits of an id that begin it in a search: fewer are found in every other id.
const LEAST_ID_DIGITS: usize = 4;

/// Adds the ids that begin with a word: with or without the prefix of a volume, or with that of a result.
fn push_id(query: &mut QueryBuilder, tenant: &Tenant, word: &str) {
    let is_digits = word.len() >= LEAST_ID_DIGITS && word.bytes().all(|b| b.is_ascii_hexdigit());
    // No character of an id comes after `~`.
    let between = |query: &mut QueryBuilder, column: &str, from: &str| {
        query.push(column).push(" >= ").push_bind(from);
        query.push(" AND ").push(column).push(" < ");
        query.push_bind(format!("{from}~"));
    };
    match Resource::from_id(word) {
        Some(Resource::Volume) => {
            query.push(" OR ");
            between(query, "l.volume", word);
        }
        Some(_) => {
            query.push(" OR l.volume IN (SELECT volume FROM sources WHERE tenant = ");
            query.push_bind(tenant.to_string()).push(" AND ");
            between(query, "id", word);
            query.push(")");
        }
        None if is_digits => {
            query.push(" OR ");
            let prefix = Resource::Volume.prefix();
            between(query, "l.volume", &format!("{prefix}{word}"));
        }
        None => {}
    }
}

/// The forms of a word that are looked for in texts whose letters A to Z are small: as it is, in small letters, in
/// capitals, and with its first letter a capital.
fn forms(word: &str) -> Vec<String> {
    let small = word.to_lowercase();
    let mut letters = small.chars();
    let first = letters.next().map(|first| first.to_uppercase().to_string());
    let titled = first.unwrap_or_default() + letters.as_str();
    let mut forms = Vec::new();
    for form in [word.to_owned(), small.clone(), word.to_uppercase(), titled] {
        let form = form.to_ascii_lowercase();
        if !forms.contains(&form) {
            forms.push(form);
        }
    }
    forms
}

/// The pattern of texts of which that is a part.
fn part(text: &str) -> String {
    let mut pattern = String::from("%");
    for letter in text.chars() {
        if matches!(letter, '%' | '_' | '\\') {
            pattern.push('\\');
        }
        pattern.push(letter);
    }
    pattern.push('%');
    pattern
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::DiskGauge;
    use std::time::Duration;
    use ventriform_service::base::records::{ScanFilter, WhichScan};

    #[test]
    fn a_word_is_looked_for_in_the_forms_in_which_names_are_written() {
        assert_eq!(forms("Smith"), ["smith"]);
        assert_eq!(forms("MÜLLER"), ["mÜller", "müller"]);
        assert_eq!(forms("éloïse"), ["éloïse", "ÉloÏse", "Éloïse"]);
        assert_eq!(part("50%_\\"), "%50\\%\\_\\\\%");
    }

    #[test]
    fn a_page_ends_at_its_limit_or_at_its_bytes_and_says_whether_more_follows() {
        let page = |limit, sizes: &[u64]| {
            let rows = (1..).zip(sizes.iter().copied()).collect();
            let found = page_of(rows, limit);
            (found.sequences.len(), found.bytes, found.next)
        };
        assert_eq!(page(2, &[5, 6, 7]), (2, 11, Some(2)));
        assert_eq!(page(3, &[5, 6, 7]), (3, 18, None));
        assert_eq!(page(9, &[PAGE_BYTES, 1]), (1, PAGE_BYTES, Some(1)));
        assert_eq!(page(9, &[2 * PAGE_BYTES]), (1, 2 * PAGE_BYTES, None));
        assert_eq!(page(9, &[]), (0, 0, None));
    }

    /// Every order with every filter by itself, with what its plan must begin with if not with the order's index.
    fn searches() -> Vec<(ItemFilter, Option<&'static str>)> {
        let text = || Some("x".to_owned());
        let base = ItemFilter::default;
        let with = |change: fn(&mut ScanSearch)| {
            let mut filter = base();
            change(&mut filter.search);
            filter
        };
        let words = |search: &mut ScanSearch| {
            search.words = Some(SearchedWords {
                words: vec!["a".into(), "É".into()],
                personal: true,
            });
        };
        let mut of_study = base();
        of_study.scan = ScanFilter {
            study: text(),
            ..ScanFilter::default()
        };
        let mut named = base();
        named.tags.external_id = text();
        let mut labelled = base();
        labelled.tags.labels = [("a".to_owned(), "b".to_owned())].into();
        vec![
            (base(), None),
            (with(words), None),
            (with(|s| s.made = Some(MadeOfScan::Beat)), None),
            (with(|s| s.made = Some(MadeOfScan::Nothing)), None),
            (with(|s| s.modality = Some("NM".into())), None),
            (with(|s| s.rest_or_stress = Some(WhichScan::Rest)), None),
            (with(|s| s.patient = Some("7".into())), None),
            (with(|s| s.created_after = Some(3)), None),
            (with(|s| s.job = Some(JobOnScan::Failed)), Some("volume=?")),
            (of_study, Some("rowid=?")),
            (named, Some("rowid=?")),
            (labelled, Some("rowid=?")),
        ]
    }

    #[tokio::test]
    async fn a_page_is_read_in_the_order_of_an_index_or_from_few_rows() {
        let folder = tempfile::tempdir().unwrap();
        let gauge = DiskGauge::new(folder.path(), None);
        let path = folder.path().join("lists.db");
        let store = SqlStore::open(&path, Duration::from_secs(1), gauge).await;
        let store = store.unwrap();
        let tenant = Tenant::default();
        for order in ScanOrder::ALL {
            let place = match order {
                ScanOrder::Newest => Place::Sequence(7),
                ScanOrder::Largest => Place::Bytes(5, 7),
                _ => Place::Text("a".into(), 7),
            };
            for (mut filter, few) in searches() {
                filter.search.order = order;
                for after in [None, Some(&place)] {
                    let statement = found(&tenant, &filter, after, 30).text();
                    let plan = query(format!("EXPLAIN QUERY PLAN {statement}"));
                    let plan = plan.fetch_all(&store.readers).await.unwrap();
                    let plan: Vec<String> = rows::all(plan, |row| row.try_get("detail")).unwrap();
                    let told = format!("{statement}\n{plan:#?}");
                    let list = plan.iter().find(|step| step.starts_with("SEARCH l USING"));
                    let list = list.unwrap_or_else(|| panic!("{told}"));
                    let ordered = list.contains("listed_scans_by_");
                    assert!(
                        ordered || few.is_some_and(|few| list.contains(few)),
                        "{told}"
                    );
                    assert!(
                        !plan
                            .iter()
                            .any(|step| step.starts_with("SCAN listed_scans")),
                        "{told}"
                    );
                }
            }
        }
        store.close().await;
    }
}
