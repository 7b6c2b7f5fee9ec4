//! Space on the disk of the data folder that is kept for erasures.
//!
//! An erasure writes to the database before it frees anything, so on a full disk nothing could be erased. A file of
//! [`RESERVE_BYTES`] holds the space: when an erasure finds the disk full, the file is deleted and the erasure tried
//! again. The upkeep writes it anew once there is room. Not guaranteed: that no other program takes the space in
//! between.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The file's name in the data folder.
const RESERVE_FILE: &str = "reserve";

/// What the erasure of a volume with a thousand results writes to the log, bytes.
const RESERVE_BYTES: usize = 4 << 20;

/// Free space below which the file is not written, bytes.
const ROOM_BYTES: u64 = 4 * RESERVE_BYTES as u64;

/// The file; none until a folder is set.
#[derive(Debug, Default)]
pub(super) struct Reserve {
    path: OnceLock<PathBuf>,
}

impl Reserve {
    /// Keeps the space in `folder` from now on.
    pub fn keep_in(&self, folder: &Path) {
        // A second folder would be a second store.
        let _ = self.path.set(folder.join(RESERVE_FILE));
    }

    /// Frees the space. `false` if there is none.
    pub fn release(&self) -> bool {
        let Some(path) = self.path.get() else {
            return false;
        };
        let released = fs::remove_file(path).is_ok();
        if released {
            tracing::warn!("the disk is full: the space kept for erasures is used");
        }
        released
    }

    /// Takes the space again if it was freed and the disk has `free` bytes.
    pub fn refill(&self, free: Option<u64>) {
        let Some(path) = self.path.get() else {
            return;
        };
        let roomy = free.is_none_or(|free| free >= ROOM_BYTES);
        if !roomy || fs::metadata(path).is_ok_and(|file| file.len() == RESERVE_BYTES as u64) {
            return;
        }
        if let Err(error) = write(path) {
            tracing::warn!(%error, "no space could be kept for erasures; tried again soon");
            // A part of it is of no use.
            let _ = fs::remove_file(path);
        }
    }
}

/// Writes a file that no file system packs into less than its length.
fn write(path: &Path) -> io::Result<()> {
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut bytes = Vec::with_capacity(RESERVE_BYTES);
    while bytes.len() < RESERVE_BYTES {
        // Marsaglia's xorshift.
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        bytes.extend_from_slice(&state.to_le_bytes());
    }
    let mut file = File::create(path)?;
    file.write_all(&bytes)?;
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_space_is_kept_released_once_and_taken_again_when_there_is_room() {
        let folder = tempfile::tempdir().unwrap();
        let reserve = Reserve::default();
        reserve.refill(None);
        assert!(!reserve.release(), "no folder is set");
        reserve.keep_in(folder.path());
        reserve.refill(Some(ROOM_BYTES - 1));
        assert!(!reserve.release(), "the disk had no room");
        let file = folder.path().join(RESERVE_FILE);
        for _ in 0..2 {
            reserve.refill(Some(ROOM_BYTES));
            assert_eq!(fs::metadata(&file).unwrap().len(), RESERVE_BYTES as u64);
            assert!(reserve.release());
            assert!(!reserve.release());
        }
        fs::write(&file, b"half").unwrap();
        reserve.refill(Some(ROOM_BYTES));
        assert_eq!(fs::metadata(&file).unwrap().len(), RESERVE_BYTES as u64);
    }
}
