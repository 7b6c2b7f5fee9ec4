//! Figures for Prometheus.
//!
//! Counters and histograms are counted where things happen; gauges are read when somebody asks.
//! Names follow Prometheus: base units, `_total` for counters. Every label has a fixed set of
//! values: the pattern of a path and never the path, the code of a failure and never its text.

use crate::base::records::{DiskSpace, QueueFigures, QueueLoad, Timestamp};
use crate::config::Settings;
use crate::network::archive::ArchiveReadings;
use crate::network::hooks::{Backlog, DeliveryCounts};
use crate::network::intake::{AssociationEnd, IntakeObserver, Protocol};
use prometheus::core::Collector;
use prometheus::{
    Encoder, Gauge, Histogram, HistogramOpts, HistogramVec, IntCounter, IntCounterVec, IntGauge,
    IntGaugeVec, Opts, Registry, TextEncoder,
};
use std::path::Path;
use std::time::Instant;

type Made<T> = Result<T, prometheus::Error>;

/// Upper bounds of an answer's time, seconds.
const ANSWER_SECONDS: [f64; 12] = [
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 5.0, 30.0,
];

/// Upper bounds of the time of jobs and stages, seconds.
const JOB_SECONDS: [f64; 13] = [
    0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 60.0, 120.0, 300.0, 600.0, 3600.0,
];

/// The metrics of one service.
pub struct Metrics {
    registry: Registry,
    /// Requests.
    pub requests: RequestMetrics,
    /// Jobs, as they change.
    pub jobs: JobMetrics,
    /// Received objects.
    pub intake: IntakeMetrics,
    stored: Gauges,
    started: Instant,
}

/// Figures on requests.
#[derive(Clone)]
pub struct RequestMetrics {
    /// Answers by method, route and status.
    pub answers: IntCounterVec,
    /// Time until an answer began, by method, route and class of status.
    pub durations: HistogramVec,
    /// Requests without an answer yet.
    pub in_flight: IntGauge,
    /// Requests whose client went away before the answer.
    pub abandoned: IntCounter,
    /// Bytes of bodies that arrived.
    pub received: IntCounter,
    /// Bytes of bodies that were sent.
    pub sent: IntCounter,
    /// Open connections.
    pub connections: IntGauge,
    /// Time until the decoding of an upload or a preview begins.
    pub decoding_waits: Histogram,
}

/// Figures on jobs.
#[derive(Clone)]
pub struct JobMetrics {
    /// Accepted jobs by kind.
    pub filed: IntCounterVec,
    /// Starts by kind.
    pub attempts: IntCounterVec,
    /// Starts after the first, by kind.
    pub retries: IntCounterVec,
    /// Ended jobs by kind and state.
    pub finished: IntCounterVec,
    /// Failed jobs by kind and cause.
    pub failures: IntCounterVec,
    /// Time from filing to the first start, by kind.
    pub waits: HistogramVec,
    /// Time from the last start to the end, by kind and state.
    pub durations: HistogramVec,
    /// Time of stages, by kind and stage.
    pub stages: HistogramVec,
}

/// Figures on received objects.
#[derive(Clone)]
pub struct IntakeMetrics {
    /// Connections for DICOM that have ended, by how.
    ended: IntCounterVec,
    /// Open associations.
    associations: IntGauge,
    /// Objects by protocol and outcome.
    objects: IntCounterVec,
    /// Their bytes by protocol.
    bytes: IntCounterVec,
    /// Groups of objects by outcome.
    groups: IntCounterVec,
}

impl IntakeObserver for IntakeMetrics {
    fn associated(&self) {
        self.associations.inc();
    }

    fn ended(&self, end: AssociationEnd, accepted: bool) {
        self.ended.with_label_values(&[end.as_str()]).inc();
        if accepted {
            self.associations.dec();
        }
    }

    fn object(&self, protocol: Protocol, outcome: &'static str, bytes: u64) {
        let protocol = protocol.as_str();
        self.objects.with_label_values(&[protocol, outcome]).inc();
        self.bytes.with_label_values(&[protocol]).inc_by(bytes);
    }

    fn group(&self, made: bool) {
        let outcome = if made { "stored" } else { "failed" };
        self.groups.with_label_values(&[outcome]).inc();
    }
}

/// Gauges that are read when somebody asks.
struct Gauges {
    jobs: IntGaugeVec,
    oldest_queued: Gauge,
    queue_limit: IntGauge,
    items: IntGaugeVec,
    ready: IntGauge,
    uptime: Gauge,
    disk_size: IntGauge,
    disk_free: IntGauge,
    database: IntGauge,
    write_ahead_log: IntGauge,
    hook_attempts: IntCounterVec,
    hooks_given_up: IntCounter,
    hooks_pending: IntGauge,
    hooks_dead: IntGauge,
    oldest_hook: Gauge,
    received_waiting: IntGauge,
    received_waiting_bytes: IntGauge,
    fetches: IntCounterVec,
    fetches_pending: IntGauge,
    deliveries: IntCounterVec,
    deliveries_pending: IntGauge,
    deliveries_dead: IntGauge,
    oldest_delivery: Gauge,
}

/// Makes metrics and registers them.
struct Maker<'a>(&'a Registry);

impl Maker<'_> {
    fn keep<M: Collector + Clone + 'static>(&self, metric: Made<M>) -> Made<M> {
        let metric = metric?;
        self.0.register(Box::new(metric.clone()))?;
        Ok(metric)
    }

    fn counter(&self, name: &str, help: &str) -> Made<IntCounter> {
        self.keep(IntCounter::new(name, help))
    }

    fn counters(&self, name: &str, help: &str, labels: &[&str]) -> Made<IntCounterVec> {
        self.keep(IntCounterVec::new(Opts::new(name, help), labels))
    }

    fn whole(&self, name: &str, help: &str) -> Made<IntGauge> {
        self.keep(IntGauge::new(name, help))
    }

    fn wholes(&self, name: &str, help: &str, labels: &[&str]) -> Made<IntGaugeVec> {
        self.keep(IntGaugeVec::new(Opts::new(name, help), labels))
    }

    fn gauge(&self, name: &str, help: &str) -> Made<Gauge> {
        self.keep(Gauge::new(name, help))
    }

    fn histogram(&self, name: &str, help: &str, bounds: &[f64]) -> Made<Histogram> {
        let options = HistogramOpts::new(name, help).buckets(bounds.to_vec());
        self.keep(Histogram::with_opts(options))
    }

    fn histograms(
        &self,
        name: &str,
        help: &str,
        labels: &[&str],
        bounds: &[f64],
    ) -> Made<HistogramVec> {
        let options = HistogramOpts::new(name, help).buckets(bounds.to_vec());
        self.keep(HistogramVec::new(options, labels))
    }
}

impl Default for Metrics {
    fn default() -> Self {
        Self::new()
    }
}

impl Metrics {
    /// The metrics of a service that starts now: all are 0.
    ///
    /// # Panics
    /// Never: the names are valid and distinct.
    pub fn new() -> Self {
        Self::registered().expect("the names of the metrics are valid and distinct")
    }

    fn registered() -> Made<Self> {
        let registry = Registry::new();
        let make = Maker(&registry);
        let build = make.wholes("ventriform_build_info", "Always 1.", &["version"])?;
        build.with_label_values(&[env!("CARGO_PKG_VERSION")]).set(1);
        #[cfg(target_os = "linux")]
        registry.register(Box::new(
            prometheus::process_collector::ProcessCollector::for_self(),
        ))?;
        Ok(Self {
            requests: RequestMetrics::registered(&make)?,
            jobs: JobMetrics::registered(&make)?,
            intake: IntakeMetrics::registered(&make)?,
            stored: Gauges::registered(&make)?,
            registry,
            started: Instant::now(),
        })
    }

    /// All figures in the text format of Prometheus (version 0.0.4).
    pub fn text(&self, reading: &MetricReadings<'_>) -> String {
        self.stored.read(reading);
        self.stored.uptime.set(self.started.elapsed().as_secs_f64());
        let mut text = Vec::new();
        // Writing to memory fails only for metrics without a value, and there are none.
        let _ = TextEncoder::new().encode(&self.registry.gather(), &mut text);
        String::from_utf8_lossy(&text).into_owned()
    }
}

/// Readings from elsewhere.
pub struct MetricReadings<'a> {
    /// The load of the queue.
    pub load: QueueLoad,
    /// Numbers of waiting jobs and stored items.
    pub figures: QueueFigures,
    /// Number and bytes of received objects that are not part of a volume.
    pub received: (u64, u64),
    /// Webhooks that wait.
    pub backlog: Backlog,
    /// Webhooks that were sent.
    pub sent: &'a DeliveryCounts,
    /// Archives.
    pub archives: ArchiveReadings<'a>,
    /// Whether the storage works.
    pub ready: bool,
    /// The space of the disk, where it is known.
    pub space: Option<DiskSpace>,
    /// The operator's settings.
    pub settings: &'a Settings,
    /// The time of day.
    pub now: Timestamp,
}

impl RequestMetrics {
    fn registered(make: &Maker<'_>) -> Made<Self> {
        Ok(Self {
            answers: make.counters(
                "ventriform_http_requests_total",
                "Answered requests by method, pattern of the path, and status.",
                &["method", "route", "status"],
            )?,
            durations: make.histograms(
                "ventriform_http_request_duration_seconds",
                "Time until an answer began, by method, pattern of the path, and class of status.",
                &["method", "route", "class"],
                &ANSWER_SECONDS,
            )?,
            in_flight: make.whole(
                "ventriform_http_requests_in_flight",
                "Requests that wait for their answer to begin.",
            )?,
            abandoned: make.counter(
                "ventriform_http_requests_abandoned_total",
                "Requests whose client went away before the answer began.",
            )?,
            received: make.counter(
                "ventriform_http_received_bytes_total",
                "Bytes of the bodies of requests.",
            )?,
            sent: make.counter(
                "ventriform_http_sent_bytes_total",
                "Bytes of the bodies of answers.",
            )?,
            connections: make.whole("ventriform_http_connections", "Open connections.")?,
            decoding_waits: make.histogram(
                "ventriform_decoding_wait_seconds",
                "Time until the decoding of an upload or a preview begins.",
                &ANSWER_SECONDS,
            )?,
        })
    }
}

impl JobMetrics {
    fn registered(make: &Maker<'_>) -> Made<Self> {
        Ok(Self {
            filed: make.counters("ventriform_jobs_filed_total", "Accepted jobs.", &["kind"])?,
            attempts: make.counters(
                "ventriform_job_attempts_total",
                "Times that a worker started a job.",
                &["kind"],
            )?,
            retries: make.counters(
                "ventriform_job_retries_total",
                "Times that a worker started a job which had been started before.",
                &["kind"],
            )?,
            finished: make.counters(
                "ventriform_jobs_finished_total",
                "Jobs that ended, by final state.",
                &["kind", "state"],
            )?,
            failures: make.counters(
                "ventriform_job_failures_total",
                "Jobs that failed, by cause: the last word of the problem's type.",
                &["kind", "cause"],
            )?,
            waits: make.histograms(
                "ventriform_job_wait_seconds",
                "Time from the filing of a job to its first start.",
                &["kind"],
                &JOB_SECONDS,
            )?,
            durations: make.histograms(
                "ventriform_job_duration_seconds",
                "Time from the last start of a job to its end, by final state.",
                &["kind", "state"],
                &JOB_SECONDS,
            )?,
            stages: make.histograms(
                "ventriform_job_stage_duration_seconds",
                "Time of a stage of a job; `commit` is the storing of its result.",
                &["kind", "stage"],
                &JOB_SECONDS,
            )?,
        })
    }
}

impl IntakeMetrics {
    fn registered(make: &Maker<'_>) -> Made<Self> {
        let made = Self {
            ended: make.counters(
                "ventriform_dicom_connections_total",
                "Connections for DICOM that have ended, by how.",
                &["end"],
            )?,
            associations: make.whole("ventriform_dicom_associations", "Open associations.")?,
            objects: make.counters(
                "ventriform_received_objects_total",
                "Objects sent by C-STORE or STOW-RS, by outcome.",
                &["protocol", "outcome"],
            )?,
            bytes: make.counters(
                "ventriform_received_bytes_total",
                "Bytes of objects sent by C-STORE or STOW-RS.",
                &["protocol"],
            )?,
            groups: make.counters(
                "ventriform_received_volumes_total",
                "Received objects and series that became a volume, or could not.",
                &["outcome"],
            )?,
        };
        for end in AssociationEnd::ALL {
            made.ended.with_label_values(&[end.as_str()]);
        }
        for protocol in Protocol::ALL.map(Protocol::as_str) {
            made.objects.with_label_values(&[protocol, "stored"]);
            made.bytes.with_label_values(&[protocol]);
        }
        for outcome in ["stored", "failed"] {
            made.groups.with_label_values(&[outcome]);
        }
        Ok(made)
    }
}

impl Gauges {
    fn registered(make: &Maker<'_>) -> Made<Self> {
        Ok(Self {
            jobs: make.wholes("ventriform_jobs", "Jobs that have not ended.", &["state"])?,
            oldest_queued: make.gauge(
                "ventriform_oldest_queued_job_age_seconds",
                "Time since the oldest waiting job was filed; 0 if none waits.",
            )?,
            queue_limit: make.whole(
                "ventriform_queue_limit",
                "Number of waiting jobs beyond which more are rejected.",
            )?,
            items: make.wholes("ventriform_stored_items", "Stored items.", &["kind"])?,
            ready: make.whole("ventriform_ready", "1 if /readyz answers 200, else 0.")?,
            uptime: make.gauge("ventriform_uptime_seconds", "Time since the start.")?,
            disk_size: make.whole(
                "ventriform_disk_size_bytes",
                "Size of the disk of the data folder.",
            )?,
            disk_free: make.whole(
                "ventriform_disk_free_bytes",
                "Free space of the disk of the data folder.",
            )?,
            database: make.whole("ventriform_database_bytes", "Size of the database.")?,
            write_ahead_log: make.whole(
                "ventriform_database_wal_bytes",
                "Size of the database's write-ahead log.",
            )?,
            hook_attempts: make.counters(
                "ventriform_webhook_attempts_total",
                "Attempts to deliver webhooks, by how they ended.",
                &["outcome"],
            )?,
            hooks_given_up: make.counter(
                "ventriform_webhooks_given_up_total",
                "Webhook deliveries that were given up.",
            )?,
            hooks_pending: make.whole(
                "ventriform_webhooks_pending",
                "Webhook deliveries that will be tried.",
            )?,
            hooks_dead: make.whole(
                "ventriform_webhooks_dead",
                "Webhook deliveries that were given up and are still shown.",
            )?,
            oldest_hook: make.gauge(
                "ventriform_oldest_webhook_age_seconds",
                "Age of the oldest pending webhook delivery; 0 if none is pending.",
            )?,
            received_waiting: make.whole(
                "ventriform_received_waiting_objects",
                "Received objects that are not part of a volume.",
            )?,
            received_waiting_bytes: make.whole(
                "ventriform_received_waiting_bytes",
                "Bytes of received objects that are not part of a volume.",
            )?,
            fetches: make.counters(
                "ventriform_archive_fetches_total",
                "Attempts to fetch a series from an archive, by how they ended.",
                &["outcome"],
            )?,
            fetches_pending: make.whole(
                "ventriform_archive_fetches_pending",
                "Jobs that wait for a series from an archive.",
            )?,
            deliveries: make.counters(
                "ventriform_archive_deliveries_total",
                "Attempts to deliver an object to an archive, by how they ended.",
                &["outcome"],
            )?,
            deliveries_pending: make.whole(
                "ventriform_archive_deliveries_pending",
                "Objects that are to be delivered to an archive.",
            )?,
            deliveries_dead: make.whole(
                "ventriform_archive_deliveries_dead",
                "Objects whose delivery to an archive was given up.",
            )?,
            oldest_delivery: make.gauge(
                "ventriform_oldest_archive_delivery_age_seconds",
                "Age of the oldest pending delivery to an archive; 0 if none is pending.",
            )?,
        })
    }

    fn read(&self, reading: &MetricReadings<'_>) {
        let MetricReadings {
            load,
            figures,
            backlog,
            settings,
            now,
            ..
        } = reading;
        self.ready.set(i64::from(reading.ready));
        let age = |since: Option<i64>| since.map_or(0.0, |at| (*now - at).max(0) as f64 / 1000.0);
        for (state, jobs) in [("queued", load.queued), ("running", load.running)] {
            self.jobs.with_label_values(&[state]).set(signed(jobs));
        }
        self.oldest_queued.set(age(figures.oldest_queued_at));
        self.queue_limit.set(signed(settings.queue_limit as u64));
        for (kind, count) in &figures.items {
            self.items
                .with_label_values(&[kind.noun()])
                .set(signed(*count));
        }
        let folder = &settings.data_dir;
        if let Some(space) = &reading.space {
            self.disk_size.set(signed(space.total));
            self.disk_free.set(signed(space.free));
        }
        let database = figures.database_bytes.map(signed);
        self.database
            .set(database.unwrap_or_else(|| size_of(&folder.join("ventriform.db"))));
        self.write_ahead_log
            .set(size_of(&folder.join("ventriform.db-wal")));
        for (outcome, count) in reading.sent.attempts() {
            raise(&self.hook_attempts.with_label_values(&[outcome]), count);
        }
        raise(&self.hooks_given_up, reading.sent.given_up());
        self.hooks_pending.set(signed(backlog.pending));
        self.hooks_dead.set(signed(backlog.dead));
        self.oldest_hook.set(age(backlog.oldest));
        let (objects, bytes) = reading.received;
        self.received_waiting.set(signed(objects));
        self.received_waiting_bytes.set(signed(bytes));
        let archives = &reading.archives;
        for (outcome, count) in archives.pulls.all() {
            raise(&self.fetches.with_label_values(&[outcome]), count);
        }
        for (outcome, count) in archives.sends.all() {
            raise(&self.deliveries.with_label_values(&[outcome]), count);
        }
        self.fetches_pending.set(signed(archives.backlog.pulls));
        let sends = archives.backlog.sends;
        self.deliveries_pending.set(signed(sends.pending));
        self.deliveries_dead.set(signed(sends.dead));
        self.oldest_delivery.set(age(sends.oldest));
    }
}

/// Raises a counter to a count that is kept elsewhere.
fn raise(counter: &IntCounter, count: u64) {
    counter.inc_by(count.saturating_sub(counter.get()));
}

fn signed(count: u64) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

/// The length of a file; 0 if there is none.
fn size_of(path: &Path) -> i64 {
    std::fs::metadata(path).map_or(0, |file| signed(file.len()))
}
