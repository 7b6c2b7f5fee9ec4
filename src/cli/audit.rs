//! `ventriform audit`: checks the audit trail of a data folder, also while the service runs on it.

use super::data_args::{DataArgs, StoreArgs};
use super::output::{json, note, say};
use crate::server::store_settings;
use anyhow::{Result, anyhow, bail};
use clap::{Args, Subcommand};
use std::path::PathBuf;
use tokio::runtime::Runtime;
use ventriform_service::base::records::ListRequest;
use ventriform_service::callers::{AccessStore, AuditFilter, fhir, verify};
use ventriform_service::config::{PostgresSettings, Settings};
use ventriform_store::{IfNone, NewerStore, Store, apply, missed, require_store};

/// Check or print the audit trail, also while the service runs
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform audit verify --data-dir data
  ventriform audit print --data-dir data > audit.ndjson
  ventriform audit missed --from data.broken --data-dir data
  ventriform audit missed --from data.broken --data-dir data --apply
  ventriform audit missed --from postgres://me@db/broken --database postgres://me@db/restored --data-dir data

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
    /// List acts of a newer trail that are missing in this restored store: keys revoked, items erased and legal holds set
    /// after the backup; with --apply, repeat them here (stop the service first)
    Missed(MissedArgs),
    /// Print all events, newest first, one FHIR AuditEvent per line
    Print(DataArgs),
}

#[derive(Debug, Args)]
struct MissedArgs {
    /// Where the newer trail is, such as that of the store that was replaced: a data folder, whose database may be damaged, or
    /// the URL of a PostgreSQL database. Nothing is written there
    #[arg(long, value_name = "DIR|URL")]
    from: String,
    /// Repeat the missing acts here
    #[arg(long)]
    apply: bool,
    #[command(flatten)]
    store: StoreArgs,
}

/// Runs the command.
///
/// # Errors
/// If the chain is broken, or the data folder cannot be used.
pub fn run(args: &AuditArgs) -> Result<()> {
    Runtime::new()?.block_on(async {
        match &args.command {
            AuditCommand::Verify(args) => check(args).await,
            AuditCommand::Missed(args) => catch_up(args).await,
            AuditCommand::Print(args) => print(args).await,
        }
    })
}

async fn check(args: &DataArgs) -> Result<()> {
    let store = args.open(IfNone::Refuse).await?;
    let report = verify(&*store).await?;
    if let Some(broken) = report.broken {
        for row in &report.unconfirmed {
            note!(
                "{} names row {} with the hash {}",
                row.place,
                row.sequence,
                row.hash
            );
        }
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

async fn catch_up(args: &MissedArgs) -> Result<()> {
    let service = args.store.settings()?;
    ventriform_http::install_cryptography();
    let folder = &service.settings.data_dir;
    if service.settings.database.0.is_none() {
        require_store(folder, IfNone::Refuse).map_err(|error| service.explained(error))?;
    }
    let mut store = Store::open_with(folder, store_settings(&service.settings)).await?;
    let told = tell_missed(args, &service.settings, &store).await;
    store.close().await;
    told
}

/// Where the newer store is: a URL names a database, all else a folder.
fn newer(from: &str, service: &Settings) -> Result<NewerStore> {
    if !from.contains("://") {
        return Ok(NewerStore::Folder(PathBuf::from(from)));
    }
    let url = from
        .parse()
        .map_err(|why| anyhow!("--from: {why}; or give a data folder"))?;
    Ok(NewerStore::Server(PostgresSettings {
        url,
        connections: 1,
        patience: service.database_wait.0,
    }))
}

async fn tell_missed(args: &MissedArgs, service: &Settings, store: &Store) -> Result<()> {
    let missed = missed(&store.rows, &newer(&args.from, service)?).await?;
    for act in &missed.acts {
        say!("{act}");
    }
    let rows = missed.rows.len();
    say!(
        "{} acts are missed; {rows} rows of the newer trail follow those here",
        missed.acts.len()
    );
    for table in &missed.unread {
        note!("of the newer store could not be read: {table}");
    }
    if args.apply {
        let left = apply(store, &missed).await?;
        if !left.is_empty() {
            bail!("not done:\n{}", left.join("\n"));
        }
        say!("all of them are done here");
    } else if !missed.acts.is_empty() || rows > 0 {
        say!("do the same here: give --apply");
    }
    if !missed.unread.is_empty() {
        bail!("what the unreadable tables say may be missed still");
    }
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
