//! The arguments of commands beside the service that work on its data, and the settings that they resolve to.
//!
//! Every command resolves settings as `serve` does: a flag, else an environment variable, else the file of `--config`,
//! else the default. A command has the flags of the settings that it needs.

use super::serve::variable;
use anyhow::{Result, anyhow};
use clap::Args;
use std::path::PathBuf;
use std::sync::Arc;
use ventriform_service::config::{BlobPlace, DatabaseUrl, Flags, Origins, Settings};
use ventriform_store::{DoctorError, IfNone, OpenError, SqlStore, open_beside};

/// Where the records of the service are.
#[derive(Debug, Args)]
pub struct DataArgs {
    /// TOML file with the settings of the service [env: VENTRIFORM_CONFIG]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Data folder of the service [env: VENTRIFORM_DATA_DIR] [default: ventriform-data]
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// Database of the service: `sqlite`, or the URL of a PostgreSQL database
    /// [env: VENTRIFORM_DATABASE] [default: sqlite]
    #[arg(long, value_name = "URL")]
    database: Option<DatabaseUrl>,
}

/// Where the records and the files of the service are.
#[derive(Debug, Args)]
pub struct StoreArgs {
    #[command(flatten)]
    data: DataArgs,
    /// Where the service keeps the files: `folder` is the data folder, else s3://BUCKET/PREFIX. Address and
    /// credentials come from the environment, as for the service [env: VENTRIFORM_BLOBS] [default: folder]
    #[arg(long, value_name = "URL")]
    blobs: Option<BlobPlace>,
}

/// The settings of the service, and where each came from.
pub struct Resolved {
    /// The settings.
    pub settings: Settings,
    origins: Origins,
}

impl DataArgs {
    /// Whether a place of records is given.
    pub fn is_given(&self) -> bool {
        self.data_dir.is_some() || self.database.is_some()
    }

    /// The file of settings.
    pub fn config(&self) -> Option<PathBuf> {
        self.config.clone()
    }

    fn flags(&self) -> Flags {
        Flags {
            config: self.config.clone(),
            data_dir: self.data_dir.clone(),
            database: self.database.clone(),
            ..Flags::default()
        }
    }

    /// The settings of the service.
    ///
    /// # Errors
    /// If a setting is invalid.
    pub fn settings(&self) -> Result<Resolved> {
        Resolved::from_flags(&self.flags())
    }

    /// Opens the database of a store.
    ///
    /// # Errors
    /// If a setting is invalid, there is no store, or the database cannot be used.
    pub async fn open(&self, if_none: IfNone) -> Result<Arc<SqlStore>> {
        let found = self.settings()?;
        let settings = &found.settings;
        let opened = open_beside(&settings.data_dir, settings.postgres().as_ref(), if_none).await;
        opened.map_err(|error| found.explained(error))
    }
}

impl StoreArgs {
    /// The settings of the service, with what the environment says of a bucket.
    ///
    /// # Errors
    /// If a setting is invalid.
    pub fn settings(&self) -> Result<Resolved> {
        Resolved::from_flags(&Flags {
            blobs: self.blobs.clone(),
            ..self.data.flags()
        })
    }
}

impl Resolved {
    fn from_flags(flags: &Flags) -> Result<Self> {
        let (mut settings, origins) = Settings::load(flags, variable)?;
        settings.read_aws(variable);
        Ok(Self { settings, origins })
    }

    /// Refuses settings by which the records are on a server, for a command that works on those in a data folder.
    ///
    /// # Errors
    /// If they are.
    pub fn require_file(&self, instead: &str) -> Result<()> {
        match &self.settings.database.0 {
            None => Ok(()),
            Some(url) => Err(anyhow!(
                "the records of the service are in {url} ({}), and this command works on those in a data folder: \
                 {instead}. For a folder whose records are in its file, give --database sqlite",
                self.origins.origin("database").described("database")
            )),
        }
    }

    /// The error, and of one for which the settings may name the wrong place, where that came from.
    pub fn explained(&self, error: impl Into<anyhow::Error>) -> anyhow::Error {
        let error = error.into();
        let opening = match error.downcast_ref() {
            Some(DoctorError::Open(opening)) => Some(opening),
            _ => error.downcast_ref(),
        };
        let Some(OpenError::NoStore { .. }) = opening else {
            return error;
        };
        let of = if self.settings.database.0.is_some() {
            "database"
        } else {
            "data_dir"
        };
        anyhow!(
            "{error}. That comes from the {}; give what the service has, such as --data-dir /var/lib/ventriform, \
             or the file of its settings by --config. Before its first start, make an empty folder for it (mkdir): \
             then `keys create` makes the store",
            self.origins.origin(of).described(of)
        )
    }
}
