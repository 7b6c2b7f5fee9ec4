//! Whose scan a volume is: read when the volume is stored, shown in answers as `dicom`, and searched
//! by `study`, `series` and `accession`.
//!
//! Fields that name a patient (name, ID, dates, accession number, free texts) are shown to callers of the
//! scope `submit` and `admin`; `read` sees identifiers of DICOM, the acquisition and the equipment.
//! None of it gets into a path, a header or the log.

use crate::wire::query::parsed;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};
use utoipa::{IntoParams, ToSchema};
use ventriform::base::text::is_printable;
use ventriform_service::base::records::{ScanFilter, ScanIdentity};
use ventriform_service::callers::Scope;

/// A search by scan.
#[derive(Default, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ScanQuery {
    /// Only of the study with this Study Instance UID
    #[serde(default, deserialize_with = "value")]
    #[param(pattern = "^.{1,64}$")]
    study: Option<String>,
    /// Only of the series with this Series Instance UID
    #[serde(default, deserialize_with = "value")]
    #[param(pattern = "^.{1,64}$")]
    series: Option<String>,
    /// Only of scans with this Accession Number
    #[serde(default, deserialize_with = "value")]
    #[param(pattern = "^.{1,64}$")]
    accession: Option<String>,
}

impl From<ScanQuery> for ScanFilter {
    fn from(query: ScanQuery) -> Self {
        Self {
            study: query.study,
            series: query.series,
            accession: query.accession,
        }
    }
}

fn value<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    let expected =
        format!("1 to {VALUE_LENGTH} printable characters, as the DICOM header has them");
    let read = |text: &str| is_value(text).then(|| text.to_owned());
    parsed(deserializer, read, &expected).map(Some)
}

/// Whether a text can be the value of an identifier in a header.
pub fn is_value(text: &str) -> bool {
    let length = text.chars().count();
    (1..=VALUE_LENGTH).contains(&length) && text.chars().all(is_printable)
}

/// Longest value of a parameter, characters: that of a UID.
pub const VALUE_LENGTH: usize = 64;

/// The fields that callers of the scope `read` see: identifiers that DICOM systems exchange, the
/// acquisition and the equipment.
const READABLE_FIELDS: [&str; 17] = [
    "study_uid",
    "series_uid",
    "series_number",
    "modality",
    "image_type",
    "frame_of_reference_uid",
    "position_reference_indicator",
    "sop_class_uid",
    "sop_instance_uid",
    "radiopharmaceutical",
    "radionuclide",
    "injected_dose",
    "manufacturer",
    "model_name",
    "software_versions",
    "reconstruction_method",
    "rest_or_stress",
];

/// Shown by `/identity` only: a series may have hundreds.
const INSTANCES_FIELD: &str = "instance_uids";

/// Study, series and Frame of Reference of a scan.
#[derive(Serialize, ToSchema)]
#[schema(as = ScanUids)]
pub struct ScanUidsBody {
    /// Study Instance UID.
    #[schema(example = "1.2.840.99999.1.1")]
    study_uid: Option<String>,
    /// Series Instance UID.
    #[schema(example = "1.2.840.99999.1.2")]
    series_uid: Option<String>,
    /// Frame of Reference UID.
    #[schema(example = "1.2.840.99999.1.3")]
    frame_of_reference_uid: Option<String>,
}

impl ScanUidsBody {
    /// Those that are known; `None` if nothing is.
    pub fn from_scan(scan: &ScanIdentity) -> Option<Self> {
        let text = |name| {
            scan.text(name)
                .filter(|uid| is_formed(uid))
                .map(str::to_owned)
        };
        (!scan.is_empty()).then(|| Self {
            study_uid: text("study_uid"),
            series_uid: text("series_uid"),
            frame_of_reference_uid: text("frame_of_reference_uid"),
        })
    }
}

/// The fields of a scan that a caller of that scope sees, without its instances; `None` if nothing is known.
pub fn shown(scan: &ScanIdentity, scope: Scope) -> Option<Map<String, Value>> {
    if scan.is_empty() {
        return None;
    }
    let mut shown = scan.whole();
    shown.remove(INSTANCES_FIELD);
    if !sees_patients(scope) {
        shown.retain(|name, value| {
            let is_uid = name.ends_with("_uid");
            READABLE_FIELDS.contains(&name.as_str())
                && (!is_uid || value.as_str().is_some_and(is_formed))
        });
    }
    Some(shown)
}

/// Whether a UID is one, and no text in its place.
fn is_formed(uid: &str) -> bool {
    uid.len() <= VALUE_LENGTH && uid.bytes().all(|b| b.is_ascii_digit() || b == b'.')
}

/// Whether callers of that scope see whose scan a volume is.
pub fn sees_patients(scope: Scope) -> bool {
    scope.includes(Scope::Submit)
}
