//! Which texts are values of their representation, in what the objects made of a scan state (PS3.5 6.2 and 9.1).
//!
//! In: whose scan it is, as a file says it. Out: the same with dates, times and the patient's
//! sex written as the standard writes them, and without identifiers, dates and times that are none. A file may
//! hold anything; an archive refuses an object with such a value, or files it where nobody finds it.
//!
//! Texts may be longer than their representation. Objects state them as far as they fit ([`Provenance::fit`]), without
//! those that name a patient or an order: cut off, they would name another. The record of the scan keeps them whole,
//! since people look for what the header has.

use super::Provenance;

/// Longest UID, characters.
const LONGEST_UID: usize = 64;

/// Most digits of a fraction of a second.
const MOST_FRACTION_DIGITS: usize = 6;

/// The value representation of a text, as far as it is checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Representation {
    Uid,
    Date,
    Time,
    Sex,
}

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

/// The value representation of a text that may be too long.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Text {
    /// LO.
    Long,
    /// SH.
    Short,
    /// PN: up to three groups between equals signs.
    Name,
}

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

impl Text {
    /// Most characters of a value, of a name those of each group (PS3.5 6.2).
    fn most(self) -> usize {
        match self {
            Self::Long | Self::Name => 64,
            Self::Short => 16,
        }
    }

    /// As much of `text` as fits; `None` if all does.
    fn fitted(self, text: &str) -> Option<String> {
        let cut = |part: &str| -> String { part.chars().take(self.most()).collect() };
        let fitted = match self {
            Self::Name => text
                .split('=')
                .take(3)
                .map(cut)
                .collect::<Vec<_>>()
                .join("="),
            _ => cut(text),
        };
        (fitted != text).then(|| fitted.trim_end().to_owned())
    }
}

impl Representation {
    /// `text` as the standard writes it; `None` if it is no such value.
    fn settled(self, text: &str) -> Option<String> {
        let text = text.trim_matches(['\0', ' ']);
        match self {
            Self::Uid => is_uid(text).then(|| text.to_owned()),
            Self::Date => date(text),
            Self::Time => time(text),
            Self::Sex => sex(text),
        }
    }

    fn expected(self) -> &'static str {
        match self {
            Self::Uid => {
                "no UID (numbers without leading zeros, separated by dots, at most 64 characters)"
            }
            Self::Date => "no date (YYYYMMDD)",
            Self::Time => "no time (HHMMSS.FFFFFF)",
            Self::Sex => "not M, F or O",
        }
    }
}

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

/// Whether `text` is a unique identifier (PS3.5 section 9.1).
pub fn is_uid(text: &str) -> bool {
    let number = |part: &str| {
        let digits = !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
        digits && (part == "0" || !part.starts_with('0'))
    };
    text.len() <= LONGEST_UID && text.contains('.') && text.split('.').all(number)
}

/// Whether `text` is a date of the calendar as `YYYYMMDD`.
pub fn is_date(text: &str) -> bool {
    let number = |range: std::ops::Range<usize>| text.get(range)?.parse::<u32>().ok();
    let digits = text.len() == 8 && text.bytes().all(|b| b.is_ascii_digit());
    let (true, Some(year), Some(month), Some(day)) =
        (digits, number(0..4), number(4..6), number(6..8))
    else {
        return false;
    };
    let leap = year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    let days = match month {
        2 if leap => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => 0,
    };
    year > 0 && (1..=days).contains(&day)
}

/// The date that `text` states: `YYYYMMDD`, with dots, dashes or slashes, or with a time after it.
fn date(text: &str) -> Option<String> {
    let digits: String = match text.as_bytes() {
        [_, _, _, _, a @ (b'.' | b'-' | b'/'), _, _, b, _, _] if a == b => {
            text.split(char::from(*a)).collect()
        }
        [..] if text.len() > 8 && text.is_char_boundary(8) => {
            time(&text[8..])?;
            text[..8].to_owned()
        }
        _ => text.to_owned(),
    };
    is_date(&digits).then_some(digits)
}

/// The time of day that `text` states: `HH`, `HHMM`, `HHMMSS` or `HHMMSS.FFFFFF`, or with colons between the numbers.
fn time(text: &str) -> Option<String> {
    let (whole, fraction) = match text.split_once('.') {
        Some((whole, fraction)) => (whole, Some(fraction)),
        None => (text, None),
    };
    let parts: Vec<&str> = if whole.contains(':') {
        whole.split(':').collect()
    } else {
        let places = (0..whole.len()).step_by(2);
        places
            .map(|at| whole.get(at..at + 2))
            .collect::<Option<_>>()?
    };
    let numbers = parts.iter().zip([23, 59, 60]);
    let two_digits = |part: &str| part.len() == 2 && part.bytes().all(|b| b.is_ascii_digit());
    let valid = (1..=3).contains(&parts.len())
        && numbers.into_iter().all(|(part, most)| {
            two_digits(part) && part.parse::<u32>().is_ok_and(|number| number <= most)
        });
    let fraction = match fraction {
        None => None,
        Some(digits) if parts.len() == 3 && !digits.is_empty() => {
            let all = digits.bytes().all(|b| b.is_ascii_digit());
            Some(all.then(|| &digits[..digits.len().min(MOST_FRACTION_DIGITS)])?)
        }
        Some(_) => return None,
    };
    let fraction = fraction.map_or_else(String::new, |digits| format!(".{digits}"));
    valid.then(|| parts.concat() + &fraction)
}

/// The patient's sex that `text` states, in whatever letters.
fn sex(text: &str) -> Option<String> {
    let letter = match text.to_ascii_uppercase().as_str() {
        "M" | "MALE" => "M",
        "F" | "FEMALE" => "F",
        "O" | "OTHER" => "O",
        _ => return None,
    };
    Some(letter.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_numbers_between_dots() {
        for right in ["1.2", "1.2.840.10008.5.1.4.1.1.20", "2.25.0", "0.1"] {
            assert!(is_uid(right), "{right}");
        }
        for wrong in [
            "", ".", "..", "1", "1..2", "1.", ".1", "01.2", "1.02", "1.a", "1.2 ", "1.2\\1.3",
        ] {
            assert!(!is_uid(wrong), "{wrong}");
        }
        assert!(
            is_uid(&format!("1.{}", "2".repeat(62))) && !is_uid(&format!("1.{}", "2".repeat(63)))
        );
    }

    #[test]
    fn dates_and_times_are_put_right_or_left_out() {
        for (text, right) in [
            ("20240229", Some("20240229")),
            ("2025.03.10", Some("20250310")),
            ("2025-03-10", Some("20250310")),
            ("2025/03/10", Some("20250310")),
            ("20250310091500", Some("20250310")),
            ("20250229", None),
            ("20251310", None),
            ("20250400", None),
            ("00000000", None),
            ("2025.03-10", None),
            ("202503", None),
            ("10032025", None),
            ("20250310-20250311", None),
            ("2025\u{663}310", None),
            ("today", None),
        ] {
            assert_eq!(date(text).as_deref(), right, "{text}");
        }
        for (text, right) in [
            ("09", Some("09")),
            ("0915", Some("0915")),
            ("091500", Some("091500")),
            ("091500.123456", Some("091500.123456")),
            ("091500.12345678", Some("091500.123456")),
            ("09:15:00", Some("091500")),
            ("09:15", Some("0915")),
            ("09:15:00.5", Some("091500.5")),
            ("245000", None),
            ("096000", None),
            ("9", None),
            ("0915.5", None),
            ("091500.", None),
            ("morning", None),
            ("", None),
        ] {
            assert_eq!(time(text).as_deref(), right, "{text}");
        }
    }

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
        let group = "A".repeat(64);
        assert_eq!(Text::Name.fitted(&format!("{group}={group}={group}")), None);
        let long = format!("{group}B={group}={group}C=D");
        let cut = format!("{group}={group}={group}");
        assert_eq!(Text::Name.fitted(&long), Some(cut));
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
