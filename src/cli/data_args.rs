//! The arguments of commands beside the service that use its database.

use super::serve::settings_beside;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;
use std::sync::Arc;
use ventriform_service::config::{DatabaseUrl, Settings};
use ventriform_store::{SqlStore, open_database};

#[derive(Debug, Args)]
pub struct DataArgs {
    /// Data folder of the service [env: VENTRIFORM_DATA_DIR] [default: ventriform-data]
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// Database of the service: `sqlite`, or the URL of a PostgreSQL database
    /// [env: VENTRIFORM_DATABASE] [default: sqlite]
    #[arg(long, value_name = "URL")]
    database: Option<DatabaseUrl>,
}

impl DataArgs {
    /// Whether any of them is given.
    pub fn is_given(&self) -> bool {
        self.data_dir.is_some() || self.database.is_some()
    }

    /// The settings of the service that concern its database.
    ///
    /// # Errors
    /// If a setting is invalid.
    pub fn settings(&self) -> Result<Settings> {
        settings_beside(self.data_dir.as_ref(), self.database.as_ref())
    }

    /// Opens the database.
    ///
    /// # Errors
    /// If a setting is invalid, or the database cannot be used.
    pub async fn open(&self) -> Result<Arc<SqlStore>> {
        let settings = self.settings()?;
        Ok(open_database(&settings.data_dir, settings.postgres().as_ref()).await?)
    }
}
