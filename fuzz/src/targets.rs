//! Targets that need no service, and the files that damage starts from. All files are made here.

use std::io::Write as _;
use ventriform::geometry::Vec3;
use ventriform::geometry::frame::VoxelToPatient;
use ventriform::parameters::{FitParameters, ModelParameters, Parameters};
use ventriform::progress::Monitor;
use ventriform::volume::nifti::{self as nifti_files, StoredType};
use ventriform::volume::{self, ReadLimits, ReadOptions, Volume, VolumeFile};

/// Small, so that a file that gets past them shows at once.
const LIMITS: ReadLimits = ReadLimits {
    voxels: 1 << 16,
    unpacked_bytes: 1 << 20,
};

/// Reads the bytes as a NIfTI file; what is read keeps its promises.
pub fn nifti(data: &[u8]) {
    read("volume.nii", data);
}

/// Reads the bytes as a DICOM file; what is read keeps its promises.
pub fn dicom(data: &[u8]) {
    read("volume.dcm", data);
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
        "dicom" => vec![dicom_file(false), dicom_file(true)],
        "parameters" => [
            r#"{"points": 24, "iso": "50%", "box": [0, 0, 0, 9, 9, 9], "method": "paper"}"#,
            r#"{"model": "auto", "organ": "liver", "center": [1.5, 2, 3], "margin": 0.5}"#,
            "points=12\niso=absolute:0.5\nseed-point=1,2,3\nw1=0",
            "model=tpl_0\nsuperior=frame\naxis=0,0,1\nbox=0,0,0,1,1,1",
        ]
        .map(|text| text.as_bytes().to_vec())
        .to_vec(),
        "multipart" => multipart_corpus(),
        other => panic!("no target `{other}`"),
    }
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

/// A multi-frame NM file of 2 × 3 × 4 voxels, with explicit or implicit value representations.
fn dicom_file(implicit: bool) -> Vec<u8> {
    let uid = match implicit {
        true => "1.2.840.10008.1.2\0",
        false => "1.2.840.10008.1.2.1\0",
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
        (false, "SQ" | "OW") => {
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
