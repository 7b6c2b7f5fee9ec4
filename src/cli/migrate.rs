//! `ventriform migrate`: moving a data folder to PostgreSQL and an S3 store, and noting that files were moved.

use super::data_args::DataArgs;
use super::output::{note, say};
use super::serve::variable;
use crate::server::s3_location;
use anyhow::{Context, Result, bail};
use clap::Args;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};
use tokio::runtime::Runtime;
use ventriform_service::callers::verify;
use ventriform_service::config::{BlobPlace, DatabaseUrl, Flags, Settings};
use ventriform_store::{Destination, IfNone, Migrated, MovedFiles, Progress, open_database};

/// Time between two lines about the progress.
const TOLD_EVERY: Duration = Duration::from_secs(2);

/// Copy a data folder to PostgreSQL, to an S3 store, or to both, or note that files were moved (stop the service first)
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform migrate --from data --to postgres://ventriform@db/ventriform,s3://hearts/prod
  ventriform migrate --from data --to postgres://ventriform@db/ventriform,new-data
  ventriform migrate --from data --to s3://hearts/prod,new-data
  ventriform migrate --moved-files s3://hearts/restored --database postgres://ventriform@db/ventriform

Every file is hashed on both sides, every row is read back. The folder stays as it is. If it is stopped or
fails, give the same command again: it goes on where it stopped, and no service starts on what is
unfinished.

With --moved-files nothing is copied: other tools have moved the files of a store, and its database is told
where they are. Every file that it names must be there, in its full length.

Passwords and credentials come from the environment, as for the service.")]
pub struct MigrateArgs {
    /// Data folder of the service, with its records in `ventriform.db` and its files beside it
    #[arg(
        long,
        value_name = "DIR",
        required_unless_present = "moved_files",
        conflicts_with = "moved_files"
    )]
    from: Option<PathBuf>,
    /// Where to: postgres://USER@HOST:PORT/NAME, s3://BUCKET/PREFIX, or both; with one alone, also the new
    /// data folder for the rest. A comma in a password is written %2C
    #[arg(
        long,
        value_name = "TARGET,...",
        value_delimiter = ',',
        required_unless_present = "moved_files",
        conflicts_with = "moved_files"
    )]
    to: Vec<String>,
    /// The place of files that were moved: s3://BUCKET/PREFIX, or with records in PostgreSQL a data folder
    #[arg(long, value_name = "PLACE")]
    moved_files: Option<String>,
    #[command(flatten)]
    records: DataArgs,
}

/// Copies a data folder.
///
/// # Errors
/// If it was not copied as a whole.
pub fn run(args: &MigrateArgs) -> Result<()> {
    if let Some(place) = &args.moved_files {
        return note_moved(place, &args.records);
    }
    if args.records.is_given() {
        bail!(
            "--data-dir and --database belong to --moved-files; --from and --to say what is copied where"
        );
    }
    let to = args.destination()?;
    let from = args.from.clone().unwrap_or_default();
    ventriform_http::install_cryptography();
    let told = Mutex::new(Instant::now());
    let tell = |progress: Progress| {
        let Ok(mut told) = told.lock() else { return };
        if told.elapsed() >= TOLD_EVERY {
            *told = Instant::now();
            note!("{}", line(progress));
        }
    };
    Runtime::new()?.block_on(async {
        let done = ventriform_store::migrate(&from, &to, tell).await?;
        print(&done);
        check_trail(&to).await
    })
}

/// Notes in the database that its files are at `place`.
fn note_moved(place: &str, records: &DataArgs) -> Result<()> {
    let settings = records.settings()?.settings;
    let files = match place.split_once("://") {
        Some(("s3", _)) => {
            let blobs: BlobPlace = place.parse().map_err(anyhow::Error::msg)?;
            let mut settings = Settings {
                blobs,
                ..settings.clone()
            };
            settings.read_aws(variable);
            MovedFiles::Bucket(s3_location(&settings).context("--moved-files names no bucket")?)
        }
        Some((scheme, _)) => {
            bail!(
                "--moved-files: {scheme}:// cannot hold files: give s3://BUCKET/PREFIX or a folder"
            )
        }
        None => MovedFiles::Folder(PathBuf::from(place)),
    };
    ventriform_http::install_cryptography();
    let database = settings.postgres();
    let items = Runtime::new()?.block_on(async {
        if database.is_some() {
            // An empty database would be made into that of a store without items.
            records.open(IfNone::Refuse).await?.close().await;
        }
        let data_dir = &settings.data_dir;
        let noted = ventriform_store::note_moved_files(data_dir, database.as_ref(), &files);
        anyhow::Ok(noted.await?)
    })?;
    say!("the files of {items} items are in {place}, as the records say now");
    Ok(())
}

impl MigrateArgs {
    fn destination(&self) -> Result<Destination> {
        let mut flags = Flags {
            config: self.records.config(),
            ..Flags::default()
        };
        let mut folder = None;
        for part in &self.to {
            let twice = match part.split_once("://") {
                Some(("postgres" | "postgresql", _)) => {
                    let url: DatabaseUrl = part.parse().map_err(anyhow::Error::msg)?;
                    flags.database.replace(url).is_some()
                }
                Some(("s3", _)) => {
                    let place: BlobPlace = part.parse().map_err(anyhow::Error::msg)?;
                    flags.blobs.replace(place).is_some()
                }
                Some((scheme, _)) => bail!("--to: {scheme}:// is neither postgres:// nor s3://"),
                None => folder.replace(PathBuf::from(part)).is_some(),
            };
            if twice {
                bail!("--to: two targets of one kind: give one of each at most");
            }
        }
        // What the environment says of the service is not meant here.
        flags
            .database
            .get_or_insert("sqlite".parse().map_err(anyhow::Error::msg)?);
        flags.blobs.get_or_insert(BlobPlace::Folder);
        let mut settings = Settings::load(&flags, variable)?.0;
        settings.read_aws(variable);
        Ok(Destination {
            database: settings.postgres(),
            s3: s3_location(&settings),
            folder,
        })
    }
}

fn line(progress: Progress) -> String {
    match progress {
        Progress::Items { done, of } => format!("{done} of {of} items"),
        Progress::Rows { done } => format!("{done} rows"),
    }
}

fn print(done: &Migrated) {
    for table in done.tables.iter().filter(|table| table.rows > 0) {
        say!("{:>10} {}", table.rows, table.name);
    }
    let rows: u64 = done.tables.iter().map(|table| table.rows).sum();
    if done.was_done {
        say!("{rows} rows are the same on both sides: it was moved before")
    } else {
        say!(
            "{rows} rows, {} items ({} of them copied now), {} received objects",
            done.items,
            done.copied,
            done.received
        )
    }
}

/// Walks the audit trail that the target has now.
async fn check_trail(to: &Destination) -> Result<()> {
    let folder = to.folder.clone().unwrap_or_default();
    let rows = open_database(&folder, to.database.as_ref()).await?;
    let report = verify(rows.as_ref()).await?;
    rows.close().await;
    match report.broken {
        None => say!(
            "audit trail: {} rows, unbroken up to {} ({})",
            report.rows,
            report.newest,
            report.head
        ),
        Some(broken) => say!(
            "audit trail: {broken}. It is the same in the folder that was moved: all was copied as it was"
        ),
    }
    Ok(())
}
