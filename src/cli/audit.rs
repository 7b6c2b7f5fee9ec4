//! `ventriform audit`: checks the audit trail of a data folder, also while the service runs on it.

use super::data_args::DataArgs;
use super::output::{json, say};
use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use tokio::runtime::Runtime;
use ventriform_service::access::{AccessStore, AuditFilter, fhir, verify};
use ventriform_service::records::ListRequest;
use ventriform_store::IfNone;

/// Check or print the audit trail, also while the service runs
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform audit verify --data-dir data
  ventriform audit print --data-dir data > audit.ndjson

`verify` prints the newest hash. Keep it in another place: a trail that was written anew as a
whole has other hashes.")]
pub struct AuditArgs {
    #[command(subcommand)]
    command: AuditCommand,
}

#[derive(Debug, Subcommand)]
enum AuditCommand {
    /// Walk the chain of hashes and name the first break; fails if there is one
    Verify(DataArgs),
    /// Print all events, newest first, one FHIR AuditEvent per line
    Print(DataArgs),
}

/// Runs the command.
///
/// # Errors
/// If the chain is broken, or the data folder cannot be used.
pub fn run(args: &AuditArgs) -> Result<()> {
    Runtime::new()?.block_on(async {
        match &args.command {
            AuditCommand::Verify(args) => check(args).await,
            AuditCommand::Print(args) => print(args).await,
        }
    })
}

async fn check(args: &DataArgs) -> Result<()> {
    let store = args.open(IfNone::Refuse).await?;
    let report = verify(&*store).await?;
    if let Some(broken) = report.broken {
        bail!(
            "the audit trail is broken: {broken} ({} rows before it are in order)",
            report.rows
        );
    }
    say!(
        "{} rows are in order; the newest is {} with the hash {}",
        report.rows,
        report.newest,
        report.head
    );
    Ok(())
}

async fn print(args: &DataArgs) -> Result<()> {
    let store = args.open(IfNone::Refuse).await?;
    let mut before = None;
    loop {
        let page = ListRequest {
            before,
            limit: 1000,
        };
        let page = store.audit(&AuditFilter::default(), page).await?;
        for record in &page.items {
            json(&fhir(record).to_string());
        }
        before = page.next;
        if before.is_none() {
            return Ok(());
        }
    }
}
