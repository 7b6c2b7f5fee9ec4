//! Result documents without text of the scans' headers.
//!
//! Whose scan a volume is may be erased, and not everybody who may read a result may see it. A store therefore keeps
//! results without what headers say: series descriptions, tracers, doses and dates of compared scans, the values that a flag
//! compares, and the codes, names of structures and names of files that a warning quotes. Pages and objects are given
//! it when they are made ([`ComparisonReport::with_scans`], [`SerialReport::with_scans`]). Sentences are told by how they begin.

use super::comparison_report::{ComparedScan, ComparisonReport};
use super::serial_report::SerialReport;
use crate::image::volume::Provenance;
use serde_json::{Map, Value};
use std::borrow::Cow;

/// Beginnings of warnings that quote, and what is said instead.
const QUOTING_WARNINGS: [(&str, &str); 5] = [
    (
        "Specific Character Set (0008,0005) has the value ",
        "Specific Character Set (0008,0005) has a value that DICOM does not define: only text of ASCII is read.",
    ),
    (
        "A file was left out: ",
        "A file was left out, since it holds no slices.",
    ),
    (
        "Files that are neither NIfTI nor DICOM were left out: ",
        "Files that are neither NIfTI nor DICOM were left out.",
    ),
    (
        "Files without content were left out: ",
        "Files without content were left out.",
    ),
    (
        "Of the expert's mask, ",
        "Of the expert's mask, one structure was compared; it holds other structures too.",
    ),
];

/// The fields of a compared scan that hold text of its header.
const SCAN_FIELDS: [&str; 4] = [
    "series_description",
    "radiopharmaceutical",
    "injected_dose",
    "date",
];

/// A warning about a file without the values, names of structures and names of files that it quotes.
pub fn warning(text: &str) -> Cow<'_, str> {
    let mut known = QUOTING_WARNINGS.iter();
    if let Some((_, instead)) = known.find(|(begin, _)| text.starts_with(begin)) {
        return Cow::Borrowed(instead);
    }
    // Why a text cannot be decoded, with the term that names no set.
    match text.split_once(" cannot be decoded: ") {
        Some((attribute, reason)) => match reason.split_once(": \"") {
            Some((reason, _)) => format!("{attribute} cannot be decoded: {reason}.").into(),
            None => text.into(),
        },
        None => text.into(),
    }
}

/// The reason of a flag without the values of both headers that it compares.
fn reason<'a>(code: &str, text: &'a str) -> Cow<'a, str> {
    let cut = |at: &str| text.split_once(at).map(|(before, _)| before);
    match code {
        "made_otherwise" => {
            let scans = match text.contains(" in scan 1, ") {
                true => "the scans",
                false => "stress and rest",
            };
            cut(" differs: ").map(|field| format!("{field} differs between {scans}").into())
        }
        "not_comparable" => cut(": the tracer is ")
            .map(|before| format!("{before}: the headers name two tracers").into()),
        "not_stated" => cut(", and that of the other scan says: ").map(|before| {
            format!("{before}, and that of the other scan does; make sure that they are alike")
                .into()
        }),
        _ => None,
    }
    .unwrap_or(Cow::Borrowed(text))
}

impl ComparisonReport {
    /// The report without text of the scans' headers.
    #[must_use]
    pub fn without_header_text(mut self) -> Self {
        for scan in [&mut self.stress, &mut self.rest] {
            (scan.series_description, scan.radiopharmaceutical) = (None, None);
            scan.injected_dose = None;
            for warnings in [&mut scan.warnings, &mut scan.input.warnings] {
                for text in warnings {
                    *text = warning(text).into_owned();
                }
            }
        }
        for flag in &mut self.flags {
            flag.reason = reason(&flag.code, &flag.reason).into_owned();
        }
        self
    }

    /// The report with what is to be shown of the scans at stress and at rest.
    #[must_use]
    pub fn with_scans(mut self, [stress, rest]: [&Provenance; 2]) -> Self {
        let fill = |own: &mut ComparedScan, scan: &Provenance| {
            own.series_description.clone_from(&scan.series_description);
            own.radiopharmaceutical
                .clone_from(&scan.radiopharmaceutical);
            own.injected_dose = scan.injected_dose_mbq();
        };
        fill(&mut self.stress, stress);
        fill(&mut self.rest, rest);
        self
    }
}

impl SerialReport {
    /// The report with what is to be shown of its scans, which stand in the order in which they were given.
    #[must_use]
    pub fn with_scans(mut self, scans: &[Provenance]) -> Self {
        for own in &mut self.scans {
            let Some(scan) = own.given.checked_sub(1).and_then(|at| scans.get(at)) else {
                continue;
            };
            own.series_description.clone_from(&scan.series_description);
            own.date = scan.day();
        }
        self
    }
}

/// What a document that holds text of headers contains.
const SIGNS: [&str; 11] = [
    "\"date\": \"",
    "\"series_description\": \"",
    "\"radiopharmaceutical\": \"",
    "\"injected_dose\": \"",
    " has the value ",
    "left out: ",
    "Of the expert's mask, ",
    " cannot be decoded: ",
    " differs: ",
    "the tracer is ",
    "other scan says: ",
];

/// The document of a result, as JSON, without text of headers; `None` if it holds none, or is none.
pub fn withheld(document: &[u8]) -> Option<Vec<u8>> {
    let text = std::str::from_utf8(document).ok()?;
    let quotes = SIGNS.iter().any(|sign| text.contains(sign));
    let mut object: Map<String, Value> = quotes.then(|| serde_json::from_str(text).ok())??;
    let held = withhold(&mut object);
    let written = held.then(|| serde_json::to_string_pretty(&object).ok())??;
    Some(format!("{written}\n").into_bytes())
}

/// Takes text of headers out of the document of any result, or of its main figures. `false` if it held none.
pub fn withhold(document: &mut Map<String, Value>) -> bool {
    let mut held = false;
    for (name, value) in document {
        held |= match (name.as_str(), value) {
            ("warnings", Value::Array(warnings)) => {
                let mut changed = false;
                for text in warnings {
                    changed |= replace(text, warning);
                }
                changed
            }
            ("flags", Value::Array(flags)) => flags
                .iter_mut()
                .fold(false, |changed, flag| changed | withhold_reason(flag)),
            (name, value) if SCAN_FIELDS.contains(&name) && value.is_string() => {
                *value = Value::Null;
                true
            }
            (_, value) => withhold_within(value),
        };
    }
    held
}

fn withhold_within(value: &mut Value) -> bool {
    match value {
        Value::Object(object) => withhold(object),
        Value::Array(values) => values
            .iter_mut()
            .fold(false, |changed, value| changed | withhold_within(value)),
        _ => false,
    }
}

fn withhold_reason(flag: &mut Value) -> bool {
    let code = flag.get("code").and_then(Value::as_str);
    let Some(code) = code.map(str::to_owned) else {
        return false;
    };
    let told = flag.get_mut("reason");
    told.is_some_and(|told| replace(told, |text| reason(&code, text)))
}

/// Replaces a text if it becomes another one.
fn replace(value: &mut Value, by: impl Fn(&str) -> Cow<'_, str>) -> bool {
    let Value::String(text) = value else {
        return false;
    };
    match by(text) {
        other if other != *text => {
            *value = Value::String(other.into_owned());
            true
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heart::comparison::{ComparisonFlag, Reason, WhichScan};
    use crate::results::report::RaisedFlag;
    use crate::results::report::comparison_report::tests::first_comparison;

    /// Text of a header.
    const MARK: &str = "MARK differs: x, says: y";

    #[test]
    fn no_flag_and_no_warning_keeps_the_text_that_it_quotes() {
        let text = || MARK.to_owned();
        let flags = [
            ComparisonFlag::MadeOtherwise {
                field: "the filter",
                stress: text(),
                rest: text(),
            },
            ComparisonFlag::NotComparable(Reason::Tracer {
                stress: text(),
                rest: text(),
            }),
            ComparisonFlag::NotStated {
                scan: WhichScan::Rest,
                field: "tracer",
                other: text(),
            },
            ComparisonFlag::RoleNotStated {
                scan: WhichScan::Rest,
            },
        ];
        let mut report = first_comparison();
        report.flags = flags
            .iter()
            .map(|flag| RaisedFlag::new(flag.code(), flag))
            .collect();
        report.stress.warnings = QUOTING_WARNINGS
            .map(|(begin, _)| format!("{begin}{MARK}"))
            .into();
        report.rest.input.warnings = vec![format!(
            "Patient's Name (0010,0010) cannot be decoded: byte 3 is not ASCII: \"{MARK}\" is no defined term."
        )];
        report.stress.series_description = Some(text());
        report.rest.radiopharmaceutical = Some(text());
        let whole = serde_json::to_value(&report).unwrap();
        let mut stripped = whole.as_object().unwrap().clone();
        assert!(withhold(&mut stripped));
        assert!(!withhold(&mut stripped.clone()), "once is enough");
        let typed = report.clone().without_header_text();
        assert_eq!(
            Value::Object(stripped),
            serde_json::to_value(&typed).unwrap()
        );
        let written = serde_json::to_vec_pretty(&report).unwrap();
        let stored = withheld(&written).unwrap();
        assert_eq!(
            serde_json::from_slice::<Value>(&stored).unwrap(),
            serde_json::to_value(&typed).unwrap()
        );
        assert_eq!(withheld(&stored), None);
        let shown = serde_json::to_string(&typed).unwrap();
        assert!(!shown.contains("MARK"), "{shown}");
        assert_eq!(typed.flags[3], report.flags[3], "what quotes nothing stays");
        let scan = Provenance {
            series_description: Some("REST".into()),
            radiopharmaceutical: Some("Tc-99m".into()),
            ..Provenance::default()
        };
        let filled = typed.with_scans([&Provenance::default(), &scan]);
        assert_eq!(filled.rest.series_description.as_deref(), Some("REST"));
        assert_eq!(filled.stress.radiopharmaceutical, None);
    }
}
