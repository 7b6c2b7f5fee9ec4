//! Request bodies that cannot be taken: empty, broken off, too slow, too large, or of a type or
//! encoding that the path does not read.

use super::{Problem, shorten};
use axum::http::StatusCode;
use http_body_util::LengthLimitError;
use std::error::Error;
use tower_http::timeout::TimeoutError;
use ventriform_service::config::Size;
use ventriform_service::network::archive::EndlessHeader;

/// Why reading a body of at most `limit` failed. The limits on bodies report through the error's
/// sources; anything else means that the client broke off.
pub fn interrupted(error: &(dyn Error + 'static), limit: Size) -> Problem {
    known_cause(error, limit).unwrap_or_else(|| {
        Problem::bad_request(
            "broken-body",
            format!("The body broke off before its end: {error}."),
        )
        .fix("Send the request again.")
    })
}

/// Why reading a form of at most `limit` failed.
pub fn form_interrupted(error: &(dyn Error + 'static), limit: Size) -> Problem {
    known_cause(error, limit).unwrap_or_else(|| {
        let innermost = causes(error).last().unwrap_or(error);
        malformed_form(&innermost.to_string())
    })
}

/// Why reading a `multipart/related` body of at most `limit` failed.
pub fn related_interrupted(error: &(dyn Error + 'static), limit: Size) -> Problem {
    let endless = causes(error).any(|cause| cause.is::<EndlessHeader>());
    let known = known_cause(error, limit).filter(|_| !endless);
    known.unwrap_or_else(|| {
        let innermost = causes(error).last().unwrap_or(error);
        malformed_related(&innermost.to_string())
    })
}

/// The problem of a limit that was met, if one is among the sources of `error`.
fn known_cause(error: &(dyn Error + 'static), limit: Size) -> Option<Problem> {
    causes(error).find_map(|cause| {
        if cause.is::<LengthLimitError>() {
            Some(too_large(limit))
        } else if cause.is::<TimeoutError>() {
            Some(too_slow())
        } else if cause.is::<EndlessHeader>() {
            Some(malformed_form(&cause.to_string()))
        } else {
            None
        }
    })
}

fn causes<'a>(error: &'a (dyn Error + 'static)) -> impl Iterator<Item = &'a (dyn Error + 'static)> {
    std::iter::successors(Some(error), |cause: &&'a (dyn Error + 'static)| {
        (*cause).source()
    })
}

/// 413: the body is larger than `limit`.
pub fn too_large(limit: Size) -> Problem {
    Problem::new(
        StatusCode::PAYLOAD_TOO_LARGE,
        "body-too-large",
        format!("The body is larger than {limit}, the limit of this service."),
    )
    .fix("Send less (a volume may be gzipped: .nii.gz), or ask the operator to raise the limit.")
}

/// 413: a form has more than `limit` files.
pub fn too_many_files(limit: usize) -> Problem {
    Problem::new(
        StatusCode::PAYLOAD_TOO_LARGE,
        "too-many-parts",
        format!("The form has more than {limit} files."),
    )
    .fix("Send the files of one volume only.")
}

fn too_slow() -> Problem {
    Problem::new(
        StatusCode::REQUEST_TIMEOUT,
        "body-too-slow",
        "The body did not arrive in time.",
    )
    .fix("Send the request again over a faster connection.")
}

/// 400: the form's structure cannot be read.
pub fn malformed_form(reason: &str) -> Problem {
    Problem::bad_request(
        "malformed-form",
        format!("The form cannot be read: {reason}."),
    )
    .fix("Send multipart/form-data with the volume as a file: curl -F file=@volume.nii.gz ...")
}

/// 400: the structure of a `multipart/related` body cannot be read.
pub fn malformed_related(reason: &str) -> Problem {
    Problem::bad_request(
        "malformed-parts",
        format!("The parts of the body cannot be read: {reason}."),
    )
    .fix(
        "Send multipart/related; type=\"application/dicom\"; boundary=..., each object as one part.",
    )
}

/// 400: the body holds no volume.
pub fn empty() -> Problem {
    Problem::bad_request("empty-body", "The body holds no volume.")
        .fix("Send the volume as the body: curl --data-binary @volume.nii.gz ...")
}

/// 400: a form's file of that name holds nothing.
pub fn empty_part(name: &str) -> Problem {
    Problem::bad_request(
        "empty-body",
        format!("The file `{name}` of the form is empty."),
    )
    .at(name)
    .fix("Send the content of the file, or leave this part of the form out.")
}

/// 400: the body is not one JSON object.
pub fn malformed_json(reason: &str) -> Problem {
    Problem::bad_request(
        "malformed-json",
        format!("The body is not a JSON object: {reason}."),
    )
    .fix("Send one JSON object.")
}

/// 415: the path does not read bodies of the media type `found`; `wanted` says which it reads.
pub fn unsupported_type(found: &str, wanted: &str) -> Problem {
    Problem::new(
        StatusCode::UNSUPPORTED_MEDIA_TYPE,
        "unsupported-media-type",
        format!(
            "This path does not read a body of type `{}`.",
            shorten(found)
        ),
    )
    .at("Content-Type")
    .fix(format!("Send the body as {wanted}."))
}

/// 415: the body is compressed for the transfer.
pub fn unsupported_encoding() -> Problem {
    Problem::new(
        StatusCode::UNSUPPORTED_MEDIA_TYPE,
        "unsupported-content-encoding",
        "The service does not support Content-Encoding.",
    )
    .at("Content-Encoding")
    .fix("Send the file as it is; a .nii.gz needs no Content-Encoding.")
}
