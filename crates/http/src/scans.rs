//! Whose scan a volume is: read when the volume is stored, shown in answers as `dicom`, and searched
//! by `study`, `series` and `accession`.
//!
//! Fields that name a patient (name, ID, dates, accession number, free texts) are shown to callers of the
//! scope `submit` and `admin`; `read` sees identifiers of DICOM, the acquisition and the equipment.
//! None of it gets into a path, a header or the log.

use super::problem::{Answer, Problem};
use super::request::refuse_unknown;
use serde::Serialize;
use serde_json::{Map, Value};
use utoipa::ToSchema;
use ventriform::text::is_printable;
use ventriform_service::access::Scope;
use ventriform_service::records::{ScanFilter, ScanIdentity};

/// The parameters of a search by scan.
pub const FIELDS: [&str; 3] = ["study", "series", "accession"];

/// Longest value of such a parameter, characters: that of a UID.
const VALUE_LENGTH: usize = 64;

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
    pub fn of(scan: &ScanIdentity) -> Option<Self> {
        let text = |name| scan.text(name).map(str::to_owned);
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
        shown.retain(|name, _| READABLE_FIELDS.contains(&name.as_str()));
    }
    Some(shown)
}

/// Whether callers of that scope see whose scan a volume is.
pub fn sees_patients(scope: Scope) -> bool {
    scope.includes(Scope::Submit)
}

/// Takes a search by scan out of the pairs of a query string.
///
/// # Errors
/// 400 if a value is given twice, empty or too long.
pub fn take_filter(pairs: Vec<(String, String)>) -> Answer<(ScanFilter, Vec<(String, String)>)> {
    let own = |(name, _): &(String, String)| FIELDS.contains(&name.as_str());
    let (own, others): (Vec<_>, Vec<_>) = pairs.into_iter().partition(own);
    refuse_unknown(&own, &FIELDS)?;
    let mut filter = ScanFilter::default();
    for (name, value) in own {
        let length = value.chars().count();
        if !(1..=VALUE_LENGTH).contains(&length) || !value.chars().all(is_printable) {
            return Err(Problem::bad_request(
                "invalid-parameter",
                format!("`{name}` must have 1 to {VALUE_LENGTH} printable characters."),
            )
            .at(&name)
            .fix("Give the UID or number as the DICOM header has it."));
        }
        let field = match name.as_str() {
            "study" => &mut filter.study,
            "series" => &mut filter.series,
            _ => &mut filter.accession,
        };
        *field = Some(value);
    }
    Ok((filter, others))
}
