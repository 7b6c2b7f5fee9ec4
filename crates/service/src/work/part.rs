//! A part of a stored mesh as an open surface, made when it is asked for.
//!
//! In: the `.json` file of a mesh. Out: the triangles of one part of the wall in any format, with what that file
//! says of them.

use super::failures::{broken_result, not_exportable};
use crate::base::records::Failure;
use crate::items::{OutputFile, StoredItem};
use ventriform::heart::polar;
use ventriform::results::export::open_part::open_part;
use ventriform::results::export::{self, Format, Part, read_json};
use ventriform::results::report;

/// `part` of the mesh `stem` of `item` as `<stem>_<part>.<extension>`; `None` if the mesh does not say which
/// triangles are of that part.
///
/// # Errors
/// If the stored mesh cannot be read, or the format cannot hold the part.
pub fn part_file(
    item: &StoredItem,
    stem: &str,
    part: Part,
    format: Format,
) -> Result<Option<OutputFile>, Failure> {
    let name = format!("{stem}.{}", Format::Json.extension());
    let bytes = item
        .read_whole(&name)
        .map_err(|error| broken_result(&error))?;
    let Some(bytes) = bytes else {
        return Ok(None);
    };
    let colours = |name: &str, values: &[f64]| match name {
        "Uptake" => values.iter().map(|x| polar::colour_of(*x)).collect(),
        _ => report::vertex_colours(values),
    };
    let (mesh, metadata) =
        read_json::document(&bytes, &colours).map_err(|error| not_exportable(&error))?;
    let Some((mesh, metadata)) = open_part(&mesh, &metadata, part) else {
        return Ok(None);
    };
    let bytes = export::encode(format, &mesh, &metadata).map_err(|error| not_exportable(&error))?;
    Ok(Some(OutputFile {
        name: format!("{stem}_{}.{}", part.as_str(), format.extension()),
        media_type: format.media_type().into(),
        bytes,
    }))
}
