//! The mesh as Surface Segmentation Storage (PS3.3 A.57).

use super::{DicomError, DicomResults, STRUCTURE_CIELAB, algorithm};
use crate::results::export::single;
use ventriform_dicom::write::data_set::DataSet;
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
    set.item(tags::SURFACE_SEQUENCE, mesh(results)?);
    Ok(())
}

/// The item of the Surface Sequence: points, normals and triangles.
fn mesh(results: &DicomResults<'_>) -> Result<DataSet, DicomError> {
    let mesh = results.mesh;
    let points = single::positions(&mesh.vertices)?;
    let count = PrimitiveValue::from(points.len() as u32);
    let mut surface = DataSet::new();
    surface.put(tags::SURFACE_NUMBER, VR::UL, PrimitiveValue::from(1u32));
    surface.text(tags::SURFACE_COMMENTS, results.structure.label);
    surface.text(tags::SURFACE_PROCESSING, "NO");
    surface.short(tags::RECOMMENDED_DISPLAY_GRAYSCALE_VALUE, 0xffff);
    surface.shorts(tags::RECOMMENDED_DISPLAY_CIE_LAB_VALUE, &STRUCTURE_CIELAB);
    surface.floats(tags::RECOMMENDED_PRESENTATION_OPACITY, vec![1.0]);
    surface.text(tags::RECOMMENDED_PRESENTATION_TYPE, "SURFACE");
    surface.text(tags::FINITE_VOLUME, "YES");
    surface.text(tags::MANIFOLD, "YES");

    let mut coordinates = DataSet::new();
    coordinates.put(tags::NUMBER_OF_SURFACE_POINTS, VR::UL, count.clone());
    let numbers: Vec<f32> = points.iter().flatten().copied().collect();
    coordinates.floats(tags::POINT_COORDINATES_DATA, numbers);
    surface.item(tags::SURFACE_POINTS_SEQUENCE, coordinates);

    let mut normals = DataSet::new();
    normals.put(tags::NUMBER_OF_VECTORS, VR::UL, count);
    normals.short(tags::VECTOR_DIMENSIONALITY, 3);
    let vectors = mesh.vertex_normals();
    let numbers = vectors.iter().flat_map(|n| [n.x, n.y, n.z]);
    let numbers: Vec<f32> = numbers.map(|x| x as f32).collect();
    normals.floats(tags::VECTOR_COORDINATE_DATA, numbers);
    surface.item(tags::SURFACE_POINTS_NORMALS_SEQUENCE, normals);

    let mut primitives = DataSet::new();
    // Points are counted from 1.
    let corners = mesh.triangles.iter().flatten().map(|v| v + 1);
    primitives.longs(tags::LONG_TRIANGLE_POINT_INDEX_LIST, corners.collect());
    primitives.empty(tags::LONG_EDGE_POINT_INDEX_LIST);
    primitives.empty(tags::LONG_VERTEX_POINT_INDEX_LIST);
    for none in [
        tags::TRIANGLE_STRIP_SEQUENCE,
        tags::TRIANGLE_FAN_SEQUENCE,
        tags::LINE_SEQUENCE,
        tags::FACET_SEQUENCE,
    ] {
        primitives.items(none, Vec::new());
    }
    surface.item(tags::SURFACE_MESH_PRIMITIVES_SEQUENCE, primitives);
    Ok(surface)
}
