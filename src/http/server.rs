//! From settings to a running service, and to its end.

use super::app::App;
use super::router::router;
use crate::config::Settings;
use crate::jobs::{
    Queue, QueueSettings, StoreError, SystemClock, Upkeep, WorkerSettings, Workers,
    recover_after_crash,
};
use crate::store::{OpenError, Store};
use crate::work::Engine;
use axum_server::accept::Accept;
use hyper_util::rt::TokioTimer;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::num::NonZeroUsize;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// How often old and hopeless things are looked for.
const UPKEEP_EVERY: Duration = Duration::from_secs(30);

/// Why the service did not start, or ended by itself.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The data folder.
    #[error(transparent)]
    Store(#[from] OpenError),
    /// What is in the data folder.
    #[error(transparent)]
    Rows(#[from] StoreError),
    /// The network or the system.
    #[error("{0}")]
    System(#[from] io::Error),
}

/// A service that answers.
pub struct Running {
    address: SocketAddr,
    queue: Arc<Queue>,
    server: JoinHandle<io::Result<()>>,
    handle: axum_server::Handle<SocketAddr>,
    workers: Workers,
    closing: CancellationToken,
    grace: Duration,
    // Held to the end: dropping it gives the data folder free.
    _store: Store,
}

/// Serves until `shutdown` comes true, then ends in order: no new connections, running jobs
/// get `shutdown_grace` to end, the rest goes back to the queue.
///
/// # Errors
/// If the service cannot start, or the network fails it.
pub async fn serve(
    settings: Settings,
    engine: Engine,
    listener: TcpListener,
    shutdown: impl Future<Output = ()>,
) -> Result<(), ServeError> {
    let running = start(settings, engine, listener).await?;
    shutdown.await;
    running.stop().await
}

/// Starts the service on a bound listener and returns once it answers.
///
/// # Errors
/// If the data folder is in use or unusable, or the system refuses threads or sockets.
pub async fn start(
    settings: Settings,
    engine: Engine,
    listener: TcpListener,
) -> Result<Running, ServeError> {
    let workers = worker_settings(&settings);
    let store = Store::open(&settings.data_dir).await?;
    let queue = Arc::new(Queue::new(
        store.rows.clone(),
        store.rows.clone(),
        store.blobs.clone(),
        Arc::new(SystemClock),
        QueueSettings {
            limit: settings.queue_limit,
            workers: workers.workers,
        },
    ));
    recover_after_crash(&queue, workers.attempt_limit).await?;
    let closing = CancellationToken::new();
    let app = App::new(
        queue.clone(),
        engine.clone(),
        settings.clone(),
        closing.clone(),
    );
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?;
    let handle = axum_server::Handle::new();
    let server = listen(listener, &settings, handle.clone(), app)?;
    let upkeep = Upkeep {
        queue: queue.clone(),
        attempt_limit: workers.attempt_limit,
        retention: settings.retention.0.map(|span| span.0),
        every: UPKEEP_EVERY,
    };
    tokio::spawn(upkeep.run(closing.clone()));
    let workers = Workers::start(&queue, &engine.works, workers)?;
    tracing::info!(%address, "listening");
    Ok(Running {
        address,
        queue,
        server,
        handle,
        workers,
        closing,
        grace: settings.shutdown_grace.0,
        _store: store,
    })
}

impl Running {
    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Its jobs and things.
    pub fn queue(&self) -> &Arc<Queue> {
        &self.queue
    }

    /// Ends it in order; see [`serve`].
    ///
    /// # Errors
    /// If the network had failed it.
    pub async fn stop(self) -> Result<(), ServeError> {
        tracing::info!("shutting down");
        self.closing.cancel();
        self.handle.graceful_shutdown(Some(self.grace));
        let (server, ()) = tokio::join!(self.server, self.workers.stop(self.grace));
        server.map_err(io::Error::other)??;
        Ok(())
    }
}

fn worker_settings(settings: &Settings) -> WorkerSettings {
    let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    WorkerSettings {
        workers: settings.workers.or(cores / 2),
        threads: settings.threads.or(cores.min(2)),
        lease: settings.lease.0,
        attempt_limit: settings.attempt_limit,
        time_limit: settings.job_time_limit.0,
    }
}

/// HTTP/1.1 with a limit on connections and a deadline on request heads, which also ends
/// connections that never send a byte or idle between requests. HTTP/2 is left to the proxy
/// in front: its preface would be read before any deadline runs.
fn listen(
    listener: TcpListener,
    settings: &Settings,
    handle: axum_server::Handle<SocketAddr>,
    app: App,
) -> io::Result<JoinHandle<io::Result<()>>> {
    let limit = Arc::new(Semaphore::new(
        settings.connection_limit.min(Semaphore::MAX_PERMITS),
    ));
    let mut server = axum_server::from_tcp(listener)?
        .handle(handle)
        .acceptor(LimitedAcceptor { limit })
        .http1_only();
    server
        .http_builder()
        .http1()
        .timer(TokioTimer::new())
        .header_read_timeout(settings.header_timeout.0);
    Ok(tokio::spawn(server.serve(router(app).into_make_service())))
}

/// Takes connections while there are permits; closes the others at once.
#[derive(Clone)]
struct LimitedAcceptor {
    limit: Arc<Semaphore>,
}

impl<S> Accept<TcpStream, S> for LimitedAcceptor {
    type Stream = Counted;
    type Service = S;
    type Future = std::future::Ready<io::Result<(Counted, S)>>;

    fn accept(&self, stream: TcpStream, service: S) -> Self::Future {
        let permit = self.limit.clone().try_acquire_owned();
        std::future::ready(match permit {
            Ok(permit) => stream.set_nodelay(true).map(|()| {
                let counted = Counted {
                    stream,
                    _permit: permit,
                };
                (counted, service)
            }),
            Err(_) => Err(io::ErrorKind::ConnectionRefused.into()),
        })
    }
}

/// A connection that gives its permit back when it ends.
struct Counted {
    stream: TcpStream,
    _permit: OwnedSemaphorePermit,
}

impl AsyncRead for Counted {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, buffer)
    }
}

impl AsyncWrite for Counted {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write_vectored(context, slices)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
