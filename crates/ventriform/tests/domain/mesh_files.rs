//! Meshes of every format that is read: our own files, one cube written by hand in every storage, and files that are
//! no closed surface.

// The helpers of a test state their expectations by panicking, as the test does.
#![allow(clippy::unwrap_used)]

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use std::collections::BTreeSet;
use std::io::Write as _;
use ventriform::base::geometry::Vec3;
use ventriform::base::progress::{CancelToken, Cancelled, Monitor, Silent};
use ventriform::mesh::files::{
    MeshFileError, MeshFrame, MeshStatement, MeshUnit, ReadMesh, look, read, read_watched,
};
use ventriform::mesh::{TriMesh, shapes, topology};
use ventriform::results::export::{Format, Metadata, Part, encode};

const MAX_BYTES: u64 = 1 << 24;

fn silent() -> MeshStatement {
    MeshStatement::default()
}

fn given(unit: Option<MeshUnit>, frame: Option<MeshFrame>) -> MeshStatement {
    MeshStatement { unit, frame }
}

fn reading(bytes: &[u8]) -> ReadMesh {
    read(bytes, &silent(), MAX_BYTES).unwrap_or_else(|error| panic!("{error}"))
}

fn refusal(bytes: &[u8]) -> MeshFileError {
    read(bytes, &silent(), MAX_BYTES).unwrap_err()
}

/// The triangles by their corners in space, each from its smallest corner on.
fn facets(mesh: &TriMesh) -> BTreeSet<[[i64; 3]; 3]> {
    let place = |p: Vec3| [p.x, p.y, p.z].map(|x| (x * 1e4).round() as i64);
    let turned = |t: usize| {
        let mut corners = mesh.corners(t).map(place);
        let least = (0..3).min_by_key(|c| corners[*c]).unwrap();
        corners.rotate_left(least);
        corners
    };
    (0..mesh.triangles.len()).map(turned).collect()
}

// ------------------------------------------------------------------------------------------- our own files

/// A cup at the position of a heart, with coordinates that have no short decimals.
fn heart() -> TriMesh {
    let mut mesh = shapes::cup(80.0, 32.0, 10.0, 17);
    let turn = nalgebra::Rotation3::from_euler_angles(0.3, -0.7, 0.2);
    for v in &mut mesh.vertices {
        *v = turn * *v + Vec3::new(-31.7, 143.9, -612.3);
    }
    mesh
}

#[test]
fn a_reading_that_is_cancelled_gives_no_mesh_in_any_format() {
    let token = CancelToken::new();
    token.cancel();
    let monitor = Monitor::new(&Silent, token);
    for format in Format::ALL {
        let bytes = encode(format, &heart(), &Metadata::new("cancelled")).unwrap();
        let read = read_watched(&bytes, &silent(), MAX_BYTES, &monitor);
        assert_eq!(read, Err(MeshFileError::Cancelled(Cancelled)), "{format:?}");
    }
}

#[test]
fn every_format_that_is_written_is_read_back_to_the_same_mesh() {
    for mesh in [
        heart(),
        shapes::icosphere(41.3, 3),
        shapes::torus(30.0, 9.0, 24, 12),
    ] {
        let mut parted = Metadata::new("with parts");
        parted.parts = (0..mesh.triangles.len())
            .map(|t| Part::ALL[t % 3])
            .collect();
        for metadata in [Metadata::new("Left ventricle"), parted] {
            for format in Format::ALL {
                let bytes = encode(format, &mesh, &metadata).unwrap();
                let back = reading(&bytes);
                let name = format.extension();
                assert_eq!(back.notes, Vec::<String>::new(), "{name}");
                let exact = !matches!(format, Format::Stl | Format::Glb | Format::Gltf);
                let in_order = format != Format::Stl;
                if exact {
                    assert_eq!(back.mesh.vertices, mesh.vertices, "{name}");
                } else if in_order {
                    let far = back.mesh.vertices.iter().zip(&mesh.vertices);
                    let far = far.map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
                    assert!(far < 1e-4, "{name}: {far}");
                }
                let single = TriMesh {
                    vertices: (mesh.vertices.iter())
                        .map(|p| p.map(|x| f64::from(x as f32)))
                        .collect(),
                    triangles: mesh.triangles.clone(),
                };
                let wanted = if exact { &mesh } else { &single };
                assert_eq!(facets(&back.mesh), facets(wanted), "{name}");
                let grouped = !metadata.parts.is_empty()
                    && matches!(format, Format::Obj | Format::Glb | Format::Gltf);
                if in_order && !grouped {
                    assert_eq!(back.mesh.triangles, mesh.triangles, "{name}");
                }
                assert_eq!(
                    topology::check(&back.mesh),
                    topology::check(&mesh),
                    "{name}"
                );
                // A file that states LPS millimetres is nothing else.
                let ras = given(None, Some(MeshFrame::Ras));
                let cm = given(Some(MeshUnit::Centimetre), None);
                if format == Format::Stl {
                    continue; // Its header states the frame and, where it fits, the unit.
                }
                for stated in [ras, cm] {
                    let refused = read(&bytes, &stated, MAX_BYTES).unwrap_err();
                    assert!(
                        matches!(refused, MeshFileError::Contradiction { .. }),
                        "{name}"
                    );
                }
            }
        }
    }
}

// ------------------------------------------------------------------------------- one body in every storage

/// Corners of a wedge without symmetry, millimetres.
const WEDGE_CORNERS_MM: [[f32; 3]; 6] = [
    [10.0, -20.0, 5.0],
    [50.0, -20.0, 5.0],
    [10.0, 20.0, 5.0],
    [10.0, -20.0, 45.5],
    [50.0, -20.0, 45.5],
    [10.0, 20.0, 45.5],
];
/// Its faces, outward: two triangles and three quadrangles.
const WEDGE_FACES: [&[u32]; 5] = [
    &[0, 2, 1],
    &[3, 4, 5],
    &[0, 1, 4, 3],
    &[1, 2, 5, 4],
    &[2, 0, 3, 5],
];

fn triangles() -> Vec<[u32; 3]> {
    let split = |face: &&[u32]| -> Vec<[u32; 3]> {
        (1..face.len() - 1)
            .map(|n| [face[0], face[n], face[n + 1]])
            .collect()
    };
    WEDGE_FACES.iter().flat_map(split).collect()
}

fn wedge() -> TriMesh {
    TriMesh {
        vertices: WEDGE_CORNERS_MM
            .map(|p| Vec3::from(p.map(f64::from)))
            .to_vec(),
        triangles: triangles(),
    }
}

fn words<T: ToString>(numbers: impl IntoIterator<Item = T>) -> String {
    let words: Vec<String> = numbers.into_iter().map(|n| n.to_string()).collect();
    words.join(" ")
}

fn stl_text(comment: &str) -> Vec<u8> {
    let mut text = format!("solid wedge {comment}\r\n");
    for t in triangles() {
        text += "  facet normal 0 0 0\n    outer loop\n";
        for v in t {
            text += &format!(
                "      vertex {}\n",
                words(WEDGE_CORNERS_MM[v as usize].map(|x| format!("{x:e}")))
            );
        }
        text += "    endloop\n  endfacet\n";
    }
    (text + "endsolid wedge\n").into_bytes()
}

fn stl_binary(header: &str) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    bytes.resize(80, 0);
    bytes.extend((triangles().len() as u32).to_le_bytes());
    for t in triangles() {
        bytes.extend([0; 12]);
        for v in t {
            bytes.extend(
                WEDGE_CORNERS_MM[v as usize]
                    .iter()
                    .flat_map(|x| x.to_le_bytes()),
            );
        }
        bytes.extend([7, 9]);
    }
    bytes
}

/// With properties and elements that say nothing of the surface.
fn ply_header(encoding: &str, comment: &str) -> Vec<u8> {
    format!(
        "ply\nformat {encoding} 1.0\ncomment {comment}\nelement camera 1\nproperty short zoom\nelement vertex 6\n\
         property float32 x\nproperty float y\nproperty float z\nproperty uchar red\nproperty list uchar int tags\n\
         element face 5\nproperty uchar flags\nproperty list uint8 int32 vertex_indices\nelement edge 1\n\
         property int vertex1\nproperty int vertex2\nend_header\n"
    )
    .into_bytes()
}

fn ply_text(comment: &str) -> Vec<u8> {
    let mut bytes = ply_header("ascii", comment);
    bytes.extend(b"3\n");
    for p in WEDGE_CORNERS_MM {
        bytes.extend(format!("{} 200 2 5 6\n", words(p)).into_bytes());
    }
    for face in WEDGE_FACES {
        bytes.extend(format!("1 {} {}\n", face.len(), words(face)).into_bytes());
    }
    bytes.extend(b"0 1");
    bytes
}

fn ply_binary(big: bool, comment: &str) -> Vec<u8> {
    let name = if big {
        "binary_big_endian"
    } else {
        "binary_little_endian"
    };
    let mut bytes = ply_header(name, comment);
    let four = |n: u32| {
        if big {
            n.to_be_bytes()
        } else {
            n.to_le_bytes()
        }
    };
    bytes.extend([0, 3]);
    for p in WEDGE_CORNERS_MM {
        bytes.extend(p.iter().flat_map(|x| four(x.to_bits())));
        bytes.extend([200, 1]);
        bytes.extend(four(77));
    }
    for face in WEDGE_FACES {
        bytes.extend([1, face.len() as u8]);
        bytes.extend(face.iter().flat_map(|v| four(*v)));
    }
    bytes.extend([four(0), four(1)].concat());
    bytes
}

fn obj(comment: &str, relative: bool) -> Vec<u8> {
    let mut text = format!("# {comment}\nmtllib a.mtl\no wedge\n");
    for p in WEDGE_CORNERS_MM {
        text += &format!("v {} 1.0\n", words(p));
    }
    text += "vn 0 0 1\nvt 0.5 0.5\ng all\nusemtl red\ns off\n";
    for face in WEDGE_FACES {
        let corner = |v: &u32| {
            if relative {
                format!("{}", i64::from(*v) - 6)
            } else {
                format!("{}/1/1", v + 1)
            }
        };
        text += &format!("f {}\n", words(face.iter().map(corner)));
    }
    text.into_bytes()
}

fn vtk(version: &str, binary: bool, title: &str) -> Vec<u8> {
    let encoding = if binary { "BINARY" } else { "ASCII" };
    let mut bytes =
        format!("# vtk DataFile Version {version}\n{title}\n{encoding}\nDATASET POLYDATA\n")
            .into_bytes();
    let ints = |numbers: &[u32], wide: bool| -> Vec<u8> {
        match (binary, wide) {
            (false, _) => (words(numbers) + "\n").into_bytes(),
            (true, false) => [
                numbers.iter().flat_map(|n| n.to_be_bytes()).collect(),
                vec![b'\n'],
            ]
            .concat(),
            (true, true) => {
                let wide = numbers.iter().flat_map(|n| u64::from(*n).to_be_bytes());
                [wide.collect(), vec![b'\n']].concat()
            }
        }
    };
    bytes.extend(b"FIELD FieldData 2\nNumbers 1 3 int\n");
    bytes.extend(ints(&[1, 2, 3], false));
    bytes.extend(b"Words 1 1 string\n");
    bytes.extend(if binary {
        b"\xc5hello\n".to_vec()
    } else {
        b"hello%20world\n".to_vec()
    });
    bytes.extend(b"POINTS 6 float\n");
    if binary {
        bytes.extend(
            WEDGE_CORNERS_MM
                .iter()
                .flatten()
                .flat_map(|x| x.to_be_bytes()),
        )
    } else {
        bytes.extend(words(WEDGE_CORNERS_MM.iter().flatten()).into_bytes())
    }
    bytes.extend(b"\nMETADATA\nINFORMATION 0\n\n");
    let corners: Vec<u32> = WEDGE_FACES.concat();
    if version.starts_with('5') {
        let ends = WEDGE_FACES.iter().scan(0, |end, face| {
            *end += face.len() as u32;
            Some(*end)
        });
        let offsets: Vec<u32> = [0].into_iter().chain(ends).collect();
        bytes.extend(b"POLYGONS 6 18\nOFFSETS vtktypeint64\n");
        bytes.extend(ints(&offsets, true));
        bytes.extend(b"CONNECTIVITY vtktypeint64\n");
        bytes.extend(ints(&corners, true));
    } else {
        bytes.extend(b"VERTICES 1 2\n");
        bytes.extend(ints(&[1, 0], false));
        bytes.extend(b"POLYGONS 5 23\n");
        let cells: Vec<u32> = WEDGE_FACES
            .iter()
            .flat_map(|f| [&[f.len() as u32], *f].concat())
            .collect();
        bytes.extend(ints(&cells, false));
    }
    bytes.extend(b"POINT_DATA 6\nSCALARS s float 1\nLOOKUP_TABLE default\nwhatever");
    bytes
}

#[derive(Clone, Copy, PartialEq)]
enum Data {
    Text,
    Base64,
    AppendedBase64,
    AppendedRaw,
}

fn vtp(data: Data, packed: bool, wide: bool, big: bool, fields: &str) -> Vec<u8> {
    let four = |n: u32| {
        if big {
            n.to_be_bytes()
        } else {
            n.to_le_bytes()
        }
    };
    let header = |n: u64| match (wide, big) {
        (true, true) => n.to_be_bytes().to_vec(),
        (true, false) => n.to_le_bytes().to_vec(),
        (false, _) => four(n as u32).to_vec(),
    };
    let points: Vec<u8> = WEDGE_CORNERS_MM
        .iter()
        .flatten()
        .flat_map(|x| four(x.to_bits()))
        .collect();
    let corners: Vec<u32> = WEDGE_FACES.concat();
    let ends: Vec<u32> = WEDGE_FACES
        .iter()
        .scan(0, |end, face| {
            *end += face.len() as u32;
            Some(*end)
        })
        .collect();
    let bytes_of = |numbers: &[u32]| numbers.iter().flat_map(|n| four(*n)).collect::<Vec<u8>>();
    let mut appended: Vec<u8> = Vec::new();
    // The blocks are of 16 bytes, so that there are several.
    let encoded = |bytes: &[u8]| -> [Vec<u8>; 2] {
        if !packed {
            return [
                Vec::new(),
                [header(bytes.len() as u64), bytes.to_vec()].concat(),
            ];
        }
        let blocks: Vec<Vec<u8>> = bytes
            .chunks(16)
            .map(|block| {
                let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
                encoder.write_all(block).unwrap();
                encoder.finish().unwrap()
            })
            .collect();
        let last = bytes.len() % 16;
        let mut head = [header(blocks.len() as u64), header(16), header(last as u64)].concat();
        head.extend(blocks.iter().flat_map(|b| header(b.len() as u64)));
        [head, blocks.concat()]
    };
    let mut array = |attributes: &str, bytes: &[u8], text: String| {
        let [head, body] = encoded(bytes);
        // Header and blocks of packed arrays are encoded one by one.
        let base64 = format!("{}{}", STANDARD.encode(&head), STANDARD.encode(&body));
        let raw = [head, body].concat();
        match data {
            Data::Text => {
                format!("<DataArray {attributes} format=\"ascii\">\n {text}\n</DataArray>")
            }
            Data::Base64 => {
                format!("<DataArray {attributes} format=\"binary\">\n  {base64}\n</DataArray>")
            }
            _ => {
                let offset = appended.len();
                match data {
                    Data::AppendedRaw => appended.extend(raw),
                    _ => appended.extend(base64.into_bytes()),
                }
                format!("<DataArray {attributes} format=\"appended\" offset=\"{offset}\"/>")
            }
        }
    };
    let order = if big { "BigEndian" } else { "LittleEndian" };
    let word = if wide { "UInt64" } else { "UInt32" };
    let compressor = if packed {
        " compressor=\"vtkZLibDataCompressor\""
    } else {
        ""
    };
    let points = array(
        "type=\"Float32\" Name=\"Points\" NumberOfComponents=\"3\"",
        &points,
        words(WEDGE_CORNERS_MM.iter().flatten()),
    );
    let connectivity = array(
        "type=\"Int32\" Name=\"connectivity\"",
        &bytes_of(&corners),
        words(&corners),
    );
    let offsets = array(
        "type=\"UInt32\" Name='offsets'",
        &bytes_of(&ends),
        words(&ends),
    );
    let mut bytes = format!(
        "<?xml version=\"1.0\"?>\n<!-- by hand > -->\n<VTKFile type=\"PolyData\" version=\"0.1\" \
         byte_order=\"{order}\" \
         header_type=\"{word}\"{compressor}>\n<PolyData>\n<FieldData>{fields}</FieldData>\n<Piece NumberOfPoints=\"6\" \
         NumberOfPolys=\"5\">\n<PointData/>\n<Points>{points}</Points>\n<Polys>{connectivity}{offsets}</Polys>\n</Piece>\n</PolyData>\n"
    )
    .into_bytes();
    if matches!(data, Data::AppendedBase64 | Data::AppendedRaw) {
        let name = if data == Data::AppendedRaw {
            "raw"
        } else {
            "base64"
        };
        bytes.extend(format!("<AppendedData encoding=\"{name}\">\n _").into_bytes());
        bytes.extend(appended);
        bytes.extend(b"\n</AppendedData>\n");
    }
    bytes.extend(b"</VTKFile>\n");
    bytes
}

/// A document whose node turns, scales and moves: the world has metres and Y up.
fn gltf(embedded: bool) -> Vec<u8> {
    // World = 0.5 * stored + (0.1, 0, 0); LPS = (X, -Z, Y) in millimetres.
    let stored = |p: [f32; 3]| {
        let world = [p[0] / 1000.0, p[2] / 1000.0, -p[1] / 1000.0];
        [(world[0] - 0.1) * 2.0, world[1] * 2.0, world[2] * 2.0]
    };
    let mut buffer: Vec<u8> = WEDGE_CORNERS_MM
        .iter()
        .flat_map(|p| stored(*p))
        .flat_map(f32::to_le_bytes)
        .collect();
    let corners = triangles().concat();
    buffer.extend(corners.iter().flat_map(|v| (*v as u16).to_le_bytes()));
    let uri = if embedded {
        format!(
            ",\"uri\":\"data:application/octet-stream;base64,{}\"",
            STANDARD.encode(&buffer)
        )
    } else {
        String::new()
    };
    let mut json = format!(
        "{{\"asset\":{{\"version\":\"2.0\",\"extras\":{{\"by\":1}}}},\"scene\":0,\"scenes\":[{{\"nodes\":[0]}}],\
         \"nodes\":[{{\"translation\":[0.1,0,0],\"children\":[1]}},{{\"scale\":[0.5,0.5,0.5],\"mesh\":0}}],\
         \"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}},\"indices\":1}}]}}],\"accessors\":[\
         {{\"bufferView\":0,\"componentType\":5126,\"count\":6,\"type\":\"VEC3\"}},{{\"bufferView\":1,\"componentType\":5123,\
         \"count\":{},\"type\":\"SCALAR\"}}],\"bufferViews\":[{{\"buffer\":0,\"byteLength\":72}},{{\"buffer\":0,\
         \"byteOffset\":72,\"byteLength\":{}}}],\"buffers\":[{{\"byteLength\":{}{uri}}}]}}",
        corners.len(),
        2 * corners.len(),
        buffer.len()
    );
    if embedded {
        return json.into_bytes();
    }
    while json.len() % 4 != 0 {
        json.push(' ');
    }
    buffer.resize(buffer.len().next_multiple_of(4), 0);
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((12 + 16 + json.len() as u32 + buffer.len() as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json.bytes());
    bytes.extend((buffer.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(buffer);
    bytes
}

fn json(head: &str) -> Vec<u8> {
    let vertices: Vec<String> = WEDGE_CORNERS_MM.iter().map(|p| format!("{p:?}")).collect();
    let triangles: Vec<String> = triangles().iter().map(|t| format!("{t:?}")).collect();
    format!(
        "{{{head}\"vertices\":[{}],\"triangles\":[{}]}}",
        vertices.join(","),
        triangles.join(",")
    )
    .into_bytes()
}

/// Every storage, without statement of unit or frame.
fn storages() -> Vec<(String, Vec<u8>)> {
    let mut all = vec![
        ("STL text".to_owned(), stl_text("")),
        ("STL binary".into(), stl_binary("made by hand")),
        (
            "STL binary, header like a text".into(),
            stl_binary("solid facet"),
        ),
        ("PLY text".into(), ply_text("by hand")),
        ("PLY little".into(), ply_binary(false, "by hand")),
        ("PLY big".into(), ply_binary(true, "by hand")),
        ("OBJ".into(), obj("by hand", false)),
        ("OBJ relative".into(), obj("by hand", true)),
        ("VTK 3 text".into(), vtk("3.0", false, "title")),
        ("VTK 4.2 binary".into(), vtk("4.2", true, "title")),
        ("VTK 5.1 text".into(), vtk("5.1", false, "title")),
        ("VTK 5.1 binary".into(), vtk("5.1", true, "title")),
        ("JSON".into(), json("")),
    ];
    for (name, data) in [
        ("text", Data::Text),
        ("base64", Data::Base64),
        ("appended base64", Data::AppendedBase64),
        ("appended raw", Data::AppendedRaw),
    ] {
        for n in 0..8 {
            let [packed, wide, big] = [n & 1 > 0, n & 2 > 0, n & 4 > 0];
            let name = format!("VTP {name} packed {packed} wide {wide} big {big}");
            all.push((name, vtp(data, packed, wide, big, "")));
        }
    }
    all
}

#[test]
fn one_body_is_the_same_in_every_storage() {
    let wanted = facets(&wedge());
    for (name, bytes) in storages() {
        let back =
            read(&bytes, &silent(), MAX_BYTES).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(facets(&back.mesh), wanted, "{name}");
        assert_eq!(back.mesh.vertices.len(), 6, "{name}");
        assert!(
            back.notes
                .iter()
                .any(|note| note.contains("LPS was assumed")),
            "{name}"
        );
        assert!(
            back.notes.iter().any(|note| note.contains("millimetres")),
            "{name}"
        );
    }
    for embedded in [false, true] {
        let back = reading(&gltf(embedded));
        for (own, place) in back.mesh.vertices.iter().zip(&wedge().vertices) {
            assert!((own - place).amax() < 1e-4, "{own} {place}");
        }
        assert_eq!(back.mesh.triangles, triangles());
    }
}

#[test]
fn strips_are_split_as_their_formats_say() {
    // A tetrahedron as one strip: 0 1 2 3 0 1.
    let text = "# vtk DataFile Version 2.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 4 double\n0 0 0 40 0 0 0 40 0 0 0 40\n\
                TRIANGLE_STRIPS 1 7\n6 0 1 2 3 0 1\n";
    let back = reading(text.as_bytes());
    assert_eq!(back.mesh.triangles.len(), 4);
    assert!((back.mesh.volume() - 64_000.0 / 6.0).abs() < 1e-6);
    let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
               element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0\n";
    assert!(matches!(
        refusal(ply.as_bytes()),
        MeshFileError::Unsupported { .. }
    ));
}

// ------------------------------------------------------------------------------------------ frame and unit

#[test]
fn ras_comes_to_lps_whoever_states_it() {
    let mut turned = wedge();
    turned
        .vertices
        .iter_mut()
        .for_each(|p| (p.x, p.y) = (-p.x, -p.y));
    let wanted = facets(&turned);
    let slicer = "3D Slicer output. SPACE=RAS";
    let codes = |text: &str| text.bytes().map(|b| format!("{b} ")).collect::<String>();
    let field = format!(
        "<Array type=\"String\" Name=\"SPACE\" NumberOfTuples=\"1\" format=\"ascii\">{}0</Array>",
        codes("RAS")
    );
    let files = [
        stl_text(slicer),
        stl_binary(slicer),
        ply_text(slicer),
        ply_binary(false, slicer),
        ply_binary(true, slicer),
        obj(slicer, false),
        vtk("3.0", false, slicer),
        vtk("5.1", true, slicer),
        vtp(Data::Text, false, false, false, &field),
        vtp(Data::AppendedRaw, true, true, false, &field),
        json("\"frame\":\"RAS\","),
    ];
    for (number, bytes) in files.iter().enumerate() {
        assert_eq!(facets(&reading(bytes).mesh), wanted, "{number}");
        let lps = given(None, Some(MeshFrame::Lps));
        let refused = read(bytes, &lps, MAX_BYTES).unwrap_err();
        assert!(
            matches!(refused, MeshFileError::Contradiction { field: "frame", .. }),
            "{refused}"
        );
    }
    for (name, bytes) in storages() {
        let ras = given(None, Some(MeshFrame::Ras));
        let back = read(&bytes, &ras, MAX_BYTES).unwrap();
        assert_eq!(facets(&back.mesh), wanted, "{name}");
        assert!(
            !back.notes.iter().any(|note| note.contains("frame")),
            "{name}"
        );
    }
    for strange in ["SPACE=LAS", "SPACE=", "UNIT=inch"] {
        for bytes in [
            obj(&format!("SPACE=LPS {strange}"), false),
            ply_text(strange),
        ] {
            let refused = refusal(&bytes).to_string();
            assert!(refused.contains("are known"), "{refused}");
        }
    }
}

/// The wedge is 40 mm across.
#[test]
fn a_unit_that_nobody_states_is_never_guessed() {
    let sized = |scale: f64| {
        let mut mesh = wedge();
        mesh.vertices.iter_mut().for_each(|p| *p *= scale);
        let mut text = String::from("# wavefront\n");
        for p in &mesh.vertices {
            text += &format!("v {} {} {}\n", p.x, p.y, p.z);
        }
        for t in &mesh.triangles {
            text += &format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
        }
        text.into_bytes()
    };
    let wanted = facets(&wedge());
    for (unit, scale) in [
        (MeshUnit::Millimetre, 1.0),
        (MeshUnit::Centimetre, 0.1),
        (MeshUnit::Metre, 0.001),
    ] {
        let bytes = sized(scale);
        let stated = read(&bytes, &given(Some(unit), None), MAX_BYTES).unwrap();
        assert_eq!(facets(&stated.mesh), wanted);
        let said = [
            format!("# UNIT={}\n", unit.as_str()).into_bytes(),
            bytes.clone(),
        ]
        .concat();
        assert_eq!(facets(&reading(&said).mesh), wanted);
        if unit == MeshUnit::Millimetre {
            continue;
        }
        let refused = refusal(&bytes);
        let MeshFileError::Size(size) = &refused else {
            panic!("{refused}");
        };
        assert_eq!(size.likely, Some(unit));
        assert_eq!(size.factor(), Some(unit.in_millimetres()));
        assert!(
            refused
                .to_string()
                .contains(&format!("factor {}", unit.in_millimetres())),
            "{refused}"
        );
        let seen = look(&bytes, &silent(), MAX_BYTES).unwrap();
        assert_eq!(seen.unlikely, Some(*size));
    }
    for (scale, likely) in [(1e-7, None), (1000.0, None)] {
        let MeshFileError::Size(size) = refusal(&sized(scale)) else {
            panic!("{scale}");
        };
        assert_eq!(size.likely, likely);
    }
    // glTF has metres; millimetres in it are 40 m.
    let mut metres = gltf(true);
    let at = metres.windows(7).position(|w| w == b"\"scale\"").unwrap();
    metres.splice(at + 9..at + 20, b"500,500,500".iter().copied());
    let MeshFileError::Size(size) = refusal(&metres) else {
        panic!("metres");
    };
    assert_eq!(size.likely, Some(MeshUnit::Millimetre));
}

// ----------------------------------------------------------------------------------- what is not a surface

fn obj_of(mesh: &TriMesh) -> Vec<u8> {
    let mut text = String::from("# SPACE=LPS UNIT=mm\n");
    for p in &mesh.vertices {
        text += &format!("v {} {} {}\n", p.x, p.y, p.z);
    }
    for t in &mesh.triangles {
        text += &format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
    }
    text.into_bytes()
}

#[test]
fn open_and_twisted_surfaces_are_refused_with_the_number_of_edges() {
    let sphere = shapes::icosphere(30.0, 2);
    let mut open = sphere.clone();
    open.triangles.pop();
    let refused = refusal(&obj_of(&open));
    assert!(
        matches!(refused, MeshFileError::Open { edges: 3, .. }),
        "{refused}"
    );
    let mut twisted = sphere.clone();
    twisted.triangles[5].swap(0, 1);
    let refused = refusal(&obj_of(&twisted));
    assert!(
        matches!(refused, MeshFileError::Orientation { edges: 3, .. }),
        "{refused}"
    );
    let mut inward = sphere.clone();
    inward.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let turned = reading(&obj_of(&inward));
    assert_eq!(facets(&turned.mesh), facets(&sphere));
    assert!(turned.notes.iter().any(|note| note.contains("inward")));
    let mut flat = sphere.clone();
    flat.vertices.iter_mut().for_each(|p| p.z = 0.0);
    assert!(matches!(
        refusal(&obj_of(&flat)),
        MeshFileError::Flat | MeshFileError::Open { .. } | MeshFileError::Orientation { .. }
    ));
    assert_eq!(
        refusal(b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
        MeshFileError::Empty
    );
}

#[test]
fn repeated_vertices_become_one_and_others_stay() {
    let sphere = shapes::icosphere(30.0, 3);
    // Each triangle with corners of its own, moved by less than single precision resolves.
    let soup = |shift: f64| {
        let mut mesh = TriMesh::default();
        for t in 0..sphere.triangles.len() {
            let moved = |p: Vec3| p + Vec3::new(shift, -shift, shift) * (t % 7) as f64;
            mesh.vertices.extend(sphere.corners(t).map(moved));
            let first = 3 * t as u32;
            mesh.triangles.push([first, first + 1, first + 2]);
        }
        // A vertex that nothing uses.
        mesh.vertices.push(Vec3::zeros());
        mesh
    };
    for (shift, word) in [(0.0, "with the coordinates of others"), (1e-6, "within")] {
        let back = reading(&obj_of(&soup(shift)));
        assert_eq!(back.mesh.vertices.len(), sphere.vertices.len());
        assert_eq!(topology::check(&back.mesh), topology::check(&sphere));
        assert!(
            back.notes.iter().any(|note| note.contains(word)),
            "{:?}",
            back.notes
        );
        assert!(
            back.notes
                .iter()
                .any(|note| note.contains("without triangle")),
            "{:?}",
            back.notes
        );
    }
    let apart = refusal(&obj_of(&soup(0.01)));
    assert!(matches!(apart, MeshFileError::Open { .. }), "{apart}");
}

#[test]
fn stated_counts_are_compared_with_the_bytes_before_memory_is_taken() {
    let huge = u64::MAX.to_string();
    let ply = |vertices: &str, faces: &str| {
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
             property float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    let vtk = |points: &str, cells: &str| {
        format!(
            "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS {points} float\n0 0 0\nPOLYGONS {cells} \
             {cells}\n"
        )
    };
    for text in [
        ply(&huge, "1"),
        ply("4294967295", "1"),
        ply("0", &huge),
        vtk(&huge, "1"),
        vtk("1", &huge),
        vtk("1", "1e300"),
    ] {
        let refused = refusal(text.as_bytes());
        assert!(
            matches!(refused, MeshFileError::Damaged { .. }),
            "{refused}"
        );
    }
    // Packed arrays that unpack beyond the limit.
    let zeros = vec![0; 1 << 20];
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(&zeros).unwrap();
    let block = encoder.finish().unwrap();
    let header = [1_u32, 1 << 20, 0, block.len() as u32]
        .map(u32::to_le_bytes)
        .concat();
    let array = format!("{}{}", STANDARD.encode(header), STANDARD.encode(block));
    let bomb = format!(
        "<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\" \
         compressor=\"vtkZLibDataCompressor\"><PolyData><Piece><Points><DataArray type=\"Float32\" \
         format=\"binary\">{array}</DataArray></Points></Piece></PolyData></VTKFile>"
    );
    let refused = read(bomb.as_bytes(), &silent(), 1 << 16).unwrap_err();
    assert!(
        matches!(
            refused,
            MeshFileError::TooLong {
                bytes: 0x10_0000,
                ..
            }
        ),
        "{refused}"
    );
    // Lines and words without end.
    let long = [&b"v 0 0 0\n# "[..], &[b'a'; 100_000]].concat();
    assert!(matches!(refusal(&long), MeshFileError::Damaged { .. }));
    let bytes = stl_binary("");
    let refused = read(&bytes, &silent(), 100).unwrap_err();
    assert!(matches!(refused, MeshFileError::TooLong { .. }));
    // A binary STL file that is cut off or longer than it states is none.
    assert!(matches!(
        refusal(&bytes[..bytes.len() - 1]),
        MeshFileError::Unknown { .. }
    ));
}

#[test]
fn every_part_of_a_file_is_cut_off_and_damaged_without_a_panic() {
    let mut files = storages();
    files.push(("glb".into(), gltf(false)));
    files.push(("gltf".into(), gltf(true)));
    for (name, whole) in files {
        let check = |bytes: &[u8]| {
            if let Ok(found) = look(bytes, &silent(), MAX_BYTES) {
                let mesh = &found.mesh;
                assert!(
                    mesh.vertices
                        .iter()
                        .all(|p| p.iter().all(|x| x.is_finite())),
                    "{name}"
                );
                assert!(
                    mesh.triangles
                        .iter()
                        .flatten()
                        .all(|v| (*v as usize) < mesh.vertices.len())
                );
                assert!(mesh.volume() > 0.0, "{name}");
            }
        };
        for at in 0..whole.len() {
            check(&whole[..at]);
            for value in [0, 0x39, 0x7f, 0xff, whole[at] ^ 1, whole[at] ^ 0x80] {
                let mut damaged = whole.clone();
                damaged[at] = value;
                check(&damaged);
            }
        }
    }
}
