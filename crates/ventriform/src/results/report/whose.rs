//! The part of a page that says whose scan it shows.

use crate::image::draw::text::leaves;
use crate::image::volume::Provenance;
use maud::{Markup, html};
use serde_json::json;
use ventriform_dicom::values::dashed_date;

/// Patient, study and series of `scan`, as far as they are known; nothing where none is. What is to be
/// shown to whom is decided before: an absent field is left out.
pub(super) fn section(scan: Option<&Provenance>) -> Markup {
    let Some(scan) = scan else {
        return html! {};
    };
    let undecoded = scan.undecoded.join(", ");
    let name = |name: &Option<String>| name.as_deref().map(person);
    let date = |date: &Option<String>| date.as_deref().map(day);
    let tables = [
        (
            "Patient",
            json!({
                "name": name(&scan.patient_name),
                "ID": scan.patient_id,
                "birth date": date(&scan.patient_birth_date),
                "sex": scan.patient_sex,
            }),
        ),
        (
            "Study",
            json!({
                "date": date(&scan.study_date),
                "time": scan.study_time.as_deref().map(clock_time),
                "description": scan.study_description,
                "study ID": scan.study_id,
                "accession number": scan.accession_number,
                "referring physician": name(&scan.referring_physician),
                "UID": scan.study_uid,
            }),
        ),
        (
            "Series",
            json!({
                "modality": scan.modality,
                "number": scan.series_number,
                "description": scan.series_description,
                "rest or stress": scan.rest_or_stress,
                "UID": scan.series_uid,
                "not legible in the file": Some(undecoded).filter(|names| !names.is_empty()),
            }),
        ),
    ];
    let known = tables.map(|(title, value)| {
        let fields = value.as_object().into_iter().flatten();
        let known = fields.filter(|(_, value)| !value.is_null());
        let known: serde_json::Map<_, _> = known.map(|(n, v)| (n.clone(), v.clone())).collect();
        (title, serde_json::Value::from(known))
    });
    let filled = known
        .iter()
        .filter(|(_, value)| value.as_object().is_some_and(|map| !map.is_empty()));
    let mut filled = filled.peekable();
    html! {
        @if filled.peek().is_some() {
            section id="whose" {
                h2 { "Whose scan this is" }
                div.row {
                    @for (title, value) in filled {
                        div {
                            h3 { (title) }
                            table {
                                tbody {
                                    @for (name, text) in leaves(value) {
                                        tr { th scope="row" { (name) } td { (text) } }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Patient and studies of `scans`, each with its name, a sentence each, for a picture: without UIDs. One study of all
/// scans is named once. Nothing where nothing is known.
pub(super) fn sentences(scans: &[(&str, &Provenance)]) -> Vec<String> {
    let Some((_, first)) = scans.first() else {
        return Vec::new();
    };
    let field = |name: &str, value: Option<String>| value.map(|value| format!("{name} {value}"));
    let whole = |value: &Option<String>| value.clone().filter(|value| !value.trim().is_empty());
    let name = |value: &Option<String>| {
        let name = value.as_deref().map(person);
        name.filter(|name| !name.is_empty())
    };
    let patient = [
        name(&first.patient_name),
        field("ID", whole(&first.patient_id)),
        field(
            "born",
            whole(&first.patient_birth_date).map(|date| day(&date)),
        ),
        field("sex", whole(&first.patient_sex)),
    ];
    let study = |scan: &Provenance| {
        let fields = [
            whole(&scan.study_date).map(|date| day(&date)),
            whole(&scan.study_description),
            field("study ID", whole(&scan.study_id)),
            field("accession number", whole(&scan.accession_number)),
            field("referring physician", name(&scan.referring_physician)),
        ];
        joined(fields)
    };
    let mut sentences: Vec<String> = joined(patient)
        .map(|patient| format!("Patient: {patient}"))
        .into_iter()
        .collect();
    let one_study = scans
        .iter()
        .all(|(_, scan)| scan.study_uid == first.study_uid);
    let studies = if one_study { &scans[..1] } else { scans };
    for (name, scan) in studies {
        let of = if one_study {
            String::new()
        } else {
            format!(" at {name}")
        };
        sentences.extend(study(scan).map(|study| format!("Study{of}: {study}")));
    }
    sentences
}

fn joined<const N: usize>(fields: [Option<String>; N]) -> Option<String> {
    let known: Vec<String> = fields.into_iter().flatten().collect();
    (!known.is_empty()).then(|| known.join(" · "))
}

/// A person's name as people write it: the family's name first, a comma, the others (DICOM separates by `^`, and
/// writings of one name by `=`).
pub(super) fn person(name: &str) -> String {
    let writing = |writing: &str| {
        let parts = writing.split('^').map(str::trim);
        let mut parts = parts.filter(|part| !part.is_empty());
        let family = parts.next().unwrap_or_default().to_owned();
        let others: Vec<&str> = parts.collect();
        if others.is_empty() {
            family
        } else {
            format!("{family}, {}", others.join(" "))
        }
    };
    let writings = name.split('=').map(writing);
    let written: Vec<String> = writings.filter(|writing| !writing.is_empty()).collect();
    written.join(" = ")
}

/// A date (`YYYYMMDD`) with hyphens; any other text as it is.
fn day(date: &str) -> String {
    dashed_date(date).unwrap_or_else(|| date.to_owned())
}

/// A time (`HHMMSS.FFFFFF`, as far as it is stated) to the minute; any other text as it is.
fn clock_time(time: &str) -> String {
    match time.as_bytes() {
        [a, b, c, d, ..] if [a, b, c, d].iter().all(|byte| byte.is_ascii_digit()) => {
            format!("{}:{}", &time[..2], &time[2..4])
        }
        _ => time.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_is_named_and_escaped() {
        let scan = Provenance {
            patient_name: Some("Doe^<Jane>".into()),
            patient_id: Some("4711".into()),
            study_date: Some("20260101".into()),
            study_time: Some("091233.5".into()),
            series_uid: Some("1.2.3".into()),
            undecoded: vec!["referring_physician".into()],
            ..Provenance::default()
        };
        let page = section(Some(&scan)).into_string();
        for shown in [
            "Doe, &lt;Jane&gt;",
            "4711",
            "2026-01-01",
            "09:12",
            "1.2.3",
            "referring_physician",
        ] {
            assert!(page.contains(shown), "{shown}: {page}");
        }
        assert!(
            !page.contains("accession") && !page.contains("null"),
            "{page}"
        );
        for nothing in [None, Some(&Provenance::default())] {
            assert_eq!(section(nothing).into_string(), "");
        }
    }

    #[test]
    fn a_picture_names_patient_and_studies() {
        let some = |text: &str| Some(text.to_owned());
        let stress = Provenance {
            patient_name: some("Müller^Jürgen^^Dr."),
            patient_id: some("P-17"),
            patient_birth_date: some("19500203"),
            study_uid: some("1.2"),
            study_date: some("20250115"),
            accession_number: some("A1"),
            ..Provenance::default()
        };
        let rest = Provenance {
            study_date: some("20250116"),
            ..stress.clone()
        };
        let patient = "Patient: Müller, Jürgen Dr. · ID P-17 · born 1950-02-03";
        assert_eq!(
            sentences(&[("stress", &stress), ("rest", &rest)]),
            [patient, "Study: 2025-01-15 · accession number A1"]
        );
        let other = Provenance {
            study_uid: some("1.3"),
            ..rest
        };
        assert_eq!(
            sentences(&[("stress", &stress), ("rest", &other)]),
            [
                patient,
                "Study at stress: 2025-01-15 · accession number A1",
                "Study at rest: 2025-01-16 · accession number A1"
            ]
        );
        let nobody = Provenance {
            patient_name: some(" ^^ ="),
            study_uid: some("1.2"),
            series_description: some("SA"),
            ..Provenance::default()
        };
        assert_eq!(sentences(&[("", &nobody)]), Vec::<String>::new());
        assert_eq!(
            person("Yamada^Tarou=山田^太郎="),
            "Yamada, Tarou = 山田, 太郎"
        );
        assert_eq!(person("^Jürgen"), "Jürgen");
        assert_eq!(day("about 1950"), "about 1950");
    }
}
