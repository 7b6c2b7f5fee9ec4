//! The filters and the order that lists have in common: newest first, by the column `sequence`.
//!
//! However a list is filtered, it is read from an index that begins with the tenant and a column of the filter and
//! ends with `sequence`, so that a page costs no more rows than one of its filters lets through. The tests look at
//! the plan of every combination of filters.

use crate::query::QueryBuilder;
use ventriform_service::base::records::{ListRequest, Resource, TagFilter, Tenant, Timestamp};

/// Adds the conditions of a filter to a query whose columns have that prefix.
pub(super) fn push_tags(
    query: &mut QueryBuilder,
    prefix: &str,
    tenant: &Tenant,
    kind: Resource,
    filter: &TagFilter,
) {
    if let Some(external_id) = &filter.external_id {
        query.push(" AND ").push(prefix).push("external_id = ");
        query.push_bind(external_id.clone());
    }
    for (name, value) in &filter.labels {
        query.push(" AND ").push(prefix).push("sequence IN ");
        query.push("(SELECT sequence FROM label_index WHERE tenant = ");
        query.push_bind(tenant.to_string());
        query.push(" AND kind = ").push_bind(kind.noun());
        query.push(" AND name = ").push_bind(name.clone());
        query
            .push(" AND value = ")
            .push_bind(value.clone())
            .push(")");
    }
}

/// Bounds on a column of times.
pub(super) struct Times<'a> {
    /// The table that is listed.
    pub table: &'a str,
    /// The column, which has an index of tenant, time and `sequence`.
    pub column: &'a str,
    /// Comparisons with moments.
    pub bounds: &'a [(&'a str, Timestamp)],
}

/// Adds bounds on times to a query whose order is that of `sequence`. Times are nearly in that order, and not
/// quite: clocks are set. So the least and the greatest `sequence` between the bounds are taken from the index,
/// and the list is read from there. Without them it would be read to its end for the last few rows that match.
pub(super) fn push_times(query: &mut QueryBuilder, times: &Times<'_>, tenant: &Tenant) {
    let Times {
        table,
        column,
        bounds,
    } = times;
    let compared = |query: &mut QueryBuilder| {
        for (than, moment) in *bounds {
            query.push(" AND ").push(column).push(" ").push(than);
            query.push(" ").push_bind(*moment);
        }
    };
    compared(query);
    // Without the sum, an engine may look for the least by reading the table in the order of `sequence`.
    for (than, end) in [(">=", "min"), ("<=", "max")] {
        query.push(" AND sequence ").push(than).push(" (SELECT ");
        query.push(end).push("(sequence + 0) FROM ").push(table);
        query.push(" WHERE tenant = ").push_bind(tenant.to_string());
        compared(query);
        query.push(")");
    }
}

/// Adds the end of a query for a page, newest first, by the column of the sequence number.
pub(super) fn push_page(query: &mut QueryBuilder, sequence: &str, page: ListRequest) {
    if let Some(before) = page.before {
        query.push(" AND ").push(sequence).push(" < ");
        query.push_bind(before);
    }
    query.push(" ORDER BY ").push(sequence).push(" DESC LIMIT ");
    query.push_bind(i64::from(page.limit) + 1);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::database::SqlStore;
    use crate::query::query;
    use crate::space::DiskGauge;
    use crate::tables::catalogue::Columns;
    use crate::tables::{access, catalogue, intake, jobs, rows};
    use std::time::Duration;
    use ventriform_service::base::records::{
        Clock, Cutoff, Expired, ItemFilter, JobFilter, JobState, Priority, ScanFilter,
    };
    use ventriform_service::callers::AuditFilter;
    use ventriform_service::network::intake::GroupState;

    /// Every combination of so many filters, as bits.
    fn combinations(filters: u32) -> impl Iterator<Item = impl Fn(u32) -> bool> {
        (0..1_u32 << filters).map(|chosen| move |filter: u32| chosen >> filter & 1 == 1)
    }

    fn text(chosen: bool) -> Option<String> {
        chosen.then(|| "x".to_owned())
    }

    fn tags(external_id: bool, label: bool) -> TagFilter {
        let labels = label.then(|| ("a".to_owned(), "b".to_owned()));
        TagFilter {
            external_id: text(external_id),
            labels: labels.into_iter().collect(),
        }
    }

    fn scan(study: bool, series: bool, accession: bool) -> ScanFilter {
        ScanFilter {
            study: text(study),
            series: text(series),
            accession: text(accession),
        }
    }

    /// A statement, and the words of which its plan must name one, where it must.
    type Listed = (String, Vec<&'static str>);

    /// Every list by every combination of its filters, first pages and later ones.
    fn lists() -> Vec<Listed> {
        let tenant = Tenant::default();
        let mut all: Vec<Listed> = Vec::new();
        for before in [None, Some(7)] {
            let page = ListRequest { before, limit: 100 };
            let mut add = |query: QueryBuilder, by: Vec<&'static str>| all.push((query.text(), by));
            for on in combinations(10) {
                let filter = JobFilter {
                    tenant: tenant.clone(),
                    state: on(0).then_some(JobState::Failed),
                    kind: text(on(1)),
                    priority: on(2).then_some(Priority::Urgent),
                    volume: text(on(3)),
                    created_after: on(4).then_some(5),
                    tags: tags(on(5), on(6)),
                    scan: scan(on(7), on(8), on(9)),
                };
                // What lets the fewest through finds them.
                let narrow = [
                    (on(3), "volume=?"),
                    (on(5), "external_id=?"),
                    (on(6), "sequence=?"),
                    (on(7) || on(8) || on(9), "sequence=?"),
                ];
                let narrow: Vec<_> = narrow.iter().filter(|one| one.0).map(|one| one.1).collect();
                let wide = [(on(0), "state=?"), (on(2), "priority=?"), (on(1), "kind=?")];
                let wide = wide.iter().find(|one| one.0).map(|one| one.1);
                let by = match (narrow.is_empty(), wide) {
                    (false, _) => narrow,
                    // A range of times is one of the list's order.
                    (true, Some(wide)) if on(4) => vec![wide, "sequence>?"],
                    (true, Some(wide)) => vec![wide],
                    (true, None) => vec!["jobs_by_tenant (tenant=?"],
                };
                add(jobs::listed("sequence, bytes", &filter, page), by.clone());
                add(jobs::listed("*", &filter, page), by);
            }
            for on in combinations(5) {
                let filter = ItemFilter {
                    tags: tags(on(0), on(1)),
                    scan: scan(on(2), on(3), on(4)),
                    ..ItemFilter::default()
                };
                let narrow = [
                    (on(0), "external_id=?"),
                    (on(1), "sequence=?"),
                    (on(2) || on(3) || on(4), "sequence=?"),
                ];
                let by: Vec<_> = narrow.iter().filter(|one| one.0).map(|one| one.1).collect();
                let by = if by.is_empty() { vec!["kind=?"] } else { by };
                for kind in [Resource::Volume, Resource::Model, Resource::Template] {
                    for column in [Columns::All, Columns::Size] {
                        let query = catalogue::listed(column, &tenant, kind, &filter, page);
                        add(query, by.clone());
                    }
                }
            }
            for on in combinations(4) {
                let filter = AuditFilter {
                    tenant: Some(tenant.clone()),
                    agent: text(on(0)),
                    object: text(on(1)),
                    since: on(2).then_some(1),
                    until: on(3).then_some(9),
                };
                let found = [(on(0), "agent=?"), (on(1), "object=?")];
                let mut by: Vec<_> = found.iter().filter(|one| one.0).map(|one| one.1).collect();
                if on(2) || on(3) {
                    by.push("sequence>?");
                }
                if by.is_empty() {
                    by.push("audit_by_tenant (tenant=?");
                }
                add(access::listed_events(&filter, page), by);
            }
            add(access::listed_keys(Some(&tenant), page), vec!["tenant=?"]);
            for columns in [Columns::All, Columns::Size] {
                let all = catalogue::listed_receipts(columns, &tenant, None, page);
                add(all, vec!["tenant=?"]);
                let of_item = catalogue::listed_receipts(columns, &tenant, Some("x"), page);
                add(of_item, vec!["item=?"]);
            }
            add(intake::listed(&tenant, None, page), vec!["tenant=?"]);
            let failed = intake::listed(&tenant, Some(GroupState::Failed), page);
            add(failed, vec!["state=?"]);
        }
        for kind in Resource::ALL {
            let last = Expired {
                tenant: tenant.clone(),
                id: String::new(),
                since: 3,
                sequence: 4,
            };
            for after in [None, Some(&last)] {
                let by = match kind {
                    Resource::Job => "finished_at<?",
                    _ => "renewed_at<?",
                };
                let query = catalogue::expired(kind, cutoff(9), after, 100);
                all.push((query.text(), vec![by]));
            }
        }
        all
    }

    /// A clock that stands still and is trusted.
    struct StandingClock(Timestamp);

    impl Clock for StandingClock {
        fn now(&self) -> Timestamp {
            self.0
        }

        fn is_trusted(&self) -> bool {
            true
        }

        fn latest(&self) -> Timestamp {
            self.0
        }
    }

    fn cutoff(moment: Timestamp) -> Cutoff {
        let clock: &dyn Clock = &StandingClock(moment);
        clock.trusted().unwrap().older_than(Duration::ZERO)
    }

    #[tokio::test]
    async fn no_list_reads_more_rows_than_one_of_its_filters_lets_through() {
        let folder = tempfile::tempdir().unwrap();
        let gauge = DiskGauge::new(folder.path(), None);
        let path = folder.path().join("lists.db");
        let store = SqlStore::open(&path, Duration::from_secs(1), gauge).await;
        let store = store.unwrap();
        let lists = lists();
        assert!(lists.len() > 2000, "{}", lists.len());
        for (statement, by) in lists {
            let plan = query(format!("EXPLAIN QUERY PLAN {statement}"));
            let plan = plan.fetch_all(&store.readers).await.unwrap();
            let plan: Vec<String> = rows::all(plan, |row| row.try_get("detail")).unwrap();
            let scans = plan.iter().find(|step| step.starts_with("SCAN"));
            assert!(scans.is_none(), "{statement}\n{plan:#?}");
            // Parts that look things up by the tenant alone would read all that it has. The list itself may, in
            // its order, if there is no filter.
            let alone = |step: &&String| step.ends_with("(tenant=?)");
            let lookups = plan.iter().skip(1).find(alone);
            assert!(lookups.is_none(), "{statement}\n{plan:#?}");
            let found = by.iter().any(|by| plan[0].contains(by));
            assert!(found, "{by:?}: {statement}\n{plan:#?}");
        }
        store.close().await;
    }
}
