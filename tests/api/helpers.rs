//! Starts a service for each test, with a fake computation.

use crate::s3_server;
use reqwest::header::{AUTHORIZATION, HeaderValue};
use reqwest::{Client, Method, RequestBuilder, Response, StatusCode};
use serde_json::{Map, Value, json};
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use ventriform::base::progress::{Monitor, Plan, Stage};
use ventriform::image::volume::ReadLimits;
use ventriform::image::volume::given_mask::MaskChoice;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PhantomParameters, phantom};
use ventriform::mesh::TriMesh;
use ventriform::mesh::files::MeshStatement;
use ventriform::mesh::shapes::icosphere;
use ventriform::results::export::{self, Format, Metadata};
use ventriform_http::{document_json, install_cryptography};
use ventriform_program::server::{Running, start};
use ventriform_service::base::records::{
    Clock, Cutoff, Failure, Fault, LocalFile, Resource, ScanFields, SystemClock, Timestamp,
    TrustedNow,
};
use ventriform_service::callers::{
    AccessStore, Activity, ApiKey, AuditEvent, KeyRequest, Maker, Quota, Scope,
};
use ventriform_service::config::Settings;
use ventriform_service::items::{OutputFile, StoredItem, WorkOutput};
use ventriform_service::jobs::{GivenParameters, Needs, Work, WorkError, WorkInput};
use ventriform_service::work::{Engine, IntensityFacts, UploadFacts, UploadReader};
use ventriform_store::{SqlStore, open_database, open_rows};

/// Time for which a test waits for a job or another event before it fails.
const EVENT_PATIENCE: Duration = Duration::from_secs(60);

/// A client of one service.
pub struct Api {
    pub client: Client,
    pub url: String,
}

impl Api {
    fn new(url: String) -> Self {
        install_cryptography();
        let client = Client::new();
        Self { client, url }
    }

    /// A client that sends that API key with every request.
    fn with_key(url: String, key: &str) -> Self {
        let mut bearer: HeaderValue = format!("Bearer {key}").parse().unwrap();
        bearer.set_sensitive(true);
        let headers = [(AUTHORIZATION, bearer)].into_iter().collect();
        let client = Client::builder().default_headers(headers).build().unwrap();
        Self { client, url }
    }

    pub fn get(&self, path: &str) -> RequestBuilder {
        self.client.get(format!("{}{path}", self.url))
    }

    pub fn post(&self, path: &str) -> RequestBuilder {
        self.client.post(format!("{}{path}", self.url))
    }

    pub fn delete(&self, path: &str) -> RequestBuilder {
        self.client.delete(format!("{}{path}", self.url))
    }

    pub fn put(&self, path: &str) -> RequestBuilder {
        self.client.put(format!("{}{path}", self.url))
    }
}

/// Whether the tests of the service run on PostgreSQL: `VENTRIFORM_TEST_DATABASE=postgres`.
fn on_postgres() -> bool {
    std::env::var("VENTRIFORM_TEST_DATABASE").is_ok_and(|engine| engine == "postgres")
}

/// A port on which nobody listens, and that stays so until the test listens there: the system hands out ports
/// above 32767 to whoever asks for any, and to connections.
pub fn quiet_port() -> u16 {
    use std::sync::atomic::{AtomicU16, Ordering};
    static NEXT_PORT: AtomicU16 = AtomicU16::new(0);
    // Other processes of the tests begin elsewhere.
    let first = 16_000 + (std::process::id() % 160) as u16 * 100;
    loop {
        let port = first + NEXT_PORT.fetch_add(1, Ordering::Relaxed) % 100;
        if std::net::TcpListener::bind(("127.0.0.1", port)).is_ok() {
            return port;
        }
    }
}

/// A running service and a client.
pub struct TestApp {
    pub api: Api,
    pub running: Option<Running>,
    pub data: Arc<TempDir>,
}

impl Deref for TestApp {
    type Target = Api;

    fn deref(&self) -> &Api {
        &self.api
    }
}

impl TestApp {
    /// The answer of `/metrics`.
    pub async fn metrics(&self) -> String {
        let answer = self.get("/metrics").send().await.unwrap();
        answer.text().await.unwrap()
    }

    /// A service with the fake computation and default settings.
    pub async fn start() -> Self {
        Self::with(|_| {}).await
    }

    /// A service with the fake computation and changed settings.
    pub async fn with(change: impl FnOnce(&mut Settings)) -> Self {
        let data = Arc::new(tempfile::tempdir().unwrap());
        Self::on(data, fake_engine(), change).await
    }

    /// A service on a data folder that may have been used before.
    pub async fn on(
        data: Arc<TempDir>,
        engine: Engine,
        change: impl FnOnce(&mut Settings),
    ) -> Self {
        let mut settings = Settings {
            data_dir: data.path().to_owned(),
            shutdown_grace: "5s".parse().unwrap(),
            workers: "2".parse().unwrap(),
            threads: "1".parse().unwrap(),
            wait_limit: WAIT_LIMIT.parse().unwrap(),
            ..Settings::default()
        };
        if std::env::var_os("VENTRIFORM_TEST_BLOBS").is_some_and(|place| place == "s3") {
            s3_server::keep_files_in_bucket(&mut settings);
        }
        if on_postgres() {
            settings.database = super::postgres::database_of(data.path()).await;
        }
        change(&mut settings);
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let running = start(settings, engine, listener).await.unwrap();
        Self {
            api: Api::new(format!("http://{}", running.address())),
            running: Some(running),
            data,
        }
    }

    /// The same service as the owner of that API key sees it.
    pub fn seen_with(&self, key: &str) -> Self {
        Self {
            api: Api::with_key(self.url.clone(), key),
            running: None,
            data: self.data.clone(),
        }
    }

    /// The same as the caller of this, and the owner of the service.
    pub fn running_as(mut self, mut owner: Self) -> Self {
        self.running = owner.running.take();
        self
    }

    /// Shuts the service down in order and returns its data folder.
    pub async fn stop(mut self) -> Arc<TempDir> {
        self.running.take().unwrap().stop().await.unwrap();
        self.data.clone()
    }

    /// GETs a path; returns the JSON.
    pub async fn json(&self, path: &str) -> Value {
        let answer = self.get(path).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{path}");
        answer.json().await.unwrap()
    }

    /// Uploads a volume; returns its id.
    pub async fn volume(&self, words: &str) -> String {
        let answer = self
            .post("/v1/volumes")
            .body(volume(words))
            .send()
            .await
            .unwrap();
        assert!(
            answer.status().is_success(),
            "{}",
            answer.text().await.unwrap()
        );
        let volume: Value = answer.json().await.unwrap();
        text(&volume["id"])
    }

    /// Uploads a volume and starts a model job in one request; returns the job.
    pub async fn file(&self, words: &str) -> Value {
        let answer = self
            .post("/v1/models")
            .body(volume(words))
            .send()
            .await
            .unwrap();
        assert_eq!(answer.status(), StatusCode::ACCEPTED);
        answer.json().await.unwrap()
    }

    /// Waits until a job is in one of the states; returns the job.
    pub async fn until(&self, job: &Value, states: &[&str]) -> Value {
        let path = text(&job["links"]["self"]);
        let deadline = Instant::now() + EVENT_PATIENCE;
        loop {
            let job = self.json(&path).await;
            if states.contains(&job["state"].as_str().unwrap()) {
                return job;
            }
            assert!(Instant::now() < deadline, "still {job}");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    /// Starts a model job and waits until it has ended; returns the job.
    pub async fn finished(&self, words: &str) -> Value {
        let job = self.file(words).await;
        self.until(&job, &["succeeded", "failed", "cancelled"])
            .await
    }

    /// Makes a model; returns it.
    pub async fn model(&self, words: &str) -> Value {
        let job = self.finished(words).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        self.json(&text(&job["links"]["model"])).await
    }

    /// Names of all entries in the folders for files and in the staging folder.
    pub fn stored(&self) -> Vec<String> {
        let mut names = Vec::new();
        let shelves = Resource::WITH_FILES.map(Resource::plural);
        for shelf in shelves.into_iter().chain(["staging"]) {
            for entry in std::fs::read_dir(self.data.path().join(shelf)).unwrap() {
                names.push(entry.unwrap().file_name().into_string().unwrap());
            }
        }
        names.sort();
        names
    }
}

/// A clock that stands still and is trusted.
struct StandingClock(Timestamp);

impl Clock for StandingClock {
    fn now(&self) -> Timestamp {
        self.0
    }

    fn is_trusted(&self) -> bool {
        true
    }

    fn latest(&self) -> Timestamp {
        self.0
    }
}

/// That time as one by which ages count.
pub fn trusted(now: Timestamp) -> TrustedNow {
    let clock: &dyn Clock = &StandingClock(now);
    clock.trusted().unwrap()
}

/// The moment before which things are too old.
pub fn cutoff(moment: Timestamp) -> Cutoff {
    trusted(moment).older_than(Duration::ZERO)
}

/// Makes a key as `ventriform keys create` does: beside the running service. Returns its id and the
/// key.
pub async fn key(data: &Path, scope: Scope, tenant: &str, quota: Quota) -> (String, String) {
    let now = SystemClock.now();
    let request = KeyRequest {
        name: format!("{scope} of {tenant}"),
        tenant: tenant.parse().unwrap(),
        scope,
        quota,
        maker: Maker::Operator,
        owner: None,
        expires_at: None,
    };
    let (key, text) = ApiKey::make(request, now).unwrap();
    let store = rows_of(data).await;
    let event = AuditEvent::new(now, Activity::KeyCreated, key.tenant.clone(), "test".into());
    store.add_key(&key, &event.on(&key.id)).await.unwrap();
    (key.id, text)
}

/// The rows of the service on that data folder, beside it.
pub async fn rows_of(data: &Path) -> Arc<SqlStore> {
    if on_postgres() {
        let url = super::postgres::database_of(data).await.0.unwrap();
        let settings = super::postgres::reached_at(url);
        open_database(data, Some(&settings)).await.unwrap()
    } else {
        open_rows(data).await.unwrap()
    }
}

/// Waits until the service asks for credentials: within a second, as docs/security.md promises.
pub async fn closed(app: &TestApp) {
    let deadline = Instant::now() + Duration::from_secs(1);
    while app.get("/v1/volumes").send().await.unwrap().status() != StatusCode::UNAUTHORIZED {
        assert!(Instant::now() < deadline, "the service is still open");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// The text of a JSON string.
pub fn text(value: &Value) -> String {
    value
        .as_str()
        .unwrap_or_else(|| panic!("{value}"))
        .to_owned()
}

/// Asserts that a response is a complete problem object with that status and code; returns it.
pub async fn problem(answer: Response, status: u16, code: &str) -> Value {
    assert_eq!(answer.status().as_u16(), status);
    let media_type = answer.headers()["content-type"].to_str().unwrap();
    assert_eq!(media_type, "application/problem+json");
    assert!(answer.headers().contains_key("x-request-id"));
    let body: Value = answer.json().await.unwrap();
    assert_eq!(body["status"], status, "{body}");
    assert_eq!(
        body["type"],
        format!("urn:ventriform:problem:{code}"),
        "{body}"
    );
    assert!(!text(&body["title"]).is_empty());
    assert!(!text(&body["detail"]).is_empty());
    body
}

/// A file that the fake reader accepts as a volume. Its first word decides what the fake
/// computation does: `sphere`, `slow`, `brief`, `stubborn`, `panic`, `abort`, `fail`.
pub fn volume(words: &str) -> Vec<u8> {
    format!("VOLUME {words}").into_bytes()
}

/// The engine with fake computations. Parameters and templates are validated by the real code.
pub fn fake_engine() -> Engine {
    let real = Engine::new(ReadLimits::default());
    let stand_in = |work: &Arc<dyn Work>| -> Arc<dyn Work> { Arc::new(FakeWork(work.clone())) };
    Engine {
        works: real.works.iter().map(stand_in).collect(),
        limits: real.limits,
        reader: Arc::new(FakeReader(real.reader)),
    }
}

/// The product's engine, in which `run` stands for the computation of every kind of work.
pub fn engine_with(run: Computation) -> Engine {
    let real = Engine::new(ReadLimits::default());
    let stand_in = |work: &Arc<dyn Work>| -> Arc<dyn Work> {
        let real = work.clone();
        Arc::new(StandIn { real, run })
    };
    Engine {
        works: real.works.iter().map(stand_in).collect(),
        ..real
    }
}

/// A computation of any kind of work.
pub type Computation = fn(&WorkInput, &Monitor<'_>) -> Result<WorkOutput, WorkError>;

/// Work of the product with another computation.
struct StandIn {
    real: Arc<dyn Work>,
    run: Computation,
}

impl Work for StandIn {
    fn makes(&self) -> Resource {
        self.real.makes()
    }

    fn plan(&self) -> Plan {
        self.real.plan()
    }

    fn check_parameters(&self, given: GivenParameters<'_>) -> Result<Map<String, Value>, Failure> {
        self.real.check_parameters(given)
    }

    fn run(&self, input: &WorkInput, monitor: &Monitor<'_>) -> Result<WorkOutput, WorkError> {
        (self.run)(input, monitor)
    }

    fn page_files(&self) -> &'static [&'static str] {
        self.real.page_files()
    }

    fn page(&self, product: &StoredItem, scans: &[Map<String, Value>]) -> Result<String, Failure> {
        self.real.page(product, scans)
    }
}

struct FakeReader(Arc<dyn UploadReader>);

fn words(files: &[LocalFile]) -> Result<String, Failure> {
    let content = std::fs::read(&files[0]).unwrap();
    match content.strip_prefix(b"VOLUME ") {
        Some(words) => Ok(String::from_utf8_lossy(&words[..words.len().min(64)]).into_owned()),
        None => Err(
            Failure::new(Fault::Content, "unrecognised-format", "No volume.").fix("Send a volume."),
        ),
    }
}

impl UploadReader for FakeReader {
    fn inspect(&self, files: &[LocalFile], _: &Monitor<'_>) -> Result<UploadFacts, Failure> {
        let words = words(files)?;
        let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
        Ok(UploadFacts {
            format: "words".into(),
            compressed: false,
            shape: if words.starts_with("large ") {
                [256; 3]
            } else {
                [1, 2, 3]
            },
            frames: 1,
            spacing_mm: [1.0; 3],
            affine: [
                [1.0, 0.0, 0.0, 0.0],
                [0.0, 1.0, 0.0, 0.0],
                [0.0, 0.0, 1.0, 0.0],
                [0.0, 0.0, 0.0, 1.0],
            ],
            affine_source: "sform".into(),
            dtype: "int16".into(),
            intensity: IntensityFacts {
                min: 0.0,
                max: 1.0,
                mean: 0.5,
                not_finite: 0,
            },
            labels: None,
            gates: None,
            warnings: files.iter().map(|path| name(path)).collect(),
        })
    }

    fn scan(&self, files: &[LocalFile], _: &Monitor<'_>) -> Result<Option<ScanFields>, Failure> {
        words(files)?;
        Ok(None)
    }

    fn preview(&self, files: &[LocalFile], _: &Monitor<'_>) -> Result<Vec<u8>, Failure> {
        words(files)?;
        Ok(b"\x89PNG\r\n\x1a\n".to_vec())
    }

    fn voxels(
        &self,
        files: &[LocalFile],
        frame: Option<usize>,
        _: &Monitor<'_>,
    ) -> Result<Vec<u8>, Failure> {
        words(files)?;
        match frame {
            None | Some(0) => Ok(b"\x1f\x8b".to_vec()),
            Some(_) => {
                Err(Failure::new(Fault::Request, "frame-out-of-range", "one frame").at("frame"))
            }
        }
    }

    fn mask(
        &self,
        files: &[LocalFile],
        _: &MaskChoice,
        monitor: &Monitor<'_>,
    ) -> Result<Vec<u8>, Failure> {
        self.voxels(files, None, monitor)
    }

    fn template(
        &self,
        mesh: &[u8],
        organ: &str,
        stated: &MeshStatement,
    ) -> Result<WorkOutput, Failure> {
        self.0.template(mesh, organ, stated)
    }

    fn is_bare(&self, file: &LocalFile, _: &Monitor<'_>) -> Result<bool, Failure> {
        let words = words(std::slice::from_ref(file))?;
        Ok(!words.contains("patient"))
    }

    fn profile(&self, profile: &[u8]) -> Result<WorkOutput, Failure> {
        self.0.profile(profile)
    }

    fn normals(&self, limits: &[u8]) -> Result<WorkOutput, Failure> {
        self.0.normals(limits)
    }
}

struct FakeWork(Arc<dyn Work>);

impl Work for FakeWork {
    fn makes(&self) -> Resource {
        self.0.makes()
    }

    fn plan(&self) -> Plan {
        self.0.plan()
    }

    fn needs(&self, parameters: &Map<String, Value>) -> Needs {
        self.0.needs(parameters)
    }

    fn check_parameters(&self, given: GivenParameters<'_>) -> Result<Map<String, Value>, Failure> {
        self.0.check_parameters(given)
    }

    fn check_order(
        &self,
        volume: Option<&str>,
        parameters: &Map<String, Value>,
    ) -> Result<(), Failure> {
        self.0.check_order(volume, parameters)
    }

    fn page_files(&self) -> &'static [&'static str] {
        self.0.page_files()
    }

    fn run(&self, input: &WorkInput, monitor: &Monitor<'_>) -> Result<WorkOutput, WorkError> {
        if self.makes() == Resource::Reading {
            return self.0.run(input, monitor);
        }
        let words = words(&input.files)?;
        let words = words.strip_prefix("large ").unwrap_or(&words);
        match words.split(' ').next().unwrap() {
            "slow" => work_for(Duration::from_secs(30), monitor)?,
            "brief" => work_for(Duration::from_millis(300), monitor)?,
            "stubborn" => std::thread::sleep(Duration::from_secs(2)),
            "panic" => panic!("as told"),
            "abort" => std::process::abort(),
            "fail" => {
                return Err(
                    Failure::new(Fault::Content, "no-surface", "There is no surface.")
                        .at("iso")
                        .fix("Choose another iso-value.")
                        .into(),
                );
            }
            _ => {}
        }
        let mut output = sphere();
        if self.makes() == Resource::Segmentation {
            output.files.push(OutputFile {
                name: "mask.nii.gz".into(),
                media_type: "application/gzip".into(),
                bytes: b"\x1f\x8b a mask".to_vec(),
            });
            let seen = json!({
                "things": input.items.keys().collect::<Vec<_>>(),
                "library": input.library.len(),
            });
            output.summary.insert("seen".into(), seen);
        }
        if self.makes() == Resource::Comparison {
            let rename = |file| name_as(file, "mesh_stress", "comparison.json");
            output.files.iter_mut().for_each(rename);
        }
        if self.makes() == Resource::Serial {
            let rename = |file| name_as(file, "mesh_scan01", "serial.json");
            output.files.iter_mut().for_each(rename);
        }
        if self.makes() == Resource::Normals {
            output.files.clear();
            output.files.push(OutputFile {
                name: "normals.json".into(),
                media_type: "application/json".into(),
                bytes: b"{}".to_vec(),
            });
        }
        if self.makes() == Resource::Beat {
            let rename = |file| name_as(file, "mesh_ed", "beat.json");
            output.files.iter_mut().for_each(rename);
            output.files.push(OutputFile {
                name: "labels_gate01.nii.gz".into(),
                media_type: "application/gzip".into(),
                bytes: b"\x1f\x8b labels".to_vec(),
            });
        }
        Ok(output)
    }

    fn page(
        &self,
        stored: &StoredItem,
        scans: &[serde_json::Map<String, serde_json::Value>],
    ) -> Result<String, Failure> {
        if self.makes() == Resource::Reading {
            return self.0.page(stored, scans);
        }
        let names = ["report.json", "beat.json", "comparison.json", "serial.json"];
        let mut names = names.into_iter();
        let report = names.find_map(|name| stored.read(name).unwrap()).unwrap();
        let report = String::from_utf8(report).unwrap();
        Ok(format!("<!doctype html><title>report</title>{report}"))
    }
}

/// Renames the mesh of a model and its report.
fn name_as(file: &mut OutputFile, mesh: &str, report: &str) {
    file.name = match file.name.strip_prefix("mesh.") {
        Some(extension) => format!("{mesh}.{extension}"),
        None => report.into(),
    };
}

fn work_for(time: Duration, monitor: &Monitor<'_>) -> Result<(), WorkError> {
    let started = Instant::now();
    while started.elapsed() < time {
        let fraction = started.elapsed().as_secs_f64() / time.as_secs_f64();
        monitor.report(Stage::Retile, fraction)?;
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(())
}

/// The files of a model: a sphere.
pub fn sphere() -> WorkOutput {
    let mesh = icosphere(30.0, 1);
    let encoded = |format| export::encode(format, &mesh, &Metadata::new("sphere")).unwrap();
    let names = [
        "mesh.glb",
        "mesh.gltf",
        "mesh.stl",
        "mesh.ply",
        "mesh.obj",
        "mesh.vtp",
        "mesh.vtk",
        "mesh.json",
    ];
    let mut files: Vec<OutputFile> = names
        .into_iter()
        .zip(Format::ALL)
        .map(|(name, format)| OutputFile {
            name: name.into(),
            media_type: format.media_type().into(),
            bytes: encoded(format),
        })
        .collect();
    files.push(OutputFile {
        name: "report.json".into(),
        media_type: "application/json".into(),
        bytes: json!({"mesh": {"vertices": 42}}).to_string().into_bytes(),
    });
    WorkOutput {
        summary: [("vertices".to_owned(), json!(42))].into_iter().collect(),
        files,
    }
}

/// A mesh as a JSON file.
pub fn mesh_json(mesh: &TriMesh) -> Vec<u8> {
    export::encode(Format::Json, mesh, &Metadata::new("test")).unwrap()
}

/// A simulated scan of a heart and its true mask, as `.nii.gz` files; computed once.
pub fn heart() -> (Vec<u8>, Vec<u8>) {
    static HEART_FILES: std::sync::OnceLock<(Vec<u8>, Vec<u8>)> = std::sync::OnceLock::new();
    HEART_FILES
        .get_or_init(|| {
            let parameters = PhantomParameters {
                shape: [64; 3],
                ..PhantomParameters::default()
            };
            let made = phantom(&parameters, &Monitor::silent()).unwrap();
            let file = |volume, stored| nifti::write(volume, stored, true).unwrap();
            (
                file(&made.volume, StoredType::Int16),
                file(&made.truth, StoredType::Uint8),
            )
        })
        .clone()
}

/// A small simulated scan as `.nii.gz`; computed once.
pub fn scan() -> Vec<u8> {
    static SCAN_FILE: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
    SCAN_FILE
        .get_or_init(|| {
            let parameters = PhantomParameters {
                shape: [64; 3],
                spacing_mm: [6.4; 3],
                ..PhantomParameters::default()
            };
            let made = phantom(&parameters, &Monitor::silent()).unwrap();
            nifti::write(&made.volume, StoredType::Int16, true).unwrap()
        })
        .clone()
}

/// Sends a signal to a process, by name.
#[cfg(unix)]
pub fn send_signal(process: u32, name: &str) {
    let sent = Command::new("kill")
        .args([format!("-{name}"), process.to_string()])
        .status();
    assert!(sent.unwrap().success());
}

/// Asks to wait for a job that succeeds, on however busy a machine; services of tests allow it ([`WAIT_LIMIT`]).
pub const UNTIL_DONE: &str = "wait=600";
/// Limit of waiting of the services that tests start.
const WAIT_LIMIT: &str = "10m";

/// The real program in a separate process.
pub struct Service {
    process: Child,
    api: Api,
    /// Where it listens for DICOM.
    pub dicom: Option<SocketAddr>,
}

impl Deref for Service {
    type Target = Api;

    fn deref(&self) -> &Api {
        &self.api
    }
}

impl Service {
    /// Starts the program on a data folder and returns once it listens.
    pub async fn start(data: &Path, arguments: &[&str]) -> Self {
        Self::start_with(data, arguments, &[]).await
    }

    /// The same, with environment variables.
    pub async fn start_with(data: &Path, arguments: &[&str], variables: &[(&str, String)]) -> Self {
        Self::launch(data, arguments, variables, Stdio::null()).await
    }

    /// The same, with its log in a file.
    pub async fn start_logging(data: &Path, arguments: &[&str], log: &Path) -> Self {
        let log = std::fs::File::create(log).unwrap();
        Self::launch(data, arguments, &[], log.into()).await
    }

    async fn launch(
        data: &Path,
        arguments: &[&str],
        variables: &[(&str, String)],
        log: Stdio,
    ) -> Self {
        let database = if on_postgres() {
            Some(super::postgres::database_of(data).await.to_string())
        } else {
            None
        };
        let mut process = Command::new(env!("CARGO_BIN_EXE_ventriform"))
            .envs(database.map(|url| ("VENTRIFORM_DATABASE", url)))
            .args(["serve", "--listen", "127.0.0.1:0", "--data-dir"])
            .arg(data)
            .args(arguments)
            .env("VENTRIFORM_WAIT_LIMIT", WAIT_LIMIT)
            .envs(variables.iter().map(|(name, value)| (*name, value)))
            .stdout(Stdio::piped())
            .stderr(log)
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap())
            .read_line(&mut line)
            .unwrap();
        let url = line
            .split_whitespace()
            .find(|word| word.starts_with("http"))
            .expect("the first line names the address");
        let dicom = line.split_once("DICOM on ").map(|(_, rest)| rest.trim());
        Self {
            process,
            api: Api::new(url.to_owned()),
            dicom: dicom.map(|address| address.parse().unwrap()),
        }
    }

    /// The processes that this one has started.
    #[cfg(target_os = "linux")]
    pub fn children(&self) -> Vec<u32> {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.process.id())).unwrap();
        let lists = tasks.flatten().map(|task| task.path().join("children"));
        // A thread may have ended since it was listed.
        let lists = lists.filter_map(|list| std::fs::read_to_string(list).ok());
        let ids: Vec<String> = lists
            .flat_map(|list| list.split(' ').map(str::to_owned).collect::<Vec<_>>())
            .collect();
        ids.iter().filter_map(|id| id.trim().parse().ok()).collect()
    }

    /// Processor time that the process has used, seconds.
    #[cfg(target_os = "linux")]
    pub fn processor_seconds(&self) -> f64 {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.process.id())).unwrap();
        let (_, fields) = stat.rsplit_once(") ").unwrap();
        let ticks = fields.split(' ').skip(11).take(2);
        // Linux counts 100 ticks a second for every program.
        ticks.map(|n| n.parse::<f64>().unwrap() / 100.0).sum()
    }

    /// Kills the process without warning, as a power cut would.
    pub fn kill(mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }

    /// Sends a signal to the process.
    #[cfg(unix)]
    pub fn signal(&self, name: &str) {
        let id = self.process.id().to_string();
        let sent = Command::new("kill").args(["-s", name, &id]).status();
        assert!(sent.unwrap().success());
    }

    /// Files a job and waits until it has succeeded; returns the job.
    pub async fn succeeded(&self, order: &Value) -> Value {
        let filed = self.post("/v1/jobs").json(order).send().await.unwrap();
        let job: Value = filed.json().await.unwrap();
        let job = self.ended(&text(&job["id"])).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        job
    }

    /// Waits until the job has ended; returns the job.
    pub async fn ended(&self, id: &str) -> Value {
        let deadline = Instant::now() + 3 * EVENT_PATIENCE;
        loop {
            let job = self.get(&format!("/v1/jobs/{id}")).send().await.unwrap();
            assert_eq!(job.status(), StatusCode::OK, "{id} was lost");
            let job: Value = job.json().await.unwrap();
            if job["finished_at"].is_string() {
                return job;
            }
            assert!(Instant::now() < deadline, "still {job}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }

    /// The peak memory of the process.
    #[cfg(target_os = "linux")]
    pub fn peak_memory_kib(&self) -> u64 {
        let status =
            std::fs::read_to_string(format!("/proc/{}/status", self.process.id())).unwrap();
        let line = status
            .lines()
            .find(|line| line.starts_with("VmHWM:"))
            .unwrap();
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        // The process may have ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Method, path and content of every operation of the OpenAPI document. A path of a result's files stands once for
/// each of their names, those of gates with the number of the first gate.
pub fn operations() -> Vec<(Method, String, Value)> {
    let document: Value = serde_json::from_str(&document_json()).unwrap();
    let mut all = Vec::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let Ok(method) = method.to_uppercase().parse::<Method>() else {
                continue;
            };
            let mut paths = vec![path.clone()];
            if path.contains("{file}") {
                let names = operation["x-files"].as_object().unwrap().keys();
                let names = names.map(|name| name.replace("gateNN", "gate01"));
                paths = names.map(|name| path.replace("{file}", &name)).collect();
            }
            all.extend(
                paths
                    .into_iter()
                    .map(|path| (method.clone(), path, operation.clone())),
            );
        }
    }
    assert!(all.len() > 200, "{}", all.len());
    all
}

/// If set, the folder below which generated files are written instead of being compared.
const GENERATED_FOLDER_VARIABLE: &str = "GENERATED_FOLDER";

/// Checks that the committed file `name` is `content`; scripts/generate.sh has it written instead.
pub fn generated(name: &str, content: &str) {
    if let Some(folder) = std::env::var_os(GENERATED_FOLDER_VARIABLE) {
        let path = PathBuf::from(folder).join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, content).unwrap();
        return;
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    let committed = std::fs::read_to_string(path).unwrap_or_default();
    assert!(
        committed == content,
        "{name} is out of date; write it anew with scripts/generate.sh"
    );
}
