//! `ventriform serve` and `healthcheck`: settings, log, listener, signals.

use crate::config::{Flags, LogFormat, Settings};
use crate::http::{self, Running};
use crate::volume::ReadLimits;
use crate::work::Engine;
use anyhow::{Context, Result, bail};
use clap::Args;
use std::net::{SocketAddr, TcpListener};
use std::path::Path;
use std::time::Duration;
use tokio::runtime::Runtime;
use tracing_subscriber::EnvFilter;

/// How long the health check waits for an answer.
const HEALTH_TIMEOUT: Duration = Duration::from_secs(3);

/// Runs the HTTP service until Ctrl-C or SIGTERM.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform serve --data-dir data
  ventriform serve --listen 127.0.0.1:0 --data-dir data --workers 2
  VENTRIFORM_QUEUE_LIMIT=50 ventriform serve --config ventriform.toml --print-config

Every setting is also a variable (VENTRIFORM_DATA_DIR) and a key of the TOML file
(data_dir); a flag beats a variable, a variable the file.")]
pub struct ServeArgs {
    #[command(flatten)]
    flags: Flags,
    /// Print every setting with where it came from, and end
    #[arg(long)]
    print_config: bool,
}

/// Asks a running service whether it is ready, by the same settings; for containers.
#[derive(Debug, Args)]
pub struct HealthcheckArgs {
    #[command(flatten)]
    flags: Flags,
}

/// Runs the service.
///
/// # Errors
/// Where a setting cannot be used, the address is taken, or the data folder is unusable.
pub fn run(args: &ServeArgs) -> Result<()> {
    let (settings, origins) = Settings::load(&args.flags, variable)?;
    if args.print_config {
        print!("{}", settings.print(&origins));
        return Ok(());
    }
    start_log(&settings)?;
    let listener = bind(settings.listen)?;
    let address = listener.local_addr()?;
    let engine = engine(&settings);
    Runtime::new()?.block_on(async {
        let running = http::start(settings, engine, listener).await?;
        println!("Listening on http://{address} (documentation: http://{address}/docs)");
        shutdown_signal().await?;
        running.stop().await?;
        Ok(())
    })
}

/// Asks `/readyz` of the service at the configured address.
///
/// # Errors
/// Where it does not answer 200 in time.
pub fn check_health(args: &HealthcheckArgs) -> Result<()> {
    let (settings, _) = Settings::load(&args.flags, variable)?;
    let mut address = settings.listen;
    if address.ip().is_unspecified() {
        address.set_ip(match address {
            SocketAddr::V4(_) => std::net::Ipv4Addr::LOCALHOST.into(),
            SocketAddr::V6(_) => std::net::Ipv6Addr::LOCALHOST.into(),
        });
    }
    Runtime::new()?.block_on(async {
        let client = reqwest::Client::builder().timeout(HEALTH_TIMEOUT).build()?;
        let answer = client
            .get(format!("http://{address}/readyz"))
            .send()
            .await?;
        if !answer.status().is_success() {
            bail!("{} answers {}", address, answer.status());
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
    Ok(http::start(settings, engine, listener).await?)
}

fn engine(settings: &Settings) -> Engine {
    Engine::new(ReadLimits {
        voxels: settings.voxel_limit,
        unpacked_bytes: settings.decompressed_limit.0,
    })
}

fn variable(name: &str) -> Option<String> {
    std::env::var(name).ok()
}

fn bind(listen: SocketAddr) -> Result<TcpListener> {
    TcpListener::bind(listen).with_context(|| {
        format!("cannot listen on {listen}; give another address, or port 0 for a free one")
    })
}

fn start_log(settings: &Settings) -> Result<()> {
    let filter = EnvFilter::try_new(&settings.log)
        .with_context(|| format!("log = `{}` is no log filter", settings.log))?;
    let log = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr);
    match settings.log_format {
        LogFormat::Json => log.json().init(),
        LogFormat::Text => log.init(),
    }
    Ok(())
}

/// Returns at Ctrl-C, and at SIGTERM where there is such.
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
