//! Targets that need no service, and the files that damage starts from. All files are made here.

use std::io::Write as _;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::given_mask::{MaskChoice, read_mask};
use ventriform::image::volume::nifti::{self as nifti_files, StoredType};
use ventriform::image::volume::{self, ReadLimits, ReadOptions, Volume, VolumeFile};
use ventriform::mesh::files::{self, MeshStatement};
use ventriform::parameters::{FitParameters, ModelParameters, Parameters};
use ventriform::results::export::{Format, Metadata, encode};

/// Small, so that a file that gets past them shows at once.
const LIMITS: ReadLimits = ReadLimits {
    voxels: 1 << 16,
    unpacked_bytes: 1 << 20,
    mesh_bytes: 1 << 20,
    ..ReadLimits::DEFAULT
};

/// Reads the bytes as a NIfTI file; what is read keeps its promises.
pub fn nifti(data: &[u8]) {
    read("volume.nii", data);
}

/// Reads the bytes as a DICOM file; what is read keeps its promises.
pub fn dicom(data: &[u8]) {
    read("volume.dcm", data);
}

/// Reads the bytes as a mesh, and as an expert's mask; what is read is a closed surface.
pub fn mesh(data: &[u8]) {
    let stated = MeshStatement::default();
    if let Ok(read) = files::look(data, &stated, LIMITS.mesh_bytes) {
        let mesh = &read.mesh;
        assert!(
            mesh.vertices
                .iter()
                .all(|p| p.iter().all(|x| x.is_finite()))
        );
        assert!(mesh.volume() > 0.0);
    }
    let files = [VolumeFile::in_memory("mesh", data)];
    let monitor = Monitor::silent();
    if let Ok(mask) = read_mask(&files, &MaskChoice::default(), &LIMITS, &monitor) {
        assert!(mask.mask.voxels.contains(&true));
    }
}

fn read(name: &str, data: &[u8]) {
    let files = [VolumeFile::in_memory(name, data)];
    let monitor = Monitor::silent();
    let facts = volume::inspect(&files, &LIMITS, &monitor);
    let frame = ReadOptions { frame: Some(0) };
    let reading = volume::read(&files, &frame, &LIMITS, &monitor);
    if let Ok(reading) = &reading {
        let volume = &reading.volume;
        let count: usize = volume.shape.iter().product();
        assert_eq!(volume.voxels.len(), count);
        assert!(count as u64 <= LIMITS.voxels, "{:?}", volume.shape);
        let affine = reading.facts.affine_lps;
        assert!(affine.iter().all(|x| x.is_finite()), "{affine}");
    }
    // Inspecting decodes every voxel, so that a job does not fail on a file that was accepted.
    if let (Ok(facts), Err(error)) = (&facts, &reading) {
        panic!(
            "{} frames were accepted, the first is refused: {error}",
            facts.frames
        );
    }
}

/// Reads the bytes as parameters of a model and of a fit: as JSON, and as `name=value` lines.
/// What is accepted is written out and read back to the same.
pub fn parameters(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    if let Ok(serde_json::Value::Object(object)) = serde_json::from_str(text) {
        kept(ModelParameters::from_json(&object));
        kept(FitParameters::from_json(&object));
    }
    let pairs = || text.lines().filter_map(|line| line.split_once('='));
    kept(ModelParameters::from_pairs(pairs()));
    kept(FitParameters::from_pairs(pairs()));
}

fn kept<P: Parameters, E>(given: Result<P, E>) {
    if let Ok(parameters) = given {
        let written = parameters.to_json();
        let Ok(again) = P::from_json(&written) else {
            panic!("written, but not read: {written:?}");
        };
        assert_eq!(again.to_json(), written);
    }
}

/// The files that damage starts from, by the target's name.
pub fn corpus(target: &str) -> Vec<Vec<u8>> {
    match target {
        "nifti" => nifti_corpus(),
        "dicom" => dicom_corpus(),
        "parameters" => [
            r#"{"points": 24, "iso": "50%", "box": [0, 0, 0, 9, 9, 9], "method": "paper"}"#,
            r#"{"model": "auto", "organ": "liver", "center": [1.5, 2, 3], "margin": 0.5}"#,
            "points=12\niso=absolute:0.5\nseed-point=1,2,3\nw1=0",
            "model=tpl_0\nsuperior=frame\naxis=0,0,1\nbox=0,0,0,1,1,1",
        ]
        .map(|text| text.as_bytes().to_vec())
        .to_vec(),
        "mesh" => mesh_corpus(),
        "multipart" => multipart_corpus(),
        "association" => association_corpus(),
        other => panic!("no target `{other}`"),
    }
}

/// A small body in every format that we write, and some that we do not.
fn mesh_corpus() -> Vec<Vec<u8>> {
    let mesh = ventriform::mesh::shapes::tetrahedron(40.0);
    let metadata = Metadata::new("t");
    let ours = Format::ALL.map(|format| encode(format, &mesh, &metadata).unwrap_or_default());
    let points = mesh
        .vertices
        .iter()
        .map(|p| format!("{} {} {}\n", p.x, p.y, p.z));
    let points: String = points.collect();
    let faces = mesh
        .triangles
        .iter()
        .map(|[a, b, c]| format!("3 {a} {b} {c}\n"));
    let faces: String = faces.collect();
    let corners = mesh.triangles.iter().map(|t| {
        let corner = |v: u32| {
            let p = mesh.vertices[v as usize];
            format!("vertex {} {} {}\n", p.x, p.y, p.z)
        };
        let corners = t.map(corner).concat();
        format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    });
    let corners: String = corners.collect();
    let others = [
        format!("solid t\n{corners}endsolid t\n"),
        format!(
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             element face 4\nproperty list uchar int vertex_index\nend_header\n{points}{faces}"
        ),
        format!(
            "# vtk DataFile Version 5.1\nSPACE=RAS\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n{points}POLYGONS 5 12\n\
             OFFSETS vtktypeint64\n0 3 6 9 12\nCONNECTIVITY vtktypeint64\n{}",
            faces.replace("3 ", " ")
        ),
    ];
    let others = others.into_iter().map(String::into_bytes);
    ours.into_iter().chain(others).collect()
}

/// A PDU or an item of one: type, length, content.
fn framed(kind: u8, wide: bool, content: &[u8]) -> Vec<u8> {
    let length = content.len();
    let length = if wide {
        (length as u32).to_be_bytes().to_vec()
    } else {
        (length as u16).to_be_bytes().to_vec()
    };
    [&[kind, 0], &length[..], content].concat()
}

/// An association with C-ECHO, and one with a C-STORE that is cut off.
fn association_corpus() -> Vec<Vec<u8>> {
    let item = |kind, content: &[u8]| framed(kind, false, content);
    let context = |id, class: &[u8], syntax: &[u8]| {
        let parts = [&[id, 0, 0, 0], &item(0x30, class)[..], &item(0x40, syntax)];
        item(0x20, &parts.concat())
    };
    let request = [
        b"\0\x01\0\0VENTRIFORM      FUZZ            ".to_vec(),
        vec![0; 32],
        item(0x10, b"1.2.840.10008.3.1.1.1"),
        context(1, b"1.2.840.10008.1.1", b"1.2.840.10008.1.2"),
        context(3, b"1.2.840.10008.5.1.4.1.1.20", b"1.2.840.10008.1.2.1"),
        item(0x50, &item(0x51, &16384_u32.to_be_bytes())),
    ];
    let value = |context, control, content: &[u8]| {
        let length = (content.len() as u32 + 2).to_be_bytes();
        framed(
            4,
            true,
            &[&length, &[context, control][..], content].concat(),
        )
    };
    let element = |number: u16, content: &[u8]| {
        let head = [&[0, 0], &number.to_le_bytes()[..]].concat();
        [&head, &(content.len() as u32).to_le_bytes()[..], content].concat()
    };
    let command = |field: u8, class: &[u8], data: [u8; 2]| {
        let parts = [
            element(0x0002, class),
            element(0x0100, &[field, 0]),
            element(0x0110, &[1, 0]),
            element(0x0800, &data),
            element(0x1000, b"1.2.3.45"),
        ];
        parts.concat()
    };
    let echo = command(0x30, b"1.2.840.10008.1.1\0", [1, 1]);
    let store = command(0x01, b"1.2.840.10008.5.1.4.1.1.20", [0, 0]);
    let request = framed(1, true, &request.concat());
    let release = framed(5, true, &[0; 4]);
    let object = dicom_corpus().swap_remove(0);
    let object = object.get(132..).unwrap_or_default();
    vec![
        [&request[..], &value(1, 3, &echo), &release].concat(),
        [
            &request[..],
            &value(3, 3, &store),
            &value(3, 0, object),
            &value(3, 2, b"\0\0"),
        ]
        .concat(),
    ]
}

fn nifti_corpus() -> Vec<Vec<u8>> {
    let shape = [3, 4, 5];
    let volume = Volume {
        voxels: (0..60).map(|v| v as f32).collect(),
        shape,
        integral: true,
        frame: VoxelToPatient::centred(shape, [2.0, 3.0, 4.0], Vec3::zeros()).unwrap(),
    };
    let types = [StoredType::Uint8, StoredType::Int16];
    let plain = types.map(|stored| nifti_files::write(&volume, stored, false).unwrap());
    let packed = nifti_files::write(&volume, StoredType::Int16, true).unwrap();
    let mut swapped = plain[1].clone();
    // A header in the other byte order: the reader must notice by its first number.
    swapped[..4].reverse();
    [plain.to_vec(), vec![packed, swapped]].concat()
}

fn dicom_corpus() -> Vec<Vec<u8>> {
    let mut corpus = vec![dicom_file(false), dicom_file(true)];
    for (uid, frame) in [
        ("1.2.840.10008.1.2.5\0", run_lengths()),
        ("1.2.840.10008.1.2.4.70", hex(JPEG_LOSSLESS)),
        ("1.2.840.10008.1.2.4.80", hex(JPEG_LS)),
        ("1.2.840.10008.1.2.4.90", hex(JPEG_2000)),
    ] {
        corpus.push(compressed_slice(uid, &frame));
    }
    corpus.push(segmentation());
    corpus.push(stored_zip(&corpus[2]));
    corpus
}

/// A 9 x 7 image of 12 bits in JPEG-LS, by CharLS.
const JPEG_LS: &str = "\
    ffd8ffe800205350494646000200000100000007000000090a1006010000012c0000012cffe8000800000001\
    ffd8fff7000b100007000901011100fff8000d01ffff0012004301140040ffda0008010100000000f127f4cf\
    2bf7a89fb342c34189a161b2825ba89d412dc13a735ef7da34e2f7515a6df54b4da310d6bd9b10d6bd910e5c\
    dcb653ad7ca651ad3c924ec63c4507b3f84a0765f01400ffd9";

/// The same in JPEG 2000, by OpenJPEG.
const JPEG_2000: &str = "\
    ff4fff5100290000000000090000000700000000000000000000000900000007000000000000000000010b01\
    01ff52000c00000001000004040001ff5c00044060ff640025000143726561746564206279204f70656e4a50\
    45472076657273696f6e20322e352e34ff90000a00000000006a0001ff93dfe164111df62479fd1b32775125\
    b50b562195515f88f2d362bc588be51732ce2b6a0286c0c3712d678334be10852cbaaa2a9fde568f0e5df2c5\
    823a9c9ea09749ceff0cc6c571b21e92674e776eb56158ed6297956d67093f31582dffd9";

/// The same in lossless JPEG, by liblj92.
const JPEG_LOSSLESS: &str = "\
    ffd8ffc4001b000101000203010000000000000000000008000706090a050cffc3000b0c0007000901001100\
    ffda0008010000060000f9ff00eaeca1ca6f32fcf0f62baacd08fc579891f54824e638cde9ccebcb8f656db7\
    1d2a745cf8a9cb6895b6a4895b6a4895b6754b30f5f4b30f5f4b30d1ea368798a368798a3680ffd9";

fn hex(digits: &str) -> Vec<u8> {
    let digits: Vec<u32> = digits.chars().filter_map(|c| c.to_digit(16)).collect();
    let (pairs, _) = digits.as_chunks::<2>();
    pairs.iter().map(|[a, b]| (16 * a + b) as u8).collect()
}

/// 9 x 7 numbers of 16 bits in literal runs and runs of one byte.
fn run_lengths() -> Vec<u8> {
    let mut frame = vec![0; 64];
    (frame[0], frame[4], frame[8]) = (2, 64, 66);
    frame.extend([194, 3]);
    frame.push(62);
    frame.extend(0..63);
    frame
}

/// The elements of an image of 9 columns and 7 rows of a SOP class.
fn image_elements(class: &[u8], bits: u16) -> Vec<((u16, u16), &'static str, Vec<u8>)> {
    let short = |n: u16| n.to_le_bytes().to_vec();
    vec![
        ((0x08, 0x16), "UI", class.to_vec()),
        ((0x08, 0x18), "UI", b"1.2.3.4\0".to_vec()),
        ((0x18, 0x50), "DS", b"6 ".to_vec()),
        ((0x20, 0x32), "DS", b"10\\-20.5\\30 ".to_vec()),
        ((0x20, 0x37), "DS", b"1\\0\\0\\0\\1\\0 ".to_vec()),
        ((0x28, 0x10), "US", short(7)),
        ((0x28, 0x11), "US", short(9)),
        ((0x28, 0x30), "DS", b"2.5\\4 ".to_vec()),
        ((0x28, 0x100), "US", short(bits)),
        ((0x28, 0x101), "US", short(bits)),
        ((0x28, 0x102), "US", short(bits - 1)),
        ((0x28, 0x103), "US", short(0)),
    ]
}

fn dicom_start(uid: &str) -> Vec<u8> {
    let mut bytes = vec![0; 128];
    bytes.extend(b"DICM");
    element(&mut bytes, (2, 0x10), "UI", uid.as_bytes(), false);
    bytes
}

/// A PET slice with compressed pixels.
fn compressed_slice(uid: &str, frame: &[u8]) -> Vec<u8> {
    let mut bytes = dicom_start(uid);
    for (tag, vr, value) in &image_elements(b"1.2.840.10008.5.1.4.1.1.128\0", 16) {
        element(&mut bytes, *tag, vr, value, false);
    }
    bytes.extend([0xe0, 0x7f, 0x10, 0x00]);
    bytes.extend(b"OB\0\0\xff\xff\xff\xff");
    bytes.extend([0xfe, 0xff, 0x00, 0xe0, 0, 0, 0, 0]);
    bytes.extend([0xfe, 0xff, 0x00, 0xe0]);
    let padded = frame.len().next_multiple_of(2);
    bytes.extend((padded as u32).to_le_bytes());
    bytes.extend(frame);
    bytes.resize(bytes.len() + padded - frame.len(), 0);
    bytes.extend([0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]);
    bytes
}

/// A binary segmentation of two frames, each with a position of its own.
fn segmentation() -> Vec<u8> {
    let mut bytes = dicom_start("1.2.840.10008.1.2.1\0");
    let mut elements = image_elements(b"1.2.840.10008.5.1.4.1.1.66.4", 1);
    elements.push(((0x28, 0x08), "IS", b"2 ".to_vec()));
    elements.push(((0x62, 0x01), "CS", b"BINARY".to_vec()));
    elements.sort_by_key(|(tag, ..)| *tag);
    for (tag, vr, value) in &elements {
        element(&mut bytes, *tag, vr, value, false);
    }
    let item = |content: Vec<u8>| {
        let mut item = vec![0xfe, 0xff, 0x00, 0xe0];
        item.extend((content.len() as u32).to_le_bytes());
        item.extend(content);
        item
    };
    let mut frames = Vec::new();
    for (position, segment) in [("10\\-20.5\\30 ", 1_u16), ("10\\-20.5\\48 ", 2)] {
        let (mut place, mut number, mut frame) = (Vec::new(), Vec::new(), Vec::new());
        element(&mut place, (0x20, 0x32), "DS", position.as_bytes(), false);
        element(
            &mut number,
            (0x62, 0x0b),
            "US",
            &segment.to_le_bytes(),
            false,
        );
        element(&mut frame, (0x20, 0x9113), "SQ", &item(place), false);
        element(&mut frame, (0x62, 0x0a), "SQ", &item(number), false);
        frames.extend(item(frame));
    }
    element(&mut bytes, (0x5200, 0x9230), "SQ", &frames, false);
    element(&mut bytes, (0x7fe0, 0x10), "OW", &[0x55; 16], false);
    bytes
}

/// A zip archive with `content` as its only file, not packed.
fn stored_zip(content: &[u8]) -> Vec<u8> {
    let size = (content.len() as u32).to_le_bytes();
    // Version, flags, method, time, date, checksum (not read), sizes, lengths of name and extra field.
    let mut common = vec![20, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    common.extend([size, size].concat());
    common.extend([1, 0, 0, 0]);
    let mut bytes = b"PK\x03\x04".to_vec();
    bytes.extend(&common);
    bytes.push(b'a');
    bytes.extend(content);
    let begin = (bytes.len() as u32).to_le_bytes();
    let mut directory = b"PK\x01\x02\x14\0".to_vec();
    directory.extend(&common);
    directory.extend([0; 14]);
    directory.push(b'a');
    bytes.extend(&directory);
    bytes.extend(b"PK\x05\x06\0\0\0\0\x01\0\x01\0");
    bytes.extend((directory.len() as u32).to_le_bytes());
    bytes.extend(begin);
    bytes.extend([0, 0]);
    bytes
}

/// A multi-frame NM file of 2 × 3 × 4 voxels, with explicit or implicit value representations.
fn dicom_file(implicit: bool) -> Vec<u8> {
    let uid = if implicit {
        "1.2.840.10008.1.2\0"
    } else {
        "1.2.840.10008.1.2.1\0"
    };
    let mut bytes = vec![0; 128];
    bytes.extend(b"DICM");
    element(&mut bytes, (2, 0x10), "UI", uid.as_bytes(), false);
    let short = |n: u16| n.to_le_bytes().to_vec();
    let shorts = |n: std::ops::Range<u16>| n.flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    let mut place = vec![0xfe, 0xff, 0x00, 0xe0];
    let mut item = Vec::new();
    element(&mut item, (0x20, 0x32), "DS", b"10\\-20.5\\30 ", implicit);
    element(
        &mut item,
        (0x20, 0x37),
        "DS",
        b"1\\0\\0\\0\\1\\0 ",
        implicit,
    );
    place.extend((item.len() as u32).to_le_bytes());
    place.extend(item);
    let elements: [((u16, u16), &str, Vec<u8>); 17] = [
        (
            (0x08, 0x08),
            "CS",
            b"ORIGINAL\\PRIMARY\\RECON TOMO\\EMISSION ".to_vec(),
        ),
        ((0x08, 0x16), "UI", b"1.2.840.10008.5.1.4.1.1.20".to_vec()),
        ((0x08, 0x60), "CS", b"NM".to_vec()),
        ((0x18, 0x50), "DS", b"6 ".to_vec()),
        ((0x18, 0x88), "DS", b"-5.0".to_vec()),
        ((0x28, 0x02), "US", short(1)),
        ((0x28, 0x08), "IS", b"4 ".to_vec()),
        ((0x28, 0x09), "AT", [short(0x54), short(0x80)].concat()),
        ((0x28, 0x10), "US", short(2)),
        ((0x28, 0x11), "US", short(3)),
        ((0x28, 0x30), "DS", b"2.5\\4 ".to_vec()),
        ((0x28, 0x100), "US", short(16)),
        ((0x28, 0x101), "US", short(16)),
        ((0x28, 0x102), "US", short(15)),
        ((0x28, 0x103), "US", short(0)),
        ((0x54, 0x22), "SQ", place),
        ((0x54, 0x80), "US", shorts(1..5)),
    ];
    for (tag, vr, value) in &elements {
        element(&mut bytes, *tag, vr, value, implicit);
    }
    element(&mut bytes, (0x7fe0, 0x10), "OW", &shorts(0..24), implicit);
    bytes
}

fn element(bytes: &mut Vec<u8>, tag: (u16, u16), vr: &str, value: &[u8], implicit: bool) {
    bytes.extend(tag.0.to_le_bytes());
    bytes.extend(tag.1.to_le_bytes());
    let length = value.len() as u32;
    match (implicit, vr) {
        (true, _) => bytes.extend(length.to_le_bytes()),
        (false, "SQ" | "OW" | "OB") => {
            bytes.extend(vr.as_bytes());
            bytes.extend([0, 0]);
            bytes.extend(length.to_le_bytes());
        }
        (false, _) => {
            bytes.extend(vr.as_bytes());
            bytes.extend((length as u16).to_le_bytes());
        }
    }
    bytes.extend(value);
}

fn multipart_corpus() -> Vec<Vec<u8>> {
    let part = |name: &str, file: &str, content: &[u8]| {
        let mut bytes = Vec::new();
        let head = "Content-Disposition: form-data";
        write!(
            bytes,
            "--X\r\n{head}; name=\"{name}\"; filename=\"{file}\"\r\n\r\n"
        )
        .unwrap();
        bytes.extend(content);
        bytes.extend(b"\r\n");
        bytes
    };
    let volume = &nifti_corpus()[0];
    let end = b"--X--\r\n".to_vec();
    vec![
        [part("file", "v.nii", volume), end.clone()].concat(),
        [
            part("a", "v.hdr", &volume[..348]),
            part("b", "v.img", &volume[352..]),
            end.clone(),
        ]
        .concat(),
        [
            b"--X\r\nContent-Disposition: form-data; name=\"points\"\r\n\r\n12\r\n".to_vec(),
            end,
        ]
        .concat(),
    ]
}
