//! Parameters that come from the tables of parameters, and headers.

use utoipa::openapi::path::{Parameter, ParameterBuilder, ParameterIn, ParameterStyle};
use utoipa::openapi::schema::{ObjectBuilder, Schema, SchemaType, Type};
use utoipa::openapi::{RefOr, Required};
use utoipa::{IntoParams, PartialSchema, ToSchema};
use ventriform::parameters::{
    BeatChoice, ComparisonChoice, ComparisonParameters, FIT_SPECS, FitParameters, GatedParameters,
    Kind, ModelParameters, ParameterSpec, Parameters, schema_of,
};

/// Declares the parameters of tables as query parameters.
macro_rules! queries {
    ($(#[doc = $doc:tt] $name:ident => $parameters:expr;)+) => {$(
        #[doc = $doc]
        pub struct $name;

        impl IntoParams for $name {
            fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
                $parameters.collect()
            }
        }
    )+};
}

queries! {
    /// Parameters of a model as query parameters.
    ModelQuery => ModelParameters::PARAMETER_SPECS.iter().map(parameter_of);
    /// Parameters of a segmentation as query parameters.
    SegmentationQuery => FitParameters::PARAMETER_SPECS.iter().map(parameter_of);
    /// Parameters of a beat as query parameters.
    BeatQuery => BeatChoice::PARAMETER_SPECS.iter().map(parameter_of)
        .chain(GatedParameters::fit_specs().map(parameter_of));
    /// Parameters of a comparison as query parameters.
    ComparisonQuery => ComparisonChoice::PARAMETER_SPECS.iter().map(parameter_of)
        .chain(ComparisonParameters::fit_specs().map(parameter_of));
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
    if let Kind::Integers { .. } | Kind::Numbers { .. } | Kind::Points { .. } = spec.kind {
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
