//! The files of a series on their way from an archive: `multipart/related` (PS3.18, 8.7.1), read
//! part by part within limits.

use super::answer::unexpected_answer;
use super::pieces::{EndlessHeader, Unparsed};
use super::related::RelatedType;
use crate::base::error::AttemptError;
use crate::base::http_client::ByteStream;
use crate::base::records::Fault;
use futures::{Stream, StreamExt};
use multer::{Constraints, Multipart, SizeLimit};
use std::pin::Pin;
use std::task::{Context, Poll};

/// Limits on a series.
#[derive(Debug, Clone, Copy)]
pub struct PartLimits {
    /// Most bytes of the whole answer.
    pub bytes: u64,
    /// Most files.
    pub parts: usize,
}

/// The files of a series.
pub struct SeriesParts {
    multipart: Multipart<'static>,
    unparsed: Unparsed,
    limits: PartLimits,
    seen: usize,
}

impl SeriesParts {
    /// The parts of a body of that content type.
    ///
    /// # Errors
    /// If it is no `multipart/related` with a boundary.
    pub(super) fn new(
        content_type: &str,
        body: ByteStream,
        limits: PartLimits,
    ) -> Result<Self, AttemptError> {
        let related = RelatedType::parse(content_type);
        let boundary = related
            .and_then(|related| related.boundary)
            .ok_or_else(|| {
                unexpected_answer(
                    "The archive's answer is not `multipart/related` with DICOM files.",
                )
            })?;
        let unparsed = Unparsed::default();
        let body = unparsed.pieces(body);
        let sizes = SizeLimit::new().whole_stream(limits.bytes);
        let constraints = Constraints::new().size_limit(sizes);
        Ok(Self {
            multipart: Multipart::with_constraints(body, boundary, constraints),
            unparsed,
            limits,
            seen: 0,
        })
    }

    /// The next file; `None` after the last.
    ///
    /// # Errors
    /// If the answer is cut off or malformed, or there are too many files.
    pub async fn next(&mut self) -> Result<Option<SeriesPart>, AttemptError> {
        let next = self.multipart.next_field().await;
        let Some(field) = next.map_err(|error| self.trouble(&error))? else {
            return match self.seen {
                0 => Err(unexpected_answer("The archive answered without a file.")),
                _ => Ok(None),
            };
        };
        self.unparsed.reset();
        self.seen += 1;
        if self.seen > self.limits.parts {
            return Err(too_large(format!(
                "The series has more than {} files.",
                self.limits.parts
            )));
        }
        Ok(Some(SeriesPart {
            field,
            unparsed: self.unparsed.clone(),
            limits: self.limits,
        }))
    }

    fn trouble(&self, error: &multer::Error) -> AttemptError {
        trouble(error, self.limits)
    }
}

/// One file: a stream of its bytes.
pub struct SeriesPart {
    field: multer::Field<'static>,
    unparsed: Unparsed,
    limits: PartLimits,
}

impl Stream for SeriesPart {
    type Item = Result<bytes::Bytes, AttemptError>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let piece = std::task::ready!(self.field.poll_next_unpin(context));
        self.unparsed.reset();
        let limits = self.limits;
        Poll::Ready(piece.map(|piece| piece.map_err(|error| trouble(&error, limits))))
    }
}

fn trouble(error: &multer::Error, limits: PartLimits) -> AttemptError {
    match error {
        multer::Error::StreamSizeExceeded { .. } | multer::Error::FieldSizeExceeded { .. } => {
            too_large(format!("The series is larger than {} bytes.", limits.bytes))
        }
        multer::Error::StreamReadFailed(cause) if cause.is::<EndlessHeader>() => unexpected_answer(
            "The archive's answer is malformed: a header or boundary does not end.",
        ),
        multer::Error::StreamReadFailed(_) => {
            AttemptError::retry("The connection to the archive broke off in its answer.")
        }
        _ => unexpected_answer(
            "The archive's answer is malformed: its parts have no proper boundaries.",
        ),
    }
}

fn too_large(what: String) -> AttemptError {
    AttemptError::permanent(
        Fault::TooLarge,
        "too-large",
        what,
        "Ask the operator to raise `body_limit` or `parts_limit`.",
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;
    use futures::stream;

    const PART_LIMITS: PartLimits = PartLimits {
        bytes: 1 << 20,
        parts: 2,
    };

    async fn read(content_type: &str, body: &str) -> Result<Vec<String>, AttemptError> {
        let pieces: Vec<_> = body
            .as_bytes()
            .chunks(7)
            .map(Bytes::copy_from_slice)
            .collect();
        let pieces = stream::iter(pieces.into_iter().map(Ok)).boxed();
        let mut parts = SeriesParts::new(content_type, pieces, PART_LIMITS)?;
        let mut files = Vec::new();
        while let Some(mut part) = parts.next().await? {
            let mut file = Vec::new();
            while let Some(piece) = part.next().await {
                file.extend_from_slice(&piece?);
            }
            files.push(String::from_utf8(file).unwrap());
        }
        Ok(files)
    }

    const RELATED_TYPE: &str = "multipart/related; type=\"application/dicom\"; boundary=\"b:1\"";

    #[tokio::test]
    async fn parts_are_read_as_they_come() {
        let body = "--b:1\r\nContent-Type: application/dicom\r\n\r\none\r\n--b:1\r\n\
                    Content-Type: application/dicom\r\n\r\ntwo --b:1\r\n--b:1--\r\n";
        assert_eq!(
            read(RELATED_TYPE, body).await.unwrap(),
            ["one", "two --b:1"]
        );
    }

    #[tokio::test]
    async fn what_is_not_as_the_standard_says_ends_with_its_reason() {
        let part = "--b:1\r\nContent-Type: application/dicom\r\n\r\none\r\n";
        for (content_type, body, code) in [
            ("text/html", "<html>".to_owned(), "archive-answer"),
            ("multipart/related", part.to_owned(), "archive-answer"),
            (
                RELATED_TYPE,
                "--other\r\n\r\nx\r\n--other--".to_owned(),
                "archive-answer",
            ),
            (RELATED_TYPE, "--b:1--\r\n".to_owned(), "archive-answer"),
            (RELATED_TYPE, part.to_owned(), "archive-answer"),
            (
                RELATED_TYPE,
                format!("{}--b:1--", part.repeat(3)),
                "too-large",
            ),
            (
                RELATED_TYPE,
                format!("--b:1\r\nA: {}", "a".repeat(600_000)),
                "archive-answer",
            ),
        ] {
            match read(content_type, &body).await {
                Err(AttemptError::Permanent(failure)) => {
                    assert_eq!(failure.code, code, "{failure:?}")
                }
                other => panic!("{content_type}: {other:?}"),
            }
        }
    }
}
