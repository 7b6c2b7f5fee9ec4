//! Writes a mesh in every format and reads it back with readers that are part of this test.
//!
//! The files are kept in `target/tmp/formats/`, where `scripts/check/formats.sh` checks them with
//! other programs: Khronos' validator, trimesh and VTK.

// The helpers of a test state their expectations by panicking, as the test does.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::{Value, json};
use ventriform::base::geometry::Vec3;
use ventriform::mesh::{TriMesh, shapes};
use ventriform::results::export::animated::{self, Cycle};
use ventriform::results::export::open_part::open_part;
use ventriform::results::export::{
    ExportError, Format, Metadata, Part, VertexField, encode, read_json,
};

/// A cup at the position of a heart, with coordinates that have no short decimals.
fn cup() -> TriMesh {
    let mut mesh = shapes::cup(80.0, 32.0, 10.0, 17);
    let turn = nalgebra::Rotation3::from_euler_angles(0.3, -0.7, 0.2);
    for v in &mut mesh.vertices {
        *v = turn * *v + Vec3::new(-31.7, 143.9, -612.3);
    }
    mesh
}

fn metadata() -> Metadata {
    let mut metadata = Metadata::new("Left ventricle, ½ \"test\"\nend_header");
    metadata.volume_id = Some("vol_3f5a".to_owned());
    metadata.frame_of_reference_uid = Some("1.2.826.0.1.3680043.10.1".to_owned());
    metadata.quality.insert("vertices".into(), json!(150));
    metadata.quality.insert("hausdorff_mm".into(), json!(2.75));
    metadata
}

fn bytes(format: Format) -> Vec<u8> {
    encode(format, &cup(), &metadata()).unwrap()
}

/// The same mesh with a figure of each vertex, which is not known of the first, and with its parts.
fn painted(format: Format) -> Vec<u8> {
    let mesh = cup();
    encode(format, &mesh, &painted_metadata(&mesh)).unwrap()
}

/// The parts in an order that no format may assume.
fn parts(mesh: &TriMesh) -> Vec<Part> {
    let part = |n: usize| Part::ALL[(n / 3 + n % 2) % 3];
    (0..mesh.triangles.len()).map(part).collect()
}

fn painted_metadata(mesh: &TriMesh) -> Metadata {
    let shares = (0..mesh.vertices.len()).map(|n| n as f64 / mesh.vertices.len() as f64);
    let field = VertexField {
        name: "Uptake",
        values: shares
            .clone()
            .map(|x| if x == 0.0 { f64::NAN } else { 100.0 * x })
            .collect(),
        colours: shares.map(|x| [x, 0.5, 1.0 - x]).collect(),
    };
    Metadata {
        field: Some(field),
        parts: parts(mesh),
        ..metadata()
    }
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    let words = bytes.chunks_exact(4);
    words
        .map(|w| f32::from_le_bytes(w.try_into().unwrap()))
        .collect()
}

fn doubles(bytes: &[u8]) -> Vec<f64> {
    let words = bytes.chunks_exact(8);
    words
        .map(|w| f64::from_le_bytes(w.try_into().unwrap()))
        .collect()
}

fn flat(vectors: &[Vec3]) -> Vec<f64> {
    vectors.iter().flat_map(|v| [v.x, v.y, v.z]).collect()
}

fn rounded(vectors: &[Vec3]) -> Vec<f32> {
    flat(vectors).iter().map(|&x| x as f32).collect()
}

fn decode_base64(text: &str) -> Vec<u8> {
    use base64::Engine;
    base64::engine::general_purpose::STANDARD
        .decode(text)
        .unwrap()
}

/// The JSON and the binary chunk of a GLB file.
fn chunks(glb: &[u8]) -> (Value, &[u8]) {
    let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&glb[..4], word(4), word(8)), (&b"glTF"[..], 2, glb.len()));
    let json_bytes = word(12);
    assert_eq!(&glb[16..20], b"JSON");
    let binary = 20 + json_bytes;
    assert_eq!(&glb[binary + 4..binary + 8], b"BIN\0");
    assert_eq!(binary + 8 + word(binary), glb.len());
    assert!(json_bytes % 4 == 0 && word(binary) % 4 == 0);
    let document = serde_json::from_slice(&glb[20..binary]).unwrap();
    (document, &glb[binary + 8..])
}

#[test]
fn all_formats_are_written_for_the_other_readers() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("formats");
    std::fs::create_dir_all(&folder).unwrap();
    for format in Format::ALL {
        let path = folder.join(format!("model.{}", format.extension()));
        std::fs::write(path, bytes(format)).unwrap();
        assert_eq!(bytes(format), bytes(format), "{format:?} varies");
        let path = folder.join(format!("painted.{}", format.extension()));
        std::fs::write(path, painted(format)).unwrap();
        let mesh = cup();
        let (open, about) = open_part(&mesh, &painted_metadata(&mesh), Part::Epicardium).unwrap();
        let path = folder.join(format!("open.{}", format.extension()));
        std::fs::write(path, encode(format, &open, &about).unwrap()).unwrap();
    }
}

#[test]
fn json_holds_the_figures_of_vertices_by_their_names() {
    let plain: Value = serde_json::from_slice(&bytes(Format::Json)).unwrap();
    assert!(plain.get("fields").is_none());
    let painted: Value = serde_json::from_slice(&painted(Format::Json)).unwrap();
    let uptake = painted["fields"]["Uptake"].as_array().unwrap();
    let count = cup().vertices.len();
    assert_eq!(uptake.len(), count);
    assert!(uptake[0].is_null());
    assert_eq!(uptake[1].as_f64(), Some(100.0 * (1.0 / count as f64)));
}

#[test]
fn extensions_and_media_types_identify_the_format() {
    for format in Format::ALL {
        assert_eq!(Format::from_extension(format.extension()), Some(format));
        assert_eq!(Format::from_media_type(format.media_type()), Some(format));
    }
    assert_eq!(Format::from_extension(".GLB"), Some(Format::Glb));
    assert_eq!(
        Format::from_media_type("Model/STL; q=0.8"),
        Some(Format::Stl)
    );
    assert_eq!(Format::from_extension("dcm"), None);
    assert_eq!(Format::from_media_type("*/*"), None);
}

#[test]
fn glb_has_every_vertex_once_in_patient_millimetres() {
    let mesh = cup();
    let glb = bytes(Format::Glb);
    let (document, buffer) = chunks(&glb);
    let n = mesh.vertices.len();
    assert_eq!(floats(&buffer[..12 * n]), rounded(&mesh.vertices));
    assert_eq!(
        floats(&buffer[12 * n..24 * n]),
        rounded(&mesh.vertex_normals())
    );
    let indices: Vec<u32> = buffer[24 * n..]
        .chunks_exact(2)
        .map(|w| u32::from(u16::from_le_bytes([w[0], w[1]])))
        .collect();
    let expected: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
    assert_eq!(indices[..expected.len()], expected);

    let accessors = &document["accessors"];
    assert_eq!(accessors[0]["count"], n);
    for r in 0..3 {
        let column = || mesh.vertices.iter().map(|v| f64::from(v[r] as f32));
        let min = column().fold(f64::INFINITY, f64::min);
        let max = column().fold(f64::NEG_INFINITY, f64::max);
        // serde_json may read the last bit of a decimal incorrectly, which does not affect an f32.
        let single = |x: &Value| f64::from(x.as_f64().unwrap() as f32);
        assert_eq!(single(&accessors[0]["min"][r]), min);
        assert_eq!(single(&accessors[0]["max"][r]), max);
    }
    let extras = &document["asset"]["extras"];
    assert_eq!(
        (&extras["frame"], &extras["unit"]),
        (&json!("LPS"), &json!("mm"))
    );
    assert_eq!(extras["volume"], "vol_3f5a");
    assert_eq!(extras["frame_of_reference_uid"], "1.2.826.0.1.3680043.10.1");
    assert_eq!(extras["quality"]["hausdorff_mm"], 2.75);
}

#[test]
fn the_node_converts_to_metres_with_the_patient_upright() {
    let glb = bytes(Format::Glb);
    let (document, _) = chunks(&glb);
    assert_eq!(document["nodes"].as_array().unwrap().len(), 1);
    let columns: Vec<f64> = serde_json::from_value(document["nodes"][0]["matrix"].clone()).unwrap();
    let map = nalgebra::Matrix4::from_column_slice(&columns);
    let place = |lps: [f64; 3]| (map * Vec3::from(lps).push(1.0)).xyz();
    let left_side = place([1000.0, 0.0, 0.0]);
    let face = place([0.0, -1000.0, 0.0]);
    let head = place([0.0, 0.0, 1000.0]);
    assert_eq!(left_side, Vec3::x());
    assert_eq!(face, Vec3::z());
    assert_eq!(head, Vec3::y());
}

#[test]
fn gltf_is_the_same_model_with_its_buffer_embedded() {
    let glb = bytes(Format::Glb);
    let (mut expected, buffer) = chunks(&glb);
    let document: Value = serde_json::from_slice(&bytes(Format::Gltf)).unwrap();
    let uri = document["buffers"][0]["uri"].as_str().unwrap();
    let (head, data) = uri.split_once(',').unwrap();
    assert_eq!(head, "data:application/octet-stream;base64");
    assert_eq!(decode_base64(data), buffer);
    expected["buffers"][0]["uri"] = uri.into();
    assert_eq!(document, expected);
}

#[test]
fn more_than_65535_vertices_need_wide_indices() {
    let mesh = shapes::torus(60.0, 20.0, 400, 170);
    assert_eq!(mesh.vertices.len(), 68_000);
    let glb = encode(Format::Glb, &mesh, &metadata()).unwrap();
    let (document, buffer) = chunks(&glb);
    assert_eq!(document["accessors"][2]["componentType"], 5125);
    let last = u32::from_le_bytes(buffer[buffer.len() - 4..].try_into().unwrap());
    assert_eq!(last, mesh.triangles.last().unwrap()[2]);
}

#[test]
fn stl_has_every_triangle_and_its_normal() {
    let mesh = cup();
    let stl = bytes(Format::Stl);
    assert!(stl.starts_with(b"SPACE=LPS UNIT=mm"));
    assert_eq!(stl.len(), 84 + 50 * mesh.triangles.len());
    assert_eq!(stl[80..84], (mesh.triangles.len() as u32).to_le_bytes());
    for (t, record) in stl[84..].chunks_exact(50).enumerate() {
        let numbers = floats(&record[..48]);
        assert_eq!(numbers[3..], rounded(&mesh.corners(t)));
        let normal = Vec3::from_fn(|r, _| f64::from(numbers[r]));
        assert!((normal - mesh.area_normal(t).normalize()).norm() < 1e-4);
    }
}

#[test]
fn ply_keeps_double_precision() {
    let mesh = cup();
    let ply = bytes(Format::Ply);
    let end = b"\nend_header\n";
    let body = ply.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let header = std::str::from_utf8(&ply[..body]).unwrap();
    assert!(header.contains("comment SPACE=LPS UNIT=mm\n"));
    assert!(header.contains(&format!("element vertex {}\n", mesh.vertices.len())));
    let (vertices, faces) = ply[body..].split_at(48 * mesh.vertices.len());
    let rows: Vec<f64> = (mesh.vertices.iter())
        .zip(mesh.vertex_normals())
        .flat_map(|(p, n)| flat(&[*p, n]))
        .collect();
    assert_eq!(doubles(vertices), rows);
    assert_eq!(faces.len(), 13 * mesh.triangles.len());
    for (face, t) in faces.chunks_exact(13).zip(&mesh.triangles) {
        let indices: Vec<u8> = t.iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!((face[0], &face[1..]), (3, &indices[..]));
    }
}

#[test]
fn obj_keeps_double_precision() {
    let mesh = cup();
    let obj = String::from_utf8(bytes(Format::Obj)).unwrap();
    let numbers = |key: &str| -> Vec<f64> {
        (obj.lines().filter_map(|l| l.strip_prefix(key)))
            .flat_map(|l| l.split(' ').map(|x| x.parse::<f64>().unwrap()))
            .collect()
    };
    assert_eq!(numbers("v "), flat(&mesh.vertices));
    assert_eq!(numbers("vn "), flat(&mesh.vertex_normals()));
    let faces: Vec<u32> = (obj.lines().filter_map(|l| l.strip_prefix("f ")))
        .flat_map(|l| l.split(' '))
        .map(|corner| {
            let (v, n) = corner.split_once("//").unwrap();
            assert_eq!(v, n);
            v.parse::<u32>().unwrap() - 1
        })
        .collect();
    assert_eq!(faces.as_chunks::<3>().0, mesh.triangles);
    assert!(obj.starts_with("# SPACE=LPS UNIT=mm\n"));
}

#[test]
fn vtp_keeps_double_precision() {
    let mesh = cup();
    let vtp = String::from_utf8(bytes(Format::Vtp)).unwrap();
    let array = |name: &str| {
        let start = vtp.find(&format!("Name=\"{name}\"")).unwrap();
        let open = start + vtp[start..].find('>').unwrap() + 1;
        let close = open + vtp[open..].find('<').unwrap();
        let bytes = decode_base64(&vtp[open..close]);
        let (size, data) = bytes.split_at(8);
        assert_eq!(size, (data.len() as u64).to_le_bytes());
        data.to_vec()
    };
    assert_eq!(doubles(&array("Points")), flat(&mesh.vertices));
    assert_eq!(doubles(&array("Normals")), flat(&mesh.vertex_normals()));
    let connectivity: Vec<u8> = (mesh.triangles.iter().flatten())
        .flat_map(|&v| u64::from(v).to_le_bytes())
        .collect();
    assert_eq!(array("connectivity"), connectivity);
    assert!(vtp.contains("Name=\"SPACE\" NumberOfTuples=\"1\" format=\"ascii\">76 80 83 0<"));
}

#[test]
fn json_keeps_double_precision_and_states_its_frame() {
    let mesh = cup();
    let text = String::from_utf8(bytes(Format::Json)).unwrap();
    let document: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(document["frame"], "LPS");
    assert_eq!(document["unit"], "mm");
    // serde_json may read the last bit of a decimal incorrectly, so the text itself is parsed.
    let numbers = |key: &str| -> Vec<f64> {
        let rows = &text[text.find(&format!("\"{key}\":[[")).unwrap() + key.len() + 5..];
        let rows = &rows[..rows.find("]]").unwrap()];
        rows.split("],[")
            .flat_map(|row| row.split(','))
            .map(|x| x.parse().unwrap())
            .collect()
    };
    assert_eq!(numbers("vertices"), flat(&mesh.vertices));
    assert_eq!(numbers("normals"), flat(&mesh.vertex_normals()));
    let triangles: Vec<[u32; 3]> = serde_json::from_value(document["triangles"].clone()).unwrap();
    assert_eq!(triangles, mesh.triangles);
}

#[test]
fn vertices_that_rounding_would_join_stay_distinct() {
    let mut mesh = cup();
    // The two vertices of an edge, a nanometre apart and half a metre from the origin.
    let [a, b, _] = mesh.triangles[40].map(|v| v as usize);
    mesh.vertices[b] = mesh.vertices[a] + Vec3::new(0.0, 0.0, 1e-6);
    let stl = encode(Format::Stl, &mesh, &metadata()).unwrap();
    let places: BTreeSet<Vec<u32>> = stl[84..]
        .chunks_exact(50)
        .flat_map(|record| {
            let numbers = floats(&record[12..48]);
            let corners = numbers.chunks_exact(3);
            corners
                .map(|c| c.iter().map(|x| x.to_bits()).collect())
                .collect::<Vec<_>>()
        })
        .collect();
    assert_eq!(places.len(), mesh.vertices.len());
}

#[test]
fn errors_name_the_invalid_vertex_or_triangle() {
    let mesh = cup();
    for format in Format::ALL {
        let refuse = |change: &dyn Fn(&mut TriMesh)| {
            let mut broken = mesh.clone();
            change(&mut broken);
            encode(format, &broken, &metadata()).unwrap_err()
        };
        assert_eq!(refuse(&|m| m.triangles.clear()), ExportError::Empty);
        assert_eq!(
            refuse(&|m| m.vertices[7].y = f64::NAN),
            ExportError::NotFinite { vertex: 7 }
        );
        assert_eq!(
            refuse(&|m| m.triangles[3][1] = 60_000),
            ExportError::IndexOutOfRange { triangle: 3 }
        );
    }
}

#[test]
fn the_uncertainty_of_each_vertex_is_in_the_formats_that_can_hold_it() {
    let mesh = cup();
    let uncertainty: Vec<f64> = (0..mesh.vertices.len())
        .map(|n| 0.5 + n as f64 / 7.0)
        .collect();
    let with = |uncertainty: &[f64], format: Format| {
        let metadata = Metadata {
            uncertainty: uncertainty.to_vec(),
            ..metadata()
        };
        encode(format, &mesh, &metadata).unwrap()
    };
    let file = |format| with(&uncertainty, format);

    let glb = file(Format::Glb);
    let (document, binary) = chunks(&glb);
    let accessor = &document["meshes"][0]["primitives"][0]["attributes"]["_UNCERTAINTY"];
    let accessor = &document["accessors"][accessor.as_u64().unwrap() as usize];
    assert_eq!(accessor["type"], "SCALAR");
    assert_eq!(accessor["count"], mesh.vertices.len());
    let view = &document["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let number = |key: &str| view[key].as_u64().unwrap() as usize;
    let start = number("byteOffset");
    let single: Vec<f32> = uncertainty.iter().map(|x| *x as f32).collect();
    assert_eq!(floats(&binary[start..start + number("byteLength")]), single);

    let ply = file(Format::Ply);
    let end = b"\nend_header\n";
    let at = ply.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    assert!(String::from_utf8_lossy(&ply[..at]).contains("property double uncertainty\n"));
    let rows = doubles(&ply[at..at + 56 * mesh.vertices.len()]);
    let last: Vec<f64> = rows.chunks_exact(7).map(|row| row[6]).collect();
    assert_eq!(last, uncertainty);

    let vtp = String::from_utf8(file(Format::Vtp)).unwrap();
    let array = vtp.split("Name=\"Uncertainty\"").nth(1).unwrap();
    let array = array.split(['>', '<']).nth(1).unwrap();
    assert_eq!(doubles(&decode_base64(array)[8..]), uncertainty);

    let read: Value = serde_json::from_slice(&file(Format::Json)).unwrap();
    assert_eq!(read["uncertainty_mm"], json!(uncertainty));

    // Without it, or with that of another mesh, files are as they were.
    for format in Format::ALL {
        assert_eq!(with(&[], format), bytes(format));
        assert_eq!(with(&uncertainty[1..], format), bytes(format));
    }
}

#[test]
fn a_figure_of_each_vertex_is_a_colour_in_glb_and_an_array_in_vtp() {
    let count = cup().vertices.len();
    let glb = painted(Format::Glb);
    let (document, binary) = chunks(&glb);
    let accessor = &document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"];
    let accessor = &document["accessors"][accessor.as_u64().unwrap() as usize];
    assert_eq!(
        [&accessor["type"], &accessor["count"]],
        [&json!("VEC4"), &json!(count)]
    );
    assert_eq!(accessor["normalized"], true);
    let view = &document["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    let parts: Vec<u16> = binary[start..start + 8]
        .chunks_exact(2)
        .map(|word| u16::from_le_bytes(word.try_into().unwrap()))
        .collect();
    // Half of sRGB is 21.4 % of the light.
    assert_eq!(
        parts,
        [0, (65535.0 * 0.214_041_14_f64).round() as u16, 65535, 65535]
    );
    let material = &document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"];
    assert_eq!(material, &json!([1.0, 1.0, 1.0, 1.0]));

    let vtp = String::from_utf8(painted(Format::Vtp)).unwrap();
    let array = vtp.split("Name=\"Uptake\"").nth(1).unwrap();
    let array = array.split(['>', '<']).nth(1).unwrap();
    let values = doubles(&decode_base64(array)[8..]);
    assert!(values[0].is_nan() && values.len() == count);
    assert_eq!(values[1], 100.0 / count as f64);

    // These formats have no place for a figure.
    let mesh = cup();
    let plain = Metadata {
        field: None,
        ..painted_metadata(&mesh)
    };
    for format in [Format::Stl, Format::Obj] {
        let plain = encode(format, &mesh, &plain).unwrap();
        assert!(painted(format) == plain, "{format:?}");
    }
}

/// The triangles of each part, in their order.
fn of_part(mesh: &TriMesh, part: Part) -> Vec<[u32; 3]> {
    let both = mesh.triangles.iter().zip(parts(mesh));
    both.filter(|(_, of)| *of == part)
        .map(|(t, _)| *t)
        .collect()
}

#[test]
fn every_format_that_can_says_which_part_each_triangle_is_of() {
    let mesh = cup();
    let numbers: Vec<u8> = parts(&mesh).iter().map(|part| part.number()).collect();
    let tagged = |format| {
        let metadata = Metadata {
            parts: parts(&mesh),
            ..metadata()
        };
        encode(format, &mesh, &metadata).unwrap()
    };

    let glb = tagged(Format::Glb);
    let (document, buffer) = chunks(&glb);
    let (untagged, _) = chunks(&bytes(Format::Glb));
    assert_eq!(
        document["accessors"][0], untagged["accessors"][0],
        "vertices"
    );
    let primitives = document["meshes"][0]["primitives"].as_array().unwrap();
    assert_eq!(primitives.len(), 3);
    for (primitive, part) in primitives.iter().zip(Part::ALL) {
        assert_eq!(primitive["extras"]["part"], part.as_str());
        assert_eq!(primitive["attributes"]["POSITION"], 0);
        let material = primitive["material"].as_u64().unwrap() as usize;
        assert_eq!(document["materials"][material]["name"], part.as_str());
        let accessor = &document["accessors"][primitive["indices"].as_u64().unwrap() as usize];
        let number = |value: &Value| value.as_u64().unwrap() as usize;
        let view = &document["bufferViews"][number(&accessor["bufferView"])];
        let start = number(&view["byteOffset"]) + number(&accessor["byteOffset"]);
        let indices: Vec<u32> = buffer[start..start + 2 * number(&accessor["count"])]
            .chunks_exact(2)
            .map(|w| u32::from(u16::from_le_bytes([w[0], w[1]])))
            .collect();
        assert_eq!(indices.as_chunks::<3>().0, of_part(&mesh, part));
    }

    let ply = tagged(Format::Ply);
    let faces = ply[ply.len() - 14 * mesh.triangles.len()..].chunks_exact(14);
    let read: Vec<u8> = faces.map(|face| face[13]).collect();
    assert_eq!(read, numbers);
    assert!(
        String::from_utf8_lossy(&ply)
            .contains("property list uchar int vertex_indices\nproperty uchar part\n")
    );

    let obj = String::from_utf8(tagged(Format::Obj)).unwrap();
    for part in Part::ALL {
        let group = obj.split(&format!("g {}\n", part.as_str())).nth(1).unwrap();
        let faces = group.lines().take_while(|line| line.starts_with("f "));
        let faces: Vec<[u32; 3]> = faces
            .map(|line| {
                let corner = |n: usize| line.split(' ').nth(n).unwrap().split("//").next().unwrap();
                [1, 2, 3].map(|n| corner(n).parse::<u32>().unwrap() - 1)
            })
            .collect();
        assert_eq!(faces, of_part(&mesh, part));
    }

    let vtp = String::from_utf8(tagged(Format::Vtp)).unwrap();
    let cells = vtp.split("<CellData>").nth(1).unwrap();
    let array = cells.split("Name=\"Part\"").nth(1).unwrap();
    let array = array.split(['>', '<']).nth(1).unwrap();
    assert_eq!(decode_base64(array)[8..], numbers);

    let json: Value = serde_json::from_slice(&tagged(Format::Json)).unwrap();
    assert_eq!(json["part"], json!(numbers));
    // With the parts of another mesh, files are as they were.
    for format in Format::ALL {
        let metadata = Metadata {
            parts: parts(&mesh)[1..].to_vec(),
            ..metadata()
        };
        assert_eq!(encode(format, &mesh, &metadata).unwrap(), bytes(format));
    }
}

#[test]
fn legacy_vtk_has_the_same_mesh_and_figures() {
    let mesh = cup();
    let vtk = painted(Format::Vtk);
    let after = |mark: &str| {
        let found = vtk.windows(mark.len()).position(|w| w == mark.as_bytes());
        let start = found.unwrap_or_else(|| panic!("{mark}")) + mark.len();
        &vtk[start..]
    };
    let doubles = |bytes: &[u8], count: usize| -> Vec<f64> {
        let words = bytes[..8 * count].chunks_exact(8);
        words
            .map(|w| f64::from_be_bytes(w.try_into().unwrap()))
            .collect()
    };
    let (points, triangles) = (mesh.vertices.len(), mesh.triangles.len());
    let lines: Vec<&[u8]> = vtk.splitn(4, |byte| *byte == b'\n').collect();
    assert_eq!(lines[0], b"# vtk DataFile Version 3.0");
    assert!(lines[1].starts_with(b"SPACE=LPS UNIT=mm") && lines[1].len() < 256);
    assert_eq!(lines[2], b"BINARY");
    let positions = after(&format!("POINTS {points} double\n"));
    assert_eq!(doubles(positions, 3 * points), flat(&mesh.vertices));
    let polygons = after(&format!("POLYGONS {triangles} {}\n", 4 * triangles));
    let words: Vec<u32> = polygons[..16 * triangles]
        .chunks_exact(4)
        .map(|w| u32::from_be_bytes(w.try_into().unwrap()))
        .collect();
    let rows: Vec<u32> = (mesh.triangles.iter())
        .flat_map(|&[a, b, c]| [3, a, b, c])
        .collect();
    assert_eq!(words, rows);
    let numbers: Vec<u8> = parts(&mesh).iter().map(|part| part.number()).collect();
    let head =
        format!("CELL_DATA {triangles}\nFIELD FieldData 1\nPart 1 {triangles} unsigned_char\n");
    assert_eq!(after(&head)[..triangles], numbers);
    let normals = after("NORMALS Normals double\n");
    assert_eq!(doubles(normals, 3 * points), flat(&mesh.vertex_normals()));
    let uptake = doubles(
        after(&format!("FIELD FieldData 1\nUptake 1 {points} double\n")),
        points,
    );
    assert!(uptake[0].is_nan());
    assert_eq!(uptake[1], 100.0 * (1.0 / points as f64));
}

#[test]
fn ply_has_the_figure_of_each_vertex_and_its_colour() {
    let ply = painted(Format::Ply);
    let end = b"\nend_header\n";
    let at = ply.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let header = String::from_utf8_lossy(&ply[..at]).into_owned();
    assert!(
        header.contains("property double uptake\nproperty uchar red\n"),
        "{header}"
    );
    let count = cup().vertices.len();
    for (n, row) in ply[at..at + 59 * count].chunks_exact(59).enumerate() {
        let share = n as f64 / count as f64;
        let value = doubles(&row[48..56])[0];
        assert!(if n == 0 {
            value.is_nan()
        } else {
            value == 100.0 * share
        });
        let blue = (255.0 * (1.0 - share)).round() as u8;
        assert_eq!(row[56..], [(255.0 * share).round() as u8, 128, blue]);
    }
}

#[test]
fn open_parts_are_the_triangles_and_figures_of_the_whole() {
    let mesh = cup();
    let about = Metadata {
        uncertainty: (0..mesh.vertices.len()).map(|n| n as f64).collect(),
        ..painted_metadata(&mesh)
    };
    // A mesh that was written and read again is cut in the same way.
    let bytes = encode(Format::Json, &mesh, &about).unwrap();
    let colours = |name: &str, values: &[f64]| {
        assert_eq!((name, values.len()), ("Uptake", mesh.vertices.len()));
        about.field.as_ref().unwrap().colours.clone()
    };
    let (read, about_read) = read_json::document(&bytes, &colours).unwrap();
    let mut area = 0.0;
    for part in Part::ALL {
        let (open, of_open) = open_part(&mesh, &about, part).unwrap();
        area += open.area();
        let corners = |mesh: &TriMesh, triangles: &[[u32; 3]]| -> Vec<[Vec3; 3]> {
            let at = |v: u32| mesh.vertices[v as usize];
            triangles.iter().map(|t| t.map(at)).collect()
        };
        assert_eq!(
            corners(&open, &open.triangles),
            corners(&mesh, &of_part(&mesh, part))
        );
        let used: BTreeSet<u32> = open.triangles.iter().flatten().copied().collect();
        assert_eq!(
            used.len(),
            open.vertices.len(),
            "no vertex without triangles"
        );
        for (vertex, value) in open.vertices.iter().zip(&of_open.uncertainty) {
            assert_eq!(*vertex, mesh.vertices[*value as usize]);
        }
        assert_eq!(
            of_open.field.as_ref().unwrap().values.len(),
            open.vertices.len()
        );
        for format in Format::ALL {
            let again = open_part(&read, &about_read, part).unwrap();
            assert_eq!(
                encode(format, &again.0, &again.1).unwrap(),
                encode(format, &open, &of_open).unwrap()
            );
        }
    }
    assert!((area - mesh.area()).abs() < 1e-9 * area);
    assert!(open_part(&mesh, &metadata(), Part::Base).is_none());
}

/// The cup at a share of its contraction: shorter about its middle.
fn contracted(share: f64) -> TriMesh {
    let mesh = cup();
    let middle = mesh.vertices.iter().sum::<Vec3>() / mesh.vertices.len() as f64;
    let moved = |v: &Vec3| middle + (v - middle) * (1.0 - 0.2 * share);
    TriMesh {
        vertices: mesh.vertices.iter().map(moved).collect(),
        ..mesh
    }
}

/// At key n mesh n is shown, and the last key shows the first mesh again.
#[test]
fn a_beat_is_a_closed_animation_of_its_meshes() {
    let meshes = [0.0, 0.6, 1.0, 0.3].map(contracted);
    let cycle = Cycle {
        meshes: &meshes,
        rest: 0,
        seconds: 0.9,
    };
    let bytes = animated::encode(&cycle, &painted_metadata(&meshes[0])).unwrap();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("formats_animated");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("beat.glb"), &bytes).unwrap();
    let (document, buffer) = chunks(&bytes);
    let numbers = |accessor: &Value| -> Vec<f32> {
        let accessor = &document["accessors"][accessor.as_u64().unwrap() as usize];
        let view = accessor["bufferView"].as_u64().unwrap() as usize;
        let view = &document["bufferViews"][view];
        let at = view["byteOffset"].as_u64().unwrap() as usize;
        let count = accessor["count"].as_u64().unwrap() as usize;
        let parts = if accessor["type"] == "VEC3" { 3 } else { 1 };
        floats(&buffer[at..at + 4 * parts * count])
    };
    let animation = &document["animations"][0];
    let sampler = &animation["samplers"][0];
    assert_eq!(sampler["interpolation"], "LINEAR");
    assert_eq!(animation["channels"][0]["target"]["path"], "weights");
    let times = numbers(&sampler["input"]);
    assert_eq!(times, [0.0, 0.225, 0.45, 0.675, 0.9]);
    let weights = numbers(&sampler["output"]);
    assert_eq!(weights[..4], weights[16..]);
    let primitives = document["meshes"][0]["primitives"].as_array().unwrap();
    assert_eq!(primitives.len(), 3);
    for primitive in primitives {
        let shown = |key: usize, attribute: &str| -> Vec<f32> {
            let mut sum = numbers(&primitive["attributes"][attribute]);
            let targets = primitive["targets"].as_array().unwrap();
            assert_eq!(targets.len(), meshes.len());
            for (target, weight) in targets.iter().zip(&weights[4 * key..]) {
                let moved = numbers(&target[attribute]);
                sum.iter_mut()
                    .zip(moved)
                    .for_each(|(s, m)| *s += weight * m);
            }
            sum
        };
        for key in 0..=meshes.len() {
            let mesh = &meshes[key % meshes.len()];
            for (attribute, wanted) in [
                ("POSITION", rounded(&mesh.vertices)),
                ("NORMAL", rounded(&mesh.vertex_normals())),
            ] {
                for (found, wanted) in shown(key, attribute).iter().zip(wanted) {
                    assert!((found - wanted).abs() < 2e-4, "{attribute} at key {key}");
                }
            }
        }
    }
    let mut other = meshes.clone();
    other[2].vertices.pop();
    other[2].triangles.clear();
    other[2].triangles.push([0, 1, 2]);
    let wrong = animated::encode(
        &Cycle {
            meshes: &other,
            ..cycle
        },
        &metadata(),
    );
    assert_eq!(wrong, Err(ExportError::OtherMesh { index: 2 }));
    let none = animated::encode(
        &Cycle {
            meshes: &[],
            ..cycle
        },
        &metadata(),
    );
    assert_eq!(none, Err(ExportError::OtherMesh { index: 0 }));
}
