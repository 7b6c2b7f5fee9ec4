//! The data set of a stored file: where it begins, how it is encoded, and its bytes.

use super::super::VolumeError;
use super::super::limits::ReadLimits;
use super::super::source::{Source, VolumeFile};
use ventriform_dicom::read::syntax::{self, START_BYTES, Syntax};

/// The data set of a file.
pub(super) struct StoredDataSet {
    /// Its place and encoding.
    pub syntax: Syntax,
    /// Whether the file is gzipped.
    pub gzip: bool,
}

impl StoredDataSet {
    /// Finds the data set of `file`.
    ///
    /// # Errors
    /// [`VolumeError`] if the file cannot be read, and as [`Syntax::new`].
    pub(super) fn find(file: &VolumeFile, limits: &ReadLimits) -> Result<Self, VolumeError> {
        let (start, gzip) = beginning(file, limits)?;
        let syntax = Syntax::new(file.name(), &start)?;
        Ok(Self { syntax, gzip })
    }

    /// Opens `file` at the start of its data set, to give out at most `limit` unpacked bytes.
    ///
    /// # Errors
    /// [`VolumeError`] if the file cannot be read.
    pub(super) fn open(&self, file: &VolumeFile, limit: u64) -> Result<Source, VolumeError> {
        let begin = self.syntax.data_set;
        if self.syntax.deflated {
            return Source::inflate(file, begin, limit);
        }
        let mut source = Source::open(file, limit)?;
        source.skip_to(begin)?;
        Ok(source)
    }
}

/// The Media Storage SOP Class UID (0002,0002) of `file`, whatever transfer syntax it is in.
///
/// # Errors
/// [`VolumeError`] if the file cannot be read.
pub(super) fn media_class(
    file: &VolumeFile,
    limits: &ReadLimits,
) -> Result<Option<String>, VolumeError> {
    let (start, _) = beginning(file, limits)?;
    Ok(syntax::media_class(&start))
}

/// The first bytes of `file`, and whether it is gzipped.
fn beginning(file: &VolumeFile, limits: &ReadLimits) -> Result<(Vec<u8>, bool), VolumeError> {
    let limit = usize::try_from(limits.unpacked_bytes).unwrap_or(START_BYTES);
    let mut start = vec![0; START_BYTES.min(limit)];
    let mut source = Source::open(file, limits.unpacked_bytes)?;
    let there = source.fill(&mut start)?;
    start.truncate(there);
    Ok((start, source.is_gzip()))
}
