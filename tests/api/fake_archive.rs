//! A small archive with DICOMweb that misbehaves as it is told, for tests.

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use dicom_core::{PrimitiveValue, VR, dicom_value};
use dicom_dictionary_std::{tags, uids};
use dicom_object::InMemDicomObject;
use dicom_object::mem::InMemElement;
use dicom_transfer_syntax_registry::entries::IMPLICIT_VR_LITTLE_ENDIAN;
use dicom_ul::association::{Association, ServerAssociationOptions};
use dicom_ul::pdu::{PDataValue, PDataValueType, Pdu};
use futures::{StreamExt, stream};
use serde_json::{Value, json};
use std::collections::{BTreeMap, VecDeque};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// The fault of the next retrieval or storing.
#[derive(Debug, Clone)]
pub enum Fault {
    /// It is answered with this status.
    Status(u16),
    /// Its answer is cut off.
    Cut,
    /// Its answer does not end.
    Endless,
    /// Its answer's parts have another boundary than its header says.
    Boundary,
    /// Its answer is a page for people.
    Page,
    /// It is sent elsewhere.
    Redirect(String),
    /// It is not answered.
    Silence,
    /// An object is stored, but its answer is lost.
    LostAnswer,
    /// An object is refused with this Failure Reason.
    Failure(u16),
}

/// One request that arrived.
#[derive(Debug, Clone)]
pub struct Asked {
    pub method: Method,
    pub path: String,
    pub headers: HeaderMap,
}

#[derive(Default)]
struct Content {
    series: Vec<Vec<u8>>,
    faults: VecDeque<Fault>,
    storing_faults: VecDeque<Fault>,
    asked: Vec<Asked>,
    stored: BTreeMap<String, Vec<u8>>,
    storings: usize,
    searches: bool,
}

/// The archive.
#[derive(Clone)]
pub struct FakeArchive {
    pub url: String,
    content: Arc<Mutex<Content>>,
}

impl FakeArchive {
    /// An archive with one series of these files.
    pub async fn start(series: &[&[u8]]) -> Self {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let archive = Self {
            url: format!("http://{}/dicom-web", listener.local_addr().unwrap()),
            content: Arc::default(),
        };
        archive.hold(series);
        archive.content.lock().unwrap().searches = true;
        let router = Router::new().fallback(serve).with_state(archive.clone());
        tokio::spawn(async move { axum::serve(listener, router).await });
        archive
    }

    /// Replaces the files of the series.
    pub fn hold(&self, series: &[&[u8]]) {
        let series = series.iter().map(|file| file.to_vec()).collect();
        self.content.lock().unwrap().series = series;
    }

    /// Adds the next faults of retrieving, in this order.
    pub fn fail(&self, faults: &[Fault]) {
        self.content.lock().unwrap().faults.extend(faults.to_vec());
    }

    /// Adds the next faults of storing, in this order.
    pub fn fail_storing(&self, faults: &[Fault]) {
        let mut content = self.content.lock().unwrap();
        content.storing_faults.extend(faults.to_vec());
    }

    /// Loses what was stored.
    pub fn forget(&self) {
        self.content.lock().unwrap().stored.clear();
    }

    /// Nothing goes wrong any more.
    pub fn recover(&self) {
        let mut content = self.content.lock().unwrap();
        content.faults.clear();
        content.storing_faults.clear();
    }

    /// Whether it answers searches.
    pub fn search(&self, searches: bool) {
        self.content.lock().unwrap().searches = searches;
    }

    /// The requests that retrieved or stored.
    pub fn transfers(&self) -> Vec<Asked> {
        let asked = self.asked().into_iter();
        asked
            .filter(|asked| !asked.path.contains("/instances"))
            .collect()
    }

    /// All requests.
    pub fn asked(&self) -> Vec<Asked> {
        self.content.lock().unwrap().asked.clone()
    }

    /// The stored objects by SOP Instance UID, and how often something was stored.
    pub fn stored(&self) -> (BTreeMap<String, Vec<u8>>, usize) {
        let content = self.content.lock().unwrap();
        (content.stored.clone(), content.storings)
    }
}

async fn serve(State(archive): State<FakeArchive>, request: Request) -> Response {
    let (parts, body) = request.into_parts();
    let path = parts.uri.path().to_owned();
    let body = axum::body::to_bytes(body, 64 << 20)
        .await
        .unwrap_or_default();
    let fault = {
        let mut content = archive.content.lock().unwrap();
        content.asked.push(Asked {
            method: parts.method.clone(),
            path: path.clone(),
            headers: parts.headers.clone(),
        });
        match path.ends_with("/instances") {
            true => None,
            false if parts.method == Method::GET => content.faults.pop_front(),
            false => content.storing_faults.pop_front(),
        }
    };
    if path.ends_with("/instances") {
        return archive.found(&parts.uri);
    }
    match (fault, parts.method) {
        (None, Method::GET) => archive.retrieve("part").into_response(),
        (None, _) => {
            archive.keep(&body);
            stored(None)
        }
        (Some(fault), method) => archive.misbehave(fault, &method, &body).await,
    }
}

impl FakeArchive {
    fn found(&self, uri: &Uri) -> Response {
        let content = self.content.lock().unwrap();
        if !content.searches {
            return StatusCode::NOT_IMPLEMENTED.into_response();
        }
        let uids: Vec<String> = match uri.query().and_then(|q| q.strip_prefix("SOPInstanceUID=")) {
            Some(uid) => {
                let stored = content.stored.keys().filter(|stored| *stored == uid);
                stored.cloned().collect()
            }
            None => (0..content.series.len())
                .map(|n| format!("1.2.{n}"))
                .collect(),
        };
        let found: Vec<Value> = uids
            .iter()
            .map(|uid| json!({"00080018": {"vr": "UI", "Value": [uid]}}))
            .collect();
        (
            [(header::CONTENT_TYPE, "application/dicom+json")],
            json!(found).to_string(),
        )
            .into_response()
    }

    fn retrieve(&self, boundary: &str) -> impl IntoResponse {
        let content = self.content.lock().unwrap();
        let mut body = Vec::new();
        for file in &content.series {
            body.extend_from_slice(
                format!("--{boundary}\r\nContent-Type: application/dicom\r\n\r\n").as_bytes(),
            );
            body.extend_from_slice(file);
            body.extend_from_slice(b"\r\n");
        }
        body.extend_from_slice(format!("--{boundary}--\r\n").as_bytes());
        (content_type(), body)
    }

    fn keep(&self, body: &Bytes) {
        let mut content = self.content.lock().unwrap();
        content.storings += 1;
        let text = |bytes: &[u8], end: &[u8]| bytes.windows(end.len()).position(|w| w == end);
        let start = text(body, b"\r\n\r\n").unwrap() + 4;
        let end =
            body.len() - (body.len() - start - text(&body[start..], b"\r\n--ventriform").unwrap());
        let object = body[start..end].to_vec();
        let file = dicom_object::from_reader(object.as_slice()).unwrap();
        let uid = file.meta().media_storage_sop_instance_uid();
        let uid = uid.trim_end_matches('\0').to_owned();
        content.stored.insert(uid, object);
    }

    async fn misbehave(&self, fault: Fault, method: &Method, body: &Bytes) -> Response {
        let start = b"--part\r\nContent-Type: application/dicom\r\n\r\nVOLUME ".to_vec();
        match fault {
            Fault::Status(status) => StatusCode::from_u16(status).unwrap().into_response(),
            Fault::Cut => {
                let pieces: [Result<Vec<u8>, &str>; 2] = [Ok(start), Err("cut")];
                (content_type(), Body::from_stream(stream::iter(pieces))).into_response()
            }
            Fault::Endless => {
                let pieces = stream::iter([start]).chain(stream::repeat(vec![b'x'; 64 << 10]));
                let pieces = pieces.map(Ok::<_, std::io::Error>);
                (content_type(), Body::from_stream(pieces)).into_response()
            }
            Fault::Boundary => self.retrieve("other").into_response(),
            Fault::Page => ([(header::CONTENT_TYPE, "text/html")], "<h1>Hello").into_response(),
            Fault::Redirect(to) => {
                (StatusCode::TEMPORARY_REDIRECT, [(header::LOCATION, to)]).into_response()
            }
            Fault::Silence => {
                tokio::time::sleep(Duration::from_secs(60)).await;
                StatusCode::OK.into_response()
            }
            Fault::LostAnswer => {
                assert_eq!(method, Method::POST);
                self.keep(body);
                let cut: [Result<Vec<u8>, &str>; 1] = [Err("cut")];
                Body::from_stream(stream::iter(cut)).into_response()
            }
            Fault::Failure(reason) => stored(Some(reason)),
        }
    }
}

fn content_type() -> [(header::HeaderName, &'static str); 1] {
    let value = "multipart/related; type=\"application/dicom\"; boundary=part";
    [(header::CONTENT_TYPE, value)]
}

/// The answer to STOW-RS.
fn stored(failure: Option<u16>) -> Response {
    let sequence = |item: Value| json!({"vr": "SQ", "Value": [item]});
    let (status, body) = match failure {
        None => (StatusCode::OK, json!({"00081199": sequence(json!({}))})),
        Some(reason) => {
            let reason = json!({"00081197": {"vr": "US", "Value": [reason]}});
            (StatusCode::CONFLICT, json!({"00081198": sequence(reason)}))
        }
    };
    let headers = [(header::CONTENT_TYPE, "application/dicom+json")];
    (status, headers, body.to_string()).into_response()
}

/// An old archive: it takes Implicit VR Little Endian by C-STORE only.
pub struct FakeScp {
    pub address: String,
    received: Arc<Mutex<Vec<(String, InMemDicomObject)>>>,
}

impl FakeScp {
    /// Starts it; it answers with these statuses, and with success after them.
    pub fn start(statuses: &[u16]) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let scp = Self {
            address: listener.local_addr().unwrap().to_string(),
            received: Arc::default(),
        };
        let received = scp.received.clone();
        let mut statuses: VecDeque<u16> = statuses.iter().copied().collect();
        std::thread::spawn(move || {
            while let Ok((stream, _)) = listener.accept() {
                let status = statuses.pop_front().unwrap_or_default();
                take(stream, status, &received);
            }
        });
        scp
    }

    /// The AE titles and data sets of what came.
    pub fn received(&self) -> Vec<(String, InMemDicomObject)> {
        self.received.lock().unwrap().clone()
    }
}

/// Takes one object.
fn take(stream: TcpStream, status: u16, received: &Mutex<Vec<(String, InMemDicomObject)>>) {
    let mut association = ServerAssociationOptions::new()
        .accept_any()
        .ae_title("OLD")
        .with_transfer_syntax(uids::IMPLICIT_VR_LITTLE_ENDIAN)
        .promiscuous(true)
        .establish(stream)
        .unwrap();
    let titles = format!("{} -> OLD", association.peer_ae_title());
    let implicit = IMPLICIT_VR_LITTLE_ENDIAN.erased();
    let (mut command, mut data_set) = (Vec::new(), Vec::new());
    let context = 'message: loop {
        let Pdu::PData { data } = association.receive().unwrap() else {
            panic!("no data");
        };
        for value in data {
            match value.value_type {
                PDataValueType::Command => command.extend(value.data),
                PDataValueType::Data => {
                    data_set.extend(value.data);
                    if value.is_last {
                        break 'message value.presentation_context_id;
                    }
                }
            }
        }
    };
    let command = InMemDicomObject::read_dataset_with_ts(&command[..], &implicit).unwrap();
    let data_set = InMemDicomObject::read_dataset_with_ts(&data_set[..], &implicit).unwrap();
    received.lock().unwrap().push((titles, data_set));
    let number = |tag, value: u16| InMemElement::new(tag, VR::US, dicom_value!(U16, [value]));
    let same = |tag| {
        let uid = command.get(tag).unwrap().to_str().unwrap().into_owned();
        InMemElement::new(tag, VR::UI, PrimitiveValue::from(uid))
    };
    let response = InMemDicomObject::command_from_element_iter([
        same(tags::AFFECTED_SOP_CLASS_UID),
        number(tags::COMMAND_FIELD, 0x8001),
        number(tags::MESSAGE_ID_BEING_RESPONDED_TO, 1),
        number(tags::COMMAND_DATA_SET_TYPE, 0x0101),
        number(tags::STATUS, status),
        same(tags::AFFECTED_SOP_INSTANCE_UID),
    ]);
    let mut bytes = Vec::new();
    response
        .write_dataset_with_ts(&mut bytes, &implicit)
        .unwrap();
    let answer = PDataValue {
        presentation_context_id: context,
        value_type: PDataValueType::Command,
        is_last: true,
        data: bytes,
    };
    association
        .send(&Pdu::PData { data: vec![answer] })
        .unwrap();
    if let Ok(Pdu::ReleaseRQ) = association.receive() {
        let _ = association.send(&Pdu::ReleaseRP);
    }
}

/// The bytes of the data set in Implicit VR Little Endian.
pub fn implicit(data_set: &InMemDicomObject) -> Vec<u8> {
    let implicit = IMPLICIT_VR_LITTLE_ENDIAN.erased();
    let mut bytes = Vec::new();
    data_set
        .write_dataset_with_ts(&mut bytes, &implicit)
        .unwrap();
    bytes
}
