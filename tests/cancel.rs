//! Cancelled work stops soon, at whichever point it is cancelled: the cancel token is checked often
//! enough everywhere.
//!
//! The time until it stops is processor time of the working thread. Other load on the machine
//! lengthens wall time, but not processor time.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used)] // A test states its expectations by panicking.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::sync::mpsc;
use std::time::Duration;

use serde_json::Map;
use ventriform::base::progress::{CancelToken, Monitor, Silent};
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PhantomParameters, phantom};
use ventriform::image::volume::{ReadLimits, Volume};
use ventriform_service::base::records::LocalFile;
use ventriform_service::items::StoredItem;
use ventriform_service::jobs::{Work, WorkError, WorkInput};
use ventriform_service::work::Engine;

/// Most processor time after cancellation. The promise is 100 ms, also in this build, which is not
/// the fastest one.
const MOST_AFTER_CANCEL: Duration = Duration::from_millis(100);

/// Number of moments of cancellation, spread evenly over the length of the work.
const MOMENT_COUNT: u32 = 14;

/// Processor time of a thread so far; `None` if the system does not report it.
fn processor_time(thread: &str) -> Option<Duration> {
    let text = fs::read_to_string(format!("{thread}/schedstat")).ok()?;
    let nanoseconds = text.split(' ').next()?.parse().ok()?;
    Some(Duration::from_nanos(nanoseconds))
}

/// Runs `work` on one thread and cancels it once that thread has used `limit` of processor time.
/// Returns the outcome, the processor time in all, and that after the cancellation.
fn run(
    work: &dyn Work,
    input: &WorkInput,
    limit: Duration,
) -> (Result<(), WorkError>, [Duration; 2]) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let cancel = CancelToken::new();
    let (started, start_of_work) = mpsc::channel();
    let (ended, end_of_work) = mpsc::channel::<()>();
    std::thread::scope(|scope| {
        let token = cancel.clone();
        let told = scope.spawn(move || {
            let (thread, before): (String, Duration) = start_of_work.recv().unwrap();
            while end_of_work.recv_timeout(Duration::from_millis(1))
                == Err(mpsc::RecvTimeoutError::Timeout)
            {
                let worked = processor_time(&thread).unwrap() - before;
                if worked >= limit {
                    token.cancel();
                    return Some(worked);
                }
            }
            None
        });
        let (outcome, worked) = pool.install(|| {
            let own = fs::read_link("/proc/thread-self").unwrap();
            let own = PathBuf::from("/proc")
                .join(own)
                .to_string_lossy()
                .into_owned();
            let before = processor_time(&own).unwrap();
            started.send((own.clone(), before)).unwrap();
            let outcome = work.run(input, &Monitor::new(&Silent, cancel.clone()));
            (outcome.map(|_| ()), processor_time(&own).unwrap() - before)
        });
        drop(ended);
        let told = told.join().unwrap();
        (
            outcome,
            [
                worked,
                told.map_or(Duration::ZERO, |told| worked.saturating_sub(told)),
            ],
        )
    })
}

fn stops_wherever_it_is(
    kind: &str,
    pairs: &[(&str, &str)],
    things: &[(&str, &Volume)],
    scan: &Volume,
) {
    if processor_time("/proc/thread-self").is_none() {
        println!("skipped: this system does not report a thread's processor time");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, volume: &Volume| {
        let path = folder.path().join(format!("{name}.nii.gz"));
        fs::write(
            &path,
            nifti::write(volume, StoredType::Float32, true).unwrap(),
        )
        .unwrap();
        LocalFile::in_place(path)
    };
    let engine = Engine::new(ReadLimits::default());
    let work = engine.work(kind).unwrap();
    let pairs: Vec<(String, String)> = pairs
        .iter()
        .map(|(n, t)| ((*n).into(), (*t).into()))
        .collect();
    let stored = |(field, volume): &(&str, &Volume)| {
        let stored = StoredItem {
            id: "vol_0".into(),
            parameters: Map::new(),
            files: vec![file(field, volume)],
            voxels: 0,
        };
        ((*field).to_owned(), stored)
    };
    let input = WorkInput {
        volume: "vol_1".into(),
        files: vec![file("scan", scan)],
        parameters: work.parameters_from_text(&pairs).unwrap(),
        items: things.iter().map(stored).collect::<BTreeMap<_, _>>(),
        library: Vec::new(),
        voxels: 0,
    };
    let never = Duration::from_secs(3600);
    // The first run also fills the caches that live as long as the process.
    let (outcome, _) = run(&**work, &input, never);
    outcome.unwrap();
    let (_, [whole, _]) = run(&**work, &input, never);
    for moment in 0..MOMENT_COUNT {
        let (outcome, [_, after]) = run(&**work, &input, whole * moment / MOMENT_COUNT);
        assert!(
            after < MOST_AFTER_CANCEL,
            "{kind}: {after:?} after moment {moment} of {MOMENT_COUNT}"
        );
        assert!(
            moment > MOMENT_COUNT / 2 || matches!(outcome, Err(WorkError::Cancelled)),
            "{outcome:?}"
        );
    }
}

fn heart() -> [Volume; 2] {
    let parameters = PhantomParameters {
        shape: [80; 3],
        ..PhantomParameters::default()
    };
    let made = phantom(&parameters, &Monitor::silent()).unwrap();
    [made.volume, made.truth]
}

#[test]
fn generation_stops_wherever_it_is() {
    let [scan, _] = heart();
    stops_wherever_it_is("model", &[("points", "300")], &[], &scan);
}

#[test]
fn segmentation_stops_wherever_it_is() {
    let [scan, truth] = heart();
    let expert = [("expert", &truth)];
    stops_wherever_it_is("segmentation", &[("expert", "vol_0")], &expert, &scan);
}
