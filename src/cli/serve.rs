//! `ventriform serve`: settings, log, service, signals.

use crate::config::{Flags, LogFormat, Settings};
use crate::http::{self, Running};
use crate::jobs::Engine;
use crate::volume::ReadLimits;
use anyhow::{Context, Result};
use clap::Args;
use std::net::{SocketAddr, TcpListener};
use std::path::Path;
use tokio::signal::unix::{SignalKind, signal};
use tracing_subscriber::EnvFilter;

/// Serves models over HTTP.
#[derive(Debug, Args)]
#[command(
    after_help = "Every setting is also a variable, VENTRIFORM_ and its name in capitals
(VENTRIFORM_DATA_DIR), and a key of the file of --config (data_dir). A flag
beats a variable, a variable beats the file.

Examples:
  ventriform serve
  ventriform serve --listen 0.0.0.0:8080 --data-dir /data --workers 4
  ventriform serve --config ventriform.toml --print-config"
)]
pub struct ServeArgs {
    /// Print every setting with its origin, and end
    #[arg(long)]
    print_config: bool,
    #[command(flatten)]
    flags: Flags,
}

/// Runs the command until SIGTERM or Ctrl-C; a second signal ends it at once.
///
/// # Errors
/// Where a setting is invalid, the address is taken, or the data folder cannot be used.
pub fn run(args: &ServeArgs) -> Result<()> {
    let (settings, origins) = Settings::load(&args.flags, |name| std::env::var(name).ok())?;
    if args.print_config {
        print!("{}", settings.print(&origins));
        return Ok(());
    }
    start_log(&settings)?;
    let runtime = tokio::runtime::Runtime::new().context("cannot start the runtime")?;
    let outcome = runtime.block_on(serve(settings));
    // Work that did not look up from its task holds nobody back.
    runtime.shutdown_background();
    outcome
}

async fn serve(settings: Settings) -> Result<()> {
    let running = start(settings).await?;
    println!("ventriform listens on http://{}", running.address());
    wait_for_signal().await?;
    tokio::select! {
        stopped = running.stop() => Ok(stopped?),
        again = wait_for_signal() => again.context("ended before jobs were done; they go on at the next start"),
    }
}

async fn start(settings: Settings) -> Result<Running> {
    let listener = TcpListener::bind(settings.listen)
        .with_context(|| format!("cannot listen on {}", settings.listen))?;
    let engine = Engine::new(ReadLimits {
        voxels: settings.voxel_limit,
        unpacked_bytes: settings.decompressed_limit.0,
    });
    Ok(http::start(settings, engine, listener).await?)
}

async fn wait_for_signal() -> Result<()> {
    let mut terminate = signal(SignalKind::terminate())?;
    tokio::select! {
        _ = terminate.recv() => Ok(()),
        pressed = tokio::signal::ctrl_c() => Ok(pressed?),
    }
}

fn start_log(settings: &Settings) -> Result<()> {
    let filter: EnvFilter = settings
        .log
        .parse()
        .with_context(|| format!("log = `{}`: not in the form of RUST_LOG", settings.log))?;
    let log = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr);
    match settings.log_format {
        LogFormat::Text => log.init(),
        LogFormat::Json => log.json().init(),
    }
    Ok(())
}

/// A service within this process, on defaults, for the demo.
pub struct LocalService(Running);

/// Starts a service on `listen` with its data in `data_dir`.
///
/// # Errors
/// Where the address is taken or the folder cannot be used.
pub async fn start_local(listen: SocketAddr, data_dir: &Path) -> Result<LocalService> {
    let settings = Settings {
        listen,
        data_dir: data_dir.to_owned(),
        ..Settings::default()
    };
    Ok(LocalService(start(settings).await?))
}

impl LocalService {
    /// Where it answers.
    pub fn url(&self) -> String {
        format!("http://{}", self.0.address())
    }

    /// Ends it in order.
    ///
    /// # Errors
    /// If the network had failed it.
    pub async fn stop(self) -> Result<()> {
        Ok(self.0.stop().await?)
    }
}
