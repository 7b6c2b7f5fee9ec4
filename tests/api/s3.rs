//! The contract of the file store, over the folder and over S3 stores, and the service over S3.

use crate::doctor::to_default;
use crate::helpers::{TestApp, cutoff, fake_engine, problem, text, trusted, volume};
use crate::s3_server::{BUCKET_NAME, FaultProxy, Network, S3Server, variables};
use futures::TryStreamExt;
use futures::future::join_all;
use serde_json::json;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tempfile::TempDir;
use tokio::io::AsyncWriteExt;
use ventriform_program::cli::advice::advised;
use ventriform_service::base::records::{
    BlobError, BlobStore, FileRecord, ItemRecord, Resource, StagedFiles, StagedFor, StoreFault,
    StoredVolume, random_id,
};
use ventriform_service::config::{AwsVariables, Settings};
use ventriform_service::network::intake::ReceivedFiles;
use ventriform_store::{DiskGauge, FileBlobs, S3Blobs, S3Location, Store, StoreSettings, examine};

const CACHE_BYTES: u64 = 64 << 20;

/// A store of files, and how to damage a file in it.
struct Subject {
    blobs: Arc<dyn BlobStore>,
    received: Arc<dyn ReceivedFiles>,
    /// The S3 store, and the prefix in its bucket.
    bucket: Option<(Arc<S3Server>, String)>,
    folder: TempDir,
}

impl Subject {
    fn folder() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let gauge = DiskGauge::new(folder.path(), Some(0));
        let blobs = Arc::new(FileBlobs::open(folder.path(), gauge).unwrap());
        Self {
            blobs: blobs.clone(),
            received: blobs,
            bucket: None,
            folder,
        }
    }

    /// A part of a server's bucket, reached at `url`.
    async fn bucket(server: &Arc<S3Server>, url: &str, prefix: &str) -> Self {
        ventriform_http::install_cryptography();
        let location = S3Server::location_at(url, prefix);
        let folder = tempfile::tempdir().unwrap();
        let gauge = DiskGauge::new(folder.path(), Some(0));
        let blobs = S3Blobs::open(&location, folder.path(), gauge, CACHE_BYTES).await;
        let blobs = Arc::new(blobs.unwrap().with_grace(Duration::ZERO));
        Self {
            blobs: blobs.clone(),
            received: blobs,
            bucket: Some((server.clone(), prefix.to_owned())),
            folder,
        }
    }

    /// Replaces the content of a stored file.
    async fn damage(&self, id: &str, file: &FileRecord, content: &'static [u8]) {
        let place = file.place.as_deref().unwrap_or_default();
        let Some((server, prefix)) = &self.bucket else {
            let path = format!("volumes/{id}/{}", file.name);
            return std::fs::write(self.folder.path().join(path), content).unwrap();
        };
        let key = format!("{prefix}/volumes/{id}/{place}/{}", file.name);
        server.write(&key, content).await;
        self.empty_cache();
    }

    /// Deletes everything on the local disk that an S3 store does not need.
    fn empty_cache(&self) {
        if self.bucket.is_some() {
            std::fs::remove_dir_all(self.folder.path().join("cache")).unwrap();
        }
    }

    async fn stage(&self, files: &[(&str, Vec<u8>)]) -> Box<dyn StagedFiles> {
        let staged = self.blobs.stage(StagedFor::Upload).await.unwrap();
        for (number, (name, content)) in files.iter().enumerate() {
            let draft = number.to_string();
            let mut writer = staged.create(&draft).await.unwrap();
            writer.write_all(content).await.unwrap();
            writer.shutdown().await.unwrap();
            staged.rename(&draft, name).await.unwrap();
            let local = staged.local(name).await.unwrap();
            assert_eq!(std::fs::read(&*local).unwrap(), *content);
        }
        staged
    }

    /// Publishes files; returns their records.
    async fn publish(
        &self,
        id: &str,
        files: &[(&str, Vec<u8>)],
    ) -> Result<Vec<FileRecord>, BlobError> {
        let staged = self.stage(files).await;
        let mut record = described(id, files);
        record.put_at(staged.place());
        staged.settle(id).await?;
        staged.publish(&record).await?;
        Ok(record.files())
    }

    async fn ids(&self) -> Vec<String> {
        let items = self.blobs.ids(Resource::Volume).await.unwrap();
        items.into_iter().map(|item| item.id).collect()
    }

    async fn read(&self, id: &str, file: &FileRecord) -> Result<Vec<u8>, BlobError> {
        let stream = self.blobs.read(id, file, 0..file.bytes).await?;
        Ok(stream.try_collect::<Vec<_>>().await?.concat())
    }
}

fn sha256(content: &[u8]) -> String {
    let hash = Sha256::digest(content);
    hash.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn described(id: &str, files: &[(&str, Vec<u8>)]) -> ItemRecord {
    let records = files.iter().map(|(name, content)| FileRecord {
        name: (*name).to_owned(),
        bytes: content.len() as u64,
        sha256: sha256(content),
        place: None,
    });
    ItemRecord::Volume(StoredVolume {
        id: id.into(),
        sequence: 0,
        created_at: 1,
        bytes: 0,
        files: records.collect(),
        facts: json!({}),
    })
}

/// Bytes that look random.
fn bytes(length: usize, seed: u32) -> Vec<u8> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    (0..length).map(|_| next()).collect()
}

/// The promises of every store of files.
async fn contract(subject: &Subject) {
    let blobs = &subject.blobs;
    blobs.check().await.unwrap();
    // Three parts of a multipart upload, a part and a little more in one request, and files of every awkward
    // length.
    let files = [
        ("great.nii", bytes((17 << 20) + 5, 1)),
        ("whole.nii", bytes((8 << 20) + 352, 2)),
        ("small.json", bytes(700, 3)),
        ("empty.txt", Vec::new()),
    ];
    drop(subject.stage(&files).await);
    assert!(subject.ids().await.is_empty(), "nothing was published");
    let records = subject.publish("vol_a", &files).await.unwrap();
    assert_eq!(subject.ids().await, ["vol_a"]);
    for _ in 0..2 {
        for (file, (name, content)) in records.iter().zip(&files) {
            assert!(
                subject.read("vol_a", file).await.unwrap() == *content,
                "{name}"
            );
            let local = blobs.local("vol_a", file).await.unwrap().unwrap();
            assert_eq!(local.file_name().unwrap().to_str().unwrap(), *name);
            assert!(std::fs::read(&*local).unwrap() == *content, "{name}");
            let stored = blobs.hash("vol_a", file).await.unwrap();
            assert_eq!(stored, *file, "{name}");
        }
        subject.empty_cache();
    }
    for range in [
        0..1,
        8_388_607..8_388_609,
        17_825_796..17_825_797,
        5..9_000_000,
    ] {
        let part = blobs
            .read("vol_a", &records[0], range.clone())
            .await
            .unwrap();
        let part = part.try_collect::<Vec<_>>().await.unwrap().concat();
        let range = range.start as usize..range.end as usize;
        assert!(part == files[0].1[range.clone()], "{range:?}");
    }
    let mut described = described("vol_a", &files);
    described.put_at(records[0].place.as_deref());
    blobs.describe(&described).await.unwrap();

    // Published anew: the new files are seen, whatever becomes of the old ones.
    let newer = [("small.json", bytes(900, 4))];
    let newer_records = subject.publish("vol_a", &newer).await.unwrap();
    assert_eq!(
        subject.read("vol_a", &newer_records[0]).await.unwrap(),
        newer[0].1
    );
    blobs.prune("vol_a", &newer_records).await.unwrap();
    assert_eq!(
        subject.read("vol_a", &newer_records[0]).await.unwrap(),
        newer[0].1
    );
    let gone = subject.read("vol_a", &records[0]).await.unwrap_err();
    assert_eq!(gone.cause, StoreFault::DamagedFile);

    // What differs from its record is found.
    for content in [&b"altered"[..], b""] {
        subject.damage("vol_a", &newer_records[0], content).await;
        for error in [
            subject.read("vol_a", &newer_records[0]).await.unwrap_err(),
            blobs.local("vol_a", &newer_records[0]).await.unwrap_err(),
        ] {
            assert_eq!(error.cause, StoreFault::DamagedFile, "{error}");
        }
        let stored = blobs.hash("vol_a", &newer_records[0]).await.unwrap();
        assert_eq!(stored.bytes, content.len() as u64);
    }

    blobs.delete("vol_a", &newer_records).await.unwrap();
    blobs.delete("vol_a", &newer_records).await.unwrap();
    assert!(subject.ids().await.is_empty());
    assert!(
        blobs
            .local("vol_a", &newer_records[0])
            .await
            .unwrap()
            .is_none()
    );

    // What has no row is set aside, and deleted when its time has come.
    let orphans = subject.publish("vol_b", &newer).await.unwrap();
    assert!(blobs.set_aside("vol_b", 0).await.unwrap());
    assert!(!blobs.set_aside("vol_b", 0).await.unwrap());
    assert!(subject.ids().await.is_empty());
    assert!(subject.read("vol_b", &orphans[0]).await.is_err());
    blobs.tidy(Some(cutoff(1))).await.unwrap();
    blobs
        .tidy(Some(cutoff(i64::from(i32::MAX) * 1000)))
        .await
        .unwrap();
    blobs.delete("vol_b", &orphans).await.unwrap();

    received_contract(&*subject.received).await;
    blobs
        .tidy(Some(cutoff(i64::from(i32::MAX) * 1000)))
        .await
        .unwrap();
}

async fn received_contract(received: &dyn ReceivedFiles) {
    let content = bytes(5000, 5);
    let hash = sha256(&content);
    for name in ["obj_1.dcm", "obj_2.dcm"] {
        let mut incoming = received.begin().await.unwrap();
        incoming.writer().write_all(&content).await.unwrap();
        incoming.writer().shutdown().await.unwrap();
        assert_eq!(std::fs::read(&*incoming.local()).unwrap(), content);
        incoming.keep(name).await.unwrap();
        let kept = received.received(name, &hash).await.unwrap().unwrap();
        assert_eq!(std::fs::read(&*kept).unwrap(), content);
    }
    drop(received.begin().await.unwrap());
    let mut kept = received.kept(Duration::ZERO, trusted(1)).await.unwrap();
    kept.sort();
    assert_eq!(kept, ["obj_1.dcm", "obj_2.dcm"]);
    assert!(
        received
            .kept(Duration::from_secs(3600), trusted(1))
            .await
            .unwrap()
            .is_empty()
    );
    let both = ["obj_1.dcm".to_owned(), "obj_0.dcm".to_owned()];
    received.discard(&both).await.unwrap();
    received.quarantine("obj_2.dcm", 0).await.unwrap();
    for name in ["obj_1.dcm", "obj_2.dcm"] {
        assert!(received.received(name, &hash).await.unwrap().is_none());
    }
}

#[tokio::test]
async fn a_folder_keeps_the_contract() {
    contract(&Subject::folder()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bucket_keeps_the_contract() {
    let server = Arc::new(S3Server::start().await);
    let prefix = random_id("some/prefix-");
    contract(&Subject::bucket(&server, &server.url, &prefix).await).await;
    let left = server.keys(&prefix).await;
    assert_eq!(left, [format!("{prefix}/ready")]);
}

/// More parts than may be held in memory at once.
#[tokio::test(flavor = "multi_thread")]
async fn great_files_at_the_same_time_take_turns() {
    let server = Arc::new(S3Server::start().await);
    let subject = Subject::bucket(&server, &server.url, &random_id("")).await;
    let files = [("great.nii", bytes(17 << 20, 1))];
    let ids: Vec<_> = (0..8).map(|number| format!("vol_{number}")).collect();
    let published = join_all(ids.iter().map(|id| subject.publish(id, &files)));
    let published = tokio::time::timeout(Duration::from_secs(60), published).await;
    assert!(published.unwrap().iter().all(Result::is_ok));
}

#[tokio::test(flavor = "multi_thread")]
async fn files_go_and_come_over_a_failing_network() {
    let server = Arc::new(S3Server::start().await);
    let proxy = FaultProxy::before(&server.url).await;
    let subject = Subject::bucket(&server, &proxy.url, &random_id("")).await;
    proxy.set(Network::Failing);
    let files = [
        ("great.nii", bytes(17 << 20, 1)),
        ("small.json", bytes(700, 2)),
    ];
    for id in ["vol_1", "vol_2"] {
        let records = subject.publish(id, &files).await.unwrap();
        subject.empty_cache();
        for (file, (name, content)) in records.iter().zip(&files) {
            assert!(subject.read(id, file).await.unwrap() == *content, "{name}");
        }
        subject.blobs.delete(id, &records).await.unwrap();
    }
    assert!(subject.ids().await.is_empty());
    assert!(proxy.considered() > 30, "{}", proxy.considered());
}

/// The settings for a service whose files are in a bucket.
pub fn in_bucket(url: &str, prefix: &str) -> impl FnOnce(&mut Settings) + use<> {
    let place = format!("s3://{BUCKET_NAME}/{prefix}").parse().unwrap();
    let aws = AwsVariables(S3Server::location_at(url, prefix).variables);
    move |settings| {
        settings.blobs = place;
        settings.aws = aws;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_service_works_with_its_files_in_a_bucket() {
    let server = S3Server::start().await;
    let prefix = random_id("");
    let app = TestApp::with(in_bucket(&server.url, &prefix)).await;
    let id = app.volume("sphere").await;
    let model = app.model("sphere").await;
    let segmentation = app
        .post("/v1/segmentations?model=auto")
        .body(volume("sphere"));
    let job = segmentation.send().await.unwrap().json().await.unwrap();
    let job = app.until(&job, &["succeeded", "failed"]).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let segmentation = app.json(&text(&job["links"]["segmentation"])).await;

    let mut before = BTreeMap::new();
    let links = [&model["links"], &segmentation["links"]];
    let links = links
        .into_iter()
        .flat_map(|l| l.as_object().unwrap().values());
    let paths = links.filter_map(|link| link.as_str().map(str::to_owned));
    let own = ["", "/preview.png", "/content", "/voxels.nii.gz"];
    let own = own.map(|end| format!("/v1/volumes/{id}{end}"));
    for path in paths.chain(own) {
        let answer = app.get(&path).send().await.unwrap();
        before.insert(path, (answer.status(), answer.bytes().await.unwrap()));
    }
    let good = before.values().filter(|(status, _)| status.is_success());
    assert!(good.count() > 10, "{:?}", before.keys());
    let mesh = text(&model["links"]["mesh"]);
    let part = app
        .get(&format!("{mesh}.json"))
        .header("range", "bytes=5-9");
    let part = part.send().await.unwrap();
    assert_eq!(part.status(), 206);
    assert!(
        app.get("/readyz")
            .send()
            .await
            .unwrap()
            .status()
            .is_success()
    );

    // Restarted with an empty disk but for the database, the same bytes.
    let data = app.stop().await;
    for folder in ["cache", "staging"] {
        std::fs::remove_dir_all(data.path().join(folder)).unwrap();
    }
    let change = in_bucket(&server.url, &prefix);
    let app = TestApp::on(data, fake_engine(), change).await;
    for (path, (status, content)) in &before {
        let answer = app.get(path).send().await.unwrap();
        assert_eq!(answer.status(), *status, "{path}");
        if !path.ends_with(&id) {
            assert!(answer.bytes().await.unwrap() == *content, "{path}");
        }
    }

    // Uploaded again by somebody who does not know whose scan it is: the stored file is read.
    let identity = format!("/v1/volumes/{id}/identity");
    let erased = app.delete(&identity).send().await.unwrap();
    assert!(erased.status().is_success());
    assert_eq!(app.volume("sphere").await, id);

    // Damaged in the bucket: found, and repaired by the same upload.
    let stored = server.keys(&format!("{prefix}/volumes/{id}")).await;
    let original = stored
        .iter()
        .find(|key| key.ends_with("volume.nii"))
        .unwrap();
    server.write(original, b"VOLUME plates").await;
    std::fs::remove_dir_all(app.data.path().join("cache")).unwrap();
    let original = format!("/v1/volumes/{id}/content");
    problem(
        app.get(&original).send().await.unwrap(),
        500,
        "damaged-file",
    )
    .await;
    assert_eq!(app.volume("sphere").await, id);
    assert_eq!(app.get(&original).send().await.unwrap().status(), 200);

    // Erased by study, with all that was made of it.
    let identity = app.client.put(format!("{}{identity}", app.url));
    let identity = identity.json(&serde_json::json!({"study_uid": "1.2.3", "patient_id": "P1"}));
    assert!(identity.send().await.unwrap().status().is_success());
    let erased = app.delete("/v1/volumes?study=1.2.3&patient=P1");
    assert!(erased.send().await.unwrap().status().is_success());
    for kind in ["models", "segmentations"] {
        let left = server.keys(&format!("{prefix}/{kind}")).await;
        assert!(left.is_empty(), "{left:?}");
    }
    // A second publication of the item, which was damaged, goes with the next sweep after its time.
    app.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_acknowledged_is_lost_over_a_failing_network() {
    let server = S3Server::start().await;
    let prefix = random_id("");
    let proxy = FaultProxy::before(&server.url).await;
    let app = TestApp::with(in_bucket(&proxy.url, &prefix)).await;
    proxy.set(Network::Failing);
    let words: Vec<String> = (0..12)
        .map(|n| format!("sphere {n} {}", "x".repeat(n * 1000)))
        .collect();
    let uploads = words.iter().map(|words| async {
        let answer = app
            .post("/v1/models")
            .body(volume(words))
            .send()
            .await
            .unwrap();
        let status = answer.status();
        let retry = answer.headers().contains_key("retry-after");
        (
            status,
            retry,
            answer.json::<serde_json::Value>().await.unwrap(),
        )
    });
    let answers = join_all(uploads).await;
    proxy.set(Network::Away);
    let ready = problem(app.get("/readyz").send().await.unwrap(), 503, "not-ready").await;
    assert!(text(&ready["detail"]).contains("S3"), "{ready}");
    proxy.set(Network::Whole);
    let mut accepted = 0;
    for (words, (status, retry, job)) in words.iter().zip(answers) {
        if status != 202 {
            assert_eq!((status.as_u16(), retry), (503, true), "{job}");
            continue;
        }
        accepted += 1;
        let job = app.until(&job, &["succeeded", "failed"]).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        let id = text(&job["volume"]);
        let path = format!("/v1/volumes/{id}/content");
        let stored = app.get(&path).send().await.unwrap();
        assert_eq!(stored.bytes().await.unwrap(), volume(words));
        let model = app.json(&text(&job["links"]["model"])).await;
        let mesh = format!("{}.json", text(&model["links"]["mesh"]));
        assert_eq!(app.get(&mesh).send().await.unwrap().status(), 200);
    }
    assert!(accepted > 6, "{accepted}");
    assert!(proxy.considered() > 40, "{}", proxy.considered());
}

#[tokio::test(flavor = "multi_thread")]
async fn without_its_store_the_service_says_so_and_jobs_wait() {
    let server = S3Server::start().await;
    let prefix = random_id("");
    let proxy = FaultProxy::before(&server.url).await;
    let app = TestApp::with(in_bucket(&proxy.url, &prefix)).await;
    let id = app.volume("sphere").await;
    proxy.set(Network::Away);
    std::fs::remove_dir_all(app.data.path().join("cache")).unwrap();
    let path = format!("/v1/volumes/{id}/content");
    let (read, stored) = tokio::join!(
        app.get(&path).send(),
        app.post("/v1/volumes").body(volume("other")).send()
    );
    for answer in [read.unwrap(), stored.unwrap()] {
        assert_eq!(answer.headers()["retry-after"], "5");
        problem(answer, 503, "storage-away").await;
    }
    let job = app
        .post("/v1/jobs")
        .json(&json!({"kind": "model", "volume": id}));
    let job = job.send().await.unwrap().json().await.unwrap();
    tokio::time::sleep(Duration::from_secs(1)).await;
    proxy.set(Network::Whole);
    let job = app.until(&job, &["succeeded", "failed"]).await;
    assert_eq!(job["state"], "succeeded", "{job}");
}

#[tokio::test]
async fn a_bucket_that_cannot_be_used_is_refused_at_the_start_with_what_to_do() {
    ventriform_http::install_cryptography();
    let server = Arc::new(S3Server::start().await);
    let prefix = random_id("");
    let folder = tempfile::tempdir().unwrap();
    let open = async |folder: &Path, location: Option<S3Location>| {
        let settings = StoreSettings {
            s3: location,
            ..StoreSettings::default()
        };
        Store::open_with(folder, settings).await
    };
    let refused = async |folder: &Path, location| {
        advised(&open(folder, location).await.err().unwrap().into())
    };
    let no_bucket = S3Location {
        bucket: "nothing".into(),
        ..server.location(&prefix)
    };
    let error = refused(folder.path(), Some(no_bucket)).await;
    assert!(
        error.contains("s3://nothing/") && error.contains("Create the bucket"),
        "{error}"
    );
    let stranger = S3Location {
        variables: variables(&server.url, "wrong"),
        ..server.location(&prefix)
    };
    if server.is_strict {
        let error = refused(folder.path(), Some(stranger)).await;
        assert!(error.contains("AWS_SECRET_ACCESS_KEY"), "{error}");
        assert!(!error.contains("wrong"), "{error}");
    }

    // A folder whose files are in a bucket, with other settings.
    let mut store = open(folder.path(), Some(server.location(&prefix)))
        .await
        .unwrap();
    store.close().await;
    drop(store);
    for other in [None, Some(server.location(&random_id("")))] {
        let error = refused(folder.path(), other).await;
        assert!(
            error.contains(&format!("--blobs s3://hearts/{prefix}")),
            "{error}"
        );
    }
    let doctor = examine(folder.path(), None, None).await;
    assert!(doctor.unwrap_err().to_string().contains("s3://hearts/"));
    // A bucket with items whose database is gone.
    let other = tempfile::tempdir().unwrap();
    let subject = Subject::bucket(&server, &server.url, &prefix).await;
    subject
        .publish("vol_a", &[("volume.nii", bytes(9, 1))])
        .await
        .unwrap();
    let error = refused(other.path(), Some(server.location(&prefix))).await;
    assert!(error.contains("missing or empty"), "{error}");
    // A folder with items, with a bucket.
    let local = Store::open(other.path()).await.unwrap();
    drop(local);
    std::fs::create_dir(other.path().join("volumes/vol_a")).unwrap();
    let error = refused(other.path(), Some(server.location(&random_id("")))).await;
    assert!(error.contains("holds the files"), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_doctor_makes_rows_of_what_lies_in_the_bucket_and_sets_damaged_items_aside() {
    let server = S3Server::start().await;
    let prefix = random_id("");
    let app = TestApp::with(in_bucket(&server.url, &prefix)).await;
    let model = app.model("sphere").await;
    let path = format!("/v1/volumes/{}/content", text(&model["volume"]));
    let other = app.volume("other").await;
    let data = app.stop().await;
    let location = server.location(&prefix);
    let healthy = examine(data.path(), Some(&location), None).await.unwrap();
    assert!(healthy.findings.is_empty(), "{healthy:?}");
    assert_eq!(healthy.items, 3);

    std::fs::remove_file(data.path().join("ventriform.db")).unwrap();
    let keys = server.keys(&format!("{prefix}/volumes/{other}")).await;
    let file = keys.iter().find(|key| key.ends_with("volume.nii")).unwrap();
    server.write(file, b"VOLUME ether").await;
    let lost = examine(data.path(), Some(&location), None).await.unwrap();
    assert!(!lost.is_healthy());
    assert_eq!(lost.findings.len(), 4, "{lost:?}");
    let repaired = examine(data.path(), Some(&location), Some(&to_default()))
        .await
        .unwrap();
    assert!(repaired.is_healthy(), "{repaired:?}");
    assert!(
        server
            .keys(&format!("{prefix}/volumes/{other}"))
            .await
            .is_empty()
    );
    assert_eq!(server.keys(&format!("{prefix}/quarantine")).await.len(), 2);

    // Repaired by hand, the item is brought back.
    let keys = server.keys(&format!("{prefix}/quarantine")).await;
    let file = keys.iter().find(|key| key.ends_with("volume.nii")).unwrap();
    server.write(file, b"VOLUME other").await;
    let again = examine(data.path(), Some(&location), Some(&to_default()))
        .await
        .unwrap();
    assert!(again.is_healthy(), "{again:?}");
    let app = TestApp::on(data, fake_engine(), in_bucket(&server.url, &prefix)).await;
    for path in [path, format!("/v1/volumes/{other}/content")] {
        assert_eq!(app.get(&path).send().await.unwrap().status(), 200, "{path}");
    }
    app.json(&format!("/v1/models/{}", text(&model["id"])))
        .await;
}
