//! A surface of triangles, an item of the Surface Sequence (PS3.3 C.27.1).

use super::data_set::DataSet;
use dicom_core::{PrimitiveValue, VR};
use dicom_dictionary_std::tags;

/// A closed, manifold surface.
#[derive(Debug, Clone)]
pub struct Surface<'a> {
    /// Surface Comments (0066,0004).
    pub comments: &'a str,
    /// Its colour in viewers, CIELab values (PS3.3 C.10.7.1.1).
    pub colour: [u16; 3],
    /// Points, mm.
    pub points: Vec<[f32; 3]>,
    /// The normal at each point.
    pub normals: Vec<[f32; 3]>,
    /// Corners of the triangles, points counted from 0.
    pub triangles: &'a [[u32; 3]],
}

impl Surface<'_> {
    /// The item: points, normals and triangles.
    pub fn item(self) -> DataSet {
        let count = PrimitiveValue::from(self.points.len() as u32);
        let mut surface = DataSet::new();
        surface.put(tags::SURFACE_NUMBER, VR::UL, PrimitiveValue::from(1u32));
        surface.text(tags::SURFACE_COMMENTS, self.comments);
        surface.text(tags::SURFACE_PROCESSING, "NO");
        surface.short(tags::RECOMMENDED_DISPLAY_GRAYSCALE_VALUE, 0xffff);
        surface.shorts(tags::RECOMMENDED_DISPLAY_CIE_LAB_VALUE, &self.colour);
        surface.floats(tags::RECOMMENDED_PRESENTATION_OPACITY, vec![1.0]);
        surface.text(tags::RECOMMENDED_PRESENTATION_TYPE, "SURFACE");
        surface.text(tags::FINITE_VOLUME, "YES");
        surface.text(tags::MANIFOLD, "YES");

        let mut coordinates = DataSet::new();
        coordinates.put(tags::NUMBER_OF_SURFACE_POINTS, VR::UL, count.clone());
        coordinates.floats(tags::POINT_COORDINATES_DATA, self.points.into_flattened());
        surface.item(tags::SURFACE_POINTS_SEQUENCE, coordinates);

        let mut normals = DataSet::new();
        normals.put(tags::NUMBER_OF_VECTORS, VR::UL, count);
        normals.short(tags::VECTOR_DIMENSIONALITY, 3);
        normals.floats(tags::VECTOR_COORDINATE_DATA, self.normals.into_flattened());
        surface.item(tags::SURFACE_POINTS_NORMALS_SEQUENCE, normals);

        let mut primitives = DataSet::new();
        // Points are counted from 1.
        let corners = self.triangles.as_flattened().iter().map(|v| v + 1);
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
        surface
    }
}
