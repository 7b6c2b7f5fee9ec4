//! The tables of parameters as schemas of OpenAPI.

use super::{
    BeatChoice, BesideFit, ComparisonChoice, ComparisonParameters, FitParameters, GatedParameters,
    Kind, ModelParameters, NormalsChoice, NormalsParameters, ParameterSpec, Parameters,
    ReadingParameters, SerialChoice, SerialParameters, WithFit,
};
use serde_json::{Value, json};
use std::borrow::Cow;
use utoipa::openapi::RefOr;
use utoipa::openapi::extensions::{Extensions, ExtensionsBuilder};
use utoipa::openapi::schema::{
    AdditionalProperties, ArrayBuilder, Object, ObjectBuilder, Schema, Type,
};
use utoipa::{PartialSchema, ToSchema};

impl ToSchema for ModelParameters {
    fn name() -> Cow<'static, str> {
        "ModelParameters".into()
    }
}

impl PartialSchema for ModelParameters {
    fn schema() -> RefOr<Schema> {
        object_of::<Self>("The parameters of a model")
    }
}

impl ToSchema for FitParameters {
    fn name() -> Cow<'static, str> {
        "SegmentationParameters".into()
    }
}

impl PartialSchema for FitParameters {
    fn schema() -> RefOr<Schema> {
        object_of::<Self>("The parameters of a segmentation")
    }
}

impl ToSchema for GatedParameters {
    fn name() -> Cow<'static, str> {
        "BeatParameters".into()
    }
}

impl PartialSchema for GatedParameters {
    fn schema() -> RefOr<Schema> {
        with_fit::<BeatChoice>()
    }
}

impl ToSchema for ComparisonParameters {
    fn name() -> Cow<'static, str> {
        "ComparisonParameters".into()
    }
}

impl PartialSchema for ComparisonParameters {
    fn schema() -> RefOr<Schema> {
        with_fit::<ComparisonChoice>()
    }
}

impl ToSchema for SerialParameters {
    fn name() -> Cow<'static, str> {
        "SerialParameters".into()
    }
}

impl PartialSchema for SerialParameters {
    fn schema() -> RefOr<Schema> {
        with_fit::<SerialChoice>()
    }
}

impl ToSchema for ReadingParameters {
    fn name() -> Cow<'static, str> {
        "ReadingParameters".into()
    }
}

impl PartialSchema for ReadingParameters {
    fn schema() -> RefOr<Schema> {
        object_of::<Self>("What a reader states of a result")
    }
}

impl ToSchema for NormalsParameters {
    fn name() -> Cow<'static, str> {
        "NormalsFitParameters".into()
    }
}

impl PartialSchema for NormalsParameters {
    fn schema() -> RefOr<Schema> {
        with_fit::<NormalsChoice>()
    }
}

fn with_fit<C: BesideFit>() -> RefOr<Schema> {
    let of_fit = WithFit::<C>::fit_specs().map(|spec| (spec.name, schema_of(spec)));
    let own = C::PARAMETER_SPECS
        .iter()
        .map(|spec| (spec.name, schema_of(spec)));
    object_with(
        &format!("The parameters of {}", C::WORK_NOUN),
        of_fit.chain(own),
    )
}

fn object_of<P: Parameters>(description: &str) -> RefOr<Schema> {
    let rows = P::PARAMETER_SPECS.iter();
    object_with(description, rows.map(|spec| (spec.name, schema_of(spec))))
}

fn object_with(
    description: &str,
    fields: impl Iterator<Item = (&'static str, Schema)>,
) -> RefOr<Schema> {
    let object = fields
        .fold(ObjectBuilder::new(), |object, (name, schema)| {
            object.property(name, schema)
        })
        .description(Some(description))
        .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)));
    Schema::from(object.build()).into()
}

/// The schema of one parameter: type, range or words, default and help; `x-title`, `x-group` and `x-unit` for forms.
pub fn schema_of<P: Parameters>(spec: &ParameterSpec<P>) -> Schema {
    let object = ObjectBuilder::new()
        .description(Some(spec.summary))
        .extensions(Some(form_facts(spec)))
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
        Kind::Switch => object.schema_type(Type::Boolean).into(),
        Kind::Choice(words) => object
            .schema_type(Type::String)
            .enum_values(Some(words.iter().copied()))
            .into(),
        Kind::Direction(words) => {
            let number = r"[+-]?[0-9]{1,9}(\.[0-9]{1,9})?";
            let words = words.join("|");
            object
                .schema_type(Type::String)
                .pattern(Some(format!("^({words}|{number},{number},{number})$")))
                .examples([spec.default, "0,0,1"])
                .into()
        }
        Kind::Integers { count } => list_of(Type::Integer, [count; 2], spec),
        Kind::Numbers { count } => list_of(Type::Number, [count; 2], spec),
        Kind::Points { most } => list_of(Type::Number, [3, 3 * most], spec),
        Kind::Stored {
            prefixes,
            word,
            more,
        } => {
            let id = format!("({})[0-9a-f]{{1,64}}", prefixes.join("|"));
            let pattern = match (word, more) {
                ("", 0) => format!("^{id}$"),
                ("", _) => format!("^{id}(,{id}){{0,{more}}}$"),
                (_, 0) => format!("^({word}|{id})$"),
                _ => format!("^({word}(,{id}){{0,{more}}}|{id})$"),
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

/// What forms show beside the value.
fn form_facts<P: Parameters>(spec: &ParameterSpec<P>) -> Extensions {
    let facts = [("x-group", spec.group), ("x-unit", spec.unit)];
    let facts = facts.into_iter().filter(|(_, text)| !text.is_empty());
    let builder = ExtensionsBuilder::new().add("x-title", spec.shown_name());
    facts
        .fold(builder, |builder, (name, text)| builder.add(name, text))
        .build()
}

fn list_of<P: Parameters>(
    kind: Type,
    [least, most]: [usize; 2],
    spec: &ParameterSpec<P>,
) -> Schema {
    Schema::Array(
        ArrayBuilder::new()
            .description(Some(spec.summary))
            .extensions(Some(form_facts(spec)))
            .items(Object::with_type(kind))
            .min_items(Some(least))
            .max_items(Some(most))
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
        Kind::Switch => json!(spec.default == "true"),
        _ => json!(spec.default),
    })
}
