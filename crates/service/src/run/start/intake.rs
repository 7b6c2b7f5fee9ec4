//! The settings of the intake.

use crate::config::Settings;
use crate::limits::decoding::Decoding;
use crate::network::intake::{
    HeaderTurns, HeaderWork, IntakeRoom, ReceiveError, ReceiverSettings, ScpSettings, Senders,
    Waits,
};
use async_trait::async_trait;
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
pub fn waits(settings: &Settings) -> Waits {
    Waits {
        quiet: settings.series_quiet.0,
        patience: settings.series_patience.0,
    }
}

/// Limits on what is received.
pub fn receiver_settings(settings: &Settings) -> ReceiverSettings {
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

/// The settings of the SCP. `loopback` if only this machine can reach it. `None` if everybody could send
/// and the operator has not said that everybody may.
pub fn scp_settings(settings: &Settings, loopback: bool) -> Option<ScpSettings> {
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
