//! `ventriform doctor` and `ventriform backup`: checking, repairing and copying a data folder.

use super::data_args::StoreArgs;
use super::output::{json, say};
use crate::server::s3_location;
use anyhow::{Context, Result, bail};
use clap::Args;
use std::path::PathBuf;
use tokio::runtime::Runtime;
use ventriform_service::base::records::Tenant;
use ventriform_store::{Examination, Repair, examine, examine_on_server};

/// Check a data folder, and repair it from what lies on disk (stop the service first)
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform doctor --data-dir data
  ventriform doctor --data-dir data --repair
  ventriform doctor --data-dir data --repair --tenant clinic-b
  ventriform doctor --data-dir data --json
  ventriform doctor --data-dir data --database postgres://ventriform@db/ventriform
  ventriform doctor --data-dir data --blobs s3://hearts/prod

The status is 0 if nothing is wrong or everything was repaired, else 1; also 1 if a repair found that rows are
lost. A repair deletes no content: what is broken or has no record is moved into the folder `quarantine`. \
What was lost, given to another tenant or closed is listed here and in the audit trail.")]
pub struct DoctorArgs {
    #[command(flatten)]
    store: StoreArgs,
    /// Repair what can be repaired
    #[arg(long)]
    repair: bool,
    /// Tenant for items without an owner (volumes get a legal hold) [default: they stay in the quarantine]
    #[arg(long, value_name = "NAME", requires = "repair")]
    tenant: Option<Tenant>,
    /// Print the findings as JSON
    #[arg(long)]
    json: bool,
}

/// Copy a data folder while the service runs or not
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform backup --data-dir data /backups/ventriform

The target is empty or holds an earlier backup, of which unchanged files are kept. To restore, stop
the service, copy the target to the data folder, and start the service.")]
pub struct BackupArgs {
    #[command(flatten)]
    store: StoreArgs,
    /// Folder to copy to
    target: PathBuf,
}

/// Checks a data folder, and repairs it if asked to.
///
/// # Errors
/// If the folder cannot be examined, or something is wrong that was not repaired.
pub fn run(args: &DoctorArgs) -> Result<()> {
    let repair = args.repair.then(|| Repair {
        heir: args.tenant.clone(),
    });
    let service = args.store.settings()?;
    ventriform_http::install_cryptography();
    let settings = &service.settings;
    let (s3, server) = (s3_location(settings), settings.postgres());
    let found = Runtime::new()?.block_on(async {
        let (folder, s3, repair) = (&settings.data_dir, s3.as_ref(), repair.as_ref());
        match &server {
            Some(server) => examine_on_server(folder, server, s3, repair).await,
            None => examine(folder, s3, repair).await,
        }
    });
    let found = found
        .map_err(|error| service.explained(error))
        .with_context(|| format!("examining {}", settings.data_dir.display()))?;
    if args.json {
        json(&serde_json::to_string_pretty(&found)?)
    } else {
        print(&found)
    }
    if found.is_healthy() {
        return Ok(());
    }
    if args.repair {
        bail!(
            "not everything could be repaired: what is lost is named above and in the audit trail; a backup may have it"
        )
    }
    bail!("the folder is not healthy; repair it with --repair, or restore a backup")
}

fn print(found: &Examination) {
    for finding in &found.findings {
        let repair = finding.repair.map(|done| format!(" Repaired: {done}."));
        say!(
            "{} {}: {}{}",
            finding.kind,
            finding.subject,
            finding.detail,
            repair.unwrap_or_default()
        );
    }
    say!(
        "{} items with a row, {} files read, {} findings",
        found.items,
        found.files,
        found.findings.len()
    );
}

/// Copies a data folder.
///
/// # Errors
/// If the folder cannot be copied, or items in it are damaged.
pub fn back_up(args: &BackupArgs) -> Result<()> {
    let service = args.store.settings()?;
    service.require_file("the tools of PostgreSQL copy it, such as pg_dump")?;
    if let Some(bucket) = s3_location(&service.settings) {
        bail!(
            "the files of the service are in {bucket}, and this command copies those in a data folder: the tools of S3 \
             copy a bucket. For a folder with its files, give --blobs folder"
        );
    }
    let done = ventriform_store::backup(&service.settings.data_dir, &args.target);
    let done = Runtime::new()?.block_on(done);
    let done = done
        .map_err(|error| service.explained(error))
        .with_context(|| {
            let folder = service.settings.data_dir.display();
            format!("copying {folder} to {}", args.target.display())
        })?;
    say!(
        "{} items in the backup, {} of them copied now",
        done.items,
        done.copied
    );
    if done.damaged.is_empty() {
        return Ok(());
    }
    bail!(
        "items that are damaged in the data folder are not in the backup:\n{}",
        done.damaged.join("\n")
    )
}
