//! Whether stored files still hold what was stored.
//!
//! A file is hashed when it is first used, and again whenever its length, its times or its inode
//! have changed. The hash of a file that this process wrote is known without reading it. So a file
//! that was altered in place is found before it is served or computed on, and a file that was not
//! costs one `fstat`.
//!
//! Not found: content that changes on the disk below the file system after it was verified. The
//! slow check of all files ([`ventriform_service::run::background::Upkeep`]) reads every file anew.

use bytes::Bytes;
use futures::{StreamExt, stream};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::fs::{File, Metadata};
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use ventriform_service::base::records::{BlobError, BlobStream, FileRecord, StoreFault, hex};

/// Files remembered at most, twice: when there are more, the older half is forgotten.
const REMEMBERED_FILES: usize = 8192;

/// Bytes of a file that are read at a time for a client, and held in memory for each slow one.
const SENT_CHUNK: u64 = 256 << 10;

/// Bytes read at a time.
const CHUNK_BYTES: usize = 128 << 10;

/// The properties of a file that change with its content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Stamp {
    bytes: u64,
    identity: [i64; 6],
}

impl Stamp {
    #[cfg(unix)]
    pub fn from_file(file: &Metadata) -> Self {
        use std::os::unix::fs::MetadataExt;
        Self {
            bytes: file.len(),
            identity: [
                file.mtime(),
                file.mtime_nsec(),
                file.ctime(),
                file.ctime_nsec(),
                file.ino().cast_signed(),
                file.dev().cast_signed(),
            ],
        }
    }

    #[cfg(not(unix))]
    pub fn from_file(file: &Metadata) -> Self {
        let modified = file.modified().ok();
        let since = modified.and_then(|at| at.duration_since(std::time::UNIX_EPOCH).ok());
        let nanoseconds = since.map_or(0, |since| since.as_nanos() as i64);
        Self {
            bytes: file.len(),
            identity: [nanoseconds, 0, 0, 0, 0, 0],
        }
    }

    /// Whether the open file with this stamp still holds the same: nothing of it has changed, or it was erased. That
    /// changes the time of its inode alone, and whoever has it open reads on.
    fn still_holds(&self, now: &Metadata) -> bool {
        let mut found = Self::from_file(now);
        if is_erased(now) {
            found.identity[CHANGED..=CHANGED_NANOSECONDS]
                .copy_from_slice(&self.identity[CHANGED..=CHANGED_NANOSECONDS]);
        }
        found == *self
    }
}

/// Places of the time of the inode in the identity.
const CHANGED: usize = 2;
const CHANGED_NANOSECONDS: usize = 3;

#[cfg(unix)]
fn is_erased(file: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    file.nlink() == 0
}

#[cfg(not(unix))]
fn is_erased(_: &Metadata) -> bool {
    false
}

/// The hashes of files, with the stamps they had when they were hashed.
#[derive(Default)]
pub(super) struct Verified(Mutex<Generations>);

/// Younger and older entries, by path below the data folder.
#[derive(Default)]
struct Generations {
    young: HashMap<String, (Stamp, String)>,
    old: HashMap<String, (Stamp, String)>,
}

impl Verified {
    /// Remembers the hash of the file at `path`.
    pub fn remember(&self, path: String, stamp: Stamp, sha256: String) {
        let mut generations = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if generations.young.len() >= REMEMBERED_FILES {
            generations.old = std::mem::take(&mut generations.young);
        }
        generations.young.insert(path, (stamp, sha256));
    }

    fn known(&self, path: &str, stamp: &Stamp) -> Option<String> {
        let generations = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = generations.young.get(path).or(generations.old.get(path))?;
        (found.0 == *stamp).then(|| found.1.clone())
    }

    /// Checks that the open file holds what `record` says; hashes it if it is not known. Returns
    /// its stamp.
    ///
    /// # Errors
    /// [`StoreFault::DamagedFile`], or that of reading.
    pub fn check(&self, path: &str, file: &File, record: &FileRecord) -> Result<Stamp, BlobError> {
        let stamp = Stamp::from_file(&file.metadata()?);
        if stamp.bytes != record.bytes {
            return Err(damaged(
                path,
                &format!("{} bytes instead of {}", stamp.bytes, record.bytes),
            ));
        }
        let hash = match self.known(path, &stamp) {
            Some(hash) => hash,
            None => {
                let hash = hash(file)?;
                self.remember(path.to_owned(), stamp, hash.clone());
                hash
            }
        };
        if hash != record.sha256 {
            return Err(damaged(path, "its SHA-256 is another"));
        }
        Ok(stamp)
    }
}

/// The file at `path` is not what was stored.
pub(super) fn damaged(path: &str, how: &str) -> BlobError {
    BlobError::new(StoreFault::DamagedFile, format!("{path} is damaged: {how}"))
}

/// SHA-256 of a file from its current position on, hexadecimal.
pub(super) fn hash(mut file: &File) -> std::io::Result<String> {
    let mut hash = Sha256::new();
    let mut chunk = vec![0; CHUNK_BYTES];
    loop {
        match file.read(&mut chunk)? {
            0 => return Ok(hex(&hash.finalize())),
            read => hash.update(&chunk[..read]),
        }
    }
}

/// The rest of a range of a verified file, chunk by chunk.
pub(super) struct Reading {
    file: File,
    stamp: Stamp,
    left: u64,
    path: String,
}

impl Reading {
    /// The first chunk of `range`, and the rest. Errors call the file `path`. To be called on a thread
    /// that may block.
    ///
    /// # Errors
    /// [`StoreFault::DamagedFile`] if the file has changed since its stamp was taken, or that of
    /// reading.
    pub fn begin(
        mut file: File,
        stamp: Stamp,
        path: String,
        range: Range<u64>,
    ) -> Result<(Bytes, Self), BlobError> {
        file.seek(SeekFrom::Start(range.start))?;
        let reading = Self {
            file,
            stamp,
            left: range.end.saturating_sub(range.start),
            path,
        };
        reading.next()
    }

    /// The next chunk. With the last one, checks that the file was not changed meanwhile. A file that was erased
    /// meanwhile is read to its end: the answer has begun, and is whole.
    fn next(mut self) -> Result<(Bytes, Self), BlobError> {
        let mut chunk = vec![0; self.left.min(SENT_CHUNK) as usize];
        self.file.read_exact(&mut chunk)?;
        self.left -= chunk.len() as u64;
        if self.left == 0 && !self.stamp.still_holds(&self.file.metadata()?) {
            return Err(damaged(&self.path, "it changed while it was read"));
        }
        Ok((chunk.into(), self))
    }
}

/// A file that [`Reading::begin`] has begun to read.
pub(super) fn stream((chunk, rest): (Bytes, Reading)) -> BlobStream {
    let rest = stream::try_unfold(rest, async |reading: Reading| {
        if reading.left == 0 {
            return Ok(None);
        }
        tokio::task::spawn_blocking(move || reading.next())
            .await
            .map_err(|e| BlobError::new(StoreFault::Other, e.to_string()))?
            .map(Some)
    });
    stream::iter([Ok(chunk)]).chain(rest).boxed()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::path::Path;

    /// Whether a reading that has begun ends whole after `act` on its file.
    fn ends_whole(act: impl FnOnce(&Path)) -> bool {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("volume.nii");
        let content: Vec<u8> = (0..3 * SENT_CHUNK / 2).map(|at| at as u8).collect();
        fs::write(&path, &content).unwrap();
        let file = File::open(&path).unwrap();
        let stamp = Stamp::from_file(&file.metadata().unwrap());
        let all = 0..content.len() as u64;
        let (first, rest) = Reading::begin(file, stamp, "volume.nii".into(), all).unwrap();
        act(&path);
        let second = rest.next();
        second.is_ok_and(|(second, _)| [first, second].concat() == content)
    }

    /// An answer that has begun when the item is erased is whole: the file is read on, as it is open. One that was
    /// altered is not passed on.
    #[test]
    fn a_file_that_is_erased_while_it_is_read_is_whole_and_one_that_is_altered_is_refused() {
        let alter = |path: &Path| {
            // The times of files are those of the kernel's last tick.
            std::thread::sleep(std::time::Duration::from_millis(20));
            fs::write(path, vec![7; 3 * SENT_CHUNK as usize / 2]).unwrap();
        };
        assert!(ends_whole(|_| {}));
        assert!(ends_whole(|path| fs::remove_file(path).unwrap()));
        assert!(ends_whole(|path| {
            let doomed = path.with_extension("doomed");
            fs::rename(path, &doomed).unwrap();
            fs::remove_file(doomed).unwrap();
        }));
        assert!(!ends_whole(alter));
        assert!(!ends_whole(|path| {
            alter(path);
            fs::remove_file(path).unwrap();
        }));
    }
}
