//! DICOM files made in code: Nuclear Medicine slices of a simulated scan.

use std::sync::OnceLock;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::Volume;
use ventriform::image::volume::phantom::{Phantom, PhantomParameters, phantom};

/// An element of a data set in Explicit VR Little Endian.
pub fn element(group: u16, number: u16, vr: &str, value: &[u8]) -> Vec<u8> {
    let mut value = value.to_vec();
    if value.len() % 2 == 1 {
        value.push(if vr == "UI" { 0 } else { b' ' });
    }
    let mut bytes = [group.to_le_bytes(), number.to_le_bytes()].concat();
    bytes.extend(vr.as_bytes());
    match vr {
        "OB" | "OW" | "SQ" => {
            bytes.extend([0, 0]);
            bytes.extend(u32::try_from(value.len()).unwrap().to_le_bytes());
        }
        _ => bytes.extend(u16::try_from(value.len()).unwrap().to_le_bytes()),
    }
    bytes.extend(value);
    bytes
}

/// A file with these elements, which rise by their tags.
pub fn file(elements: &[Vec<u8>]) -> Vec<u8> {
    file_in("1.2.840.10008.1.2.1", elements)
}

/// The same in another transfer syntax, whose encoding the elements have.
pub fn file_in(syntax: &str, elements: &[Vec<u8>]) -> Vec<u8> {
    let syntax = element(2, 0x10, "UI", syntax.as_bytes());
    let length = u32::try_from(syntax.len()).unwrap().to_le_bytes();
    let group_length = element(2, 0, "UL", &length);
    [
        vec![0; 128],
        b"DICM".to_vec(),
        group_length,
        syntax,
        elements.concat(),
    ]
    .concat()
}

/// Whose scan the made file is.
pub struct Patient {
    /// Patient's Name.
    pub name: &'static str,
    /// Patient ID.
    pub id: &'static str,
    /// Study Instance UID; series, instance and Frame of Reference are below it.
    pub study: &'static str,
    /// Accession Number.
    pub accession: &'static str,
}

/// A patient of no name.
pub const JANE: Patient = Patient {
    name: "Doe^Jane",
    id: "PAT-4711",
    study: "1.2.840.99999.7",
    accession: "ACC-2026-17",
};

/// The greatest voxel of a made Nuclear Medicine Image.
pub const NM_GREATEST: f32 = 30_000.0;

/// The simulated heart that [`nm`] shows, and its true mask.
pub fn simulated() -> &'static Phantom {
    static SIMULATED_HEART: OnceLock<Phantom> = OnceLock::new();
    SIMULATED_HEART.get_or_init(|| {
        let parameters = PhantomParameters {
            shape: [64; 3],
            ..PhantomParameters::default()
        };
        phantom(&parameters, &Monitor::silent()).unwrap()
    })
}

/// A scan of `gates` equal gates (one is not gated) as a Nuclear Medicine Image.
pub fn nm(patient: &Patient, gates: usize) -> Vec<u8> {
    nm_of(patient, &vec![&simulated().volume; gates])
}

/// Gates on one grid (one is not gated) as a Nuclear Medicine Image.
pub fn nm_of(patient: &Patient, volumes: &[&Volume]) -> Vec<u8> {
    nm_numbered(patient, volumes, None)
}

/// The same as the instance of that number of its series, which holds gates: it is gated also if there is one.
pub fn nm_numbered(patient: &Patient, volumes: &[&Volume], number: Option<usize>) -> Vec<u8> {
    let (volume, gates) = (volumes[0], volumes.len());
    let [columns, rows, slices] = volume.shape;
    let matrix = volume.frame.matrix();
    let text = |numbers: &[f64]| {
        let texts: Vec<String> = numbers.iter().map(f64::to_string).collect();
        texts.join("\\").into_bytes()
    };
    let step = |axis: usize| [0, 1, 2].map(|row| matrix[(row, axis)]);
    let length = |axis: usize| step(axis).iter().map(|x| x * x).sum::<f64>().sqrt();
    let cosines = [0, 1].map(|axis| step(axis).map(|x| x / length(axis)));
    let detector = [
        element(
            0x20,
            0x32,
            "DS",
            &text(&[0, 1, 2].map(|row| matrix[(row, 3)])),
        ),
        element(0x20, 0x37, "DS", &text(cosines.as_flattened())),
    ]
    .concat();
    let drug = element(0x18, 0x1074, "DS", b"740");
    let shorts =
        |numbers: &[u16]| -> Vec<u8> { numbers.iter().flat_map(|n| n.to_le_bytes()).collect() };
    let short = |number: usize| shorts(&[u16::try_from(number).unwrap()]);
    let voxels = || volumes.iter().flat_map(|volume| &volume.voxels);
    let greatest = voxels().copied().fold(0.0, f32::max);
    let voxels: Vec<u16> = voxels()
        .map(|v| (v / greatest * NM_GREATEST).round() as u16)
        .collect();
    let each = |gate: usize, slice: usize| (gate as u16 + 1, slice as u16 + 1);
    let frames: Vec<(u16, u16)> = (0..gates)
        .flat_map(|gate| (0..slices).map(move |slice| each(gate, slice)))
        .collect();
    let of_gates: Vec<u16> = frames.iter().map(|(gate, _)| *gate).collect();
    let of_slices: Vec<u16> = frames.iter().map(|(_, slice)| *slice).collect();
    let ones = vec![1; frames.len()];
    let gated = gates > 1 || number.is_some();
    let (kind, vectors) = if gated {
        ("RECON GATED TOMO", vec![0x54, 0x60, 0x54, 0x70, 0x54, 0x80])
    } else {
        ("RECON TOMO", vec![0x54, 0x80])
    };
    let below = |number: usize| format!("{}.{number}", patient.study).into_bytes();
    let instance = match number {
        None => below(3),
        Some(number) => [below(3), format!(".{number}").into_bytes()].concat(),
    };
    let mut elements = vec![
        element(
            0x08,
            0x08,
            "CS",
            format!("ORIGINAL\\PRIMARY\\{kind}\\EMISSION").as_bytes(),
        ),
        element(0x08, 0x16, "UI", b"1.2.840.10008.5.1.4.1.1.20"),
        element(0x08, 0x18, "UI", &instance),
        element(0x08, 0x20, "DA", b"20261101"),
        element(0x08, 0x22, "DA", b"20261102"),
        element(0x08, 0x30, "TM", b"101500"),
        element(0x08, 0x50, "SH", patient.accession.as_bytes()),
        element(0x08, 0x60, "CS", b"NM"),
        element(0x08, 0x70, "LO", b"Maker"),
        element(0x08, 0x90, "PN", b"Referrer^Ann"),
        element(0x08, 0x103e, "LO", b"STRESS TOMO"),
        element(0x10, 0x10, "PN", patient.name.as_bytes()),
        element(0x10, 0x20, "LO", patient.id.as_bytes()),
        element(0x10, 0x30, "DA", b"19500102"),
        element(0x10, 0x40, "CS", b"F"),
        element(0x18, 0x50, "DS", &text(&[length(2)])),
        element(0x18, 0x88, "DS", &text(&[length(2)])),
        element(0x20, 0x0d, "UI", patient.study.as_bytes()),
        element(0x20, 0x0e, "UI", &below(2)),
        element(0x20, 0x10, "SH", b"S1"),
        number.map_or_else(Vec::new, |number| {
            element(0x20, 0x13, "IS", number.to_string().as_bytes())
        }),
        element(0x20, 0x52, "UI", &below(4)),
        element(0x28, 0x02, "US", &short(1)),
        element(0x28, 0x08, "IS", frames.len().to_string().as_bytes()),
        element(0x28, 0x09, "AT", &shorts(&vectors)),
        element(0x28, 0x10, "US", &short(rows)),
        element(0x28, 0x11, "US", &short(columns)),
        element(0x28, 0x30, "DS", &text(&[length(1), length(0)])),
        element(0x28, 0x100, "US", &short(16)),
        element(0x28, 0x101, "US", &short(16)),
        element(0x28, 0x102, "US", &short(15)),
        element(0x28, 0x103, "US", &short(0)),
        element(0x54, 0x16, "SQ", &item(drug)),
        element(0x54, 0x22, "SQ", &item(detector)),
    ];
    if gated {
        elements.push(element(0x54, 0x60, "US", &shorts(&ones)));
        elements.push(element(0x54, 0x70, "US", &shorts(&of_gates)));
    }
    elements.push(element(0x54, 0x80, "US", &shorts(&of_slices)));
    elements.push(element(0x7fe0, 0x10, "OW", &shorts(&voxels)));
    file(&elements)
}

/// An item of a sequence.
fn item(content: Vec<u8>) -> Vec<u8> {
    let length = u32::try_from(content.len()).unwrap().to_le_bytes();
    [vec![0xfe, 0xff, 0x00, 0xe0], length.to_vec(), content].concat()
}

/// Whether the bytes contain that text.
pub fn contains(bytes: &[u8], text: &str) -> bool {
    bytes
        .windows(text.len())
        .any(|part| part == text.as_bytes())
}
