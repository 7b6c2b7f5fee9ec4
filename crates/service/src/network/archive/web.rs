//! The archive's DICOMweb services (PS3.18): QIDO-RS, WADO-RS and STOW-RS.
//!
//! Redirects are followed within the archive's own scheme, host and port only. For a URL without a
//! configured archive, connections go to the addresses that the guard has checked.

use super::answer::unexpected_answer;
use super::answer::{Read, Step, find, listed};
use super::parts::{PartLimits, SeriesParts};
use super::{Archive, Credentials};
use crate::base::dicom_tags::{FAILED_SOP_SEQUENCE, FAILURE_REASON, SOP_INSTANCE_UID};
use crate::base::error::AttemptError;
use crate::base::http_client::{
    ByteStream, ClientError, ClientFactory, ClientOptions, HttpClient, Redirects, SendError,
    USER_AGENT, bounded_body, build_client, request_uri,
};
use crate::base::records::{Failure, Fault, Timestamp};
use crate::network::hooks::{Pin, PinnedNames, UrlGuard, retry_after};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use bytes::Bytes;
use http::header::{
    ACCEPT, AUTHORIZATION, CONTENT_LENGTH, CONTENT_TYPE, HeaderMap, HeaderName, HeaderValue,
    InvalidHeaderValue,
};
use http::{Method, Request, Response, StatusCode};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Most bytes of a search's answer for each object that a series may have. PS3.18 (10.6.3.3) has some 40 attributes in
/// an answer about an instance, those of its study and its series included, of 60 to 100 bytes each as JSON.
const FOUND_BYTES: usize = 4 << 10;
/// Most bytes of a search's answer beside those.
const SEARCH_BYTES: usize = 64 << 10;
/// Most bytes of the answer about one stored object: a few hundred for what PS3.18 (annex I) has, and room for the
/// attributes that the archive has changed, or for a page of text.
const STORED_BYTES: usize = 256 << 10;

/// Longest time to connect.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// Most redirects within an archive.
const MAX_REDIRECTS: usize = 3;

/// Time for which an unused connection is kept.
const IDLE_TIMEOUT: Duration = Duration::from_secs(10);

const DICOM_JSON: &str = "application/dicom+json";
const PART_BOUNDARY: &str = "ventriform-dicom-object";

/// Connects to DICOMweb services.
pub struct WebClients {
    factory: Arc<dyn ClientFactory>,
    /// Which services may be used beside the configured archives.
    guard: UrlGuard,
    names: PinnedNames,
    timeout: Duration,
    /// Most objects of a series.
    objects: usize,
    /// Made for the first use: reading the system's certificates takes time and memory. By the
    /// name of the archive; the empty name is for URLs without one.
    clients: Mutex<BTreeMap<String, Arc<dyn HttpClient>>>,
}

/// One DICOMweb service.
pub struct DicomWeb {
    client: Arc<dyn HttpClient>,
    base: String,
    credentials: Credentials,
    now: Timestamp,
    /// Most objects that a search may find.
    objects: usize,
    /// Keeps the checked addresses.
    _pin: Option<Pin>,
}

/// The outcome of an object that was sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stored {
    /// It was stored now.
    Now,
    /// It was there already.
    Before,
}

impl WebClients {
    /// Clients of that factory that allow pauses of that length in answers, and so many objects in a series.
    pub fn new(
        factory: Arc<dyn ClientFactory>,
        guard: UrlGuard,
        timeout: Duration,
        objects: usize,
    ) -> Self {
        Self {
            factory,
            guard,
            names: PinnedNames::default(),
            timeout,
            objects,
            clients: Mutex::default(),
        }
    }

    /// The DICOMweb service of a configured archive.
    ///
    /// # Errors
    /// If it has none, or the file of its authorities cannot be read.
    pub async fn client(
        &self,
        archive: &Archive,
        now: Timestamp,
    ) -> Result<DicomWeb, AttemptError> {
        let base = archive.dicomweb.clone().ok_or_else(|| {
            AttemptError::retry("The archive has no `dicomweb` in the settings any more.")
        })?;
        let client = match self.known(&archive.name) {
            Some(client) => client,
            None => {
                let mut options = self.options();
                options.redirects = Redirects::WithinOrigin(MAX_REDIRECTS);
                if let Some(path) = &archive.ca_file {
                    let pem = tokio::fs::read(path).await;
                    let pem = pem.map_err(|error| unusable_authorities(&archive.name, &error))?;
                    options.authorities = Some(pem);
                }
                self.made(&archive.name, options).await?
            }
        };
        Ok(DicomWeb {
            client,
            base,
            credentials: archive.credentials.clone(),
            now,
            objects: self.objects,
            _pin: None,
        })
    }

    /// The DICOMweb service at a URL that a job gave.
    ///
    /// # Errors
    /// If the guard does not let it pass.
    pub async fn at(&self, url: &str, now: Timestamp) -> Result<DicomWeb, AttemptError> {
        let checked = self.guard.resolve(url).await.map_err(|refusal| {
            AttemptError::permanent(
                Fault::Request,
                "invalid-field",
                format!("Nothing can be fetched from the source's URL. {refusal}"),
                "Name a configured archive, or ask the operator for an entry in `[[archives]]`.",
            )
        })?;
        let pin = self.names.pin(&checked);
        let client = match self.known("") {
            Some(client) => client,
            None => {
                let mut options = self.options();
                options.resolver = Some(Arc::new(self.names.clone()));
                self.made("", options).await?
            }
        };
        Ok(DicomWeb {
            client,
            base: url.trim_end_matches('/').to_owned(),
            credentials: Credentials::None,
            now,
            objects: self.objects,
            _pin: Some(pin),
        })
    }

    /// The rules for all archives.
    fn options(&self) -> ClientOptions {
        ClientOptions {
            redirects: Redirects::Never,
            idle_timeout: IDLE_TIMEOUT,
            connect_timeout: Some(CONNECT_TIMEOUT.min(self.timeout)),
            read_timeout: Some(self.timeout),
            user_agent: Some(USER_AGENT),
            ..ClientOptions::default()
        }
    }

    fn known(&self, name: &str) -> Option<Arc<dyn HttpClient>> {
        let clients = self.clients.lock().unwrap_or_else(PoisonError::into_inner);
        clients.get(name).cloned()
    }

    async fn made(
        &self,
        name: &str,
        options: ClientOptions,
    ) -> Result<Arc<dyn HttpClient>, AttemptError> {
        let built = build_client(self.factory.clone(), options).await;
        let client = built.map_err(|error| match error {
            ClientError::Authorities(_) => unusable_authorities(name, &error),
            ClientError::Client(_) => {
                tracing::error!(%error, "archives cannot be reached");
                AttemptError::retry("The connection to the archive could not be set up.")
            }
        })?;
        let mut clients = self.clients.lock().unwrap_or_else(PoisonError::into_inner);
        clients.insert(name.to_owned(), client.clone());
        Ok(client)
    }
}

fn unusable_authorities(archive: &str, error: &dyn std::error::Error) -> AttemptError {
    let error = error.to_string();
    tracing::error!(archive, error, "ca_file is unusable");
    AttemptError::retry("The file `ca_file` of the archive cannot be used.")
}

impl DicomWeb {
    /// Its base URL.
    pub fn base(&self) -> &str {
        &self.base
    }

    /// The SOP Instance UIDs of a series, as the archive lists them; `None` if it does not say, or lists more than a
    /// series may have.
    ///
    /// # Errors
    /// If the archive does not answer, or its answer is longer than any that can be used.
    pub async fn instances(
        &self,
        study: &str,
        series: &str,
    ) -> Result<Option<Vec<String>>, AttemptError> {
        self.search(&format!("studies/{study}/series/{series}/instances"))
            .await
    }

    /// Whether the archive has that object; `None` if it does not say.
    ///
    /// # Errors
    /// If the archive does not answer.
    pub async fn has(&self, study: &str, instance: &str) -> Result<Option<bool>, AttemptError> {
        let path = format!("studies/{study}/instances?SOPInstanceUID={instance}");
        let found = self.search(&path).await?;
        Ok(found.map(|found| found.iter().any(|uid| uid == instance)))
    }

    /// The SOP Instance UIDs that a search finds.
    async fn search(&self, path: &str) -> Result<Option<Vec<String>>, AttemptError> {
        let headers = [(ACCEPT, DICOM_JSON)];
        let answer = self.send(Method::GET, path, &headers, Bytes::new()).await?;
        match answer.status() {
            StatusCode::NO_CONTENT => return Ok(Some(Vec::new())),
            StatusCode::OK => {}
            StatusCode::UNAUTHORIZED => return Err(unauthorised()),
            // It does not search, or not so.
            status if status == StatusCode::NOT_IMPLEMENTED || !may_pass(status) => {
                return Ok(None);
            }
            status => return Err(busy(status, answer.headers(), self.now)),
        }
        let most = SEARCH_BYTES.saturating_add(FOUND_BYTES.saturating_mul(self.objects));
        let bytes = limited(answer, most).await?;
        Ok(uids(&bytes, self.objects))
    }

    /// The files of a series, as they are stored.
    ///
    /// # Errors
    /// If the archive does not have it, does not give it, or does not answer.
    pub async fn series(
        &self,
        study: &str,
        series: &str,
        limits: PartLimits,
    ) -> Result<SeriesParts, AttemptError> {
        let path = format!("studies/{study}/series/{series}");
        let headers = [(
            ACCEPT,
            "multipart/related; type=\"application/dicom\"; transfer-syntax=*",
        )];
        let answer = self
            .send(Method::GET, &path, &headers, Bytes::new())
            .await?;
        let status = answer.status();
        if status != StatusCode::OK {
            return Err(match status {
                StatusCode::NOT_FOUND | StatusCode::GONE | StatusCode::NO_CONTENT => {
                    AttemptError::permanent(
                        Fault::Content,
                        "no-such-series",
                        "The archive has no such series.",
                        "Check the Study and the Series Instance UID, and that the archive has \
                         received the series.",
                    )
                }
                status => refused(status, answer.headers(), self.now),
            });
        }
        let length = text(answer.headers(), CONTENT_LENGTH.as_str()).parse::<u64>();
        if length.is_ok_and(|length| length > limits.bytes) {
            return Err(AttemptError::permanent(
                Fault::TooLarge,
                "too-large",
                format!("The series is larger than {} bytes.", limits.bytes),
                "Ask the operator to raise `body_limit`.",
            ));
        }
        let content_type = text(answer.headers(), CONTENT_TYPE.as_str()).to_owned();
        SeriesParts::new(&content_type, answer.into_body(), limits)
    }

    /// Stores an object.
    ///
    /// # Errors
    /// If the archive does not take it, or does not answer.
    pub async fn store(&self, object: &[u8]) -> Result<Stored, AttemptError> {
        let head = format!("--{PART_BOUNDARY}\r\nContent-Type: application/dicom\r\n\r\n");
        let tail = format!("\r\n--{PART_BOUNDARY}--\r\n");
        let body = [head.as_bytes(), object, tail.as_bytes()].concat();
        let content_type =
            format!("multipart/related; type=\"application/dicom\"; boundary={PART_BOUNDARY}");
        let headers = [(CONTENT_TYPE, content_type.as_str()), (ACCEPT, DICOM_JSON)];
        let answer = self
            .send(Method::POST, "studies", &headers, Bytes::from(body))
            .await?;
        let status = answer.status();
        if !matches!(status.as_u16(), 200 | 202 | 409) {
            return Err(refused(status, answer.headers(), self.now));
        }
        let bytes = limited(answer, STORED_BYTES).await?;
        judge(status, &bytes)
    }

    /// Sends a request for a path below its base, with its credentials.
    async fn send(
        &self,
        method: Method,
        path: &str,
        headers: &[(HeaderName, &str)],
        body: Bytes,
    ) -> Result<Response<ByteStream>, AttemptError> {
        let sent = async {
            let uri = request_uri(&format!("{}/{path}", self.base))?;
            let unusable = |error: http::Error| SendError::Request(error.to_string());
            let mut request = Request::builder().method(method).uri(uri);
            for (name, value) in headers {
                request = request.header(name, *value);
            }
            if let Some(value) = authorization(&self.credentials) {
                request = request.header(AUTHORIZATION, value.map_err(|e| unusable(e.into()))?);
            }
            self.client
                .send(request.body(body).map_err(unusable)?)
                .await
        };
        sent.await.map_err(|error| {
            AttemptError::retry(match error {
                SendError::Timeout => "The archive did not answer in time.",
                _ => "The archive could not be reached, or broke the connection off.",
            })
        })
    }
}

/// The value of `Authorization` (RFC 7617, RFC 6750), which logs must not show.
fn authorization(credentials: &Credentials) -> Option<Result<HeaderValue, InvalidHeaderValue>> {
    let value = match credentials {
        Credentials::None => return None,
        Credentials::Basic { username, password } => {
            let pair = STANDARD.encode(format!("{username}:{password}"));
            format!("Basic {pair}")
        }
        Credentials::Bearer(token) => format!("Bearer {token}"),
    };
    Some(HeaderValue::try_from(value).map(|mut value| {
        value.set_sensitive(true);
        value
    }))
}

/// The SOP Instance UIDs in an answer to QIDO-RS; `None` if it is no list of objects that have one, or of more than
/// `most`.
fn uids(answer: &[u8], most: usize) -> Option<Vec<String>> {
    let uid = [
        Step::Member(SOP_INSTANCE_UID),
        Step::Member("Value"),
        Step::First,
    ];
    listed(answer, &uid, most).ok()
}

/// The outcome for the only object in an answer to STOW-RS (PS3.18, 10.5.3; Store Instances Response
/// Module, PS3.18 annex I).
fn judge(status: StatusCode, answer: &[u8]) -> Result<Stored, AttemptError> {
    /// To the reason why the first object failed. The first steps lead to that object.
    const REASON: [Step; 6] = [
        Step::Member(FAILED_SOP_SEQUENCE),
        Step::Member("Value"),
        Step::First,
        Step::Member(FAILURE_REASON),
        Step::Member("Value"),
        Step::First,
    ];
    const STEPS_TO_FAILED: usize = 3;
    let found = find(answer, &REASON).ok();
    match found {
        Some(found) if found.steps >= STEPS_TO_FAILED => store_failure(match found.value {
            Read::Number(reason) => u16::try_from(reason).ok(),
            _ => None,
        }),
        _ => {
            let is_json = found.is_some();
            let said = match status {
                StatusCode::OK => is_json || answer.is_empty() || is_xml_without_failure(answer),
                StatusCode::ACCEPTED => is_json,
                _ => false,
            };
            if said {
                Ok(Stored::Now)
            } else {
                Err(AttemptError::retry(
                    "The archive did not say whether it has stored the object.",
                ))
            }
        }
    }
}

/// Whether it is the Native DICOM Model (PS3.19 A.1) of a response that lists no failure.
fn is_xml_without_failure(answer: &[u8]) -> bool {
    let text = String::from_utf8_lossy(answer);
    let model = text.contains("<NativeDicomModel");
    model && !text.contains(FAILED_SOP_SEQUENCE) && !text.contains("FailedSOPSequence")
}

/// The meaning of a Failure Reason of STOW-RS or a status of C-STORE (PS3.3 C.14, PS3.4 B.2.3).
pub(super) fn store_failure(reason: Option<u16>) -> Result<Stored, AttemptError> {
    let refuses = |what: &str| {
        let code = reason.unwrap_or_default();
        AttemptError::permanent(
            Fault::Service,
            "archive-refuses",
            format!("The archive does not take the object: {what} (reason {code:04X}H)."),
            "Ask the archive's administrator; then send it again.",
        )
    };
    match reason {
        Some(0x0111) => Ok(Stored::Before),
        Some(0x0122 | 0xA800) => Err(refuses("it does not support the SOP class")),
        Some(0xA900..=0xA9FF) => Err(refuses("the data set does not match the SOP class")),
        Some(0xC000..=0xCFFF) => Err(refuses("it cannot understand the data set")),
        Some(0x0124) => Err(AttemptError::retry(
            "The archive does not allow this service to store (reason 0124H).",
        )),
        Some(code) => Err(AttemptError::retry(format!(
            "The archive could not store the object (reason {code:04X}H)."
        ))),
        None => Err(AttemptError::retry(
            "The archive could not store the object.",
        )),
    }
}

/// Whether a request that was answered so can succeed later.
fn may_pass(status: StatusCode) -> bool {
    status.is_server_error() || matches!(status.as_u16(), 408 | 425 | 429)
}

fn busy(status: StatusCode, headers: &HeaderMap, now: Timestamp) -> AttemptError {
    AttemptError::Retry {
        why: format!("The archive answered with status {}.", status.as_u16()),
        asked: retry_after(headers, now),
    }
}

fn unauthorised() -> AttemptError {
    AttemptError::Permanent(
        Failure::new(
            Fault::Service,
            "archive-credentials",
            "The archive does not accept the credentials of this service (status 401).",
        )
        .fix(
            "Ask the operator to check the variables that `username_env` and `password_env`, or \
             `token_env`, of the archive name.",
        ),
    )
}

fn refused(status: StatusCode, headers: &HeaderMap, now: Timestamp) -> AttemptError {
    match status {
        StatusCode::UNAUTHORIZED => unauthorised(),
        status if may_pass(status) => busy(status, headers, now),
        status if status.is_redirection() => {
            unexpected_answer("The archive sends elsewhere (redirect), which is not followed.")
        }
        status => AttemptError::permanent(
            Fault::Service,
            "archive-refuses",
            format!(
                "The archive refuses the request with status {}.",
                status.as_u16()
            ),
            "Ask the operator whether the archive allows this service to do that.",
        ),
    }
}

/// The body of an answer, if it has no more than `most` bytes.
async fn limited(answer: Response<ByteStream>, most: usize) -> Result<Vec<u8>, AttemptError> {
    let read = bounded_body(answer.into_body(), most).await;
    let read = read.map_err(|_| {
        AttemptError::retry("The connection to the archive broke off in its answer.")
    })?;
    read.ok_or_else(|| {
        unexpected_answer(format!("The archive's answer has more than {most} bytes."))
    })
}

fn text<'a>(headers: &'a HeaderMap, name: &str) -> &'a str {
    let value = headers.get(name).and_then(|value| value.to_str().ok());
    value.unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::super::answer::TEXT_BYTES;
    use super::*;

    /// The example of RFC 7617, section 2, and that of RFC 6750, section 2.1.
    #[test]
    fn credentials_are_sent_as_the_standards_say_and_logged_by_nobody() {
        let basic = Credentials::Basic {
            username: "Aladdin".into(),
            password: "open sesame".into(),
        };
        let bearer = Credentials::Bearer("mF_9.B5f-4.1JqM".into());
        for (credentials, sent) in [
            (basic, "Basic QWxhZGRpbjpvcGVuIHNlc2FtZQ=="),
            (bearer, "Bearer mF_9.B5f-4.1JqM"),
        ] {
            let value = authorization(&credentials).unwrap().unwrap();
            assert_eq!(value, sent);
            assert_eq!(format!("{value:?}"), "Sensitive");
        }
        assert!(authorization(&Credentials::None).is_none());
        let broken = Credentials::Bearer("two\nlines".into());
        assert!(authorization(&broken).unwrap().is_err());
    }

    #[test]
    fn each_object_of_a_stow_answer_is_judged_by_itself() {
        let failed = |reason: u32| {
            format!(
                r#"{{"00081198": {{"vr": "SQ", "Value": [{{"00081197": {{"vr": "US", "Value": [{reason}]}}}}]}}}}"#
            )
        };
        let judge =
            |status: u16, body: &str| judge(StatusCode::from_u16(status).unwrap(), body.as_bytes());
        let stored = r#"{"00081199": {"vr": "SQ", "Value": [{}]}}"#;
        assert_eq!(judge(200, stored).unwrap(), Stored::Now);
        assert_eq!(judge(200, "").unwrap(), Stored::Now);
        assert_eq!(judge(202, stored).unwrap(), Stored::Now);
        let xml = "<?xml version=\"1.0\"?><NativeDicomModel>";
        assert_eq!(judge(200, xml).unwrap(), Stored::Now);
        assert!(judge(200, &format!("{xml}<DicomAttribute tag=\"00081198\"")).is_err());
        assert!(judge(200, "<html>Log in").is_err());
        assert_eq!(judge(409, &failed(0x0111)).unwrap(), Stored::Before);
        for status in [200, 202, 409] {
            let refused = judge(status, &failed(0xC000)).unwrap_err();
            assert!(refused.why().contains("C000H"));
            assert!(matches!(refused, AttemptError::Permanent(_)));
            let full = judge(status, &failed(0xA700)).unwrap_err();
            assert!(matches!(full, AttemptError::Retry { .. }), "{full:?}");
        }
        assert!(matches!(
            judge(202, "<xml/>"),
            Err(AttemptError::Retry { .. })
        ));
        assert!(matches!(judge(409, ""), Err(AttemptError::Retry { .. })));
        // A failure is one, however odd its description is.
        for odd in ["null", "{}", "7", r#"{"00081197": {"Value": ["x"]}}"#] {
            let body = format!(r#"{{"00081198": {{"Value": [{odd}]}}}}"#);
            let unsaid = judge(200, &body).unwrap_err();
            assert!(matches!(unsaid, AttemptError::Retry { .. }), "{odd}");
        }
    }

    #[test]
    fn a_search_keeps_the_uids_of_its_answer_and_no_more_than_a_series_has() {
        let object =
            r#"{"00080018": {"vr": "UI", "Value": ["1.2.3"]}, "00080060": {"Value": [[0]]}}"#;
        let three = format!("[{object}, {object}, {object}]");
        let uid = "1.2.3".to_owned();
        assert_eq!(uids(three.as_bytes(), 3), Some(vec![uid; 3]));
        assert_eq!(uids(three.as_bytes(), 2), None);
        assert_eq!(uids(b"[]", 2), Some(Vec::new()));
        let long = object.replace("1.2.3", &"1".repeat(TEXT_BYTES + 1));
        for odd in [
            long.as_str(),
            "{\"\":0}",
            "0",
            "null",
            "[0]",
            "{\"00080018\": 0}",
        ] {
            assert_eq!(uids(format!("[{odd}]").as_bytes(), 9), None, "{odd}");
        }
        assert_eq!(uids(object.as_bytes(), 9), None);
        assert_eq!(uids(b"[", 9), None);
        assert_eq!(uids(format!("{three}]").as_bytes(), 9), None);
    }
}
