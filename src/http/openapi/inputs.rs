//! Parameters and bodies that several handlers share, and those that come from tables.

use crate::export::Format;
use crate::jobs::Resource;
use crate::parameters::{self, FIT_SPECS, Kind, ParameterSpec, Parameters};
use serde_json::{Value, json};
use std::borrow::Cow;
use utoipa::openapi::path::{Parameter, ParameterBuilder, ParameterIn, ParameterStyle};
use utoipa::openapi::schema::{
    AdditionalProperties, ArrayBuilder, Object, ObjectBuilder, Schema, Type,
};
use utoipa::openapi::{RefOr, Required};
use utoipa::{IntoParams, PartialSchema, ToSchema};

/// Makes two types that document a table of parameters: as a JSON object, and as query
/// parameters.
macro_rules! parameters {
    ($object:ident, $query:ident, $table:ty, $what:literal) => {
        #[doc = concat!("Parameters of a ", $what, " as a JSON object.")]
        pub struct $object;

        impl ToSchema for $object {
            fn name() -> Cow<'static, str> {
                stringify!($object).into()
            }
        }

        impl PartialSchema for $object {
            fn schema() -> RefOr<Schema> {
                object_of::<$table>(concat!("What decides a ", $what))
            }
        }

        #[doc = concat!("Parameters of a ", $what, " as query parameters.")]
        pub struct $query;

        impl IntoParams for $query {
            fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
                query_of::<$table>()
            }
        }
    };
}

parameters!(
    ModelParameters,
    ModelQuery,
    parameters::ModelParameters,
    "model"
);
parameters!(
    SegmentationParameters,
    SegmentationQuery,
    parameters::FitParameters,
    "segmentation"
);

fn object_of<P: Parameters>(description: &str) -> RefOr<Schema> {
    let object = P::SPECS
        .iter()
        .fold(ObjectBuilder::new(), |object, spec| {
            object.property(spec.name, schema_of(spec))
        })
        .description(Some(description))
        .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)));
    Schema::from(object.build()).into()
}

fn query_of<P: Parameters>() -> Vec<Parameter> {
    P::SPECS
        .iter()
        .map(|spec| {
            let mut parameter = query(spec.name, spec.summary).schema(Some(schema_of(spec)));
            if let Kind::Integers { .. } | Kind::Numbers { .. } = spec.kind {
                // `1,2,3` in one, not repeated.
                parameter = parameter
                    .style(Some(ParameterStyle::Form))
                    .explode(Some(false));
            }
            parameter.build()
        })
        .collect()
}

fn schema_of<P: Parameters>(spec: &ParameterSpec<P>) -> Schema {
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
        Kind::Integers { count } => list_of(Type::Integer, count, spec.summary),
        Kind::Numbers { count } => list_of(Type::Number, count, spec.summary),
        Kind::Stored { prefixes, word } => {
            let id = format!("({})[0-9a-f]{{1,64}}", prefixes.join("|"));
            let pattern = match word {
                "" => format!("^{id}$"),
                _ => format!("^({word}|{id})$"),
            };
            object
                .schema_type(Type::String)
                .pattern(Some(pattern))
                .into()
        }
        Kind::Text { pattern, example } => object
            .schema_type(Type::String)
            .pattern(Some(pattern))
            .examples([example])
            .into(),
    }
}

fn list_of(kind: Type, count: usize, summary: &str) -> Schema {
    Schema::Array(
        ArrayBuilder::new()
            .description(Some(summary))
            .items(Object::with_type(kind))
            .min_items(Some(count))
            .max_items(Some(count))
            .build(),
    )
}

fn default_of<P: Parameters>(spec: &ParameterSpec<P>) -> Option<Value> {
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

/// Names of the files that a product of that kind may have.
pub fn file_names(resource: Resource) -> Vec<String> {
    let meshes = Format::ALL.map(|format| format!("mesh.{}", format.extension()));
    let others: &[&str] = match resource {
        Resource::Model => &["report.json", "report.html", "distance.json"],
        Resource::Segmentation => &[
            "mask.nii.gz",
            "report.json",
            "report.html",
            "slices.png",
            "polar.json",
            "polar.svg",
            "polar.png",
        ],
        _ => &[],
    };
    let others = others.iter().map(|name| (*name).to_owned());
    meshes.into_iter().chain(others).collect()
}

/// Makes types that document the file names of a kind of product.
macro_rules! file_names {
    ($($name:ident: $resource:ident),+) => {$(
        #[doc = concat!("The files of a ", stringify!($resource), ".")]
        pub struct $name;

        impl ToSchema for $name {
            fn name() -> Cow<'static, str> {
                stringify!($name).into()
            }
        }

        impl PartialSchema for $name {
            fn schema() -> RefOr<Schema> {
                Schema::from(
                    ObjectBuilder::new()
                        .schema_type(Type::String)
                        .enum_values(Some(file_names(Resource::$resource))),
                )
                .into()
            }
        }
    )+};
}

file_names!(FileName: Model, SegmentationFileName: Segmentation, TemplateFileName: Template);

/// `name`, `organ` and `model` of a template.
pub struct TemplateQuery;

impl IntoParams for TemplateQuery {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let text = || ObjectBuilder::new().schema_type(Type::String);
        let name = text().min_length(Some(1)).max_length(Some(80));
        let model = text().pattern(Some("^(mdl_|seg_)[0-9a-f]{1,64}$"));
        let own = [
            ("name", "Name in reports", name),
            ("model", "Stored model or segmentation to copy", model),
        ]
        .map(|(name, summary, schema)| {
            let schema = Schema::from(schema);
            query(name, summary).schema(Some(schema)).build()
        });
        let organ = FIT_SPECS.iter().filter(|spec| spec.name == "organ");
        organ
            .map(|spec| {
                query(spec.name, "What it shows")
                    .schema(Some(schema_of(spec)))
                    .build()
            })
            .chain(own)
            .collect()
    }
}
