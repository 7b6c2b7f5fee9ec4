//! The parameters of a reading: what a reader states of a stored result.

use super::{Kind, ParameterError, ParameterSpec, Parameters, groups};
use crate::base::text::is_printable;
use crate::heart::polar::SEGMENT_COUNT;
use serde_json::json;

/// Greatest score of a segment: no uptake.
pub const GREATEST_SCORE: u8 = 4;

/// Longest impression, characters.
const IMPRESSION_LENGTH: usize = 4000;
/// Longest sentence on the limits of the study, characters.
const LIMITS_LENGTH: usize = 1000;
/// Longest name of a reader, characters, as DICOM has it (PS3.5 6.2, PN).
const READER_LENGTH: usize = 64;

/// How good a study is for a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StudyQuality {
    /// Nothing limits the reading.
    Good,
    /// The reading is limited.
    Fair,
    /// The reading is hardly possible.
    Poor,
}

impl StudyQuality {
    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Fair => "fair",
            Self::Poor => "poor",
        }
    }
}

/// The score of each segment, 0 (normal) to 4 (no uptake), in their order.
pub type SegmentScores = [u8; SEGMENT_COUNT];

/// What a reader states.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ReadingParameters {
    /// Id of the result that is read.
    pub result: Option<String>,
    /// Id of the volume at rest of a comparison that is read: the reading goes with it, too.
    pub rest: Option<String>,
    /// Id of the reading that this one replaces.
    pub amends: Option<String>,
    /// Who reads.
    pub reader: Option<String>,
    /// When, RFC 3339 in UTC.
    pub read_at: Option<String>,
    /// Scores of a single scan.
    pub scores: Option<SegmentScores>,
    /// Scores at stress.
    pub stress_scores: Option<SegmentScores>,
    /// Scores at rest.
    pub rest_scores: Option<SegmentScores>,
    /// How good the study is.
    pub quality: Option<StudyQuality>,
    /// What limits the study.
    pub limits: Option<String>,
    /// The impression.
    pub impression: Option<String>,
}

impl Parameters for ReadingParameters {
    type Draft = Self;

    const PARAMETER_SPECS: &'static [ParameterSpec<Self>] = READING_SPECS;

    fn finish(reading: Self) -> Result<Self, ParameterError> {
        Ok(reading)
    }
}

/// Text of at most `length` characters, whose lines are printable.
fn prose(text: &str, length: usize) -> Result<Option<String>, String> {
    let text = text.trim();
    if text.chars().count() > length {
        return Err(format!("it has more than {length} characters"));
    }
    if !text.chars().all(|c| c == '\n' || is_printable(c)) {
        return Err("it has characters that cannot be printed".into());
    }
    Ok((!text.is_empty()).then(|| text.to_owned()))
}

fn name(text: &str) -> Result<String, String> {
    let name = text.trim();
    let known = (1..=READER_LENGTH).contains(&name.chars().count());
    if known && name.chars().all(|c| is_printable(c) && !"\\=".contains(c)) {
        return Ok(name.to_owned());
    }
    Err(format!(
        "a name has 1 to {READER_LENGTH} printable characters, without \\ and ="
    ))
}

/// `2026-11-30T22:15:00Z`.
fn moment(text: &str) -> Result<String, String> {
    const FORM: &[u8] = b"0000-00-00T00:00:00Z";
    let fits = |(given, form): (u8, &u8)| match form {
        b'0' => given.is_ascii_digit(),
        form => given == *form,
    };
    let known = text.len() == FORM.len() && text.bytes().zip(FORM).all(fits);
    match known {
        true => Ok(text.to_owned()),
        false => Err("a moment has the form 2026-11-30T22:15:00Z".into()),
    }
}

fn scores(list: &[i64]) -> Result<SegmentScores, String> {
    let mut scores = [0; SEGMENT_COUNT];
    for (score, given) in scores.iter_mut().zip(list) {
        *score = u8::try_from(*given)
            .ok()
            .filter(|score| *score <= GREATEST_SCORE)
            .ok_or_else(|| format!("{given} is no score from 0 to {GREATEST_SCORE}"))?;
    }
    Ok(scores)
}

/// A row for the scores of a scan.
macro_rules! scores_of {
    ($name:literal, $field:ident, $summary:literal) => {
        ParameterSpec {
            name: $name,
            title: "",
            group: groups::MAIN,
            unit: "",
            kind: Kind::Integers {
                count: SEGMENT_COUNT,
            },
            default: "",
            summary: $summary,
            read: |d, v| {
                d.$field = Some(scores(v.integers())?);
                Ok(())
            },
            write: |p| json!(p.$field),
        }
    };
}

/// A row for the id of something that a service stores.
macro_rules! stored {
    ($name:literal, $field:ident, $prefixes:expr, $summary:literal) => {
        ParameterSpec {
            name: $name,
            title: "",
            group: groups::MAIN,
            unit: "",
            kind: Kind::Stored {
                prefixes: $prefixes,
                word: "",
                more: 0,
            },
            default: "",
            summary: $summary,
            read: |d, v| {
                d.$field = Some(v.text().into());
                Ok(())
            },
            write: |p| json!(p.$field),
        }
    };
}

/// A row for text.
macro_rules! written {
    ($name:literal, $field:ident, $read:expr, $pattern:literal, $example:literal, $summary:literal) => {
        ParameterSpec {
            name: $name,
            title: "",
            group: groups::MAIN,
            unit: "",
            kind: Kind::Text {
                pattern: $pattern,
                example: $example,
            },
            default: "",
            summary: $summary,
            read: |d, v| {
                d.$field = $read(v.text())?;
                Ok(())
            },
            write: |p| json!(p.$field),
        }
    };
}

/// Every parameter of a reading.
pub const READING_SPECS: &[ParameterSpec<ReadingParameters>] = &[
    stored!(
        "result",
        result,
        &["cmp_", "seg_", "bea_"],
        "Id of the comparison, segmentation or beat that is read"
    ),
    stored!(
        "rest",
        rest,
        &["vol_"],
        "Id of the volume at rest of the comparison that is read"
    ),
    stored!(
        "amends",
        amends,
        &["rdg_"],
        "Id of the reading of the same result that this one replaces; it is kept"
    ),
    written!(
        "reader",
        reader,
        |text| name(text).map(Some),
        "^[^\\\\=\\x00-\\x1f]{1,64}$",
        "Doe^Jane^^Dr.",
        "Who reads: a name as DICOM writes it, family name first, parts separated by ^"
    ),
    written!(
        "read_at",
        read_at,
        |text| moment(text).map(Some),
        "^\\d{4}-\\d\\d-\\d\\dT\\d\\d:\\d\\d:\\d\\dZ$",
        "2026-11-30T22:15:00Z",
        "When it was read, UTC"
    ),
    scores_of!(
        "scores",
        scores,
        "Scores of the 17 segments of a single scan in their order, 0 (normal) to 4 (no uptake)"
    ),
    scores_of!(
        "stress_scores",
        stress_scores,
        "Scores of the 17 segments at stress"
    ),
    scores_of!(
        "rest_scores",
        rest_scores,
        "Scores of the 17 segments at rest"
    ),
    ParameterSpec {
        name: "quality",
        title: "",
        group: groups::MAIN,
        unit: "",
        kind: Kind::Choice(&["good", "fair", "poor"]),
        default: "",
        summary: "How good the study is for a reading",
        read: |d, v| {
            d.quality = Some(match v.text() {
                "good" => StudyQuality::Good,
                "fair" => StudyQuality::Fair,
                _ => StudyQuality::Poor,
            });
            Ok(())
        },
        write: |p| json!(p.quality.map(StudyQuality::as_str)),
    },
    written!(
        "limits",
        limits,
        |text| prose(text, LIMITS_LENGTH),
        "^[^\\x00-\\x09\\x0b-\\x1f]{0,1000}$",
        "Gut beside the inferior wall.",
        "What limits the study; it must not name the patient"
    ),
    written!(
        "impression",
        impression,
        |text| prose(text, IMPRESSION_LENGTH),
        "^[^\\x00-\\x09\\x0b-\\x1f]{0,4000}$",
        "No perfusion defect.",
        "The impression; it must not name the patient"
    ),
];

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;
    use serde_json::{Map, Value};

    const SCORES: &str = "0,1,2,3,4,0,0,0,0,0,0,0,0,0,0,0,1";

    #[test]
    fn written_parameters_read_back_unchanged() {
        let given = [
            ("result", "cmp_2c26b46b68ffc68ff99b453c1d304134"),
            ("rest", "vol_2c26b46b68ffc68ff99b453c1d304134"),
            ("amends", "rdg_2c26b46b68ffc68ff99b453c1d304134"),
            ("reader", "Doe^Jane"),
            ("read_at", "2026-11-30T22:15:00Z"),
            ("scores", SCORES),
            ("stress_scores", SCORES),
            ("rest_scores", SCORES),
            ("quality", "fair"),
            ("limits", "Gut."),
            ("impression", "One line.\nAnother."),
        ];
        let reading = ReadingParameters::from_pairs(given).unwrap();
        assert_eq!(reading.stress_scores.unwrap()[4], 4);
        let json: Map<String, Value> = reading.to_json();
        assert_eq!(ReadingParameters::from_json(&json).unwrap(), reading);
        checks::table_states_defaults::<ReadingParameters>();
    }

    #[test]
    fn what_is_no_statement_is_refused_by_field() {
        let long = "x".repeat(4001);
        for (name, value) in [
            ("result", "vol_2c26b46b68ffc68ff99b453c1d304134"),
            ("scores", "0,1"),
            ("scores", "0,1,2,3,5,0,0,0,0,0,0,0,0,0,0,0,1"),
            ("scores", "0,1,2,3,-1,0,0,0,0,0,0,0,0,0,0,0,1"),
            ("reader", " "),
            ("reader", "a\\b"),
            ("read_at", "yesterday"),
            ("quality", "splendid"),
            ("impression", "a\u{7}b"),
            ("impression", &long),
        ] {
            let refused = ReadingParameters::from_pairs([(name, value)]).unwrap_err();
            assert_eq!(refused.field, name, "{value}");
        }
    }
}
