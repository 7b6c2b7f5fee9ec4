//! Starting the service from its settings, and shutting it down.

use super::app::{App, Watching};
use super::archives::ArchiveDesk;
use super::connections::tls::{Tls, TlsError};
use super::connections::{self, ConnectionLimits, Linger};
use super::cryptography::install_cryptography;
use super::duties::{self, UPKEEP_EVERY};
use super::guard::hosts::HostPolicy;
use super::guard::state::Guard;
use super::hooks::Hooks;
use super::intake::{self, Intake};
use super::job_watch::JobWatch;
use super::metrics::Metrics;
use super::router::router;
use super::spans::{OtlpError, Spans};
use super::volume_maker::check_rules;
use futures::future::BoxFuture;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use ventriform_service::access::{
    AccessStore, Gate, Issuer, IssuerError, IssuerSettings, Recorder, Scope,
};
use ventriform_service::background::Upkeep;
use ventriform_service::config::{Role, Settings};
use ventriform_service::hooks::{Dispatcher, HookSettings, RetrySchedule, UrlGuard};
use ventriform_service::intake::{Listener, Receiver, ScpSettings, Sessions, TlsConfiguration};
use ventriform_service::items::{Items, RetentionAges};
use ventriform_service::jobs::{Queue, QueueSettings, WorkerSettings, Workers};
use ventriform_service::records::{
    Clock, DeathLimit, Failure, Fault, SteadyClock, StoreError, SystemClock,
};
use ventriform_service::stores::Stores;
use ventriform_service::work::Engine;

/// Why the service did not start, or ended without being asked.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The data folder cannot be used.
    #[error(transparent)]
    Store(Box<dyn std::error::Error + Send + Sync>),
    /// The database in the data folder cannot be used.
    #[error(transparent)]
    Rows(#[from] StoreError),
    /// Callers without credentials would be served on an address that others can reach.
    #[error(
        "{0} can be reached from other machines, but there is no API key and no OpenID Connect \
         issuer. Make a key by `ventriform keys create --name NAME --scope submit --data-dir DIR`, \
         or set `oidc_issuer`, or serve everybody by `--allow-anonymous`"
    )]
    Open(SocketAddr),
    /// Everybody who can reach the address could send objects by DICOM.
    #[error(
        "{0} can be reached from other machines, but no system is listed that may send images there. \
         List them as `[[senders]]` in the file of `--config`, or let everybody send by \
         `--allow-anonymous`"
    )]
    OpenDicom(SocketAddr),
    /// The address for DICOM cannot be used.
    #[error("cannot listen on {address} for DICOM: {reason}")]
    Dicom {
        /// The address.
        address: SocketAddr,
        /// The system's message.
        reason: io::Error,
    },
    /// A rule of the settings cannot be used.
    #[error("{0}")]
    Rules(String),
    /// The settings of the OpenID Connect issuer cannot be used.
    #[error("the OpenID Connect issuer: {0}")]
    Issuer(#[from] IssuerError),
    /// TLS cannot be used as the settings ask for it.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// Traces cannot be sent as the settings ask for it.
    #[error(transparent)]
    Traces(#[from] OtlpError),
    /// The role needs other processes, which could not reach what this one stores.
    #[error(
        "role = {role} is for several processes on one store, but {lacking}. Give every process the same \
         `--database postgres://...` and `--blobs s3://...`, or leave the role at `all`"
    )]
    Role {
        /// The role.
        role: Role,
        /// What only this process can reach.
        lacking: &'static str,
    },
    /// The system refused threads or sockets.
    #[error("{0}")]
    System(#[from] io::Error),
}

/// A running service.
pub struct Running {
    address: SocketAddr,
    app: App,
    queue: Arc<Queue>,
    server: JoinHandle<()>,
    dicom: Option<JoinHandle<()>>,
    dicom_address: Option<SocketAddr>,
    workers: Workers,
    duties: Option<JoinHandle<()>>,
    alive: JoinHandle<()>,
    spans: Spans,
    closing: CancellationToken,
    grace: Duration,
    // Dropping it unlocks the data folder, so it is kept to the end.
    close_stores: Box<dyn FnOnce() -> BoxFuture<'static, ()> + Send + Sync>,
}

/// Starts the service on a bound listener. `open` opens its stores, once the settings are known to be usable.
///
/// # Errors
/// If the stores are in use or unusable, or the system refuses threads or sockets.
pub async fn start<E>(
    settings: Settings,
    engine: Engine,
    listener: TcpListener,
    open: impl Future<Output = Result<Stores, E>>,
) -> Result<Running, ServeError>
where
    E: Into<Box<dyn std::error::Error + Send + Sync>>,
{
    install_cryptography();
    check_role(&settings)?;
    let dicom = dicom_listener(&settings)?;
    let tls = Tls::of(&settings)?;
    let dicom_tls = Tls::of_dicom(&settings)?;
    let workers = worker_settings(&settings);
    let stores = open
        .await
        .map_err(|error| ServeError::Store(error.into()))?;
    let clock: Arc<dyn Clock> = Arc::new(SteadyClock::default());
    let items = Items::new(
        stores.catalogue.clone(),
        stores.blobs.clone(),
        clock.clone(),
        stores.peers.clone(),
    );
    let queue = Arc::new(Queue::new(
        stores.jobs.clone(),
        Arc::new(items),
        clock,
        QueueSettings {
            limit: settings.queue_limit,
            workers: workers.workers,
        },
    ));
    queue.heartbeat().await?;
    let limit = death_limit(&settings);
    let limit = Some(&limit).filter(|_| engine.works.isolation().is_none());
    queue.recover_after_crash(limit).await?;
    let closing = CancellationToken::new();
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?;
    let guard = guard(&settings, stores.access.clone(), address).await?;
    let watching = watching(&settings, &stores, &queue)?;
    let spans = watching.spans.clone();
    let hooks = hooks(&settings, &stores, &queue);
    let intake = receiving(&settings, &stores, &queue, &watching);
    let app = App::new(
        queue.clone(),
        engine.clone(),
        (stores.access.clone(), stores.worklist.clone(), guard),
        settings.clone(),
        (
            hooks,
            ArchiveDesk::new(&settings, stores.archives.clone()),
            intake,
        ),
        watching,
        closing.clone(),
    );
    check_rules(&app).map_err(ServeError::Rules)?;
    let limits = ConnectionLimits {
        connections: settings.connection_limit,
        of_one_client: settings.client_connection_limit,
        trusted_proxies: settings.trusted_proxies.clone(),
        base_path: settings.base_path.clone(),
        head: settings.header_timeout.0,
        idle: settings.keep_alive_timeout.0,
        write: settings.write_timeout.0,
        linger: Linger {
            total: settings.linger_time.0,
            pause: settings.linger_pause.0,
            bytes: settings.linger_bytes.0,
        },
        grace: settings.shutdown_grace.0,
    };
    let listener = tokio::net::TcpListener::from_std(listener)?;
    for tls in [&tls, &dicom_tls].into_iter().flatten() {
        tokio::spawn(tls.clone().follow_changes(closing.clone()));
    }
    let open = app.metrics.requests.connections.clone();
    let router = router(app.clone());
    let server = connections::serve(listener, router, tls, limits, open, closing.clone());
    let server = tokio::spawn(server);
    let alive = tokio::spawn(queue.clone().run_heartbeat());
    let scheduled = {
        let app = app.clone();
        move || app.scheduled.notify_one()
    };
    tokio::spawn(queue.clone().follow_peers(scheduled, closing.clone()));
    if queue.is_shared() {
        // Each process looks after its own items, and finds the dead as soon as their leases expire.
        let upkeep = Upkeep {
            queue: queue.clone(),
            retention: RetentionAges::default(),
            every: UPKEEP_EVERY.min(settings.lease.0),
        };
        tokio::spawn(upkeep.run(closing.clone()));
    }
    tokio::spawn(duties::gatherer(&app).run(closing.clone()));
    let works = settings.role.works();
    let duties = works.then(|| tokio::spawn(duties::run(app.clone(), closing.clone())));
    let dicom_address = dicom.as_ref().map(|dicom| dicom.address);
    let dicom = dicom.map(|dicom| serve_dicom(&app, dicom, dicom_tls));
    let dicom = dicom.transpose()?;
    let workers = Workers::start(&queue, &engine.works, workers)?;
    tracing::info!(%address, "listening");
    Ok(Running {
        address,
        app,
        queue,
        server,
        dicom,
        dicom_address,
        workers,
        duties,
        alive,
        spans,
        closing,
        grace: settings.shutdown_grace.0,
        close_stores: stores.close,
    })
}

impl Running {
    /// The address it listens on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The address on which it listens for DICOM; `None` if it does not.
    pub fn dicom_address(&self) -> Option<SocketAddr> {
        self.dicom_address
    }

    /// Its queue of jobs.
    pub fn queue(&self) -> &Arc<Queue> {
        &self.queue
    }

    /// Shuts the service down in order: no new connections are accepted, running jobs get `shutdown_grace` to
    /// end, and unfinished ones go back to the queue.
    ///
    /// # Errors
    /// If the task that serves connections has panicked.
    pub async fn stop(self) -> Result<(), ServeError> {
        tracing::info!("shutting down");
        self.closing.cancel();
        let ended = |task: Option<JoinHandle<()>>| async move {
            match task {
                Some(task) => task.await,
                None => Ok(()),
            }
        };
        let (server, dicom, (), duties) = tokio::join!(
            self.server,
            ended(self.dicom),
            self.workers.stop(self.grace),
            ended(self.duties),
        );
        self.app.guard.recorder.flush().await;
        self.spans.flush().await;
        self.alive.abort();
        self.queue.leave_peers().await;
        (self.close_stores)().await;
        server.and(dicom).and(duties).map_err(io::Error::other)?;
        Ok(())
    }
}

/// Refuses a role that needs other processes, if these cannot share what this one stores.
fn check_role(settings: &Settings) -> Result<(), ServeError> {
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
    Err(ServeError::Role { role, lacking })
}

/// Where objects are received by DICOM, and from whom.
struct DicomListener {
    listener: TcpListener,
    address: SocketAddr,
    settings: ScpSettings,
}

/// Listens for DICOM if the settings ask for it.
///
/// # Errors
/// If the address cannot be used, or strangers could send and the settings do not say that they may.
fn dicom_listener(settings: &Settings) -> Result<Option<DicomListener>, ServeError> {
    let address = settings.dicom_listen.0;
    let Some(address) = address.filter(|_| settings.role.serves()) else {
        return Ok(None);
    };
    let unusable = |reason| ServeError::Dicom { address, reason };
    let loopback = address.ip().to_canonical().is_loopback();
    let scp = intake::scp_settings(settings, loopback).ok_or(ServeError::OpenDicom(address))?;
    if scp.senders.others && !loopback {
        tracing::warn!(%address, "every system may send images by DICOM (allow_anonymous)");
    }
    let listener = TcpListener::bind(address).map_err(unusable)?;
    listener.set_nonblocking(true).map_err(unusable)?;
    Ok(Some(DicomListener {
        address: listener.local_addr().map_err(unusable)?,
        listener,
        settings: scp,
    }))
}

/// Serves DICOM until the service shuts down.
fn serve_dicom(
    app: &App,
    dicom: DicomListener,
    tls: Option<Arc<Tls>>,
) -> io::Result<JoinHandle<()>> {
    let scp = Listener::new(
        dicom.settings,
        app.intake.receiver.clone(),
        app.intake.sessions.clone(),
        app.guard.recorder.clone(),
        (
            app.queue.clock().clone(),
            Arc::new(app.metrics.intake.clone()),
        ),
        app.closing.clone(),
    );
    let listener = tokio::net::TcpListener::from_std(dicom.listener)?;
    tracing::info!(address = %dicom.address, "listening for DICOM");
    let tls: Option<TlsConfiguration> = tls.map(|tls| Arc::new(move || tls.config()) as _);
    Ok(tokio::spawn(scp.run(listener, tls)))
}

/// What receives objects.
fn receiving(settings: &Settings, stores: &Stores, queue: &Queue, watching: &Watching) -> Intake {
    let receiver = Receiver::new(
        stores.intake.clone(),
        stores.received.clone(),
        queue.clock().clone(),
        Arc::new(watching.metrics.intake.clone()),
        intake::receiver_settings(settings),
    );
    Intake {
        receiver: Arc::new(receiver),
        sessions: Sessions::new(intake::waits(settings)),
        store: stores.intake.clone(),
        files: stores.received.clone(),
    }
}

/// Tells callers as the settings say.
///
/// # Errors
/// If the service could be used by strangers and the settings do not say that it shall.
async fn guard(
    settings: &Settings,
    store: Arc<dyn AccessStore>,
    address: SocketAddr,
) -> Result<Guard, ServeError> {
    let clock = Arc::new(SystemClock);
    let loopback = address.ip().to_canonical().is_loopback();
    let text = |text: &String| Some(text.clone()).filter(|text| !text.is_empty());
    let issuer = text(&settings.oidc_issuer).map(|issuer| {
        Issuer::new(IssuerSettings {
            issuer,
            audience: settings.oidc_audience.clone(),
            jwks: text(&settings.oidc_jwks),
            tenant_claim: text(&settings.oidc_tenant_claim),
            scope_claim: settings.oidc_scope_claim.clone(),
            leeway: settings.oidc_leeway.0,
        })
    });
    // Whoever can reach a loopback address can usually read the data folder too.
    let anonymous = match loopback {
        true => Scope::Admin,
        false => Scope::Submit,
    };
    let recorder = Recorder::start(store.clone(), clock.clone());
    let gate = Gate::new(
        store,
        clock,
        issuer.transpose()?,
        anonymous,
        settings.allow_anonymous,
    );
    let open = gate.is_open().await?;
    if open && !loopback && !settings.allow_anonymous {
        return Err(ServeError::Open(address));
    }
    if open && !loopback {
        tracing::warn!(%address, "callers without credentials are served (allow_anonymous)");
    }
    let hosts = HostPolicy {
        names: settings.hosts.clone(),
        origins: settings.cors_origins.clone(),
        loopback,
        open,
    };
    Ok(Guard::new(gate, recorder, hosts, settings, !loopback))
}

/// Metrics and traces, which from now on follow the queue's jobs.
fn watching(settings: &Settings, stores: &Stores, queue: &Queue) -> Result<Watching, OtlpError> {
    let metrics = Metrics::new();
    let spans = Spans::new(settings.otlp_endpoint.0.as_deref())?;
    queue.observe(Arc::new(JobWatch::new(metrics.jobs.clone(), spans.clone())));
    Ok(Watching {
        metrics,
        figures: stores.figures.clone(),
        spans,
    })
}

fn hooks(settings: &Settings, stores: &Stores, queue: &Queue) -> Hooks {
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
        workers: match settings.role.works() {
            true => settings.workers.or(cores),
            false => 0,
        },
        threads: settings.threads.or(1),
        lease: settings.lease.0,
        attempt_limit: settings.attempt_limit,
        time_limit: settings.job_time_limit.0,
    }
}
