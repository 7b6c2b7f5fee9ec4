//! Files of results: formats by name, names and bytes for Python.

use crate::errors::{Stopped, broken, refused};
use ventriform::results::export::Format;
use ventriform::runs::segmentation::{NamedFile, SegmentationFilesError};

/// The formats with these names.
pub fn formats(names: &[String]) -> Result<Vec<Format>, Stopped> {
    let format = |name: &String| {
        Format::from_extension(name).ok_or_else(|| {
            let known = Format::ALL.map(Format::extension).join(", ");
            let reason = format!("`{name}` is no format of meshes");
            Stopped::Failed(refused(
                "formats",
                reason,
                &format!("Give some of {known}."),
            ))
        })
    };
    names.iter().map(format).collect()
}

/// Names and bytes of files.
pub type Files = Vec<(String, Vec<u8>)>;

/// Files for Python.
pub fn named(files: Vec<NamedFile>) -> Files {
    files
        .into_iter()
        .map(|file| (file.name, file.bytes))
        .collect()
}

/// Why files cannot be made.
pub fn unwritable(error: SegmentationFilesError) -> Stopped {
    match error {
        SegmentationFilesError::Cancelled(_) => Stopped::Cancelled,
        error => Stopped::Failed(broken(error)),
    }
}
