//! STOW-RS (PS3.18, 10.5): other systems store DICOM objects by `POST /dicom-web/studies`.
//!
//! Each part of the body is received as an object of C-STORE is: streamed to the disk, checked, and on
//! disk before the answer. One request is one session: its series are taken to be complete a quiet time
//! after its end. The answer is a data set of the DICOM JSON Model.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::edge::quota::reserve_upload;
use crate::openapi::{StowAnswers, UploadProblems};
use crate::wire::client::ClientAddress;
use crate::wire::limits::BodyLimits;
use crate::wire::memory::charge;
use crate::wire::negotiate::require_offer;
use crate::wire::problem::{Answer, body};
use crate::wire::query::NoQuery;
use crate::wire::request::{PathSegments, media_type, refuse_content_encoding};
use axum::body::{Body, Bytes};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::IntoResponse;
use futures::{Stream, StreamExt, TryStreamExt};
use multer::Multipart;
use serde_json::{Map, Value, json};
use ventriform_service::base::dicom_tags::{
    FAILED_SOP_SEQUENCE, FAILURE_REASON, OTHER_FAILURES_SEQUENCE, REFERENCED_SOP_CLASS_UID,
    REFERENCED_SOP_INSTANCE_UID, REFERENCED_SOP_SEQUENCE, RETRIEVE_URL,
};
use ventriform_service::callers::Agent;
use ventriform_service::limits::quotas::Counting;
use ventriform_service::network::archive::{RelatedType, Unparsed};
use ventriform_service::network::intake::{
    Incoming, Origin, Protocol, ReceiveError, Refused, Session, Stated,
};

/// The media types of the answer.
const ANSWER_TYPES: [&str; 2] = ["application/dicom+json", "application/json"];
/// The media type of an object.
const OBJECT_TYPE: &str = "application/dicom";
/// The media type of several.
const RELATED_TYPE: &str = "multipart/related";
/// Memory of a request: what is gathered for a write, here and in the file's writer; and of what is answered about
/// one object.
const REQUEST_MEMORY: u64 = 1 << 20;
const OBJECT_MEMORY: u64 = 1 << 10;
/// The failure reason of a part that holds no object (PS3.18, table I.2-2): cannot understand.
const NOT_UNDERSTOOD: u16 = 0xC000;

/// Store DICOM objects
///
/// The objects of one or several studies, as STOW-RS sends them (PS3.18, 10.5). What can be read becomes a
/// volume: a multi-frame image at once, a series of single slices when nothing more of it comes for
/// a while. The answer names the objects that were stored and those that were not.
#[utoipa::path(post, path = "/dicom-web/studies", tag = "dicomweb", operation_id = "store_instances",
    request_body(content(
        (Vec<u8> = "multipart/related"),
        (Vec<u8> = "application/dicom"))),
    responses(StowAnswers, UploadProblems))]
pub async fn store_instances(
    State(app): State<App>,
    caller: Caller,
    _: NoQuery,
    request: Request,
) -> Answer {
    store(&app, &caller, None, request).await
}

/// Store DICOM objects of a study
///
/// As `POST /dicom-web/studies`; objects of other studies are not stored.
#[utoipa::path(post, path = "/dicom-web/studies/{study}", tag = "dicomweb",
    operation_id = "store_study_instances",
    params(("study" = String, Path, description = "Study Instance UID")),
    request_body(content(
        (Vec<u8> = "multipart/related"),
        (Vec<u8> = "application/dicom"))),
    responses(StowAnswers, UploadProblems))]
pub async fn store_study_instances(
    State(app): State<App>,
    caller: Caller,
    PathSegments(study): PathSegments<String>,
    _: NoQuery,
    request: Request,
) -> Answer {
    store(&app, &caller, Some(study), request).await
}

/// The outcome of the objects of a request.
#[derive(Default)]
struct Outcome {
    /// SOP Class and Instance UIDs of those that are stored.
    stored: Vec<(String, String)>,
    /// The same of those that are not, with the failure reason.
    failed: Vec<(String, String, u16)>,
    /// Failure reasons of parts of which not even that is known.
    others: Vec<u16>,
}

impl Outcome {
    fn status(&self) -> StatusCode {
        match (
            self.stored.is_empty(),
            self.failed.is_empty() && self.others.is_empty(),
        ) {
            (_, true) => StatusCode::OK,
            (false, false) => StatusCode::ACCEPTED,
            (true, false) => StatusCode::CONFLICT,
        }
    }

    /// The Store Instances Response Module (PS3.18, annex I) in the DICOM JSON Model.
    fn module(&self) -> Value {
        let reference = |class: &str, instance: &str| {
            let mut item = Map::new();
            item.insert(
                REFERENCED_SOP_CLASS_UID.into(),
                json!({"vr": "UI", "Value": [class]}),
            );
            item.insert(
                REFERENCED_SOP_INSTANCE_UID.into(),
                json!({"vr": "UI", "Value": [instance]}),
            );
            item
        };
        let reason = |status: u16| json!({"vr": "US", "Value": [status]});
        let stored = self.stored.iter().map(|(class, instance)| {
            let mut item = reference(class, instance);
            item.insert(RETRIEVE_URL.into(), json!({"vr": "UR"}));
            Value::Object(item)
        });
        let failed = self.failed.iter().map(|(class, instance, status)| {
            let mut item = reference(class, instance);
            item.insert(FAILURE_REASON.into(), reason(*status));
            Value::Object(item)
        });
        let others = self
            .others
            .iter()
            .map(|status| json!({FAILURE_REASON: reason(*status)}));
        // Stored objects are not retrieved from here, so no URL is known.
        let mut module = Map::new();
        module.insert(RETRIEVE_URL.into(), json!({"vr": "UR"}));
        let sequences: [(&str, Vec<Value>); 3] = [
            (FAILED_SOP_SEQUENCE, failed.collect()),
            (REFERENCED_SOP_SEQUENCE, stored.collect()),
            (OTHER_FAILURES_SEQUENCE, others.collect()),
        ];
        for (tag, items) in sequences {
            if !items.is_empty() {
                module.insert(tag.into(), json!({"vr": "SQ", "Value": items}));
            }
        }
        Value::Object(module)
    }

    fn refuse(&mut self, refused: Refused) {
        let status = refused.error.status();
        match refused.header {
            Some(header) => {
                let failed = (header.sop_class, header.sop_instance, status);
                self.failed.push(failed);
            }
            None => self.others.push(status),
        }
    }
}

/// A request under way.
struct Storing<'a> {
    app: &'a App,
    by: Agent,
    study: Option<String>,
    origin: Origin,
    session: Session,
    counting: Counting,
    outcome: Outcome,
}

impl Storing<'_> {
    /// Receives one object.
    ///
    /// # Errors
    /// The problem in the body; objects that are not stored are no error.
    async fn object(&mut self, pieces: impl Stream<Item = Answer<Bytes>>) -> Answer<()> {
        let receiver = self.app.service.receiver();
        let mut pieces = std::pin::pin!(pieces);
        let mut object: Result<Incoming, ReceiveError> = receiver.begin().await;
        while let Some(piece) = pieces.next().await {
            let piece = piece?;
            self.counting.arrived(piece.len() as u64).await?;
            if let Ok(incoming) = &mut object
                && let Err(error) = incoming.write(&piece).await
            {
                object = Err(error);
            }
        }
        let stated = Stated {
            object: None,
            study: self.study.as_deref(),
        };
        let stored = match object {
            Ok(incoming) => {
                let (by, session) = (&self.by, &mut self.session);
                let stored = receiver.store(by, incoming, stated, &self.origin, session);
                stored.await
            }
            Err(error) => {
                receiver.note(Protocol::StowRs, &Err(&error), 0);
                Err(Refused {
                    error,
                    header: None,
                })
            }
        };
        match stored {
            Ok((_, header)) => {
                let stored = (header.sop_class, header.sop_instance);
                self.outcome.stored.push(stored);
            }
            Err(refused) => self.outcome.refuse(refused),
        }
        Ok(())
    }

    /// Receives the objects of a `multipart/related` body.
    async fn parts(&mut self, request: Request, boundary: String) -> Answer<()> {
        let limit = BodyLimits::from_request(&request)?.size;
        let unparsed = Unparsed::default();
        let pieces = unparsed.pieces(request.into_body().into_data_stream());
        let mut parts = Multipart::new(pieces, boundary);
        let interrupted = |error: multer::Error| body::related_interrupted(&error, limit);
        let mut count = 0;
        while let Some(part) = parts.next_field().await.map_err(interrupted)? {
            unparsed.reset();
            charge(OBJECT_MEMORY).await?;
            count += 1;
            let most = self.app.service.settings().parts_limit;
            if count > most {
                return Err(body::too_many_files(most));
            }
            let essence = part
                .content_type()
                .map(|kind| kind.essence_str().to_owned());
            let is_object = essence.is_none_or(|kind| kind == OBJECT_TYPE);
            let pieces = part.inspect_ok(|_| unparsed.reset()).map_err(interrupted);
            if is_object {
                self.object(pieces).await?;
            } else {
                pieces.try_for_each(|_| async { Ok(()) }).await?;
                self.outcome.others.push(NOT_UNDERSTOOD);
            }
        }
        Ok(())
    }
}

async fn store(app: &App, caller: &Caller, study: Option<String>, request: Request) -> Answer {
    require_offer(request.headers(), &ANSWER_TYPES)?;
    refuse_content_encoding(request.headers())?;
    let limits = BodyLimits::from_request(&request)?;
    let boundary = boundary(request.headers())?;
    charge(REQUEST_MEMORY).await?;
    let mut storing = Storing {
        app,
        by: caller.by.clone(),
        study,
        origin: Origin {
            tenant: caller.tenant.clone(),
            protocol: Protocol::StowRs,
            sender: caller.name.clone(),
            address: ClientAddress::current().to_string(),
        },
        session: app.service.sessions().begin(),
        counting: reserve_upload(app, caller, request.headers(), 0).await?,
        outcome: Outcome::default(),
    };
    match boundary {
        Some(boundary) => storing.parts(request, boundary).await?,
        None => {
            let body: Body = request.into_body();
            let pieces = body.into_data_stream();
            let pieces = pieces.map_err(|error| body::interrupted(&error, limits.size));
            storing.object(pieces).await?;
        }
    }
    let Storing {
        session, outcome, ..
    } = storing;
    session.release();
    if outcome.stored.is_empty() && outcome.failed.is_empty() && outcome.others.is_empty() {
        return Err(body::malformed_related("it has no part"));
    }
    let headers = [
        (header::CONTENT_TYPE, ANSWER_TYPES[0]),
        (header::CACHE_CONTROL, "no-store"),
    ];
    let module = outcome.module().to_string();
    Ok((outcome.status(), headers, module).into_response())
}

/// The boundary of a body of several objects; `None` for a body that is one.
fn boundary(headers: &HeaderMap) -> Answer<Option<String>> {
    let wanted = "multipart/related; type=\"application/dicom\", or application/dicom";
    let given = media_type(headers).unwrap_or_default();
    if given == OBJECT_TYPE {
        return Ok(None);
    }
    let text = headers.get(header::CONTENT_TYPE);
    let text = text.and_then(|value| value.to_str().ok());
    let Some(related) = text.and_then(RelatedType::parse) else {
        return Err(body::unsupported_type(&given, wanted));
    };
    if !related.is_dicom() {
        let found = related.parts.unwrap_or_default();
        let found = format!("{RELATED_TYPE}; type=\"{found}\"");
        return Err(body::unsupported_type(&found, wanted));
    }
    let boundary = related.boundary;
    let boundary =
        boundary.ok_or_else(|| body::malformed_related("Content-Type has no `boundary`"))?;
    Ok(Some(boundary))
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;

    #[test]
    fn the_boundary_is_read_as_senders_write_it() {
        let of = |value: &str| {
            let headers = [(header::CONTENT_TYPE, value.parse().unwrap())];
            boundary(&headers.into_iter().collect())
        };
        for value in [
            "multipart/related; type=\"application/dicom\"; boundary=b-1",
            "Multipart/Related; boundary=\"b-1\"; type=application/dicom",
            "multipart/related; boundary=b-1",
        ] {
            assert_eq!(of(value).unwrap().as_deref(), Some("b-1"), "{value}");
        }
        assert_eq!(of("application/dicom; transfer-syntax=*").unwrap(), None);
        for (value, status) in [
            ("multipart/related; type=\"application/dicom\"", 400),
            (
                "multipart/related; type=\"application/dicom+json\"; boundary=b",
                415,
            ),
            ("multipart/form-data; boundary=b", 415),
            ("text/plain", 415),
        ] {
            let problem = of(value).unwrap_err().into_body();
            assert_eq!(problem.status, status, "{value}");
        }
    }

    #[test]
    fn the_status_says_whether_all_some_or_none_are_stored() {
        let mut outcome = Outcome::default();
        outcome.stored.push(("1.2".into(), "1.2.3".into()));
        assert_eq!(outcome.status(), StatusCode::OK);
        outcome.others.push(0xC000);
        assert_eq!(outcome.status(), StatusCode::ACCEPTED);
        let module = outcome.module();
        assert_eq!(
            module["00081199"]["Value"][0]["00081155"]["Value"][0],
            "1.2.3"
        );
        assert_eq!(
            module["0008119A"]["Value"][0]["00081197"]["Value"][0],
            0xC000
        );
        assert_eq!(module.get("00081198"), None);
        outcome.stored.clear();
        assert_eq!(outcome.status(), StatusCode::CONFLICT);
    }
}
