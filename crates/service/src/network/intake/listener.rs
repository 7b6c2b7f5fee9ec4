//! All associations: accepting connections, and how many there may be.
//!
//! Connections that have not requested an association yet are counted apart from associations, so
//! that they cannot keep callers out: of too many, the oldest one of the address that has the most is
//! closed. Associations beyond the limits are rejected as PS3.8 says, for a passing reason.

use super::association::{Connection, REQUEST_WAIT, serve};
use super::negotiate::Offer;
use super::observer::{AssociationEnd, IntakeObserver};
use super::receive::Receiver;
use super::service::{Places, ScpSettings, Service};
use super::session::Sessions;
use crate::base::client::ClientAddress;
use crate::base::records::Clock;
use crate::callers::Recorder;
use rustls::ServerConfig;
use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinSet;
use tokio::time::timeout;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;
use tokio_util::sync::CancellationToken;
use ventriform::image::volume::dicom::{storage_classes, transfer_syntaxes};

/// Most connections that have not requested an association yet.
const UNASSOCIATED_CONNECTIONS: usize = 128;
/// Pause after the system refused a connection.
const REFUSED_PAUSE: Duration = Duration::from_millis(100);
/// Time at the end of the grace in which callers are told.
const LAST_WORDS: Duration = Duration::from_secs(1);

/// Connections that have not requested an association yet, oldest first.
#[derive(Default)]
struct Unassociated {
    next: u64,
    open: BTreeMap<u64, (IpAddr, CancellationToken)>,
}

impl Unassociated {
    /// Enters a connection. Of too many, closes the oldest of the address that has the most.
    fn enter(&mut self, peer: IpAddr) -> (u64, CancellationToken) {
        if self.open.len() >= UNASSOCIATED_CONNECTIONS {
            let mut counts: BTreeMap<IpAddr, usize> = BTreeMap::new();
            for (peer, _) in self.open.values() {
                *counts.entry(*peer).or_default() += 1;
            }
            let most = counts.into_iter().max_by_key(|(_, count)| *count);
            let mut all = self.open.iter();
            let oldest = all.find(|(_, (peer, _))| most.is_some_and(|(most, _)| most == *peer));
            if let Some(number) = oldest.map(|(number, _)| *number)
                && let Some((_, displaced)) = self.open.remove(&number)
            {
                displaced.cancel();
            }
        }
        let displaced = CancellationToken::new();
        self.next += 1;
        self.open.insert(self.next, (peer, displaced.clone()));
        (self.next, displaced)
    }
}

/// The configuration of TLS handshakes that begin now.
pub type TlsConfiguration = Arc<dyn Fn() -> Arc<ServerConfig> + Send + Sync>;

/// The connection after the handshake; `None` if there is none in time.
async fn handshake(
    service: &Service,
    stream: TcpStream,
    tls: Arc<ServerConfig>,
    displaced: &CancellationToken,
) -> Option<TlsStream<TcpStream>> {
    let made = tokio::select! {
        made = timeout(REQUEST_WAIT, TlsAcceptor::from(tls).accept(stream)) => made,
        () = displaced.cancelled() => return None,
        () = service.closing.cancelled() => return None,
    };
    match made {
        Ok(Ok(stream)) => Some(stream),
        Ok(Err(error)) => {
            tracing::info!(%error, "a TLS handshake for DICOM failed");
            None
        }
        Err(_) => None,
    }
}

/// The SCP: Verification and Storage.
pub struct Listener(Arc<Service>);

impl Listener {
    /// An SCP that stores by `receiver` until `closing` is cancelled.
    pub fn new(
        settings: ScpSettings,
        receiver: Arc<Receiver>,
        sessions: Arc<Sessions>,
        recorder: Arc<Recorder>,
        (clock, observer): (Arc<dyn Clock>, Arc<dyn IntakeObserver>),
        closing: CancellationToken,
    ) -> Self {
        Self(Arc::new(Service {
            offer: Offer {
                classes: storage_classes(),
                transfer_syntaxes: transfer_syntaxes(),
                longest: settings.longest_pdu,
            },
            places: Places::new(settings.associations, settings.of_one_peer),
            settings,
            receiver,
            sessions,
            recorder,
            clock,
            observer,
            closing,
            ending: CancellationToken::new(),
        }))
    }

    /// Serves `listener` until the service shuts down; returns when all associations have ended. With `tls`,
    /// connections begin with a handshake by the configuration that it returns.
    pub async fn run(self, listener: TcpListener, tls: Option<TlsConfiguration>) {
        let service = self.0;
        let unassociated: Arc<Mutex<Unassociated>> = Arc::default();
        let mut connections = JoinSet::new();
        loop {
            let accepted = tokio::select! {
                accepted = listener.accept() => accepted,
                Some(_) = connections.join_next() => continue,
                () = service.closing.cancelled() => break,
            };
            let (stream, address) = match accepted {
                Ok(accepted) => accepted,
                Err(error) => {
                    tracing::warn!(%error, "a connection for DICOM was not accepted");
                    tokio::time::sleep(REFUSED_PAUSE).await;
                    continue;
                }
            };
            let _ = stream.set_nodelay(true);
            let peer = address.ip();
            let client = ClientAddress::of_peer(peer);
            let enter = |table: &Mutex<Unassociated>| {
                let mut table = table.lock().unwrap_or_else(PoisonError::into_inner);
                table.enter(peer)
            };
            let (number, displaced) = enter(&unassociated);
            let (service, unassociated) = (service.clone(), unassociated.clone());
            let tls = tls.as_ref().map(|current| current());
            connections.spawn(async move {
                let leave = || {
                    let table = unassociated.lock();
                    let mut table = table.unwrap_or_else(PoisonError::into_inner);
                    table.open.remove(&number);
                };
                match tls {
                    None => {
                        let connection = Connection {
                            stream,
                            peer,
                            displaced,
                        };
                        client.scope(serve(&service, connection, leave)).await;
                    }
                    Some(tls) => match handshake(&service, stream, tls, &displaced).await {
                        Some(stream) => {
                            let connection = Connection {
                                stream,
                                peer,
                                displaced,
                            };
                            client.scope(serve(&service, connection, leave)).await;
                        }
                        None => service.observer.ended(AssociationEnd::Broken, false),
                    },
                }
                leave();
            });
        }
        drop(listener);
        let grace = service.settings.grace;
        let ended = async { while connections.join_next().await.is_some() {} };
        if timeout(grace.saturating_sub(LAST_WORDS), ended)
            .await
            .is_err()
        {
            service.ending.cancel();
            let ended = async { while connections.join_next().await.is_some() {} };
            let _ = timeout(LAST_WORDS, ended).await;
        }
    }
}
