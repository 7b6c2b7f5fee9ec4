//! Whose scan a volume is, how it was made and which DICOM objects it came from.

use serde::{Deserialize, Serialize};
use std::fmt;

macro_rules! provenance {
    ($($(#[$doc:meta])* $field:ident,)*) => {
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
            /// Fields that the file states and that cannot be decoded; while they belong to patient or
            /// study, no DICOM object is made.
            #[serde(default, skip_serializing_if = "Vec::is_empty")]
            pub undecoded: Vec<String>,
        }

        impl Provenance {
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
    patient_name,
    /// Patient ID (0010,0020).
    patient_id,
    /// Patient's Birth Date (0010,0030), `YYYYMMDD`.
    patient_birth_date,
    /// Patient's Sex (0010,0040): `M`, `F` or `O`.
    patient_sex,
    /// Study Instance UID (0020,000D).
    study_uid,
    /// Study Date (0008,0020), `YYYYMMDD`.
    study_date,
    /// Study Time (0008,0030), `HHMMSS.FFFFFF`.
    study_time,
    /// Study ID (0020,0010).
    study_id,
    /// Study Description (0008,1030).
    study_description,
    /// Accession Number (0008,0050).
    accession_number,
    /// Referring Physician's Name (0008,0090).
    referring_physician,
    /// Series Instance UID (0020,000E).
    series_uid,
    /// Series Number (0020,0011).
    series_number,
    /// Series Description (0008,103E).
    series_description,
    /// Modality (0008,0060).
    modality,
    /// Image Type (0008,0008), values separated by backslashes.
    image_type,
    /// Frame of Reference UID (0020,0052).
    frame_of_reference_uid,
    /// Position Reference Indicator (0020,1040).
    position_reference_indicator,
    /// SOP Class UID (0008,0016) of the instances.
    sop_class_uid,
    /// SOP Instance UID (0008,0018); of a series of several instances, the first one's.
    sop_instance_uid,
    /// Acquisition Date (0008,0022), or the date in Acquisition `DateTime` (0008,002A), or
    /// the Series Date, `YYYYMMDD`.
    acquisition_date,
    /// Acquisition Time (0008,0032), or the time in Acquisition `DateTime` (0008,002A).
    acquisition_time,
    /// Meaning of the Radiopharmaceutical Code (0054,0304), or the Radiopharmaceutical
    /// (0018,0031).
    radiopharmaceutical,
    /// Meaning of the Radionuclide Code (0054,0300).
    radionuclide,
    /// Radionuclide Total Dose (0018,1074) as stored: MBq in NM images, Bq in PET images
    /// ([`Provenance::injected_dose_mbq`]).
    injected_dose,
    /// Radiopharmaceutical Start Time (0018,1072).
    injection_time,
    /// Manufacturer (0008,0070) of the equipment.
    manufacturer,
    /// Manufacturer's Model Name (0008,1090).
    model_name,
    /// Software Versions (0018,1020).
    software_versions,
    /// Protocol Name (0018,1030).
    protocol_name,
    /// Corrected Image (0028,0051), values separated by backslashes: with `ATTN` attenuation was corrected.
    corrected_image,
    /// Units (0054,1001).
    units,
    /// Patient Position (0018,5100), such as `HFS`, or the meaning of the Patient Orientation Modifier Code (0054,0412).
    patient_position,
    /// Reconstruction Method (0054,1103).
    reconstruction_method,
    /// Convolution Kernel (0018,1210).
    convolution_kernel,
    /// Scan Arc (0018,1143): by how many degrees the camera turned.
    scan_arc,
}

impl Provenance {
    /// By how many degrees the camera turned; `None` where the header does not say. Rings of PET see all angles at once: 0.
    pub fn scan_arc_deg(&self) -> Option<f64> {
        if self.modality.as_deref().map(str::trim) == Some("PT") {
            return Some(0.0);
        }
        let arc: f64 = self.scan_arc.as_deref()?.trim().parse().ok()?;
        arc.is_finite().then_some(arc.abs())
    }

    /// The Frame of Reference UID, which meshes name; `None` if the header has a text in its place.
    pub fn frame_of_reference(&self) -> Option<&str> {
        let uid = self.frame_of_reference_uid.as_deref()?;
        let formed = uid.len() <= 64 && uid.bytes().all(|b| b.is_ascii_digit() || b == b'.');
        formed.then_some(uid)
    }

    /// The total dose in MBq, as text; what is no number stays as the header has it.
    pub fn injected_dose_mbq(&self) -> Option<String> {
        /// Units of the header in a megabecquerel, in PET images.
        const BQ_PER_MBQ: f64 = 1e6;
        let stated = self.injected_dose.as_deref()?.trim();
        if self.modality.as_deref().map(str::trim) != Some("PT") {
            return Some(stated.to_owned());
        }
        match stated.parse::<f64>() {
            Ok(becquerels) if becquerels.is_finite() => {
                Some(format!("{:.0}", becquerels / BQ_PER_MBQ))
            }
            _ => Some(stated.to_owned()),
        }
    }

    /// Whether attenuation was corrected; `None` where the header does not say.
    pub fn attenuation_corrected(&self) -> Option<bool> {
        let corrections = self.corrected_image.as_deref()?;
        Some(
            corrections
                .split('\\')
                .any(|correction| correction.trim() == "ATTN"),
        )
    }
}

impl fmt::Debug for Provenance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Provenance").finish_non_exhaustive()
    }
}
