//! Answers and problems that several handlers share.

use super::bodies::MeshDocument;
use crate::wire::problem::{MEDIA_TYPE, ProblemBody};
use std::collections::BTreeMap;
use utoipa::openapi::header::HeaderBuilder;
use utoipa::openapi::schema::{ObjectBuilder, Schema, Type};
use utoipa::openapi::{Content, Ref, RefOr, Response, ResponseBuilder};
use utoipa::{IntoResponses, PartialSchema, ToSchema};
use ventriform::results::export::Format;

/// The schema of a job, which the handlers register.
const JOB_SCHEMA: &str = "Job";
/// The schema of a segmentation's report, which the document's frame registers.
const SEGMENTATION_REPORT: &str = "SegmentationReport";

/// The schema of a beat's report, which the document's frame registers.
const BEAT_REPORT: &str = "BeatReport";

/// The schema of a comparison's report, which the document's frame registers.
const COMPARISON_REPORT: &str = "ComparisonReport";
/// The schema of a reading.
const READING_REPORT: &str = "ReadingReport";
/// The schema of the report of a serial comparison.
const SERIAL_REPORT: &str = "SerialReport";

type Responses = BTreeMap<String, RefOr<Response>>;

/// A problem object with this status.
pub fn problem(status: u16, description: &str) -> (String, RefOr<Response>) {
    let schema = Ref::from_schema_name(ProblemBody::name());
    let response = ResponseBuilder::new()
        .description(description)
        .content(MEDIA_TYPE, Content::new(Some(schema)))
        .build();
    (status.to_string(), response.into())
}

/// Declares types that document the problems of a group of handlers.
macro_rules! problems {
    ($($(#[doc = $doc:literal])+ $name:ident { $($status:literal: $description:literal,)+ })+) => {$(
        $(#[doc = $doc])+
        pub struct $name;

        impl IntoResponses for $name {
            fn responses() -> Responses {
                [$(problem($status, $description)),+].into()
            }
        }
    )+};
}

problems! {
    /// Problems of lists.
    ListProblems {
        400: "A query parameter is unknown, repeated or out of range",
        500: "The service met an error of its own",
    }
    /// Problems of looking something up by its id.
    LookupProblems {
        400: "A query parameter is unknown, or an id or header cannot be read",
        404: "There is nothing with this id or name",
        410: "It was erased",
        500: "The service met an error of its own",
    }
    /// Problems of erasing what a job may need.
    EraseProblems {
        409: "An unfinished job needs it, or a legal hold keeps it",
    }
    /// Problems of erasing what a filter selects.
    ScanErasureProblems {
        400: "A query parameter is unknown, is given twice, or cannot be read",
        403: "The caller's scope does not allow it",
        404: "No volume matches",
        409: "An unfinished job, a request or a legal hold keeps something, or something else would go than the plan \
            names",
        422: "There is no filter, a value of it is empty or too long, or one receipt cannot hold what would go",
        500: "The service met an error of its own",
    }
    /// Problems of changing names.
    PatchProblems {
        408: "The body did not arrive in time",
        413: "The body is larger than the operator allows",
        415: "The body has a type or encoding that this path does not read",
        422: "A name or label cannot be used",
    }
    /// Problems of what needs a wider scope.
    ScopeProblems {
        403: "The caller's scope does not allow it",
    }
    /// Problems of setting a legal hold.
    HoldProblems {
        403: "The caller's scope does not allow it",
        408: "The body did not arrive in time",
        413: "The body is larger than the operator allows",
        415: "The body has a type or encoding that this path does not read",
        422: "The reason cannot be used",
    }
    /// Problems of stating whose scan a volume is.
    IdentityProblems {
        403: "The caller's scope does not allow it",
        408: "The body did not arrive in time",
        409: "The volume's file says something else",
        413: "The body is larger than the operator allows",
        415: "The body has a type or encoding that this path does not read",
        422: "A field is unknown, or its value is not valid DICOM",
    }
    /// Problems of making a DICOM object of a result.
    DicomProblems {
        403: "Whose scan it is needs the scope `submit`",
        409: "Nobody said whose scan the volume is, or the volume was erased",
        422: "DICOM cannot express the result",
    }
    /// Problems of requests about work items.
    WorkitemProblems {
        400: "The body is not DICOM JSON, or an attribute or parameter cannot be used",
        403: "The caller's scope does not allow it",
        408: "The body did not arrive in time",
        413: "The body is larger than the operator allows",
        415: "The body has a type or encoding that this path does not read",
        500: "The service met an error of its own",
        507: "There are too many work items, or the disk is full",
    }
    /// Problems of changing a work item.
    WorkitemConflict {
        409: "The item's state or its Transaction UID does not allow it",
    }
    /// Problems of uploads.
    UploadProblems {
        400: "The body is empty or malformed or broke off, or a query parameter is unknown",
        408: "The body did not arrive in time",
        413: "The body, or the volume in it, is larger than the operator allows",
        415: "The body has a type or encoding that this path does not read",
        422: "The body is not a usable file, or a parameter is invalid",
        500: "The service met an error of its own",
    }
    /// Problems of filing a job.
    FileProblems {
        400: "The request cannot be read",
        408: "The body did not arrive in time",
        413: "The body is larger than the operator allows",
        415: "The body has a type or encoding that this path does not read",
        422: "A field or parameter is invalid, or the idempotency key was used for another request",
        429: "The queue is full; the job was not accepted",
        500: "The service met an error of its own",
    }
}

/// 304 of what carries a validator.
pub struct UnchangedAnswer;

impl IntoResponses for UnchangedAnswer {
    fn responses() -> Responses {
        let unchanged = ResponseBuilder::new().description("The client's copy is still current");
        [("304".to_owned(), unchanged.build().into())].into()
    }
}

/// 206, 304, 406 and 416 of downloads.
pub struct DownloadAnswers;

impl IntoResponses for DownloadAnswers {
    fn responses() -> Responses {
        // Without a schema: generators would take the part for a second form of the whole.
        let part = ResponseBuilder::new()
            .description("The bytes that `Range` asks for, under the file's media type");
        let unchanged = ResponseBuilder::new().description("The client's copy is still current");
        [
            ("206".to_owned(), part.build().into()),
            ("304".to_owned(), unchanged.build().into()),
            problem(406, "`Accept` allows none of the formats"),
            problem(416, "`Range` lies outside the file"),
        ]
        .into()
    }
}

/// The outcome of objects that came by STOW-RS, and 406.
pub struct StowAnswers;

impl IntoResponses for StowAnswers {
    fn responses() -> Responses {
        let answers = [
            (200, "All are stored"),
            (202, "Some are stored"),
            (409, "None is stored"),
        ];
        let answers = answers.map(|(status, description)| {
            let object = ObjectBuilder::new().schema_type(Type::Object);
            let content = Content::new(Some(object));
            let answer = ResponseBuilder::new().description(description);
            let answer = answer.content("application/dicom+json", content).build();
            (status.to_string(), answer.into())
        });
        let refused = problem(406, "The answer is `application/dicom+json` only");
        answers.into_iter().chain([refused]).collect()
    }
}

/// 202, 406 and 409 of requests that upload a volume and may wait for the result.
pub struct WaitAnswers;

impl IntoResponses for WaitAnswers {
    fn responses() -> Responses {
        let header = |schema: RefOr<Schema>, description: &str| {
            HeaderBuilder::new()
                .schema(Some(schema))
                .description(Some(description))
                .build()
        };
        let accepted = ResponseBuilder::new()
            .description("Accepted")
            .content(
                "application/json",
                Content::new(Some(Ref::from_schema_name(JOB_SCHEMA))),
            )
            .header("Location", header(String::schema(), "The job's path"))
            .header(
                "Retry-After",
                header(u64::schema(), "Seconds to wait before asking for its state"),
            );
        [
            ("202".to_owned(), accepted.build().into()),
            problem(406, "`Accept` allows none of the formats of the result"),
            problem(409, "The job was cancelled while this request waited"),
        ]
        .into()
    }
}

/// Declares types that document the answer 200 with a file of one of several kinds.
macro_rules! files {
    ($(#[doc = $doc:literal] $name:ident: $description:literal, $contents:expr;)+) => {$(
        #[doc = $doc]
        pub struct $name;

        impl IntoResponses for $name {
            fn responses() -> Responses {
                file_answer($description, $contents.into_iter().flatten())
            }
        }
    )+};
}

files! {
    /// 200 with a file of a result, whose media type follows from its name.
    FileAnswer: "The file", [Contents::new()];
    /// 200 with a mesh in one of the formats.
    MeshAnswer: "The mesh", [meshes()];
    /// 200 with an uploaded file.
    OriginalAnswer: "The file", [files_of([
        "application/gzip", "application/dicom", "application/nifti", "application/octet-stream",
    ])];
    /// 200 with a report.
    ReportAnswer: "The report", [reports()];
    /// 200 with a report that has no page.
    ReportDocumentAnswer: "The report", [report_document()];
    /// 200 with the mask, mesh or report of a segmentation.
    SegmentationAnswer: "The mask, the mesh or the report", [meshes(), masks(), report_alone(SEGMENTATION_REPORT)];
    /// 200 with the report of a beat, or a mesh of it.
    BeatAnswer: "The report or the mesh", [meshes(), report_alone(BEAT_REPORT)];
    /// 200 with the report of a comparison, or its slices.
    ComparisonAnswer: "The report or the slices", [files_of(["image/png"]), report_alone(COMPARISON_REPORT)];
    /// 200 with the reading.
    ReadingAnswer: "The reading", [report_alone(READING_REPORT)];
    /// 200 with the report of a serial comparison, or its trend.
    SerialAnswer: "The report or the trend", [files_of(["image/svg+xml"]), report_alone(SERIAL_REPORT)];
}

/// 200 with a job's changes; the schema is that of one event.
pub struct EventsAnswer;

impl IntoResponses for EventsAnswer {
    fn responses() -> Responses {
        let text = || ObjectBuilder::new().schema_type(Type::String);
        let job = text()
            .content_media_type("application/json")
            .content_schema(Some(Ref::from_schema_name(JOB_SCHEMA)));
        let event = ObjectBuilder::new()
            .property("id", text())
            .property("event", text().enum_values(Some(["job"])))
            .property("data", job)
            .required("data");
        let response = ResponseBuilder::new()
            .description("The changes")
            .content("text/event-stream", Content::new(Some(Schema::from(event))))
            .build();
        [("200".to_owned(), response.into())].into()
    }
}

/// Media types and what is sent under each.
type Contents = Vec<(&'static str, Content)>;

fn file_answer(
    description: &str,
    contents: impl Iterator<Item = (&'static str, Content)>,
) -> Responses {
    let text = || HeaderBuilder::new().schema(Some(ObjectBuilder::new().schema_type(Type::String)));
    let mut response = ResponseBuilder::new()
        .description(description)
        .header(
            "ETag",
            text()
                .description(Some("SHA-256 of the content, quoted"))
                .build(),
        )
        .header(
            "Content-Location",
            text().description(Some("The file's own path")).build(),
        );
    let contents: BTreeMap<_, _> = contents.collect();
    for (media_type, content) in contents {
        response = response.content(media_type, content);
    }
    [("200".to_owned(), response.build().into())].into()
}

fn meshes() -> Contents {
    Format::ALL
        .into_iter()
        .map(|format| {
            let schema = match format {
                Format::Json => Ref::from_schema_name(MeshDocument::name()).into(),
                Format::Gltf => RefOr::T(object()),
                _ => RefOr::T(binary()),
            };
            (format.media_type(), Content::new(Some(schema)))
        })
        .collect()
}

fn masks() -> Contents {
    files_of([
        "application/gzip",
        "application/nifti",
        "application/x-nifti",
    ])
}

fn files_of<const N: usize>(media_types: [&'static str; N]) -> Contents {
    media_types
        .map(|media_type| (media_type, Content::new(Some(binary()))))
        .into()
}

fn reports() -> Contents {
    let page = ObjectBuilder::new().schema_type(Type::String);
    vec![
        ("application/json", Content::new(Some(object()))),
        ("text/html", Content::new(Some(Schema::from(page)))),
    ]
}

fn report_document() -> Contents {
    vec![("application/json", Content::new(Some(object())))]
}

fn report_alone(schema: &str) -> Contents {
    let report = Ref::from_schema_name(schema);
    vec![("application/json", Content::new(Some(report)))]
}

fn object() -> Schema {
    ObjectBuilder::new().schema_type(Type::Object).into()
}

/// Bytes. OpenAPI 3.1 expresses them by a schema without a type.
fn binary() -> Schema {
    ObjectBuilder::new()
        .schema_type(utoipa::openapi::schema::SchemaType::AnyValue)
        .content_media_type("application/octet-stream")
        .into()
}
