//! The unpacked bytes of a file, read from front to back and counted against a limit.
//!
//! A gzipped file may consist of several members one after the other (RFC 1952, 2.2), which are
//! read as one stream. Bytes after the last member are ignored, as by `gzip -d`. Small files of one
//! member are unpacked [at once](super::unpack), which is faster.

use super::VolumeError;
use super::unpack::{self, Unpacked};
use crate::base::text::escaped;
use crate::image::grid::Volume;
use flate2::bufread::{DeflateDecoder, GzDecoder};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use ventriform_dicom::read::bytes::Bytes;

/// Packed bytes are read in portions of this size.
const PORTION_BYTES: usize = 128 * 1024;

/// Largest ratio of unpacked to packed size of any deflate stream (1032:1 according to zlib's
/// technical details).
const GREATEST_RATIO: u64 = 1032;

/// A file to read and its name, which is only used in messages.
#[derive(Debug, Clone)]
pub struct VolumeFile {
    name: String,
    content: Content,
    /// Whether it was found in an archive or a folder, and not named by a person.
    found: bool,
    /// Whether errors state its whole path, because the caller named it by that.
    by_path: bool,
}

#[derive(Debug, Clone)]
enum Content {
    Path(PathBuf),
    Memory(Arc<[u8]>),
    /// A file inside an archive.
    Entry(Arc<Entry>),
    /// Volumes that are no file.
    Arrays(Arc<[Volume]>),
}

/// What errors call a folder that files were found in.
pub(super) const FOLDER: &str = "the folder";

/// The name of a file for messages: control characters are escaped.
fn shown(name: String) -> String {
    escaped(&name).into_owned()
}

/// Place of a file inside an archive.
#[derive(Debug)]
struct Entry {
    archive: VolumeFile,
    begin: u64,
    packed: u64,
    size: u64,
    deflated: bool,
}

impl VolumeFile {
    /// The file at `path`, named after the last part of the path.
    pub fn at(path: impl AsRef<Path>) -> Self {
        let path = path.as_ref();
        let name = path.file_name().unwrap_or(path.as_os_str());
        Self::named(name.to_string_lossy(), path)
    }

    /// The file at `path` under another name, for example an upload that is stored under a key.
    pub fn named(name: impl Into<String>, path: impl AsRef<Path>) -> Self {
        Self {
            name: shown(name.into()),
            content: Content::Path(path.as_ref().to_path_buf()),
            found: false,
            by_path: false,
        }
    }

    /// A file whose content is in memory.
    pub fn in_memory(name: impl Into<String>, bytes: impl Into<Arc<[u8]>>) -> Self {
        Self {
            name: shown(name.into()),
            content: Content::Memory(bytes.into()),
            found: false,
            by_path: false,
        }
    }

    /// Volumes in memory in place of a file: one, or the gates of a study on one grid.
    pub fn of_arrays(name: impl Into<String>, volumes: impl Into<Arc<[Volume]>>) -> Self {
        Self {
            name: shown(name.into()),
            content: Content::Arrays(volumes.into()),
            found: false,
            by_path: false,
        }
    }

    /// The volumes in memory; `None` for files.
    pub(super) fn arrays(&self) -> Option<Arc<[Volume]>> {
        match &self.content {
            Content::Arrays(volumes) => Some(Arc::clone(volumes)),
            _ => None,
        }
    }

    /// The file of `size` bytes in `archive` whose `packed` bytes begin at byte `begin`.
    pub(super) fn inside(
        archive: &Self,
        name: impl Into<String>,
        begin: u64,
        [packed, size]: [u64; 2],
        deflated: bool,
    ) -> Self {
        let entry = Entry {
            archive: archive.clone(),
            begin,
            packed,
            size,
            deflated,
        };
        Self {
            name: shown(name.into()),
            content: Content::Entry(Arc::new(entry)),
            found: true,
            by_path: false,
        }
    }

    /// The stored bytes.
    ///
    /// # Errors
    /// If the file cannot be opened.
    pub(super) fn bytes(&self) -> io::Result<Box<dyn ReadSeek>> {
        Ok(match &self.content {
            Content::Path(path) => Box::new(File::open(path)?),
            Content::Memory(bytes) => Box::new(Cursor::new(Arc::clone(bytes))),
            // They are recognised before anything reads bytes.
            Content::Arrays(_) => return Err(ErrorKind::Unsupported.into()),
            Content::Entry(entry) => {
                let packed = Window {
                    archive: entry.archive.bytes()?,
                    begin: entry.begin,
                    length: entry.packed,
                    position: 0,
                };
                if entry.deflated {
                    // The archive states the size, and no more is taken from it.
                    Box::new(Inflated::new(packed, entry.size))
                } else {
                    Box::new(packed)
                }
            }
        })
    }

    /// The file, marked as found in a folder.
    pub(super) fn found(self) -> Self {
        Self {
            found: true,
            ..self
        }
    }

    /// The file, marked as one that the caller named by its path: errors state the whole of it.
    pub(super) fn by_path(self) -> Self {
        Self {
            by_path: true,
            ..self
        }
    }

    /// What errors call the file: its whole path, if the caller named it by that; otherwise its name.
    pub(super) fn whole_name(&self) -> String {
        match self.path() {
            Some(path) if self.by_path => shown(path.display().to_string()),
            _ => self.name.clone(),
        }
    }

    /// The folder that the caller named by its path, and in which the file was found.
    fn folder(&self) -> Option<&Path> {
        let path = self.path().filter(|_| self.by_path && self.found)?;
        path.ancestors()
            .nth(Path::new(&self.name).components().count())
    }

    /// Whether the file was found in an archive or a folder, and not named by a person.
    pub(super) fn was_found(&self) -> bool {
        self.found
    }

    /// The file at `path` and, if it is one of a `.hdr`/`.img` pair, the other file of the pair, if
    /// that is in the same folder. Either may be gzipped.
    pub fn with_other_half(path: impl AsRef<Path>) -> Vec<Self> {
        let path = path.as_ref();
        let at = |path: &Path| Self::at(path).by_path();
        let mut files = vec![at(path)];
        let name = path.to_string_lossy();
        let bare = name.strip_suffix(".gz").unwrap_or(&name);
        for (this, other) in [(".hdr", ".img"), (".img", ".hdr")] {
            let Some(stem) = bare.strip_suffix(this) else {
                continue;
            };
            let others = [format!("{stem}{other}"), format!("{stem}{other}.gz")];
            let other = others.iter().map(Path::new).find(|o| o.is_file());
            files.extend(other.map(at));
        }
        files
    }

    /// The path of a file on disk; `None` for what is in memory or in an archive.
    pub fn path(&self) -> Option<&Path> {
        match &self.content {
            Content::Path(path) => Some(path),
            _ => None,
        }
    }

    /// The bytes of a file in memory; `None` for files on disk, files in an archive, and arrays.
    pub fn memory(&self) -> Option<&[u8]> {
        match &self.content {
            Content::Memory(bytes) => Some(bytes),
            _ => None,
        }
    }

    /// Gives the stored bytes to `take`, portion by portion. Of arrays these are for each volume its shape (64-bit
    /// whole numbers), the affine to LPS mm (64-bit floats, by rows) and the voxels (32-bit floats, i fastest), least
    /// significant byte first.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn stream_stored(&self, take: &mut dyn FnMut(&[u8])) -> io::Result<()> {
        if let Content::Arrays(volumes) = &self.content {
            for volume in volumes.iter() {
                let shape = volume.shape.map(|size| (size as u64).to_le_bytes());
                take(shape.as_flattened());
                let matrix = volume.frame.matrix();
                for (row, column) in (0..4).flat_map(|row| [0, 1, 2, 3].map(|column| (row, column)))
                {
                    take(&matrix[(row, column)].to_le_bytes());
                }
                for portion in volume.voxels.chunks(PORTION_BYTES / size_of::<f32>()) {
                    let bytes: Vec<u8> = portion.iter().flat_map(|v| v.to_le_bytes()).collect();
                    take(&bytes);
                }
            }
            return Ok(());
        }
        let mut reader = self.bytes()?;
        let mut portion = vec![0; PORTION_BYTES];
        loop {
            match reader.read(&mut portion) {
                Ok(0) => return Ok(()),
                Ok(got) => take(&portion[..got]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// The name used in messages.
    pub fn name(&self) -> &str {
        &self.name
    }
}

impl VolumeError {
    /// The error with the whole path in place of the name of that one of `files` which it is about, where the caller
    /// named it by its path: many folders hold files of one name.
    #[must_use]
    pub(super) fn with_path(mut self, files: &[VolumeFile]) -> Self {
        if let Some(named) = self.file_mut() {
            let whole = files.iter().filter(|file| file.name() == named);
            let whole: Vec<String> = whole.map(VolumeFile::whole_name).collect();
            if !whole.is_empty() {
                *named = whole.join(" or ");
            } else if named == FOLDER
                && let Some(folder) = files.iter().find_map(VolumeFile::folder)
            {
                *named = format!("{FOLDER} {}", shown(folder.display().to_string()));
            }
        }
        self
    }
}

/// The unpacked bytes of an open file.
pub(super) struct Source {
    file: String,
    body: Body,
    /// Size of the file as stored, bytes.
    stored: u64,
    /// Unpacked bytes given out or skipped so far.
    position: u64,
    /// Most unpacked bytes to give out.
    limit: u64,
    gzip: bool,
    /// Whether the gzip stream ended before its checksum.
    cut_off: bool,
    /// Whether unpacking at once was tried.
    prepared: bool,
    /// Bytes that were read and not yet given out.
    ahead: Vec<u8>,
}

enum Body {
    Plain(BufReader<Box<dyn ReadSeek>>),
    /// Deflated without header or checksum, as in deflated DICOM data sets.
    Deflated(Box<DeflateDecoder<BufReader<Box<dyn Read>>>>),
    Gzip(Box<Members>),
    /// The whole content, in memory.
    Unpacked(Unpacked),
}

/// Bytes that can be read from any place on.
pub(super) trait ReadSeek: Read + Seek {}
impl<T: Read + Seek> ReadSeek for T {}

impl Source {
    /// Opens `file` to give out at most `limit` unpacked bytes.
    ///
    /// # Errors
    /// [`VolumeError::Io`].
    pub(super) fn open(file: &VolumeFile, limit: u64) -> Result<Self, VolumeError> {
        let io = |e: io::Error| VolumeError::Io {
            file: file.name.clone(),
            reason: e.to_string(),
        };
        let mut reader = file.bytes().map_err(io)?;
        let stored = reader.seek(SeekFrom::End(0)).map_err(io)?;
        reader.rewind().map_err(io)?;
        let mut mark = [0; 2];
        let gzipped = stored >= 2 && reader.read_exact(&mut mark).is_ok() && mark == GZIP_MAGIC;
        reader.rewind().map_err(io)?;
        let body = if gzipped {
            Body::Gzip(Box::new(Members::new(reader)))
        } else {
            Body::Plain(BufReader::with_capacity(PORTION_BYTES, reader))
        };
        let mut source = Self::new(file, body, stored, limit);
        source.gzip = gzipped;
        Ok(source)
    }

    /// Opens `file` to give out the bytes that are deflated from byte `begin` on. They are counted
    /// from `begin` too.
    ///
    /// # Errors
    /// [`VolumeError`] if the file cannot be read or is shorter.
    pub(super) fn inflate(file: &VolumeFile, begin: u64, limit: u64) -> Result<Self, VolumeError> {
        let mut packed = Self::open(file, limit)?;
        packed.skip_to(begin)?;
        let stored = packed.capacity();
        let mut source = Self::new(file, Self::inflater(Box::new(packed)), stored, limit);
        source.position = begin;
        Ok(source)
    }

    /// The `bytes` themselves, whatever they look like.
    pub(super) fn plain(file: &VolumeFile, bytes: Vec<u8>) -> Self {
        let stored = bytes.len() as u64;
        let reader: Box<dyn ReadSeek> = Box::new(Cursor::new(bytes));
        let body = Body::Plain(BufReader::with_capacity(0, reader));
        Self::new(file, body, stored, u64::MAX)
    }

    fn new(file: &VolumeFile, body: Body, stored: u64, limit: u64) -> Self {
        Self {
            file: file.name.clone(),
            body,
            stored,
            position: 0,
            limit,
            gzip: false,
            cut_off: false,
            prepared: false,
            ahead: Vec::new(),
        }
    }

    fn inflater(packed: Box<dyn Read>) -> Body {
        let packed = BufReader::with_capacity(PORTION_BYTES, packed);
        Body::Deflated(Box::new(DeflateDecoder::new(packed)))
    }

    /// Name of the file.
    pub(super) fn file(&self) -> &str {
        &self.file
    }

    /// Unpacked bytes given out or skipped so far.
    pub(super) fn position(&self) -> u64 {
        self.position
    }

    /// Whether the file is gzipped.
    pub(super) fn is_gzip(&self) -> bool {
        self.gzip
    }

    /// Upper bound on the number of unpacked bytes in the file.
    pub(super) fn capacity(&self) -> u64 {
        if self.gzip || matches!(self.body, Body::Deflated(_)) {
            self.stored.saturating_mul(GREATEST_RATIO)
        } else {
            self.stored
        }
    }

    /// Announces that bytes up to `end` will be read. Unpacks the file at once if that is possible;
    /// bytes and errors are the same either way.
    ///
    /// # Errors
    /// [`VolumeError::Io`].
    pub(super) fn prepare(&mut self, end: u64) -> Result<(), VolumeError> {
        // A second try would unpack everything before the position again.
        if std::mem::replace(&mut self.prepared, true) {
            return Ok(());
        }
        let Body::Gzip(members) = &mut self.body else {
            return Ok(());
        };
        if !self.ahead.is_empty() {
            return Ok(());
        }
        let Some(mut packed) = members.take_first() else {
            return Ok(());
        };
        let unpacked = unpack::at_once(&mut packed, self.stored, end, self.limit);
        let restarted = unpacked.and_then(|unpacked| match unpacked {
            Some(unpacked) => Ok(Body::Unpacked(unpacked)),
            None => {
                packed.rewind()?;
                let mut members = Members::new(packed);
                io::copy(&mut members.by_ref().take(self.position), &mut io::sink())?;
                Ok(Body::Gzip(Box::new(members)))
            }
        });
        self.body = restarted.map_err(|e| self.failure(&e, 0))?;
        Ok(())
    }

    /// The next `length` bytes, if the file is unpacked in memory.
    pub(super) fn lend(&mut self, length: usize) -> Option<&[u8]> {
        let Body::Unpacked(unpacked) = &self.body else {
            return None;
        };
        if !self.ahead.is_empty() {
            return None;
        }
        let begin = usize::try_from(self.position).ok()?;
        let lent = unpacked.bytes().get(begin..begin.checked_add(length)?)?;
        self.position += length as u64;
        Some(lent)
    }

    /// The memory that holds the next `length` bytes and the offset of the first of them, if they are
    /// the last bytes and most of an unpacked file. Nothing can be read after that.
    pub(super) fn give_up(&mut self, length: usize) -> Option<(Vec<f32>, usize)> {
        let Body::Unpacked(unpacked) = &mut self.body else {
            return None;
        };
        let begin = usize::try_from(self.position).ok()?;
        if !self.ahead.is_empty() {
            return None;
        }
        if begin > length || begin.checked_add(length) != Some(unpacked.bytes().len()) {
            return None;
        }
        self.position += length as u64;
        Some((std::mem::take(unpacked).into_words(), begin))
    }

    /// Fills `buffer` up to the end of the file and returns the number of bytes read.
    ///
    /// # Errors
    /// [`VolumeError`] if the file is damaged, unreadable or larger than the limit.
    pub(super) fn fill(&mut self, buffer: &mut [u8]) -> Result<usize, VolumeError> {
        let mut filled = self.ahead.len().min(buffer.len());
        buffer[..filled].copy_from_slice(&self.ahead[..filled]);
        self.ahead.drain(..filled);
        while filled < buffer.len() {
            let part = &mut buffer[filled..];
            let got = match &mut self.body {
                Body::Plain(reader) => reader.read(part),
                Body::Gzip(members) => members.read(part),
                Body::Deflated(inflater) => inflater.read(part),
                Body::Unpacked(unpacked) => {
                    let begin = self.position as usize + filled;
                    unpacked.bytes().get(begin..).unwrap_or_default().read(part)
                }
            };
            match got {
                Ok(0) => break,
                Ok(n) => filled += n,
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                // The packed stream ends in the middle: the file was cut off.
                Err(e) if e.kind() == ErrorKind::UnexpectedEof => {
                    self.cut_off = true;
                    break;
                }
                Err(e) => return Err(self.failure(&e, filled)),
            }
        }
        self.position += filled as u64;
        if self.position > self.limit {
            Err(self.beyond_limit(self.position))
        } else {
            Ok(filled)
        }
    }

    /// The next `length` bytes, fewer at the end of the file, which stay to be read.
    ///
    /// # Errors
    /// As [`Source::fill`].
    pub(super) fn peek(&mut self, length: usize) -> Result<&[u8], VolumeError> {
        let left = self.limit.saturating_sub(self.position);
        let length = length.min(usize::try_from(left).unwrap_or(length));
        let missing = length.saturating_sub(self.ahead.len());
        if missing > 0 {
            let position = self.position;
            let mut held = std::mem::take(&mut self.ahead);
            let mut more = vec![0; missing];
            // The bytes held are no part of the position, and those read now become none.
            self.position += held.len() as u64;
            let got = self.fill(&mut more);
            self.position = position;
            held.extend_from_slice(&more[..*got.as_ref().unwrap_or(&0)]);
            self.ahead = held;
            got?;
        }
        Ok(&self.ahead[..length.min(self.ahead.len())])
    }

    /// Fills `buffer` completely. `needed` is the size of the file that the header implies, for the
    /// error if the file ends before.
    pub(super) fn fill_all(&mut self, buffer: &mut [u8], needed: u64) -> Result<(), VolumeError> {
        if self.fill(buffer)? == buffer.len() {
            Ok(())
        } else {
            Err(self.truncated(needed, self.position))
        }
    }

    /// Moves forward to byte `target` of the unpacked file.
    pub(super) fn skip_to(&mut self, target: u64) -> Result<(), VolumeError> {
        debug_assert!(target >= self.position, "a stream cannot move backward");
        if target > self.limit {
            return Err(self.beyond_limit(target));
        }
        let known = target.saturating_sub(self.position);
        let known = self.ahead.len().min(known as usize);
        self.ahead.drain(..known);
        self.position += known as u64;
        if let Body::Plain(reader) = &mut self.body {
            // Keeps the buffer if the target is inside it.
            if let Err(e) = reader.seek_relative((target - self.position) as i64) {
                return Err(self.failure(&e, 0));
            }
            self.position = target;
            return Ok(());
        }
        let mut scratch = vec![0; PORTION_BYTES];
        while self.position < target {
            let part = (target - self.position).min(PORTION_BYTES as u64) as usize;
            self.fill_all(&mut scratch[..part], target)?;
        }
        Ok(())
    }

    /// Reads on after the last byte that is needed, so that the checksum of a gzip member is verified.
    /// Returns whether the file has more bytes. Reads at most one portion, so that appended data cannot
    /// exhaust time or memory.
    pub(super) fn finish(&mut self) -> Result<bool, VolumeError> {
        let mut rest = vec![0; PORTION_BYTES];
        self.limit = u64::MAX;
        let left_over = self.fill(&mut rest)? > 0;
        if self.cut_off {
            Err(VolumeError::Corrupt {
                file: self.file.clone(),
                byte: self.position,
                reason: "the packed data end before the checksum".into(),
            })
        } else {
            Ok(left_over)
        }
    }

    /// The error for a file that is too short.
    pub(super) fn truncated(&self, needed: u64, found: u64) -> VolumeError {
        VolumeError::Truncated {
            file: self.file.clone(),
            needed,
            found,
        }
    }

    /// The error for a file that exceeds the limit of unpacked bytes.
    pub(super) fn beyond_limit(&self, asked: u64) -> VolumeError {
        VolumeError::TooLarge {
            file: self.file.clone(),
            what: "unpacked bytes",
            asked,
            limit: self.limit,
        }
    }

    fn failure(&self, e: &io::Error, filled: usize) -> VolumeError {
        let file = self.file.clone();
        let reason = e.to_string();
        match e.kind() {
            ErrorKind::InvalidInput | ErrorKind::InvalidData => VolumeError::Corrupt {
                file,
                byte: self.position + filled as u64,
                reason,
            },
            _ => VolumeError::Io { file, reason },
        }
    }
}

/// A part of a file.
struct Window {
    archive: Box<dyn ReadSeek>,
    begin: u64,
    length: u64,
    position: u64,
}

impl Read for Window {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = self.length.saturating_sub(self.position);
        let most = buffer
            .len()
            .min(usize::try_from(left).unwrap_or(usize::MAX));
        let at = self.begin.saturating_add(self.position);
        self.archive.seek(SeekFrom::Start(at))?;
        let got = self.archive.read(&mut buffer[..most])?;
        self.position += got as u64;
        Ok(got)
    }
}

impl Seek for Window {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.position = target(to, self.length, self.position)?;
        Ok(self.position)
    }
}

/// The content of a deflated file, at most as many bytes as were stated. It is unpacked when it is read,
/// and from the beginning after a move backward.
struct Inflated {
    /// `None` after a failed restart.
    inflater: Option<DeflateDecoder<BufReader<Window>>>,
    length: u64,
    /// Bytes unpacked so far.
    unpacked: u64,
    /// Where the next byte is read.
    position: u64,
}

impl Inflated {
    fn new(packed: Window, size: u64) -> Self {
        // A size that the packed bytes cannot reach is not believed.
        let length = size.min(packed.length.saturating_mul(GREATEST_RATIO));
        let packed = BufReader::with_capacity(PORTION_BYTES, packed);
        Self {
            inflater: Some(DeflateDecoder::new(packed)),
            length,
            unpacked: 0,
            position: 0,
        }
    }

    /// The decoder, at the position.
    fn decoder(&mut self) -> io::Result<&mut DeflateDecoder<BufReader<Window>>> {
        if self.position < self.unpacked
            && let Some(inflater) = self.inflater.take()
        {
            let mut packed = inflater.into_inner();
            packed.rewind()?;
            self.inflater = Some(DeflateDecoder::new(packed));
            self.unpacked = 0;
        }
        let decoder = self.inflater.as_mut().ok_or(ErrorKind::Other)?;
        if self.unpacked < self.position {
            let skipped = self.position - self.unpacked;
            let skipped = io::copy(&mut decoder.by_ref().take(skipped), &mut io::sink())?;
            self.unpacked += skipped;
        }
        Ok(decoder)
    }
}

impl Read for Inflated {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = self.length.saturating_sub(self.position);
        let most = buffer
            .len()
            .min(usize::try_from(left).unwrap_or(usize::MAX));
        if most == 0 {
            return Ok(0);
        }
        let got = self.decoder()?.read(&mut buffer[..most])?;
        self.unpacked += got as u64;
        self.position = self.unpacked;
        Ok(got)
    }
}

impl Seek for Inflated {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.position = target(to, self.length, self.position)?;
        Ok(self.position)
    }
}

/// The place in a file of `length` bytes that `to` names, seen from `position`.
fn target(to: SeekFrom, length: u64, position: u64) -> io::Result<u64> {
    let target = match to {
        SeekFrom::Start(at) => Some(at),
        SeekFrom::End(by) => length.checked_add_signed(by),
        SeekFrom::Current(by) => position.checked_add_signed(by),
    };
    target.ok_or_else(|| ErrorKind::InvalidInput.into())
}

/// For parsers that need a reader. Every error becomes [`ErrorKind::Other`].
impl Bytes for Source {
    fn file(&self) -> &str {
        &self.file
    }

    fn position(&self) -> u64 {
        self.position
    }

    fn capacity(&self) -> u64 {
        Source::capacity(self)
    }

    fn peek(&mut self, length: usize) -> io::Result<&[u8]> {
        Source::peek(self, length).map_err(io::Error::other)
    }
}

impl Read for Source {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.fill(buffer).map_err(io::Error::other)
    }
}

/// The first two bytes of a gzip member.
const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// Gzip members, one after the other. (`MultiGzDecoder` of flate2 treats padding after the last member
/// as a damaged member.)
struct Members {
    current: Option<GzDecoder<BufReader<Box<dyn ReadSeek>>>>,
    first: bool,
}

impl Members {
    fn new(packed: Box<dyn ReadSeek>) -> Self {
        Self {
            current: Some(GzDecoder::new(BufReader::with_capacity(
                PORTION_BYTES,
                packed,
            ))),
            first: true,
        }
    }

    /// The packed file, if no member has ended yet. Nothing can be read after that.
    fn take_first(&mut self) -> Option<Box<dyn ReadSeek>> {
        let member = self.current.take_if(|_| self.first)?;
        Some(member.into_inner().into_inner())
    }

    /// Moves to the member after `ended`.
    fn next(ended: GzDecoder<BufReader<Box<dyn ReadSeek>>>) -> io::Result<Self> {
        let mut packed = ended.into_inner();
        // The buffer may hold only one more byte. One is enough to recognise padding; a member that
        // starts correctly and continues wrongly is reported as an error.
        let follows = packed.fill_buf()?.first() == Some(&GZIP_MAGIC[0]);
        Ok(Self {
            current: follows.then(|| GzDecoder::new(packed)),
            first: false,
        })
    }
}

impl Read for Members {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while let Some(member) = &mut self.current {
            match member.read(buffer)? {
                0 if !buffer.is_empty() => {
                    let Some(ended) = self.current.take() else {
                        break;
                    };
                    *self = Members::next(ended)?;
                }
                n => return Ok(n),
            }
        }
        Ok(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::image::volume::ReadLimits;

    #[test]
    fn the_other_half_lies_beside() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("a.hdr"), b"header").unwrap();
        std::fs::write(at("a.img.gz"), b"image").unwrap();
        let names = |path: PathBuf| {
            let files = VolumeFile::with_other_half(path);
            files
                .iter()
                .map(|f| f.name().to_owned())
                .collect::<Vec<_>>()
        };
        assert_eq!(names(at("a.hdr")), ["a.hdr", "a.img.gz"]);
        assert_eq!(names(at("a.img.gz")), ["a.img.gz", "a.hdr"]);
        assert_eq!(names(at("b.nii.gz")), ["b.nii.gz"]);
        assert_eq!(names(at("b.hdr")), ["b.hdr"]);
    }

    #[test]
    fn stored_bytes_are_those_of_the_file_and_tell_arrays_apart() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.nii");
        let bytes: Vec<u8> = (0..3 * PORTION_BYTES + 5).map(|n| n as u8).collect();
        std::fs::write(&path, &bytes).unwrap();
        let stored = |file: &VolumeFile| {
            let mut all = Vec::new();
            file.stream_stored(&mut |part| all.extend_from_slice(part))
                .unwrap();
            all
        };
        let (on_disk, memory) = (
            VolumeFile::at(&path),
            VolumeFile::in_memory("a", bytes.clone()),
        );
        assert_eq!((on_disk.path(), on_disk.memory()), (Some(&*path), None));
        assert_eq!((memory.path(), memory.memory()), (None, Some(&*bytes)));
        assert!(stored(&on_disk) == bytes && stored(&memory) == bytes);
        let array = |mm: f64, value: f32| {
            let frame = VoxelToPatient::centred([2, 3, 4], [mm; 3], Vec3::zeros()).unwrap();
            let volume = Volume {
                shape: [2, 3, 4],
                voxels: vec![value; 24],
                frame,
                integral: false,
            };
            VolumeFile::of_arrays("the array", vec![volume])
        };
        assert_eq!(stored(&array(4.0, 1.0)).len(), 3 * 8 + 16 * 8 + 24 * 4);
        assert_eq!(stored(&array(4.0, 1.0)), stored(&array(4.0, 1.0)));
        assert_ne!(stored(&array(4.0, 1.0)), stored(&array(4.0, 2.0)));
        assert_ne!(stored(&array(4.0, 1.0)), stored(&array(5.0, 1.0)));
        assert!(
            VolumeFile::at("/nowhere/at/all")
                .stream_stored(&mut |_| ())
                .is_err()
        );
    }

    #[test]
    fn a_file_that_is_named_by_its_path_is_told_by_all_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("patient_017/spect.nii.gz");
        std::fs::create_dir(path.parent().unwrap()).unwrap();
        let error = |file: &str, files: &[VolumeFile]| {
            let error = VolumeError::Empty { file: file.into() };
            error.with_path(files).to_string()
        };
        let whole = format!("{} is empty", path.display());
        assert_eq!(
            error("spect.nii.gz", &VolumeFile::with_other_half(&path)),
            whole
        );
        std::fs::write(&path, b"").unwrap();
        for given in [path.as_path(), path.parent().unwrap()] {
            let files = VolumeFile::given(&[given], &ReadLimits::DEFAULT).unwrap();
            assert_eq!(error("spect.nii.gz", &files), whole);
            assert_eq!(files[0].name(), "spect.nii.gz");
        }
        // What a service stores under a key is told by the name that it was sent with.
        let stored = [
            VolumeFile::named("spect.nii.gz", &path),
            VolumeFile::at(&path),
        ];
        assert_eq!(error("spect.nii.gz", &stored[..1]), "spect.nii.gz is empty");
        assert_eq!(error("spect.nii.gz", &stored[1..]), "spect.nii.gz is empty");
        assert_eq!(error("other", &stored), "other is empty");
        let files = VolumeFile::given(&[folder.path()], &ReadLimits::DEFAULT).unwrap();
        let whole = format!("the folder {} is empty", folder.path().display());
        assert_eq!(error(FOLDER, &files), whole);
        assert_eq!(error(FOLDER, &stored), "the folder is empty");
    }

    #[test]
    fn a_missing_file_is_named() {
        let missing = VolumeFile::named("upload.nii", "/nowhere/at/all");
        assert!(matches!(
            Source::open(&missing, 10),
            Err(VolumeError::Io { file, .. }) if file == "upload.nii"
        ));
    }
}
