//! Files of meshes on the command line: models, and what is stated of them.

use super::output::note;
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use std::io::Read as _;
use std::path::Path;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::ReadLimits;
use ventriform::mesh::TriMesh;
use ventriform::mesh::files::{self, MeshFrame, MeshStatement, MeshUnit};
use ventriform::runs::advice::Explain;

/// Statements about meshes.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct MeshArgs {
    /// Unit of meshes (STL, PLY, OBJ, VTK, VTP, glTF) that do not state theirs: mm, cm or m
    /// [default: mm, of glTF m]
    #[arg(long, value_name = "UNIT", value_parser = parse_unit, help_heading = "Meshes")]
    mesh_unit: Option<MeshUnit>,
    /// Frame of meshes that do not state theirs: lps (DICOM) or ras (NIfTI) [default: lps]
    #[arg(long, value_name = "FRAME", value_parser = parse_frame, help_heading = "Meshes")]
    mesh_frame: Option<MeshFrame>,
}

impl From<MeshArgs> for MeshStatement {
    fn from(args: MeshArgs) -> Self {
        Self {
            unit: args.mesh_unit,
            frame: args.mesh_frame,
        }
    }
}

fn parse_unit(text: &str) -> Result<MeshUnit, String> {
    MeshUnit::named(text).ok_or_else(|| "give one of mm, cm, m".into())
}

fn parse_frame(text: &str) -> Result<MeshFrame, String> {
    MeshFrame::named(text).ok_or_else(|| "give one of lps, ras".into())
}

/// The bytes of a file of a mesh.
///
/// # Errors
/// If it cannot be read, or is larger than `limit`; then `advice` says what to do.
pub(super) fn mesh_bytes(path: &Path, limit: u64, advice: &str) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path)?;
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        bail!("the file has more than the {limit} bytes that a mesh may have; {advice}");
    }
    Ok(bytes)
}

/// The closed surface in the file at `path`, LPS mm. `stated` counts for what the file does not state.
///
/// # Errors
/// If the file cannot be read, or holds no closed surface.
pub(super) fn read_mesh(
    path: &Path,
    stated: &MeshStatement,
    limits: &ReadLimits,
) -> Result<TriMesh> {
    let context = || format!("{}", path.display());
    let advice = "give one with fewer triangles, or raise the limit: --mesh-limit 256MiB";
    let bytes = mesh_bytes(path, limits.mesh_bytes, advice).with_context(context)?;
    let read = files::read_where_silent(&bytes, stated, limits.mesh_bytes, &Monitor::silent())
        .map_err(|error| anyhow!(error.with_advice()))
        .with_context(context)?;
    for assumed in &read.notes {
        note!("warning: {}: {assumed}", path.display());
    }
    Ok(read.mesh)
}
