//! Faults of the disk: every write of the real program can fail, and a power cut can take whatever
//! was not forced to disk. What was acknowledged is there after a restart, all the same.
//!
//! `tests/faults/shim.c` injects the faults. By default a sample of all writes fails, one in each
//! round; `VENTRIFORM_TEST_FAULTS=all` lets every one of them fail, in turn
//! (`scripts/check/faults.sh`).

#![cfg(target_os = "linux")]

use crate::helpers::{Service, heart, scan, text};
use serde_json::Value;
use std::fs::{self, File};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use ventriform_store::examine;

/// `errno` of a failing and of a full disk.
const DISK_FAULTS: [(&str, i32); 2] = [("EIO", 5), ("ENOSPC", 28)];
/// Writes that fail by default.
const SAMPLED_WRITES: u32 = 6;
/// Longest time of a job, or of the recovery of the service.
const EVENT_PATIENCE: Duration = Duration::from_secs(60);

/// The compiled shim.
fn shim() -> &'static Path {
    static COMPILED_SHIM: OnceLock<PathBuf> = OnceLock::new();
    COMPILED_SHIM.get_or_init(|| {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults/shim.c");
        let library = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fault_shim.so");
        let compiled = Command::new("cc")
            .args(["-shared", "-fPIC", "-O1", "-o"])
            .args([&library, &source])
            .arg("-ldl")
            .status()
            .unwrap();
        assert!(compiled.success(), "cc failed");
        library
    })
}

/// A data folder whose disk can fail.
struct Disk {
    folder: TempDir,
    control: File,
}

impl Disk {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        for name in ["data", "shadow"] {
            fs::create_dir(folder.path().join(name)).unwrap();
        }
        fs::write(folder.path().join("control"), [0; 16]).unwrap();
        let mut options = File::options();
        let control = options.read(true).write(true);
        let control = control.open(folder.path().join("control")).unwrap();
        Self { folder, control }
    }

    fn data(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    async fn service(&self) -> Service {
        let path = |name| self.folder.path().join(name).display().to_string();
        let variables = [
            ("LD_PRELOAD", shim().display().to_string()),
            ("FAULT_ROOT", path("data")),
            ("FAULT_CONTROL", path("control")),
            ("FAULT_SHADOW", path("shadow")),
        ];
        let arguments = ["--workers", "1", "--lease", "1s", "--min-free", "0B"];
        Service::start_with(&self.data(), &arguments, &variables).await
    }

    /// Lets the writes from `first` to `last` after this moment fail.
    fn fail(&self, first: u32, last: u32, error: i32) {
        let numbers = [0, first, last, error.cast_unsigned()];
        let bytes: Vec<u8> = numbers.iter().flat_map(|n| n.to_ne_bytes()).collect();
        self.control.write_all_at(&bytes, 0).unwrap();
    }

    /// The number of writes since [`Disk::fail`].
    fn writes(&self) -> u32 {
        let mut number = [0; 4];
        self.control.read_exact_at(&mut number, 0).unwrap();
        u32::from_ne_bytes(number)
    }

    /// The data folder after a power cut: only files that were forced to disk.
    fn after_power_cut(&self) -> TempDir {
        use std::os::unix::fs::MetadataExt;
        let rest = tempfile::tempdir().unwrap();
        let inode = fs::metadata(self.data()).unwrap().ino();
        self.rebuild(inode, rest.path());
        rest
    }

    fn rebuild(&self, inode: u64, to: &Path) {
        use std::os::unix::fs::MetadataExt;
        let shadow = self.folder.path().join("shadow");
        let listing = fs::read_to_string(shadow.join(format!("{inode}.dir")));
        for line in listing.unwrap_or_default().lines() {
            let mut words = line.splitn(3, ' ');
            let inode: u64 = words.next().unwrap().parse().unwrap();
            let is_folder = words.next().unwrap() == "d";
            let place = to.join(words.next().unwrap());
            if is_folder {
                fs::create_dir(&place).unwrap();
                self.rebuild(inode, &place);
            } else {
                let content = fs::read(shadow.join(format!("{inode}.data")));
                let mut content = content.unwrap_or_default();
                fs::write(&place, &content).unwrap();
                if place.ends_with("kept.json") {
                    // A power cut leaves a file its inode, by which the store tells its note from a copy.
                    let now = fs::metadata(&place).unwrap().ino();
                    let note = String::from_utf8(content).unwrap();
                    let [before, now] = [inode, now].map(|inode| format!("\"inode {inode}\""));
                    content = note.replace(&before, &now).into_bytes();
                    fs::write(&place, &content).unwrap();
                }
            }
        }
    }
}

/// The ids that the service acknowledged.
#[derive(Debug, Default)]
struct Acknowledged {
    volumes: Vec<String>,
    erased: Vec<String>,
    jobs: Vec<String>,
    /// Paths of results, with their content.
    results: Vec<(String, Vec<u8>)>,
}

/// Uploads, computes and erases; notes what is acknowledged. Refusals must say that the storage
/// fails, not that the program does.
async fn load(service: &Service, noted: &mut Acknowledged) {
    let volumes = [heart().1, scan()];
    for body in &volumes {
        let answer = service.post("/v1/volumes").body(body.clone());
        if let Some(volume) = accepted(answer).await {
            noted.volumes.push(text(&volume["id"]));
        }
    }
    let answer = service.post("/v1/models?points=67").body(scan());
    if let Some(job) = accepted(answer).await {
        let id = text(&job["id"]);
        noted.jobs.push(id.clone());
        let job = service.ended(&id).await;
        if job["state"] == "succeeded" {
            let path = text(&job["links"]["mesh"]) + ".json";
            let mesh = service.get(&path).send().await.unwrap();
            if mesh.status() == 200 {
                noted
                    .results
                    .push((path, mesh.bytes().await.unwrap().to_vec()));
            }
        } else {
            let said = job["error"]["type"].as_str().unwrap_or_default();
            assert!(
                said.ends_with(":storage") || said.ends_with(":attempt-limit"),
                "{job}"
            );
        }
    }
    if let Some(id) = noted.volumes.first().cloned() {
        let answer = service.delete(&format!("/v1/volumes/{id}")).send().await;
        // If it fails, the volume may be erased or not.
        noted.volumes.remove(0);
        let status = answer.unwrap().status().as_u16();
        assert!([204, 503, 507].contains(&status), "{status}");
        if status == 204 {
            noted.erased.push(id);
        }
    }
}

/// The JSON of a success; `None` if the storage failed.
async fn accepted(request: reqwest::RequestBuilder) -> Option<Value> {
    let answer = request.send().await.unwrap();
    let status = answer.status().as_u16();
    let said = answer.text().await.unwrap();
    assert!(
        [200, 201, 202, 503, 507].contains(&status),
        "{status} {said}"
    );
    (status < 300).then(|| serde_json::from_str(&said).unwrap())
}

/// Everything acknowledged is there, everything erased is not, and nothing is damaged.
async fn check(data: &Path, noted: &Acknowledged, when: &str) {
    let service = Service::start(data, &["--workers", "1"]).await;
    for (ids, status) in [(&noted.volumes, 200), (&noted.erased, 410)] {
        for id in ids {
            let answer = service
                .get(&format!("/v1/volumes/{id}"))
                .send()
                .await
                .unwrap();
            assert_eq!(
                answer.status().as_u16(),
                status,
                "{when}: {id} of {noted:?}"
            );
        }
    }
    for id in &noted.jobs {
        service.ended(id).await;
    }
    for (path, content) in &noted.results {
        let answer = service.get(path).send().await.unwrap();
        assert_eq!(answer.status().as_u16(), 200, "{when}: {path}");
        assert!(
            answer.bytes().await.unwrap() == content[..],
            "{when}: {path} changed"
        );
    }
    service.kill();
    let found = examine(data, None, None).await.unwrap();
    let unexpected = |kind| !["unknown-item", "quarantined-item", "leftover"].contains(&kind);
    let serious: Vec<_> = found
        .findings
        .iter()
        .filter(|f| unexpected(f.kind))
        .collect();
    assert!(serious.is_empty(), "{when}: {serious:?}");
}

fn all_points() -> bool {
    std::env::var("VENTRIFORM_TEST_FAULTS").is_ok_and(|points| points == "all")
}

#[tokio::test]
async fn whichever_write_fails_nothing_acknowledged_is_lost() {
    let disk = Disk::new();
    let service = disk.service().await;
    disk.fail(u32::MAX, u32::MAX, 0);
    load(&service, &mut Acknowledged::default()).await;
    let writes = disk.writes();
    service.kill();
    assert!(writes > 50, "{writes}");

    let step = if all_points() {
        1
    } else {
        writes / SAMPLED_WRITES
    };
    for (number, point) in (1..=writes).step_by(step as usize).enumerate() {
        let (name, error) = DISK_FAULTS[number % DISK_FAULTS.len()];
        // Every other pair of rounds, the disk does not recover by itself.
        let last = if number % 4 < 2 { point } else { point + 20 };
        let when = format!("{name} at writes {point} to {last} of {writes}");
        let disk = Disk::new();
        let service = disk.service().await;
        disk.fail(point, last, error);
        let mut noted = Acknowledged::default();
        load(&service, &mut noted).await;
        disk.fail(u32::MAX, u32::MAX, 0);
        let deadline = Instant::now() + EVENT_PATIENCE;
        loop {
            let ready = service.get("/readyz").send().await.unwrap();
            if ready.status() == 200 {
                break;
            }
            assert!(Instant::now() < deadline, "{when}: it does not recover");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        let again = accepted(service.post("/v1/volumes").body(scan())).await;
        let again = again.unwrap_or_else(|| panic!("{when}: it does not recover"));
        let again = text(&again["id"]);
        // It is there again if the first upload failed and this one was erased in its place.
        noted.erased.retain(|id| *id != again);
        noted.volumes.push(again);
        service.kill();
        check(&disk.data(), &noted, &when).await;
    }
}

#[tokio::test]
async fn after_a_power_cut_nothing_acknowledged_is_lost() {
    let rounds = if all_points() { 40 } else { 2 };
    for round in 0..rounds {
        let disk = Disk::new();
        let service = disk.service().await;
        disk.fail(u32::MAX, u32::MAX, 0);
        let mut noted = Acknowledged::default();
        load(&service, &mut noted).await;
        assert_eq!(noted.results.len(), 1, "{noted:?}");
        // A last upload is cut off at some moment.
        let last = service.post("/v1/volumes").body(heart().0).send();
        let _ = tokio::time::timeout(Duration::from_millis(round * 2), last).await;
        service.kill();
        let rest = disk.after_power_cut();
        check(rest.path(), &noted, &format!("power cut {round}")).await;
    }
}
