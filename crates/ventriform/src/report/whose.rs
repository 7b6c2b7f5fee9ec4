//! The part of a page that says whose scan it shows.

use crate::draw::text::leaves;
use crate::volume::Provenance;
use maud::{Markup, html};
use serde_json::json;

/// Patient, study and series of `scan`, as far as they are known; nothing where none is. What is to be
/// shown to whom is decided before: an absent field is left out.
pub(super) fn section(scan: Option<&Provenance>) -> Markup {
    let Some(scan) = scan else {
        return html! {};
    };
    let undecoded = scan.undecoded.join(", ");
    let tables = [
        (
            "Patient",
            json!({
                "name": scan.patient_name,
                "ID": scan.patient_id,
                "birth date": scan.patient_birth_date,
                "sex": scan.patient_sex,
            }),
        ),
        (
            "Study",
            json!({
                "date": scan.study_date,
                "time": scan.study_time,
                "description": scan.study_description,
                "study ID": scan.study_id,
                "accession number": scan.accession_number,
                "referring physician": scan.referring_physician,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_is_named_and_escaped() {
        let scan = Provenance {
            patient_name: Some("Doe^<Jane>".into()),
            patient_id: Some("4711".into()),
            study_date: Some("20260101".into()),
            series_uid: Some("1.2.3".into()),
            undecoded: vec!["referring_physician".into()],
            ..Provenance::default()
        };
        let page = section(Some(&scan)).into_string();
        for shown in [
            "Doe^&lt;Jane&gt;",
            "4711",
            "20260101",
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
}
