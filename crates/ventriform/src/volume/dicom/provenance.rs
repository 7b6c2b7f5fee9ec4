//! Whose scan a volume is, how it was made and which DICOM objects it came from.

use super::attributes::{
    ACCESSION_NUMBER, ACQUISITION_DATE, ACQUISITION_DATE_TIME, ACQUISITION_TIME, Attributes,
    CONTENT_DATE, CONTEXT_MEANING, CONVOLUTION_KERNEL, FRAME_OF_REFERENCE, IMAGE_TYPE,
    INJECTED_DOSE, INJECTION_TIME, MANUFACTURER, MODALITY, MODEL_NAME, NUCLIDE_MEANING,
    PATIENT_BIRTH_DATE, PATIENT_ID, PATIENT_NAME, PATIENT_SEX, PHARMACEUTICAL_MEANING,
    PHARMACEUTICAL_NAME, POSITION_REFERENCE, PROTOCOL_MEANING, PROTOCOL_NAME,
    RECONSTRUCTION_METHOD, REFERRING_PHYSICIAN, SERIES_DATE, SERIES_DESCRIPTION, SERIES_NUMBER,
    SERIES_UID, SOFTWARE_VERSIONS, SOP_CLASS, SOP_INSTANCE, STUDY_DATE, STUDY_DESCRIPTION,
    STUDY_ID, STUDY_TIME, STUDY_UID, clip,
};
use serde::{Deserialize, Serialize};
use std::fmt;

macro_rules! provenance {
    ($($(#[$doc:meta])* $field:ident = $attribute:expr;)*) => {
        // Patient, study, series, instances and acquisition (PS3.3 C.7, C.8.4). An attribute that is
        // absent or empty is `None`. This is personal data: `Debug` shows no value of it, so that it
        // cannot get into a log.
        /// Whose scan a volume is: what its DICOM header says, or was stated.
        #[derive(Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
        #[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = Scan))]
        pub struct Provenance {
            $(
                $(#[$doc])*
                #[serde(skip_serializing_if = "Option::is_none")]
                pub $field: Option<String>,
            )*
            // From the acquisition context, the protocol, or the descriptions of series and study.
            /// `rest` or `stress`.
            #[serde(skip_serializing_if = "Option::is_none")]
            pub rest_or_stress: Option<String>,
            // In the order of the volume's slices; empty for a single one.
            /// SOP Instance UIDs of a series of several instances; in `/identity` only.
            #[serde(default, skip_serializing_if = "Vec::is_empty")]
            pub instance_uids: Vec<String>,
            /// For every slice of the volume, the number of its stored frame in the instance, from 1;
            /// empty for a series of single-frame instances, and for a segmentation.
            #[serde(default, skip_serializing_if = "Vec::is_empty")]
            #[cfg_attr(feature = "schema", schema(ignore))]
            pub slice_frames: Vec<u32>,
            // See [`decode`](super::characters).
            /// Fields that the file states and that cannot be decoded; while they belong to patient or
            /// study, no DICOM object is made.
            #[serde(default, skip_serializing_if = "Vec::is_empty")]
            pub undecoded: Vec<String>,
        }

        impl Provenance {
            /// The provenance that the data set states, without the frames of the slices.
            pub(super) fn of(a: &Attributes) -> Self {
                let mut undecoded = Vec::new();
                $(if a.decoded($attribute).is_err() {
                    undecoded.push(stringify!($field).to_owned());
                })*
                Self {
                    $($field: a.prose($attribute),)*
                    rest_or_stress: rest_or_stress(a),
                    instance_uids: Vec::new(),
                    slice_frames: Vec::new(),
                    undecoded,
                }
                .settled(a)
            }

            /// Which of the attributes cannot be decoded, and why, for people to read.
            pub(super) fn warnings(a: &Attributes) -> Vec<String> {
                let sets = a.character_sets(&[]);
                let unknown = sets.unknown().map(|term| format!(
                    "Specific Character Set (0008,0005) has the value {:?}, which DICOM does not \
                     define: only text of ASCII is read.",
                    clip(term)
                ));
                let each = [$(($attribute, a.decoded($attribute)),)*];
                let each = each.into_iter().filter_map(|(attribute, decoded)| {
                    let reason = decoded.err()?;
                    Some(format!("{} cannot be decoded: {reason}.", attribute.name))
                });
                unknown.into_iter().chain(each).collect()
            }

            /// The stated values, each with its name, without the numbers of slices.
            pub fn stated(&self) -> Vec<(&'static str, &str)> {
                let fields = [$((stringify!($field), self.$field.as_deref()),)*];
                let state = ("rest_or_stress", self.rest_or_stress.as_deref());
                fields
                    .into_iter()
                    .chain([state])
                    .filter_map(|(name, value)| Some((name, value?)))
                    .collect()
            }
        }
    };
}

provenance! {
    /// Patient's Name (0010,0010), components separated by `^`.
    patient_name = PATIENT_NAME;
    /// Patient ID (0010,0020).
    patient_id = PATIENT_ID;
    /// Patient's Birth Date (0010,0030), `YYYYMMDD`.
    patient_birth_date = PATIENT_BIRTH_DATE;
    /// Patient's Sex (0010,0040): `M`, `F` or `O`.
    patient_sex = PATIENT_SEX;
    /// Study Instance UID (0020,000D).
    study_uid = STUDY_UID;
    /// Study Date (0008,0020), `YYYYMMDD`.
    study_date = STUDY_DATE;
    /// Study Time (0008,0030), `HHMMSS.FFFFFF`.
    study_time = STUDY_TIME;
    /// Study ID (0020,0010).
    study_id = STUDY_ID;
    /// Study Description (0008,1030).
    study_description = STUDY_DESCRIPTION;
    /// Accession Number (0008,0050).
    accession_number = ACCESSION_NUMBER;
    /// Referring Physician's Name (0008,0090).
    referring_physician = REFERRING_PHYSICIAN;
    /// Series Instance UID (0020,000E).
    series_uid = SERIES_UID;
    /// Series Number (0020,0011).
    series_number = SERIES_NUMBER;
    /// Series Description (0008,103E).
    series_description = SERIES_DESCRIPTION;
    /// Modality (0008,0060).
    modality = MODALITY;
    /// Image Type (0008,0008), values separated by backslashes.
    image_type = IMAGE_TYPE;
    /// Frame of Reference UID (0020,0052).
    frame_of_reference_uid = FRAME_OF_REFERENCE;
    /// Position Reference Indicator (0020,1040).
    position_reference_indicator = POSITION_REFERENCE;
    /// SOP Class UID (0008,0016) of the instances.
    sop_class_uid = SOP_CLASS;
    /// SOP Instance UID (0008,0018); of a series of several instances, the first one's.
    sop_instance_uid = SOP_INSTANCE;
    /// Acquisition Date (0008,0022), or the date in Acquisition `DateTime` (0008,002A), or
    /// the Series Date, `YYYYMMDD`.
    acquisition_date = ACQUISITION_DATE;
    /// Acquisition Time (0008,0032), or the time in Acquisition `DateTime` (0008,002A).
    acquisition_time = ACQUISITION_TIME;
    /// Meaning of the Radiopharmaceutical Code (0054,0304), or the Radiopharmaceutical
    /// (0018,0031).
    radiopharmaceutical = PHARMACEUTICAL_MEANING;
    /// Meaning of the Radionuclide Code (0054,0300).
    radionuclide = NUCLIDE_MEANING;
    /// Radionuclide Total Dose (0018,1074) as stored: MBq in NM images, Bq in PET images.
    injected_dose = INJECTED_DOSE;
    /// Radiopharmaceutical Start Time (0018,1072).
    injection_time = INJECTION_TIME;
    /// Manufacturer (0008,0070) of the equipment.
    manufacturer = MANUFACTURER;
    /// Manufacturer's Model Name (0008,1090).
    model_name = MODEL_NAME;
    /// Software Versions (0018,1020).
    software_versions = SOFTWARE_VERSIONS;
    /// Protocol Name (0018,1030).
    protocol_name = PROTOCOL_NAME;
    /// Reconstruction Method (0054,1103).
    reconstruction_method = RECONSTRUCTION_METHOD;
    /// Convolution Kernel (0018,1210).
    convolution_kernel = CONVOLUTION_KERNEL;
}

impl Provenance {
    /// Takes values from attributes that say the same where the first choice is empty.
    fn settled(mut self, a: &Attributes) -> Self {
        let moment = a.prose(ACQUISITION_DATE_TIME);
        let date = moment.as_ref().and_then(|moment| moment.get(..8));
        let time = moment.as_ref().and_then(|moment| moment.get(8..));
        let or = |value: Option<String>, other: Option<&str>| {
            value.or_else(|| other.filter(|o| !o.is_empty()).map(str::to_owned))
        };
        self.acquisition_date = or(self.acquisition_date, date)
            .or_else(|| a.prose(SERIES_DATE))
            .or_else(|| a.prose(CONTENT_DATE));
        self.acquisition_time = or(self.acquisition_time, time);
        self.radiopharmaceutical = self
            .radiopharmaceutical
            .or_else(|| a.prose(PHARMACEUTICAL_NAME));
        self
    }
}

/// `rest` or `stress` if exactly one of them is named, by the most telling attribute that names one.
fn rest_or_stress(a: &Attributes) -> Option<String> {
    [
        CONTEXT_MEANING,
        PROTOCOL_MEANING,
        PROTOCOL_NAME,
        SERIES_DESCRIPTION,
        STUDY_DESCRIPTION,
    ]
    .into_iter()
    .find_map(|attribute| {
        let text = a.prose(attribute)?.to_lowercase();
        let words: Vec<&str> = text.split(|c: char| !c.is_alphabetic()).collect();
        let any = |names: &[&str]| words.iter().any(|word| names.contains(word));
        let rest = any(&["rest", "resting", "rst", "ruhe", "repos"]);
        let stress = any(&["stress", "str", "strs", "exercise", "belastung", "effort"]);
        match (rest, stress) {
            (true, false) => Some("rest".to_owned()),
            (false, true) => Some("stress".to_owned()),
            _ => None,
        }
    })
}

impl fmt::Debug for Provenance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Provenance").finish_non_exhaustive()
    }
}
