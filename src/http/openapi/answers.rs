//! Answers that several handlers share.

use crate::export::Format;
use crate::http::problem::{MEDIA_TYPE, ProblemBody};
use std::collections::BTreeMap;
use utoipa::openapi::header::HeaderBuilder;
use utoipa::openapi::schema::{ObjectBuilder, Schema, Type};
use utoipa::openapi::{Content, ContentBuilder, Ref, RefOr, Response, ResponseBuilder};
use utoipa::{IntoResponses, ToSchema};

type Responses = BTreeMap<String, RefOr<Response>>;

fn problem(status: u16, description: &str) -> (String, RefOr<Response>) {
    let schema = Ref::from_schema_name(ProblemBody::name());
    let response = ResponseBuilder::new()
        .description(description)
        .content(MEDIA_TYPE, Content::new(Some(schema)))
        .build();
    (status.to_string(), response.into())
}

/// Makes types that document the problems of a group of handlers.
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
    /// Of everything that lists.
    ListProblems {
        400: "A query parameter is unknown, repeated or out of range",
        500: "The service met an error of its own",
    }
    /// Of everything that looks something up by id.
    LookupProblems {
        400: "A query parameter is unknown, or an id or header cannot be read",
        404: "There is no such thing",
        410: "It was erased",
        500: "The service met an error of its own",
    }
    /// Of everything that erases what jobs may need.
    EraseProblems {
        409: "A job that has not ended needs it",
    }
    /// Of everything that takes a file.
    UploadProblems {
        400: "The body is empty, malformed or broke off, or a query parameter is unknown",
        408: "The body did not arrive in time",
        413: "The body, or the volume in it, is larger than the operator allows",
        415: "The body is of a type or encoding that is not understood",
        422: "The body is no volume that can be used, or a parameter is invalid",
        500: "The service met an error of its own",
    }
    /// Of everything that files a job.
    FileProblems {
        400: "The request cannot be read",
        408: "The body did not arrive in time",
        413: "The body is larger than the operator allows",
        415: "The body is of a type or encoding that is not understood",
        422: "A field or parameter is invalid, or the idempotency key was used for another request",
        429: "As many jobs wait as may wait; nothing was accepted",
        500: "The service met an error of its own",
    }
}

/// 304, 206, 406 and 416 of downloads.
pub struct DownloadAnswers;

impl IntoResponses for DownloadAnswers {
    fn responses() -> Responses {
        let part = ResponseBuilder::new()
            .description("The part that `Range` asks for")
            .content("*/*", Content::new(Some(binary())));
        let unchanged = ResponseBuilder::new().description("The validator still holds");
        [
            ("206".to_owned(), part.build().into()),
            ("304".to_owned(), unchanged.build().into()),
            problem(406, "`Accept` names none of the formats"),
            problem(416, "`Range` lies outside the file"),
        ]
        .into()
    }
}

/// 200 with a mesh in one of the formats.
pub struct MeshAnswer;

impl IntoResponses for MeshAnswer {
    fn responses() -> Responses {
        file_answer("The mesh", mesh_contents())
    }
}

/// 200 with a report.
pub struct ReportAnswer;

impl IntoResponses for ReportAnswer {
    fn responses() -> Responses {
        file_answer("The report", report_contents())
    }
}

/// 200 with what a segmentation can be had as.
pub struct SegmentationAnswer;

impl IntoResponses for SegmentationAnswer {
    fn responses() -> Responses {
        let mut contents = mesh_contents();
        contents.extend(mask_contents());
        file_answer("The mask, the mesh or the report", contents)
    }
}

/// 200 with any of a segmentation's files.
pub struct SegmentationFileAnswer;

impl IntoResponses for SegmentationFileAnswer {
    fn responses() -> Responses {
        let mut contents = mesh_contents();
        contents.extend(mask_contents());
        for picture in ["image/svg+xml", "image/png"] {
            contents.insert(picture, Content::new(Some(binary())));
        }
        contents.extend(report_contents());
        file_answer("The file", contents)
    }
}

/// 200 with any of a model's files.
pub struct FileAnswer;

impl IntoResponses for FileAnswer {
    fn responses() -> Responses {
        let mut contents = mesh_contents();
        contents.extend(report_contents());
        file_answer("The file", contents)
    }
}

/// 200 with a job's changes: what each event of the stream is.
pub struct EventsAnswer;

impl IntoResponses for EventsAnswer {
    fn responses() -> Responses {
        let text = || ObjectBuilder::new().schema_type(Type::String);
        let job = text()
            .content_media_type("application/json")
            .content_schema(Some(Ref::from_schema_name("Job")));
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

fn file_answer(description: &str, contents: BTreeMap<&'static str, Content>) -> Responses {
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
    for (media_type, content) in contents {
        response = response.content(media_type, content);
    }
    [("200".to_owned(), response.build().into())].into()
}

fn mesh_contents() -> BTreeMap<&'static str, Content> {
    Format::ALL
        .into_iter()
        .map(|format| {
            let schema = match format {
                Format::Json | Format::Gltf => object(),
                _ => binary(),
            };
            (format.media_type(), Content::new(Some(schema)))
        })
        .collect()
}

fn mask_contents() -> BTreeMap<&'static str, Content> {
    [
        "application/gzip",
        "application/nifti",
        "application/x-nifti",
    ]
    .map(|media_type| (media_type, Content::new(Some(binary()))))
    .into()
}

fn report_contents() -> BTreeMap<&'static str, Content> {
    let page = ObjectBuilder::new().schema_type(Type::String);
    [
        ("application/json", Content::new(Some(object()))),
        (
            "text/html",
            ContentBuilder::new()
                .schema(Some(Schema::from(page)))
                .build(),
        ),
    ]
    .into()
}

fn object() -> Schema {
    ObjectBuilder::new().schema_type(Type::Object).into()
}

/// Bytes: OpenAPI 3.1 says so by saying nothing of their form.
fn binary() -> Schema {
    ObjectBuilder::new()
        .schema_type(utoipa::openapi::schema::SchemaType::AnyValue)
        .content_media_type("application/octet-stream")
        .into()
}
