//! Files inside a zip archive (PKWARE APPNOTE 6.3.10).
//!
//! In: one file. Out: the files in it, to be read where they lie, without unpacking them to disk or
//! memory. What is read is bounded before it is read: the archive's directory by [`MOST_ENTRY`] and
//! [`ReadLimits::files`], whichever of its end records states them; what an entry unpacks to by the size that the
//! directory states, and the sum of those sizes by the limit of unpacked bytes.
//!
//! 1. The end record is looked for from the end of the file. It counts if its comment fits into the file
//!    and a directory ends where it begins; one that is only text of a comment does not.
//! 2. A zip64 end record before it states what the plain one has no room for. Where both state a quantity
//!    and differ, the archive is refused: other programs would see other files in it.
//! 3. The directory is read as a whole, and then the header of each entry that is used.
//!
//! The directory is read here and not by `zip`, which takes memory for as many entries as a zip64 end record
//! states.
//!
//! Checksums of entries are not verified: a damaged entry shows in what is read of it.
//!
//! Entries that accompany images on a medium are left out: folders, hidden files and DICOMDIR.

use super::VolumeError;
use super::limits::ReadLimits;
use super::source::{ReadSeek, VolumeFile};
use std::io::{self, Read, Seek, SeekFrom};

/// Most bytes of an archive's directory for each of the files that it may have.
const MOST_ENTRY: u64 = 512;

/// Bytes of an end record without its comment.
const END_RECORD_BYTES: usize = 22;

/// Bytes at the end of a file among which the directory's end record begins.
const END_REACH: u64 = END_RECORD_BYTES as u64 + 0xffff;

/// Bytes of a zip64 end record without what may extend it, and of its locator.
const ZIP64_END_BYTES: usize = 56;
const LOCATOR_BYTES: usize = 20;

/// Bytes of an entry in the directory, and of its header before its content, without what varies.
const ENTRY_BYTES: usize = 46;
const LOCAL_HEADER_BYTES: usize = 30;

/// A field that says that zip64 states the quantity.
const IN_ZIP64: u64 = 0xffff_ffff;

/// The extra field that holds what an entry has no room for.
const ZIP64_FIELD: u16 = 1;

/// Flags of an entry: encrypted, also by a certificate; its name is UTF-8.
const ENCRYPTED_FLAGS: u16 = 1 | 1 << 6 | 1 << 13;

/// The files in `file` if that is a zip archive.
///
/// # Errors
/// [`VolumeError`] for damaged, encrypted or oversized archives.
pub(super) fn files_in(
    file: &VolumeFile,
    limits: &ReadLimits,
) -> Result<Option<Vec<VolumeFile>>, VolumeError> {
    if file.arrays().is_some() {
        return Ok(None);
    }
    let io = |error: io::Error| io_error(file, &error);
    let mut bytes = file.bytes().map_err(io)?;
    let mut mark = [0; 4];
    let marked = bytes.read_exact(&mut mark).is_ok() && mark == *b"PK\x03\x04";
    if !marked {
        return Ok(None);
    }
    let size = bytes.seek(SeekFrom::End(0)).map_err(io)?;
    let mut archive = Archive {
        file,
        bytes,
        size,
        most_files: limits.files,
    };
    let directory = archive.directory()?;
    let mut files = Vec::new();
    let mut total = 0_u64;
    let mut rest = &directory.bytes[..];
    for _ in 0..directory.count {
        let entry;
        (entry, rest) = archive.entry(&directory, rest)?;
        if entry.name.ends_with(['/', '\\']) || is_company(&entry.name) {
            continue;
        }
        if entry.flags & ENCRYPTED_FLAGS != 0 {
            return Err(VolumeError::Unsupported {
                file: file.name().into(),
                format: "an encrypted zip archive".into(),
                fix: "Send the archive without a password.",
            });
        }
        let deflated = match entry.method {
            0 => false,
            8 => true,
            other => {
                return Err(VolumeError::Unsupported {
                    file: file.name().into(),
                    format: format!("a zip archive packed by method {other}"),
                    fix: "Pack the archive with deflate, or send the files themselves.",
                });
            }
        };
        total = total.saturating_add(entry.unpacked);
        if total > limits.unpacked_bytes {
            return Err(archive.too_large("unpacked bytes", total, limits.unpacked_bytes));
        }
        let begin = archive.content_of(&entry)?;
        let sizes = [entry.packed, entry.unpacked];
        files.push(VolumeFile::inside(file, entry.name, begin, sizes, deflated));
    }
    Ok(Some(files))
}

/// An archive that is being read.
struct Archive<'a> {
    file: &'a VolumeFile,
    bytes: Box<dyn ReadSeek>,
    size: u64,
    most_files: u64,
}

/// An end record, and where it begins.
struct End {
    count: u64,
    directory: u64,
    offset: u64,
    at: u64,
}

/// The directory of an archive.
struct Directory {
    bytes: Vec<u8>,
    /// Where it begins in the file.
    at: u64,
    count: u64,
    /// Bytes before the archive in the file, by which all offsets are to be moved.
    before: u64,
}

/// An entry of the directory.
struct Entry {
    name: String,
    flags: u16,
    method: u16,
    packed: u64,
    unpacked: u64,
    /// Where its header lies in the file.
    header: u64,
}

fn io_error(file: &VolumeFile, error: &io::Error) -> VolumeError {
    VolumeError::Io {
        file: file.name().into(),
        reason: error.to_string(),
    }
}

/// The little-endian number in the bytes `at..at + N`, of which there are as many.
fn number<const N: usize>(bytes: &[u8], at: usize) -> u64 {
    let digits = bytes[at..at + N].iter().rev();
    digits.fold(0, |number, byte| number << 8 | u64::from(*byte))
}

impl Archive<'_> {
    fn corrupt(&self, byte: u64, reason: impl Into<String>) -> VolumeError {
        VolumeError::Corrupt {
            file: self.file.name().into(),
            byte,
            reason: reason.into(),
        }
    }

    fn too_large(&self, what: &'static str, asked: u64, limit: u64) -> VolumeError {
        VolumeError::TooLarge {
            file: self.file.name().into(),
            what,
            asked,
            limit,
        }
    }

    /// The `length` bytes from byte `at` on; `None` if the file ends before.
    fn read(&mut self, at: u64, length: usize) -> Result<Option<Vec<u8>>, VolumeError> {
        if at
            .checked_add(length as u64)
            .is_none_or(|end| end > self.size)
        {
            return Ok(None);
        }
        let mut found = vec![0; length];
        let read = self.bytes.seek(SeekFrom::Start(at));
        read.and_then(|_| self.bytes.read_exact(&mut found))
            .map_err(|error| io_error(self.file, &error))?;
        Ok(Some(found))
    }

    /// The directory that the last end record of the file states.
    fn directory(&mut self) -> Result<Directory, VolumeError> {
        let begin = self.size.saturating_sub(END_REACH);
        let tail = self.read(begin, (self.size - begin) as usize)?;
        let tail = tail.unwrap_or_default();
        for place in (0..tail.len().saturating_sub(END_RECORD_BYTES - 1)).rev() {
            let record = &tail[place..];
            let comment = || number::<2>(record, 20) as usize;
            if record.starts_with(b"PK\x05\x06")
                && END_RECORD_BYTES + comment() <= record.len()
                && let Some(directory) = self.directory_of(record, begin + place as u64)?
            {
                return Ok(directory);
            }
        }
        let reason =
            "no end record of the archive is followed by its comment and preceded by its directory";
        Err(self.corrupt(self.size, reason))
    }

    /// The directory that ends where the end record at byte `at` begins, or the zip64 record before it;
    /// `None` if none does.
    fn directory_of(&mut self, record: &[u8], at: u64) -> Result<Option<Directory>, VolumeError> {
        let plain = End {
            count: number::<2>(record, 10),
            directory: number::<4>(record, 12),
            offset: number::<4>(record, 16),
            at,
        };
        let wide = self.zip64(at)?;
        let end = wide.as_ref().unwrap_or(&plain);
        let Some(start) = end.at.checked_sub(end.directory) else {
            return Ok(None);
        };
        let Some(before) = start.checked_sub(end.offset) else {
            return Ok(None);
        };
        let first = self.read(start, 4)?.unwrap_or_default();
        if end.count > 0 && first != *b"PK\x01\x02" {
            return Ok(None);
        }
        if end.count > self.most_files {
            return Err(self.too_large("files in the archive", end.count, self.most_files));
        }
        let most = self.most_files.saturating_mul(MOST_ENTRY);
        if end.directory > most {
            let what = "bytes in the archive's directory";
            return Err(self.too_large(what, end.directory, most));
        }
        let agree = |plain: u64, own: u64, most: u64| plain == own || plain == most;
        if !(agree(plain.count, end.count, 0xffff)
            && agree(plain.directory, end.directory, IN_ZIP64)
            && agree(plain.offset, end.offset, IN_ZIP64))
        {
            let reason = "its end record and its zip64 end record state different directories";
            return Err(self.corrupt(at, reason));
        }
        let [disk, disk_of_directory, on_disk] = [4, 6, 8].map(|field| number::<2>(record, field));
        if wide.is_none() && (disk != disk_of_directory || on_disk != plain.count) {
            return Err(self.corrupt(at, "it is one of several parts of an archive"));
        }
        let bytes = self.read(start, end.directory as usize)?;
        Ok(Some(Directory {
            bytes: bytes.unwrap_or_default(),
            at: start,
            count: end.count,
            before,
        }))
    }

    /// The zip64 end record whose locator ends at byte `at`; `None` if there is none.
    fn zip64(&mut self, at: u64) -> Result<Option<End>, VolumeError> {
        let Some(locator_at) = at.checked_sub(LOCATOR_BYTES as u64) else {
            return Ok(None);
        };
        let locator = self.read(locator_at, LOCATOR_BYTES)?.unwrap_or_default();
        if !locator.starts_with(b"PK\x06\x07") {
            return Ok(None);
        }
        // Bytes before the archive move the record; it lies right before its locator then.
        let stated = number::<8>(&locator, 8);
        for place in [Some(stated), locator_at.checked_sub(ZIP64_END_BYTES as u64)] {
            let Some(place) = place.filter(|place| *place < locator_at) else {
                continue;
            };
            let record = self.read(place, ZIP64_END_BYTES)?.unwrap_or_default();
            if !record.starts_with(b"PK\x06\x06") {
                continue;
            }
            let count = number::<8>(&record, 32);
            let whole = number::<4>(&record, 16) == 0
                && number::<4>(&record, 20) == 0
                && number::<8>(&record, 24) == count;
            if !whole {
                return Err(self.corrupt(place, "it is one of several parts of an archive"));
            }
            return Ok(Some(End {
                count,
                directory: number::<8>(&record, 40),
                offset: number::<8>(&record, 48),
                at: place,
            }));
        }
        Err(self.corrupt(
            locator_at,
            "there is no zip64 end record where its locator says",
        ))
    }

    /// The entry with which `rest` of a directory begins, and what follows it.
    fn entry<'d>(
        &self,
        directory: &Directory,
        rest: &'d [u8],
    ) -> Result<(Entry, &'d [u8]), VolumeError> {
        let at = directory.at + (directory.bytes.len() - rest.len()) as u64;
        let cut = || self.corrupt(at, "its directory ends within an entry");
        if rest.len() < ENTRY_BYTES {
            return Err(cut());
        }
        if !rest.starts_with(b"PK\x01\x02") {
            return Err(self.corrupt(at, "an entry of its directory begins wrongly"));
        }
        let [name, extra, comment] = [28, 30, 32].map(|field| number::<2>(rest, field) as usize);
        let end = ENTRY_BYTES + name + extra + comment;
        if rest.len() < end {
            return Err(cut());
        }
        let extra = &rest[ENTRY_BYTES + name..][..extra];
        let mut wide = zip64_fields(extra);
        let mut quantity = |field: usize| match number::<4>(rest, field) {
            IN_ZIP64 => wide.next().ok_or(()),
            value => Ok(value),
        };
        // In the order in which the extra field has them.
        let quantities = [24, 20, 42].map(&mut quantity);
        let [Ok(unpacked), Ok(packed), Ok(header)] = quantities else {
            let reason = "an entry of its directory lacks the zip64 field that it refers to";
            return Err(self.corrupt(at, reason));
        };
        let header = header.checked_add(directory.before);
        let entry = Entry {
            name: String::from_utf8_lossy(&rest[ENTRY_BYTES..][..name]).into_owned(),
            flags: number::<2>(rest, 8) as u16,
            method: number::<2>(rest, 10) as u16,
            packed,
            unpacked,
            header: header.ok_or_else(|| self.corrupt(at, "an entry lies beyond the archive"))?,
        };
        Ok((entry, &rest[end..]))
    }

    /// Where the content of an entry begins.
    fn content_of(&mut self, entry: &Entry) -> Result<u64, VolumeError> {
        let wrong = "an entry does not lie where the directory says";
        let header = self.read(entry.header, LOCAL_HEADER_BYTES)?;
        let header = header.filter(|header| header.starts_with(b"PK\x03\x04"));
        let Some(header) = header else {
            return Err(self.corrupt(entry.header, wrong));
        };
        let names = number::<2>(&header, 26) + number::<2>(&header, 28);
        let begin = entry.header + LOCAL_HEADER_BYTES as u64 + names;
        match begin.checked_add(entry.packed) {
            Some(end) if end <= self.size => Ok(begin),
            _ => Err(self.corrupt(entry.header, "an entry ends after the archive")),
        }
    }
}

/// The numbers in the zip64 field among the extra fields of an entry.
fn zip64_fields(mut extra: &[u8]) -> impl Iterator<Item = u64> {
    let mut found: &[u8] = &[];
    while extra.len() >= 4 {
        let length = number::<2>(extra, 2) as usize;
        let Some(value) = extra.get(4..4 + length) else {
            break;
        };
        if number::<2>(extra, 0) as u16 == ZIP64_FIELD {
            found = value;
            break;
        }
        extra = &extra[4 + length..];
    }
    found.chunks_exact(8).map(|value| number::<8>(value, 0))
}

/// Whether the entry of that name accompanies images and is none.
pub(super) fn is_company(name: &str) -> bool {
    let mut parts = name.split(['/', '\\']);
    let last = name.rsplit(['/', '\\']).next().unwrap_or_default();
    parts.any(|part| part == "__MACOSX") || last.starts_with('.') || last == "DICOMDIR"
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;

    const MOST_FILES: u64 = ReadLimits::DEFAULT.files;
    use std::io::Write as _;
    use zip::write::SimpleFileOptions;
    use zip::{CompressionMethod, ZipArchive, ZipWriter};

    /// An archive by `zip`: `count` entries, deflated and stored in turn, some of them zip64.
    fn archive(count: usize, comment: &[u8]) -> Vec<u8> {
        let mut zip = ZipWriter::new(io::Cursor::new(Vec::new()));
        for n in 0..count {
            let method = [CompressionMethod::Stored, CompressionMethod::Deflated][n % 2];
            let options = SimpleFileOptions::default();
            let options = options.compression_method(method).large_file(n % 3 == 0);
            zip.start_file(format!("folder/file {n}"), options).unwrap();
            zip.write_all(&vec![n as u8; 100 + n]).unwrap();
        }
        zip.set_raw_comment(comment.to_vec().into_boxed_slice())
            .unwrap();
        zip.finish().unwrap().into_inner()
    }

    fn files(bytes: &[u8]) -> Result<Vec<VolumeFile>, VolumeError> {
        let file = VolumeFile::in_memory("a.zip", bytes.to_vec());
        files_in(&file, &ReadLimits::default()).map(|files| files.unwrap())
    }

    /// Names and contents, by this module and by `zip`.
    fn contents(bytes: &[u8]) -> [Vec<(String, Vec<u8>)>; 2] {
        let mut own = Vec::new();
        for file in files(bytes).unwrap() {
            let mut content = Vec::new();
            let mut source = super::super::source::Source::open(&file, 1 << 20).unwrap();
            source.read_to_end(&mut content).unwrap();
            own.push((file.name().to_owned(), content));
        }
        let mut library = ZipArchive::new(io::Cursor::new(bytes)).unwrap();
        let others = (0..library.len()).map(|n| {
            let mut entry = library.by_index(n).unwrap();
            let name = entry.name().unwrap().into_owned();
            let mut content = Vec::new();
            entry.read_to_end(&mut content).unwrap();
            (name, content)
        });
        [own, others.collect()]
    }

    /// A directory of `entries` smallest entries of one stored file, and end records of these kinds.
    struct Made {
        /// Number of entries that there are, and that the plain and the zip64 record state.
        counts: [u64; 3],
        zip64: bool,
        comment: Vec<u8>,
        before: Vec<u8>,
        /// Bytes between the zip64 record and its locator.
        extension: usize,
    }

    impl Made {
        fn with_entries(entries: u64) -> Self {
            Self {
                counts: [entries; 3],
                zip64: true,
                comment: Vec::new(),
                before: Vec::new(),
                extension: 0,
            }
        }

        fn bytes(&self) -> Vec<u8> {
            let [entries, plain, wide] = self.counts;
            let mut local = b"PK\x03\x04".to_vec();
            local.extend([0; 26]);
            local[26] = 1;
            local.push(b'a');
            let mut entry = b"PK\x01\x02".to_vec();
            entry.extend([0; 42]);
            entry[28] = 1;
            entry.push(b'a');
            let directory = entry.repeat(entries as usize);
            let (start, length) = (local.len() as u64, directory.len() as u64);
            let mut made = [self.before.clone(), local, directory].concat();
            if self.zip64 {
                let record = made.len() as u64 - self.before.len() as u64;
                made.extend(b"PK\x06\x06");
                made.extend((44 + self.extension as u64).to_le_bytes());
                made.extend([45, 0, 45, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
                for number in [wide, wide, length, start] {
                    made.extend(number.to_le_bytes());
                }
                made.extend(vec![0; self.extension]);
                made.extend(b"PK\x06\x07\0\0\0\0");
                made.extend(record.to_le_bytes());
                made.extend([1, 0, 0, 0]);
            }
            made.extend(b"PK\x05\x06\0\0\0\0");
            let small = |number: u64, most: u64| number.min(most);
            made.extend(&(small(plain, 0xffff) as u16).to_le_bytes().repeat(2));
            for number in [length, start] {
                made.extend((small(number, IN_ZIP64) as u32).to_le_bytes());
            }
            made.extend((self.comment.len() as u16).to_le_bytes());
            [made, self.comment.clone()].concat()
        }
    }

    fn is_too_large(found: &Result<Vec<VolumeFile>, VolumeError>) -> bool {
        matches!(found, Err(VolumeError::TooLarge { .. }))
    }

    fn is_corrupt(found: &Result<Vec<VolumeFile>, VolumeError>) -> bool {
        matches!(found, Err(VolumeError::Corrupt { .. }))
    }

    #[test]
    fn the_files_are_those_that_another_reader_finds() {
        let stray = b"a comment with PK\x05\x06 and then much more text than a record has";
        for comment in [&b""[..], b"made by hand", stray, &[b'P'; 0xffff]] {
            let plain = archive(7, comment);
            let [own, others] = contents(&plain);
            assert_eq!(own, others);
            assert_eq!(own.len(), 7);
            // Bytes before the archive that look like the start of one.
            let moved = [&archive(2, b"")[..50], &plain].concat();
            let [own, others] = contents(&moved);
            assert_eq!(own, others);
        }
        let many = contents(&archive(3000, b""));
        assert_eq!(many[0], many[1]);
    }

    #[test]
    fn too_large_a_directory_is_refused_wherever_that_is_stated() {
        assert_eq!(files(&Made::with_entries(3).bytes()).unwrap().len(), 3);
        assert_eq!(
            files(&Made::with_entries(MOST_FILES).bytes())
                .unwrap()
                .len() as u64,
            MOST_FILES
        );
        for entries in [MOST_FILES + 1, 70_000, 200_000] {
            for (zip64, extension) in [(false, 0), (true, 0), (true, 30)] {
                for comment in [0, 1, 0xffff] {
                    for before in [0, 40] {
                        let mut made = Made::with_entries(entries);
                        made.zip64 = zip64;
                        made.extension = extension;
                        made.comment = vec![b'.'; comment];
                        made.before = [b"PK\x03\x04".to_vec(), vec![0; before]].concat();
                        if before == 0 {
                            made.before.clear();
                        }
                        let found = files(&made.bytes());
                        let refused = is_too_large(&found) || (zip64 && is_corrupt(&found));
                        assert!(refused, "{entries} {zip64} {extension}: {found:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn end_records_that_contradict_each_other_are_refused() {
        for (plain, wide) in [(1, 3), (3, 1), (3, 70_000), (1, 1 << 40), (0, 3)] {
            let mut made = Made::with_entries(3);
            made.counts = [3, plain, wide];
            let found = files(&made.bytes());
            assert!(
                is_corrupt(&found) || is_too_large(&found),
                "{plain} {wide}: {found:?}"
            );
        }
        // What the plain record leaves to the other.
        let mut made = Made::with_entries(3);
        made.counts = [3, 0xffff, 3];
        assert_eq!(files(&made.bytes()).unwrap().len(), 3);
        // More entries than there are.
        for zip64 in [false, true] {
            let mut made = Made::with_entries(3);
            made.counts = [3, 4, 4];
            made.zip64 = zip64;
            assert!(is_corrupt(&files(&made.bytes())));
        }
    }

    #[test]
    fn two_end_records_give_the_last_one() {
        let first = archive(2, b"");
        let both = [&first[..], &archive(5, b"")].concat();
        let [own, others] = contents(&both);
        assert_eq!(own, others);
        assert_eq!(own.len(), 5);
    }

    #[test]
    fn no_damage_is_a_panic_or_takes_more_memory_than_the_file() {
        let whole = Made {
            comment: b"PK\x05\x06 and so on".to_vec(),
            ..Made::with_entries(2)
        };
        let whole = whole.bytes();
        for at in 4..whole.len() {
            for value in [0, 1, 0x7f, 0xff] {
                let mut damaged = whole.clone();
                damaged[at] = value;
                if let Ok(found) = files(&damaged) {
                    assert!(found.len() <= 2);
                }
            }
            let _ = files(&whole[..at]);
        }
    }
}
