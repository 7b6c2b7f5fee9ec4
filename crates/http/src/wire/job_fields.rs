//! The fields of requests for jobs: each struct reads and documents those that it has.
//!
//! [`OrderFields`] are of every kind of job; with them stand those of one kind.

use crate::wire::fields::given;
use crate::wire::webhook_request::WebhookRequest;
use crate::wire::words::PriorityName;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ObjectBuilder, Schema, SchemaType, Type};
use utoipa::{PartialSchema, ToSchema};
use ventriform::parameters::{
    CohortCase, ComparisonParameters, NormalsParameters, SerialParameters,
};
use ventriform_service::base::records::Priority;
use ventriform_service::work::MOST_CASES;

/// Longest external id, characters.
pub const EXTERNAL_ID_LENGTH: usize = 128;
/// Longest value of a label, characters.
pub const LABEL_VALUE_LENGTH: usize = 256;

/// Those of every request for a job.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct OrderFields {
    #[serde(default, deserialize_with = "given")]
    #[schema(schema_with = external_id_field)]
    pub external_id: Option<Option<String>>,
    #[serde(default, deserialize_with = "given")]
    #[schema(schema_with = labels_field)]
    pub labels: Option<Option<LabelFields>>,
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = PriorityField, inline, required = false)]
    pub priority: Option<PriorityName>,
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = WebhookRequest, required = false)]
    pub webhook: Option<WebhookRequest>,
}

/// The tags in a JSON object; in a merge patch, `null` removes them.
#[derive(Deserialize)]
pub struct TagFields {
    /// The id in the caller's own system.
    #[serde(default, deserialize_with = "given")]
    pub external_id: Option<Option<String>>,
    /// The caller's own names and values.
    #[serde(default, deserialize_with = "given")]
    pub labels: Option<Option<LabelFields>>,
}

/// The labels in a JSON object.
pub type LabelFields = BTreeMap<String, Option<String>>;

/// The work of a job, and what it is done on.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct JobFields {
    /// The kind of work
    #[serde(default, deserialize_with = "given")]
    #[schema(nullable = false)]
    pub kind: Option<String>,
    /// Id of the volume
    #[serde(default, deserialize_with = "given")]
    #[schema(nullable = false, examples("vol_9f86d081884c7d659a2feaa0c55ad015"))]
    pub volume: Option<String>,
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = SourceRequest, required = false)]
    pub source: Option<SourceRequest>,
    #[serde(default)]
    pub parameters: Map<String, Value>,
}

/// A series in an archive.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SourceRequest {
    /// Name of a configured archive
    #[serde(default, deserialize_with = "given")]
    #[schema(nullable = false, examples("pacs"))]
    pub archive: Option<String>,
    /// Base URL of a DICOMweb service, instead of `archive`: of a configured archive, or of a host that the operator has
    /// allowed
    #[serde(default, deserialize_with = "given")]
    #[schema(nullable = false, max_length = 2048)]
    pub dicomweb: Option<String>,
    /// Study Instance UID
    #[serde(default, deserialize_with = "given")]
    #[schema(
        required = true,
        nullable = false,
        max_length = 64,
        pattern = r"^(0|[1-9][0-9]*)(\.(0|[1-9][0-9]*))+$"
    )]
    pub study: Option<String>,
    /// Series Instance UID
    #[serde(default, deserialize_with = "given")]
    #[schema(
        required = true,
        nullable = false,
        max_length = 64,
        pattern = r"^(0|[1-9][0-9]*)(\.(0|[1-9][0-9]*))+$"
    )]
    pub series: Option<String>,
}

/// What of the result is sent, and where.
#[derive(Deserialize)]
pub struct SendFields {
    #[serde(default, deserialize_with = "given")]
    pub send: Option<Vec<String>>,
    #[serde(default, deserialize_with = "given")]
    pub to: Option<String>,
}

/// The scans of a comparison, and how they are compared.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ComparisonFields {
    /// The scan at stress: a volume, or the segmentation or beat of one
    #[serde(default, deserialize_with = "given")]
    #[schema(
        required = true,
        nullable = false,
        pattern = "^(vol_|seg_|bea_)[0-9a-f]{1,64}$"
    )]
    pub stress: Option<String>,
    /// The scan at rest
    #[serde(default, deserialize_with = "given")]
    #[schema(
        required = true,
        nullable = false,
        pattern = "^(vol_|seg_|bea_)[0-9a-f]{1,64}$"
    )]
    pub rest: Option<String>,
    /// Normal limits by which both scans are scored
    #[serde(default, deserialize_with = "given")]
    #[schema(nullable = false, pattern = "^(nrm_)[0-9a-f]{1,64}$")]
    pub normals: Option<String>,
    #[serde(default)]
    #[schema(value_type = ComparisonParameters, required = false)]
    pub parameters: Map<String, Value>,
}

/// The scans of a serial comparison, and how they are compared.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SerialFields {
    /// The scans, in any order: volumes, or the segmentations or beats of them
    #[serde(default, deserialize_with = "given")]
    #[schema(required = true, nullable = false, min_items = 2, max_items = 20)]
    pub scans: Option<Vec<String>>,
    /// Normal limits by which all scans are scored
    #[serde(default, deserialize_with = "given")]
    #[schema(nullable = false, pattern = "^(nrm_)[0-9a-f]{1,64}$")]
    pub normals: Option<String>,
    #[serde(default)]
    #[schema(value_type = SerialParameters, required = false)]
    pub parameters: Map<String, Value>,
}

/// What a reader states of a result.
#[derive(Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ReadingFields {
    /// The comparison, segmentation or beat that was read
    #[serde(
        default,
        deserialize_with = "given",
        skip_serializing_if = "Option::is_none"
    )]
    #[schema(
        required = true,
        nullable = false,
        pattern = "^(cmp_|seg_|bea_)[0-9a-f]{1,64}$"
    )]
    pub result: Option<String>,
    /// The newest reading of the same result, which this one replaces; it is kept
    #[serde(
        default,
        deserialize_with = "given",
        skip_serializing_if = "Option::is_none"
    )]
    #[schema(nullable = false, pattern = "^(rdg_)[0-9a-f]{1,64}$")]
    pub amends: Option<String>,
    /// Who read it: family name first, parts separated by ^ as in DICOM
    #[serde(
        default,
        deserialize_with = "given",
        skip_serializing_if = "Option::is_none"
    )]
    #[schema(
        required = true,
        nullable = false,
        min_length = 1,
        max_length = 64,
        example = "Doe^Jane^^Dr."
    )]
    pub reader: Option<String>,
    /// Scores of the 17 segments of a single scan, 0 (normal) to 4 (no uptake)
    #[serde(
        default,
        deserialize_with = "given",
        skip_serializing_if = "Option::is_none"
    )]
    #[schema(nullable = false, min_items = 17, max_items = 17)]
    pub scores: Option<Vec<u8>>,
    /// Scores of the 17 segments at stress
    #[serde(
        default,
        deserialize_with = "given",
        skip_serializing_if = "Option::is_none"
    )]
    #[schema(nullable = false, min_items = 17, max_items = 17)]
    pub stress_scores: Option<Vec<u8>>,
    /// Scores of the 17 segments at rest
    #[serde(
        default,
        deserialize_with = "given",
        skip_serializing_if = "Option::is_none"
    )]
    #[schema(nullable = false, min_items = 17, max_items = 17)]
    pub rest_scores: Option<Vec<u8>>,
    /// How good the study is: `good`, `fair` or `poor`
    #[serde(
        default,
        deserialize_with = "given",
        skip_serializing_if = "Option::is_none"
    )]
    #[schema(nullable = false, pattern = "^(good|fair|poor)$")]
    pub quality: Option<String>,
    /// What limits the study; it must not name the patient
    #[serde(
        default,
        deserialize_with = "given",
        skip_serializing_if = "Option::is_none"
    )]
    #[schema(nullable = false, max_length = 1000)]
    pub limits: Option<String>,
    /// The impression; it must not name the patient
    #[serde(
        default,
        deserialize_with = "given",
        skip_serializing_if = "Option::is_none"
    )]
    #[schema(nullable = false, max_length = 4000, example = "No perfusion defect.")]
    pub impression: Option<String>,
}

/// A cohort of which normal limits are built.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CohortFields {
    /// The name of the limits; not a person's
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = String, required = false, min_length = 1, max_length = 80)]
    pub name: Option<Value>,
    /// The scans of the cohort, and what is known of each
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = Vec<CohortCase>, required = true, min_items = 1, max_items = 1000)]
    pub cases: Option<Value>,
    #[serde(default)]
    #[schema(value_type = NormalsParameters, required = false)]
    pub parameters: Map<String, Value>,
}

const _: () = assert!(MOST_CASES == 1000, "the document says 1000");

/// `priority` of a request for a job.
pub struct PriorityField;

impl PartialSchema for PriorityField {
    fn schema() -> RefOr<Schema> {
        let field = ObjectBuilder::new()
            .schema_type(Type::String)
            .description(Some(
                "How urgent the job is: every waiting job of a higher priority starts before it",
            ))
            .enum_values(Some(Priority::ALL.map(Priority::as_str)))
            .default(Some(json!(Priority::default().as_str())));
        Schema::from(field).into()
    }
}

impl ToSchema for PriorityField {}

/// `external_id` of a request for a job.
fn external_id_field() -> RefOr<Schema> {
    Schema::from(external_id(false)).into()
}

/// `labels` of a request for a job.
fn labels_field() -> RefOr<Schema> {
    Schema::from(labels(false)).into()
}

/// In a patch, `null` removes it.
pub fn external_id(patch: bool) -> ObjectBuilder {
    name(Type::String, patch)
        .min_length(Some(1))
        .max_length(Some(EXTERNAL_ID_LENGTH))
        .description(Some("The id in the caller's own system"))
        .examples(["A-2026-17"])
}

/// In a patch, `null` removes them, or one of them.
pub fn labels(patch: bool) -> ObjectBuilder {
    let value = name(Type::String, patch)
        .min_length(Some(1))
        .max_length(Some(LABEL_VALUE_LENGTH));
    name(Type::Object, patch)
        .description(Some("The caller's own names and values"))
        .additional_properties(Some(Schema::from(value)))
        .examples([json!({"study": "42"})])
}

fn name(kind: Type, patch: bool) -> ObjectBuilder {
    ObjectBuilder::new().schema_type(match patch {
        true => SchemaType::from_iter([kind, Type::Null]),
        false => kind.into(),
    })
}
