//! The queue on PostgreSQL: claims beside the ended jobs of the table, and processes whose jobs sleep.
//!
//! `scripts/measure/bench_scale.py` starts the servers, fills the table and runs this. The settings come from the
//! environment, as those of the service do: `VENTRIFORM_DATABASE`, `VENTRIFORM_BLOBS`, `AWS_*`.
//!
//! Jobs that sleep need no processor, so the second measurement shows what the queue itself costs with more
//! workers than the machine has cores.

use std::error::Error;
use std::net::TcpListener;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use tokio::time::{MissedTickBehavior, interval, sleep};
use ventriform::base::progress::{Monitor, Plan};
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::{PhantomParameters, ReadLimits, phantom};
use ventriform_http::install_cryptography;
use ventriform_program::server::{Running, start};
use ventriform_service::base::records::{
    Claimant, Clock, Failure, JobFilter, JobOutcome, JobState, JobStore, Lease, ListRequest,
    NewJob, Resource, SystemClock, random_id,
};
use ventriform_service::config::{Flags, PostgresSettings, Settings};
use ventriform_service::items::{StoredItem, WorkOutput};
use ventriform_service::jobs::{GivenParameters, Needs, Work, WorkError, WorkInput};
use ventriform_service::work::Engine;
use ventriform_store::{SqlStore, open_database};

/// The time that a job sleeps.
const SLEEP_TIME: Duration = Duration::from_millis(500);
/// Jobs for each worker.
const JOBS_PER_WORKER: usize = 24;
const CLAIMS_PER_SECOND: u32 = 100;
const CLAIM_COUNT: u32 = 3_000;
const CLAIMANT_COUNT: u32 = 4;
const MEASURED_TURNS: usize = 3;

type Outcome<T> = Result<T, Box<dyn Error + Send + Sync>>;

#[tokio::main]
async fn main() -> Outcome<()> {
    let environment = |name: &str| std::env::var(name).ok();
    let (mut settings, _) = Settings::load(&Flags::default(), environment)?;
    let Some(url) = settings.database.0.clone() else {
        println!("VENTRIFORM_DATABASE is not set: run scripts/measure/bench_scale.py");
        return Ok(());
    };
    settings.read_credentials(environment)?;
    install_cryptography();
    let folder = tempfile::tempdir()?;
    let server = PostgresSettings {
        url,
        connections: 8,
        patience: Duration::from_secs(10),
    };
    let bench = Bench {
        store: open_database(folder.path(), Some(&server)).await?,
        settings,
    };
    let api = bench.process("api", folder.path().join("api")).await?;
    let client = reqwest::Client::new();
    let upload = client.post(format!("http://{}/v1/volumes", api.address()));
    let volume: serde_json::Value = upload.body(scan()?).send().await?.json().await?;
    let volume = volume["id"].as_str().ok_or("the scan was refused")?;

    bench.claims(volume).await?;
    for _ in 0..MEASURED_TURNS {
        for workers in [1, 2, 4] {
            let rate = bench.sleepers(workers, volume).await?;
            let each = rate / workers as f64;
            println!(
                "{workers} processes of one worker, jobs that sleep {SLEEP_TIME:?}: {rate:.2} jobs/s, {each:.3} each"
            );
        }
    }
    api.stop().await?;
    Ok(())
}

struct Bench {
    store: Arc<SqlStore>,
    settings: Settings,
}

impl Bench {
    /// A process of the service, but for the process.
    async fn process(&self, role: &str, data_dir: std::path::PathBuf) -> Outcome<Running> {
        let settings = Settings {
            role: role.parse()?,
            data_dir,
            workers: "1".parse()?,
            threads: "1".parse()?,
            ..self.settings.clone()
        };
        let real = Engine::new(ReadLimits::default());
        let sleepy =
            |work: &Arc<dyn Work>| -> Arc<dyn Work> { Arc::new(Sleepy::new(work.clone())) };
        let engine = Engine {
            works: real.works.iter().map(sleepy).collect(),
            ..real
        };
        Ok(start(settings, engine, TcpListener::bind("127.0.0.1:0")?).await?)
    }

    async fn file(&self, volume: &str, count: usize) -> Outcome<()> {
        let work = Engine::new(ReadLimits::default()).works;
        let work = work.of_kind("model").ok_or("no models")?;
        for number in 0..count {
            let seed = format!("{}", SystemClock.now() * 1_000 + number as i64);
            let given = [("points".into(), "67".into()), ("seed".into(), seed)];
            let job = NewJob {
                kind: "model".into(),
                volume: Some(volume.into()),
                parameters: work.parameters_from_text(&given)?,
                ..NewJob::default()
            };
            self.store.file(&job, usize::MAX, SystemClock.now()).await?;
        }
        Ok(())
    }

    /// Claims at a fixed rate, each at its time whether or not the one before has ended.
    async fn claims(&self, volume: &str) -> Outcome<()> {
        self.file(volume, CLAIM_COUNT as usize).await?;
        let mut claimants = tokio::task::JoinSet::new();
        for _ in 0..CLAIMANT_COUNT {
            let store = self.store.clone();
            claimants.spawn(async move {
                let mut due = interval(Duration::from_secs(1) * CLAIMANT_COUNT / CLAIMS_PER_SECOND);
                due.set_missed_tick_behavior(MissedTickBehavior::Burst);
                let mut times = Vec::new();
                for _ in 0..CLAIM_COUNT / CLAIMANT_COUNT {
                    let due_at = due.tick().await;
                    let claimant = Claimant {
                        token: random_id("lse_"),
                        run: "run_bench".into(),
                        lease: Duration::from_secs(60),
                    };
                    let begun = Instant::now();
                    let job = store.claim(&claimant, SystemClock.now()).await?;
                    let claimed = begun.elapsed();
                    let late = due_at.elapsed();
                    let lease = Lease {
                        job: job.ok_or("no job waits")?.id,
                        token: claimant.token,
                    };
                    let now = SystemClock.now();
                    store.finish(&lease, &JobOutcome::Cancelled, now).await?;
                    times.push((late, claimed, begun.elapsed() - claimed));
                }
                Outcome::Ok(times)
            });
        }
        let [mut late, mut claimed, mut finished] = [(); 3].map(|()| Vec::new());
        for found in claimants.join_all().await {
            for (a, b, c) in found? {
                late.push(a);
                claimed.push(b);
                finished.push(c);
            }
        }
        println!("{CLAIMS_PER_SECOND} claims/s by {CLAIMANT_COUNT}:");
        for (what, times) in [
            ("from the time it was due", &mut late),
            ("a claim", &mut claimed),
            ("an end", &mut finished),
        ] {
            times.sort();
            let at = |share: usize| times[(times.len() - 1) * share / 1_000];
            let [median, p99, most] = [500, 990, 1_000].map(at);
            println!("  {what}: median {median:.1?}, p99 {p99:.1?}, most {most:.1?}");
        }
        Ok(())
    }

    /// Jobs per second of so many processes. The first and the last tenth are left out: processes start and end
    /// one after the other.
    async fn sleepers(&self, workers: usize, volume: &str) -> Outcome<f64> {
        let count = workers * JOBS_PER_WORKER;
        let begin = SystemClock.now();
        sleep(Duration::from_millis(2)).await;
        self.file(volume, count).await?;
        let folder = tempfile::tempdir()?;
        let mut running = Vec::new();
        for number in 0..workers {
            let data = folder.path().join(number.to_string());
            running.push(self.process("worker", data).await?);
        }
        let deadline = Instant::now() + Duration::from_secs(120);
        loop {
            let load = self.store.load().await?;
            if load.queued + load.running == 0 {
                break;
            }
            if Instant::now() > deadline {
                return Err(format!("{} jobs still wait", load.queued).into());
            }
            sleep(Duration::from_millis(200)).await;
        }
        for process in running {
            process.stop().await?;
        }
        let filter = JobFilter {
            state: Some(JobState::Succeeded),
            created_after: Some(begin),
            ..JobFilter::default()
        };
        let page = ListRequest {
            before: None,
            limit: 1_000,
        };
        let jobs = self.store.jobs(&filter, page).await?.items;
        let mut ends: Vec<_> = jobs.iter().filter_map(|job| job.finished_at).collect();
        if ends.len() != count {
            return Err(format!("{} of {count} jobs succeeded", ends.len()).into());
        }
        ends.sort_unstable();
        let ends = &ends[count / 10..count - count / 10];
        Ok((ends.len() - 1) as f64 / (ends[ends.len() - 1] - ends[0]) as f64 * 1e3)
    }
}

/// A simulated scan as a NIfTI file.
fn scan() -> Outcome<Vec<u8>> {
    let parameters = PhantomParameters {
        shape: [64; 3],
        spacing_mm: [6.4; 3],
        ..PhantomParameters::default()
    };
    let made = phantom(&parameters, &Monitor::silent())?;
    Ok(nifti::write(&made.volume, StoredType::Int16, true)?)
}

/// Work that is done once; after that it sleeps and returns what it made then.
struct Sleepy {
    real: Arc<dyn Work>,
    made: OnceLock<WorkOutput>,
}

impl Sleepy {
    fn new(real: Arc<dyn Work>) -> Self {
        Self {
            real,
            made: OnceLock::new(),
        }
    }
}

impl Work for Sleepy {
    fn makes(&self) -> Resource {
        self.real.makes()
    }

    fn plan(&self) -> Plan {
        self.real.plan()
    }

    fn check_parameters(
        &self,
        given: GivenParameters<'_>,
    ) -> Result<serde_json::Map<String, serde_json::Value>, Failure> {
        self.real.check_parameters(given)
    }

    fn needs(&self, parameters: &serde_json::Map<String, serde_json::Value>) -> Needs {
        self.real.needs(parameters)
    }

    fn run(&self, input: &WorkInput, monitor: &Monitor<'_>) -> Result<WorkOutput, WorkError> {
        if let Some(made) = self.made.get() {
            let begun = Instant::now();
            while begun.elapsed() < SLEEP_TIME {
                monitor.check()?;
                std::thread::sleep(Duration::from_millis(20));
            }
            return Ok(made.clone());
        }
        let made = self.real.run(input, monitor)?;
        Ok(self.made.get_or_init(|| made).clone())
    }

    fn page_files(&self) -> &'static [&'static str] {
        self.real.page_files()
    }

    fn page(
        &self,
        product: &StoredItem,
        scan: &[serde_json::Map<String, serde_json::Value>],
    ) -> Result<String, Failure> {
        self.real.page(product, scan)
    }
}
