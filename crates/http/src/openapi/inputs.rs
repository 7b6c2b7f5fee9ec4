//! Parameters that come from the tables of parameters, and headers.

use serde_json::json;
use utoipa::openapi::path::{Parameter, ParameterBuilder, ParameterIn, ParameterStyle};
use utoipa::openapi::schema::{ObjectBuilder, Schema, SchemaType, Type};
use utoipa::openapi::{RefOr, Required};
use utoipa::{IntoParams, PartialSchema, ToSchema};
use ventriform::parameters::{
    BeatChoice, ComparisonChoice, ComparisonParameters, FIT_SPECS, FitParameters, GatedParameters,
    Kind, ModelParameters, ParameterSpec, Parameters, schema_of,
};
use ventriform_service::base::records::Priority;

/// Parameters of a model as query parameters.
pub struct ModelQuery;

impl IntoParams for ModelQuery {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        ModelParameters::PARAMETER_SPECS
            .iter()
            .map(parameter_of)
            .collect()
    }
}

/// Parameters of a segmentation as query parameters.
pub struct SegmentationQuery;

impl IntoParams for SegmentationQuery {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        FitParameters::PARAMETER_SPECS
            .iter()
            .map(parameter_of)
            .collect()
    }
}

/// Parameters of a beat as query parameters.
pub struct BeatQuery;

impl IntoParams for BeatQuery {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let of_fit = GatedParameters::fit_specs().map(parameter_of);
        let own = BeatChoice::PARAMETER_SPECS.iter().map(parameter_of);
        own.chain(of_fit).collect()
    }
}

/// Parameters of a comparison as query parameters.
pub struct ComparisonQuery;

impl IntoParams for ComparisonQuery {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let of_fit = ComparisonParameters::fit_specs().map(parameter_of);
        let own = ComparisonChoice::PARAMETER_SPECS.iter().map(parameter_of);
        own.chain(of_fit).collect()
    }
}

/// Those of the parameters of a segmentation that have these names.
pub fn fit_parameters(names: &[&str]) -> Vec<Parameter> {
    let specs = FIT_SPECS.iter().filter(|spec| names.contains(&spec.name));
    specs.map(parameter_of).collect()
}

fn parameter_of<P: Parameters>(spec: &ParameterSpec<P>) -> Parameter {
    let mut parameter = ParameterBuilder::new()
        .name(spec.name)
        .parameter_in(ParameterIn::Query)
        .required(Required::False)
        .description(Some(spec.summary))
        .schema(Some(schema_of(spec)));
    if let Kind::Integers { .. } | Kind::Numbers { .. } = spec.kind {
        // One value `1,2,3`, not the parameter repeated.
        parameter = parameter
            .style(Some(ParameterStyle::Form))
            .explode(Some(false));
    }
    parameter.build()
}

/// `organ` of a new template.
pub struct OrganField;

impl PartialSchema for OrganField {
    fn schema() -> RefOr<Schema> {
        let organ = FIT_SPECS.iter().find(|spec| spec.name == "organ");
        schema_of(organ.expect("segmentations have the parameter `organ`")).into()
    }
}

impl ToSchema for OrganField {}

/// `priority` of a request for a job.
pub struct PriorityField;

impl PartialSchema for PriorityField {
    fn schema() -> RefOr<Schema> {
        let field = text()
            .description(Some(
                "How urgent the job is: every waiting job of a higher priority starts before it",
            ))
            .enum_values(Some(Priority::ALL.map(Priority::as_str)))
            .default(Some(json!(Priority::default().as_str())));
        Schema::from(field).into()
    }
}

impl ToSchema for PriorityField {}

fn text() -> ObjectBuilder {
    ObjectBuilder::new().schema_type(Type::String)
}

fn header(name: &str, description: &str, schema: ObjectBuilder) -> Parameter {
    ParameterBuilder::new()
        .name(name)
        .parameter_in(ParameterIn::Header)
        .required(Required::False)
        .description(Some(description))
        .schema(Some(schema))
        .build()
}

/// Declares groups of headers of a request: name, description and schema of each.
macro_rules! headers {
    ($($(#[doc = $doc:tt])+ $group:ident: $(($name:tt, $description:tt, $schema:expr)),+;)+) => {$(
        $(#[doc = $doc])+
        pub struct $group;

        impl IntoParams for $group {
            fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
                vec![$(header($name, $description, $schema)),+]
            }
        }
    )+};
}

headers! {
    /// The header of a request on a claimed work item.
    TransactionHeader: ("Transaction-UID", "The Transaction UID under which the item is claimed; it may also be in the \
        body",
        text());
    /// The header of an erasure.
    ErasureHeader: ("Prefer", "`return=representation` asks for the receipt in the answer", text());
    /// The header of a request for what the client may have already.
    CachedHeaders: ("If-None-Match", "Validators (`ETag`) of the client's copies; 304 if one is current", text());
    /// The headers of a download.
    ConditionalHeaders:
        ("If-None-Match", "Validators (`ETag`) of the client's copies; 304 if one is current", text()),
        ("Range", "`bytes=FIRST-LAST`: a part of the file", text()),
        ("If-Range", "Apply `Range` only if this validator is current, else send the whole file", text());
    /// The header of a request for a job that may be repeated.
    IdempotencyHeader: ("Idempotency-Key", "A random text. Repeating a request under the same key returns the first \
        job",
        text().min_length(Some(1)).max_length(Some(255)).pattern(Some("^[!#-~]+$")));
    /// The header with the secret of a job's webhook.
    WebhookSecretHeader: ("Webhook-Secret", "What signs the deliveries: `whsec_` and base64", text());
    /// The header of a stream of events that is resumed.
    EventHeader: ("Last-Event-ID", "The revision of the job that the client received last",
        ObjectBuilder::new().schema_type(Type::Integer).minimum(Some(0)));
    /// The header of an upload that waits for the result.
    PreferHeader: ("Prefer", "`wait=SECONDS`: how long to wait for the result",
        text().schema_type(SchemaType::from_iter([Type::String, Type::Null])));
}
