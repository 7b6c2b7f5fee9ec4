//! Accepting connections: HTTP/1.1 with a limit on their number and a deadline on request heads.
//!
//! - A connection beyond the limit is closed at once.
//! - The deadline on a request's head also ends connections that send nothing, and those that are
//!   idle between requests.
//! - On shutdown no connection is accepted any more. Open ones may finish the answer they are
//!   working on; those that are still open after the grace period are closed.
//!
//! HTTP/2 is left to a proxy: hyper reads its preface before the deadline runs.

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use std::io;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

/// Pause after a connection could not be accepted, which happens when file descriptors run out.
const PAUSE: Duration = Duration::from_millis(100);

/// The limits on connections.
#[derive(Debug, Clone, Copy)]
pub struct ConnectionLimits {
    /// Most connections at the same time.
    pub connections: usize,
    /// Longest time for the head of a request to arrive.
    pub head: Duration,
    /// Longest time for open connections to end on shutdown.
    pub grace: Duration,
}

/// Serves connections until `shutdown`, and returns when all of them have ended.
pub async fn serve(
    listener: TcpListener,
    router: Router,
    limits: ConnectionLimits,
    shutdown: CancellationToken,
) {
    let permits = Arc::new(Semaphore::new(
        limits.connections.min(Semaphore::MAX_PERMITS),
    ));
    let service = TowerToHyperService::new(router);
    let graceful = GracefulShutdown::new();
    let halt = CancellationToken::new();
    while let Some(accepted) = shutdown.run_until_cancelled(accept(&listener)).await {
        let stream = match accepted {
            Ok(stream) => stream,
            Err(error) => {
                tracing::warn!(%error, "a connection could not be accepted");
                tokio::time::sleep(PAUSE).await;
                continue;
            }
        };
        let Ok(permit) = permits.clone().try_acquire_owned() else {
            continue;
        };
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(limits.head)
            .serve_connection(TokioIo::new(stream), service.clone());
        let connection = graceful.watch(connection);
        let halt = halt.clone();
        tokio::spawn(async move {
            if let Some(Err(error)) = halt.run_until_cancelled(connection).await {
                tracing::debug!(%error, "a connection ended early");
            }
            drop(permit);
        });
    }
    drop(listener);
    if tokio::time::timeout(limits.grace, graceful.shutdown())
        .await
        .is_err()
    {
        halt.cancel();
    }
}

async fn accept(listener: &TcpListener) -> io::Result<TcpStream> {
    let (stream, _) = listener.accept().await?;
    stream.set_nodelay(true)?;
    Ok(stream)
}
