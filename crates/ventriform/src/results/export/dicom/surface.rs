//! The mesh as Surface Segmentation Storage (PS3.3 A.57).

use super::{DicomError, DicomResults, STRUCTURE_CIELAB, algorithm};
use crate::results::export::single;
use ventriform_dicom::write::data_set::DataSet;
use ventriform_dicom::write::surface::Surface;
use ventriform_dicom::{PrimitiveValue, VR, tags};

/// Puts everything that is particular to this object.
pub(super) fn put(results: &DicomResults<'_>, set: &mut DataSet) -> Result<(), DicomError> {
    results.scan.put_frame_of_reference(set);
    results.put_content(set);
    results.put_referenced_series(set);

    let mut segment = DataSet::new();
    results.put_segment(&mut segment);
    let count = PrimitiveValue::from(1u32);
    segment.put(tags::SURFACE_COUNT, VR::UL, count.clone());
    let mut made = DataSet::new();
    made.put(tags::REFERENCED_SURFACE_NUMBER, VR::UL, count.clone());
    made.item(
        tags::SEGMENT_SURFACE_GENERATION_ALGORITHM_IDENTIFICATION_SEQUENCE,
        algorithm(),
    );
    let sources = results.scan.images().map(|images| images.references());
    made.items(
        tags::SEGMENT_SURFACE_SOURCE_INSTANCE_SEQUENCE,
        sources.unwrap_or_default(),
    );
    segment.item(tags::REFERENCED_SURFACE_SEQUENCE, made);
    set.item(tags::SEGMENT_SEQUENCE, segment);

    set.put(tags::NUMBER_OF_SURFACES, VR::UL, count);
    set.item(tags::SURFACE_SEQUENCE, item(results)?);
    Ok(())
}

/// The item of the Surface Sequence: points, normals and triangles.
fn item(results: &DicomResults<'_>) -> Result<DataSet, DicomError> {
    let mesh = results.mesh;
    let normals = mesh.vertex_normals().into_iter();
    let surface = Surface {
        comments: results.structure.label,
        colour: STRUCTURE_CIELAB,
        points: single::positions(&mesh.vertices)?,
        normals: normals.map(|n| [n.x, n.y, n.z].map(|x| x as f32)).collect(),
        triangles: &mesh.triangles,
    };
    Ok(surface.item())
}
