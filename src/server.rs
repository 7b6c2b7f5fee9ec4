//! The service as a whole: settings, then stores and the HTTP client, then the service on them, then its listeners.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use tokio::task::JoinHandle;
use ventriform_http::{Tls, TlsError, install_cryptography};
use ventriform_http_client::ReqwestFactory;
use ventriform_service::config::Settings;
use ventriform_service::jobs::Queue;
use ventriform_service::network::intake::TlsConfiguration;
use ventriform_service::run::start::{DicomListener, RunningService, StartError, check_role, open};
use ventriform_service::work::Engine;
use ventriform_store::{OpenError, S3Location, Store, StoreSettings};

/// Why the service did not start, or ended without being asked.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The stores cannot be used.
    #[error(transparent)]
    Store(#[from] OpenError),
    /// The service cannot be started on its stores and settings.
    #[error(transparent)]
    Start(#[from] StartError),
    /// TLS cannot be used as the settings ask for it.
    #[error(transparent)]
    Tls(#[from] TlsError),
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

/// Starts the service on a bound listener.
///
/// # Errors
/// If the stores are in use or unusable, strangers could use the service and the settings do not say that they shall, or
/// the system refuses threads or sockets.
pub async fn start(
    settings: Settings,
    engine: Engine,
    listener: TcpListener,
) -> Result<Running, ServeError> {
    install_cryptography();
    check_role(&settings)?;
    let dicom = DicomListener::bind(&settings)?;
    let tls = Tls::from_settings(&settings)?;
    let dicom_tls = Tls::of_dicom(&settings)?;
    let store = Store::open_with(&settings.data_dir, store_settings(&settings)).await?;
    let opened = open(
        settings,
        engine,
        store.into_stores(),
        Arc::new(ReqwestFactory),
    )
    .await?;
    let service = opened.service.clone();
    let address = listener.local_addr()?;
    let entrance = service.entrance(address).await?;
    for tls in [&tls, &dicom_tls].into_iter().flatten() {
        tokio::spawn(tls.clone().follow_changes(service.closing().clone()));
    }
    let server = ventriform_http::serve(&service, listener, entrance, tls)?;
    let running = RunningService::start(opened)?;
    let dicom_address = dicom.as_ref().map(DicomListener::address);
    let dicom_tls = dicom_tls.map(|tls| -> TlsConfiguration { Arc::new(move || tls.config()) });
    let dicom = dicom.map(|dicom| dicom.serve(&service, dicom_tls));
    tracing::info!(%address, "listening");
    Ok(Running {
        address,
        service: running,
        server,
        dicom: dicom.transpose()?,
        dicom_address,
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

/// Where the files are, if not in the data folder.
pub fn s3_location(settings: &Settings) -> Option<S3Location> {
    let (bucket, prefix) = settings.blobs.bucket()?;
    Some(S3Location {
        bucket: bucket.to_owned(),
        prefix: prefix.to_owned(),
        variables: settings.aws.0.clone(),
    })
}

/// How the store of these settings is opened.
pub fn store_settings(settings: &Settings) -> StoreSettings {
    StoreSettings {
        min_free: settings.min_free.0.map(|size| size.0),
        write_wait: settings.write_wait.0,
        database: settings.postgres(),
        s3: s3_location(settings),
        cache: settings.blob_cache.0,
    }
}
