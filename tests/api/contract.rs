//! The properties of a database that the queue and the service rely on, checked on SQLite and on PostgreSQL.
//!
//! On PostgreSQL, `a` and `b` are two processes on one database; on SQLite, which one process uses, they
//! are the same.

mod search;

use super::helpers::{cutoff, trusted};
use super::postgres::{Server, reached, server};
use futures::future::BoxFuture;
use search::{
    a_search_knows_what_has_changed, pages_of_a_search_have_no_gaps_while_scans_come_and_go,
    scans_are_searched_as_a_whole,
};
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;
use tempfile::TempDir;
use ventriform::image::volume::dicom::DicomHeader;
use ventriform_program::cli::advice::advised;
use ventriform_service::base::records::{
    AddedProduct, Bounded, Catalogue, Claimant, Clock, Custody, DeathLimit, Deleted, Erased,
    ErasureAgent, ErasureOrder, ErasureReason, Failure, Fault, FigureStore, FileRecord, Filed,
    Idempotency, Interrupted, ItemFilter, ItemRecord, Job, JobFilter, JobOutcome, JobState,
    JobStore, JobWebhook, Lease, LegalHold, ListRequest, NewJob, PAGE_BYTES, Priority, Product,
    ProductFile, ProductRoom, Resource, ScanErasureOrder, ScanErasures, ScanFields, ScanFilter,
    ScanSelection, Scans, ScansErased, SendOrder, SeriesSource, StoreFault, StoreResult,
    StoredVolume, SystemClock, TagFilter, Tags, Tenant, TimeStore, Timestamp, random_id,
};
use ventriform_service::callers::{
    AccessStore, Activity, Agent, ApiKey, AuditEvent, AuditFilter, AuditRecord, KeyRequest, Maker,
    Quota, Recorder, Scope, verify,
};
use ventriform_service::network::archive::{ArchiveStore, HeldSeries, SendSettlement, SeriesKey};
use ventriform_service::network::hooks::{
    AttemptOutcome, DeliveryLimits, DeliveryState, DeliveryStore, HookEndpoint, HookEvent, Lane,
    NextAttempt, Settlement, SigningSecret,
};
use ventriform_service::network::intake::{
    Added, GroupState, IntakeRoom, IntakeStore, NewObject, Origin, Protocol, RecordedGroups,
};
use ventriform_service::network::worklist::{
    AddedWorkitem, BATCH_BYTES, DataSetJson, Performer, Workitem, WorkitemState, Worklist,
};
use ventriform_store::{DiskGauge, PostgresError, SqlStore, Store, StoreSettings};

/// Longer than a busy machine keeps anybody waiting.
const CONNECT_WAIT: Duration = Duration::from_secs(30);
/// Time for which an operation waits for a server that is away.
const SHORT_WAIT: Duration = Duration::from_millis(500);
const SHORT_LEASE: Duration = Duration::from_millis(150);
const ALL: ListRequest = ListRequest {
    before: None,
    limit: 1000,
};

const AMPLE_ROOM: ProductRoom = ProductRoom {
    count: u32::MAX,
    bytes: None,
};

/// Two users of one database.
struct Stores {
    a: Arc<SqlStore>,
    b: Arc<SqlStore>,
    /// The database on the server; `None` for SQLite.
    url: Option<String>,
    folder: TempDir,
}

impl Stores {
    async fn sqlite() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let gauge = DiskGauge::new(folder.path(), Some(0));
        let a = SqlStore::open(&folder.path().join("contract.db"), CONNECT_WAIT, gauge).await;
        let a = Arc::new(a.unwrap());
        let (b, url) = (a.clone(), None);
        Self { a, b, url, folder }
    }

    async fn postgres() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let url = server().database().await;
        // Both start at once, and both want to make the tables.
        let settings = reached(&url);
        let open = || async {
            let gauge = DiskGauge::new(folder.path(), Some(0));
            Arc::new(
                SqlStore::connect(&settings, CONNECT_WAIT, gauge)
                    .await
                    .unwrap(),
            )
        };
        let (a, b) = tokio::join!(open(), open());
        let url = Some(url);
        Self { a, b, url, folder }
    }

    /// Runs SQL as somebody who can write to the database. Returns whether that was accepted.
    async fn tamper(&self, sql: &'static str) -> bool {
        use sqlx::{ConnectOptions, Connection, Executor};
        match &self.url {
            Some(url) => {
                let mut connection = sqlx::PgConnection::connect(url).await.unwrap();
                connection.execute(sqlx::raw_sql(sql)).await.is_ok()
            }
            None => {
                let file = self.folder.path().join("contract.db");
                let options = sqlx::sqlite::SqliteConnectOptions::new().filename(file);
                let mut connection = options.connect().await.unwrap();
                connection.execute(sqlx::raw_sql(sql)).await.is_ok()
            }
        }
    }

    /// What makes every row of the audit trail fail.
    fn without_trail(&self) -> &'static str {
        match self.url {
            Some(_) => {
                "CREATE OR REPLACE FUNCTION no_trail() RETURNS trigger LANGUAGE plpgsql AS
                     $$ BEGIN RAISE EXCEPTION 'no trail'; END $$;
                 CREATE TRIGGER no_trail BEFORE INSERT ON audit FOR EACH ROW EXECUTE FUNCTION no_trail()"
            }
            None => "CREATE TRIGGER no_trail BEFORE INSERT ON audit BEGIN SELECT RAISE(ABORT, 'no trail'); END",
        }
    }

    /// What ends that.
    fn with_trail(&self) -> &'static str {
        match self.url {
            Some(_) => "DROP TRIGGER no_trail ON audit",
            None => "DROP TRIGGER no_trail",
        }
    }

    /// A volume of that tenant.
    async fn volume(&self, tenant: &Tenant) -> String {
        let id = random_id(Resource::Volume.prefix());
        let volume = stored_volume(&id, 1_000);
        let tags = Tags::default();
        assert!(
            self.a
                .add_volume(&volume, tenant, &tags, None)
                .await
                .unwrap()
        );
        id
    }

    async fn file(&self, job: &NewJob) -> Job {
        match self.a.file(job, 1000, now()).await.unwrap() {
            Filed::New(job) => job,
            other => panic!("{other:?}"),
        }
    }

    async fn claim(&self) -> Option<(Job, Lease)> {
        claim(&self.b, "run_b").await
    }
}

async fn claim(store: &SqlStore, run: &str) -> Option<(Job, Lease)> {
    let by = Claimant {
        token: random_id(""),
        run: run.into(),
        lease: SHORT_LEASE,
    };
    let job = store.claim(&by, now()).await.unwrap()?;
    let lease = Lease {
        job: job.id.clone(),
        token: by.token,
    };
    Some((job, lease))
}

fn now() -> Timestamp {
    SystemClock.now()
}

fn tenant() -> Tenant {
    Tenant::default()
}

fn other() -> Tenant {
    "other".parse().unwrap()
}

fn lane(tenant: &Tenant, destination: &str) -> Lane {
    Lane {
        destination: destination.into(),
        tenant: tenant.clone(),
    }
}

fn stored_volume(id: &str, bytes: u64) -> StoredVolume {
    StoredVolume {
        id: id.into(),
        sequence: 0,
        created_at: now(),
        bytes,
        files: vec![FileRecord {
            name: "volume.nii".into(),
            bytes,
            sha256: "ab".repeat(32),
            place: None,
        }],
        facts: json!({"shape": [4, 4, 4]}),
    }
}

fn new_job(volume: &str) -> NewJob {
    NewJob {
        kind: "model".into(),
        volume: Some(volume.into()),
        ..NewJob::default()
    }
}

fn product(id: String, volume: Option<&str>) -> Product {
    Product {
        id,
        sequence: 0,
        created_at: now(),
        volume: volume.map(str::to_owned),
        parameters: Map::new(),
        summary: object(json!({"points": 12})),
        software: "test".into(),
        files: vec![ProductFile {
            name: "mesh.json".into(),
            media_type: "application/json".into(),
            bytes: 2,
            sha256: "cd".repeat(32),
            place: None,
        }],
    }
}

fn model(volume: &str) -> Product {
    product(random_id(Resource::Model.prefix()), Some(volume))
}

fn object(value: Value) -> Map<String, Value> {
    value.as_object().unwrap().clone()
}

fn failure(code: &str) -> Failure {
    Failure::new(Fault::Content, code, "It failed.")
}

fn erasure(id: &str, cascade: bool) -> ErasureOrder {
    ErasureOrder {
        renewed_before: None,
        tenant: tenant(),
        id: id.into(),
        cascade,
        by: ErasureAgent {
            name: "somebody".into(),
            ..ErasureAgent::default()
        },
        reason: ErasureReason::Request,
    }
}

fn succeeded(product: &Product) -> JobOutcome {
    JobOutcome::Succeeded(Box::new(product.clone()))
}

/// Makes a test of each contract on each engine.
macro_rules! contracts {
    ($($name:ident),+ $(,)?) => {
        mod on_sqlite {
            $(#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn $name() {
                let on = super::Stores::sqlite().await;
                super::$name(&on).await;
                super::totals_are_sums(&on).await;
            })+
        }
        mod on_postgres {
            $(#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn $name() {
                let on = super::Stores::postgres().await;
                super::$name(&on).await;
                super::totals_are_sums(&on).await;
            })+
        }
    };
}

contracts!(
    a_lost_lease_writes_nothing,
    a_failed_commit_leaves_nothing,
    each_job_is_claimed_once_in_order,
    tenants_take_turns,
    one_key_files_one_job,
    the_queue_is_never_longer_than_its_limit,
    no_job_is_filed_on_what_is_erased,
    jobs_end_in_every_way,
    holds_keep_what_they_name,
    erasures_leave_receipts,
    scans_are_erased_together,
    old_things_expire,
    lists_find_by_tags_and_scans,
    scans_are_searched_as_a_whole,
    pages_of_a_search_have_no_gaps_while_scans_come_and_go,
    a_search_knows_what_has_changed,
    a_page_is_planned_by_the_bytes_of_its_rows,
    a_row_is_read_within_its_bytes,
    identities_are_kept_and_erased,
    items_are_shared_by_tenants,
    the_audit_trail_is_one_chain,
    keys_are_kept,
    keys_of_an_owner_are_revoked_together,
    the_trusted_time_is_kept,
    what_a_clock_that_was_ahead_put_off_is_due,
    a_defect_is_told_until_it_is_mended,
    the_trail_is_tried_without_a_row,
    ends_of_jobs_are_told,
    series_are_fetched_and_results_sent,
    errands_are_found_by_tenant_and_destination,
    received_objects_become_volumes,
    work_items_change_once,
    figures_are_counted,
    changes_and_their_rows_are_one,
    everything_stored_counts_for_its_tenant,
    totals_follow_every_change_of_a_row,
    a_full_queue_and_a_full_intake_keep_a_share_for_others,
    work_items_are_read_in_batches_of_few_bytes,
);

/// Whatever a test has done, quotas are judged by what is stored.
async fn totals_are_sums(on: &Stores) {
    let wrong = on.a.wrong_totals().await.unwrap();
    assert!(wrong.is_empty(), "{wrong:?}");
}

async fn a_lost_lease_writes_nothing(on: &Stores) {
    let volume = on.volume(&tenant()).await;
    let job = on.file(&new_job(&volume)).await;
    let (_, lost) = claim(&on.a, "run_a").await.unwrap();
    assert!(claim(&on.b, "run_b").await.is_none(), "it is claimed");
    // A run that lives keeps its leases.
    let (alive, limit) = (Some("run_a"), None);
    tokio::time::sleep(2 * SHORT_LEASE).await;
    assert!(
        on.b.release_dead(alive, limit, now())
            .await
            .unwrap()
            .is_empty()
    );
    let released =
        on.b.release_dead(Some("run_b"), limit, now())
            .await
            .unwrap();
    assert_eq!(released.len(), 1);
    assert_eq!(
        (released[0].state, released[0].interruptions),
        (JobState::Queued, 1)
    );
    let (again, lease) = on.claim().await.unwrap();
    assert_eq!((&again.id, again.attempts), (&job.id, 2));
    let first = model(&volume);
    assert!(
        on.a.renew_lease(&lost, SHORT_LEASE, now())
            .await
            .unwrap()
            .is_none()
    );
    assert!(
        on.a.progress(&lost, "surface", 0.5)
            .await
            .unwrap()
            .is_none()
    );
    assert!(on.a.hand_back(&lost, now()).await.unwrap().is_none());
    assert!(
        on.a.finish(&lost, &succeeded(&first), now())
            .await
            .unwrap()
            .is_none()
    );
    assert!(
        on.a.record(&first.id).await.unwrap().is_none(),
        "no part of a result"
    );
    // A lease that is renewed does not expire for others.
    tokio::time::sleep(SHORT_LEASE).await;
    assert_eq!(
        on.b.renew_lease(&lease, CONNECT_WAIT, now()).await.unwrap(),
        Some(false)
    );
    tokio::time::sleep(SHORT_LEASE).await;
    assert!(
        on.a.release_dead(Some("run_a"), limit, now())
            .await
            .unwrap()
            .is_empty()
    );
    let second = model(&volume);
    let done =
        on.b.finish(&lease, &succeeded(&second), now())
            .await
            .unwrap()
            .unwrap();
    assert_eq!(
        (done.state, done.result.as_ref()),
        (JobState::Succeeded, Some(&second.id))
    );
    assert!(on.a.product(&tenant(), &second.id).await.unwrap().is_some());
    assert!(
        on.b.finish(&lease, &succeeded(&second), now())
            .await
            .unwrap()
            .is_none()
    );
}

async fn a_failed_commit_leaves_nothing(on: &Stores) {
    let volume = on.volume(&tenant()).await;
    on.file(&NewJob {
        send: Some(SendOrder {
            names: vec!["mask.dcm".into()],
            to: "pacs".into(),
        }),
        ..new_job(&volume)
    })
    .await;
    let (job, lease) = on.claim().await.unwrap();
    // The kind of this id is none of a product, which the table refuses after the job was changed.
    let broken = product(random_id(Resource::Job.prefix()), Some(&volume));
    assert!(
        on.b.finish(&lease, &succeeded(&broken), now())
            .await
            .is_err()
    );
    let job = on.a.job(&job.id).await.unwrap().unwrap();
    assert_eq!(
        (job.state, job.result, job.revision),
        (JobState::Running, None, job.revision)
    );
    assert!(on.a.sends(&[&job.id]).await.unwrap().is_empty());
    assert!(on.a.record(&broken.id).await.unwrap().is_none());
    // The same writer goes on.
    let result = model(&volume);
    assert!(
        on.b.finish(&lease, &succeeded(&result), now())
            .await
            .unwrap()
            .is_some()
    );
    assert_eq!(on.a.sends(&[&job.id]).await.unwrap()[&job.id].len(), 1);
}

/// Random filing, claiming and ending, beside a queue that is written as plainly as possible.
async fn tenants_take_turns(on: &Stores) {
    let tenants = ["default", "b", "c"].map(|name| name.parse::<Tenant>().unwrap());
    let mut orders = Vec::new();
    for tenant in &tenants {
        let job = new_job(&on.volume(tenant).await);
        orders.push(NewJob {
            tenant: tenant.clone(),
            ..job
        });
    }
    // (rank of the priority, turn, number of filing, tenant, sequence and id)
    type Waiting = (i64, i64, usize, usize, (i64, String));
    let mut waiting: Vec<Waiting> = Vec::new();
    let mut running: Vec<(Waiting, Lease)> = Vec::new();
    let mut random = 7_u64;
    for number in 0..250 {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        match random >> 60 {
            chance @ 0..=7 => {
                // The first tenant files most of the jobs.
                let tenant = [0, 0, 0, 0, 0, 1, 1, 2][chance as usize];
                let rank = [1, 1, 0, 2][(random >> 50 & 3) as usize];
                let order = NewJob {
                    priority: Priority::of_rank(rank).unwrap(),
                    ..orders[tenant].clone()
                };
                let job = on.file(&order).await;
                let of = |all: &mut dyn Iterator<Item = i64>| all.max().map(|turn| turn + 1);
                // Each priority is a queue of its own.
                let waits = || waiting.iter().filter(|job| job.0 == rank);
                let runs = || {
                    running
                        .iter()
                        .map(|(job, _)| job)
                        .filter(|job| job.0 == rank)
                };
                let current = waits().map(|job| job.1).min();
                let current = current.or(of(&mut runs().map(|job| job.1)));
                let unfinished = waits().chain(runs());
                let own = of(&mut unfinished.filter(|job| job.3 == tenant).map(|job| job.1));
                let turn = current.unwrap_or(0).max(own.unwrap_or(0));
                waiting.push((rank, turn, number, tenant, (job.sequence, job.id)));
                waiting.sort();
                let asked: Vec<i64> = waiting.iter().map(|job| job.4.0).collect();
                let places: BTreeMap<i64, u64> = asked.iter().copied().zip(0..).collect();
                assert_eq!(on.b.ahead_of(&asked).await.unwrap(), places);
            }
            8..=11 => {
                waiting.sort();
                let claimed = on.claim().await;
                assert_eq!(claimed.is_some(), !waiting.is_empty());
                if let Some((job, lease)) = claimed {
                    let next = waiting.remove(0);
                    assert_eq!(job.id, next.4.1, "{next:?} before {waiting:?}");
                    running.push((next, lease));
                }
            }
            _ if running.is_empty() => {}
            _ => {
                let (_, lease) = running.remove(0);
                let outcome = JobOutcome::Failed(failure("no-surface"));
                assert!(
                    on.a.finish(&lease, &outcome, now())
                        .await
                        .unwrap()
                        .is_some()
                );
            }
        }
    }
    while on.claim().await.is_some() {}
    let urgent = NewJob {
        priority: Priority::Urgent,
        ..orders[2].clone()
    };
    let bulk = NewJob {
        priority: Priority::Bulk,
        ..orders[2].clone()
    };
    let (last, first) = (on.file(&bulk).await, on.file(&urgent).await);
    let places = on.a.ahead_of(&[last.sequence, first.sequence]).await;
    assert_eq!(
        places.unwrap(),
        [(last.sequence, 1), (first.sequence, 0)].into()
    );
    for (priority, job) in [(Priority::Urgent, first), (Priority::Bulk, last)] {
        let filter = JobFilter {
            tenant: tenants[2].clone(),
            state: Some(JobState::Queued),
            priority: Some(priority),
            ..JobFilter::default()
        };
        let page = ListRequest {
            before: None,
            limit: 10,
        };
        let found = on.a.jobs(&filter, page).await.unwrap().items;
        assert_eq!(
            found.iter().map(|job| &job.id).collect::<Vec<_>>(),
            [&job.id]
        );
        assert_eq!(found[0].priority, priority);
        assert_eq!(on.claim().await.unwrap().0.id, job.id);
    }
    // However much one tenant has filed, another's only job waits for one of these at most.
    for _ in 0..30 {
        on.file(&orders[0]).await;
    }
    on.claim().await.unwrap();
    let only = on.file(&orders[1]).await;
    let ahead = on.b.ahead_of(&[only.sequence]).await.unwrap();
    assert_eq!(ahead, [(only.sequence, 1)].into());
    assert_eq!(on.claim().await.unwrap().0.tenant, tenants[0]);
    assert_eq!(on.claim().await.unwrap().0.id, only.id);
}

async fn each_job_is_claimed_once_in_order(on: &Stores) {
    let volume = on.volume(&tenant()).await;
    let mut filed = Vec::new();
    for _ in 0..40 {
        filed.push(on.file(&new_job(&volume)).await.sequence);
    }
    assert_eq!(
        on.b.ahead_of(&[filed[7], filed[0]]).await.unwrap(),
        [(filed[0], 0), (filed[7], 7)].into()
    );
    let claimants = (0..4).map(|number| {
        let store = if number % 2 == 0 { &on.a } else { &on.b }.clone();
        tokio::spawn(async move {
            let mut own = Vec::new();
            while let Some((job, _)) = claim(&store, &format!("run_{number}")).await {
                own.push(job.sequence);
            }
            own
        })
    });
    let mut claimed = Vec::new();
    for own in futures::future::join_all(claimants).await {
        let own = own.unwrap();
        assert!(own.is_sorted(), "{own:?}");
        claimed.extend(own);
    }
    claimed.sort_unstable();
    assert_eq!(claimed, filed);
    let load = on.a.load().await.unwrap();
    assert_eq!(
        (load.queued, load.running, load.mean_duration_ms),
        (0, 40, None)
    );
}

async fn one_key_files_one_job(on: &Stores) {
    let volume = on.volume(&tenant()).await;
    let keyed = |fingerprint: &str| NewJob {
        idempotency: Some(Idempotency {
            key: "k".into(),
            fingerprint: fingerprint.into(),
        }),
        ..new_job(&volume)
    };
    let job = keyed("one");
    let filing = (0..8).map(|n| {
        let store = if n % 2 == 0 { &on.a } else { &on.b };
        store.file(&job, 1000, now())
    });
    let mut ids = BTreeSet::new();
    let mut new = 0;
    for filed in futures::future::join_all(filing).await {
        match filed.unwrap() {
            Filed::New(job) => {
                new += 1;
                ids.insert(job.id);
            }
            Filed::Same(job) => {
                ids.insert(job.id);
            }
            other => panic!("{other:?}"),
        }
    }
    assert_eq!((ids.len(), new), (1, 1));
    let filed = on.b.file(&keyed("two"), 1000, now()).await.unwrap();
    assert!(matches!(filed, Filed::KeyReused), "{filed:?}");
    assert!(on.b.is_filed(&tenant(), "k").await.unwrap());
    assert!(!on.b.is_filed(&other(), "k").await.unwrap());
    let (_, fingerprint) = on.b.filed_under(&tenant(), "k").await.unwrap().unwrap();
    assert_eq!(fingerprint, "one");
}

async fn the_queue_is_never_longer_than_its_limit(on: &Stores) {
    let volume = on.volume(&tenant()).await;
    let job = new_job(&volume);
    let filing = (0..24).map(|n| {
        let store = if n % 2 == 0 { &on.a } else { &on.b };
        store.file(&job, 10, now())
    });
    let filed = futures::future::join_all(filing).await;
    let new = filed
        .iter()
        .filter(|f| matches!(f, Ok(Filed::New(_))))
        .count();
    let full = filed
        .iter()
        .filter(|f| matches!(f, Ok(Filed::QueueFull)))
        .count();
    assert_eq!((new, full), (10, 14));
    let missing =
        on.b.file(&new_job("vol_missing"), 1000, now())
            .await
            .unwrap();
    assert!(matches!(missing, Filed::Missing { field, .. } if field == "volume"));
    let needs = [("model".to_owned(), "mdl_missing".to_owned())].into();
    let job = NewJob {
        needs,
        ..new_job(&volume)
    };
    let missing = on.b.file(&job, 1000, now()).await.unwrap();
    assert!(matches!(missing, Filed::Missing { field, .. } if field == "model"));
}

async fn no_job_is_filed_on_what_is_erased(on: &Stores) {
    let mut both = [0, 0];
    for _ in 0..12 {
        let volume = on.volume(&tenant()).await;
        let (job, order) = (new_job(&volume), erasure(&volume, false));
        let expected = [volume.clone()];
        let (filed, erased) = tokio::join!(
            on.a.file(&job, 1000, now()),
            on.b.erase(&order, &expected, now())
        );
        match (filed.unwrap(), erased.unwrap()) {
            (Filed::New(_), Erased::InUse) => both[0] += 1,
            (Filed::Missing { .. }, Erased::Done(_)) => both[1] += 1,
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(both[0] + both[1], 12);
}

async fn jobs_end_in_every_way(on: &Stores) {
    let volume = on.volume(&tenant()).await;
    let limit = DeathLimit {
        deaths: 2,
        reason: failure("attempt-limit"),
    };
    // Cancelled while it waits; asked while it runs.
    let waiting = on.file(&new_job(&volume)).await;
    let cancelled = on.b.interrupt(&waiting.id, now()).await.unwrap();
    assert!(matches!(cancelled, Interrupted::Cancelled(job) if job.finished_at.is_some()));
    on.file(&new_job(&volume)).await;
    let (job, lease) = on.claim().await.unwrap();
    let told =
        on.b.progress(&lease, "surface", 0.5)
            .await
            .unwrap()
            .unwrap();
    let told = (told.stage.as_deref(), told.progress);
    assert_eq!(told, (Some("surface"), 0.5));
    let back =
        on.b.progress(&lease, "retile", 0.25)
            .await
            .unwrap()
            .unwrap();
    assert_eq!(back.progress, 0.5, "progress never goes back");
    assert_eq!(
        on.a.delete_job(&job.id, None, now()).await.unwrap(),
        Deleted::InUse
    );
    let asked = on.a.interrupt(&job.id, now()).await.unwrap();
    assert!(matches!(asked, Interrupted::Asked(job) if job.cancel_requested));
    assert_eq!(
        on.b.renew_lease(&lease, SHORT_LEASE, now()).await.unwrap(),
        Some(true)
    );
    let ended = on.b.hand_back(&lease, now()).await.unwrap().unwrap();
    assert_eq!(ended.state, JobState::Cancelled);
    let late = on.a.interrupt(&job.id, now()).await.unwrap();
    assert!(matches!(late, Interrupted::Finished(_)));
    assert!(matches!(
        on.a.interrupt("job_x", now()).await.unwrap(),
        Interrupted::Unknown
    ));
    // Crashed up to the limit.
    let job = on.file(&new_job(&volume)).await;
    for state in [JobState::Queued, JobState::Failed] {
        let (_, lease) = on.claim().await.unwrap();
        let left = on.b.crashed(&lease, &limit, now()).await.unwrap().unwrap();
        assert_eq!(left.state, state);
    }
    let failed = on.a.job(&job.id).await.unwrap().unwrap();
    assert_eq!(
        (failed.crashes, failed.failure.unwrap().code),
        (2, "attempt-limit".into())
    );
    // Handed back, and abandoned by a worker that does not know what it claimed.
    let job = on.file(&new_job(&volume)).await;
    let (_, lease) = on.claim().await.unwrap();
    let back = on.b.hand_back(&lease, now()).await.unwrap().unwrap();
    assert_eq!(
        (back.state, back.attempts, back.started_at),
        (JobState::Queued, 0, None)
    );
    let (_, lease) = on.claim().await.unwrap();
    assert_eq!(
        on.b.abandon(&lease.token).await.unwrap().unwrap().attempts,
        0
    );
    assert!(on.b.abandon(&lease.token).await.unwrap().is_none());
    // Failed, and deleted.
    let (_, lease) = on.claim().await.unwrap();
    let outcome = JobOutcome::Failed(failure("no-heart").at("volume"));
    on.b.finish(&lease, &outcome, now()).await.unwrap().unwrap();
    let by = ErasureAgent::retention();
    for (deleted, rows) in [(Deleted::Done, 1), (Deleted::Unknown, 1)] {
        let done = on.a.delete_job(&job.id, Some(&by), now()).await.unwrap();
        assert_eq!(done, deleted);
        assert_eq!(rows_about(&on.b, &job.id).await, rows);
    }
    assert!(on.b.erased_at(&tenant(), &job.id).await.unwrap().is_some());
    // Interrupted by the death of the service up to the limit.
    on.file(&new_job(&volume)).await;
    for state in [JobState::Queued, JobState::Failed] {
        on.claim().await.unwrap();
        let released = on.a.release_dead(None, Some(&limit), now()).await.unwrap();
        assert_eq!(released[0].state, state);
    }
    assert!(on.claim().await.is_none());
    on.a.check().await.unwrap();
    assert_eq!(on.a.is_shared(), on.url.is_some());
}

async fn holds_keep_what_they_name(on: &Stores) {
    let volume = on.volume(&tenant()).await;
    let result = model(&volume);
    let owner = tenant();
    let added = on.a.add_product(&result, &owner, Some(&volume), AMPLE_ROOM);
    assert_eq!(added.await.unwrap(), AddedProduct::New);
    let hold = LegalHold {
        reason: "a trial".into(),
        since: now(),
        by: "somebody".into(),
    };
    assert!(
        on.a.set_legal_hold(&tenant(), &volume, Some(&hold))
            .await
            .unwrap()
    );
    assert!(
        !on.a
            .set_legal_hold(&other(), &volume, Some(&hold))
            .await
            .unwrap()
    );
    let held = on.b.volume(&tenant(), &volume).await.unwrap().unwrap();
    assert_eq!(held.ownership.legal_hold, Some(hold));
    let made = on.b.product(&tenant(), &result.id).await.unwrap().unwrap();
    assert!(made.ownership.source_on_hold);
    for id in [&volume, &result.id] {
        let expected = [id.clone()];
        let erased =
            on.b.erase(&erasure(id, false), &expected, now())
                .await
                .unwrap();
        assert_eq!(erased, Erased::OnHold { id: volume.clone() });
    }
    assert!(!on.b.erase_scan(&tenant(), &volume, now()).await.unwrap());
    for kind in Resource::ALL {
        let expired = on.b.expired(kind, cutoff(i64::MAX), None, 100);
        assert!(expired.await.unwrap().is_empty(), "{kind:?}");
    }
    assert!(on.a.set_legal_hold(&tenant(), &volume, None).await.unwrap());
    let expected = [volume.clone()];
    let unexpected =
        on.b.erase(&erasure(&volume, true), &expected, now())
            .await
            .unwrap();
    assert_eq!(
        unexpected,
        Erased::InUse,
        "something goes that nobody has locked"
    );
    assert_eq!(
        on.b.made_of(&tenant(), &volume).await.unwrap(),
        std::slice::from_ref(&result.id)
    );
}

async fn erasures_leave_receipts(on: &Stores) {
    let volume = on.volume(&tenant()).await;
    on.file(&new_job(&volume)).await;
    let (job, lease) = on.claim().await.unwrap();
    let result = model(&volume);
    on.b.finish(&lease, &succeeded(&result), now())
        .await
        .unwrap()
        .unwrap();
    let fit = NewJob {
        needs: [("expert".to_owned(), volume.clone())].into(),
        ..new_job(&on.volume(&tenant()).await)
    };
    let needing = on.file(&fit).await;
    let expected = [volume.clone(), result.id.clone()];
    let needed =
        on.a.erase(&erasure(&volume, true), &expected, now())
            .await
            .unwrap();
    assert_eq!(needed, Erased::InUse);
    on.a.interrupt(&needing.id, now()).await.unwrap();
    let erased =
        on.a.erase(&erasure(&volume, true), &expected, now())
            .await
            .unwrap();
    let Erased::Done(receipt) = erased else {
        panic!("{erased:?}")
    };
    assert!(receipt.items.iter().all(|item| item.files_erased));
    assert_eq!(receipt.items.len(), 2);
    let mut jobs = [job.id.clone(), needing.id];
    jobs.sort();
    assert_eq!(receipt.jobs, jobs);
    for id in [&volume, &result.id, &job.id] {
        assert!(on.b.erased_at(&tenant(), id).await.unwrap().is_some());
        assert!(on.b.erased_at(&other(), id).await.unwrap().is_none());
        assert!(on.b.was_erased(id).await.unwrap());
    }
    assert_eq!(
        on.b.receipt_within(&tenant(), &receipt.id, u64::MAX)
            .await
            .unwrap(),
        Bounded::Read((*receipt).clone())
    );
    let listed = on.b.receipts(&tenant(), Some(&volume), ALL).await.unwrap();
    assert_eq!(listed.items, [*receipt]);
    assert!(verify(&*on.a).await.unwrap().broken.is_none());
    let again =
        on.a.erase(&erasure(&volume, false), &expected, now())
            .await
            .unwrap();
    assert_eq!(again, Erased::Unknown);
    // It can come back.
    let (tags, scan) = (Tags::default(), None);
    assert!(
        on.a.renew_volume(&tenant(), &volume, &tags, scan, now())
            .await
            .unwrap()
            .is_none()
    );
    let back = stored_volume(&volume, 7);
    assert!(
        on.a.add_volume(&back, &tenant(), &tags, scan)
            .await
            .unwrap()
    );
    assert!(on.b.erased_at(&tenant(), &volume).await.unwrap().is_none());
    assert!(on.a.overwrite_erased().await.is_ok());
}

fn scan_erasure(of: [(&str, &str); 1], cascade: bool) -> ScanErasureOrder {
    let value = |name: &str| of.iter().find(|one| one.0 == name).map(|one| one.1.into());
    ScanErasureOrder {
        tenant: tenant(),
        selection: ScanSelection {
            patient: value("patient"),
            study: value("study"),
            series: value("series"),
            accession: value("accession"),
        },
        cascade,
        only_plan: None,
        by: ErasureAgent {
            name: "somebody".into(),
            ..ErasureAgent::default()
        },
    }
}

/// The volumes of a patient go in one transaction with all that was made of them, or not at all.
async fn scans_are_erased_together(on: &Stores) {
    let owner = tenant();
    let scan = |series: &str| {
        let fields = json!({"patient_id": "PAT_1%", "study_uid": "1.2", "series_uid": series,
            "accession_number": "A 7"});
        ScanFields(object(fields))
    };
    let mut volumes = Vec::new();
    for series in ["1.2.1", "1.2.2"] {
        let id = random_id(Resource::Volume.prefix());
        let volume = stored_volume(&id, 1_000);
        let (tags, scan) = (Tags::default(), scan(series));
        for owner in [tenant(), other()] {
            let added = on.a.add_volume(&volume, &owner, &tags, Some(&scan));
            assert!(added.await.unwrap());
        }
        volumes.push(id);
    }
    // Of the same patient, as the tenant says; and of another one, whose ID matches as a pattern only.
    for patient in ["PAT_1%", "PATS12"] {
        let id = on.volume(&tenant()).await;
        let stated = ScanFields(object(json!({"patient_id": patient, "study_uid": "1.3"})));
        assert!(on.a.state_scan(&tenant(), &id, &stated).await.unwrap());
        volumes.push(id);
    }
    let [first, second, stated, stranger] = &volumes[..] else {
        panic!("{volumes:?}")
    };
    on.file(&new_job(first)).await;
    let (job, lease) = on.claim().await.unwrap();
    let result = model(first);
    on.b.finish(&lease, &succeeded(&result), now())
        .await
        .unwrap()
        .unwrap();
    // A comparison of the first with a volume of somebody else.
    let compared = product(
        random_id(Resource::Comparison.prefix()),
        Some(first.as_str()),
    );
    for source in [first, stranger] {
        let added =
            on.a.add_product(&compared, &owner, Some(source), AMPLE_ROOM);
        added.await.unwrap();
    }

    let by = |name, value, cascade| scan_erasure([(name, value)], cascade);
    let order = by("patient", "PAT_1%", true);
    let plan = async |order: &ScanErasureOrder| on.b.plan_scan_erasure(order).await.unwrap();
    let sorted = |ids: &[&String]| {
        let mut ids: Vec<String> = ids.iter().map(|id| (*id).clone()).collect();
        ids.sort();
        ids
    };
    for (name, value, found) in [
        ("patient", "PAT_1%", sorted(&[first, second, stated])),
        ("patient", "pat_1%", vec![]),
        ("patient", "PAT", vec![]),
        ("study", "1.2", sorted(&[first, second])),
        ("study", "1.3", sorted(&[stated, stranger])),
        ("series", "1.2.2", sorted(&[second])),
        ("accession", "A 7", sorted(&[first, second])),
    ] {
        assert_eq!(
            plan(&by(name, value, true)).await.volumes,
            found,
            "{name} {value}"
        );
    }
    let nothing = ScanErasureOrder {
        selection: ScanSelection::default(),
        ..order.clone()
    };
    assert_eq!(plan(&nothing).await.volumes, Vec::<String>::new());
    let planned = plan(&order).await;
    let items: Vec<String> = planned.items.iter().map(|item| item.id.clone()).collect();
    let mut expected = sorted(&[first, second, stated]);
    expected.extend(sorted(&[&result.id, &compared.id]));
    assert_eq!(items, expected);
    assert_eq!(planned.jobs, std::slice::from_ref(&job.id));
    assert!(planned.is_free() && planned.unread == 0, "{planned:?}");
    let alone = plan(&by("patient", "PAT_1%", false)).await;
    assert_eq!((alone.items.len(), alone.jobs.len()), (3, 0));

    // Kept as a whole, with all that is in the way.
    let hold = LegalHold {
        reason: "a trial".into(),
        since: now(),
        by: "somebody".into(),
    };
    let set = on.a.set_legal_hold(&owner, stranger, Some(&hold));
    assert!(set.await.unwrap());
    let waiting = NewJob {
        needs: [("expert".to_owned(), second.clone())].into(),
        ..new_job(stranger)
    };
    let waiting = on.file(&waiting).await;
    let erase = async |order: &ScanErasureOrder, expected: &[String]| {
        on.b.erase_scans(order, expected, now()).await.unwrap()
    };
    let ScansErased::Kept(kept) = erase(&order, &items).await else {
        panic!("a hold and a job keep it")
    };
    assert_eq!(kept.holds, std::slice::from_ref(stranger));
    assert_eq!(kept.unfinished_jobs, std::slice::from_ref(&waiting.id));
    on.a.interrupt(&waiting.id, now()).await.unwrap();
    on.a.set_legal_hold(&tenant(), stranger, None)
        .await
        .unwrap();
    let differing = ScanErasureOrder {
        only_plan: Some(planned.tag()),
        ..order.clone()
    };
    let differs = erase(&differing, &items).await;
    assert!(
        matches!(differs, ScansErased::Differs(_)),
        "a job ended since"
    );
    let unexpected = erase(&order, &items[1..]).await;
    assert_eq!(unexpected, ScansErased::Changed, "nobody has locked it");
    for id in &volumes {
        assert!(on.b.volume(&tenant(), id).await.unwrap().is_some());
    }

    let differing = ScanErasureOrder {
        only_plan: Some(plan(&order).await.tag()),
        ..order.clone()
    };
    let ScansErased::Done(receipt) = erase(&differing, &items).await else {
        panic!("nothing is in the way")
    };
    let erased: Vec<String> = receipt.items.iter().map(|item| item.id.clone()).collect();
    assert_eq!(erased, expected);
    assert_eq!(receipt.jobs, sorted(&[&job.id, &waiting.id]));
    assert_eq!(receipt.selected_by, ["patient"]);
    let shared = |id: &String| id == first || id == second;
    for item in &receipt.items {
        assert_eq!(item.files_erased, !shared(&item.id), "{}", item.id);
        assert!(on.b.erased_at(&tenant(), &item.id).await.unwrap().is_some());
        let listed = on.b.receipts(&tenant(), Some(&item.id), ALL).await.unwrap();
        assert_eq!(listed.items, std::slice::from_ref(&*receipt), "{}", item.id);
    }
    let read = on.b.receipt_within(&tenant(), &receipt.id, u64::MAX).await;
    assert_eq!(read.unwrap(), Bounded::Read((*receipt).clone()));
    for none in ["vol_", "vol\"", "id", "%"] {
        let listed = on.b.receipts(&tenant(), Some(none), ALL).await.unwrap();
        assert!(listed.items.is_empty(), "{none}");
    }
    // The trail names each volume, and nothing names the patient.
    for id in sorted(&[first, second, stated]) {
        let filter = AuditFilter {
            object: Some(id.clone()),
            ..AuditFilter::default()
        };
        let rows = on.b.audit(&filter, ALL).await.unwrap().items;
        assert_eq!(rows.len(), 1, "{id}");
    }
    assert!(verify(&*on.a).await.unwrap().broken.is_none());
    let text = serde_json::to_string(&*receipt).unwrap();
    assert!(!text.contains("PAT_1"), "{text}");
    // Others keep what is theirs, and who erases again finds nothing.
    assert!(on.b.volume(&other(), first).await.unwrap().is_some());
    assert!(on.b.volume(&tenant(), stranger).await.unwrap().is_some());
    let ScansErased::Kept(none) = erase(&order, &items).await else {
        panic!("there is none")
    };
    assert!(none.volumes.is_empty());
}

async fn old_things_expire(on: &Stores) {
    let volume = on.volume(&tenant()).await;
    on.file(&new_job(&volume)).await;
    let (job, lease) = on.claim().await.unwrap();
    let result = model(&volume);
    on.b.finish(&lease, &succeeded(&result), now())
        .await
        .unwrap()
        .unwrap();
    let other_volume = on.volume(&other()).await;
    let expired = async |kind, before| {
        let mut found = Vec::new();
        // Page by page.
        loop {
            let page = on.a.expired(kind, before, found.last(), 1).await.unwrap();
            assert!(page.len() <= 1);
            if page.is_empty() {
                break;
            }
            found.extend(page);
        }
        let whole = on.b.expired(kind, before, None, 100).await.unwrap();
        assert_eq!(whole, found);
        assert!(found.is_sorted_by_key(|one| (one.since, one.sequence)));
        found.into_iter().map(|one| one.id).collect::<Vec<_>>()
    };
    let (past, future) = (cutoff(now() - 60_000), cutoff(now() + 60_000));
    for (kind, ids) in [
        (Resource::Volume, &[&volume, &other_volume][..]),
        (Resource::Model, &[&result.id]),
        (Resource::Segmentation, &[]),
        (Resource::Job, &[&job.id]),
    ] {
        assert!(expired(kind, past).await.is_empty());
        let found: BTreeSet<String> = expired(kind, future).await.into_iter().collect();
        assert_eq!(found, ids.iter().map(|id| (*id).clone()).collect());
    }
    let load = on.a.load().await.unwrap();
    assert!(load.mean_duration_ms.is_some_and(|mean| mean >= 0.0));
}

async fn a_page_is_planned_by_the_bytes_of_its_rows(on: &Stores) {
    let owner: Tenant = "pages".parse().unwrap();
    let large = PAGE_BYTES as usize / 2 + 1;
    let mut ids = Vec::new();
    for size in [large, 10, large, large] {
        let volume = StoredVolume {
            facts: json!({"text": "x".repeat(size)}),
            ..stored_volume(&random_id(Resource::Volume.prefix()), 1)
        };
        let added =
            on.a.add_volume(&volume, &owner, &Tags::default(), None)
                .await;
        assert!(added.unwrap());
        ids.push(volume.id);
    }
    let filter = ItemFilter::default();
    let (mut asked, mut found, mut counts) = (ALL, Vec::new(), Vec::new());
    loop {
        let plan = on.b.plan_items(&owner, Resource::Volume, &filter, asked);
        let plan = plan.await.unwrap();
        let page = on.b.volumes(&owner, &filter, plan.page).await.unwrap();
        assert!(plan.bytes as usize > large);
        counts.push(page.items.len());
        found.extend(page.items.iter().map(|volume| volume.id.clone()));
        match page.next {
            Some(next) => asked.before = Some(next),
            None => break,
        }
    }
    // The newest first, and as many on a page as fit.
    assert_eq!(counts, [1, 2, 1]);
    ids.reverse();
    assert_eq!(found, ids);
    let none = on.b.plan_receipts(&owner, None, ALL).await.unwrap();
    assert_eq!(none.bytes, 0);
    let jobs = JobFilter {
        tenant: owner.clone(),
        ..JobFilter::default()
    };
    assert_eq!(on.b.plan_jobs(&jobs, ALL).await.unwrap().bytes, 0);
    on.file(&NewJob {
        tenant: owner,
        ..new_job(&ids[0])
    })
    .await;
    assert!(on.b.plan_jobs(&jobs, ALL).await.unwrap().bytes > 2048);
}

/// One row of each kind whose size a client chooses: told to be larger, read as soon as there is room for all of it, and
/// seen by its tenant alone.
async fn a_row_is_read_within_its_bytes(on: &Stores) {
    const TEXT: usize = 50_000;
    const LEAST: u64 = TEXT as u64;
    /// The bytes that a row is told to have by a reader with room for fewer.
    fn size<T: std::fmt::Debug>(read: Bounded<T>) -> u64 {
        match read {
            Bounded::Larger(bytes) => bytes,
            other => panic!("{other:?}"),
        }
    }
    fn is_read<T>(read: Bounded<T>) -> bool {
        matches!(read, Bounded::Read(_))
    }
    let long = "\u{e4}".repeat(TEXT / 2);
    let (store, own, other) = (&on.b, tenant(), other());
    // A volume by what was found in its file.
    let id = random_id(Resource::Volume.prefix());
    let mut volume = stored_volume(&id, 1_000);
    volume.facts = json!({"found": long});
    let untagged = Tags::default();
    let added = on.a.add_volume(&volume, &own, &untagged, None);
    assert!(added.await.unwrap());
    let bytes = size(store.volume_within(&own, &id, LEAST).await.unwrap());
    assert!((LEAST..LEAST + 1_000).contains(&bytes), "{bytes}");
    assert_eq!(
        size(store.volume_within(&own, &id, bytes - 1).await.unwrap()),
        bytes
    );
    assert!(is_read(
        store.volume_within(&own, &id, bytes).await.unwrap()
    ));
    let missing = store.volume_within(&other, &id, bytes).await.unwrap();
    assert!(matches!(missing, Bounded::Missing));
    // A product by its parameters.
    let mut product = model(&id);
    product.parameters = object(json!({"cases": long}));
    on.a.add_product(&product, &own, None, AMPLE_ROOM)
        .await
        .unwrap();
    let bytes = size(
        store
            .product_within(&own, &product.id, LEAST)
            .await
            .unwrap(),
    );
    assert!((LEAST..LEAST + 1_000).contains(&bytes), "{bytes}");
    let read = store.product_within(&own, &product.id, bytes);
    assert!(is_read(read.await.unwrap()));
    let missing = store.product_within(&other, &product.id, bytes);
    assert!(matches!(missing.await.unwrap(), Bounded::Missing));
    // A job by its parameters.
    let job = on
        .file(&NewJob {
            parameters: object(json!({"cases": "x".repeat(TEXT)})),
            ..new_job(&id)
        })
        .await;
    let bytes = size(store.job_within(&job.id, LEAST).await.unwrap());
    assert!((LEAST..LEAST + 3_000).contains(&bytes), "{bytes}");
    assert!(is_read(store.job_within(&job.id, bytes).await.unwrap()));
    let missing = store.job_within("job_0", bytes).await.unwrap();
    assert!(matches!(missing, Bounded::Missing));
    // A work item.
    on.a.add_workitem(&workitem("1.7.2", &long), 10)
        .await
        .unwrap();
    let bytes = size(store.workitem_within(&own, "1.7.2", LEAST).await.unwrap());
    assert!((LEAST..LEAST + 1_000).contains(&bytes), "{bytes}");
    let read = store.workitem_within(&own, "1.7.2", bytes);
    assert!(is_read(read.await.unwrap()));
    let missing = store.workitem_within(&other, "1.7.2", bytes);
    assert!(matches!(missing.await.unwrap(), Bounded::Missing));
    // A receipt.
    on.a.interrupt(&job.id, now()).await.unwrap();
    let expected = [id.clone(), product.id.clone()];
    let cascading = erasure(&id, true);
    let erased = on.a.erase(&cascading, &expected, now());
    let Erased::Done(receipt) = erased.await.unwrap() else {
        panic!("the volume is in use");
    };
    let bytes = size(store.receipt_within(&own, &receipt.id, 10).await.unwrap());
    let read = store.receipt_within(&own, &receipt.id, bytes);
    assert_eq!(read.await.unwrap(), Bounded::Read(*receipt.clone()));
    let missing = store.receipt_within(&other, &receipt.id, bytes);
    assert!(matches!(missing.await.unwrap(), Bounded::Missing));
}

async fn lists_find_by_tags_and_scans(on: &Stores) {
    let tags = |name: &str| Tags {
        external_id: Some(name.into()),
        labels: [("ward".to_owned(), name.to_owned())].into(),
    };
    let scan = |study: &str| ScanFields(object(json!({"study_uid": study, "series_uid": "1.2.9"})));
    let mut ids = Vec::new();
    for name in ["é", "b", "c"] {
        let id = random_id(Resource::Volume.prefix());
        let volume = stored_volume(&id, 1);
        let scan = scan(&format!("1.2.{name}"));
        on.a.add_volume(&volume, &tenant(), &tags(name), Some(&scan))
            .await
            .unwrap();
        on.file(&NewJob {
            tags: tags(name),
            ..new_job(&id)
        })
        .await;
        ids.push(id);
    }
    let page = |before| ListRequest { before, limit: 2 };
    let filter = ItemFilter::default();
    let first = on.b.volumes(&tenant(), &filter, page(None)).await.unwrap();
    let second =
        on.b.volumes(&tenant(), &filter, page(first.next))
            .await
            .unwrap();
    let listed: Vec<_> = first
        .items
        .iter()
        .chain(&second.items)
        .map(|v| &v.id)
        .collect();
    assert_eq!(listed, ids.iter().rev().collect::<Vec<_>>());
    assert_eq!(second.next, None);
    let tag_filter = |name: &str| TagFilter {
        external_id: Some(name.into()),
        labels: [("ward".to_owned(), name.to_owned())].into(),
    };
    let scan_filter = |study: &str| ScanFilter {
        study: Some(study.into()),
        series: Some("1.2.9".into()),
        accession: None,
    };
    let both = ItemFilter {
        tags: tag_filter("é"),
        scan: scan_filter("1.2.é"),
        ..ItemFilter::default()
    };
    let found = on.b.volumes(&tenant(), &both, ALL).await.unwrap();
    assert_eq!(found.items.len(), 1);
    assert_eq!(found.items[0].id, ids[0]);
    assert!(
        on.b.volumes(&other(), &both, ALL)
            .await
            .unwrap()
            .items
            .is_empty()
    );
    let jobs = JobFilter {
        state: Some(JobState::Queued),
        kind: Some("model".into()),
        volume: Some(ids[1].clone()),
        tags: tag_filter("b"),
        scan: scan_filter("1.2.b"),
        created_after: Some(0),
        ..JobFilter::default()
    };
    let found = on.b.jobs(&jobs, ALL).await.unwrap();
    assert_eq!(found.items.len(), 1);
    assert_eq!(found.items[0].tags, tags("b"));
    // New tags replace the old ones.
    let job = &found.items[0].id;
    let none = Tags::default();
    for (id, name) in [(&ids[0], "é"), (job, "b")] {
        let change = async |tenant: &Tenant, before: &Tags, after: &Tags| {
            let changed = on.a.change_tags(tenant, id, before, after).await;
            changed.unwrap()
        };
        assert!(!change(&other(), &tags(name), &tags("new")).await);
        // Not if they have changed in between.
        assert!(!change(&tenant(), &tags("c"), &tags("new")).await);
        assert!(!change(&tenant(), &none, &tags("new")).await);
        assert!(change(&tenant(), &tags(name), &none).await);
        assert!(!change(&tenant(), &tags(name), &tags("new")).await);
        assert!(change(&tenant(), &none, &tags("new")).await);
    }
    assert!(
        on.b.volumes(&tenant(), &both, ALL)
            .await
            .unwrap()
            .items
            .is_empty()
    );
    let new = ItemFilter {
        tags: tag_filter("new"),
        ..ItemFilter::default()
    };
    assert_eq!(
        on.b.volumes(&tenant(), &new, ALL)
            .await
            .unwrap()
            .items
            .len(),
        1
    );
    let template = product(random_id(Resource::Template.prefix()), None);
    on.a.add_product(&template, &tenant(), Some(&ids[0]), AMPLE_ROOM)
        .await
        .unwrap();
    assert!(
        on.a.set_library(&tenant(), &template.id, true)
            .await
            .unwrap()
    );
    assert!(!on.a.set_library(&tenant(), &ids[0], true).await.unwrap());
    let listed =
        on.b.products(&tenant(), Resource::Template, &filter, ALL)
            .await
            .unwrap();
    assert!(listed.items[0].ownership.library);
    let of_scan = ItemFilter {
        scan: scan_filter("1.2.é"),
        ..ItemFilter::default()
    };
    let listed =
        on.b.products(&tenant(), Resource::Template, &of_scan, ALL)
            .await
            .unwrap();
    assert_eq!(
        listed.items.len(),
        1,
        "it was made of a volume of that scan"
    );
}

async fn identities_are_kept_and_erased(on: &Stores) {
    let volume = on.volume(&tenant()).await;
    let fields = |value: Value| ScanFields(object(value));
    let found = fields(json!({"study_uid": "1.2.\u{0}3", "patient_name": "A\u{0}B"}));
    let unread = on.volume(&other()).await;
    let stated = fields(json!({"accession_number": "77"}));
    assert!(on.a.state_scan(&tenant(), &volume, &stated).await.unwrap());
    assert!(!on.a.state_scan(&other(), &volume, &stated).await.unwrap());
    let tags = Tags::default();
    assert!(on.a.erase_scan(&tenant(), &volume, now()).await.unwrap());
    let scan = on.b.scan(&tenant(), &volume).await.unwrap().unwrap();
    assert!(scan.is_empty() && scan.erased_at.is_some());
    // Another upload ends the erasure.
    let scan = Some(&found);
    let renewed =
        on.a.renew_volume(&tenant(), &volume, &tags, scan, now())
            .await;
    let (held, new) = renewed.unwrap().unwrap();
    assert!(!new && held.ownership.scan.erased_at.is_none());
    assert_eq!(held.ownership.scan.found, Some(found.clone()));
    on.a.note_scan(&other(), &unread, Some(&found))
        .await
        .unwrap();
    let scan = on.b.scan(&other(), &unread).await.unwrap().unwrap();
    assert_eq!(
        scan.found, None,
        "the upload noted that its file says nothing"
    );
    let secret = on.a.deidentification_secret(&tenant()).await.unwrap();
    assert_eq!(secret.len(), 32);
    assert_eq!(
        on.b.deidentification_secret(&tenant()).await.unwrap(),
        secret
    );
    assert_ne!(
        on.b.deidentification_secret(&other()).await.unwrap(),
        secret
    );
}

async fn items_are_shared_by_tenants(on: &Stores) {
    let volume = on.volume(&tenant()).await;
    let (tags, scan) = (Tags::default(), None);
    let (_, new) =
        on.a.renew_volume(&other(), &volume, &tags, scan, now())
            .await
            .unwrap()
            .unwrap();
    assert!(new);
    let expected = [volume.clone()];
    let erased =
        on.b.erase(&erasure(&volume, false), &expected, now())
            .await
            .unwrap();
    let Erased::Done(receipt) = erased else {
        panic!("{erased:?}")
    };
    assert!(!receipt.items[0].files_erased, "the other tenant has it");
    assert!(on.b.volume(&tenant(), &volume).await.unwrap().is_none());
    assert!(on.b.volume(&other(), &volume).await.unwrap().is_some());
    let record = on.b.record(&volume).await.unwrap().unwrap();
    let ItemRecord::Volume(mut amended) = record else {
        panic!("{record:?}")
    };
    amended.facts = json!({"amended": true});
    on.a.amend(&ItemRecord::Volume(amended.clone()))
        .await
        .unwrap();
    let page = on.b.records(Resource::Volume, 0, 10).await.unwrap();
    assert_eq!(page, [ItemRecord::Volume(amended)]);
    let template = product(random_id(Resource::Template.prefix()), None);
    on.a.add_product(&template, &tenant(), None, AMPLE_ROOM)
        .await
        .unwrap();
    on.a.amend(&ItemRecord::Product(template.clone()))
        .await
        .unwrap();
    assert_eq!(on.b.records(Resource::Model, 0, 10).await.unwrap().len(), 1);
    let asked = [volume.clone(), template.id.clone(), "mdl_no".into()];
    let known = on.b.known(&asked).await.unwrap();
    assert_eq!(known, BTreeSet::from([volume, template.id]));
    assert!(on.a.defects().await.unwrap().is_empty());
    assert_eq!(on.a.version().is_some(), on.url.is_none());
}

async fn the_audit_trail_is_one_chain(on: &Stores) {
    let event = |n: i64| {
        AuditEvent::new(n, Activity::Read, tenant(), "somebody".into()).on(format!("vol_{n}"))
    };
    // The oldest comes first. The order of the others is not known.
    on.a.append(&[event(0), event(1)]).await.unwrap();
    let appending = (1..20).map(|n| {
        let store = if n % 2 == 0 { &on.a } else { &on.b };
        async move { store.append(&[event(2 * n), event(2 * n + 1)]).await }
    });
    for appended in futures::future::join_all(appending).await {
        appended.unwrap();
    }
    let report = verify(&*on.b).await.unwrap();
    assert_eq!((report.rows, report.broken), (40, None));
    let filter = AuditFilter {
        tenant: Some(tenant()),
        agent: Some("somebody".into()),
        object: Some("vol_7".into()),
        since: Some(7),
        until: Some(8),
    };
    assert_eq!(on.b.audit(&filter, ALL).await.unwrap().items.len(), 1);
    for forbidden in [
        "UPDATE audit SET event = '{}'",
        "DELETE FROM audit",
        "INSERT INTO audit_anchors (sequence, hash, pruned_at) VALUES (1, 'x', 0)",
    ] {
        assert!(!on.tamper(forbidden).await, "{forbidden}");
    }
    assert!(on.a.prune(cutoff(20), 30).await.unwrap() > 0);
    assert!(verify(&*on.b).await.unwrap().broken.is_none());
    assert!(!on.tamper("DELETE FROM audit_anchors").await);
    assert!(!on.tamper("UPDATE audit_anchors SET pruned_at = 0").await);
    // Rows cut off the end are missed.
    let cut = match on.url {
        Some(_) => {
            "DROP TRIGGER audit_is_removed_up_to_an_anchor ON audit;
             DELETE FROM audit WHERE sequence = (SELECT max(sequence) FROM audit)"
        }
        None => {
            "DROP TRIGGER audit_is_removed_up_to_an_anchor;
             DELETE FROM audit WHERE sequence = (SELECT max(sequence) FROM audit)"
        }
    };
    assert!(on.tamper(cut).await);
    assert!(verify(&*on.b).await.unwrap().broken.is_some());
}

async fn keys_are_kept(on: &Stores) {
    assert!(!on.a.is_closed().await.unwrap());
    let request = KeyRequest {
        name: "ward".into(),
        tenant: other(),
        scope: Scope::Submit,
        quota: Quota {
            requests: Some(5),
            bytes: None,
            jobs: Some(1),
        },
        maker: Maker::Caller(Some("0123456789abcdef".into())),
        owner: Some("dr-who".into()),
        expires_at: Some(i64::MAX),
    };
    let (key, _) = ApiKey::make(request, now()).unwrap();
    let event = AuditEvent::new(now(), Activity::KeyCreated, other(), "somebody".into());
    on.a.add_key(&key, &event).await.unwrap();
    assert!(on.b.is_closed().await.unwrap());
    let stored = on.b.key(&key.id).await.unwrap().unwrap();
    assert_eq!(
        (stored.digest, stored.quota, stored.maker),
        (key.digest.clone(), key.quota, key.maker.clone())
    );
    assert_eq!(on.b.keys(Some(&other()), ALL).await.unwrap().items.len(), 1);
    assert_eq!(
        on.b.keys(Some(&tenant()), ALL).await.unwrap().items.len(),
        0
    );
    assert_eq!(on.b.keys(None, ALL).await.unwrap().items.len(), 1);
    for _ in 0..2 {
        assert!(on.b.revoke_key(&key.id, now(), &event).await.unwrap());
    }
    assert!(!on.b.revoke_key("none", now(), &event).await.unwrap());
    assert!(
        on.a.key(&key.id)
            .await
            .unwrap()
            .unwrap()
            .revoked_at
            .is_some()
    );
    assert_eq!(verify(&*on.a).await.unwrap().rows, 2);
    let volume = on.volume(&other()).await;
    on.file(&NewJob {
        tenant: other(),
        ..new_job(&volume)
    })
    .await;
    let usage = on.b.usage(&other()).await.unwrap();
    assert_eq!(usage.jobs, 1);
    assert!((3000..4000).contains(&usage.bytes), "{}", usage.bytes);
    // A key that works closes what the operator has opened, though nothing else says so.
    let opened = self::event(Activity::AccessOpened);
    assert!(on.a.open_access(now(), &opened).await.unwrap());
    assert!(!on.b.is_closed().await.unwrap());
    assert!(on.tamper("UPDATE api_keys SET revoked_at = NULL").await);
    assert!(on.b.is_closed().await.unwrap());
}

async fn keys_of_an_owner_are_revoked_together(on: &Stores) {
    let make = async |owner: Option<&str>, tenant: Tenant| {
        let request = KeyRequest {
            name: "made".into(),
            tenant,
            scope: Scope::Read,
            quota: Quota::default(),
            maker: Maker::Caller(None),
            owner: owner.map(str::to_owned),
            expires_at: None,
        };
        let (key, _) = ApiKey::make(request, now()).unwrap();
        let event = event(Activity::KeyCreated);
        on.a.add_key(&key, &event).await.unwrap();
        key.id
    };
    let mut own = [
        make(Some("dr-who"), tenant()).await,
        make(Some("dr-who"), tenant()).await,
    ];
    own.sort();
    let elsewhere = make(Some("dr-who"), other()).await;
    for kept in [Some("dr-no"), None] {
        make(kept, tenant()).await;
    }
    let rows = verify(&*on.a).await.unwrap().rows;
    let revoke = async |tenant: Option<&Tenant>| {
        let event = event(Activity::KeyRevoked);
        on.b.revoke_keys_of("dr-who", tenant, now(), &event)
            .await
            .unwrap()
    };
    assert_eq!(revoke(Some(&tenant())).await, own);
    assert!(revoke(Some(&tenant())).await.is_empty());
    assert_eq!(revoke(None).await, std::slice::from_ref(&elsewhere));
    let key = on.a.key(&elsewhere).await.unwrap().unwrap();
    assert_eq!(key.owner.as_deref(), Some("dr-who"));
    assert!(key.revoked_at.is_some());
    assert_eq!(verify(&*on.a).await.unwrap().rows, rows + 3);
}

fn event(activity: Activity) -> AuditEvent {
    AuditEvent::new(now(), activity, tenant(), "test".into())
}

async fn the_trusted_time_is_kept(on: &Stores) {
    let server = on.a.server_time().await.unwrap();
    assert_eq!(server.is_some(), on.url.is_some());
    assert!(server.is_none_or(|at| (at - now()).abs() < 60_000));
    assert_eq!(
        on.a.last_trusted().await.unwrap(),
        None,
        "nothing is stored"
    );
    on.volume(&tenant()).await;
    let last = on.a.last_trusted().await.unwrap();
    assert!(
        last.is_some_and(|at| (at - now()).abs() < 60_000),
        "{last:?}"
    );
    for at in [1_000, 2_000, 500] {
        on.a.note_trusted(trusted(at)).await.unwrap();
        assert_eq!(on.b.last_trusted().await.unwrap(), Some(at));
    }
}

async fn what_a_clock_that_was_ahead_put_off_is_due(on: &Stores) {
    let far = 400 * 86_400_000;
    let source = SeriesSource {
        archive: Some("pacs".into()),
        dicomweb: None,
        study: "1.2".into(),
        series: "1.2.3".into(),
    };
    let job = on
        .file(&NewJob {
            kind: "model".into(),
            source: Some(source),
            ..NewJob::default()
        })
        .await;
    let pacs = lane(&tenant(), "pacs");
    let due = async || on.b.due_pulls(&pacs, now(), 10).await.unwrap();
    assert_eq!(on.a.recall_pulls(now()).await.unwrap(), 0);
    // An attempt of the future, in doubt: it does not count.
    on.a.pull_begun(&job.id, now() + far).await.unwrap();
    let again = NextAttempt {
        at: now() + far + 60_000,
        counts: false,
    };
    on.a.pull_failed(&job.id, "away", again, now() + far)
        .await
        .unwrap();
    assert!(due().await.is_empty());
    assert_eq!(on.a.recall_pulls(now()).await.unwrap(), 1);
    let found = due().await;
    assert_eq!((found.len(), found[0].attempts), (1, 0));
    // A pause that this clock has set is kept.
    on.a.pull_begun(&job.id, now()).await.unwrap();
    let again = NextAttempt {
        at: now() + 60_000,
        counts: true,
    };
    on.a.pull_failed(&job.id, "away", again, now())
        .await
        .unwrap();
    assert_eq!(on.a.recall_pulls(now()).await.unwrap(), 0);
    assert!(due().await.is_empty());
    assert_eq!(on.a.recall_sends(now()).await.unwrap(), 0);
    assert_eq!(on.a.recall_deliveries(now()).await.unwrap(), 0);
}

async fn a_defect_is_told_until_it_is_mended(on: &Stores) {
    on.a.check().await.unwrap();
    let key = SeriesKey {
        tenant: &tenant(),
        base: "https://pacs.example",
        study: "1.2",
        series: "1.2.3",
    };
    let held = HeldSeries {
        instances: "x".into(),
        volume: "vol_none".into(),
    };
    assert!(on.tamper("ALTER TABLE pulled_series RENAME TO lost").await);
    on.a.check().await.unwrap();
    // A read and a write tell of it.
    let read = on.a.held_series(key).await.unwrap_err();
    let written = on.a.note_series(key, &held).await.unwrap_err();
    for error in [read, written, on.a.check().await.unwrap_err()] {
        assert_eq!(error.cause(), StoreFault::DamagedDatabase, "{error}");
    }
    on.a.recheck().await;
    assert!(on.a.check().await.is_err(), "it is not mended");
    assert!(on.tamper("ALTER TABLE lost RENAME TO pulled_series").await);
    assert!(on.a.check().await.is_err(), "nobody has looked");
    let begun = std::time::Instant::now();
    while on.a.check().await.is_err() {
        assert!(begun.elapsed() < Duration::from_secs(120));
        tokio::time::sleep(Duration::from_millis(500)).await;
        on.a.recheck().await;
    }
    assert!(on.a.held_series(key).await.unwrap().is_none());
}

async fn the_trail_is_tried_without_a_row(on: &Stores) {
    on.a.append(&[event(Activity::Read)]).await.unwrap();
    on.a.check_trail(now()).await.unwrap();
    assert_eq!(verify(&*on.b).await.unwrap().rows, 1);
    let (shut, open) = match on.url {
        Some(_) => (
            "CREATE FUNCTION no_rows() RETURNS TRIGGER LANGUAGE plpgsql
                 AS 'BEGIN RAISE EXCEPTION ''no''; END';
             CREATE TRIGGER shut BEFORE INSERT ON audit FOR EACH ROW EXECUTE FUNCTION no_rows()",
            "DROP TRIGGER shut ON audit; DROP FUNCTION no_rows()",
        ),
        None => (
            "CREATE TRIGGER shut BEFORE INSERT ON audit BEGIN SELECT RAISE(ABORT, 'no'); END",
            "DROP TRIGGER shut",
        ),
    };
    assert!(on.tamper(shut).await);
    assert!(on.a.check_trail(now()).await.is_err());
    assert!(on.tamper(open).await);
    on.a.check_trail(now()).await.unwrap();
    on.a.append(&[event(Activity::Read)]).await.unwrap();
    let report = verify(&*on.b).await.unwrap();
    assert_eq!((report.rows, report.broken), (2, None));
}

async fn ends_of_jobs_are_told(on: &Stores) {
    let volume = on.volume(&tenant()).await;
    let endpoint = |id: &str, events: &[HookEvent]| HookEndpoint {
        id: id.into(),
        tenant: tenant(),
        created_at: now(),
        url: "https://ward.example/hook".into(),
        destination: "https://ward.example:443".into(),
        events: events.to_vec(),
        gone_at: None,
    };
    let secret = SigningSecret::random();
    let all = endpoint("whk_1", &HookEvent::ALL);
    assert!(on.a.add_endpoint(&all, &secret, 2).await.unwrap());
    let ends = endpoint("whk_2", &HookEvent::ENDS);
    assert!(on.a.add_endpoint(&ends, &secret, 2).await.unwrap());
    assert!(
        !on.a
            .add_endpoint(&endpoint("whk_3", &[]), &secret, 2)
            .await
            .unwrap()
    );
    assert_eq!(on.b.endpoints(&tenant()).await.unwrap(), [all, ends]);
    let own = JobWebhook {
        url: "https://own.example/".into(),
        destination: "https://own.example:443".into(),
        events: vec!["failed".into()],
        secret: None,
    };
    let job = on
        .file(&NewJob {
            webhook: Some(own.clone()),
            ..new_job(&volume)
        })
        .await;
    let (_, lease) = on.claim().await.unwrap();
    let outcome = JobOutcome::Failed(failure("no-heart"));
    on.b.finish(&lease, &outcome, now()).await.unwrap().unwrap();
    let told = on.a.deliveries(&tenant(), &job.id, 10).await.unwrap();
    let told: Vec<_> = told
        .iter()
        .map(|d| (d.endpoint.as_deref(), d.event))
        .collect();
    assert_eq!(told.len(), 4);
    assert!(told.contains(&(Some("whk_1"), HookEvent::Started)));
    assert!(told.contains(&(None, HookEvent::Failed)));
    let (at_own, at_ward) = (
        lane(&tenant(), "https://own.example:443"),
        lane(&tenant(), "https://ward.example:443"),
    );
    let lanes = on.b.delivery_lanes().await.unwrap();
    let lanes: Vec<_> = lanes.into_iter().map(|(lane, _)| lane).collect();
    assert_eq!(lanes, [at_own.clone(), at_ward.clone()]);
    let tenants = on.a.signing_secret(&tenant(), &secret).await.unwrap();
    assert_eq!(
        on.b.signing_secret(&tenant(), &SigningSecret::random())
            .await
            .unwrap(),
        tenants
    );
    on.a.replace_secret(&tenant(), &SigningSecret::random(), i64::MAX)
        .await
        .unwrap();
    let due = on.b.due_deliveries(&at_own, now(), 10).await.unwrap();
    assert_eq!(due.len(), 1);
    assert_eq!(
        (due[0].secrets.len(), due[0].cause.as_deref()),
        (2, Some("no-heart"))
    );
    // An attempt that fails is repeated, one that is taken is not.
    let settle = |outcome, again_at| Settlement {
        outcome,
        again_at,
        counts: true,
    };
    let again = settle(AttemptOutcome::Rejected(500), Some(now() + 60_000));
    assert_eq!(due[0].attempts, 0);
    // It counts from its beginning.
    on.a.begun(&due[0].id, now()).await.unwrap();
    let begun = on.b.due_deliveries(&at_own, now(), 10);
    assert_eq!(begun.await.unwrap()[0].attempts, 1);
    on.a.settle(&due[0].id, again, now()).await.unwrap();
    assert!(
        on.b.due_deliveries(&at_own, now(), 10)
            .await
            .unwrap()
            .is_empty()
    );
    on.a.begun(&due[0].id, now()).await.unwrap();
    on.a.settle(
        &due[0].id,
        settle(AttemptOutcome::Delivered(204), None),
        now(),
    )
    .await
    .unwrap();
    let settled = &on.b.deliveries(&tenant(), &job.id, 10).await.unwrap();
    let settled = settled.iter().find(|d| d.id == due[0].id).unwrap();
    assert_eq!(
        (settled.state, settled.attempts, settled.last_status),
        (DeliveryState::Delivered, 2, Some(204))
    );
    let once_more =
        on.b.redeliver(&tenant(), &job.id, &due[0].id, now())
            .await
            .unwrap()
            .unwrap();
    assert_eq!(
        (once_more.state, once_more.attempts),
        (DeliveryState::Pending, 0)
    );
    // 410 ends the endpoint, and what it was to be told.
    let due = on.b.due_deliveries(&at_ward, now(), 10).await.unwrap();
    let first = due.iter().find(|d| d.event == HookEvent::Started).unwrap();
    on.a.settle(&first.id, settle(AttemptOutcome::Gone, None), now())
        .await
        .unwrap();
    assert!(
        on.b.endpoints(&tenant()).await.unwrap()[0]
            .gone_at
            .is_some()
    );
    assert!(
        on.b.remove_endpoint(&tenant(), "whk_2", now())
            .await
            .unwrap()
    );
    assert!(
        !on.b
            .remove_endpoint(&tenant(), "whk_2", now())
            .await
            .unwrap()
    );
    let left = on.b.backlog().await.unwrap();
    assert_eq!((left.pending, left.dead), (1, 3));
    let limits = |pending_since, backlog| DeliveryLimits {
        pending_since: Some(cutoff(pending_since)),
        ended_since: Some(cutoff(0)),
        backlog,
    };
    assert_eq!(on.a.expire(limits(0, 1), now()).await.unwrap(), 0);
    assert_eq!(on.a.expire(limits(0, 0), now()).await.unwrap(), 1);
    assert_eq!(on.a.expire(limits(i64::MAX, 0), now()).await.unwrap(), 0);
    // Each tenant has a backlog of its own, also at a receiver that several tell.
    for tenant in [tenant(), other()] {
        let volume = on.volume(&tenant).await;
        on.file(&NewJob {
            tenant,
            webhook: Some(own.clone()),
            ..new_job(&volume)
        })
        .await;
        let (_, lease) = on.claim().await.unwrap();
        on.b.finish(&lease, &outcome, now()).await.unwrap().unwrap();
    }
    assert_eq!(on.b.backlog().await.unwrap().pending, 2);
    assert_eq!(on.a.expire(limits(0, 1), now()).await.unwrap(), 0);
    // What was told about an erased job goes with it.
    on.a.delete_job(&job.id, None, now()).await.unwrap();
    assert!(
        on.b.deliveries(&tenant(), &job.id, 10)
            .await
            .unwrap()
            .is_empty()
    );
}

async fn series_are_fetched_and_results_sent(on: &Stores) {
    let source = SeriesSource {
        archive: Some("pacs".into()),
        dicomweb: None,
        study: "1.2".into(),
        series: "1.2.3".into(),
    };
    let sourced = NewJob {
        kind: "model".into(),
        source: Some(source.clone()),
        send: Some(SendOrder {
            names: vec!["mesh.dcm".into(), "report.dcm".into()],
            to: "pacs".into(),
        }),
        ..NewJob::default()
    };
    let (job, lost) = (on.file(&sourced).await, on.file(&sourced).await);
    assert!(on.claim().await.is_none(), "they have no volume yet");
    let pacs = lane(&tenant(), "pacs");
    assert_eq!(on.b.pull_lanes().await.unwrap()[0].0, pacs);
    let due = on.b.due_pulls(&pacs, now(), 10).await.unwrap();
    assert_eq!(due.len(), 2);
    assert_eq!((&due[0].source, due[0].attempts), (&source, 0));
    // An attempt counts from its beginning.
    on.a.pull_begun(&job.id, now()).await.unwrap();
    let due = on.b.due_pulls(&pacs, now(), 10).await.unwrap();
    let begun = due.iter().find(|due| due.job == job.id).unwrap();
    assert_eq!(begun.attempts, 1);
    let again = NextAttempt {
        at: now() + 60_000,
        counts: true,
    };
    on.a.pull_failed(&job.id, "away", again, now())
        .await
        .unwrap();
    assert_eq!(on.b.due_pulls(&pacs, now(), 10).await.unwrap().len(), 1);
    let given_up =
        on.a.pull_given_up(&lost.id, &failure("no-series"), now())
            .await
            .unwrap()
            .unwrap();
    assert_eq!(given_up.state, JobState::Failed);
    let volume = on.volume(&tenant()).await;
    assert!(
        on.a.pulled(&lost.id, &volume, now())
            .await
            .unwrap()
            .is_none()
    );
    on.a.pull_begun(&job.id, now()).await.unwrap();
    on.a.pull_begun(&lost.id, now()).await.unwrap();
    let supplied = on.a.pulled(&job.id, &volume, now()).await.unwrap().unwrap();
    assert_eq!(supplied.volume.as_ref(), Some(&volume));
    let pulls = on.b.pulls(&[&job.id, &lost.id]).await.unwrap();
    assert_eq!(
        (pulls[&job.id].state, pulls[&job.id].attempts),
        (DeliveryState::Delivered, 2)
    );
    assert_eq!(
        (pulls[&lost.id].state, pulls[&lost.id].attempts),
        (DeliveryState::Dead, 0)
    );
    let tenant = tenant();
    let key = SeriesKey {
        tenant: &tenant,
        base: "http://pacs",
        study: "1.2",
        series: "1.2.3",
    };
    let held = HeldSeries {
        instances: "ab".into(),
        volume: volume.clone(),
    };
    for _ in 0..2 {
        on.a.note_series(key, &held).await.unwrap();
    }
    assert_eq!(on.b.held_series(key).await.unwrap(), Some(held));
    let (_, lease) = on.claim().await.unwrap();
    let result = model(&volume);
    on.b.finish(&lease, &succeeded(&result), now())
        .await
        .unwrap()
        .unwrap();
    let sends = &on.a.sends(&[&job.id]).await.unwrap()[&job.id];
    let names: Vec<_> = sends.iter().map(|send| send.name.as_str()).collect();
    assert_eq!(names, ["mesh.dcm", "report.dcm"]);
    assert_eq!(on.b.send_lanes().await.unwrap()[0].0, pacs);
    let due = on.b.due_sends(&pacs, now(), 10).await.unwrap();
    let stored = SendSettlement {
        state: DeliveryState::Delivered,
        outcome: "stored",
        error: None,
        again_at: None,
        counts: true,
    };
    on.a.send_begun(&due[0].id, now()).await.unwrap();
    let begun = on.b.due_sends(&pacs, now(), 10).await.unwrap();
    let begun = begun.iter().find(|send| send.id == due[0].id).unwrap();
    assert_eq!((due[0].attempts, begun.attempts), (0, 1));
    on.a.settle_send(&due[0], &stored, now()).await.unwrap();
    let sends = &on.b.sends(&[&job.id]).await.unwrap()[&job.id];
    let settled = sends.iter().find(|send| send.id == due[0].id).unwrap();
    assert_eq!(
        (settled.state, settled.attempts),
        (DeliveryState::Delivered, 1)
    );
    let backlog = on.b.archive_backlog().await.unwrap();
    assert_eq!(
        (backlog.pulls, backlog.sends.pending, backlog.sends.dead),
        (0, 1, 0)
    );
    // What is erased is not sent any more, and its series is fetched anew.
    let expected = [volume.clone(), result.id.clone()];
    let order = ErasureOrder {
        renewed_before: None,
        cascade: false,
        ..erasure(&result.id, false)
    };
    assert!(matches!(
        on.a.erase(&order, &expected, now()).await.unwrap(),
        Erased::Done(_)
    ));
    let sends = &on.b.sends(&[&job.id]).await.unwrap()[&job.id];
    assert_eq!(sends[1].last_outcome.as_deref(), Some("erased"));
    let again =
        on.b.redeliver_object(&tenant, &job.id, &sends[1].id, now())
            .await
            .unwrap();
    assert_eq!(again.unwrap().state, DeliveryState::Dead);
    let again =
        on.b.redeliver_object(&tenant, &job.id, &sends[0].id, now())
            .await
            .unwrap();
    assert_eq!(again.unwrap().state, DeliveryState::Pending);
    let order = erasure(&volume, false);
    assert!(matches!(
        on.a.erase(&order, &expected, now()).await.unwrap(),
        Erased::Done(_)
    ));
    assert_eq!(on.b.held_series(key).await.unwrap(), None);
    let job = on.b.job(&job.id).await.unwrap().unwrap();
    assert_eq!(
        job.source.unwrap().series,
        "",
        "the UIDs go with the volume"
    );
}

/// However much a tenant has due at a destination, what another has due there is found: fetches, deliveries of
/// objects, and webhooks.
async fn errands_are_found_by_tenant_and_destination(on: &Stores) {
    const MANY: usize = 30;
    let (busy, calm): (Tenant, Tenant) = ("busy".parse().unwrap(), "calm".parse().unwrap());
    let sourced = |tenant: &Tenant, archive: &str| NewJob {
        tenant: tenant.clone(),
        kind: "model".into(),
        source: Some(SeriesSource {
            archive: Some(archive.into()),
            dicomweb: None,
            study: "1.2".into(),
            series: "1.2.3".into(),
        }),
        send: Some(SendOrder {
            names: vec!["mesh.dcm".into()],
            to: archive.into(),
        }),
        webhook: Some(JobWebhook {
            url: "https://shared.example/".into(),
            destination: "https://shared.example:443".into(),
            events: vec!["succeeded".into()],
            secret: None,
        }),
        ..NewJob::default()
    };
    for _ in 0..MANY {
        on.file(&sourced(&busy, "pacs")).await;
    }
    on.file(&sourced(&busy, "archive")).await;
    on.file(&sourced(&calm, "pacs")).await;
    let expected = |destinations: &[(&str, &Tenant)]| -> Vec<Lane> {
        let lanes = destinations.iter();
        lanes.map(|(name, tenant)| lane(tenant, name)).collect()
    };
    let names = |lanes: Vec<(Lane, Timestamp)>| -> Vec<Lane> {
        assert!(lanes.iter().all(|(_, due_at)| *due_at <= now()));
        lanes.into_iter().map(|(lane, _)| lane).collect()
    };
    let at_archives = expected(&[("archive", &busy), ("pacs", &busy), ("pacs", &calm)]);
    assert_eq!(names(on.b.pull_lanes().await.unwrap()), at_archives);
    let mut supplied = Vec::new();
    for (lane, count) in at_archives.iter().zip([1, 3, 1]) {
        let due = on.b.due_pulls(lane, now(), 3).await.unwrap();
        assert!(due.iter().all(|due| due.tenant == lane.tenant));
        assert_eq!(due.len(), count);
        supplied.extend(on.b.due_pulls(lane, now(), MANY).await.unwrap());
    }
    assert_eq!(supplied.len(), MANY + 2);
    // All succeed, so each has an object to deliver and a webhook to send.
    for due in supplied {
        let volume = on.volume(&due.tenant).await;
        on.a.pulled(&due.job, &volume, now())
            .await
            .unwrap()
            .unwrap();
        let (job, lease) = on.claim().await.unwrap();
        let result = model(job.volume.as_deref().unwrap());
        on.b.finish(&lease, &succeeded(&result), now())
            .await
            .unwrap()
            .unwrap();
    }
    assert!(on.b.pull_lanes().await.unwrap().is_empty());
    assert_eq!(names(on.b.send_lanes().await.unwrap()), at_archives);
    let of_calm = on.b.due_sends(&at_archives[2], now(), 3).await.unwrap();
    assert_eq!((of_calm.len(), &of_calm[0].tenant), (1, &calm));
    let of_busy = on.b.due_sends(&at_archives[1], now(), 3).await.unwrap();
    assert_eq!((of_busy.len(), &of_busy[0].tenant), (3, &busy));
    let shared = "https://shared.example:443";
    let at_receiver = expected(&[(shared, &busy), (shared, &calm)]);
    assert_eq!(names(on.b.delivery_lanes().await.unwrap()), at_receiver);
    for (lane, count) in [(&at_receiver[0], 3), (&at_receiver[1], 1)] {
        let due = on.b.due_deliveries(lane, now(), 3).await.unwrap();
        assert_eq!(due.len(), count);
        assert!(due.iter().all(|due| due.tenant == lane.tenant));
    }
}

async fn received_objects_become_volumes(on: &Stores) {
    let received = |instance: &str, data: &str| object_of(&tenant(), instance, data);
    let room = IntakeRoom {
        objects: 2,
        bytes: 1000,
        tenant_bytes: None,
    };
    let add = async |instance: &str, data: &str| {
        let added = on.a.add(&received(instance, data), room, now()).await;
        added.unwrap()
    };
    let Added::New(group, None) = add("1", "aa").await else {
        panic!("it is new")
    };
    assert_eq!(add("1", "aa").await, Added::Known(group.clone()));
    assert_eq!(add("1", "bb").await, Added::Conflict);
    assert_eq!(add("2", "aa").await, Added::New(group.clone(), None));
    assert_eq!(add("3", "aa").await, Added::NoRoom);
    assert_eq!(on.b.waiting().await.unwrap(), (2, 20));
    let state = on.b.group(&group).await.unwrap().unwrap();
    assert_eq!(
        (state.objects, state.waiting_bytes, state.revision),
        (2, 20, 2)
    );
    assert_eq!(on.b.unfinished().await.unwrap().len(), 1);
    assert_eq!(on.b.objects(&group).await.unwrap().len(), 2);
    assert_eq!(on.b.files().await.unwrap().len(), 2);
    // It cannot be read; an object that is sent again replaces the other.
    on.a.failed(&group, 2, &failure("not-a-volume"), now())
        .await
        .unwrap();
    assert_eq!(
        on.b.failed_before(cutoff(now() + 1000))
            .await
            .unwrap()
            .len(),
        1
    );
    let Added::New(_, obsolete) = add("1", "bb").await else {
        panic!("it replaces the other")
    };
    assert_eq!(obsolete.as_deref(), Some("file-1-aa"));
    let volume = on.volume(&tenant()).await;
    on.a.made(&group, 1, &volume, now()).await.unwrap();
    let state = on.b.group(&group).await.unwrap().unwrap();
    assert_eq!(state.state, GroupState::Gathering, "more has come since");
    on.a.made(&group, state.revision, &volume, now())
        .await
        .unwrap();
    let files =
        on.a.filed(&group, Some("job_1"), None, now())
            .await
            .unwrap();
    assert_eq!(files.len(), 2);
    assert_eq!(on.b.releasable().await.unwrap().len(), 2);
    on.a.released(&files).await.unwrap();
    assert!(on.b.releasable().await.unwrap().is_empty());
    let listed =
        on.b.groups(&tenant(), Some(GroupState::Stored), ALL)
            .await
            .unwrap();
    assert_eq!(listed.items[0].job.as_deref(), Some("job_1"));
    // Who erases the volume erases what is known of its objects.
    let expected = [volume.clone()];
    on.a.erase(&erasure(&volume, false), &expected, now())
        .await
        .unwrap();
    assert!(on.b.group(&group).await.unwrap().is_none());
    let Added::New(group, None) = add("1", "aa").await else {
        panic!("it is new again")
    };
    let by = ErasureAgent::retention();
    let reason = ErasureReason::Retention;
    let of_other = on.b.remove(&other(), &group, &by, reason, now()).await;
    assert_eq!(of_other.unwrap(), None);
    let removed = on.b.remove(&tenant(), &group, &by, reason, now()).await;
    let (files, receipt) = removed.unwrap().unwrap();
    assert_eq!(files, ["file-1-aa"]);
    assert_eq!((receipt.item, receipt.reason), (group.clone(), reason));
    assert_eq!(receipt.items[0].files[0].name, "file-1-aa");
    assert_eq!(rows_about(&on.a, &group).await, 1);
    assert_eq!(on.b.waiting().await.unwrap(), (0, 0));
}

/// The number of rows of the audit trail by which retention has erased an item of the tenant.
async fn rows_about(store: &SqlStore, item: &str) -> usize {
    let filter = AuditFilter {
        tenant: Some(tenant()),
        object: Some(item.to_owned()),
        ..AuditFilter::default()
    };
    let rows = store.audit(&filter, ALL).await.unwrap().items;
    let by_age = |row: &&AuditRecord| {
        row.event.agent == "retention" && row.event.activity == Activity::Delete
    };
    rows.iter().filter(by_age).count()
}

async fn work_items_change_once(on: &Stores) {
    let item = |uid: &str| Workitem {
        tenant: tenant(),
        uid: uid.into(),
        sequence: 0,
        revision: 0,
        state: WorkitemState::Scheduled,
        transaction: None,
        performer: Performer::None,
        attributes: DataSetJson::from_object(object(json!({
            "00741000": {"vr": "CS", "Value": ["SCHEDULED"]}
        })))
        .unwrap(),
        changed_at: now(),
    };
    let (first, second) = (item("1.2.1"), item("1.2.2"));
    assert_eq!(
        on.a.add_workitem(&first, 2).await.unwrap(),
        AddedWorkitem::Done
    );
    assert_eq!(
        on.b.add_workitem(&first, 2).await.unwrap(),
        AddedWorkitem::Exists
    );
    assert_eq!(
        on.a.add_workitem(&second, 2).await.unwrap(),
        AddedWorkitem::Done
    );
    assert_eq!(
        on.a.add_workitem(&item("1.2.3"), 2).await.unwrap(),
        AddedWorkitem::Full
    );
    assert_eq!(on.b.scheduled_workitems(0, 10).await.unwrap().len(), 2);
    let mut mine = on.b.workitem(&tenant(), "1.2.1").await.unwrap().unwrap();
    mine.state = WorkitemState::InProgress;
    (mine.transaction, mine.performer) = (Some("1.9".into()), Performer::Claimed);
    let changed = tokio::join!(on.a.change_workitem(&mine), on.b.change_workitem(&mine));
    assert!(
        changed.0.unwrap() != changed.1.unwrap(),
        "one of two claims it"
    );
    assert_eq!(on.b.performed_workitems(0, 10).await.unwrap().len(), 1);
    let listed =
        on.b.workitems(&tenant(), Some(WorkitemState::Scheduled), 0, 10)
            .await
            .unwrap();
    assert_eq!(listed.len(), 1);
    assert_eq!(
        on.b.workitems(&tenant(), None, 0, 10).await.unwrap().len(),
        2
    );
    let mut ended = on.a.workitem(&tenant(), "1.2.1").await.unwrap().unwrap();
    ended.state = WorkitemState::Completed;
    assert!(on.a.change_workitem(&ended).await.unwrap());
    let deleted =
        on.b.delete_ended_workitems(cutoff(now() + 1000), now())
            .await;
    assert_eq!(deleted.unwrap(), 1);
    assert_eq!(rows_about(&on.a, "1.2.1").await, 1);
    assert!(on.a.erased_at(&tenant(), "1.2.1").await.unwrap().is_some());
    let by = ErasureAgent {
        name: "clerk".into(),
        ..ErasureAgent::default()
    };
    let (own, others) = (tenant(), other());
    let erase = |of| on.b.erase_workitem(of, "1.2.2", &by, now());
    assert_eq!(erase(&others).await.unwrap(), Erased::Unknown);
    let Erased::Done(receipt) = erase(&own).await.unwrap() else {
        panic!("the item is there");
    };
    assert_eq!((&*receipt.item, &*receipt.erased_by), ("1.2.2", "clerk"));
    assert_eq!(erase(&own).await.unwrap(), Erased::Unknown);
    // It exists again.
    let again = on.a.add_workitem(&item("1.2.2"), 2).await.unwrap();
    assert_eq!(again, AddedWorkitem::Done);
    assert_eq!(on.a.erased_at(&tenant(), "1.2.2").await.unwrap(), None);
    let mut performed = on.a.workitem(&tenant(), "1.2.2").await.unwrap().unwrap();
    performed.state = WorkitemState::InProgress;
    performed.performer = Performer::Claimed;
    assert!(on.a.change_workitem(&performed).await.unwrap());
    assert_eq!(erase(&own).await.unwrap(), Erased::InUse);
}

/// A change that somebody makes: its name, the act and the item of its row, and how it is made; `true` if it was.
struct Act<'a> {
    name: &'static str,
    activity: Activity,
    /// Who the row says did it.
    by: &'static str,
    object: String,
    make: Box<dyn Fn() -> BoxFuture<'a, StoreResult<bool>> + 'a>,
}

fn act<'a, F>(
    name: &'static str,
    (activity, object): (Activity, &str),
    make: impl Fn() -> F + 'a,
) -> Act<'a>
where
    F: Future<Output = StoreResult<bool>> + Send + 'a,
{
    Act {
        name,
        activity,
        by: "clerk",
        object: object.to_owned(),
        make: Box::new(move || Box::pin(make())),
    }
}

impl Act<'_> {
    /// It is done by somebody else: a duty of the service.
    fn by(mut self, by: &'static str) -> Self {
        self.by = by;
        self
    }
}

/// A job whose result is delivered to the archive `pacs` by two sends, and whose end is told to a webhook: its id, and the
/// ids of the delivery of the message and of the result.
async fn told_and_sent(on: &Stores) -> (String, String, String) {
    let volume = on.volume(&tenant()).await;
    let job = on
        .file(&NewJob {
            send: Some(SendOrder {
                names: vec!["mesh.dcm".into(), "report.dcm".into()],
                to: "pacs".into(),
            }),
            webhook: Some(JobWebhook {
                url: "https://own.example/".into(),
                destination: "https://own.example:443".into(),
                events: vec!["succeeded".into()],
                secret: None,
            }),
            ..new_job(&volume)
        })
        .await;
    let (_, lease) = on.claim().await.unwrap();
    let result = model(&volume);
    on.b.finish(&lease, &succeeded(&result), now())
        .await
        .unwrap()
        .unwrap();
    let told = on.a.deliveries(&tenant(), &job.id, 10).await.unwrap();
    (job.id, told[0].id.clone(), result.id)
}

/// Every change of a store that is made for somebody: with the trail broken it is undone, else it leaves one row.
async fn changes_and_their_rows_are_one(on: &Stores) {
    let (store, t) = (&on.a, &tenant());
    let (told, message, sent) = told_and_sent(on).await;
    let sends = store.due_sends(&lane(t, "pacs"), now(), 10).await.unwrap();
    let settled = |state, outcome| SendSettlement {
        state,
        outcome,
        error: None,
        again_at: None,
        counts: true,
    };
    let stored = settled(DeliveryState::Delivered, "stored");
    let refused = settled(DeliveryState::Dead, "refused");
    let held = on.volume(t).await;
    let (volume, product) = (stored_volume("vol_new", 10), model(&held));
    let queued = on.file(&new_job(&held)).await.id;
    let mut keyed = new_job(&held);
    keyed.idempotency = Some(Idempotency {
        key: "once".into(),
        fingerprint: "f".into(),
    });
    let cancelled = on.file(&new_job(&held)).await.id;
    store.interrupt(&cancelled, now()).await.unwrap();
    let mut sourced = new_job("");
    (sourced.volume, sourced.source) = (None, Some(series_source()));
    let (pulled, lost) = (on.file(&sourced).await.id, on.file(&sourced).await.id);
    let template = product_of_kind(Resource::Template);
    store
        .add_product(&template, t, None, AMPLE_ROOM)
        .await
        .unwrap();
    let hook = |id: &str| HookEndpoint {
        id: id.into(),
        tenant: t.clone(),
        created_at: now(),
        url: "https://ward.example/hook".into(),
        destination: "https://ward.example:443".into(),
        events: HookEvent::ALL.to_vec(),
        gone_at: None,
    };
    let (first, second, secret) = (hook("whk_1"), hook("whk_2"), SigningSecret::random());
    store.add_endpoint(&first, &secret, 9).await.unwrap();
    let item = |uid: &str| Workitem {
        tenant: t.clone(),
        uid: uid.into(),
        sequence: 0,
        revision: 0,
        state: WorkitemState::Scheduled,
        transaction: None,
        performer: Performer::None,
        attributes: DataSetJson::from_object(object(json!({}))).unwrap(),
        changed_at: now(),
    };
    store.add_workitem(&item("1.1"), 9).await.unwrap();
    let changed = store.workitem(t, "1.1").await.unwrap().unwrap();
    let (added, erased) = (item("1.2"), item("1.3"));
    let ended = Workitem {
        state: WorkitemState::Completed,
        ..item("1.4")
    };
    for item in [&erased, &ended] {
        store.add_workitem(item, 9).await.unwrap();
    }
    let soon = cutoff(now() + 600_000);
    let (retention, old) = (ErasureAgent::retention(), on.file(&new_job(&held)).await.id);
    store.interrupt(&old, now()).await.unwrap();
    let room = IntakeRoom {
        objects: 99,
        bytes: 9999,
        tenant_bytes: None,
    };
    let received = received_object(t, "7");
    let group = store.add(&received_object(t, "8"), room, now()).await;
    let Added::New(group, _) = group.unwrap() else {
        panic!("the object is new");
    };
    let (before, after) = (
        Tags::default(),
        Tags {
            external_id: Some("A".into()),
            ..Tags::default()
        },
    );
    let hold = LegalHold {
        reason: "case".into(),
        since: now(),
        by: "clerk".into(),
    };
    let fields = ScanFields(object(json!({"patient_id": "7"})));
    // An erasure names its agent itself: its receipt does so too.
    let by = ErasureAgent {
        name: "clerk".into(),
        ..ErasureAgent::default()
    };
    let (erased_volume, order) = {
        let id = on.volume(t).await;
        let order = ErasureOrder {
            tenant: t.clone(),
            id: id.clone(),
            cascade: false,
            renewed_before: None,
            by: by.clone(),
            reason: ErasureReason::Request,
        };
        (id, order)
    };
    let expected = [erased_volume.clone()];
    let why = failure("no-series");
    let new_key = |name: &str| KeyRequest {
        name: name.into(),
        tenant: t.clone(),
        scope: Scope::Read,
        quota: Quota::default(),
        expires_at: None,
        maker: Maker::Operator,
        owner: None,
    };
    let (api_key, _) = ApiKey::make(new_key("k"), now()).unwrap();
    let event = |activity| AuditEvent::new(now(), activity, t.clone(), "clerk".into());
    let (made, revoked) = (
        event(Activity::KeyCreated).on(&*api_key.id),
        event(Activity::KeyRevoked).on(&*api_key.id),
    );
    let owned = KeyRequest {
        owner: Some("dr-who".into()),
        ..new_key("owned")
    };
    let (owned_key, _) = ApiKey::make(owned, now()).unwrap();
    let opened = event(Activity::AccessOpened);
    store
        .add_key(&owned_key, &event(Activity::KeyCreated))
        .await
        .unwrap();
    let of_patient = on.volume(t).await;
    let stated = ScanFields(object(json!({"patient_id": "PAT_9"})));
    assert!(store.state_scan(t, &of_patient, &stated).await.unwrap());
    let patient = scan_erasure([("patient", "PAT_9")], true);
    let selected = [of_patient.clone()];
    use Activity::{
        AccessOpened, AuditPruned, Create, Delete, Execute, KeyCreated, KeyRevoked, Read, Update,
    };
    // In this order: some change what an earlier one has made. The id of a new job is not known before.
    let acts = [
        act("add_volume", (Create, "vol_new"), || {
            store.add_volume(&volume, t, &before, None)
        }),
        act("renew_volume", (Update, "vol_new"), || async {
            let renewed = store
                .renew_volume(t, "vol_new", &before, None, now())
                .await?;
            Ok(renewed.is_some_and(|(_, new)| !new))
        }),
        act("add_product", (Create, &product.id), || async {
            let added = store.add_product(&product, t, None, AMPLE_ROOM).await?;
            Ok(matches!(added, AddedProduct::New))
        }),
        act("change_tags", (Update, &held), || {
            store.change_tags(t, &held, &before, &after)
        }),
        act("change_tags of a job", (Update, &queued), || {
            store.change_tags(t, &queued, &before, &after)
        }),
        act("set_library", (Update, &template.id), || {
            store.set_library(t, &template.id, true)
        }),
        act("set_legal_hold", (Update, &held), || {
            store.set_legal_hold(t, &held, Some(&hold))
        }),
        act("set_legal_hold, lifted", (Update, &held), || {
            store.set_legal_hold(t, &held, None)
        }),
        act("state_scan", (Update, &held), || {
            store.state_scan(t, &held, &fields)
        }),
        act("erase_scan", (Delete, &held), || {
            store.erase_scan(t, &held, now())
        }),
        act("file", (Execute, ""), || async {
            Ok(matches!(
                store.file(&keyed, 99, now()).await?,
                Filed::New(_)
            ))
        }),
        act("interrupt", (Delete, &queued), || async {
            Ok(matches!(
                store.interrupt(&queued, now()).await?,
                Interrupted::Cancelled(_)
            ))
        }),
        act("delete_job", (Delete, &cancelled), || async {
            Ok(store.delete_job(&cancelled, None, now()).await? == Deleted::Done)
        }),
        act("delete_job, by age", (Delete, &old), || async {
            let deleted = store.delete_job(&old, Some(&retention), now());
            Ok(deleted.await? == Deleted::Done)
        })
        .by("retention"),
        act("settle_send", (Read, &sent), || async {
            let settled = store.settle_send(&sends[0], &stored, now());
            settled.await.map(|()| true)
        }),
        act("settle_send, given up", (Read, &sent), || async {
            let settled = store.settle_send(&sends[1], &refused, now());
            settled.await.map(|()| true)
        }),
        act("redeliver_object", (Update, &told), || async {
            let again = store.redeliver_object(t, &told, &sends[0].id, now());
            Ok(again.await?.is_some())
        }),
        act("redeliver", (Update, &told), || async {
            let again = store.redeliver(t, &told, &message, now());
            Ok(again.await?.is_some())
        }),
        act("pulled", (Create, &pulled), || async {
            Ok(store.pulled(&pulled, &held, now()).await?.is_some())
        }),
        act("pull_given_up", (Create, &lost), || async {
            Ok(store.pull_given_up(&lost, &why, now()).await?.is_some())
        }),
        act("add_endpoint", (Create, "whk_2"), || {
            store.add_endpoint(&second, &secret, 9)
        }),
        act("remove_endpoint", (Delete, "whk_1"), || {
            store.remove_endpoint(t, "whk_1", now())
        }),
        act("replace_secret", (Update, "webhooks/secret"), || async {
            store.replace_secret(t, &secret, now()).await.map(|()| true)
        }),
        act("add_workitem", (Create, "1.2"), || async {
            Ok(store.add_workitem(&added, 9).await? == AddedWorkitem::Done)
        }),
        act("change_workitem", (Update, "1.1"), || {
            store.change_workitem(&changed)
        }),
        act("erase_workitem", (Delete, "1.3"), || async {
            Ok(matches!(
                store.erase_workitem(t, "1.3", &by, now()).await?,
                Erased::Done(_)
            ))
        }),
        act("delete_ended_workitems", (Delete, "1.4"), || async {
            Ok(store.delete_ended_workitems(soon, now()).await? == 1)
        })
        .by("retention"),
        act("add a received object", (Create, &group), || async {
            Ok(matches!(
                store.add(&received, room, now()).await?,
                Added::New(..)
            ))
        }),
        act("remove", (Delete, &group), || async {
            let removed = store
                .remove(t, &group, &by, ErasureReason::Request, now())
                .await?;
            Ok(removed.is_some())
        }),
        act("erase", (Delete, &erased_volume), || async {
            Ok(matches!(
                store.erase(&order, &expected, now()).await?,
                Erased::Done(_)
            ))
        }),
        act("erase_scans", (Delete, &of_patient), || async {
            let erased = store.erase_scans(&patient, &selected, now()).await?;
            Ok(matches!(erased, ScansErased::Done(_)))
        })
        .by("somebody"),
        act("add_key", (KeyCreated, &api_key.id), || async {
            store.add_key(&api_key, &made).await.map(|()| true)
        }),
        act("revoke_key", (KeyRevoked, &api_key.id), || {
            store.revoke_key(&api_key.id, now(), &revoked)
        }),
        act("revoke_keys_of", (KeyRevoked, &owned_key.id), || async {
            let event = event(KeyRevoked);
            let revoked = store.revoke_keys_of("dr-who", None, now(), &event).await?;
            Ok(revoked.len() == 1)
        }),
        act("open_access", (AccessOpened, ""), || {
            store.open_access(now(), &opened)
        }),
        act("prune", (AuditPruned, ""), || async {
            Ok(store.prune(soon, now()).await? > 0)
        })
        .by("ventriform"),
    ];
    let recorder = Arc::new(Recorder::start(store.clone(), Arc::new(SystemClock)));
    let agent = Agent::new(recorder, Arc::new(SystemClock), t.clone(), "clerk");
    for act in acts {
        let made = || Agent::scope(Some(agent.clone()), (act.make)());
        let rows = newest_row(store).await.0;
        assert!(on.tamper(on.without_trail()).await);
        assert!(made().await.is_err(), "{}: there can be no row", act.name);
        assert!(on.tamper(on.with_trail()).await);
        assert_eq!(newest_row(store).await.0, rows, "{}", act.name);
        assert!(
            made().await.unwrap(),
            "{}: the change was not undone",
            act.name
        );
        let (sequence, event) = newest_row(store).await;
        assert_eq!(sequence, rows + 1, "{}: one row", act.name);
        assert_eq!(
            (event.activity, &*event.agent),
            (act.activity, act.by),
            "{}",
            act.name
        );
        if !act.object.is_empty() {
            assert_eq!(event.object.as_ref(), Some(&act.object), "{}", act.name);
        }
    }
    assert_eq!(verify(&**store).await.unwrap().broken, None);
}

/// The position of the newest row of the trail, and what it says.
async fn newest_row(store: &SqlStore) -> (i64, AuditEvent) {
    let page = ListRequest {
        before: None,
        limit: 1,
    };
    let rows = store
        .audit(&AuditFilter::default(), page)
        .await
        .unwrap()
        .items;
    let nothing = || AuditEvent::new(0, Activity::Read, tenant(), String::new());
    rows.into_iter()
        .next()
        .map_or_else(|| (0, nothing()), |row| (row.sequence, row.event))
}

fn series_source() -> SeriesSource {
    SeriesSource {
        archive: Some("pacs".into()),
        dicomweb: None,
        study: "1.2".into(),
        series: "1.2.3".into(),
    }
}

fn product_of_kind(kind: Resource) -> Product {
    product(random_id(kind.prefix()), None)
}

async fn figures_are_counted(on: &Stores) {
    let volume = on.volume(&tenant()).await;
    let job = on.file(&new_job(&volume)).await;
    on.a.add_product(&model(&volume), &tenant(), Some(&volume), AMPLE_ROOM)
        .await
        .unwrap();
    let figures = on.b.queue_figures().await.unwrap();
    assert_eq!(figures.oldest_queued_at, Some(job.created_at));
    let counted: BTreeMap<_, _> = figures
        .items
        .iter()
        .map(|(kind, n)| (kind.noun(), *n))
        .collect();
    assert_eq!(
        (counted["volume"], counted["model"], counted["template"]),
        (1, 1, 0)
    );
}

// ------------------------------------------------------------------------------ PostgreSQL alone

/// Tables, views and columns of a schema, without those of the engine and of the migrations.
fn columns(rows: Vec<(String, String)>) -> BTreeSet<(String, String)> {
    let own = |table: &str| !table.starts_with("sqlite_") && !table.starts_with("_sqlx");
    rows.into_iter().filter(|(table, _)| own(table)).collect()
}

#[tokio::test]
async fn both_engines_have_the_same_tables() {
    use sqlx::{ConnectOptions, Connection};
    let (file, on_server) = (Stores::sqlite().await, Stores::postgres().await);
    let options = sqlx::sqlite::SqliteConnectOptions::new();
    let path = file.folder.path().join("contract.db");
    let mut connection = options.filename(path).connect().await.unwrap();
    let sqlite = sqlx::query_as(
        "SELECT t.name, c.name FROM sqlite_schema AS t, pragma_table_xinfo(t.name) AS c
         WHERE t.type IN ('table', 'view')",
    );
    let sqlite = columns(sqlite.fetch_all(&mut connection).await.unwrap());
    let mut connection = sqlx::PgConnection::connect(&on_server.url.unwrap())
        .await
        .unwrap();
    let postgres = sqlx::query_as(
        "SELECT table_name::text, column_name::text FROM information_schema.columns
         WHERE table_schema = 'public'",
    );
    let mut postgres = columns(postgres.fetch_all(&mut connection).await.unwrap());
    // SQLite keeps it in its own table of sequences.
    postgres.retain(|(table, _)| table != "audit_greatest");
    // One process uses a file.
    let of_processes = [
        "runs",
        "holds",
        "duties",
        "store_place",
        "given_up_places",
        "oldest_program",
    ];
    postgres.retain(|(table, _)| !of_processes.contains(&table.as_str()));
    assert_eq!(sqlite, postgres);
    assert!(sqlite.len() > 150, "{}", sqlite.len());
}

/// The indexes that begin with the tenant, by which lists are read: their names and columns.
fn indexes(rows: Vec<(String, String)>) -> BTreeSet<(String, String)> {
    let columns = rows.into_iter().filter_map(|(name, statement)| {
        let (_, rest) = statement.split_once('(')?;
        let (columns, _) = rest.split_once(')')?;
        Some((name, columns.to_owned()))
    });
    columns
        .filter(|(_, columns)| columns.starts_with("tenant, "))
        .collect()
}

#[tokio::test]
async fn both_engines_have_the_same_indexes_of_tenants() {
    use sqlx::{ConnectOptions, Connection};
    let (file, on_server) = (Stores::sqlite().await, Stores::postgres().await);
    let path = file.folder.path().join("contract.db");
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(path);
    let mut connection = options.connect().await.unwrap();
    let sqlite = sqlx::query_as(
        "SELECT name, sql FROM sqlite_schema WHERE type = 'index' AND sql IS NOT NULL",
    );
    let sqlite = indexes(sqlite.fetch_all(&mut connection).await.unwrap());
    let mut connection = sqlx::PgConnection::connect(&on_server.url.unwrap())
        .await
        .unwrap();
    let postgres = sqlx::query_as(
        "SELECT indexname::text, indexdef FROM pg_indexes
         WHERE schemaname = 'public' AND indexname NOT LIKE '%_key' AND indexname NOT LIKE '%_pkey'",
    );
    let postgres = indexes(postgres.fetch_all(&mut connection).await.unwrap());
    assert_eq!(sqlite, postgres);
    assert!(sqlite.len() > 20, "{}", sqlite.len());
}

async fn connect(url: &str) -> Result<SqlStore, PostgresError> {
    let gauge = DiskGauge::new(std::path::Path::new("/tmp"), Some(0));
    SqlStore::connect(&reached(url), CONNECT_WAIT, gauge).await
}

/// The first half of a rolling upgrade: the next version adds to the tables while this one runs, and this one is
/// started once more.
#[tokio::test]
async fn a_process_goes_on_while_the_next_version_adds_to_the_tables() {
    let on = Stores::postgres().await;
    let url = on.url.clone().unwrap();
    let name = url.rsplit('/').next().unwrap();
    let volume = on.volume(&tenant()).await;
    let mut filed = Vec::new();
    for round in 0..4 {
        // Each connection has prepared each statement several times over.
        for _ in 0..10 {
            // A transaction that meets the change is told to come again, and nothing of it stays.
            let job = loop {
                match on.a.file(&new_job(&volume), 1000, now()).await {
                    Ok(Filed::New(job)) => break job,
                    Err(error) if error.cause() == StoreFault::Busy && round > 0 => {}
                    other => panic!("{other:?}"),
                }
            };
            filed.push(job.id.clone());
            assert_eq!(on.a.job(&job.id).await.unwrap().unwrap().id, job.id);
            let listed = on.a.jobs(&JobFilter::default(), ALL).await.unwrap();
            assert_eq!(listed.items.len(), filed.len());
            let (claimed, lease) = claim(&on.a, "run_a").await.unwrap();
            assert_eq!(claimed.id, job.id);
            on.a.progress(&lease, "surface", 0.5)
                .await
                .unwrap()
                .unwrap();
            let ended = JobOutcome::Failed(failure("no-surface"));
            loop {
                match on.a.finish(&lease, &ended, now()).await {
                    Ok(job) => break assert!(job.is_some()),
                    Err(error) => assert_eq!(error.cause(), StoreFault::Busy, "{error}"),
                }
            }
        }
        let added = format!(
            "ALTER TABLE jobs ADD COLUMN added_{round} BIGINT NOT NULL DEFAULT 0;
             ALTER TABLE volumes ADD COLUMN added_{round} TEXT;
             CREATE TABLE added_{round} (id BIGINT);
             INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
             VALUES (1000 + {round}, 'newer', true, '', 0)"
        );
        server().run(name, &added).await;
    }
    let again = connect(&url).await.unwrap();
    assert_eq!(again.job(&filed[0]).await.unwrap().unwrap().id, filed[0]);
    again.close().await;
}

#[tokio::test]
async fn a_database_that_cannot_be_used_is_refused_with_advice() {
    let refused = async |url: &str| connect(url).await.err().unwrap().to_string();
    let url = server().url("there_is_none");
    assert!(refused(&url).await.contains("CREATE DATABASE"));
    // No rights.
    let url = server().database().await;
    let name = url.rsplit('/').next().unwrap();
    let setup = "CREATE ROLE guest_of_tests LOGIN";
    let _ = tokio::spawn(async move { server().run("postgres", setup).await }).await;
    let as_guest = url.replace("tests@", "guest_of_tests@");
    assert!(refused(&as_guest).await.contains("GRANT CREATE"));
    // Somebody else's tables.
    server().run(name, "CREATE TABLE jobs (id int)").await;
    assert!(refused(&url).await.contains("empty database"));
    // Tables of a newer version, on which this one does not work.
    let url = server().database().await;
    let name = url.rsplit('/').next().unwrap();
    connect(&url).await.unwrap().close().await;
    let newer =
        "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
                 VALUES (9999, 'newer', true, '', 0)";
    server().run(name, newer).await;
    server()
        .run(name, "UPDATE oldest_program SET version = 9999")
        .await;
    assert!(refused(&url).await.contains("newer version"));
    // Another encoding.
    let latin = "CREATE DATABASE latin_of_tests ENCODING 'LATIN1' TEMPLATE template0";
    server().run("postgres", latin).await;
    assert!(
        refused(&server().url("latin_of_tests"))
            .await
            .contains("UTF8")
    );
}

#[tokio::test]
async fn a_folder_and_a_database_that_do_not_belong_together_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let on = async |database: Option<&str>| {
        let settings = StoreSettings {
            database: database.map(reached),
            ..StoreSettings::default()
        };
        Store::open_with(folder.path(), settings).await
    };
    let (url, wrong) = (server().database().await, server().database().await);
    let mut store = on(Some(&url)).await.unwrap();
    store.close().await;
    drop(store);
    std::fs::create_dir_all(folder.path().join("volumes/vol_1")).unwrap();
    let error = on(Some(&wrong)).await.err().unwrap().to_string();
    assert!(error.contains("is empty"), "{error}");
    let error = advised(&on(None).await.err().unwrap().into());
    assert!(error.contains("--database"), "{error}");
    let error = ventriform_store::examine(folder.path(), None, None).await;
    let error = advised(&error.unwrap_err().into());
    assert!(error.contains("pg_dump"), "{error}");
    std::fs::remove_file(folder.path().join("database")).unwrap();
    std::fs::write(folder.path().join("ventriform.db"), "").unwrap();
    let error = advised(&on(Some(&url)).await.err().unwrap().into());
    assert!(error.contains("Start without --database"), "{error}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_is_away_is_waited_for_and_never_answered_for() {
    let server = Arc::new(tokio::task::spawn_blocking(Server::new).await.unwrap());
    let again = |word: Option<&'static str>| {
        let server = server.clone();
        tokio::task::spawn_blocking(move || match word {
            Some(word) => server.end(word),
            None => server.start(),
        })
    };
    let url = server.database().await;
    // Away at the start: it is waited for.
    again(Some("stop")).await.unwrap();
    let mut impatient = reached(&url);
    impatient.patience = Duration::from_millis(300);
    let gauge = || DiskGauge::new(std::path::Path::new("/tmp"), Some(0));
    let error = SqlStore::connect(&impatient, CONNECT_WAIT, gauge())
        .await
        .err()
        .unwrap();
    assert!(
        matches!(error, PostgresError::Unreachable { .. }),
        "{error}"
    );
    let patient = reached(&url);
    let started = tokio::join!(SqlStore::connect(&patient, SHORT_WAIT, gauge()), async {
        tokio::time::sleep(Duration::from_millis(500)).await;
        again(None).await.unwrap();
    });
    let store = started.0.unwrap();
    let volume = stored_volume("vol_1", 1);
    let tags = Tags::default();
    store
        .add_volume(&volume, &tenant(), &tags, None)
        .await
        .unwrap();
    for word in ["crash", "stop"] {
        again(Some(word)).await.unwrap();
        let short = tokio::time::timeout(CONNECT_WAIT, async {
            let read = store.volume(&tenant(), "vol_1").await.unwrap_err();
            let written = store
                .add_volume(&volume, &tenant(), &tags, None)
                .await
                .unwrap_err();
            let checked = store.check().await.unwrap_err();
            [read.cause(), written.cause(), checked.cause()]
        });
        assert_eq!(short.await.unwrap(), [StoreFault::Away; 3]);
        again(None).await.unwrap();
        // Back again, with all that was acknowledged, and without another start.
        assert!(store.volume(&tenant(), "vol_1").await.unwrap().is_some());
        assert!(
            !store
                .add_volume(&volume, &tenant(), &tags, None)
                .await
                .unwrap()
        );
        store.check().await.unwrap();
    }
}

/// Changes of rows in every table that counts, in orders that the service has only after a loss: content that comes
/// after its owners or goes before them, and rows that change their tenant.
const CHANGES_OF_ROWS: [&str; 32] = [
    "INSERT INTO holdings (tenant, id, kind, created_at, renewed_at)
     VALUES ('ta', 'vol_1', 'volume', 1, 1), ('tb', 'vol_1', 'volume', 1, 1)",
    "INSERT INTO volumes (id, created_at, bytes, files, facts) VALUES ('vol_1', 1, 100, '[]', '{}')",
    "INSERT INTO volumes (id, created_at, bytes, files, facts) VALUES ('vol_1', 1, 7, '[]', '{}')
     ON CONFLICT (id) DO UPDATE SET files = excluded.files",
    "UPDATE volumes SET bytes = 250 WHERE id = 'vol_1'",
    "INSERT INTO products (id, kind, created_at, parameters, summary, software, files)
     VALUES ('mdl_1', 'model', 1, '{}', '{}', '', '[{\"bytes\": 30, \"place\": \"1\"}]'),
            ('tpl_1', 'template', 1, '{}', '{}', '', '[]')",
    "INSERT INTO holdings (tenant, id, kind, created_at, renewed_at)
     VALUES ('ta', 'mdl_1', 'model', 1, 1), ('tb', 'mdl_1', 'model', 1, 1), ('tb', 'tpl_1', 'template', 1, 1)",
    "INSERT INTO holdings (tenant, id, kind, created_at, renewed_at) VALUES ('ta', 'mdl_1', 'model', 1, 1)
     ON CONFLICT (tenant, id) DO UPDATE SET renewed_at = 2",
    "UPDATE products SET files = '[{\"bytes\": 3, \"place\": \"1\"}, {\"bytes\": 4, \"place\": \"2\"}]'",
    "UPDATE holdings SET tenant = 'tc' WHERE tenant = 'ta'",
    "DELETE FROM products WHERE id = 'mdl_1'",
    "INSERT INTO products (id, kind, created_at, parameters, summary, software, files)
     VALUES ('mdl_1', 'model', 1, '{}', '{}', '', '[{\"bytes\": 31, \"place\": \"3\"}]')
     ON CONFLICT (id) DO NOTHING",
    "DELETE FROM holdings WHERE id = 'mdl_1' AND tenant = 'tb'",
    "INSERT INTO jobs (id, tenant, kind, volume, parameters, created_at, source)
     VALUES ('job_1', 'ta', 'model', 'vol_1', '{}', 1, '{\"archive\": \"a\", \"study\": \"1.2\"}'),
            ('job_2', 'tc', 'model', 'vol_1', '{}', 1, '{\"archive\": \"a\", \"study\": \"1.2.3\"}')",
    "UPDATE jobs SET labels = '{\"a\": \"\u{e4}\"}', external_id = 'x' WHERE id = 'job_1'",
    "UPDATE jobs SET state = 'running', progress = 0.5, revision = 2",
    "UPDATE jobs SET tenant = 'tb' WHERE id = 'job_1'",
    "DELETE FROM holdings WHERE tenant = 'tc' AND id = 'vol_1'",
    "DELETE FROM jobs WHERE id = 'job_2'",
    "INSERT INTO intake_groups (id, tenant, study, series, instance, image_type, protocol, sender, state,
                                revision, created_at, changed_at)
     VALUES ('grp_1', 'ta', '1', '2', '', '[]', 'stow-rs', '', 'gathering', 1, 1, 1)",
    "INSERT INTO intake_objects (tenant, sop_instance, group_id, data_sha256, file_sha256, file, bytes, received_at)
     VALUES ('ta', '1.1', 'grp_1', '', '', 'f1', 40, 1), ('ta', '1.2', 'grp_1', '', '', 'f2', 50, 1),
            ('ta', '1.3', 'grp_1', '', '', NULL, 60, 1)",
    "UPDATE intake_objects SET file = NULL WHERE file = 'f1'",
    "UPDATE intake_objects SET bytes = 55 WHERE file = 'f2'",
    "UPDATE intake_objects SET tenant = 'tb' WHERE file = 'f2'",
    "UPDATE intake_objects SET file = 'f1' WHERE sop_instance = '1.1'",
    "DELETE FROM intake_objects WHERE file = 'f1'",
    "DELETE FROM intake_groups",
    "INSERT INTO workitems (tenant, uid, state, attributes, changed_at)
     VALUES ('ta', '1', 'SCHEDULED', '{\"a\": \"\u{e4}\"}', 1), ('tb', '1', 'SCHEDULED', '{}', 1)",
    "UPDATE workitems SET state = 'COMPLETED', attributes = '{\"a\": 1}' WHERE tenant = 'ta'",
    "UPDATE workitems SET tenant = 'tc' WHERE tenant = 'ta'",
    "DELETE FROM workitems",
    "DELETE FROM volumes",
    "DELETE FROM products",
];

async fn totals_follow_every_change_of_a_row(on: &Stores) {
    for change in CHANGES_OF_ROWS {
        assert!(on.tamper(change).await, "{change}");
        let wrong = on.a.wrong_totals().await.unwrap();
        assert!(wrong.is_empty(), "{change}: {wrong:?}");
    }
    // A total that nobody keeps is noticed.
    assert!(on.tamper("UPDATE stored_bytes SET bytes = bytes + 1").await);
    assert_eq!(on.a.wrong_totals().await.unwrap().len(), 3);
    assert!(on.tamper("UPDATE stored_bytes SET bytes = bytes - 1").await);
}

async fn everything_stored_counts_for_its_tenant(on: &Stores) {
    let bytes = async |tenant: &Tenant| on.b.usage(tenant).await.unwrap().bytes;
    let other: Tenant = "other".parse().unwrap();
    let before = bytes(&tenant()).await;
    let volume = on.volume(&tenant()).await;
    let size = bytes(&tenant()).await - before;
    assert!(size > 0);
    // A product: new, again, one more of its kind than there may be, and larger than there is room for.
    let mut template = product(random_id(Resource::Template.prefix()), None);
    template.files.push(ProductFile {
        name: "mesh.glb".into(),
        bytes: 5000,
        ..template.files[0].clone()
    });
    let add = async |product: &Product, room: ProductRoom| {
        let added = on.a.add_product(product, &other, None, room);
        added.await.unwrap()
    };
    let limits = |count, bytes| ProductRoom {
        count,
        bytes: Some(bytes),
    };
    let too_large = AddedProduct::TooLarge { stored: 0 };
    assert_eq!(add(&template, limits(1, 5001)).await, too_large);
    assert_eq!(bytes(&other).await, 0);
    assert_eq!(add(&template, limits(1, 5002)).await, AddedProduct::New);
    assert_eq!(add(&template, limits(1, 0)).await, AddedProduct::Known);
    assert_eq!(bytes(&other).await, 5002);
    let second = product(random_id(Resource::Template.prefix()), None);
    assert_eq!(add(&second, limits(1, 9000)).await, AddedProduct::TooMany);
    let reader = product(random_id(Resource::Reader.prefix()), None);
    assert_eq!(add(&reader, limits(1, 9000)).await, AddedProduct::New);
    assert_eq!(bytes(&other).await, 5004);
    // Files that are replaced, a work item, and one that grows.
    template.files.truncate(1);
    let amended = ItemRecord::Product(template.clone());
    on.a.amend(&amended).await.unwrap();
    assert_eq!(bytes(&other).await, 4);
    let text = "\u{e4}".repeat(100);
    let mut item = workitem("1.7.1", &text);
    item.tenant = other.clone();
    on.a.add_workitem(&item, 10).await.unwrap();
    let stored = serde_json::to_string(item.attributes.object()).unwrap();
    assert_eq!(bytes(&other).await, 4 + stored.len() as u64);
    // The record of a job: alike on both engines, however it ends, with its texts, until it is deleted.
    let tagged = NewJob {
        tags: Tags {
            labels: [("\u{e4}".to_owned(), "\u{e4}".repeat(100))].into(),
            ..Tags::default()
        },
        ..new_job(&volume)
    };
    let filed = on.file(&new_job(&volume)).await;
    let of_job = bytes(&tenant()).await - before - size;
    let texts = on.b.text_bytes(&new_job(&volume)).unwrap();
    assert_eq!(of_job, 2048 + texts);
    assert!((2048..2500).contains(&of_job), "{of_job}");
    let with_tags = on.file(&tagged).await;
    let added = bytes(&tenant()).await - before - size - of_job;
    assert_eq!(added, of_job + 207, "the text of the labels in UTF-8");
    let all_texts = NewJob {
        parameters: object(json!({"\u{e4}": [1, 2.5, "\u{1f9e1}"]})),
        needs: [("expert".to_owned(), volume.clone())].into(),
        tags: Tags {
            external_id: Some("\u{e4}".into()),
            ..tagged.tags.clone()
        },
        volume: None,
        source: Some(SeriesSource {
            archive: Some("pacs".into()),
            dicomweb: None,
            study: "1.2".into(),
            series: "1.2.3".into(),
        }),
        send: Some(SendOrder {
            names: vec!["mesh.dcm".into()],
            to: "pacs".into(),
        }),
        webhook: Some(JobWebhook {
            url: "https://own.example/\u{e4}".into(),
            destination: "https://own.example:443".into(),
            events: vec!["failed".into()],
            secret: None,
        }),
        ..new_job(&volume)
    };
    let with_all = on.file(&all_texts).await;
    let added = bytes(&tenant()).await - before - size - of_job - added;
    assert_eq!(added, 2048 + on.b.text_bytes(&all_texts).unwrap());
    for job in [filed, with_tags, with_all] {
        on.a.interrupt(&job.id, now()).await.unwrap();
        on.a.delete_job(&job.id, None, now()).await.unwrap();
    }
    assert_eq!(bytes(&tenant()).await, before + size);
    // A result: as many bytes as the tenant may store, or the job fails and nothing is added.
    for (limit, state) in [
        (size + of_job + 1, JobState::Failed),
        (size + 2 * of_job + 2, JobState::Succeeded),
    ] {
        let job = NewJob {
            storage_limit: Some(before + limit),
            ..new_job(&volume)
        };
        on.file(&job).await;
        let claimed = on.claim().await.unwrap();
        let made = model(&volume);
        let outcome = JobOutcome::Succeeded(Box::new(made.clone()));
        let ended =
            on.a.finish(&claimed.1, &outcome, now())
                .await
                .unwrap()
                .unwrap();
        assert_eq!(ended.state, state, "{limit}");
        let failed = state == JobState::Failed;
        assert_eq!(ended.failure.is_some(), failed);
        assert_eq!(ended.result.is_none(), failed);
        let stored = on.b.product(&tenant(), &made.id).await.unwrap();
        assert_eq!(stored.is_none(), failed);
    }
    assert_eq!(bytes(&tenant()).await, before + size + 2 * of_job + 2);
}

async fn a_full_queue_and_a_full_intake_keep_a_share_for_others(on: &Stores) {
    let tenants: [Tenant; 3] = ["a", "b", "c"].map(|name| name.parse().unwrap());
    let mut accepted = Vec::new();
    for tenant in &tenants {
        let volume = on.volume(tenant).await;
        let mut count = 0;
        loop {
            let has_room = on.b.has_room(tenant, 6).await.unwrap();
            let job = NewJob {
                tenant: tenant.clone(),
                ..new_job(&volume)
            };
            match on.a.file(&job, 6, now()).await.unwrap() {
                Filed::New(_) => assert!(has_room),
                Filed::QueueFull => break assert!(!has_room),
                other => panic!("{other:?}"),
            }
            count += 1;
        }
        accepted.push(count);
    }
    assert_eq!(accepted, [6, 3, 2]);
    // Received objects likewise; those that make up no volume count for their tenant alone.
    let room = IntakeRoom {
        objects: 6,
        bytes: 1000,
        tenant_bytes: None,
    };
    let mut accepted = Vec::new();
    for tenant in &tenants {
        let mut count = 0;
        loop {
            let object = received_object(tenant, &format!("{count}"));
            match on.a.add(&object, room, now()).await.unwrap() {
                Added::New(..) => count += 1,
                Added::NoRoom => break,
                other => panic!("{other:?}"),
            }
        }
        accepted.push(count);
    }
    assert_eq!(accepted, [6, 3, 2]);
    for group in on.b.unfinished().await.unwrap() {
        if group.origin.tenant == tenants[0] {
            let why = failure("no");
            let failed = on.a.failed(&group.id, group.revision, &why, now());
            failed.await.unwrap();
        }
    }
    let another = received_object(&tenants[0], "another");
    let refused = on.a.add(&another, room, now()).await.unwrap();
    assert_eq!(
        refused,
        Added::NoRoom,
        "its own room is taken by what failed"
    );
    let another = received_object(&tenants[1], "another");
    let taken = on.a.add(&another, room, now()).await.unwrap();
    assert!(matches!(taken, Added::New(..)));
}

async fn work_items_are_read_in_batches_of_few_bytes(on: &Stores) {
    let large = BATCH_BYTES as usize * 2 / 5;
    for (n, size) in [large, large, large, large, 10, 3 * large, 10]
        .into_iter()
        .enumerate()
    {
        let item = workitem(&format!("1.8.{n}"), &"x".repeat(size));
        on.a.add_workitem(&item, 100).await.unwrap();
    }
    let (mut after, mut batches) = (0, Vec::new());
    loop {
        let batch = on.b.workitems(&tenant(), None, after, 100).await.unwrap();
        let Some(last) = batch.last() else { break };
        after = last.sequence;
        batches.push(batch.len());
    }
    // Each ends with the item that exceeds the bound.
    assert_eq!(batches, [3, 3, 1]);
    let owner = tenant();
    let scheduled = Some(WorkitemState::Scheduled);
    let few = on.b.workitems(&owner, scheduled, 0, 2);
    assert_eq!(few.await.unwrap().len(), 2);
    assert_eq!(on.b.scheduled_workitems(0, 100).await.unwrap().len(), 3);
}

fn workitem(uid: &str, label: &str) -> Workitem {
    Workitem {
        tenant: tenant(),
        uid: uid.into(),
        sequence: 0,
        revision: 0,
        state: WorkitemState::Scheduled,
        transaction: None,
        performer: Performer::None,
        attributes: DataSetJson::from_object(object(json!({
            "00741000": {"vr": "CS", "Value": ["SCHEDULED"]},
            "00741204": {"vr": "LO", "Value": [label]},
        })))
        .unwrap(),
        changed_at: now(),
    }
}

fn object_of(tenant: &Tenant, instance: &str, data: &str) -> NewObject {
    NewObject {
        origin: Origin {
            tenant: tenant.clone(),
            protocol: Protocol::CStore,
            sender: "CAMERA".into(),
            address: "10.0.0.1".into(),
        },
        header: DicomHeader {
            sop_class: "1.2.840.10008.5.1.4.1.1.20".into(),
            sop_instance: instance.into(),
            study: "1.2".into(),
            series: "1.2.3".into(),
            is_part: true,
            gates: None,
            modality: Some("NM".into()),
            image_type: vec!["ORIGINAL".into()],
            study_description: None,
            data_set: 0,
        },
        data_sha256: data.into(),
        file_sha256: data.into(),
        file: format!("file-{instance}-{data}"),
        bytes: 10,
        recorded: RecordedGroups::default(),
    }
}

fn received_object(tenant: &Tenant, instance: &str) -> NewObject {
    object_of(tenant, instance, instance)
}
