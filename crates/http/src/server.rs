//! Starting the HTTP interface on a service, and shutting both down.

use super::app::App;
use super::router::router;
use crate::edge::connections::tls::{Tls, TlsError};
use crate::edge::connections::{self, ConnectionLimits, Linger};
use crate::edge::cryptography::install_cryptography;
use crate::edge::guard::hosts::HostPolicy;
use crate::edge::guard::state::Guard;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use tokio::task::JoinHandle;
use ventriform_service::base::http_client::ClientFactory;
use ventriform_service::base::records::StoreError;
use ventriform_service::callers::{Gate, Issuer, IssuerError, IssuerSettings, Scope};
use ventriform_service::config::stores::Stores;
use ventriform_service::config::{Role, Settings};
use ventriform_service::jobs::Queue;
use ventriform_service::network::intake::{Listener, ScpSettings, TlsConfiguration};
use ventriform_service::run::start::{OpenError, RunningService, open, scp_settings};
use ventriform_service::use_cases::service::Service;
use ventriform_service::work::Engine;

/// Why the service did not start, or ended without being asked.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The data folder cannot be used.
    #[error(transparent)]
    Store(Box<dyn std::error::Error + Send + Sync>),
    /// The service cannot be opened on its stores.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The database cannot be used.
    #[error(transparent)]
    Rows(#[from] StoreError),
    /// Callers without credentials would be served on an address that others can reach.
    #[error(
        "{0} can be reached from other machines, but there is no API key and no OpenID Connect \
         issuer. Make a key by `ventriform keys create --name NAME --scope submit --data-dir DIR`, \
         or set `oidc_issuer`, or serve everybody by `--allow-anonymous`"
    )]
    OpenHttp(SocketAddr),
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
    /// The settings of the OpenID Connect issuer cannot be used.
    #[error("the OpenID Connect issuer: {0}")]
    Issuer(#[from] IssuerError),
    /// TLS cannot be used as the settings ask for it.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// The role needs other processes, which could not reach what this one stores.
    #[error(
        "role = {role} is for several processes on one store, but {lacking}. Give every process the same \
         `--database postgres://...` and `--blobs s3://...`, or leave the role at `all`"
    )]
    Role {
        /// The role.
        role: Role,
        /// The part that only this process can reach.
        lacking: &'static str,
    },
    /// The system refused threads or sockets.
    #[error("{0}")]
    System(#[from] io::Error),
}

/// A running service.
pub struct Running {
    address: SocketAddr,
    service: RunningService,
    server: JoinHandle<()>,
    dicom: Option<JoinHandle<()>>,
    dicom_address: Option<SocketAddr>,
}

/// Starts the service on a bound listener. `stores` opens its stores, once the settings are known to be usable;
/// `http_clients` makes the clients of its requests to other programs.
///
/// # Errors
/// If the stores are in use or unusable, or the system refuses threads or sockets.
pub async fn start<E>(
    settings: Settings,
    engine: Engine,
    listener: TcpListener,
    stores: impl Future<Output = Result<Stores, E>>,
    http_clients: Arc<dyn ClientFactory>,
) -> Result<Running, ServeError>
where
    E: Into<Box<dyn std::error::Error + Send + Sync>>,
{
    install_cryptography();
    check_role(&settings)?;
    let dicom = dicom_listener(&settings)?;
    let tls = Tls::from_settings(&settings)?;
    let dicom_tls = Tls::of_dicom(&settings)?;
    let stores = stores.await;
    let stores = stores.map_err(|error| ServeError::Store(error.into()))?;
    let opened = open(settings, engine, stores, http_clients).await?;
    let service = opened.service.clone();
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?;
    let guard = guard(&service, address).await?;
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let closing = &service.closing;
    for tls in [&tls, &dicom_tls].into_iter().flatten() {
        tokio::spawn(tls.clone().follow_changes(closing.clone()));
    }
    let open = service.metrics.requests.connections.clone();
    let router = router(App::new(service.clone(), guard));
    let limits = connection_limits(&service.settings);
    let server = connections::serve(listener, router, tls, limits, open, closing.clone());
    let server = tokio::spawn(server);
    let running = RunningService::start(opened)?;
    let dicom_address = dicom.as_ref().map(|dicom| dicom.address);
    let dicom = dicom.map(|dicom| serve_dicom(&service, dicom, dicom_tls));
    let dicom = dicom.transpose()?;
    tracing::info!(%address, "listening");
    Ok(Running {
        address,
        service: running,
        server,
        dicom,
        dicom_address,
    })
}

fn connection_limits(settings: &Settings) -> ConnectionLimits {
    ConnectionLimits {
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
    }
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
        self.service.service.queue()
    }

    /// Shuts the service down in order: no new connections are accepted, running jobs get `shutdown_grace` to
    /// end, and unfinished ones go back to the queue.
    ///
    /// # Errors
    /// If the task that serves connections has panicked.
    pub async fn stop(self) -> Result<(), ServeError> {
        tracing::info!("shutting down");
        let answers = async {
            let dicom = async {
                match self.dicom {
                    Some(task) => task.await,
                    None => Ok(()),
                }
            };
            let (server, dicom) = tokio::join!(self.server, dicom);
            server.and(dicom)
        };
        let answered = self.service.stop(answers).await;
        answered
            .and_then(|answered| answered)
            .map_err(io::Error::other)?;
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
    let scp = scp_settings(settings, loopback).ok_or(ServeError::OpenDicom(address))?;
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
    service: &Service,
    dicom: DicomListener,
    tls: Option<Arc<Tls>>,
) -> io::Result<JoinHandle<()>> {
    let scp = Listener::new(
        dicom.settings,
        service.intake.receiver.clone(),
        service.intake.sessions.clone(),
        service.recorder.clone(),
        (
            service.clock().clone(),
            Arc::new(service.metrics.intake.clone()),
        ),
        service.closing.clone(),
    );
    let listener = tokio::net::TcpListener::from_std(dicom.listener)?;
    tracing::info!(address = %dicom.address, "listening for DICOM");
    let tls: Option<TlsConfiguration> = tls.map(|tls| Arc::new(move || tls.config()) as _);
    Ok(tokio::spawn(scp.run(listener, tls)))
}

/// Tells callers as the settings say.
///
/// # Errors
/// If the service could be used by strangers and the settings do not say that it shall.
async fn guard(service: &Service, address: SocketAddr) -> Result<Guard, ServeError> {
    let settings = &service.settings;
    let loopback = address.ip().to_canonical().is_loopback();
    let text = |text: &String| Some(text.clone()).filter(|text| !text.is_empty());
    let issuer = text(&settings.oidc_issuer).map(|issuer| {
        let tokens = IssuerSettings {
            issuer,
            audience: settings.oidc_audience.clone(),
            jwks: text(&settings.oidc_jwks),
            tenant_claim: text(&settings.oidc_tenant_claim),
            scope_claim: settings.oidc_scope_claim.clone(),
            leeway: settings.oidc_leeway.0,
        };
        Issuer::new(tokens, &*service.http_clients)
    });
    if issuer.is_some() {
        // It stays closed without the setting too.
        service.access.close_access().await?;
    }
    // Whoever can reach a loopback address can usually read the data folder too.
    let anonymous = if loopback {
        Scope::Admin
    } else {
        Scope::Submit
    };
    let gate = Gate::new(
        service.access.clone(),
        service.clock().clone(),
        issuer.transpose()?,
        anonymous,
        settings.allow_anonymous,
    );
    let open = gate.is_open().await?;
    if open && !loopback && !settings.allow_anonymous {
        return Err(ServeError::OpenHttp(address));
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
    Ok(Guard::new(gate, hosts, settings, !loopback))
}
