//! Parameters that several handlers share, and those that come from the tables of parameters.

use serde_json::json;
use utoipa::IntoParams;
use utoipa::openapi::path::{Parameter, ParameterBuilder, ParameterIn, ParameterStyle};
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, Schema, SchemaType, Type};
use utoipa::openapi::{RefOr, Required};
use ventriform::export::Part;
use ventriform::parameters::{
    FIT_SPECS, FitParameters, Kind, ModelParameters, Parameters, schema_of,
};
use ventriform_service::records::Priority;

/// Parameters of a model as query parameters.
pub struct ModelQuery;

impl IntoParams for ModelQuery {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        query_of::<ModelParameters>()
    }
}

/// Parameters of a segmentation as query parameters.
pub struct SegmentationQuery;

impl IntoParams for SegmentationQuery {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        query_of::<FitParameters>()
    }
}

fn query_of<P: Parameters>() -> Vec<Parameter> {
    P::SPECS
        .iter()
        .map(|spec| {
            let mut parameter = query(spec.name, spec.summary).schema(Some(schema_of(spec)));
            if let Kind::Integers { .. } | Kind::Numbers { .. } = spec.kind {
                // One value `1,2,3`, not the parameter repeated.
                parameter = parameter
                    .style(Some(ParameterStyle::Form))
                    .explode(Some(false));
            }
            parameter.build()
        })
        .collect()
}

/// `limit` and `cursor`.
pub struct PageParameters;

impl IntoParams for PageParameters {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let limit = ObjectBuilder::new()
            .schema_type(Type::Integer)
            .minimum(Some(1))
            .maximum(Some(100))
            .default(Some(json!(20)));
        let cursor = ObjectBuilder::new()
            .schema_type(Type::String)
            .pattern(Some("^[1-9][0-9]{0,17}$"));
        vec![
            query("limit", "Greatest number of entries of the page")
                .schema(Some(Schema::from(limit)))
                .build(),
            query("cursor", "`next_cursor` of the previous page")
                .schema(Some(Schema::from(cursor)))
                .build(),
        ]
    }
}

/// `external_id` and `label`.
pub struct TagParameters;

impl IntoParams for TagParameters {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let text = |pattern: &str| {
            ObjectBuilder::new()
                .schema_type(Type::String)
                .pattern(Some(pattern))
        };
        let labels = ArrayBuilder::new()
            .items(RefOr::T(Schema::from(
                text("^[A-Za-z0-9_./-]{1,64}:.{1,256}$").examples(["study:42"]),
            )))
            .max_items(Some(16));
        vec![
            query("external_id", "The id in the caller's own system")
                .schema(Some(Schema::from(text("^.{1,128}$"))))
                .build(),
            query(
                "labels",
                "A name and a value with a colon between them; repeat for several",
            )
            .schema(Some(Schema::Array(labels.build())))
            .style(Some(ParameterStyle::Form))
            .explode(Some(true))
            .build(),
        ]
    }
}

/// `priority` of a request for a job.
pub(super) fn priority_field() -> Schema {
    let field = ObjectBuilder::new()
        .schema_type(Type::String)
        .description(Some(
            "How urgent the job is: every waiting job of a higher priority starts before it",
        ))
        .enum_values(Some(Priority::ALL.map(Priority::as_str)))
        .default(Some(json!(Priority::default().as_str())));
    Schema::from(field)
}

/// `label`, `mesh_unit` and `mesh_frame` of an expert's mask.
pub struct MaskParameters;

impl IntoParams for MaskParameters {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let names = ["label", "mesh_unit", "mesh_frame"];
        let specs = FIT_SPECS.iter().filter(|spec| names.contains(&spec.name));
        specs
            .map(|spec| {
                query(spec.name, spec.summary)
                    .schema(Some(schema_of(spec)))
                    .build()
            })
            .collect()
    }
}

/// `priority` of a job that is filed with an upload.
pub struct PriorityParameter;

impl IntoParams for PriorityParameter {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let parameter = query("priority", "How urgent the job is").schema(Some(priority_field()));
        vec![parameter.build()]
    }
}

/// `study`, `series` and `accession`.
pub struct ScanParameters;

impl IntoParams for ScanParameters {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        [
            ("study", "Only of the study with this Study Instance UID"),
            ("series", "Only of the series with this Series Instance UID"),
            ("accession", "Only of scans with this Accession Number"),
        ]
        .map(|(name, help)| {
            let text = ObjectBuilder::new()
                .schema_type(Type::String)
                .pattern(Some("^.{1,64}$"));
            query(name, help).schema(Some(Schema::from(text))).build()
        })
        .into()
    }
}

/// `part`.
pub struct PartParameter;

impl IntoParams for PartParameter {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let part = ObjectBuilder::new()
            .schema_type(Type::String)
            .enum_values(Some(Part::ALL.map(Part::as_str)));
        let help = "Of meshes of a left ventricle: only this part of the wall, as an open surface";
        vec![query("part", help).schema(Some(part)).build()]
    }
}

/// `deidentify`.
pub struct DeidentifyParameter;

impl IntoParams for DeidentifyParameter {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let flag = ObjectBuilder::new()
            .schema_type(Type::Boolean)
            .default(Some(json!(false)));
        let help = "Of DICOM objects: whether to remove the patient's identity (PS3.15, basic \
                    profile); of report.html: whether it names nobody";
        vec![query("deidentify", help).schema(Some(flag)).build()]
    }
}

/// `transaction-uid`, `transaction` and `Transaction-UID`.
pub struct TransactionParameters;

impl IntoParams for TransactionParameters {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let uid = || ObjectBuilder::new().schema_type(Type::String);
        let help =
            "The Transaction UID under which the item is claimed; it may also be in the body";
        let mut all: Vec<Parameter> = ["transaction-uid", "transaction"]
            .map(|name| query(name, help).schema(Some(Schema::from(uid()))).build())
            .into();
        all.push(header("Transaction-UID", help));
        all
    }
}

/// `cascade`.
pub struct CascadeParameter;

impl IntoParams for CascadeParameter {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let flag = ObjectBuilder::new()
            .schema_type(Type::Boolean)
            .default(Some(json!(false)));
        let help = "Whether to erase also the models, segmentations and templates that were made \
                    of the volume, and the records of its jobs";
        vec![query("cascade", help).schema(Some(flag)).build()]
    }
}

/// `Prefer: return=representation`.
pub struct ErasureParameters;

impl IntoParams for ErasureParameters {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        vec![header(
            "Prefer",
            "`return=representation` asks for the receipt in the answer",
        )]
    }
}

/// `If-None-Match`.
pub struct CachedHeaders;

impl IntoParams for CachedHeaders {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        vec![header(
            "If-None-Match",
            "Answer 304 if the `ETag` is among these",
        )]
    }
}

fn query(name: &str, description: &str) -> ParameterBuilder {
    ParameterBuilder::new()
        .name(name)
        .parameter_in(ParameterIn::Query)
        .required(Required::False)
        .description(Some(description))
}

fn header(name: &str, description: &str) -> Parameter {
    ParameterBuilder::new()
        .name(name)
        .parameter_in(ParameterIn::Header)
        .required(Required::False)
        .description(Some(description))
        .schema(Some(ObjectBuilder::new().schema_type(Type::String)))
        .build()
}

/// `Idempotency-Key`.
pub struct IdempotencyHeader;

impl IntoParams for IdempotencyHeader {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let mut key = header(
            "Idempotency-Key",
            "A random text. Repeating a request under the same key returns the first job",
        );
        key.schema = Some(
            Schema::from(
                ObjectBuilder::new()
                    .schema_type(Type::String)
                    .min_length(Some(1))
                    .max_length(Some(255))
                    .pattern(Some("^[!#-~]+$")),
            )
            .into(),
        );
        vec![key]
    }
}

/// `webhook`, `webhook_events` and `Webhook-Secret`.
pub struct WebhookInputs;

impl IntoParams for WebhookInputs {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let text = || Schema::from(ObjectBuilder::new().schema_type(Type::String));
        vec![
            query("webhook", "URL to be told when the job has ended")
                .schema(Some(text()))
                .build(),
            query(
                "webhook_events",
                "What to tell, separated by commas: `started`, `succeeded`, `failed`, `cancelled`",
            )
            .schema(Some(text()))
            .build(),
            header(
                "Webhook-Secret",
                "What signs the deliveries: `whsec_` and base64",
            ),
        ]
    }
}

/// `Last-Event-ID`.
pub struct EventHeader;

impl IntoParams for EventHeader {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let mut revision = header(
            "Last-Event-ID",
            "The revision of the job that the client received last",
        );
        let schema = ObjectBuilder::new()
            .schema_type(Type::Integer)
            .minimum(Some(0));
        revision.schema = Some(Schema::from(schema).into());
        vec![revision]
    }
}

/// `Prefer`.
pub struct PreferHeader;

impl IntoParams for PreferHeader {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let mut wait = header("Prefer", "`wait=SECONDS`: how long to wait for the result");
        let text =
            ObjectBuilder::new().schema_type(SchemaType::from_iter([Type::String, Type::Null]));
        wait.schema = Some(Schema::from(text).into());
        vec![wait]
    }
}

/// `If-None-Match`, `Range`, `If-Range`.
pub struct ConditionalHeaders;

impl IntoParams for ConditionalHeaders {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        vec![
            header(
                "If-None-Match",
                "Validators (`ETag`) of the client's copies; 304 if one is current",
            ),
            header("Range", "`bytes=FIRST-LAST`: a part of the file"),
            header(
                "If-Range",
                "Apply `Range` only if this validator is current, else send the whole file",
            ),
        ]
    }
}

/// `name` of a reader.
pub struct ReaderQuery;

impl IntoParams for ReaderQuery {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let name = ObjectBuilder::new().schema_type(Type::String);
        let name = Schema::from(name.min_length(Some(1)).max_length(Some(80)));
        let summary = "The name that reports show; not a person's name, if results leave the house";
        vec![query("name", summary).schema(Some(name)).build()]
    }
}

/// `name`, `organ` and `model` of a template.
pub struct TemplateQuery;

impl IntoParams for TemplateQuery {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let text = || ObjectBuilder::new().schema_type(Type::String);
        let name = text().min_length(Some(1)).max_length(Some(80));
        let model = text().pattern(Some("^(mdl_|seg_)[0-9a-f]{1,64}$"));
        let word = |words: &[&'static str]| text().enum_values(Some(words.iter().copied()));
        let own = [
            ("name", "The name that reports show", name),
            (
                "mesh_unit",
                "Unit of the mesh, if its file does not state it. Default: mm (of glTF m), if the size is that of an organ",
                word(&["mm", "cm", "m"]),
            ),
            (
                "mesh_frame",
                "Frame of the mesh, if its file does not state it. Default: lps",
                word(&["lps", "ras"]),
            ),
            (
                "model",
                "The stored model or segmentation whose mesh is copied",
                model,
            ),
            (
                "library",
                "Whether every `model=auto` fits the template, beside the built-in hearts",
                ObjectBuilder::new().schema_type(Type::Boolean),
            ),
        ]
        .map(|(name, summary, schema)| {
            let schema = Schema::from(schema);
            query(name, summary).schema(Some(schema)).build()
        });
        let organ = FIT_SPECS.iter().filter(|spec| spec.name == "organ");
        organ
            .map(|spec| {
                query(spec.name, "The organ that the model shows")
                    .schema(Some(schema_of(spec)))
                    .build()
            })
            .chain(own)
            .collect()
    }
}
