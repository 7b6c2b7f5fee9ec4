//! `ventriform serve` and `ventriform healthcheck`: settings, listener, signals.

use super::log;
use super::output::say;
use crate::server::{self, Running};
use anyhow::{Context, Result, bail};
use clap::Args;
use std::net::{SocketAddr, TcpListener};
use std::path::Path;
use std::time::Duration;
use tokio::runtime::Runtime;
use ventriform::image::volume::ReadLimits;
use ventriform_service::config::{Flags, Settings};
use ventriform_service::jobs::{Isolation, serve_isolated};
use ventriform_service::network;
use ventriform_service::work::Engine;

/// Time for which the health check waits for an answer.
const HEALTH_TIMEOUT: Duration = Duration::from_secs(3);

/// Threads for work that blocks, if the settings name no number. tokio's 512 have stacks of 1 GiB together: where a disk
/// is slow, as many uploads at once would take them, and the service would die at its limit of memory.
const DEFAULT_BLOCKING_THREADS: usize = 64;

/// Run the HTTP service until Ctrl-C or SIGTERM
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform serve --data-dir data
  ventriform serve --listen 127.0.0.1:0 --data-dir data --workers 2
  VENTRIFORM_QUEUE_LIMIT=50 ventriform serve --config ventriform.toml --print-config

Every setting can also be given as an environment variable (VENTRIFORM_DATA_DIR) or as a key of
the TOML file (data_dir). A flag overrides a variable, and a variable overrides the file.")]
pub struct ServeArgs {
    #[command(flatten)]
    flags: Flags,
    /// Print all settings and where each came from, then exit
    #[arg(long)]
    print_config: bool,
}

/// Check that a running service is ready (for containers); takes the settings of `serve`
#[derive(Debug, Args)]
pub struct HealthcheckArgs {
    #[command(flatten)]
    flags: Flags,
}

/// Runs the service.
///
/// # Errors
/// If a setting is invalid, the address is in use, or the data folder cannot be used.
pub fn run(args: &ServeArgs) -> Result<()> {
    let (mut settings, origins) = Settings::load(&args.flags, variable)?;
    if args.print_config {
        say!("{}", settings.print(&origins).trim_end_matches('\n'));
        return Ok(());
    }
    settings.read_credentials(variable)?;
    let arenas = limit_arenas();
    let _written_on_return = log::start(&settings, variable)?;
    if let Err(error) = arenas {
        tracing::warn!(%error, "the memory allocator keeps its default; set MALLOC_ARENA_MAX");
    }
    let listener = bind(settings.listen)?;
    let address = listener.local_addr()?;
    let engine = engine(&settings);
    let scheme = scheme(&settings);
    let mut runtime = tokio::runtime::Builder::new_multi_thread();
    runtime
        .enable_all()
        .max_blocking_threads(settings.blocking_threads.or(DEFAULT_BLOCKING_THREADS));
    runtime.build()?.block_on(async {
        let running = server::start(settings, engine, listener).await?;
        let dicom = running.dicom_address();
        let dicom = dicom.map(|address| format!(", for DICOM on {address}"));
        say!(
            "Listening on {scheme}://{address} (documentation: {scheme}://{address}/docs){}",
            dicom.unwrap_or_default()
        );
        shutdown_signal().await?;
        running.stop().await?;
        Ok(())
    })
}

/// Starts the program anew with few arenas of glibc's allocator, unless the environment says
/// how many: one per core, and those that the main thread and the log take first. Where two threads that serve
/// share one, they wait for each other, and small requests take a quarter longer. glibc reads that number only when a
/// program starts. By default there are eight per core; each keeps the greatest memory that one of its threads ever
/// needed, so that under a mixed load the memory of the service rises for hours.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn limit_arenas() -> std::io::Result<()> {
    use std::os::unix::process::CommandExt;
    const ARENAS_TAKEN_FIRST: usize = 2;
    const MALLOC_ARENAS_VARIABLE: &str = "MALLOC_ARENA_MAX";
    let mut arguments = std::env::args_os();
    let (Some(name), None) = (arguments.next(), std::env::var_os(MALLOC_ARENAS_VARIABLE)) else {
        return Ok(());
    };
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    Err(std::process::Command::new("/proc/self/exe")
        .arg0(name)
        .args(arguments)
        .env(
            MALLOC_ARENAS_VARIABLE,
            (cores + ARENAS_TAKEN_FIRST).to_string(),
        )
        .exec())
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn limit_arenas() -> std::io::Result<()> {
    Ok(())
}

/// Asks `/readyz` of the service at the configured address.
///
/// # Errors
/// If the service does not answer 200 within three seconds.
pub fn check_health(args: &HealthcheckArgs) -> Result<()> {
    let (settings, _) = Settings::load(&args.flags, variable)?;
    let mut address = settings.listen;
    if address.ip().is_unspecified() {
        address.set_ip(match address {
            SocketAddr::V4(_) => std::net::Ipv4Addr::LOCALHOST.into(),
            SocketAddr::V6(_) => std::net::Ipv6Addr::LOCALHOST.into(),
        });
    }
    ventriform_http::install_cryptography();
    let scheme = scheme(&settings);
    Runtime::new()?.block_on(async {
        let client = reqwest::Client::builder()
            .timeout(HEALTH_TIMEOUT)
            // The certificate names the service's public address and not this one. Nothing secret
            // is sent, and nothing but the status is used.
            .tls_danger_accept_invalid_certs(true)
            .build()?;
        let answer = client.get(format!("{scheme}://{address}/readyz")).send();
        let answer = answer.await.with_context(|| {
            format!(
                "no service answers at {address}; start it, or give the address that it has by --listen or \
                 VENTRIFORM_LISTEN, such as 127.0.0.1:8080"
            )
        })?;
        if !answer.status().is_success() {
            bail!(
                "the service at {address} is not ready: it answered {}",
                answer.status()
            );
        }
        Ok(())
    })
}

/// A service on this machine with default settings, for the demo.
///
/// # Errors
/// As [`run`].
pub async fn start_local(listen: SocketAddr, data_dir: &Path) -> Result<Running> {
    let settings = Settings {
        listen,
        data_dir: data_dir.to_owned(),
        ..Settings::default()
    };
    let engine = engine(&settings);
    let listener = bind(listen)?;
    Ok(server::start(settings, engine, listener).await?)
}

fn scheme(settings: &Settings) -> &'static str {
    match settings.tls_cert.0 {
        Some(_) => "https",
        None => "http",
    }
}

fn engine(settings: &Settings) -> Engine {
    let limits = ComputeArgs {
        voxel_limit: settings.voxel_limit,
        unpacked_limit: settings.decompressed_limit.0,
        file_limit: settings.file_limit,
        mesh_limit: settings.mesh_limit.0,
    };
    let mut engine = limits.engine();
    if let Some(isolation) = limits.isolation() {
        engine.works = engine.works.with_isolation(isolation);
    }
    engine
}

/// The name of the command of [`compute`].
pub const COMPUTE_COMMAND: &str = "compute-job";

/// Compute the job that standard input describes; started by the service
#[derive(Debug, Args)]
pub struct ComputeArgs {
    /// Largest number of voxels of one volume
    #[arg(long)]
    voxel_limit: u64,
    /// Largest volume after decompression, bytes
    #[arg(long)]
    unpacked_limit: u64,
    /// Largest number of files in a zip archive
    #[arg(long)]
    file_limit: u64,
    /// Largest file of a mesh, unpacked, bytes
    #[arg(long)]
    mesh_limit: u64,
}

impl ComputeArgs {
    fn engine(&self) -> Engine {
        Engine::new(ReadLimits {
            voxels: self.voxel_limit,
            unpacked_bytes: self.unpacked_limit,
            files: self.file_limit,
            mesh_bytes: self.mesh_limit,
            ..ReadLimits::DEFAULT
        })
    }

    /// How to start [`compute`] with these limits; `None` if the system does not say which program
    /// this is.
    fn isolation(&self) -> Option<Isolation> {
        // The link names the running program even after its file was replaced by another version.
        let link = Path::new("/proc/self/exe");
        let program = if link.exists() {
            link.to_owned()
        } else {
            std::env::current_exe().ok()?
        };
        let arguments = [
            COMPUTE_COMMAND.to_owned(),
            format!("--voxel-limit={}", self.voxel_limit),
            format!("--unpacked-limit={}", self.unpacked_limit),
            format!("--file-limit={}", self.file_limit),
            format!("--mesh-limit={}", self.mesh_limit),
        ];
        Some(Isolation {
            program,
            arguments: arguments.into_iter().map(Into::into).collect(),
        })
    }
}

/// Computes one job for a service; see [`Isolation`].
///
/// # Errors
/// If standard input holds no job.
pub fn compute(args: &ComputeArgs) -> Result<()> {
    serve_isolated(&args.engine().works).context("standard input holds no job of a service")
}

pub(super) fn variable(name: &str) -> Option<String> {
    std::env::var(name).ok()
}

fn bind(listen: SocketAddr) -> Result<TcpListener> {
    network::listen::listen(listen).with_context(|| {
        format!(
            "cannot listen on {listen} (--listen); give another address of this machine, such as 127.0.0.1:8081, or \
             port 0 for any free port"
        )
    })
}

/// Returns on Ctrl-C, and on SIGTERM where the system has it.
async fn shutdown_signal() -> Result<()> {
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        let mut terminate = signal(SignalKind::terminate())?;
        tokio::select! {
            pressed = tokio::signal::ctrl_c() => pressed?,
            _ = terminate.recv() => {}
        }
    }
    #[cfg(not(unix))]
    tokio::signal::ctrl_c().await?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Command;
    use ventriform_service::config::variable_name;

    #[test]
    fn help_describes_every_setting_with_its_variable_and_default() {
        let mut command = ServeArgs::augment_args(Command::new("serve")).term_width(0);
        let help = command.render_long_help().to_string();
        for row in Settings::ROWS {
            // Switches may have a value: `--flag [<VALUE>]`.
            let value = [" <", " [<"].map(|value| format!("{}{value}", row.flag()));
            let start = value
                .iter()
                .find_map(|text| help.find(text))
                .unwrap_or_else(|| panic!("{} is missing", row.flag()));
            let text = help[start..].lines().take(2).collect::<Vec<_>>().join(" ");
            assert!(row.summary().len() > 10, "{}", row.name);
            for part in [
                row.summary(),
                format!("[env: {}]", variable_name(row.name)),
                row.default.to_owned(),
            ] {
                assert!(text.contains(&part), "{part}: {text}");
            }
            assert!(help.contains(&format!("{}:\n", row.group)), "{}", row.group);
        }
    }
}
