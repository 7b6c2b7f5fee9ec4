//! `ventriform healthcheck`: asks a running service whether it can accept work. For
//! containers, whose images hold no curl.

use crate::config::{Flags, Settings};
use anyhow::{Result, bail};
use clap::Args;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(5);

/// Asks a running service whether it can accept work; fails if not.
#[derive(Debug, Args)]
pub struct HealthcheckArgs {
    /// The service's address [default: that of the settings]
    #[arg(long, value_name = "ADDR")]
    address: Option<SocketAddr>,
}

/// Runs the command.
///
/// # Errors
/// If the service does not answer or is not ready.
pub fn run(args: &HealthcheckArgs) -> Result<()> {
    let address = match args.address {
        Some(address) => address,
        None => {
            let variable = |name: &str| std::env::var(name).ok();
            reachable(Settings::load(&Flags::default(), variable)?.0.listen)
        }
    };
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        let client = reqwest::Client::builder().timeout(PATIENCE).build()?;
        let answer = client
            .get(format!("http://{address}/readyz"))
            .send()
            .await?;
        if !answer.status().is_success() {
            bail!("{}: {}", answer.status(), answer.text().await?);
        }
        Ok(())
    })
}

/// Whoever listens on every address is reached on loopback.
fn reachable(listen: SocketAddr) -> SocketAddr {
    let ip = match listen.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    SocketAddr::new(ip, listen.port())
}
