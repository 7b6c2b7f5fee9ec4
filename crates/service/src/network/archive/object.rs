//! An object on its way to an archive.

use dicom_core::Tag;
use dicom_dictionary_std::tags;
use dicom_object::{DefaultDicomObject, OpenFileOptions};

/// A DICOM file and the identifiers that sending needs.
#[derive(Debug, Clone)]
pub struct ArchiveObject {
    /// The file: Explicit VR Little Endian, with preamble and meta group.
    pub bytes: Vec<u8>,
    /// SOP Class UID.
    pub class: String,
    /// SOP Instance UID.
    pub instance: String,
    /// Study Instance UID.
    pub study: String,
    /// Series Instance UID.
    pub series: String,
}

impl ArchiveObject {
    /// The object in a file that this program has made; `None` if it lacks an identifier.
    pub fn from_bytes(bytes: Vec<u8>) -> Option<Self> {
        let file = OpenFileOptions::new()
            .read_until(tags::STUDY_ID)
            .from_reader(bytes.as_slice())
            .ok()?;
        let trimmed = |uid: &str| uid.trim_end_matches(['\0', ' ']).to_owned();
        let class = trimmed(file.meta().media_storage_sop_class_uid());
        let instance = trimmed(file.meta().media_storage_sop_instance_uid());
        let study = uid(&file, tags::STUDY_INSTANCE_UID)?;
        let series = uid(&file, tags::SERIES_INSTANCE_UID)?;
        Some(Self {
            bytes,
            class,
            instance,
            study,
            series,
        })
    }
}

fn uid(file: &DefaultDicomObject, tag: Tag) -> Option<String> {
    let text = file.get(tag)?.to_str().ok()?;
    let text = text.trim_end_matches(['\0', ' ']);
    (!text.is_empty()).then(|| text.to_owned())
}
