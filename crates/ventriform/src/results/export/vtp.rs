//! VTK XML PolyData with positions and normals in double precision, as inline base64.
//!
//! Every array consists of the number of its bytes (`UInt64`) and the bytes, encoded together.
//! Texts are field data, which VTK expects as ASCII codes that end with 0.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::{COORDINATE_FRAME, LENGTH_UNIT, Metadata};
use crate::base::geometry::Vec3;
use crate::mesh::TriMesh;
use crate::mesh::part::Part;

/// A VTP file.
pub fn encode(mesh: &TriMesh, metadata: &Metadata) -> Vec<u8> {
    let count = mesh.triangles.len() as i64;
    let connectivity = mesh.triangles.iter().flatten().map(|&v| i64::from(v));
    let offsets = (1..=count).map(|t| 3 * t);
    let xml = format!(
        r#"<?xml version="1.0"?>
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">
<PolyData>
<FieldData>
{fields}</FieldData>
<Piece NumberOfPoints="{points}" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="{count}">
<PointData Normals="Normals">
<DataArray type="Float64" Name="Normals" NumberOfComponents="3" format="binary">{normals}</DataArray>
{uncertainty}{field}</PointData>
<CellData>{parts}</CellData>
<Points>
<DataArray type="Float64" Name="Points" NumberOfComponents="3" format="binary">{positions}</DataArray>
</Points>
<Polys>
<DataArray type="Int64" Name="connectivity" format="binary">{connectivity}</DataArray>
<DataArray type="Int64" Name="offsets" format="binary">{offsets}</DataArray>
</Polys>
</Piece>
</PolyData>
</VTKFile>
"#,
        fields = fields(mesh, metadata),
        points = mesh.vertices.len(),
        normals = vectors(&mesh.vertex_normals()),
        uncertainty = metadata
            .uncertainty_of(mesh)
            .map_or_else(String::new, |values| scalars("Uncertainty", values)),
        field = metadata
            .field_of(mesh)
            .map_or_else(String::new, |field| scalars(field.name, &field.values)),
        parts = metadata.parts_of(mesh).map_or_else(String::new, |parts| {
            let numbers = array(parts.iter().map(|part| part.number()).collect());
            format!(
                "\n<DataArray type=\"UInt8\" Name=\"Part\" NumberOfComponents=\"1\" \
                 format=\"binary\">{numbers}</DataArray>\n"
            )
        }),
        positions = vectors(&mesh.vertices),
        connectivity = array(connectivity.flat_map(i64::to_le_bytes).collect()),
        offsets = array(offsets.flat_map(i64::to_le_bytes).collect()),
    );
    xml.into_bytes()
}

fn scalars(name: &str, values: &[f64]) -> String {
    let values = array(values.iter().flat_map(|x| x.to_le_bytes()).collect());
    format!(
        "<DataArray type=\"Float64\" Name=\"{name}\" NumberOfComponents=\"1\" \
         format=\"binary\">{values}</DataArray>\n"
    )
}

fn fields(mesh: &TriMesh, metadata: &Metadata) -> String {
    let mut fields = vec![
        ("SPACE".to_owned(), COORDINATE_FRAME.to_owned()),
        ("UNIT".to_owned(), LENGTH_UNIT.to_owned()),
    ];
    for (key, value) in metadata.identity() {
        fields.push((key.to_owned(), value.to_owned()));
    }
    if !metadata.quality.is_empty() {
        let quality = serde_json::Value::from(metadata.quality.clone());
        fields.push(("quality".to_owned(), quality.to_string()));
    }
    if metadata.parts_of(mesh).is_some() {
        let names = Part::ALL.map(|part| format!("{} {}", part.number(), part.as_str()));
        fields.push(("parts".to_owned(), names.join(", ")));
    }
    fields
        .iter()
        .map(|(name, text)| field(name, text))
        .collect()
}

fn field(name: &str, text: &str) -> String {
    let codes: String = text.bytes().map(|b| format!("{b} ")).collect();
    format!(
        "<Array type=\"String\" Name=\"{name}\" NumberOfTuples=\"1\" format=\"ascii\">{codes}0</Array>\n"
    )
}

fn vectors(vectors: &[Vec3]) -> String {
    let numbers = vectors.iter().flat_map(|v| [v.x, v.y, v.z]);
    array(numbers.flat_map(f64::to_le_bytes).collect())
}

fn array(bytes: Vec<u8>) -> String {
    let mut sized = (bytes.len() as u64).to_le_bytes().to_vec();
    sized.extend(bytes);
    STANDARD.encode(sized)
}
