//! TLS 1.2 and 1.3 by rustls, with client certificates if an authority for them is named (mTLS).
//!
//! The PEM files are read at the start, and again when they have changed or the process gets
//! SIGHUP. Connections that exist keep the certificate they began with; files that cannot be used
//! are logged and leave the former ones in use.
//!
//! A client whose certificate does not come from a named authority is refused during the
//! handshake. A client without one gets a 403 that says what is missing; only `/healthz` and
//! `/readyz` are answered, so that probes need no certificate. The verified certificate is put into
//! the extensions of each request as [`ClientCertificate`].
//!
//! A client that speaks plain HTTP gets a 400 in plain HTTP that says so.
//!
//! DICOM is served over TLS by the same means, with files of its own ([`Tls::of_dicom`]).

use super::stall::WatchedStream;
use rustls::server::WebPkiClientVerifier;
use rustls::{ServerConfig, ServerConnection};
use sha2::{Digest, Sha256};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime};
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;
use tokio_util::sync::CancellationToken;
use ventriform_service::base::pem;
use ventriform_service::base::records::hex;
use ventriform_service::config::{OptionalPath, Settings};

/// Interval between two looks at the files.
const LOOK_EVERY: Duration = Duration::from_secs(5);

/// The first byte of a TLS handshake (RFC 8446, section 5.1).
const TLS_HANDSHAKE: u8 = 22;

/// The body of the answer to plain HTTP.
const PLAIN_HTTP: &str = "{\"type\":\"urn:ventriform:problem:tls-required\",\
    \"title\":\"Tls required\",\"status\":400,\
    \"detail\":\"This port speaks TLS, and the request came in plain HTTP.\",\
    \"fix\":\"Use https instead of http.\"}\n";

/// The answer to plain HTTP.
fn plain_http() -> String {
    format!(
        "HTTP/1.1 400 Bad Request\r\ncontent-type: application/problem+json\r\n\
         content-length: {}\r\nconnection: close\r\n\r\n{PLAIN_HTTP}",
        PLAIN_HTTP.len()
    )
}

/// Why TLS cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// A setting is missing.
    #[error("{0} is set without {1}; give both, or neither to do without TLS")]
    Incomplete(&'static str, &'static str),
    /// A file cannot be used.
    #[error("{setting}: {path}: {reason}")]
    File {
        /// The setting that names it.
        setting: &'static str,
        /// The file.
        path: PathBuf,
        /// The faults of it.
        reason: String,
    },
    /// The certificate and the key cannot be used together.
    #[error("{0} and its key cannot be used together: {1}")]
    Pair(&'static str, rustls::Error),
}

/// The TLS side of the service.
pub struct Tls {
    files: TlsFiles,
    current: Mutex<(Arc<ServerConfig>, Versions)>,
}

/// The files that the settings name.
#[derive(Debug, Clone)]
struct TlsFiles {
    names: TlsNames,
    certificate: PathBuf,
    key: PathBuf,
    client_authorities: Option<PathBuf>,
    /// Whether they are for DICOM, and not for HTTP.
    dicom: bool,
}

/// The names of the settings that name the files.
#[derive(Debug, Clone, Copy)]
struct TlsNames {
    certificate: &'static str,
    key: &'static str,
    client_authorities: &'static str,
}

/// Time and size of each file.
type Versions = Vec<Option<(SystemTime, u64)>>;

impl Tls {
    /// Reads the files that the settings name for HTTP; `None` if they ask for plain HTTP.
    ///
    /// # Errors
    /// If a setting is missing, or a file cannot be used.
    pub fn from_settings(settings: &Settings) -> Result<Option<Arc<Self>>, TlsError> {
        let names = TlsNames {
            certificate: "tls_cert",
            key: "tls_key",
            client_authorities: "tls_client_ca",
        };
        let given = [
            &settings.tls_cert,
            &settings.tls_key,
            &settings.tls_client_ca,
        ];
        Self::of_files(names, given, false)
    }

    /// The same for DICOM. A caller without a certificate is refused in the handshake, if authorities for
    /// them are named.
    ///
    /// # Errors
    /// If a setting is missing, or a file cannot be used.
    pub fn of_dicom(settings: &Settings) -> Result<Option<Arc<Self>>, TlsError> {
        let names = TlsNames {
            certificate: "dicom_tls_cert",
            key: "dicom_tls_key",
            client_authorities: "dicom_tls_client_ca",
        };
        let given = [
            &settings.dicom_tls_cert,
            &settings.dicom_tls_key,
            &settings.dicom_tls_client_ca,
        ];
        Self::of_files(names, given, true)
    }

    fn of_files(
        names: TlsNames,
        given: [&OptionalPath; 3],
        dicom: bool,
    ) -> Result<Option<Arc<Self>>, TlsError> {
        let [certificate, key, client_authorities] = given.map(|setting| setting.0.clone());
        let files = match (certificate, key) {
            (None, None) if client_authorities.is_some() => {
                let without = names.certificate;
                return Err(TlsError::Incomplete(names.client_authorities, without));
            }
            (None, None) => return Ok(None),
            (Some(_), None) => return Err(TlsError::Incomplete(names.certificate, names.key)),
            (None, Some(_)) => return Err(TlsError::Incomplete(names.key, names.certificate)),
            (Some(certificate), Some(key)) => TlsFiles {
                names,
                certificate,
                key,
                client_authorities,
                dicom,
            },
        };
        // Taken before reading, so that a change in between is seen later.
        let versions = files.versions();
        let config = Arc::new(files.read()?);
        Ok(Some(Arc::new(Self {
            files,
            current: Mutex::new((config, versions)),
        })))
    }

    /// Whether clients need a certificate.
    pub fn demands_certificates(&self) -> bool {
        self.files.client_authorities.is_some()
    }

    /// The settings of a handshake that begins now.
    pub fn config(&self) -> Arc<ServerConfig> {
        self.lock().0.clone()
    }

    /// The handshake; `None` after answering a client that speaks plain HTTP.
    ///
    /// # Errors
    /// If the client breaks off, or its certificate is not accepted.
    pub async fn accept(
        &self,
        mut stream: WatchedStream<TcpStream>,
    ) -> io::Result<Option<TlsStream<WatchedStream<TcpStream>>>> {
        let mut first = [0];
        if stream.get_ref().peek(&mut first).await? == 1 && first[0] != TLS_HANDSHAKE {
            stream.write_all(plain_http().as_bytes()).await?;
            stream.shutdown().await?;
            // Unread bytes would make the system reset the connection before the client has read
            // the answer.
            tokio::io::copy(&mut stream, &mut tokio::io::sink()).await?;
            return Ok(None);
        }
        TlsAcceptor::from(self.config())
            .accept(stream)
            .await
            .map(Some)
    }

    /// Reads the files again when they change and on SIGHUP, until `shutdown`.
    pub async fn follow_changes(self: Arc<Self>, shutdown: CancellationToken) {
        let mut hangup = Hangup::listen();
        loop {
            let asked = tokio::select! {
                () = tokio::time::sleep(LOOK_EVERY) => false,
                () = hangup.received() => true,
                () = shutdown.cancelled() => return,
            };
            self.reload(asked);
        }
    }

    /// Reads the files again, if they have changed or somebody `asked` for it.
    fn reload(&self, asked: bool) {
        let versions = self.files.versions();
        if !asked && self.lock().1 == versions {
            return;
        }
        match self.files.read() {
            Ok(config) => {
                *self.lock() = (Arc::new(config), versions);
                tracing::info!("the TLS certificate was read again");
            }
            Err(error) => {
                // Not tried again until the files change once more.
                self.lock().1 = versions;
                tracing::error!(%error, "the TLS files cannot be used; the former ones stay in use");
            }
        }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, (Arc<ServerConfig>, Versions)> {
        // A panic cannot leave the pair half changed: each use is a single assignment.
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl TlsFiles {
    fn versions(&self) -> Versions {
        let version = |path: &Path| {
            let facts = std::fs::metadata(path).ok()?;
            Some((facts.modified().ok()?, facts.len()))
        };
        let all = [
            Some(&self.certificate),
            Some(&self.key),
            self.client_authorities.as_ref(),
        ];
        all.into_iter()
            .flatten()
            .map(|path| version(path))
            .collect()
    }

    fn read(&self) -> Result<ServerConfig, TlsError> {
        let unusable = |setting, path: &Path, reason: String| TlsError::File {
            setting,
            path: path.to_owned(),
            reason,
        };
        let chain = pem::certificates(&self.certificate)
            .map_err(|reason| unusable(self.names.certificate, &self.certificate, reason))?;
        let key = pem::private_key(&self.key)
            .map_err(|reason| unusable(self.names.key, &self.key, reason))?;
        let pair = |error| TlsError::Pair(self.names.certificate, error);
        let provider = pem::provider();
        let builder = ServerConfig::builder_with_provider(provider.clone())
            .with_protocol_versions(&pem::TLS_VERSIONS)
            .map_err(pair)?;
        let builder = match &self.client_authorities {
            None => builder.with_no_client_auth(),
            Some(path) => {
                let wrong = |reason| unusable(self.names.client_authorities, path, reason);
                let authorities = pem::authorities(path).map_err(wrong)?;
                let mut verifier =
                    WebPkiClientVerifier::builder_with_provider(authorities.into(), provider);
                if !self.dicom {
                    verifier = verifier.allow_unauthenticated();
                }
                let verifier = verifier.build();
                let verifier = verifier.map_err(|error| wrong(error.to_string()))?;
                builder.with_client_cert_verifier(verifier)
            }
        };
        let mut config = builder.with_single_cert(chain, key).map_err(pair)?;
        if !self.dicom {
            config.alpn_protocols = vec![b"http/1.1".to_vec()];
        }
        Ok(config)
    }
}

/// A client's certificate, verified in the handshake. In the extensions of a request as
/// `Arc<ClientCertificate>`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClientCertificate {
    /// The subject, as in RFC 4514: `CN=workstation 4, O=Clinic`.
    pub subject: String,
    /// The subject's common name.
    pub common_name: Option<String>,
    /// SHA-256 of the certificate, in hexadecimal digits.
    pub fingerprint: String,
}

impl ClientCertificate {
    /// The certificate of the other end of a connection.
    pub fn from_connection(connection: &ServerConnection) -> Option<Arc<Self>> {
        let certificate = connection.peer_certificates()?.first()?;
        let (_, parsed) = x509_parser::parse_x509_certificate(certificate).ok()?;
        let subject = parsed.subject();
        let mut names = subject.iter_common_name();
        Some(Arc::new(Self {
            subject: subject.to_string(),
            common_name: names
                .next()
                .and_then(|name| Some(name.as_str().ok()?.to_owned())),
            fingerprint: hex(&Sha256::digest(certificate)),
        }))
    }
}

/// The signal that asks to read files again.
#[cfg(unix)]
struct Hangup(Option<tokio::signal::unix::Signal>);

#[cfg(unix)]
impl Hangup {
    fn listen() -> Self {
        use tokio::signal::unix::{SignalKind, signal};
        let listening = signal(SignalKind::hangup());
        if let Err(error) = &listening {
            tracing::warn!(%error, "SIGHUP cannot be received; TLS files are read when they change");
        }
        Self(listening.ok())
    }

    async fn received(&mut self) {
        let received = match &mut self.0 {
            Some(signal) => signal.recv().await,
            None => None,
        };
        if received.is_none() {
            std::future::pending().await
        }
    }
}

#[cfg(not(unix))]
struct Hangup;

#[cfg(not(unix))]
impl Hangup {
    fn listen() -> Self {
        Self
    }

    async fn received(&mut self) {
        std::future::pending().await
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_answer_to_plain_http_is_complete() {
        let answer = plain_http();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        assert!(head.contains(&format!("content-length: {}\r\n", body.len())));
        let body: serde_json::Value = serde_json::from_str(body).unwrap();
        assert_eq!(body["type"], "urn:ventriform:problem:tls-required");
    }
}
