//! `ventriform demo`: starts the service, and uses it over HTTP: three simulated patients, a fit, beats, and a comparison
//! of stress and rest.

use super::output::{create_folder, say, write_file};
use super::{Bar, serve};
use anyhow::{Context, Result, bail};
use clap::Args;
use reqwest::Client;
use serde_json::{Value, json};
use std::io::IsTerminal;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use ventriform::base::progress::Monitor;
use ventriform::runs::examples::Example;

/// Start the service here, send it simulated scans, and fetch the answers
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Address and port to listen on; port 0 takes any free one
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// Data folder of the service [default: a temporary folder, deleted when the demo ends]
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// Folder for lv.glb, segmentation.html, beat.html and comparison.html
    #[arg(long, value_name = "DIR", default_value = ".")]
    output: PathBuf,
    /// End after the jobs instead of serving until Ctrl-C
    #[arg(long)]
    exit: bool,
    /// Do not open the comparison in a browser
    #[arg(long)]
    no_browser: bool,
}

/// A client of the service.
struct Remote {
    client: Client,
    base: String,
}

impl Remote {
    async fn json(&self, path: &str) -> Result<Value> {
        let answer = self.client.get(self.url(path)).send().await?;
        Ok(checked(answer).await?.json().await?)
    }

    async fn bytes(&self, path: &str) -> Result<Vec<u8>> {
        let answer = self.client.get(self.url(path)).send().await?;
        Ok(checked(answer).await?.bytes().await?.to_vec())
    }

    fn url(&self, path: &str) -> String {
        format!("{}{path}", self.base)
    }

    /// Stores a scan; its id.
    async fn upload(&self, name: &str, scan: Vec<u8>) -> Result<String> {
        let request = self
            .client
            .post(self.url("/v1/volumes"))
            .query(&[("labels", format!("name:{name}"))])
            .header("content-type", "application/dicom")
            .body(scan);
        let volume: Value = checked(request.send().await?).await?.json().await?;
        let id = volume["id"].as_str();
        Ok(id
            .context("the answer of the service names no volume")?
            .to_owned())
    }

    /// Files a job and shows its progress until it ends; the path of its result.
    async fn result(&self, path: &str, order: Value) -> Result<String> {
        let request = self.client.post(self.url(path)).json(&order);
        let job: Value = checked(request.send().await?).await?.json().await?;
        let own = (job["links"]["self"].as_str())
            .context("the answer of the service has no link to the job")?;
        let done = self.follow(own).await?;
        let kind = done["kind"].as_str().unwrap_or_default();
        let made = done["links"][kind].as_str();
        Ok(made
            .context("the finished job has no link to its result")?
            .to_owned())
    }

    /// Shows the progress of the job until it ends; returns the finished job.
    async fn follow(&self, job: &str) -> Result<Value> {
        let bar = Bar::start();
        loop {
            let now = self.json(job).await?;
            let state = now["state"].as_str().unwrap_or_default().to_owned();
            let stage = now["stage"].as_str().unwrap_or(&state).to_owned();
            bar.show(&stage, now["progress"].as_f64().unwrap_or(0.0));
            match state.as_str() {
                "queued" | "running" => tokio::time::sleep(Duration::from_millis(40)).await,
                "succeeded" => {
                    bar.finish();
                    return Ok(now);
                }
                _ => {
                    bar.finish();
                    bail!("the job {state}: {}", now["error"]);
                }
            }
        }
    }
}

async fn checked(answer: reqwest::Response) -> Result<reqwest::Response> {
    if answer.status().is_success() {
        return Ok(answer);
    }
    bail!("{}: {}", answer.status(), answer.text().await?)
}

/// Runs the demo.
///
/// # Errors
/// If the address is in use, a folder cannot be written, or a job fails.
pub fn run(args: &DemoArgs) -> Result<()> {
    let runtime =
        tokio::runtime::Runtime::new().context("cannot start the threads of the service")?;
    let scratch = Scratch::new(args.data_dir.clone())?;
    let outcome = runtime.block_on(demonstrate(args, &scratch.folder));
    runtime.shutdown_timeout(Duration::from_secs(5));
    outcome
}

async fn demonstrate(args: &DemoArgs, data_dir: &Path) -> Result<()> {
    let service = serve::start_local(args.listen, data_dir).await?;
    let remote = Remote {
        client: Client::new(),
        base: format!("http://{}", service.address()),
    };
    say!("The service listens on {}", remote.base);
    say!("Sending four simulated scans of three patients ...");
    let [scan, gated, stress, rest] = stored(&remote).await?;

    let fit = json!({"volume": scan, "kind": "segmentation"});
    let fit = remote.result("/v1/jobs", fit).await?;
    let beat = json!({"volume": gated, "kind": "beat"});
    let beat = remote.result("/v1/jobs", beat).await?;
    let pair = json!({"stress": stress, "rest": rest});
    let pair = remote.result("/v1/comparisons", pair).await?;
    // The display shows the gates of both scans by beats of the heart that the comparison was made with.
    let model = remote.json(&format!("{pair}/report")).await?["stress"]["template"].take();
    for volume in [stress, rest] {
        let order = json!({"volume": volume, "kind": "beat", "parameters": {"kept_model": model}});
        remote.result("/v1/jobs", order).await?;
    }

    create_folder(&args.output)?;
    let files = [
        (format!("{fit}/mesh.glb"), "lv.glb"),
        (format!("{fit}/report.html"), "segmentation.html"),
        (format!("{beat}/report.html"), "beat.html"),
        (format!("{pair}/report.html"), "comparison.html"),
    ];
    for (path, file) in &files {
        write_file(&args.output.join(file), &remote.bytes(path).await?)?;
    }
    say!("");
    for (title, path) in [
        ("One scan", &fit),
        ("Gated", &beat),
        ("Stress and rest", &pair),
    ] {
        let report = remote.json(&format!("{path}/report")).await?;
        say!("{title}: {}", sentences(&report));
    }
    let names: Vec<&str> = files.iter().map(|(_, file)| *file).collect();
    say!(
        "\nWritten: {} in {}",
        names.join(", "),
        args.output.display()
    );
    if args.exit {
        return Ok(service.stop().await?);
    }
    let id = pair.rsplit('/').next().unwrap_or_default();
    let page = format!("{}/#/comparison/{id}", remote.base);
    say!("Stress and rest beside each other: {page}\nServing until Ctrl-C.");
    if !args.no_browser && std::io::stdout().is_terminal() {
        open_in_browser(&page);
    }
    tokio::signal::ctrl_c().await?;
    Ok(service.stop().await?)
}

/// Simulates and stores the examples, in their order; their ids.
async fn stored(remote: &Remote) -> Result<[String; 4]> {
    let mut ids = [const { String::new() }; Example::ALL.len()];
    for (id, example) in ids.iter_mut().zip(Example::ALL) {
        let file = tokio::task::spawn_blocking(move || example.file(&Monitor::silent()));
        *id = remote.upload(&example.file_name(), file.await??).await?;
    }
    Ok(ids)
}

/// What a report offers for the impression, as a paragraph.
fn sentences(report: &Value) -> String {
    let offered = report["impression"].as_array().into_iter().flatten();
    let offered: Vec<&str> = offered.filter_map(Value::as_str).collect();
    offered.join(" ")
}

/// Shows an address where there is a screen; the address was printed, so it does not matter if that fails.
fn open_in_browser(address: &str) {
    let opener = if cfg!(target_os = "macos") {
        "open"
    } else if ["DISPLAY", "WAYLAND_DISPLAY"]
        .iter()
        .any(|name| std::env::var_os(name).is_some())
    {
        "xdg-open"
    } else {
        return;
    };
    let mut command = Command::new(opener);
    command.arg(address).stdin(Stdio::null());
    let _ = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn();
}

/// The data folder of the service; a temporary one is deleted at the end.
struct Scratch {
    folder: PathBuf,
    temporary: bool,
}

impl Scratch {
    fn new(given: Option<PathBuf>) -> Result<Self> {
        let temporary = given.is_none();
        let folder = given.unwrap_or_else(|| {
            std::env::temp_dir().join(format!("ventriform-demo-{}", std::process::id()))
        });
        create_folder(&folder)?;
        Ok(Self { folder, temporary })
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        if self.temporary {
            // If this fails, the system will clean up its temporary folder.
            let _ = std::fs::remove_dir_all(&self.folder);
        }
    }
}
