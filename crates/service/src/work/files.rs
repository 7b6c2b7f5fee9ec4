//! Files in and out: uploads for the domain's readers, meshes and JSON for downloads.

use crate::base::records::LocalFile;
use crate::items::OutputFile;
use ventriform::image::volume::VolumeFile;
use ventriform::mesh::TriMesh;
use ventriform::results::export::{self, ExportError, Format, Metadata};

/// The files of a stored volume for the domain's readers.
///
/// A single file is called "the file" in messages, because the client does not know the name
/// under which it is stored. Several files keep their names, which tell a `.hdr` from its `.img`.
pub(super) fn volume_files(files: &[LocalFile]) -> Vec<VolumeFile> {
    match files {
        [file] => vec![VolumeFile::named("the file", file)],
        _ => files.iter().map(VolumeFile::at).collect(),
    }
}

/// A mesh as the file `mesh.<extension>`.
///
/// # Errors
/// If the format cannot represent the mesh.
pub(super) fn mesh_file(
    format: Format,
    mesh: &TriMesh,
    metadata: &Metadata,
) -> Result<OutputFile, ExportError> {
    Ok(OutputFile {
        name: format!("mesh.{}", format.extension()),
        media_type: format.media_type().into(),
        bytes: export::encode(format, mesh, metadata)?,
    })
}

/// A JSON document as a file.
pub(super) fn json_file(name: &str, bytes: Vec<u8>) -> OutputFile {
    OutputFile {
        name: name.into(),
        media_type: "application/json".into(),
        bytes,
    }
}
