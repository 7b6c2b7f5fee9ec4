//! Local copies of files that are stored elsewhere, of bounded size.
//!
//! A copy is made by a download under another name, which is hashed on the way and moved to its place
//! when its content is right. It is verified again before each use, as the files of a folder are
//! ([`super::content`]); one that was altered or deleted is downloaded again. So the folder can be
//! emptied at any time: that costs downloads and nothing else.
//!
//! The copies that were not used for the longest time are deleted first. Those in use stay, so that
//! the folder may be larger than the limit while a great file is read.

use super::blobs::is_absent;
use super::content::{self, Stamp, Verified};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::SystemTime;
use ventriform_service::base::records::{BlobError, FileRecord, LocalFile, StoreFault, random_id};

/// Downloads that have not ended.
const ARRIVING_FOLDER: &str = "arriving";

/// The folder of copies.
pub(super) struct LocalCache {
    folder: PathBuf,
    limit: u64,
    verified: Arc<Verified>,
    copies: Arc<Mutex<Copies>>,
    turns: Mutex<HashMap<String, Weak<tokio::sync::Mutex<()>>>>,
}

/// Every copy by its path below the folder, and the paths in the order of their last use.
#[derive(Default)]
struct Copies {
    by_path: HashMap<String, Copy>,
    by_use: BTreeMap<u64, String>,
    bytes: u64,
    uses: u64,
}

struct Copy {
    /// When it was made, counted as uses are.
    made: u64,
    bytes: u64,
    used: u64,
    users: usize,
}

impl Copies {
    /// Adds the copy at `path`, in place of one that may be there.
    fn add(&mut self, path: &str, bytes: u64) {
        self.remove(path);
        self.uses += 1;
        let (made, used) = (self.uses, self.uses);
        self.by_use.insert(used, path.to_owned());
        self.bytes += bytes;
        let copy = Copy {
            made,
            bytes,
            used,
            users: 0,
        };
        self.by_path.insert(path.to_owned(), copy);
    }

    /// Notes that somebody uses the copy at `path`. Returns when it was made; `None` if there is none.
    fn enter(&mut self, path: &str) -> Option<u64> {
        let copy = self.by_path.get_mut(path)?;
        self.by_use.remove(&copy.used);
        self.uses += 1;
        copy.used = self.uses;
        copy.users += 1;
        self.by_use.insert(copy.used, path.to_owned());
        Some(copy.made)
    }

    /// Notes that somebody uses it no longer, unless it was replaced meanwhile.
    fn leave(&mut self, path: &str, made: u64) {
        let copy = self.by_path.get_mut(path);
        if let Some(copy) = copy.filter(|copy| copy.made == made) {
            copy.users -= 1;
        }
    }

    fn remove(&mut self, path: &str) -> Option<Copy> {
        let copy = self.by_path.remove(path)?;
        self.by_use.remove(&copy.used);
        self.bytes -= copy.bytes;
        Some(copy)
    }

    /// Removes the copies beyond the limit that nobody uses, and returns their paths.
    fn superfluous(&mut self, limit: u64) -> Vec<String> {
        let mut bytes = self.bytes;
        let mut paths = Vec::new();
        for path in self.by_use.values() {
            if bytes <= limit {
                break;
            }
            let copy = self.by_path.get(path);
            if let Some(copy) = copy.filter(|copy| copy.users == 0) {
                bytes -= copy.bytes;
                paths.push(path.clone());
            }
        }
        for path in &paths {
            self.remove(path);
        }
        paths
    }
}

fn entered<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A panic cannot leave the tables half changed: nothing in them panics.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps a copy from being deleted as superfluous.
struct InUse {
    path: String,
    made: u64,
    copies: Arc<Mutex<Copies>>,
}

impl Drop for InUse {
    fn drop(&mut self) {
        entered(&self.copies).leave(&self.path, self.made);
    }
}

/// A verified copy.
pub(super) struct Found {
    /// The open file.
    pub file: File,
    /// Its stamp.
    pub stamp: Stamp,
    /// Its path, with what keeps it there.
    pub local: LocalFile,
}

impl LocalCache {
    /// Makes the folder if it does not exist, and takes over the copies in it.
    ///
    /// # Errors
    /// If the folder cannot be read or written.
    pub fn open(folder: &Path, limit: u64) -> io::Result<Self> {
        let arriving = folder.join(ARRIVING_FOLDER);
        match fs::remove_dir_all(&arriving) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        fs::create_dir_all(&arriving)?;
        let cache = Self {
            folder: folder.to_owned(),
            limit,
            verified: Arc::default(),
            copies: Arc::default(),
            turns: Mutex::default(),
        };
        let mut found = cache.on_disk()?;
        found.sort();
        let mut copies = entered(&cache.copies);
        for (_, path, bytes) in found {
            copies.add(&path, bytes);
        }
        cache.shrink(&mut copies);
        drop(copies);
        Ok(cache)
    }

    /// Every copy on the disk: when it was written, path and length.
    fn on_disk(&self) -> io::Result<Vec<(SystemTime, String, u64)>> {
        let mut found = Vec::new();
        for place in fs::read_dir(&self.folder)? {
            let place = place?;
            let name = place.file_name().to_string_lossy().into_owned();
            if name == ARRIVING_FOLDER || !place.file_type()?.is_dir() {
                continue;
            }
            for file in fs::read_dir(place.path())? {
                let file = file?;
                let facts = file.metadata()?;
                let path = format!("{name}/{}", file.file_name().to_string_lossy());
                found.push((facts.modified()?, path, facts.len()));
            }
        }
        Ok(found)
    }

    /// Deletes what is superfluous. What cannot be deleted is met again at the next start.
    fn shrink(&self, copies: &mut Copies) {
        for path in copies.superfluous(self.limit) {
            let path = self.folder.join(path);
            let _ = fs::remove_file(&path);
            // Fails while there are other files in it.
            let _ = path.parent().map(fs::remove_dir);
        }
    }

    fn in_use(&self, path: &str, copies: &mut Copies) -> Option<InUse> {
        let made = copies.enter(path)?;
        Some(InUse {
            path: path.to_owned(),
            made,
            copies: self.copies.clone(),
        })
    }

    /// Waits until nobody else downloads that copy.
    async fn turn(&self, path: &str) -> tokio::sync::OwnedMutexGuard<()> {
        let turn = {
            let mut turns = entered(&self.turns);
            turns.retain(|_, turn| turn.strong_count() > 0);
            match turns.get(path).and_then(Weak::upgrade) {
                Some(turn) => turn,
                None => {
                    let turn = Arc::default();
                    turns.insert(path.to_owned(), Arc::downgrade(&turn));
                    turn
                }
            }
        };
        turn.lock_owned().await
    }

    /// The copy of the file `record` of the place `place`. If there is none, `download` writes it to
    /// the path that it is given and returns length and SHA-256, or `None` if the file does not exist.
    ///
    /// # Errors
    /// [`StoreFault::DamagedFile`] if the file is not what `record` says, or that of downloading.
    pub async fn get<F>(
        &self,
        place: &str,
        record: &FileRecord,
        download: impl FnOnce(PathBuf) -> F,
    ) -> Result<Option<Found>, BlobError>
    where
        F: Future<Output = Result<Option<(u64, String)>, BlobError>>,
    {
        let path = format!("{place}/{}", record.name);
        let _turn = self.turn(&path).await;
        if let Some(found) = self.look_up(&path, record).await? {
            return Ok(Some(found));
        }
        let draft = Draft(self.folder.join(ARRIVING_FOLDER).join(random_id("")));
        fs::create_dir_all(self.folder.join(ARRIVING_FOLDER))?;
        let Some((bytes, sha256)) = download(draft.0.clone()).await? else {
            return Ok(None);
        };
        if bytes != record.bytes {
            let how = format!("{bytes} bytes instead of {}", record.bytes);
            return Err(content::damaged(&path, &how));
        }
        if sha256 != record.sha256 {
            return Err(content::damaged(&path, "its SHA-256 is another"));
        }
        let _in_use = self.put(place, record, &draft.0, sha256)?;
        match self.look_up(&path, record).await? {
            None => {
                let how = format!("the copy of {path} was deleted at once");
                Err(BlobError::new(StoreFault::Disk, how))
            }
            found => Ok(found),
        }
    }

    /// The verified copy at `path`. One with another content is deleted.
    async fn look_up(&self, path: &str, record: &FileRecord) -> Result<Option<Found>, BlobError> {
        // From now on it is not superfluous.
        let in_use = self.in_use(path, &mut entered(&self.copies));
        let Some(in_use) = in_use else {
            return Ok(None);
        };
        let (place, key, record) = (self.folder.join(path), path.to_owned(), record.clone());
        let verified = self.verified.clone();
        let checked = tokio::task::spawn_blocking(move || {
            let file = match File::open(&place) {
                Err(error) if is_absent(&error) => return Ok(None),
                other => other?,
            };
            match verified.check(&key, &file, &record) {
                Ok(stamp) => Ok(Some((file, stamp, place))),
                Err(error) if error.cause == StoreFault::DamagedFile => {
                    tracing::warn!(%error, "a local copy is downloaded again");
                    fs::remove_file(&place)?;
                    Ok(None)
                }
                Err(error) => Err(error),
            }
        });
        let checked = checked
            .await
            .map_err(|e| BlobError::new(StoreFault::Other, e.to_string()))?;
        let Some((file, stamp, place)) = checked? else {
            entered(&self.copies).remove(path);
            return Ok(None);
        };
        let local = LocalFile::copied(place, in_use);
        Ok(Some(Found { file, stamp, local }))
    }

    /// Moves a file with that content to the place of its copy, which is not superfluous until the
    /// returned value is dropped.
    ///
    /// # Errors
    /// If the file cannot be moved.
    pub fn put(
        &self,
        place: &str,
        record: &FileRecord,
        from: &Path,
        sha256: String,
    ) -> io::Result<impl Send + use<>> {
        let path = format!("{place}/{}", record.name);
        let to = self.folder.join(&path);
        // Nobody deletes the file before it is in the table.
        let mut copies = entered(&self.copies);
        fs::create_dir_all(self.folder.join(place))?;
        fs::rename(from, &to)?;
        let facts = fs::metadata(&to)?;
        copies.add(&path, facts.len());
        let in_use = self.in_use(&path, &mut copies);
        self.verified
            .remember(path, Stamp::from_file(&facts), sha256);
        self.shrink(&mut copies);
        drop(copies);
        Ok(in_use)
    }

    /// The places that have copies.
    pub fn places(&self) -> BTreeSet<String> {
        let copies = entered(&self.copies);
        let places = copies
            .by_path
            .keys()
            .filter_map(|path| path.split('/').next());
        places.map(str::to_owned).collect()
    }

    /// Deletes the copies of every place that `which` names.
    ///
    /// # Errors
    /// If a copy cannot be deleted.
    pub fn forget(&self, which: impl Fn(&str) -> bool) -> io::Result<()> {
        let mut copies = entered(&self.copies);
        let place = |path: &String| path.split('/').next().unwrap_or(path).to_owned();
        let paths = copies.by_path.keys().filter(|path| which(&place(path)));
        let paths: Vec<String> = paths.cloned().collect();
        for path in &paths {
            copies.remove(path);
        }
        let doomed: BTreeSet<String> = paths.iter().map(place).collect();
        for place in doomed {
            match fs::remove_dir_all(self.folder.join(place)) {
                Err(error) if !is_absent(&error) => return Err(error),
                _ => {}
            }
        }
        Ok(())
    }
}

/// A download; deleted on drop, unless it was moved to its place.
struct Draft(PathBuf);

impl Drop for Draft {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;
    use sha2::{Digest, Sha256};
    use std::sync::atomic::{AtomicUsize, Ordering};
    use ventriform_service::base::records::hex;

    fn record(content: &[u8]) -> FileRecord {
        FileRecord {
            name: "volume.nii".into(),
            bytes: content.len() as u64,
            sha256: hex(&Sha256::digest(content)),
            place: None,
        }
    }

    /// Gets a copy; `stored` is what the store has. Returns the copy's content.
    async fn get(
        cache: &LocalCache,
        place: &str,
        stored: &[u8],
        downloads: &AtomicUsize,
    ) -> (Vec<u8>, LocalFile) {
        let record = record(stored);
        let found = cache.get(place, &record, async |path: PathBuf| {
            downloads.fetch_add(1, Ordering::Relaxed);
            fs::write(path, stored)?;
            Ok(Some((stored.len() as u64, record.sha256.clone())))
        });
        let found = found.await.unwrap().unwrap();
        (fs::read(&*found.local).unwrap(), found.local)
    }

    #[tokio::test]
    async fn copies_that_were_altered_or_deleted_are_downloaded_again() {
        let folder = tempfile::tempdir().unwrap();
        let cache = LocalCache::open(folder.path(), 1 << 20).unwrap();
        let downloads = AtomicUsize::new(0);
        for _ in 0..2 {
            assert_eq!(get(&cache, "a", b"content", &downloads).await.0, b"content");
        }
        assert_eq!(downloads.load(Ordering::Relaxed), 1);
        fs::write(folder.path().join("a/volume.nii"), b"altered").unwrap();
        assert_eq!(get(&cache, "a", b"content", &downloads).await.0, b"content");
        fs::remove_dir_all(folder.path()).unwrap();
        assert_eq!(get(&cache, "a", b"content", &downloads).await.0, b"content");
        assert_eq!(downloads.load(Ordering::Relaxed), 3);
        drop(cache);
        let cache = LocalCache::open(folder.path(), 1 << 20).unwrap();
        get(&cache, "a", b"content", &downloads).await;
        assert_eq!(downloads.load(Ordering::Relaxed), 3, "taken over at start");
        cache.forget(|place| place == "a").unwrap();
        assert!(!folder.path().join("a").exists());
    }

    #[tokio::test]
    async fn the_copies_used_least_recently_go_first_and_those_in_use_stay() {
        let folder = tempfile::tempdir().unwrap();
        let cache = LocalCache::open(folder.path(), 25).unwrap();
        let downloads = AtomicUsize::new(0);
        let there = |place: &str| folder.path().join(place).exists();
        let (_, used) = get(&cache, "a", b"0123456789", &downloads).await;
        get(&cache, "b", b"0123456789", &downloads).await;
        get(&cache, "c", b"0123456789", &downloads).await;
        assert!(there("a") && !there("b") && there("c"));
        get(&cache, "d", &[0; 30], &downloads).await;
        assert!(
            there("a") && there("d"),
            "in use, and larger than the limit"
        );
        drop(used);
        get(&cache, "e", b"0123456789", &downloads).await;
        assert!(!there("a") && !there("d") && there("e"));
    }

    #[tokio::test]
    async fn a_download_with_another_content_is_not_kept() {
        let folder = tempfile::tempdir().unwrap();
        let cache = LocalCache::open(folder.path(), 1 << 20).unwrap();
        let asked = record(b"content");
        for wrong in [&b"altered"[..], b"short"] {
            let found = cache.get("a", &asked, async |path: PathBuf| {
                fs::write(path, wrong)?;
                Ok(Some((wrong.len() as u64, record(wrong).sha256)))
            });
            let error = found.await.map(|_| ()).unwrap_err();
            assert_eq!(error.cause, StoreFault::DamagedFile);
        }
        assert!(!folder.path().join("a").exists());
    }
}
