//! The limits of the commands that read files of volumes, masks and meshes.

use super::serve::variable;
use anyhow::{Result, anyhow};
use clap::Args;
use std::str::FromStr;
use ventriform::image::volume::ReadLimits;
use ventriform_service::config::{Settings, Size};

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
    /// The limits: those of the flags, else of the environment, else of the file that VENTRIFORM_CONFIG names, else the
    /// defaults.
    ///
    /// # Errors
    /// If a variable or a key of the file is no such value.
    pub fn limits(&self) -> Result<ReadLimits> {
        let default = ReadLimits::DEFAULT;
        let mesh = given(
            self.mesh_limit,
            "mesh_limit",
            "a size with a unit, such as 64MiB",
        )?;
        let count = "a whole number, such as 8192";
        Ok(ReadLimits {
            files: given(self.file_limit, "file_limit", count)?.unwrap_or(default.files),
            folder_levels: given(self.folder_limit, "folder_limit", count)?
                .unwrap_or(default.folder_levels),
            mesh_bytes: mesh.map_or(default.mesh_bytes, |size| size.0),
            ..default
        })
    }
}

/// The flag, or else what the environment or the file of settings says.
fn given<T: FromStr>(flag: Option<T>, setting: &str, permitted: &str) -> Result<Option<T>> {
    if flag.is_some() {
        return Ok(flag);
    }
    let Some((text, origin)) = Settings::stated(setting, variable)? else {
        return Ok(None);
    };
    let value = text.parse().map_err(|_| {
        let from = origin.described(setting);
        anyhow!("{setting} = `{text}` ({from}): give {permitted}")
    })?;
    Ok(Some(value))
}
