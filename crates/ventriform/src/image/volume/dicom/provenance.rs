//! The [`Provenance`] that a data set states (PS3.3 C.7, C.8.4).

use super::super::Provenance;
use super::rest_stress::rest_or_stress;
use ventriform_dicom::read::attributes::{
    ACCESSION_NUMBER, ACQUISITION_DATE, ACQUISITION_DATE_TIME, ACQUISITION_TIME, Attributes,
    CONTENT_DATE, CONVOLUTION_KERNEL, CORRECTED_IMAGE, FRAME_OF_REFERENCE, IMAGE_TYPE,
    INJECTED_DOSE, INJECTION_DATE_TIME, INJECTION_TIME, MANUFACTURER, MODALITY, MODEL_NAME,
    NUCLIDE_MEANING, PATIENT_BIRTH_DATE, PATIENT_ID, PATIENT_NAME, PATIENT_POSITION, PATIENT_SEX,
    PHARMACEUTICAL_MEANING, PHARMACEUTICAL_NAME, POSITION_REFERENCE, POSTURE_MEANING,
    PROTOCOL_NAME, RECONSTRUCTION_METHOD, REFERRING_PHYSICIAN, SCAN_ARC, SERIES_DATE,
    SERIES_DESCRIPTION, SERIES_NUMBER, SERIES_UID, SOFTWARE_VERSIONS, SOP_CLASS, SOP_INSTANCE,
    STUDY_DATE, STUDY_DESCRIPTION, STUDY_ID, STUDY_TIME, STUDY_UID, UNITS, clip,
};

macro_rules! attributes_of_fields {
    ($($field:ident = $attribute:expr;)*) => {
        impl Provenance {
            /// The provenance that the data set states, without the frames of the slices and without what is no value
            /// of its representation.
            pub(super) fn from_attributes(a: &Attributes) -> Self {
                let mut stated = Self::as_stated(a);
                stated.put_right();
                stated
            }

            fn as_stated(a: &Attributes) -> Self {
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

            /// Which of the attributes cannot be decoded or are put right, and why, for people to read.
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
                let mut stated = Self::as_stated(a);
                let right = stated.put_right().into_iter().chain(stated.fit());
                unknown.into_iter().chain(each).chain(right).chain(a.notes()).collect()
            }
        }
    };
}

attributes_of_fields! {
    patient_name = PATIENT_NAME;
    patient_id = PATIENT_ID;
    patient_birth_date = PATIENT_BIRTH_DATE;
    patient_sex = PATIENT_SEX;
    study_uid = STUDY_UID;
    study_date = STUDY_DATE;
    study_time = STUDY_TIME;
    study_id = STUDY_ID;
    study_description = STUDY_DESCRIPTION;
    accession_number = ACCESSION_NUMBER;
    referring_physician = REFERRING_PHYSICIAN;
    series_uid = SERIES_UID;
    series_number = SERIES_NUMBER;
    series_description = SERIES_DESCRIPTION;
    modality = MODALITY;
    image_type = IMAGE_TYPE;
    frame_of_reference_uid = FRAME_OF_REFERENCE;
    position_reference_indicator = POSITION_REFERENCE;
    sop_class_uid = SOP_CLASS;
    sop_instance_uid = SOP_INSTANCE;
    acquisition_date = ACQUISITION_DATE;
    acquisition_time = ACQUISITION_TIME;
    radiopharmaceutical = PHARMACEUTICAL_MEANING;
    radionuclide = NUCLIDE_MEANING;
    injected_dose = INJECTED_DOSE;
    injection_time = INJECTION_TIME;
    manufacturer = MANUFACTURER;
    model_name = MODEL_NAME;
    software_versions = SOFTWARE_VERSIONS;
    protocol_name = PROTOCOL_NAME;
    corrected_image = CORRECTED_IMAGE;
    units = UNITS;
    patient_position = PATIENT_POSITION;
    reconstruction_method = RECONSTRUCTION_METHOD;
    convolution_kernel = CONVOLUTION_KERNEL;
    scan_arc = SCAN_ARC;
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
        let injected = a.prose(INJECTION_DATE_TIME);
        let injected = injected.as_ref().and_then(|moment| moment.get(8..));
        self.injection_time = or(self.injection_time, injected);
        self.radiopharmaceutical = self
            .radiopharmaceutical
            .or_else(|| a.prose(PHARMACEUTICAL_NAME));
        self.patient_position = self.patient_position.or_else(|| a.prose(POSTURE_MEANING));
        self
    }
}
