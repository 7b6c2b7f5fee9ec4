//! `ventriform statistics`: mean shape and principal modes of a set of fits.

use super::output::{create_folder, write_file};
use anyhow::{Context, Result};
use clap::Args;
use std::path::{Path, PathBuf};
use ventriform::mesh::TriMesh;
use ventriform::results::export::{self, Format, Metadata};
use ventriform::runs::evaluate::statistics::statistics;

/// Compute mean shape and principal modes of fits of one model
#[derive(Debug, Args)]
#[command(after_help = "Example:
  ventriform statistics p*/mesh.json -o statistics
Writes mean.json, mode1_minus.json, mode1_plus.json (2 standard deviations), ... and
statistics.json")]
pub struct StatisticsArgs {
    /// Fitted meshes: the mesh.json files that `segment` writes
    #[arg(value_name = "MESH", required = true, num_args = 2..)]
    meshes: Vec<PathBuf>,
    /// Folder to write to (created if missing)
    #[arg(short, long = "output", value_name = "DIR")]
    output: PathBuf,
    /// Number of modes to write as meshes
    #[arg(long, value_name = "N", default_value_t = 3)]
    modes: usize,
}

/// Runs the command.
///
/// # Errors
/// If a mesh cannot be read, or the meshes are not fits of the same model.
pub fn run(args: &StatisticsArgs) -> Result<()> {
    let meshes: Vec<TriMesh> = args
        .meshes
        .iter()
        .map(|path| {
            let context = || format!("{}", path.display());
            let bytes = std::fs::read(path).with_context(context)?;
            export::read_json::decode(&bytes).with_context(context)
        })
        .collect::<Result<_>>()?;
    let found = statistics(&meshes)?;
    create_folder(&args.output)?;
    write_mesh(&args.output, "mean", &found.mean)?;
    for mode in 0..args.modes.min(found.modes.len()) {
        for (sign, word) in [(-2.0, "minus"), (2.0, "plus")] {
            let name = format!("mode{}_{word}", mode + 1);
            write_mesh(&args.output, &name, &found.along(mode, sign))?;
        }
    }
    let summary = serde_json::to_vec_pretty(&found.to_json())?;
    write_file(&args.output.join("statistics.json"), &summary)
}

fn write_mesh(folder: &Path, name: &str, mesh: &TriMesh) -> Result<()> {
    let bytes = export::encode(Format::Json, mesh, &Metadata::new(name))?;
    write_file(&folder.join(format!("{name}.json")), &bytes)
}
