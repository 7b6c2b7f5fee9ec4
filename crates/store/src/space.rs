//! The space of the disk that holds a data folder.

use std::path::{Path, PathBuf};
use ventriform_service::base::records::DiskSpace;

/// Most that is kept free unless the operator sets a size.
const DISK_RESERVE_BYTES: u64 = 256 << 20;
/// On small disks, the reserve is the total divided by this.
const RESERVE_SHARE: u64 = 20;

/// Measures the space of one folder's disk.
#[derive(Debug, Clone)]
pub struct DiskGauge {
    folder: PathBuf,
    reserve: Option<u64>,
}

impl DiskGauge {
    /// A gauge for the disk of `folder`. `reserve` is kept free; if it is not set, that is 256
    /// MiB, or 5 % of a smaller disk.
    pub fn new(folder: &Path, reserve: Option<u64>) -> Self {
        Self {
            folder: folder.to_owned(),
            reserve,
        }
    }

    /// The space now; `None` if the system does not tell.
    pub fn space(&self) -> Option<DiskSpace> {
        let (free, total) = free_and_total(&self.folder)?;
        let reserve = self
            .reserve
            .unwrap_or(DISK_RESERVE_BYTES.min(total / RESERVE_SHARE));
        Some(DiskSpace {
            free,
            total,
            reserve,
        })
    }
}

#[cfg(unix)]
fn free_and_total(folder: &Path) -> Option<(u64, u64)> {
    let found = rustix::fs::statvfs(folder).ok()?;
    let bytes = |blocks: u64| blocks.saturating_mul(found.f_frsize);
    Some((bytes(found.f_bavail), bytes(found.f_blocks)))
}

#[cfg(not(unix))]
fn free_and_total(_folder: &Path) -> Option<(u64, u64)> {
    None
}
