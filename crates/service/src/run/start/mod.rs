//! Starting a service on its stores, and ending it.
//!
//! 1. [`check_role`] and [`DicomListener::bind`] refuse settings that cannot be served, before a store is opened.
//! 2. [`open`] makes the [`Service`] from settings, engine, stores and the factory of HTTP clients, returns the jobs of
//!    a process that died to the queue, and checks the rules of the settings. Nothing runs yet.
//! 3. [`Service::entrance`] says who is admitted at the address.
//! 4. [`RunningService::start`] starts workers and background tasks.
//! 5. [`RunningService::stop`] ends them in order; unfinished jobs go back to the queue.

mod dicom;
mod gate;

pub use dicom::DicomListener;
pub use gate::Entrance;

use crate::base::http_client::ClientFactory;
use crate::base::memory::MemoryBudget;
use crate::base::records::{Clock, DeathLimit, Failure, Fault, ServiceClock, StoreError};
use crate::callers::{IssuerError, Quota, Recorder};
use crate::config::stores::Stores;
use crate::config::{Role, Settings};
use crate::items::{Items, RetentionAges};
use crate::jobs::{Queue, QueueSettings, WorkerSettings, Workers};
use crate::limits::decoding::{Decoding, DecodingLimits};
use crate::limits::quotas::Quotas;
use crate::network::archive::ArchiveDesk;
use crate::network::hooks::{Dispatcher, HookSettings, Hooks, RetrySchedule, UrlGuard};
use crate::network::intake::{Intake, Receiver, Sessions};
use crate::run::background::{self, TimeOfDay, UPKEEP_EVERY, Upkeep};
use crate::telemetry::{JobWatch, Metrics, OtlpError, Readiness, Spans};
use crate::use_cases::service::Service;
use crate::work::Engine;
use futures::future::BoxFuture;
use std::io;
use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::sync::Arc;
use tokio::sync::Notify;
use tokio::task::{JoinError, JoinHandle};
use tokio_util::sync::CancellationToken;

/// Why a service was not started.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The role needs other processes, which could not reach what this one stores.
    #[error("role = {role} is for several processes on one store, but {lacking}")]
    Role {
        /// The role.
        role: Role,
        /// The part that only this process can reach.
        lacking: &'static str,
    },
    /// Callers without credentials would be served on an address that others can reach.
    #[error(
        "{0} can be reached from other machines, but there is no API key and no OpenID Connect issuer"
    )]
    OpenHttp(SocketAddr),
    /// Everybody who can reach the address could send objects by DICOM.
    #[error(
        "{0} can be reached from other machines, but no system is listed that may send images there"
    )]
    OpenDicom(SocketAddr),
    /// The address for DICOM cannot be used.
    #[error("cannot listen on {address} for DICOM: {reason}")]
    DicomAddress {
        /// The address.
        address: SocketAddr,
        /// The system's message.
        reason: io::Error,
    },
    /// The settings of the OpenID Connect issuer cannot be used.
    #[error("the OpenID Connect issuer: {0}")]
    Issuer(#[from] IssuerError),
    /// The database cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A rule of the settings cannot be used.
    #[error("{0}")]
    Rules(String),
    /// Traces cannot be sent as the settings ask for it.
    #[error(transparent)]
    Traces(#[from] OtlpError),
}

/// A service of which nothing runs yet.
pub struct OpenedService {
    /// The service.
    pub service: Arc<Service>,
    time: Arc<TimeOfDay>,
    close_stores: CloseStores,
}

/// Refuses a role that needs other processes, if these cannot share what this one stores.
///
/// # Errors
/// [`StartError::Role`].
pub fn check_role(settings: &Settings) -> Result<(), StartError> {
    let role = settings.role;
    let lacking = if role == Role::All {
        return Ok(());
    } else if settings.postgres().is_none() {
        "the database is a file in the data folder, which one process uses"
    } else if settings.blobs.bucket().is_none() {
        "the files are in the data folder, which one process uses"
    } else {
        return Ok(());
    };
    Err(StartError::Role { role, lacking })
}

type CloseStores = Box<dyn FnOnce() -> BoxFuture<'static, ()> + Send + Sync>;

/// Makes a service on its stores. To be called in the runtime in which it will run.
///
/// # Errors
/// If the stores fail, or the settings have a rule, a procedure or a collector of traces that cannot be used.
pub async fn open(
    settings: Settings,
    engine: Engine,
    stores: Stores,
    http_clients: Arc<dyn ClientFactory>,
) -> Result<OpenedService, StartError> {
    let time = Arc::new(TimeOfDay {
        clock: Arc::new(ServiceClock::default()),
        store: stores.time.clone(),
    });
    time.begin().await?;
    let queue = queue(&settings, &stores, time.clock.clone());
    queue.heartbeat().await?;
    let limit = death_limit(&settings);
    let limit = Some(&limit).filter(|_| engine.works.isolation().is_none());
    queue.recover_after_crash(limit).await?;
    let metrics = Metrics::new();
    let spans = Spans::new(settings.otlp_endpoint.0.as_deref(), &*http_clients)?;
    queue.observe(Arc::new(JobWatch::new(metrics.jobs.clone(), spans.clone())));
    let limits = DecodingLimits {
        memory: settings.decoding_memory.0,
        queue: settings.decoding_queue,
        time: settings.decoding_time.0,
        rate: settings.decoding_rate.0,
    };
    let waits = metrics.requests.decoding_waits.clone();
    let decoding = Arc::new(Decoding::new(limits, waits));
    let service = Service {
        engine,
        access: stores.access.clone(),
        recorder: Arc::new(Recorder::start(
            stores.access.clone(),
            queue.clock().clone(),
        )),
        worklist: stores.worklist.clone(),
        scheduled: Notify::new(),
        quotas: Quotas::new(stores.access.clone(), general_quota(&settings)),
        closing: CancellationToken::new(),
        decoding: decoding.clone(),
        memory: MemoryBudget::new(settings.request_memory.0),
        hooks: hooks(&settings, &stores, &queue, http_clients.clone()),
        archives: ArchiveDesk::new(
            stores.archives.clone(),
            UrlGuard::of_listed(settings.dicomweb_allow.clone()),
        ),
        intake: receiving(&settings, &stores, &queue, &metrics, decoding),
        metrics,
        readiness: Readiness::default(),
        figures: stores.figures.clone(),
        spans,
        http_clients,
        settings,
        queue,
    };
    service.check_rules().map_err(StartError::Rules)?;
    Ok(OpenedService {
        service: Arc::new(service),
        time,
        close_stores: stores.close,
    })
}

/// The workers and background tasks of a service.
pub struct RunningService {
    /// The service.
    pub service: Arc<Service>,
    workers: Workers,
    tasks: Option<JoinHandle<()>>,
    time: JoinHandle<()>,
    heartbeat: JoinHandle<()>,
    // Dropping it unlocks the data folder, so it is kept to the end.
    close_stores: CloseStores,
}

impl RunningService {
    /// Starts workers and background tasks.
    ///
    /// # Errors
    /// If the system refuses threads.
    pub fn start(opened: OpenedService) -> io::Result<Self> {
        let service = opened.service;
        let (queue, closing) = (service.queue.clone(), service.closing.clone());
        let time = tokio::spawn(opened.time.run(closing.clone()));
        let heartbeat = tokio::spawn(queue.clone().run_heartbeat());
        let scheduled = {
            let service = service.clone();
            move || service.scheduled.notify_one()
        };
        tokio::spawn(queue.clone().follow_peers(scheduled, closing.clone()));
        if queue.is_shared() {
            // Each process looks after its own items, and finds the dead as soon as their leases expire.
            let upkeep = Upkeep {
                queue: queue.clone(),
                retention: RetentionAges::default(),
                every: UPKEEP_EVERY.min(service.settings.lease.0),
            };
            tokio::spawn(upkeep.run(closing.clone()));
        }
        tokio::spawn(background::gatherer(&service).run(closing.clone()));
        let works = service.settings.role.works();
        let tasks = works.then(|| tokio::spawn(background::run(service.clone(), closing)));
        let settings = worker_settings(&service.settings);
        let workers = Workers::start(&queue, &service.engine.works, settings)?;
        Ok(Self {
            service,
            workers,
            tasks,
            time,
            heartbeat,
            close_stores: opened.close_stores,
        })
    }

    /// Ends the service in order: running jobs get `shutdown_grace` to end, and unfinished ones go back to the
    /// queue. `answers` ends when no request is answered any more.
    ///
    /// # Errors
    /// If the background tasks have panicked.
    pub async fn stop<T>(self, answers: impl Future<Output = T>) -> Result<T, JoinError> {
        self.service.closing.cancel();
        let ended = async {
            match self.tasks {
                Some(tasks) => tasks.await,
                None => Ok(()),
            }
        };
        let grace = self.service.settings.shutdown_grace.0;
        let (answered, (), ended, _) =
            tokio::join!(answers, self.workers.stop(grace), ended, self.time);
        self.service.recorder.flush().await;
        self.service.spans.flush().await;
        self.heartbeat.abort();
        self.service.queue.leave_peers().await;
        (self.close_stores)().await;
        ended.map(|()| answered)
    }
}

fn queue(settings: &Settings, stores: &Stores, clock: Arc<dyn Clock>) -> Arc<Queue> {
    let items = Items::new(
        stores.catalogue.clone(),
        stores.blobs.clone(),
        clock.clone(),
        stores.peers.clone(),
    );
    let limits = QueueSettings {
        limit: settings.queue_limit,
        workers: worker_settings(settings).workers,
    };
    Arc::new(Queue::new(
        stores.jobs.clone(),
        Arc::new(items),
        clock,
        limits,
    ))
}

fn general_quota(settings: &Settings) -> Quota {
    Quota {
        requests: settings.quota_requests.0,
        bytes: settings.quota_bytes.0.map(|size| size.0),
        jobs: settings.quota_jobs.0,
    }
}

/// The reception of objects.
fn receiving(
    settings: &Settings,
    stores: &Stores,
    queue: &Queue,
    metrics: &Metrics,
    decoding: Arc<Decoding>,
) -> Intake {
    let receiver = Receiver::new(
        stores.intake.clone(),
        stores.received.clone(),
        queue.clock().clone(),
        Arc::new(metrics.intake.clone()),
        decoding,
        dicom::receiver_settings(settings),
    );
    Intake {
        receiver: Arc::new(receiver),
        sessions: Sessions::new(dicom::waits(settings)),
        store: stores.intake.clone(),
        files: stores.received.clone(),
    }
}

fn hooks(
    settings: &Settings,
    stores: &Stores,
    queue: &Queue,
    http_clients: Arc<dyn ClientFactory>,
) -> Hooks {
    let guard = UrlGuard::new(settings.webhook_allow.clone());
    let sending = HookSettings {
        retries: RetrySchedule {
            first: settings.webhook_backoff.0,
            attempts: settings.webhook_attempts,
            age: settings.webhook_age.0,
        },
        attempt_limit: settings.webhook_timeout.0,
        places: settings.webhook_concurrency,
        per_destination: settings.webhook_destination_concurrency,
        backlog: settings.webhook_backlog,
        history: settings.webhook_history.0,
        base_path: settings.base_path.as_str().to_owned(),
    };
    let dispatcher = Dispatcher::new(
        stores.deliveries.clone(),
        queue.clock().clone(),
        http_clients,
        guard.clone(),
        sending,
    );
    Hooks {
        store: stores.deliveries.clone(),
        guard,
        dispatcher: Arc::new(dispatcher),
    }
}

/// When a job is failed by a program that cannot compute it in a process of its own.
fn death_limit(settings: &Settings) -> DeathLimit {
    let deaths = settings.attempt_limit;
    let reason = format!("The service died {deaths} times while the job was running.");
    DeathLimit {
        deaths,
        reason: Failure::new(Fault::Service, "attempt-limit", reason)
            .fix("Report it with the job's id. Other parameters may work."),
    }
}

fn worker_settings(settings: &Settings) -> WorkerSettings {
    let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    WorkerSettings {
        workers: if settings.role.works() {
            settings.workers.or(cores)
        } else {
            0
        },
        threads: settings.threads.or(1),
        lease: settings.lease.0,
        attempt_limit: settings.attempt_limit,
        time_limit: settings.job_time_limit.0,
    }
}
