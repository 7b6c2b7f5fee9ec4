//! Media types of uploads. The content tells the format; these names only tell bytes from forms.
//! Browsers, operating systems and old clients have names of their own for the same formats.

/// Media types of volumes, the recommended one first.
pub const VOLUME_TYPES: [&str; 26] = [
    "application/octet-stream",
    "application/x-octet-stream",
    "application/binary",
    "application/x-binary",
    "binary/octet-stream",
    "application/gzip",
    "application/x-gzip",
    "application/gzip-compressed",
    "application/x-gzip-compressed",
    "application/x-gunzip",
    "application/x-compressed",
    "application/x-compress",
    "application/zip",
    "application/x-zip",
    "application/x-zip-compressed",
    "application/zip-compressed",
    "multipart/x-zip",
    "multipart/x-gzip",
    "application/dicom",
    "application/x-dicom",
    "application/dicom+zip",
    "application/nifti",
    "application/x-nifti",
    "application/x-nifti-gz",
    "image/nifti",
    "image/x-nifti",
];

/// Media types of meshes, the recommended one first. `x-www-form-urlencoded` is what curl and urllib send
/// unless told otherwise.
pub const MESH_TYPES: [&str; 32] = [
    "application/json",
    "application/octet-stream",
    "application/x-octet-stream",
    "binary/octet-stream",
    "application/x-www-form-urlencoded",
    "text/plain",
    "application/xml",
    "text/xml",
    "model/stl",
    "model/x.stl-ascii",
    "model/x.stl-binary",
    "application/sla",
    "application/vnd.ms-pki.stl",
    "application/x-navistyle",
    "model/ply",
    "model/x-ply",
    "application/ply",
    "application/x-ply",
    "model/obj",
    "model/x-obj",
    "text/prs.wavefront-obj",
    "application/x-tgif",
    "model/vtk",
    "model/x-vtk",
    "application/x-vtk",
    "application/vtk",
    "model/vtp",
    "model/x-vtp",
    "application/x-vtp",
    "application/vtp",
    "model/gltf-binary",
    "model/gltf+json",
];

/// `true` if a body of this type is the bytes of a volume, or of an expert's mesh.
pub fn is_raw(media_type: &str) -> bool {
    VOLUME_TYPES.contains(&media_type) || MESH_TYPES.contains(&media_type)
}
