//! The parameters by which the list of volumes is searched, filtered and ordered, over all that are stored.
//!
//! A caller of the scope `read` does not see whose scan a volume is, nor what people call it. So its words are looked
//! for in texts without these, and what would tell them by trial is refused: orders by them, dates of studies, Patient
//! IDs.

use crate::edge::caller::Caller;
use crate::resources::scans::{VALUE_LENGTH, is_value, sees_patients};
use crate::wire::problem::Answer;
use crate::wire::query::{Moment, parsed};
use crate::wire::words::{JobOnScanName, MadeOfScanName, ScanOrderName, WhichScanName};
use serde::{Deserialize, Deserializer};
use utoipa::IntoParams;
use ventriform::base::text::is_printable;
use ventriform_service::base::records::{ScanSearch, SearchedWords, parse_rfc3339};
use ventriform_service::callers::Scope;

/// Longest text that is searched for, characters.
const SEARCH_LENGTH: usize = 128;

/// Most words that are searched for.
const MOST_WORDS: usize = 8;

/// A search of the list of volumes, its filters, and its order.
#[derive(Default, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ScanListQuery {
    /// Only volumes about which each of these words is found, as a part of a text: id, format, modality, tracer, rest or
    /// stress, the begin of a result's id; for callers who see whose scan a volume is also `external_id`, labels as
    /// NAME:VALUE, patient's name and ID, study date, accession number, descriptions of study and series
    #[serde(default, deserialize_with = "words")]
    #[param(value_type = Option<String>, pattern = "^.{1,128}$")]
    search: Option<Vec<String>>,
    /// The order: the newest or the largest first, the latest study first, by patient, or by the caller's own name for it
    #[param(inline)]
    order: Option<ScanOrderName>,
    /// Only volumes of which this was made
    #[param(inline)]
    made: Option<MadeOfScanName>,
    /// Only volumes with such a job
    #[param(inline)]
    job: Option<JobOnScanName>,
    /// Only volumes of this modality, such as `NM`
    #[serde(default, deserialize_with = "value")]
    #[param(value_type = Option<String>, pattern = "^.{1,64}$")]
    modality: Option<String>,
    /// Only volumes of scans at rest, or at stress
    #[param(inline)]
    rest_or_stress: Option<WhichScanName>,
    /// Only volumes with this Patient ID; not for the scope `read`
    #[serde(default, deserialize_with = "value")]
    #[param(value_type = Option<String>, pattern = "^.{1,64}$")]
    patient: Option<String>,
    /// Only volumes with a Study Date from this day on (YYYY-MM-DD); not for the scope `read`
    #[serde(default, deserialize_with = "day")]
    #[param(value_type = Option<String>, format = Date)]
    study_date_from: Option<String>,
    /// Only volumes with a Study Date up to this day (YYYY-MM-DD); not for the scope `read`
    #[serde(default, deserialize_with = "day")]
    #[param(value_type = Option<String>, format = Date)]
    study_date_to: Option<String>,
    /// Only volumes stored after this moment (RFC 3339)
    #[param(value_type = Option<String>, format = DateTime)]
    created_after: Option<Moment>,
    /// Only volumes stored before this moment (RFC 3339)
    #[param(value_type = Option<String>, format = DateTime)]
    created_before: Option<Moment>,
}

impl ScanListQuery {
    /// The search, as far as its caller may search.
    ///
    /// # Errors
    /// 403 if it would tell the caller what it may not see.
    pub fn search(self, caller: &Caller) -> Answer<ScanSearch> {
        let sees = sees_patients(caller.scope);
        let search = ScanSearch {
            words: self.search.map(|words| SearchedWords {
                words,
                personal: sees,
            }),
            order: self.order.map(|word| word.0).unwrap_or_default(),
            made: self.made.map(|word| word.0),
            job: self.job.map(|word| word.0),
            modality: self.modality,
            rest_or_stress: self.rest_or_stress.map(|word| word.0),
            patient: self.patient,
            study_date_from: self.study_date_from,
            study_date_to: self.study_date_to,
            created_after: self.created_after.map(|moment| moment.0),
            created_before: self.created_before.map(|moment| moment.0),
        };
        let personal = [
            ("order", search.order.is_personal()),
            ("patient", search.patient.is_some()),
            ("study_date_from", search.study_date_from.is_some()),
            ("study_date_to", search.study_date_to.is_some()),
        ];
        match personal.iter().find(|(_, given)| *given && !sees) {
            Some((name, _)) => {
                let refused = caller.require(Scope::Submit).map(|()| search);
                refused.map_err(|problem| problem.at(*name))
            }
            None => Ok(search),
        }
    }
}

fn words<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<String>>, D::Error> {
    let expected =
        format!("1 to {MOST_WORDS} words, together at most {SEARCH_LENGTH} printable characters");
    let read = |text: &str| {
        let is_read = text.chars().count() <= SEARCH_LENGTH && text.chars().all(is_printable);
        let words: Vec<_> = text.split_whitespace().map(str::to_owned).collect();
        (is_read && (1..=MOST_WORDS).contains(&words.len())).then_some(words)
    };
    parsed(deserializer, read, &expected).map(Some)
}

fn value<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    let expected =
        format!("1 to {VALUE_LENGTH} printable characters, as the DICOM header has them");
    let read = |text: &str| is_value(text).then(|| text.to_owned());
    parsed(deserializer, read, &expected).map(Some)
}

/// A day as headers write it.
fn day<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    let read = |text: &str| {
        let is_day = text.len() == 10 && parse_rfc3339(&format!("{text}T00:00:00Z")).is_some();
        is_day.then(|| text.replace('-', ""))
    };
    parsed(
        deserializer,
        read,
        "a day as YYYY-MM-DD, such as 2026-11-22",
    )
    .map(Some)
}
