//! The limit on connections.

use axum_server::accept::Accept;
use std::future::Ready;
use std::io;
use std::sync::Arc;
use tokio::net::TcpStream;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tower_http::add_extension::AddExtension;

/// Accepts connections up to a limit and closes all others at once.
#[derive(Clone)]
pub struct LimitedAcceptor {
    permits: Arc<Semaphore>,
}

impl LimitedAcceptor {
    /// An acceptor of at most `limit` connections at the same time.
    pub fn new(limit: usize) -> Self {
        let permits = Arc::new(Semaphore::new(limit.min(Semaphore::MAX_PERMITS)));
        Self { permits }
    }
}

impl<S> Accept<TcpStream, S> for LimitedAcceptor {
    type Stream = TcpStream;
    // The service of a connection is dropped when the connection ends, and the permit with it.
    type Service = AddExtension<S, Arc<OwnedSemaphorePermit>>;
    type Future = Ready<io::Result<(Self::Stream, Self::Service)>>;

    fn accept(&self, stream: TcpStream, service: S) -> Self::Future {
        let accepted = match self.permits.clone().try_acquire_owned() {
            Ok(permit) => stream
                .set_nodelay(true)
                .map(|()| (stream, AddExtension::new(service, Arc::new(permit)))),
            Err(_) => Err(io::ErrorKind::ConnectionRefused.into()),
        };
        std::future::ready(accepted)
    }
}
