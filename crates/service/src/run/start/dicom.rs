//! The reception of objects by DICOM: its settings, and the listener beside the HTTP interface.

use crate::config::Settings;
use crate::limits::decoding::Decoding;
use crate::network::intake::{
    HeaderTurns, HeaderWork, IntakeRoom, Listener, ReceiveError, ReceiverSettings, ScpSettings,
    Senders, TlsConfiguration, Waits,
};
use crate::network::listen::listen;
use crate::run::start::StartError;
use crate::use_cases::service::Service;
use async_trait::async_trait;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use tokio::task::JoinHandle;
use ventriform::image::volume::ReadLimits;

#[async_trait]
impl HeaderTurns for Decoding {
    async fn run(&self, bytes: u64, memory: u64, work: HeaderWork) -> Result<(), ReceiveError> {
        Ok(self.run_on(bytes, memory, work).await?)
    }
}

/// Bounds of the longest P-DATA-TF PDU, bytes.
const PDU_BYTES: (u64, u64) = (4 << 10, 16 << 20);

/// The waiting times of groups.
pub(super) fn waits(settings: &Settings) -> Waits {
    Waits {
        quiet: settings.series_quiet.0,
        patience: settings.series_patience.0,
    }
}

/// Limits on what is received.
pub(super) fn receiver_settings(settings: &Settings) -> ReceiverSettings {
    ReceiverSettings {
        room: IntakeRoom {
            objects: settings.intake_objects,
            bytes: settings.intake_bytes.0,
            tenant_bytes: settings.quota_bytes.0.map(|size| size.0),
        },
        object_bytes: settings.object_limit.0,
        limits: ReadLimits {
            voxels: settings.voxel_limit,
            unpacked_bytes: settings.decompressed_limit.0,
            files: settings.file_limit,
            mesh_bytes: settings.mesh_limit.0,
            ..ReadLimits::DEFAULT
        },
    }
}

/// The address on which objects are received by DICOM, and from whom.
pub struct DicomListener {
    listener: TcpListener,
    address: SocketAddr,
    settings: ScpSettings,
}

impl DicomListener {
    /// Listens for DICOM if the settings ask for it.
    ///
    /// # Errors
    /// If the address cannot be used, or strangers could send and the settings do not say that they may.
    pub fn bind(settings: &Settings) -> Result<Option<Self>, StartError> {
        let address = settings.dicom_listen.0;
        let Some(address) = address.filter(|_| settings.role.serves()) else {
            return Ok(None);
        };
        let unusable = |reason| StartError::DicomAddress { address, reason };
        let loopback = address.ip().to_canonical().is_loopback();
        let scp = scp_settings(settings, loopback).ok_or(StartError::OpenDicom(address))?;
        if scp.senders.others && !loopback {
            tracing::warn!(%address, "every system may send images by DICOM (allow_anonymous)");
        }
        let listener = listen(address).map_err(unusable)?;
        listener.set_nonblocking(true).map_err(unusable)?;
        Ok(Some(Self {
            address: listener.local_addr().map_err(unusable)?,
            listener,
            settings: scp,
        }))
    }

    /// The address on which it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Receives objects until the service shuts down; over TLS, if `tls` says how.
    ///
    /// # Errors
    /// If the system refuses the socket.
    pub fn serve(
        self,
        service: &Service,
        tls: Option<TlsConfiguration>,
    ) -> io::Result<JoinHandle<()>> {
        let scp = Listener::new(
            self.settings,
            service.intake.receiver.clone(),
            service.intake.sessions.clone(),
            service.recorder.clone(),
            (
                service.clock().clone(),
                Arc::new(service.metrics.intake.clone()),
            ),
            service.closing.clone(),
        );
        let listener = tokio::net::TcpListener::from_std(self.listener)?;
        tracing::info!(address = %self.address, "listening for DICOM");
        Ok(tokio::spawn(scp.run(listener, tls)))
    }
}

/// The settings of the SCP. `loopback` if only this machine can reach it. `None` if everybody could send
/// and the operator has not said that everybody may.
fn scp_settings(settings: &Settings, loopback: bool) -> Option<ScpSettings> {
    let listed = settings.senders.0.clone();
    let others = settings.allow_anonymous || (loopback && listed.is_empty());
    if listed.is_empty() && !others {
        return None;
    }
    let (least, most) = PDU_BYTES;
    Some(ScpSettings {
        ae_title: settings.ae_title.clone(),
        senders: Senders { listed, others },
        associations: settings.association_limit,
        of_one_peer: settings.client_association_limit,
        longest_pdu: u32::try_from(settings.pdu_limit.0.clamp(least, most)).unwrap_or(u32::MAX),
        association_bytes: settings.association_bytes.0,
        idle: settings.association_idle.0,
        time_limit: settings.association_time_limit.0,
        grace: settings.shutdown_grace.0,
    })
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;

    #[test]
    fn strangers_may_send_only_where_the_operator_says_so() {
        let mut settings = Settings::default();
        let others = |settings: &Settings, loopback| {
            scp_settings(settings, loopback).map(|scp| scp.senders.others)
        };
        assert_eq!(others(&settings, true), Some(true));
        assert_eq!(others(&settings, false), None);
        settings.senders = r#"[{ ae_title = "CAMERA" }]"#.parse().unwrap();
        assert_eq!(others(&settings, true), Some(false));
        assert_eq!(others(&settings, false), Some(false));
        settings.allow_anonymous = true;
        assert_eq!(others(&settings, false), Some(true));
    }
}
