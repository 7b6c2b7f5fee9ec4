//! Whose scan a volume is and which DICOM objects it came from.

use super::attributes::{
    ACCESSION_NUMBER, Attribute, Attributes, FRAME_OF_REFERENCE, INSTANCE, MANUFACTURER, MODALITY,
    MODEL_NAME, PATIENT_BIRTH_DATE, PATIENT_ID, PATIENT_NAME, PATIENT_SEX,
    POSITION_REFERENCE_INDICATOR, REFERRING_PHYSICIAN, SERIES, SERIES_DESCRIPTION, SERIES_NUMBER,
    SOP_CLASS, STUDY, STUDY_DATE, STUDY_ID, STUDY_TIME,
};
use std::fmt;

/// Patient, study, series and instances of a volume, as its DICOM header states them (PS3.3 C.7).
/// An attribute that is absent or empty is `None`.
///
/// This is personal data. `Debug` shows no value of it, so that it cannot get into a log.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct Provenance {
    /// Patient's Name (0010,0010), components separated by `^`.
    pub patient_name: Option<String>,
    /// Patient ID (0010,0020).
    pub patient_id: Option<String>,
    /// Patient's Birth Date (0010,0030), `YYYYMMDD`.
    pub patient_birth_date: Option<String>,
    /// Patient's Sex (0010,0040): `M`, `F` or `O`.
    pub patient_sex: Option<String>,
    /// Study Instance UID (0020,000D).
    pub study_uid: Option<String>,
    /// Study Date (0008,0020), `YYYYMMDD`.
    pub study_date: Option<String>,
    /// Study Time (0008,0030), `HHMMSS.FFFFFF`.
    pub study_time: Option<String>,
    /// Study ID (0020,0010).
    pub study_id: Option<String>,
    /// Accession Number (0008,0050).
    pub accession_number: Option<String>,
    /// Referring Physician's Name (0008,0090).
    pub referring_physician: Option<String>,
    /// Series Instance UID (0020,000E).
    pub series_uid: Option<String>,
    /// Series Number (0020,0011).
    pub series_number: Option<String>,
    /// Series Description (0008,103E).
    pub series_description: Option<String>,
    /// Modality (0008,0060).
    pub modality: Option<String>,
    /// Frame of Reference UID (0020,0052).
    pub frame_of_reference_uid: Option<String>,
    /// Position Reference Indicator (0020,1040).
    pub position_reference_indicator: Option<String>,
    /// SOP Class UID (0008,0016) of the instances.
    pub sop_class_uid: Option<String>,
    /// SOP Instance UID (0008,0018); of a series of several instances, the first one's.
    pub sop_instance_uid: Option<String>,
    /// SOP Instance UIDs of a series of several instances, in the order of the volume's slices;
    /// empty for a single one.
    pub instance_uids: Vec<String>,
    /// For every slice of the volume, the number of its stored frame in the instance, from 1; empty
    /// for a series of single-frame instances.
    pub slice_frames: Vec<u32>,
    /// Manufacturer (0008,0070) of the equipment.
    pub manufacturer: Option<String>,
    /// Manufacturer's Model Name (0008,1090).
    pub model_name: Option<String>,
}

impl Provenance {
    /// What the data set says, without the frames of the slices.
    pub(super) fn of(attributes: &Attributes) -> Self {
        let text = |attribute: Attribute| {
            let text = attributes.texts(attribute).join("\\");
            (!text.is_empty()).then_some(text)
        };
        Self {
            patient_name: text(PATIENT_NAME),
            patient_id: text(PATIENT_ID),
            patient_birth_date: text(PATIENT_BIRTH_DATE),
            patient_sex: text(PATIENT_SEX),
            study_uid: text(STUDY),
            study_date: text(STUDY_DATE),
            study_time: text(STUDY_TIME),
            study_id: text(STUDY_ID),
            accession_number: text(ACCESSION_NUMBER),
            referring_physician: text(REFERRING_PHYSICIAN),
            series_uid: text(SERIES),
            series_number: text(SERIES_NUMBER),
            series_description: text(SERIES_DESCRIPTION),
            modality: text(MODALITY),
            frame_of_reference_uid: text(FRAME_OF_REFERENCE),
            position_reference_indicator: text(POSITION_REFERENCE_INDICATOR),
            sop_class_uid: text(SOP_CLASS),
            sop_instance_uid: text(INSTANCE),
            manufacturer: text(MANUFACTURER),
            model_name: text(MODEL_NAME),
            ..Self::default()
        }
    }
}

impl fmt::Debug for Provenance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Provenance").finish_non_exhaustive()
    }
}
