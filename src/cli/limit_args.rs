//! The limits of the commands that read files of volumes, masks and meshes.

use super::serve::variable;
use anyhow::{Context, Result};
use clap::Args;
use std::fmt::Display;
use std::str::FromStr;
use ventriform::volume::ReadLimits;
use ventriform_service::config::Size;

/// Limits on what is read.
#[derive(Debug, Default, Args)]
pub struct LimitArgs {
    /// Largest number of files in a zip archive, or in a folder with all in it
    /// [env: VENTRIFORM_FILE_LIMIT] [default: 8192]
    #[arg(long, value_name = "N", help_heading = "Limits")]
    file_limit: Option<u64>,
    /// Largest number of levels of folders in a folder, itself counted
    /// [env: VENTRIFORM_FOLDER_LIMIT] [default: 16]
    #[arg(long, value_name = "N", help_heading = "Limits")]
    folder_limit: Option<usize>,
    /// Largest file of a mesh, unpacked; reading it takes up to eight times as much memory
    /// [env: VENTRIFORM_MESH_LIMIT] [default: 64MiB]
    #[arg(long, value_name = "SIZE", help_heading = "Limits")]
    mesh_limit: Option<Size>,
}

impl LimitArgs {
    /// The limits: those of the flags, else of the environment, else the defaults.
    ///
    /// # Errors
    /// If a variable of the environment is no such value.
    pub fn limits(&self) -> Result<ReadLimits> {
        let default = ReadLimits::DEFAULT;
        let mesh = given(self.mesh_limit, "VENTRIFORM_MESH_LIMIT")?;
        Ok(ReadLimits {
            files: given(self.file_limit, "VENTRIFORM_FILE_LIMIT")?.unwrap_or(default.files),
            folder_levels: given(self.folder_limit, "VENTRIFORM_FOLDER_LIMIT")?
                .unwrap_or(default.folder_levels),
            mesh_bytes: mesh.map_or(default.mesh_bytes, |size| size.0),
            ..default
        })
    }
}

/// The flag, or else the variable of the environment.
fn given<T: FromStr>(flag: Option<T>, name: &str) -> Result<Option<T>>
where
    T::Err: Display,
{
    let parse = |text: String| {
        let parsed = text.parse().map_err(|error| anyhow::anyhow!("{error}"));
        parsed.with_context(|| format!("{name} is `{text}`"))
    };
    match flag {
        Some(value) => Ok(Some(value)),
        None => variable(name).map(parse).transpose(),
    }
}
