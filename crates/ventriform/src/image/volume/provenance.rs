//! Whose scan a volume is, how it was made and which DICOM objects it came from.

use serde::{Deserialize, Serialize};
use std::fmt;
use ventriform_dicom::values::dashed_date;

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

/// A text without the spaces and separators around it, in capitals; `None` for an empty one.
fn plain(text: &Option<String>) -> Option<String> {
    let text = text.as_deref()?.trim_matches(['^', ' ']).to_uppercase();
    (!text.is_empty()).then_some(text)
}

/// Two stated texts, if they differ in more than capitals.
fn differing(a: &Option<String>, b: &Option<String>) -> Option<[String; 2]> {
    let (a, b) = (a.as_deref()?.trim(), b.as_deref()?.trim());
    let differ = !a.is_empty() && !b.is_empty() && !a.eq_ignore_ascii_case(b);
    differ.then(|| [a.to_owned(), b.to_owned()])
}

/// A text that is there.
fn stated(text: &Option<String>) -> Option<&str> {
    let text = text.as_deref()?.trim();
    (!text.is_empty()).then_some(text)
}

impl Provenance {
    /// When the scan was made, or else its study: date, `YYYYMMDD`, and time, as the header has them.
    pub fn moment(&self) -> Option<(&str, &str)> {
        let acquired = stated(&self.acquisition_date).map(|date| (date, &self.acquisition_time));
        let of_study = stated(&self.study_date).map(|date| (date, &self.study_time));
        let (date, time) = acquired.or(of_study)?;
        Some((date, stated(time).unwrap_or_default()))
    }

    /// The date of [`Provenance::moment`] as `YYYY-MM-DD`; another text as it is.
    pub fn day(&self) -> Option<String> {
        let (date, _) = self.moment()?;
        Some(dashed_date(date).unwrap_or_else(|| date.to_owned()))
    }

    /// The fields by which two headers name two patients. The name decides only where no number does: it changes by
    /// marriage and by spelling.
    pub fn other_patient(&self, other: &Self) -> Vec<&'static str> {
        let differ =
            |a: &Option<String>, b: &Option<String>| plain(a).zip(plain(b)).map(|(a, b)| a != b);
        let number = differ(&self.patient_id, &other.patient_id);
        let fields = [
            ("Patient ID (0010,0020)", number),
            (
                "Patient's Birth Date (0010,0030)",
                differ(&self.patient_birth_date, &other.patient_birth_date),
            ),
            (
                "Patient's Sex (0010,0040)",
                differ(&self.patient_sex, &other.patient_sex),
            ),
            (
                "Patient's Name (0010,0010)",
                differ(&self.patient_name, &other.patient_name).filter(|_| number != Some(false)),
            ),
        ];
        let named = fields
            .into_iter()
            .filter(|(_, differ)| *differ == Some(true));
        named.map(|(name, _)| name).collect()
    }

    /// The tracer, or else its nuclide.
    pub fn tracer(&self) -> Option<String> {
        let named = [&self.radiopharmaceutical, &self.radionuclide];
        let stated = named
            .into_iter()
            .flatten()
            .find(|text| !text.trim().is_empty());
        stated.map(|text| text.trim().to_owned())
    }

    /// The tracers, or else their nuclides, where both headers state one and they differ.
    pub fn other_tracer(&self, other: &Self) -> Option<[String; 2]> {
        differing(&self.radiopharmaceutical, &other.radiopharmaceutical)
            .or_else(|| differing(&self.radionuclide, &other.radionuclide))
    }

    /// What of camera and reconstruction both headers state and have otherwise.
    pub fn made_otherwise(&self, other: &Self) -> Vec<(&'static str, [String; 2])> {
        let fields = [
            ("the camera", &self.model_name, &other.model_name),
            ("the unit of uptake", &self.units, &other.units),
            (
                "the patient's position",
                &self.patient_position,
                &other.patient_position,
            ),
            (
                "the reconstruction",
                &self.reconstruction_method,
                &other.reconstruction_method,
            ),
            (
                "the filter",
                &self.convolution_kernel,
                &other.convolution_kernel,
            ),
        ];
        let differ = |(field, a, b)| Some((field, differing(a, b)?));
        fields.into_iter().filter_map(differ).collect()
    }

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

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(change: impl Fn(&mut Provenance)) -> Provenance {
        let text = |text: &str| Some(text.to_owned());
        let mut scan = Provenance {
            patient_id: text("17"),
            patient_name: text("DOE^ANN^"),
            patient_birth_date: text("19500102"),
            patient_sex: text("F"),
            ..Provenance::default()
        };
        change(&mut scan);
        scan
    }

    #[test]
    fn days_are_written_by_the_standard() {
        let day = |date: &str| {
            let made = scan(|s| s.study_date = Some(date.to_owned()));
            made.day()
        };
        assert_eq!(day("20240507").as_deref(), Some("2024-05-07"));
        assert_eq!(day(" "), None);
        for other in ["2024", "2024-05-07", "ä0240507"] {
            assert_eq!(day(other).as_deref(), Some(other));
        }
    }

    /// Spelling is no other patient, nor is a new name with the old number; every other difference is.
    #[test]
    fn patients_are_told_apart_by_what_does_not_change() {
        let text = |text: &str| Some(text.to_owned());
        let one = scan(|_| {});
        for same in [
            scan(|s| s.patient_name = text("Doe^Ann")),
            scan(|s| s.patient_name = text("MILLER^ANN")),
            scan(|s| s.patient_birth_date = None),
            scan(|s| s.patient_id = text("")),
        ] {
            assert_eq!(one.other_patient(&same), Vec::<&str>::new());
        }
        for other in [
            scan(|s| s.patient_id = text("18")),
            scan(|s| s.patient_birth_date = text("19500103")),
            scan(|s| s.patient_sex = text("M")),
            scan(|s| (s.patient_id, s.patient_name) = (None, text("MILLER^ANN"))),
        ] {
            assert!(!one.other_patient(&other).is_empty());
        }
    }
}
