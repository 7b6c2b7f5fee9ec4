//! Accepting connections: HTTP/1.1, with TLS if it is configured, and limits that keep slow or
//! greedy clients from holding up others.
//!
//! | limit | what happens beyond it |
//! |---|---|
//! | connections, in all and of one client | a stalled connection is closed for the new one; if none is stalled, the new one is [reserve](registry) |
//! | time for a TLS handshake, for a request's head, between requests | the connection is closed ([`stall`]) |
//! | pause in reading an answer, and the rate of reading it | the connection is closed ([`stall`]) |
//! | memory of the system for an answer that is not read | the answer waits ([`SEND_BUFFER`]) |
//!
//! Bodies of requests have limits of their own ([`crate::wire::limits`]).
//!
//! A connection stalls while the service waits for its client: between requests, in the head or
//! the body of a request, or in an answer that is not read. While an answer is computed, or events
//! are awaited, it does not stall.
//!
//! Between requests a connection may be idle for longer than proxies keep theirs (setting
//! `keep_alive_timeout`): a proxy that sends a request while the service closes the connection
//! answers its client with 502.
//!
//! A request that is refused while its body is still arriving is answered at once, and the connection
//! ends as [`stall`] says, so that the client gets the answer.
//!
//! A connection that is refused before it carries a request has a line in the log, at `info` ([`refused`]).
//!
//! On shutdown no connection is accepted any more. Open ones may finish the answer they are
//! working on; those that are still open after the grace period are closed.
//!
//! HTTP/2 is left to a proxy: hyper reads its preface before the deadline runs.

mod refused;
mod registry;
mod requests;
mod stall;
pub mod tls;

use crate::wire::public_base::ProxyPolicy;
use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::{GracefulShutdown, Watcher};
use prometheus::IntGauge;
use refused::Refused;
use registry::{Registry, Ticket};
use requests::RequestService;
use socket2::{SockRef, TcpKeepalive};
pub use stall::Linger;
use stall::{StreamLimits, WatchedStream};
use std::io;
use std::net::IpAddr;
use std::sync::Arc;
use std::time::Duration;
use tls::{ClientCertificate, Tls};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio_util::sync::CancellationToken;
use ventriform_service::config::{BasePath, Networks};

/// Pause after a connection could not be accepted, which happens when file descriptors run out.
const ACCEPT_PAUSE: Duration = Duration::from_millis(20);

/// Bytes of an answer that the system holds for one client (Linux allows twice as many). Without
/// this limit it holds up to 4 MiB, and a client would have to read a third of that within the
/// write timeout to be seen reading at all.
const SEND_BUFFER: usize = 128 << 10;

/// Bytes that are read from one client before they are taken: of thousands that send as fast as they can, each
/// has as many in memory. The head of a request must fit.
const READ_BUFFER: usize = 32 << 10;

/// When a silent connection is asked whether its other end still exists.
const TCP_KEEPALIVE: Duration = Duration::from_secs(60);

/// Longest life of a connection of the reserve.
const RESERVE_LIFE: Duration = Duration::from_secs(2);

/// The limits on connections.
#[derive(Debug, Clone)]
pub struct ConnectionLimits {
    /// Most connections at the same time.
    pub connections: usize,
    /// Most connections of one client.
    pub of_one_client: usize,
    /// The proxies whose word about their clients is taken.
    pub trusted_proxies: Networks,
    /// The path under which proxies show the service.
    pub base_path: BasePath,
    /// Longest time for the head of a request to arrive.
    pub head: Duration,
    /// Longest time between two requests.
    pub idle: Duration,
    /// Longest pause in reading an answer.
    pub write: Duration,
    /// Time for which a client may go on sending after an early answer.
    pub linger: Linger,
    /// Longest time for open connections to end on shutdown.
    pub grace: Duration,
}

/// The state that all connections share.
struct Server {
    router: Router,
    limits: ConnectionLimits,
    tls: Option<Arc<Tls>>,
    proxies: Arc<ProxyPolicy>,
    /// Closes what is still open after the grace period.
    halt: CancellationToken,
}

/// Serves connections until `shutdown`, and returns when all of them have ended. `open` is kept at
/// their number.
pub async fn serve(
    listener: TcpListener,
    router: Router,
    tls: Option<Arc<Tls>>,
    limits: ConnectionLimits,
    open: IntGauge,
    shutdown: CancellationToken,
) {
    let registry = Registry::new(&limits, open);
    let grace = limits.grace;
    let halt = CancellationToken::new();
    let server = Arc::new(Server {
        router,
        proxies: Arc::new(ProxyPolicy {
            trusted: limits.trusted_proxies.clone(),
            base_path: limits.base_path.clone(),
            tls: tls.is_some(),
        }),
        limits,
        tls,
        halt: halt.clone(),
    });
    let graceful = GracefulShutdown::new();
    while let Some(accepted) = shutdown.run_until_cancelled(accept(&listener)).await {
        let (stream, peer) = match accepted {
            Ok(accepted) => accepted,
            Err(error) => {
                tracing::warn!(%error, "a connection could not be accepted");
                registry.close_stalled();
                tokio::time::sleep(ACCEPT_PAUSE).await;
                continue;
            }
        };
        let trusted = server.limits.trusted_proxies.contain(peer);
        let ticket = registry.admit(peer, trusted);
        let connection = server
            .clone()
            .serve(stream, peer, ticket, graceful.watcher());
        tokio::spawn(connection);
    }
    drop(listener);
    if tokio::time::timeout(grace, graceful.shutdown())
        .await
        .is_err()
    {
        halt.cancel();
    }
}

async fn accept(listener: &TcpListener) -> io::Result<(TcpStream, IpAddr)> {
    let (stream, peer) = listener.accept().await?;
    stream.set_nodelay(true)?;
    let socket = SockRef::from(&stream);
    socket.set_send_buffer_size(SEND_BUFFER)?;
    socket.set_tcp_keepalive(&TcpKeepalive::new().with_time(TCP_KEEPALIVE))?;
    Ok((stream, peer.ip().to_canonical()))
}

impl Server {
    /// Serves one connection until it ends, is closed for another one, or the service halts.
    async fn serve(self: Arc<Self>, stream: TcpStream, peer: IpAddr, ticket: Ticket, end: Watcher) {
        let closed = ticket.connection.closed.clone();
        let ended = async {
            if ticket.reserve {
                let served = self.serve_stream(stream, peer, &ticket, end);
                let late = |_| Err(Refused::Reserve.into());
                let served = tokio::time::timeout(RESERVE_LIFE, served).await;
                served.unwrap_or_else(late)
            } else {
                self.serve_stream(stream, peer, &ticket, end).await
            }
        };
        tokio::select! {
            outcome = ended => match outcome {
                Err(error) => Refused::log(peer, &error),
                // hyper takes a connection on which nothing came for one that was closed.
                Ok(()) if ticket.connection.is_late() => {
                    Refused::log(peer, &Refused::NoRequest.into());
                }
                Ok(()) => {}
            },
            () = closed.cancelled() => {
                tracing::info!(client = %peer, "a stalled connection was closed for another one");
            }
            () = self.halt.cancelled() => {}
        }
    }

    async fn serve_stream(
        &self,
        stream: TcpStream,
        peer: IpAddr,
        ticket: &Ticket,
        end: Watcher,
    ) -> Result<(), BoxError> {
        let stream = WatchedStream::new(
            stream,
            ticket.connection.clone(),
            StreamLimits {
                write: self.limits.write,
                head: self.limits.head,
                idle: self.limits.idle,
                linger: self.limits.linger,
            },
        );
        let Some(tls) = &self.tls else {
            return self.serve_http(stream, peer, None, ticket, end).await;
        };
        let handshake = tls.accept(stream);
        let handshake = tokio::time::timeout(self.limits.head, handshake).await;
        let Some(stream) = handshake.map_err(|_| Refused::SlowHandshake)?? else {
            return Err(Refused::PlainHttp.into());
        };
        let certificate = ClientCertificate::from_connection(stream.get_ref().1);
        if let Some(certificate) = &certificate {
            let ClientCertificate {
                subject,
                fingerprint,
                ..
            } = &**certificate;
            tracing::info!(subject, fingerprint, "a client certificate was accepted");
        }
        self.serve_http(stream, peer, certificate, ticket, end)
            .await
    }

    async fn serve_http(
        &self,
        stream: impl AsyncRead + AsyncWrite + Unpin + 'static,
        peer: IpAddr,
        certificate: Option<Arc<ClientCertificate>>,
        ticket: &Ticket,
        end: Watcher,
    ) -> Result<(), BoxError> {
        let service = RequestService {
            router: self.router.clone(),
            connection: ticket.connection.clone(),
            reserve: ticket.reserve,
            peer,
            proxies: self.proxies.clone(),
            lacks_certificate: certificate.is_none()
                && self
                    .tls
                    .as_ref()
                    .is_some_and(|tls| tls.demands_certificates()),
            certificate,
        };
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .max_buf_size(READ_BUFFER)
            // The stream has limits of its own on the wait for a head.
            .header_read_timeout(None)
            .keep_alive(!ticket.reserve)
            .serve_connection(TokioIo::new(stream), service);
        Ok(end.watch(connection).await?)
    }
}

type BoxError = Box<dyn std::error::Error + Send + Sync>;
