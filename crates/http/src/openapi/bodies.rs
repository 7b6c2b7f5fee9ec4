//! Schemas of request bodies that several structs make up, or that the library reads.

use crate::wire::job_fields::{
    CohortFields, ComparisonFields, JobFields, OrderFields, ReadingFields, SerialFields,
    external_id, labels,
};
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
    NormalsParameters, ReadingParameters, SerialParameters,
};
use ventriform_service::base::records::Resource;
use ventriform_service::work::dicom;

type Schemas = Vec<(String, RefOr<Schema>)>;

/// Declares types that stand for schemas: their names, what collects the schemas that these refer to, and the schemas.
macro_rules! schemas {
    ($($(#[doc = $doc:literal])+ $name:ident $(, |$all:ident| $collect:block)? => $schema:expr;)+) => {$(
        $(#[doc = $doc])+
        pub struct $name;

        impl ToSchema for $name {
            fn name() -> Cow<'static, str> {
                stringify!($name).into()
            }

            $(fn schemas($all: &mut Schemas) $collect)?
        }

        impl PartialSchema for $name {
            fn schema() -> RefOr<Schema> {
                Schema::from($schema).into()
            }
        }
    )+};
}

schemas! {
    /// A job to be filed, of a kind by which its parameters are told. That it has a volume or else a source is added to
    /// the finished document.
    JobRequest, |schemas| {
        fn add<T: ToSchema>(schemas: &mut Schemas) {
            schemas.push((T::name().into(), T::schema()));
        }
        for add in [
            add::<ModelParameters>,
            add::<FitParameters>,
            add::<GatedParameters>,
            add::<ComparisonParameters>,
            add::<SerialParameters>,
            add::<ReadingParameters>,
            add::<NormalsJobParameters>,
            add::<JobParameters>,
            add::<CohortCase>,
            add::<Sex>,
            OrderFields::schemas,
            JobFields::schemas,
        ] {
            add(schemas);
        }
        let on_inputs = ANY_JOB_REQUESTS.iter();
        schemas.extend(on_inputs.map(|(name, input)| ((*name).to_owned(), request_on(input))));
        let of_kinds = JOB_KINDS.iter();
        schemas.extend(of_kinds.map(|kind| (kind.request.to_owned(), request_of(kind))));
    } => {
        let requests = job_requests().fold(OneOfBuilder::new(), |requests, name| {
            requests.item(Ref::from_schema_name(name))
        });
        requests.discriminator(Some(job_discriminator())).build()
    };
    /// The parameters of a job of any kind.
    JobParameters, |schemas| { JobRequest::schemas(schemas) } => {
        let parameters = JOB_KINDS.iter().fold(AnyOfBuilder::new(), |parameters, kind| {
            parameters.item(Ref::from_schema_name((kind.parameters)()))
        });
        // Readings are signed at a path of their own.
        parameters.item(Ref::from_schema_name(ReadingParameters::name())).build()
    };
    /// A comparison to be made.
    ComparisonRequest, |schemas| { JobRequest::schemas(schemas) } => {
        let mut object = joined([OrderFields::schema(), ComparisonFields::schema()]);
        add_send_fields(&mut object, &[Resource::Comparison]);
        object
    };
    /// A serial comparison to be made.
    SerialRequest, |schemas| { JobRequest::schemas(schemas) } => {
        let mut object = joined([OrderFields::schema(), SerialFields::schema()]);
        add_send_fields(&mut object, &[Resource::Serial]);
        object
    };
    /// A reading to be signed.
    ReadingRequest, |schemas| { JobRequest::schemas(schemas) } => {
        let mut object = joined([OrderFields::schema(), ReadingFields::schema()]);
        add_send_fields(&mut object, &[Resource::Reading]);
        object
    };
    /// Normal limits to be added or built.
    NormalsRequest, |schemas| {
        JobRequest::schemas(schemas);
        CohortFields::schemas(schemas);
        schemas.push((CohortRequest::name().into(), CohortRequest::schema()));
    } => OneOfBuilder::new()
        .item(Ref::from_schema_name(NormalLimits::name()))
        .item(Ref::from_schema_name(CohortRequest::name()))
        .build();
    /// A cohort of which normal limits are built.
    CohortRequest => joined([OrderFields::schema(), CohortFields::schema()]);
    /// A JSON merge patch of a caller's names.
    TagsPatch => ObjectBuilder::new()
        .property("external_id", external_id(true))
        .property("labels", labels(true))
        .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)));
    /// Data sets as DICOM JSON.
    DicomJson => {
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
        sets.build()
    };
    /// A Bundle of FHIR R4.
    FhirBundle => ObjectBuilder::new()
        .property("resourceType", text().enum_values(Some(["Bundle"])))
        .property(
            "entry",
            ArrayBuilder::new()
                .description(Some("The DiagnosticReport first, then what it refers to"))
                .items(Object::with_type(Type::Object)),
        )
        .required("resourceType")
        .required("entry")
        .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(true)));
    /// A mesh, as in `mesh.json`.
    MeshDocument => {
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
        ObjectBuilder::new()
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
            .required("triangles")
    };
}

/// A kind of job: its name, that of the schema of its request, and that of the schema of its parameters.
struct JobKind {
    kind: &'static str,
    request: &'static str,
    parameters: fn() -> Cow<'static, str>,
    /// The kind of its result.
    result: Resource,
}

/// The kinds; a job that names none is of the first.
const JOB_KINDS: [JobKind; 6] = [
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
        kind: "serial",
        request: "SerialJobRequest",
        parameters: SerialParameters::name,
        result: Resource::Serial,
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

/// The names of the schemas of requests for a job of any kind, and the field that names what it works on.
pub const ANY_JOB_REQUESTS: [(&str, &str); 2] = [
    ("VolumeJobRequest", "volume"),
    ("SourceJobRequest", "source"),
];

/// The request of a job of that kind, on a stored volume or a series in an archive.
fn request_of(kind: &JobKind) -> RefOr<Schema> {
    let mut object = job_request(&[kind.kind], &(kind.parameters)(), &[kind.result]);
    if kind.kind != JOB_KINDS[0].kind {
        object.required.push("kind".into());
    }
    if kind.result == Resource::Normals {
        object.required.push("parameters".into());
    }
    Schema::Object(object).into()
}

/// The request of a job of any kind on the input of that name.
fn request_on(input: &str) -> RefOr<Schema> {
    let kinds = JOB_KINDS.map(|kind| kind.kind);
    let mut object = job_request(&kinds, &JobParameters::name(), &Resource::ALL);
    for (_, other) in ANY_JOB_REQUESTS.iter().filter(|(_, other)| *other != input) {
        object.properties.remove(*other);
    }
    object.required.push(input.into());
    Schema::Object(object).into()
}

/// The request of a job of one of these kinds, with these parameters.
fn job_request(kinds: &[&str], parameters: &str, results: &[Resource]) -> Object {
    let usual = JOB_KINDS[0].kind;
    let mut word = text()
        .description(Some("The kind of work"))
        .enum_values(Some(kinds.to_vec()));
    if kinds.contains(&usual) {
        word = word.default(Some(json!(usual)));
    }
    let mut object = joined([OrderFields::schema(), JobFields::schema()]);
    let parameters = Ref::from_schema_name(parameters);
    object.properties.insert("kind".into(), word.into());
    object
        .properties
        .insert("parameters".into(), parameters.into());
    add_send_fields(&mut object, results);
    object
}

/// An object with the fields of all of these.
fn joined(parts: [RefOr<Schema>; 2]) -> Object {
    let mut whole = ObjectBuilder::new()
        .additional_properties(Some(AdditionalProperties::<Schema>::FreeForm(false)))
        .build();
    for part in parts {
        let RefOr::T(Schema::Object(part)) = part else {
            unreachable!("the schema of a struct is an object")
        };
        whole.properties.extend(part.properties);
        whole.required.extend(part.required);
    }
    whole
}

/// Adds `send` and `to` if results of these kinds can be sent.
fn add_send_fields(object: &mut Object, kinds: &[Resource]) {
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
    if most.is_some_and(|most| most > 0) {
        object
            .properties
            .insert("send".into(), Schema::Array(send.build()).into());
        object.properties.insert("to".into(), to.into());
    }
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
        let mut object = joined([NormalsParameters::schema(), CohortFields::schema()]);
        object.properties.remove("parameters");
        object.description = Some("The parameters of normal limits".into());
        Schema::Object(object).into()
    }
}

fn text() -> ObjectBuilder {
    ObjectBuilder::new().schema_type(Type::String)
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
