//! Parameters and bodies that several handlers share, and those that come from tables.

use crate::export::Format;
use crate::parameters::{Kind, ParameterSpec, SPECS};
use serde_json::{Value, json};
use std::borrow::Cow;
use utoipa::openapi::path::{Parameter, ParameterBuilder, ParameterIn, ParameterStyle};
use utoipa::openapi::schema::{
    AdditionalProperties, ArrayBuilder, KnownFormat, Object, ObjectBuilder, Schema, SchemaFormat,
    Type,
};
use utoipa::openapi::{Ref, RefOr, Required};
use utoipa::{IntoParams, PartialSchema, ToSchema};

/// Parameters of a model as a JSON object.
pub struct ModelParameters;

impl ToSchema for ModelParameters {
    fn name() -> Cow<'static, str> {
        "ModelParameters".into()
    }
}

impl PartialSchema for ModelParameters {
    fn schema() -> RefOr<Schema> {
        let object = SPECS
            .iter()
            .fold(ObjectBuilder::new(), |object, spec| {
                object.property(spec.name, schema_of(spec))
            })
            .description(Some("What decides the model that comes out of a volume"))
            .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)));
        Schema::from(object.build()).into()
    }
}

/// Parameters of a model as query parameters.
pub struct ModelQuery;

impl IntoParams for ModelQuery {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        SPECS
            .iter()
            .map(|spec| {
                let mut parameter = query(spec.name, spec.summary).schema(Some(schema_of(spec)));
                if let Kind::Integers { .. } = spec.kind {
                    // `1,2,3` in one, not repeated.
                    parameter = parameter
                        .style(Some(ParameterStyle::Form))
                        .explode(Some(false));
                }
                parameter.build()
            })
            .collect()
    }
}

fn schema_of(spec: &ParameterSpec) -> Schema {
    let object = ObjectBuilder::new()
        .description(Some(spec.summary))
        .default(default_of(spec));
    match spec.kind {
        Kind::Integer { min, max } => {
            let object = object
                .schema_type(Type::Integer)
                .minimum(Some(min as usize));
            match max {
                u64::MAX => object,
                _ => object.maximum(Some(max as usize)),
            }
            .into()
        }
        Kind::Number { min, max } => object
            .schema_type(Type::Number)
            .minimum(Some(min))
            .maximum(Some(max))
            .into(),
        Kind::Choice(words) => object
            .schema_type(Type::String)
            .enum_values(Some(words.iter().copied()))
            .into(),
        Kind::Integers { count } => Schema::Array(
            ArrayBuilder::new()
                .description(Some(spec.summary))
                .items(Object::with_type(Type::Integer))
                .min_items(Some(count))
                .max_items(Some(count))
                .build(),
        ),
        Kind::Text { pattern, example } => object
            .schema_type(Type::String)
            .pattern(Some(pattern))
            .examples([example])
            .into(),
    }
}

fn default_of(spec: &ParameterSpec) -> Option<Value> {
    if spec.default.is_empty() {
        return None;
    }
    Some(match spec.kind {
        Kind::Integer { .. } | Kind::Number { .. } => {
            serde_json::from_str(spec.default).unwrap_or(json!(spec.default))
        }
        _ => json!(spec.default),
    })
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
            query("limit", "Most entries of the page")
                .schema(Some(Schema::from(limit)))
                .build(),
            query("cursor", "`next_cursor` of the page before")
                .schema(Some(Schema::from(cursor)))
                .build(),
        ]
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
            "A random text: the same request under the same key is done once",
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

/// `Last-Event-ID`.
pub struct EventHeader;

impl IntoParams for EventHeader {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let mut revision = header("Last-Event-ID", "Revision of the job seen last");
        let schema = ObjectBuilder::new()
            .schema_type(Type::Integer)
            .minimum(Some(0));
        revision.schema = Some(Schema::from(schema).into());
        vec![revision]
    }
}

/// A job to be filed, as `create_job` reads it field by field.
pub struct JobRequest;

impl ToSchema for JobRequest {
    fn name() -> Cow<'static, str> {
        "JobRequest".into()
    }

    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        schemas.push((ModelParameters::name().into(), ModelParameters::schema()));
    }
}

impl PartialSchema for JobRequest {
    fn schema() -> RefOr<Schema> {
        let text = || ObjectBuilder::new().schema_type(Type::String);
        let kind = text()
            .description(Some("What kind of work it is"))
            .enum_values(Some(["model"]))
            .default(Some(json!("model")));
        let volume = text()
            .description(Some("Id of the volume"))
            .examples(["vol_9f86d081884c7d659a2feaa0c55ad015"]);
        let object = ObjectBuilder::new()
            .property("kind", Schema::from(kind))
            .property("volume", Schema::from(volume))
            .property("parameters", Ref::from_schema_name(ModelParameters::name()))
            .required("volume")
            .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)));
        Schema::from(object.build()).into()
    }
}

/// `If-None-Match`, `Range`, `If-Range`.
pub struct ConditionalHeaders;

impl IntoParams for ConditionalHeaders {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        vec![
            header("If-None-Match", "Validators at hand; 304 where one holds"),
            header("Range", "`bytes=FIRST-LAST`: a part of the file"),
            header("If-Range", "The validator under which `Range` makes sense"),
        ]
    }
}

/// Names of a model's files.
pub fn file_names() -> Vec<String> {
    let meshes = Format::ALL.map(|format| format!("mesh.{}", format.extension()));
    let reports = ["report.json", "report.html"].map(str::to_owned);
    meshes.into_iter().chain(reports).collect()
}

/// A model's files.
pub struct FileName;

impl ToSchema for FileName {
    fn name() -> Cow<'static, str> {
        "FileName".into()
    }
}

impl PartialSchema for FileName {
    fn schema() -> RefOr<Schema> {
        Schema::from(
            ObjectBuilder::new()
                .schema_type(Type::String)
                .enum_values(Some(file_names())),
        )
        .into()
    }
}

/// A form with the volume as file part.
pub struct UploadForm;

impl ToSchema for UploadForm {
    fn name() -> Cow<'static, str> {
        "UploadForm".into()
    }
}

impl PartialSchema for UploadForm {
    fn schema() -> RefOr<Schema> {
        let file = ObjectBuilder::new()
            .schema_type(Type::String)
            .format(Some(SchemaFormat::KnownFormat(KnownFormat::Binary)))
            .content_media_type("application/octet-stream")
            .description(Some(
                "The volume; several parts make up one: a .hdr/.img pair, a DICOM series",
            ));
        let form = ObjectBuilder::new()
            .property("file", Schema::from(file))
            .required("file")
            .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)));
        Schema::from(form).into()
    }
}
