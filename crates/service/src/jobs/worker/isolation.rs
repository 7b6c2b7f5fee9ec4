//! Computing one job in a process of its own.
//!
//! A job that was running when the service died may have killed it (a stack overflow, an abort,
//! more memory than the machine has), or a power cut did. Nothing that is left tells the two
//! apart, so the job is computed in a child process from then on. If the child dies while the
//! service lives, the job is to blame; if both die, it is not.
//!
//! A job on a volume of more than [`IN_PROCESS_VOXELS`](super::run::IN_PROCESS_VOXELS) is so from the start: how much
//! memory it takes is not known before (where all is noise, the muscle's model takes a hundred bytes for each voxel),
//! and the child that cannot get it ends alone.
//!
//! The service starts the program of [`Isolation`], which calls [`serve_isolated`]:
//!
//! ```text
//! service ── one line of JSON: kind, input, threads ──> stdin of the child, which stays open
//! service <── lines of JSON: progress, then the output or the failure ── stdout of the child
//! ```
//!
//! Guaranteed:
//! - the result is the same as on the threads of the service, byte for byte;
//! - a child ends as soon as its standard input ends, so it does not outlive the service;
//! - cancelling kills the child;
//! - on Linux, the system ends the child before the service when memory runs out.
//!
//! Lines of the child's output that are not messages are ignored. What it writes to standard error
//! goes to the service's.

use super::run::Ended;
use crate::base::records::{Failure, Fault, LocalFile};
use crate::items::{OutputFile, StoredItem, WorkOutput};
use crate::jobs::{Isolation, WorkError, WorkInput, Works};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};
use ventriform::base::progress::{CancelToken, Monitor, Observer, Stage};

/// Longest time until the parent notices that the computation was cancelled.
const CANCEL_POLL: Duration = Duration::from_millis(20);

/// The order to the child process.
#[derive(Serialize, Deserialize)]
struct Order {
    kind: String,
    threads: usize,
    volume: String,
    files: Vec<PathBuf>,
    parameters: Map<String, Value>,
    items: BTreeMap<String, OrderedItem>,
    library: Vec<OrderedItem>,
}

#[derive(Serialize, Deserialize)]
struct OrderedItem {
    id: String,
    parameters: Map<String, Value>,
    files: Vec<PathBuf>,
}

/// A line of the child's output.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Message {
    Progress {
        stage: String,
        fraction: f64,
    },
    Done {
        summary: Map<String, Value>,
        files: Vec<MadeFile>,
    },
    Failed(Failure),
}

#[derive(Serialize, Deserialize)]
struct MadeFile {
    name: String,
    media_type: String,
    /// In base64.
    content: String,
}

fn paths(files: &[LocalFile]) -> Vec<PathBuf> {
    files.iter().map(|file| file.to_path_buf()).collect()
}

fn in_place(files: Vec<PathBuf>) -> Vec<LocalFile> {
    files.into_iter().map(LocalFile::in_place).collect()
}

impl From<&StoredItem> for OrderedItem {
    fn from(item: &StoredItem) -> Self {
        Self {
            id: item.id.clone(),
            parameters: item.parameters.clone(),
            files: paths(&item.files),
        }
    }
}

impl From<OrderedItem> for StoredItem {
    fn from(item: OrderedItem) -> Self {
        Self {
            id: item.id,
            parameters: item.parameters,
            files: in_place(item.files),
            voxels: 0,
        }
    }
}

impl Order {
    fn new(kind: &str, input: &WorkInput, threads: usize) -> Self {
        let items = input.items.iter();
        Self {
            kind: kind.to_owned(),
            threads,
            volume: input.volume.clone(),
            files: paths(&input.files),
            parameters: input.parameters.clone(),
            items: items.map(|(n, item)| (n.clone(), item.into())).collect(),
            library: input.library.iter().map(OrderedItem::from).collect(),
        }
    }

    fn into_input(self) -> WorkInput {
        let items = self.items.into_iter();
        WorkInput {
            volume: self.volume,
            files: in_place(self.files),
            parameters: self.parameters,
            items: items.map(|(n, item)| (n, item.into())).collect(),
            library: self.library.into_iter().map(StoredItem::from).collect(),
            // For the parent alone, which has decided.
            voxels: 0,
        }
    }
}

/// A child process, killed on drop.
struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        // Both fail only if the process has ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Isolation {
    /// Computes in a child process. To be called on a thread that may block.
    pub(super) fn compute(
        &self,
        kind: &str,
        input: &WorkInput,
        threads: usize,
        monitor: &Monitor<'_>,
    ) -> Result<WorkOutput, Ended> {
        let mut order =
            serde_json::to_vec(&Order::new(kind, input, threads)).map_err(broken_pipe)?;
        order.push(b'\n');
        let mut command = Command::new(&self.program);
        command
            .args(&self.arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped());
        // A group of its own: Ctrl-C in a terminal is meant for the service, which then decides.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = Killed(command.spawn().map_err(broken_pipe)?);
        let (Some(mut stdin), Some(stdout)) = (child.0.stdin.take(), child.0.stdout.take()) else {
            return Err(broken_pipe("the child has no pipes"));
        };
        let (sender, messages) = mpsc::channel();
        std::thread::Builder::new()
            .name("isolated-output".into())
            .spawn(move || {
                let lines = BufReader::new(stdout).lines().map_while(Result::ok);
                for message in lines.filter_map(|line| serde_json::from_str(&line).ok()) {
                    if sender.send(message).is_err() {
                        break;
                    }
                }
            })
            .map_err(broken_pipe)?;
        // If the child is dead already, its status tells why.
        let _ = stdin.write_all(&order);
        loop {
            monitor.check().map_err(WorkError::from)?;
            match messages.recv_timeout(CANCEL_POLL) {
                Ok(Message::Progress { stage, fraction }) => {
                    let known = Stage::ALL.into_iter().find(|s| s.as_str() == stage);
                    if let Some(stage) = known {
                        monitor.report(stage, fraction).map_err(WorkError::from)?;
                    }
                }
                Ok(Message::Done { summary, files }) => {
                    let files: Result<Vec<_>, _> =
                        files.into_iter().map(MadeFile::decode).collect();
                    return Ok(WorkOutput {
                        summary,
                        files: files.map_err(broken_pipe)?,
                    });
                }
                Ok(Message::Failed(failure)) => return Err(WorkError::Failed(failure).into()),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        let status = child.0.wait().map_err(broken_pipe)?;
        Err(if was_told_to_end(status) {
            Ended::Interrupted
        } else {
            Ended::Crashed(status.to_string())
        })
    }
}

/// Whether somebody asked the process to end, as a service manager does that stops every process
/// of the service at once. No computation sends these signals.
#[cfg(unix)]
fn was_told_to_end(status: ExitStatus) -> bool {
    use std::os::unix::process::ExitStatusExt;
    const HANG_UP_INTERRUPT_TERMINATE: [i32; 3] = [1, 2, 15];
    status
        .signal()
        .is_some_and(|signal| HANG_UP_INTERRUPT_TERMINATE.contains(&signal))
}

#[cfg(not(unix))]
fn was_told_to_end(_: ExitStatus) -> bool {
    false
}

/// The system refused a process, a thread or a pipe: not the job's fault.
fn broken_pipe(error: impl std::fmt::Display) -> Ended {
    tracing::error!(%error, "a process for one job could not be used");
    Ended::Interrupted
}

impl MadeFile {
    fn encode(file: OutputFile) -> Self {
        Self {
            name: file.name,
            media_type: file.media_type.into_owned(),
            content: STANDARD.encode(&file.bytes),
        }
    }

    fn decode(self) -> Result<OutputFile, base64::DecodeError> {
        Ok(OutputFile {
            bytes: STANDARD.decode(self.content)?,
            name: self.name,
            media_type: self.media_type.into(),
        })
    }
}

/// Computes the job that standard input describes and writes its output to standard output; the
/// child's side of [`Isolation`].
///
/// # Errors
/// If standard input holds no order, or the system refuses threads. A job that fails is no error.
pub fn serve_isolated(works: &Works) -> std::io::Result<()> {
    // Raising the chance of being ended needs no right; elsewhere than on Linux the file is missing.
    let _ = std::fs::write("/proc/self/oom_score_adj", "1000");
    let mut stdin = BufReader::new(std::io::stdin());
    let mut order = String::new();
    stdin.read_line(&mut order)?;
    let order: Order = serde_json::from_str(&order)?;
    std::thread::Builder::new().spawn(move || {
        let _ = stdin.read_to_end(&mut Vec::new());
        std::process::exit(1);
    })?;
    let threads = super::thread_pool("isolated", order.threads)?;
    let message = threads.install(|| {
        let kind = order.kind.clone();
        let computed = catch_unwind(AssertUnwindSafe(|| {
            let work = works.of_kind(&kind).ok_or_else(super::run::unknown_kind)?;
            let observer = LineObserver::default();
            let monitor = Monitor::new(&observer, CancelToken::new());
            work.run(&order.into_input(), &monitor)
        }));
        match computed {
            Ok(Ok(output)) => Message::Done {
                summary: output.summary,
                files: output.files.into_iter().map(MadeFile::encode).collect(),
            },
            Ok(Err(WorkError::Failed(failure))) => Message::Failed(failure),
            Ok(Err(WorkError::Cancelled)) => Message::Failed(Failure::new(
                Fault::Service,
                "internal",
                "The computation stopped without a request.",
            )),
            Err(_) => Message::Failed(super::run::panicked()),
        }
    });
    write(&message)
}

fn write(message: &Message) -> std::io::Result<()> {
    let mut line = serde_json::to_vec(message)?;
    line.push(b'\n');
    let mut out = std::io::stdout().lock();
    // Starts on a line of its own, whatever was written to standard output before.
    out.write_all(b"\n")?;
    out.write_all(&line)?;
    out.flush()
}

/// Writes at most one line per percent of a stage.
struct LineObserver {
    last: AtomicU32,
    started: Instant,
}

impl Default for LineObserver {
    fn default() -> Self {
        Self {
            last: AtomicU32::new(u32::MAX),
            started: Instant::now(),
        }
    }
}

impl Observer for LineObserver {
    fn progress(&self, stage: Stage, fraction: f64) {
        let now = (stage as u32) * 1000 + (fraction * 100.0) as u32;
        if self.last.swap(now, Ordering::Relaxed) != now {
            // If nobody reads, standard input has ended too, and so does this process.
            let _ = write(&Message::Progress {
                stage: stage.as_str().to_owned(),
                fraction,
            });
        }
    }

    fn now_ms(&self) -> f64 {
        self.started.elapsed().as_secs_f64() * 1000.0
    }
}
