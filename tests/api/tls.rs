//! TLS, client certificates, and new certificates while the service runs.

use crate::helpers::{Service, TestApp, problem};
use rcgen::{
    BasicConstraints, CertificateParams, CertifiedIssuer, DnType, ExtendedKeyUsagePurpose, IsCa,
    KeyPair,
};
use reqwest::{Certificate, Client, Identity};
use std::path::Path;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use ventriform_service::config::Settings;

/// An authority that signs certificates.
pub struct Authority(CertifiedIssuer<'static, KeyPair>);

impl Authority {
    pub fn new() -> Self {
        let mut params = CertificateParams::default();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        Self(CertifiedIssuer::self_signed(params, KeyPair::generate().unwrap()).unwrap())
    }

    /// A certificate and its key as PEM.
    pub fn sign(&self, names: &[&str], usage: ExtendedKeyUsagePurpose) -> (String, String) {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let mut params = CertificateParams::new(names).unwrap();
        let name = "workstation 4";
        params.distinguished_name.push(DnType::CommonName, name);
        params.extended_key_usages = vec![usage];
        let key = KeyPair::generate().unwrap();
        let certificate = params.signed_by(&key, &self.0).unwrap();
        (certificate.pem(), key.serialize_pem())
    }

    /// Writes a certificate for the service into `folder`.
    pub fn equip(&self, folder: &Path) {
        let (certificate, key) = self.sign(&["127.0.0.1"], ExtendedKeyUsagePurpose::ServerAuth);
        std::fs::write(folder.join("cert.pem"), certificate).unwrap();
        std::fs::write(folder.join("key.pem"), key).unwrap();
    }

    /// Its own certificate as PEM.
    pub fn pem(&self) -> String {
        self.0.pem()
    }

    /// The connection under TLS, by a client that trusts this authority.
    pub async fn secured(&self, stream: TcpStream) -> tokio_rustls::client::TlsStream<TcpStream> {
        let mut roots = rustls::RootCertStore::empty();
        roots.add(self.0.der().clone()).unwrap();
        let config = rustls::ClientConfig::builder()
            .with_root_certificates(roots)
            .with_no_client_auth();
        let name = "127.0.0.1".try_into().unwrap();
        let connector = tokio_rustls::TlsConnector::from(std::sync::Arc::new(config));
        connector.connect(name, stream).await.unwrap()
    }

    fn identity(&self) -> Identity {
        let (certificate, key) = self.sign(&["client"], ExtendedKeyUsagePurpose::ClientAuth);
        Identity::from_pem(format!("{certificate}{key}").as_bytes()).unwrap()
    }

    /// A client that trusts this authority alone.
    fn client(&self, identity: Option<Identity>) -> Client {
        let trusted = Certificate::from_pem(self.0.pem().as_bytes()).unwrap();
        let mut builder = Client::builder().tls_certs_only([trusted]);
        if let Some(identity) = identity {
            builder = builder.identity(identity);
        }
        builder.build().unwrap()
    }
}

pub fn file(folder: &Path, name: &str) -> ventriform_service::config::OptionalPath {
    folder.join(name).to_str().unwrap().parse().unwrap()
}

/// A service with TLS; returns its address too.
async fn with_tls(folder: &Path, change: impl FnOnce(&mut Settings)) -> (TestApp, String) {
    let app = TestApp::with(|settings| {
        settings.tls_cert = file(folder, "cert.pem");
        settings.tls_key = file(folder, "key.pem");
        settings.header_timeout = "2s".parse().unwrap();
        change(settings);
    })
    .await;
    let address = app.url.strip_prefix("http://").unwrap().to_owned();
    (app, address)
}

#[tokio::test]
async fn the_service_speaks_tls_to_those_who_trust_its_certificate() {
    let (own, other) = (Authority::new(), Authority::new());
    let folder = tempfile::tempdir().unwrap();
    own.equip(folder.path());
    let (_app, address) = with_tls(folder.path(), |_| {}).await;
    let url = format!("https://{address}/healthz");
    let answer = own.client(None).get(&url).send().await.unwrap();
    assert_eq!(answer.status(), 200);
    assert!(other.client(None).get(&url).send().await.is_err());
}

#[tokio::test]
async fn plain_http_and_silence_on_the_tls_port_are_ended() {
    let folder = tempfile::tempdir().unwrap();
    Authority::new().equip(folder.path());
    let (_app, address) = with_tls(folder.path(), |settings| {
        settings.header_timeout = "300ms".parse().unwrap();
    })
    .await;
    for (sent, status) in [
        ("GET /healthz HTTP/1.1\r\nhost: x\r\n\r\n", "HTTP/1.1 400"),
        ("", ""),
    ] {
        let mut stream = TcpStream::connect(&address).await.unwrap();
        stream.write_all(sent.as_bytes()).await.unwrap();
        let mut said = String::new();
        let read = stream.read_to_string(&mut said);
        let read = tokio::time::timeout(Duration::from_secs(10), read).await;
        read.expect("the service hangs up").unwrap();
        assert!(said.starts_with(status), "{said}");
        assert_eq!(
            said.contains("urn:ventriform:problem:tls-required"),
            !sent.is_empty()
        );
    }
}

#[tokio::test]
async fn client_certificates_are_demanded_and_verified() {
    let (own, foreign) = (Authority::new(), Authority::new());
    let folder = tempfile::tempdir().unwrap();
    own.equip(folder.path());
    std::fs::write(folder.path().join("ca.pem"), own.0.pem()).unwrap();
    let (_app, address) = with_tls(folder.path(), |settings| {
        settings.tls_client_ca = file(folder.path(), "ca.pem");
    })
    .await;
    let url = |path: &str| format!("https://{address}{path}");
    let known = own.client(Some(own.identity()));
    assert_eq!(
        known.get(url("/v1/volumes")).send().await.unwrap().status(),
        200
    );
    let without = own.client(None);
    let refused = without.get(url("/v1/volumes")).send().await.unwrap();
    assert_eq!(refused.status(), 403);
    let refused: serde_json::Value = refused.json().await.unwrap();
    assert_eq!(
        refused["type"],
        "urn:ventriform:problem:client-certificate-required"
    );
    assert_eq!(
        without.get(url("/readyz")).send().await.unwrap().status(),
        200
    );
    let impostor = own.client(Some(foreign.identity()));
    assert!(impostor.get(url("/readyz")).send().await.is_err());
}

#[tokio::test]
async fn half_a_pair_of_settings_and_bad_files_stop_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let refused = async |certificate: &str, key: &str| {
        let settings = Settings {
            data_dir: folder.path().join("data"),
            tls_cert: file(folder.path(), certificate),
            tls_key: key.parse().unwrap(),
            ..Settings::default()
        };
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let started =
            ventriform_program::server::start(settings, crate::helpers::fake_engine(), listener);
        started.await.err().expect("it cannot start").to_string()
    };
    assert!(refused("cert.pem", "off").await.contains("tls_key"));
    assert!(
        refused("missing.pem", "key.pem")
            .await
            .contains("missing.pem")
    );
    std::fs::write(folder.path().join("empty.pem"), "").unwrap();
    assert!(
        refused("empty.pem", "key.pem")
            .await
            .contains("no certificate")
    );
}

#[cfg(unix)]
#[tokio::test]
async fn a_new_certificate_is_taken_up_without_dropping_connections() {
    let (first, second) = (Authority::new(), Authority::new());
    let folder = tempfile::tempdir().unwrap();
    first.equip(folder.path());
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (certificate, key) = (path("cert.pem"), path("key.pem"));
    let data = folder.path().join("data");
    let tls = ["--tls-cert", &certificate, "--tls-key", &key];
    let service = Service::start(&data, &tls).await;
    let url = format!("{}/healthz", service.url);
    let before = first.client(None);
    assert_eq!(before.get(&url).send().await.unwrap().status(), 200);
    second.equip(folder.path());
    service.signal("HUP");
    let mut taken_up = false;
    for _ in 0..200 {
        // A new client makes a new connection.
        taken_up = second.client(None).get(&url).send().await.is_ok();
        if taken_up {
            break;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert!(taken_up);
    assert!(first.client(None).get(&url).send().await.is_err());
    assert_eq!(before.get(&url).send().await.unwrap().status(), 200);
    // Unusable files leave the certificate as it is.
    std::fs::write(&certificate, "nothing").unwrap();
    service.signal("HUP");
    tokio::time::sleep(Duration::from_millis(200)).await;
    assert_eq!(
        second.client(None).get(&url).send().await.unwrap().status(),
        200
    );
    problem(
        before.get(format!("{url}x")).send().await.unwrap(),
        404,
        "no-such-path",
    )
    .await;
}
