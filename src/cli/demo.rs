//! `ventriform demo`: starts the service, and uses it over HTTP to make a model of a simulated scan.

use super::output::{create_folder, say, write_file};
use super::{Bar, serve};
use anyhow::{Context, Result, bail};
use clap::Args;
use reqwest::Client;
use serde_json::Value;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PhantomParameters, phantom};

/// Start the service here, send it a simulated scan, and fetch the model
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Address and port to listen on; port 0 takes any free one
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// Data folder of the service [default: a temporary folder, deleted when the demo ends]
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// Folder for lv.glb and report.html
    #[arg(long, value_name = "DIR", default_value = ".")]
    output: PathBuf,
    /// Number of points of the model
    #[arg(long, value_name = "N", default_value_t = 150)]
    points: u32,
    /// End after the job instead of serving until Ctrl-C
    #[arg(long)]
    exit: bool,
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

    /// Uploads the volume and files a job; returns the job as JSON.
    async fn submit(&self, volume: Vec<u8>, points: u32) -> Result<Value> {
        let request = self
            .client
            .post(self.url(&format!("/v1/models?points={points}")))
            .header("content-type", "application/gzip")
            .body(volume);
        Ok(checked(request.send().await?).await?.json().await?)
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
/// If the address is in use, a folder cannot be written, or the job fails.
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

    let volume = tokio::task::spawn_blocking(simulated_scan).await??;
    say!(
        "Sending a simulated scan (128³ voxels of 3.2 mm, {} KiB) ...",
        volume.len() / 1024
    );
    let job = remote.submit(volume, args.points).await?;
    let path = job["links"]["self"]
        .as_str()
        .context("the answer of the service has no link to the job")?
        .to_owned();
    let done = remote.follow(&path).await?;
    let model = done["links"]["model"]
        .as_str()
        .context("the finished job has no link to its model")?;

    create_folder(&args.output)?;
    for (remote_name, file) in [("mesh.glb", "lv.glb"), ("report.html", "report.html")] {
        let bytes = remote.bytes(&format!("{model}/{remote_name}")).await?;
        write_file(&args.output.join(file), &bytes)?;
    }
    print_figures(&remote.json(&format!("{model}/report")).await?);
    say!(
        "\nWritten: {} and {}",
        args.output.join("lv.glb").display(),
        args.output.join("report.html").display()
    );
    if args.exit {
        service.stop().await?;
        return Ok(());
    }
    print_next_steps(&remote.base, model);
    tokio::signal::ctrl_c().await?;
    service.stop().await?;
    Ok(())
}

/// A phantom with the default parameters, as the bytes of a .nii.gz file.
fn simulated_scan() -> Result<Vec<u8>> {
    let made = phantom(&PhantomParameters::default(), &Monitor::silent())?;
    Ok(nifti::write(&made.volume, StoredType::Int16, true)?)
}

fn print_figures(report: &Value) {
    let figure = |section: &str, key: &str| report[section][key].as_f64().unwrap_or(f64::NAN);
    let ratio = &report["shape"]["radius_ratio"];
    say!("\nThe model");
    say!(
        "  {} points, {} triangles, Euler characteristic {}, {} self-intersections",
        report["mesh"]["vertices"],
        report["mesh"]["triangles"],
        report["mesh"]["euler_characteristic"],
        report["mesh"]["self_intersections"]
    );
    say!(
        "  fitness {:.3} after re-tiling, {:.3} optimised ({:+.1} %)",
        figure("fitness", "retiled"),
        figure("fitness", "optimised"),
        figure("fitness", "gain_percent")
    );
    say!(
        "  triangle shape 2r/R {:.3} mean, {:.3} least (1 = equilateral)",
        ratio["mean"].as_f64().unwrap_or(f64::NAN),
        ratio["min"].as_f64().unwrap_or(f64::NAN)
    );
    say!(
        "  {:.2} mm mean and {:.2} mm largest distance to the surface",
        figure("distance", "mean_mm"),
        figure("distance", "hausdorff_mm")
    );
    say!(
        "  took {:.0} ms on this machine",
        figure("timings_ms", "total")
    );
}

fn print_next_steps(base: &str, model: &str) {
    say!(
        "\nServing until Ctrl-C. In another terminal:
  curl {base}/
  curl -s {base}{model}/report
  curl -s -H 'Accept: model/stl' {base}{model}/mesh -o lv.stl
  ventriform phantom -o phantom --seed 7
  curl -fsS --data-binary @phantom/spect.nii.gz -H 'Prefer: wait=60' \\
       -H 'Accept: model/gltf-binary' '{base}/v1/models?points=200' -o lv200.glb
In a browser: {base}/ and {base}/docs"
    );
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
