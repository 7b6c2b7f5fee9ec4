//! Request bodies that the handlers read piece by piece, so that no Rust type describes them.

use super::inputs::PriorityField;
use crate::resources::tags;
use serde_json::json;
use std::borrow::Cow;
use utoipa::openapi::schema::{
    AdditionalProperties, AnyOfBuilder, ArrayBuilder, Discriminator, KnownFormat, Object,
    ObjectBuilder, OneOfBuilder, Schema, SchemaFormat, SchemaType, Type,
};
use utoipa::openapi::{Ref, RefOr};
use utoipa::{PartialSchema, ToSchema};
use ventriform::heart::normals::{NormalLimits, Sex};
use ventriform::parameters::{
    CohortCase, ComparisonParameters, FitParameters, GatedParameters, ModelParameters,
    NormalsParameters,
};
use ventriform_service::base::records::{LegalHold, Resource};
use ventriform_service::network::hooks::HookEvent;
use ventriform_service::work::{MOST_CASES, dicom};

/// A job to be filed, of a kind by which its parameters are told; `create_job` reads it field by field. That it has a volume or
/// else a source is added to the finished document.
pub struct JobRequest;

/// A kind of job: its name, that of the schema of its request, and that of the schema of its parameters.
struct JobKind {
    kind: &'static str,
    request: &'static str,
    parameters: fn() -> Cow<'static, str>,
    /// The kind of its result.
    result: Resource,
}

/// The kinds; a job that names none is of the first.
const JOB_KINDS: [JobKind; 5] = [
    JobKind {
        kind: "model",
        request: "ModelJobRequest",
        parameters: ModelParameters::name,
        result: Resource::Model,
    },
    JobKind {
        kind: "segmentation",
        request: "SegmentationJobRequest",
        parameters: FitParameters::name,
        result: Resource::Segmentation,
    },
    JobKind {
        kind: "beat",
        request: "BeatJobRequest",
        parameters: GatedParameters::name,
        result: Resource::Beat,
    },
    JobKind {
        kind: "comparison",
        request: "ComparisonJobRequest",
        parameters: ComparisonParameters::name,
        result: Resource::Comparison,
    },
    JobKind {
        kind: "normals",
        request: "NormalsJobRequest",
        parameters: NormalsJobParameters::name,
        result: Resource::Normals,
    },
];

/// The names of the schemas of requests, one for each kind of job.
pub fn job_requests() -> impl Iterator<Item = &'static str> {
    JOB_KINDS.iter().map(|kind| kind.request)
}

/// The value of `kind` and the schema that it stands for.
pub fn job_discriminator() -> Discriminator {
    let mapping = JOB_KINDS.iter().map(|kind| {
        let schema = Ref::from_schema_name(kind.request);
        (kind.kind, schema.ref_location)
    });
    Discriminator::with_mapping("kind", mapping)
}

impl ToSchema for JobRequest {
    fn name() -> Cow<'static, str> {
        "JobRequest".into()
    }

    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        schemas.push((ModelParameters::name().into(), ModelParameters::schema()));
        schemas.push((JobParameters::name().into(), JobParameters::schema()));
        schemas.push((FitParameters::name().into(), FitParameters::schema()));
        schemas.push((GatedParameters::name().into(), GatedParameters::schema()));
        schemas.push((
            ComparisonParameters::name().into(),
            ComparisonParameters::schema(),
        ));
        schemas.push((
            NormalsJobParameters::name().into(),
            NormalsJobParameters::schema(),
        ));
        schemas.push((CohortCase::name().into(), CohortCase::schema()));
        schemas.push((Sex::name().into(), Sex::schema()));
        schemas.push((WebhookRequest::name().into(), WebhookRequest::schema()));
        let own = [
            (VolumeJobRequest::name(), VolumeJobRequest::schema()),
            (SourceJobRequest::name(), SourceJobRequest::schema()),
            (SourceRequest::name(), SourceRequest::schema()),
        ];
        schemas.extend(own.map(|(name, schema)| (name.into(), schema)));
        let of_kinds = JOB_KINDS.iter();
        schemas.extend(of_kinds.map(|kind| (kind.request.to_owned(), request_of(kind))));
    }
}

impl PartialSchema for JobRequest {
    fn schema() -> RefOr<Schema> {
        let requests = job_requests().fold(OneOfBuilder::new(), |requests, name| {
            requests.item(Ref::from_schema_name(name))
        });
        let requests = requests.discriminator(Some(job_discriminator()));
        Schema::OneOf(requests.build()).into()
    }
}

/// The request of a job of that kind, on a stored volume or a series in an archive.
fn request_of(kind: &JobKind) -> RefOr<Schema> {
    let is_usual = kind.kind == JOB_KINDS[0].kind;
    let mut word = ObjectBuilder::new()
        .schema_type(Type::String)
        .description(Some("The kind of work"))
        .enum_values(Some([kind.kind]));
    if is_usual {
        word = word.default(Some(json!(kind.kind)));
    }
    let parameters = (kind.parameters)();
    let source = Ref::from_schema_name(SourceRequest::name());
    let mut object = job_request(
        Schema::from(word),
        &[("volume", volume_field().into()), ("source", source.into())],
        &parameters,
        &[kind.result],
    );
    if !is_usual {
        object = object.required("kind");
    }
    if kind.result == Resource::Normals {
        object = object.required("parameters");
    }
    Schema::from(object.build()).into()
}

/// The fields that all job requests have, before and after what they work on.
fn job_request(
    kind: Schema,
    inputs: &[(&str, RefOr<Schema>)],
    parameters: &str,
    results: &[Resource],
) -> ObjectBuilder {
    let (external_id, labels) = tag_fields(false);
    let [(_, send), (_, to)] = send_fields(results);
    let mut object = ObjectBuilder::new()
        .property("external_id", external_id)
        .property("labels", labels)
        .property("kind", kind)
        .property("priority", PriorityField::schema());
    for (name, schema) in inputs {
        object = object.property(*name, schema.clone());
    }
    object = object
        .property("parameters", Ref::from_schema_name(parameters))
        .property("webhook", Ref::from_schema_name(WebhookRequest::name()));
    if results.iter().any(|kind| !dicom::objects(*kind).is_empty()) {
        object = object.property("send", send).property("to", to);
    }
    object.additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)))
}

/// The request of a job of any kind on that input.
fn request_on(input: &str, schema: RefOr<Schema>) -> RefOr<Schema> {
    let kind = ObjectBuilder::new()
        .schema_type(Type::String)
        .description(Some("The kind of work"))
        .enum_values(Some(JOB_KINDS.map(|kind| kind.kind)))
        .default(Some(json!(JOB_KINDS[0].kind)));
    let fields = [(input, schema)];
    let parameters = JobParameters::name();
    let object = job_request(Schema::from(kind), &fields, &parameters, &Resource::ALL);
    Schema::from(object.required(input).build()).into()
}

fn volume_field() -> Schema {
    let volume = ObjectBuilder::new()
        .schema_type(Type::String)
        .description(Some("Id of the volume"))
        .examples(["vol_9f86d081884c7d659a2feaa0c55ad015"]);
    Schema::from(volume)
}

/// A job of any kind on a stored volume; [`JobRequest`] has a schema for each kind.
pub struct VolumeJobRequest;

impl ToSchema for VolumeJobRequest {
    fn name() -> Cow<'static, str> {
        "VolumeJobRequest".into()
    }
}

impl PartialSchema for VolumeJobRequest {
    fn schema() -> RefOr<Schema> {
        request_on("volume", volume_field().into())
    }
}

/// A job of any kind on a series in an archive.
pub struct SourceJobRequest;

impl ToSchema for SourceJobRequest {
    fn name() -> Cow<'static, str> {
        "SourceJobRequest".into()
    }
}

impl PartialSchema for SourceJobRequest {
    fn schema() -> RefOr<Schema> {
        let source = Ref::from_schema_name(SourceRequest::name());
        request_on("source", source.into())
    }
}

/// A series in an archive; `source_of` reads it field by field.
pub struct SourceRequest;

impl ToSchema for SourceRequest {
    fn name() -> Cow<'static, str> {
        "SourceRequest".into()
    }
}

impl PartialSchema for SourceRequest {
    fn schema() -> RefOr<Schema> {
        let text = || ObjectBuilder::new().schema_type(Type::String);
        let uid = |what: &str| {
            let uid = text()
                .description(Some(what))
                .pattern(Some(r"^(0|[1-9][0-9]*)(\.(0|[1-9][0-9]*))+$"))
                .max_length(Some(64));
            Schema::from(uid)
        };
        let archive = text()
            .description(Some("Name of a configured archive"))
            .examples(["pacs"]);
        let dicomweb = text()
            .description(Some(
                "Base URL of a DICOMweb service, instead of `archive`: of a configured archive, or \
                 of a host that the operator has allowed",
            ))
            .max_length(Some(2048));
        let object = ObjectBuilder::new()
            .property("archive", Schema::from(archive))
            .property("dicomweb", Schema::from(dicomweb))
            .property("study", uid("Study Instance UID"))
            .property("series", uid("Series Instance UID"))
            .required("study")
            .required("series")
            .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)));
        Schema::from(object.build()).into()
    }
}

/// A receiver to be told about jobs; `GivenWebhook` reads it field by field.
pub struct WebhookRequest;

impl ToSchema for WebhookRequest {
    fn name() -> Cow<'static, str> {
        "WebhookRequest".into()
    }
}

impl PartialSchema for WebhookRequest {
    fn schema() -> RefOr<Schema> {
        let text = || ObjectBuilder::new().schema_type(Type::String);
        let url = text()
            .description(Some(
                "Where to send deliveries: https, and a public host unless the operator allows it",
            ))
            .format(Some(SchemaFormat::Custom("uri".into())))
            .max_length(Some(2048))
            .examples(["https://ris.example.org/hooks/ventriform"]);
        let events = ArrayBuilder::new()
            .description(Some("What to tell; the three ends of a job unless given"))
            .items(RefOr::T(Schema::from(
                text().enum_values(Some(HookEvent::ALL.map(HookEvent::as_str))),
            )))
            .min_items(Some(1));
        let secret = text()
            .description(Some(
                "What signs the deliveries (Standard Webhooks): `whsec_` and base64. Made by the \
                 service unless given, and never shown again",
            ))
            .pattern(Some("^whsec_[A-Za-z0-9+/]{32,88}={0,2}$"))
            .examples(["whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"]);
        let object = ObjectBuilder::new()
            .property("url", Schema::from(url))
            .property("events", Schema::Array(events.build()))
            .property("secret", Schema::from(secret))
            .required("url")
            .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)));
        Schema::from(object.build()).into()
    }
}

/// Whose scan a volume is, as a caller states it.
#[derive(ToSchema)]
#[schema(as = StatedScan)]
#[expect(dead_code, reason = "it describes a body that is read field by field")]
pub struct StatedScanSchema {
    /// Patient ID; needed for a file that is not DICOM.
    #[schema(max_length = 64, example = "4711")]
    patient_id: Option<String>,
    /// Patient's Name, components separated by `^`.
    #[schema(max_length = 64, example = "Doe^Jane")]
    patient_name: Option<String>,
    /// Patient's Birth Date, `YYYYMMDD`.
    #[schema(pattern = "^[0-9]{8}$")]
    patient_birth_date: Option<String>,
    /// Patient's Sex: M, F or O.
    #[schema(pattern = "^[MFO]$")]
    patient_sex: Option<String>,
    /// Study Instance UID; needed for a file that is not DICOM.
    #[schema(max_length = 64, pattern = "^[0-9.]+$", example = "1.2.840.99999.1.1")]
    study_uid: Option<String>,
    /// Study Date, `YYYYMMDD`.
    #[schema(pattern = "^[0-9]{8}$")]
    study_date: Option<String>,
    /// Study ID.
    #[schema(max_length = 16)]
    study_id: Option<String>,
    /// Accession Number.
    #[schema(max_length = 16)]
    accession_number: Option<String>,
    /// Referring Physician's Name, components separated by `^`.
    #[schema(max_length = 64)]
    referring_physician: Option<String>,
    /// Frame of Reference UID.
    #[schema(max_length = 64, pattern = "^[0-9.]+$")]
    frame_of_reference_uid: Option<String>,
}

/// Data sets as DICOM JSON.
pub struct WorkitemBody;

impl ToSchema for WorkitemBody {
    fn name() -> Cow<'static, str> {
        "DicomJson".into()
    }
}

impl PartialSchema for WorkitemBody {
    fn schema() -> RefOr<Schema> {
        let set = ObjectBuilder::new()
            .schema_type(Type::Object)
            .description(Some(
                "Elements by tag, each with `vr` and `Value` (PS3.18 annex F)",
            ))
            .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(true)));
        let sets = ArrayBuilder::new()
            .description(Some("Data sets; a request has one"))
            .items(RefOr::T(Schema::from(set)))
            .examples([json!([{"00741000": {"vr": "CS", "Value": ["SCHEDULED"]}}])]);
        Schema::Array(sets.build()).into()
    }
}

/// The parameters of a job of any kind.
pub struct JobParameters;

impl ToSchema for JobParameters {
    fn name() -> Cow<'static, str> {
        "JobParameters".into()
    }

    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        JobRequest::schemas(schemas);
    }
}

impl PartialSchema for JobParameters {
    fn schema() -> RefOr<Schema> {
        let parameters = AnyOfBuilder::new()
            .item(Ref::from_schema_name(ModelParameters::name()))
            .item(Ref::from_schema_name(FitParameters::name()))
            .item(Ref::from_schema_name(GatedParameters::name()))
            .item(Ref::from_schema_name(ComparisonParameters::name()))
            .item(Ref::from_schema_name(NormalsJobParameters::name()));
        Schema::AnyOf(parameters.build()).into()
    }
}

/// The table of a cohort, and a name.
fn cohort_fields() -> [(&'static str, Schema); 2] {
    let cases = ArrayBuilder::new()
        .description(Some("The scans of the cohort, and what is known of each"))
        .items(Ref::from_schema_name(CohortCase::name()))
        .min_items(Some(1))
        .max_items(Some(MOST_CASES));
    let name = ObjectBuilder::new()
        .schema_type(Type::String)
        .description(Some("The name of the limits; not a person's"))
        .min_length(Some(1))
        .max_length(Some(80));
    [
        ("name", name.into()),
        ("cases", Schema::Array(cases.build())),
    ]
}

/// The parameters of a job that builds normal limits.
pub struct NormalsJobParameters;

impl ToSchema for NormalsJobParameters {
    fn name() -> Cow<'static, str> {
        "NormalsParameters".into()
    }
}

impl PartialSchema for NormalsJobParameters {
    fn schema() -> RefOr<Schema> {
        let RefOr::T(Schema::Object(mut object)) = NormalsParameters::schema() else {
            unreachable!("the schema of parameters is an object")
        };
        for (name, schema) in cohort_fields() {
            object.properties.insert(name.into(), schema.into());
        }
        object.required.push("cases".into());
        Schema::Object(object).into()
    }
}

/// The fields of a job beside those of its work: names, priority, webhook.
fn job_fields(object: ObjectBuilder) -> ObjectBuilder {
    let (external_id, labels) = tag_fields(false);
    object
        .property("external_id", external_id)
        .property("labels", labels)
        .property("priority", PriorityField::schema())
        .property("webhook", Ref::from_schema_name(WebhookRequest::name()))
        .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)))
}

/// `send` and `to` of results of these kinds.
fn send_fields(kinds: &[Resource]) -> [(&'static str, Schema); 2] {
    let text = || ObjectBuilder::new().schema_type(Type::String);
    let mut names = Vec::new();
    for object in kinds.iter().copied().flat_map(dicom::objects) {
        if !names.contains(&object.file_name()) {
            names.push(object.file_name());
        }
    }
    let most = kinds.iter().map(|kind| dicom::objects(*kind).len()).max();
    let send = ArrayBuilder::new()
        .description(Some(
            "DICOM objects of the result that are sent to an archive",
        ))
        .items(RefOr::T(Schema::from(text().enum_values(Some(names)))))
        .min_items(Some(1))
        .max_items(most);
    let to = text()
        .description(Some(
            "The archive that they are sent to; that of `source` unless given",
        ))
        .pattern(Some("^[A-Za-z0-9._-]{1,64}$"));
    [("send", Schema::Array(send.build())), ("to", to.into())]
}

/// A comparison to be made; `create_comparison` reads it field by field.
pub struct ComparisonRequest;

impl ToSchema for ComparisonRequest {
    fn name() -> Cow<'static, str> {
        "ComparisonRequest".into()
    }

    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        JobRequest::schemas(schemas);
    }
}

impl PartialSchema for ComparisonRequest {
    fn schema() -> RefOr<Schema> {
        let id = |description: &str, kinds: &str| {
            let id = ObjectBuilder::new()
                .schema_type(Type::String)
                .description(Some(description))
                .pattern(Some(format!("^({kinds})[0-9a-f]{{1,64}}$")));
            Schema::from(id)
        };
        let scans = "vol_|seg_|bea_";
        let mut object = ObjectBuilder::new()
            .property(
                "stress",
                id(
                    "The scan at stress: a volume, or the segmentation or beat of one",
                    scans,
                ),
            )
            .property("rest", id("The scan at rest", scans))
            .property(
                "normals",
                id("Normal limits by which both scans are scored", "nrm_"),
            )
            .property(
                "parameters",
                Ref::from_schema_name(ComparisonParameters::name()),
            )
            .required("stress")
            .required("rest");
        for (name, schema) in send_fields(&[Resource::Comparison]) {
            object = object.property(name, schema);
        }
        Schema::from(job_fields(object).build()).into()
    }
}

/// Normal limits to be added or built; `create_normals` reads it field by field.
pub struct NormalsRequest;

impl ToSchema for NormalsRequest {
    fn name() -> Cow<'static, str> {
        "NormalsRequest".into()
    }

    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        JobRequest::schemas(schemas);
        schemas.push((CohortRequest::name().into(), CohortRequest::schema()));
        schemas.push((
            NormalsParameters::name().into(),
            NormalsParameters::schema(),
        ));
    }
}

impl PartialSchema for NormalsRequest {
    fn schema() -> RefOr<Schema> {
        let requests = OneOfBuilder::new()
            .item(Ref::from_schema_name(NormalLimits::name()))
            .item(Ref::from_schema_name(CohortRequest::name()));
        Schema::OneOf(requests.build()).into()
    }
}

/// A cohort of which normal limits are built.
pub struct CohortRequest;

impl ToSchema for CohortRequest {
    fn name() -> Cow<'static, str> {
        "CohortRequest".into()
    }
}

impl PartialSchema for CohortRequest {
    fn schema() -> RefOr<Schema> {
        let mut object = ObjectBuilder::new().required("cases");
        for (name, schema) in cohort_fields() {
            object = object.property(name, schema);
        }
        let object = object.property(
            "parameters",
            Ref::from_schema_name(NormalsParameters::name()),
        );
        Schema::from(job_fields(object).build()).into()
    }
}

/// `external_id` and `labels`. In a patch, `null` removes them.
fn tag_fields(patch: bool) -> (Schema, Schema) {
    let text = |longest: usize| {
        let kinds = if patch {
            SchemaType::from_iter([Type::String, Type::Null])
        } else {
            Type::String.into()
        };
        ObjectBuilder::new()
            .schema_type(kinds)
            .min_length(Some(1))
            .max_length(Some(longest))
    };
    let labels = ObjectBuilder::new()
        .schema_type(if patch {
            SchemaType::from_iter([Type::Object, Type::Null])
        } else {
            Type::Object.into()
        })
        .description(Some("The caller's own names and values"))
        .additional_properties(Some(Schema::from(text(tags::LABEL_VALUE_LENGTH))))
        .examples([json!({"study": "42"})]);
    let external_id = text(tags::EXTERNAL_ID_LENGTH)
        .description(Some("The id in the caller's own system"))
        .examples(["A-2026-17"]);
    (external_id.into(), labels.into())
}

/// A JSON merge patch of a template's setting.
pub struct TemplatePatch;

impl ToSchema for TemplatePatch {
    fn name() -> Cow<'static, str> {
        "TemplatePatch".into()
    }
}

impl PartialSchema for TemplatePatch {
    fn schema() -> RefOr<Schema> {
        let library = ObjectBuilder::new()
            .schema_type(SchemaType::from_iter([Type::Boolean, Type::Null]))
            .description(Some("Whether every `model=auto` fits the template"));
        let patch = ObjectBuilder::new()
            .property("library", library)
            .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)));
        Schema::from(patch).into()
    }
}

/// A JSON merge patch of a caller's names.
pub struct TagsPatch;

impl ToSchema for TagsPatch {
    fn name() -> Cow<'static, str> {
        "TagsPatch".into()
    }
}

impl PartialSchema for TagsPatch {
    fn schema() -> RefOr<Schema> {
        let (external_id, labels) = tag_fields(true);
        let patch = ObjectBuilder::new()
            .property("external_id", external_id)
            .property("labels", labels)
            .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)));
        Schema::from(patch).into()
    }
}

/// Why a volume is put on legal hold.
pub struct HoldRequest;

impl ToSchema for HoldRequest {
    fn name() -> Cow<'static, str> {
        "HoldRequest".into()
    }
}

impl PartialSchema for HoldRequest {
    fn schema() -> RefOr<Schema> {
        let reason = ObjectBuilder::new()
            .schema_type(Type::String)
            .min_length(Some(1))
            .max_length(Some(LegalHold::REASON_LENGTH))
            .description(Some("Why the volume must be kept"))
            .examples(["Case 17/2026"]);
        let request = ObjectBuilder::new()
            .property("reason", Schema::from(reason))
            .required("reason")
            .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)));
        Schema::from(request).into()
    }
}

fn file(description: &str) -> ObjectBuilder {
    ObjectBuilder::new()
        .schema_type(Type::String)
        .format(Some(SchemaFormat::KnownFormat(KnownFormat::Binary)))
        .content_media_type("application/octet-stream")
        .description(Some(description))
}

/// Declares types that document forms; the first file is required.
macro_rules! forms {
    ($(#[doc = $doc:literal] $name:ident { $first:literal: $help:literal, $($more:literal: $more_help:literal,)* })+) => {$(
        #[doc = $doc]
        pub struct $name;

        impl ToSchema for $name {
            fn name() -> Cow<'static, str> {
                stringify!($name).into()
            }
        }

        impl PartialSchema for $name {
            fn schema() -> RefOr<Schema> {
                let form = ObjectBuilder::new()
                    .property($first, file($help))
                    .required($first)
                    $(.property($more, file($more_help)))*
                    .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)));
                Schema::from(form).into()
            }
        }
    )+};
}

forms! {
    /// A form whose files are a volume.
    UploadForm {
        "file": "The volume; several files make up one: a .hdr/.img pair, a DICOM series (a slice or a gate in each \
            file), or 6 to 32 NIfTI files of one gate each, in the order of the numbers in their names or else of the \
            form",
    }
    /// A form with both scans of a patient.
    ComparisonForm {
        "stress": "The scan at stress; several files make up one",
        "rest": "The scan at rest; several files make up one",
    }
    /// A form with a volume and an expert's mask.
    SegmentationForm {
        "volume": "The volume; several files make up one",
        "expert": "An expert's mask (above 0.5) to measure against",
    }
}

/// A mesh, as in `mesh.json`.
pub struct MeshDocument;

impl ToSchema for MeshDocument {
    fn name() -> Cow<'static, str> {
        "MeshDocument".into()
    }
}

impl PartialSchema for MeshDocument {
    fn schema() -> RefOr<Schema> {
        let triples = |kind: Type, description: &str| {
            let triple = ArrayBuilder::new()
                .items(Object::with_type(kind))
                .min_items(Some(3))
                .max_items(Some(3));
            ArrayBuilder::new()
                .items(RefOr::T(Schema::Array(triple.build())))
                .description(Some(description))
        };
        let text = |description: &str| {
            ObjectBuilder::new()
                .schema_type(Type::String)
                .description(Some(description))
        };
        let word = |only: &'static str| {
            ObjectBuilder::new()
                .schema_type(Type::String)
                .enum_values(Some([only]))
        };
        let mesh = ObjectBuilder::new()
            .property("frame", word("LPS"))
            .property("unit", word("mm"))
            .property("title", text("What the mesh shows"))
            .property("volume", text("Id of the volume it was made of"))
            .property(
                "frame_of_reference_uid",
                text("The volume's DICOM frame of reference"),
            )
            .property("software", text("The program that made it"))
            .property(
                "quality",
                ObjectBuilder::new().description(Some("Its main figures")),
            )
            .property("vertices", triples(Type::Number, "Points, LPS millimetres"))
            .property(
                "normals",
                triples(Type::Number, "Unit normals of the points, outward"),
            )
            .property(
                "uncertainty_mm",
                ArrayBuilder::new()
                    .description(Some(
                        "Standard deviation of each point's distance from the true surface",
                    ))
                    .items(Object::with_type(Type::Number)),
            )
            .property(
                "fields",
                ObjectBuilder::new()
                    .description(Some(
                        "A figure of each point: `Uptake` (per cent) of a fitted wall, `Distance` (mm) of a \
                         model to the surface that it was made of; null where it is not known",
                    ))
                    .additional_properties(Some(
                        ArrayBuilder::new().items(
                            ObjectBuilder::new()
                                .schema_type(SchemaType::from_iter([Type::Number, Type::Null])),
                        ),
                    )),
            )
            .property(
                "part",
                ArrayBuilder::new()
                    .description(Some(
                        "The part of a left ventricle's wall that each triangle is of: 1 endocardium, 2 epicardium, 3 \
                         base",
                    ))
                    .items(Object::with_type(Type::Integer)),
            )
            .property(
                "triangles",
                triples(
                    Type::Integer,
                    "Indices of three vertices each, counter-clockwise seen from outside",
                ),
            )
            .required("vertices")
            .required("triangles");
        Schema::from(mesh).into()
    }
}
