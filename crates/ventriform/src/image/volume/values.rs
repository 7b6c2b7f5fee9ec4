//! Which texts are values of their representation, in what the objects made of a scan state (PS3.5 6.2 and 9.1).
//!
//! In: whose scan it is, as a file says it. Out: the same with dates, times and the patient's
//! sex written as the standard writes them, and without identifiers, dates and times that are none. A file may
//! hold anything; an archive refuses an object with such a value, or files it where nobody finds it. What is a value
//! of its representation, [`ventriform_dicom::values`] says.
//!
//! Texts may be longer than their representation. Objects state them as far as they fit ([`Provenance::fit`]), without
//! those that name a patient or an order: cut off, they would name another. The record of the scan keeps them whole,
//! since people look for what the header has.

use super::Provenance;
use ventriform_dicom::values::{Representation, Text, is_uid};

/// The fields that are checked, with their names in the standard.
const CHECKED_FIELDS: [(Representation, &str, &str); 9] = [
    (
        Representation::Uid,
        "study_uid",
        "Study Instance UID (0020,000D)",
    ),
    (
        Representation::Uid,
        "series_uid",
        "Series Instance UID (0020,000E)",
    ),
    (
        Representation::Uid,
        "frame_of_reference_uid",
        "Frame of Reference UID (0020,0052)",
    ),
    (
        Representation::Uid,
        "sop_class_uid",
        "SOP Class UID (0008,0016)",
    ),
    (
        Representation::Uid,
        "sop_instance_uid",
        "SOP Instance UID (0008,0018)",
    ),
    (Representation::Date, "study_date", "Study Date (0008,0020)"),
    (
        Representation::Date,
        "patient_birth_date",
        "Patient's Birth Date (0010,0030)",
    ),
    (Representation::Time, "study_time", "Study Time (0008,0030)"),
    (
        Representation::Sex,
        "patient_sex",
        "Patient's Sex (0010,0040)",
    ),
];

/// The texts that objects state, whether each may be cut off, and their names in the standard.
const TEXTS: [(Text, bool, &str, &str); 6] = [
    (
        Text::Name,
        true,
        "patient_name",
        "Patient's Name (0010,0010)",
    ),
    (Text::Long, false, "patient_id", "Patient ID (0010,0020)"),
    (Text::Short, true, "study_id", "Study ID (0020,0010)"),
    (
        Text::Short,
        false,
        "accession_number",
        "Accession Number (0008,0050)",
    ),
    (
        Text::Name,
        true,
        "referring_physician",
        "Referring Physician's Name (0008,0090)",
    ),
    (
        Text::Long,
        true,
        "position_reference_indicator",
        "Position Reference Indicator (0020,1040)",
    ),
];

impl Provenance {
    fn field_of(&mut self, name: &str) -> Option<&mut Option<String>> {
        Some(match name {
            "study_uid" => &mut self.study_uid,
            "series_uid" => &mut self.series_uid,
            "frame_of_reference_uid" => &mut self.frame_of_reference_uid,
            "sop_class_uid" => &mut self.sop_class_uid,
            "sop_instance_uid" => &mut self.sop_instance_uid,
            "study_date" => &mut self.study_date,
            "patient_birth_date" => &mut self.patient_birth_date,
            "study_time" => &mut self.study_time,
            "patient_sex" => &mut self.patient_sex,
            "patient_name" => &mut self.patient_name,
            "patient_id" => &mut self.patient_id,
            "study_id" => &mut self.study_id,
            "accession_number" => &mut self.accession_number,
            "referring_physician" => &mut self.referring_physician,
            "position_reference_indicator" => &mut self.position_reference_indicator,
            _ => return None,
        })
    }

    /// Makes texts that are longer than their representation fit: cut off, or left out where the rest would name
    /// somebody or something else. Returns what was changed, for people to read, without any value of it.
    pub(crate) fn fit(&mut self) -> Vec<String> {
        let mut notes = Vec::new();
        for (kind, may_be_cut, field, name) in TEXTS {
            let Some(value) = self.field_of(field) else {
                continue;
            };
            let Some(fitted) = value.as_deref().and_then(|text| kind.fitted(text)) else {
                continue;
            };
            let done = if may_be_cut {
                "DICOM objects state its beginning"
            } else {
                "no DICOM object states it, since its beginning could name another"
            };
            let most = kind.most();
            notes.push(format!(
                "{name} is longer than {most} characters, which the standard allows; {done}."
            ));
            *value = may_be_cut.then_some(fitted);
        }
        notes
    }

    /// Writes identifiers, dates, times and sex as the standard does and takes out those that are none. Returns what
    /// was changed, for people to read, without any value of it.
    pub(crate) fn put_right(&mut self) -> Vec<String> {
        let mut notes = Vec::new();
        for (representation, field, name) in CHECKED_FIELDS {
            let Some(value) = self.field_of(field) else {
                continue;
            };
            let Some(text) = value.as_deref() else {
                continue;
            };
            let settled = representation.settled(text);
            if settled.as_deref() == Some(text) {
                continue;
            }
            notes.push(if settled.is_some() {
                format!("{name} is not written as the standard says; it was put right.")
            } else {
                let expected = representation.expected();
                format!("{name} is {expected}; it was left out, and no DICOM object states it.")
            });
            *value = settled;
        }
        // They stand for the slices in their order: one that is lost leaves none.
        if !self.instance_uids.iter().all(|uid| is_uid(uid)) {
            self.instance_uids.clear();
            self.sop_instance_uid = None;
        }
        notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_is_longer_than_its_representation() {
        for (kind, may_be_cut, field, name) in TEXTS {
            let (whole, long) = (
                "\u{e4}".repeat(kind.most()),
                "\u{e4}".repeat(kind.most() + 1),
            );
            let mut scan = Provenance::default();
            for fits in [&whole, "7", ""] {
                *scan.field_of(field).unwrap() = Some(fits.to_owned());
                assert_eq!(scan.fit(), Vec::<String>::new(), "{field}");
                assert_eq!(scan.stated(), [(field, fits)]);
            }
            *scan.field_of(field).unwrap() = Some(long);
            let notes = scan.fit();
            assert!(notes.len() == 1 && notes[0].starts_with(name), "{notes:?}");
            assert!(!notes[0].contains('\u{e4}'), "{notes:?}");
            let left = may_be_cut.then_some((field, &*whole));
            assert_eq!(scan.stated(), Vec::from_iter(left));
            assert_eq!(scan.fit(), Vec::<String>::new());
        }
    }

    #[test]
    fn every_checked_field_is_one_and_loses_what_is_no_value() {
        for (representation, field, name) in CHECKED_FIELDS {
            let mut scan = Provenance::default();
            *scan.field_of(field).unwrap() = Some("..".into());
            let notes = scan.put_right();
            assert!(notes.len() == 1 && notes[0].starts_with(name), "{notes:?}");
            assert_eq!(scan.stated(), []);
            let right = match representation {
                Representation::Uid => "1.2.3",
                Representation::Date => "20250310",
                Representation::Time => "091500",
                Representation::Sex => "F",
            };
            *scan.field_of(field).unwrap() = Some(right.into());
            assert_eq!(scan.put_right(), Vec::<String>::new());
            assert_eq!(scan.stated(), [(field, right)]);
        }
        let mut scan = Provenance {
            sop_instance_uid: Some("1.2.3".into()),
            instance_uids: vec!["1.2.3".into(), "..".into()],
            ..Provenance::default()
        };
        scan.put_right();
        assert!(scan.instance_uids.is_empty() && scan.sop_instance_uid.is_none());
    }
}
