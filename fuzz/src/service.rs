//! The targets that need the service: forms and associations, sent to it over loopback.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::time::Duration;
use tempfile::TempDir;
use tokio::runtime::Runtime;
use ventriform::image::volume::ReadLimits;
use ventriform_program::server::{Running, start};
use ventriform_service::config::Settings;
use ventriform_service::work::Engine;

/// A running service.
pub struct Target {
    address: SocketAddr,
    dicom: SocketAddr,
    _running: Running,
    _runtime: Runtime,
    _data: TempDir,
}

impl Target {
    /// Starts a service with a folder of its own.
    pub fn start() -> Self {
        let data = tempfile::tempdir().unwrap();
        let runtime = Runtime::new().unwrap();
        let settings = Settings {
            data_dir: data.path().to_owned(),
            body_limit: "1MiB".parse().unwrap(),
            body_timeout: "1s".parse().unwrap(),
            dicom_listen: "127.0.0.1:0".parse().unwrap(),
            association_idle: "1s".parse().unwrap(),
            object_limit: "1MiB".parse().unwrap(),
            ..Settings::default()
        };
        let limits = ReadLimits {
            voxels: 1 << 16,
            unpacked_bytes: 1 << 20,
            ..ReadLimits::DEFAULT
        };
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let running = runtime
            .block_on(start(settings, Engine::new(limits), listener))
            .unwrap();
        Self {
            address: running.address(),
            dicom: running.dicom_address().unwrap(),
            _running: running,
            _runtime: runtime,
            _data: data,
        }
    }

    /// Sends the bytes as an association. The service answers by PDUs and closes; then it still answers
    /// others.
    pub fn association(&self, data: &[u8]) {
        let sent = |data: &[u8]| {
            let mut stream = TcpStream::connect(self.dicom).unwrap();
            let patience = Some(Duration::from_secs(30));
            stream.set_read_timeout(patience).unwrap();
            // The service may close before it has read everything.
            let _ = stream.write_all(data);
            let _ = stream.shutdown(Shutdown::Write);
            let mut answer = Vec::new();
            let read = stream.read_to_end(&mut answer);
            let timed_out = read.is_err_and(|e| e.kind() == ErrorKind::WouldBlock);
            assert!(!timed_out, "the service did not close");
            answer
        };
        let answer = sent(data);
        let told = answer.first().copied();
        assert!(
            told.is_none_or(|kind| (2..=7).contains(&kind)),
            "{answer:?}"
        );
        let whole = crate::targets::corpus("association").swap_remove(0);
        assert_eq!(sent(&whole).first(), Some(&2), "it accepts no association");
    }

    /// Sends the bytes as a form. The service answers 2xx, or a problem of the client's.
    pub fn multipart(&self, data: &[u8]) {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(30)))
            .unwrap();
        let head = format!(
            "POST /v1/volumes HTTP/1.1\r\nhost: {}\r\nconnection: close\r\ncontent-length: {}\r\n\
             content-type: multipart/form-data; boundary=X\r\n\r\n",
            self.address,
            data.len()
        );
        stream.write_all(head.as_bytes()).unwrap();
        // The service may answer and hang up before it has read everything.
        let _ = stream.write_all(data);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8_lossy(&answer);
        let status = answer
            .strip_prefix("HTTP/1.1 ")
            .and_then(|rest| rest.get(..3));
        let status: u16 = status.unwrap_or_default().parse().unwrap_or(0);
        let problem = answer.contains("urn:ventriform:problem:");
        assert!(
            (200..300).contains(&status) || (400..500).contains(&status) && problem,
            "{answer}"
        );
    }
}
