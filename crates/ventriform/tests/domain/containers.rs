//! The same voxels give the same segmentation, whatever file they come in.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use serde_json::Value;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PhantomParameters, phantom};
use ventriform::image::volume::{ReadLimits, Volume, VolumeFile};
use ventriform::parameters::FitParameters;
use ventriform::results::export::Format;
use ventriform::runs::segmentation::{NamedFile, SegmentationOrder, from_files};

/// One element of a DICOM file, explicit VR, little endian.
fn element(group: u16, number: u16, vr: &str, mut value: Vec<u8>) -> Vec<u8> {
    if value.len() % 2 == 1 {
        value.push(if vr == "UI" { 0 } else { b' ' });
    }
    let mut bytes = [group.to_le_bytes(), number.to_le_bytes()].concat();
    bytes.extend(vr.as_bytes());
    if matches!(vr, "SQ" | "OW") {
        bytes.extend([0, 0]);
        bytes.extend((value.len() as u32).to_le_bytes());
    } else {
        bytes.extend((value.len() as u16).to_le_bytes());
    }
    bytes.extend(value);
    bytes
}

fn text(group: u16, number: u16, vr: &str, value: impl ToString) -> Vec<u8> {
    element(group, number, vr, value.to_string().into_bytes())
}

fn shorts(group: u16, number: u16, vr: &str, values: impl IntoIterator<Item = u16>) -> Vec<u8> {
    let bytes = values.into_iter().flat_map(u16::to_le_bytes).collect();
    element(group, number, vr, bytes)
}

/// `volume`, with whole numbers as voxels and axial slices, as a reconstructed tomogram. `position` is
/// that of its first voxel, as decimals.
fn dicom(volume: &Volume, position: [&str; 3], spacing: [&str; 3]) -> Vec<u8> {
    let [columns, rows, slices] = volume.shape.map(|n| n as u16);
    let detector = [
        text(0x20, 0x32, "DS", position.join("\\")),
        text(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0"),
    ]
    .concat();
    let item = [
        &[0xfe, 0xff, 0x00, 0xe0][..],
        &(detector.len() as u32).to_le_bytes(),
        &detector,
    ]
    .concat();
    let [x, y, z] = spacing;
    let set = [
        text(0x08, 0x08, "CS", "ORIGINAL\\PRIMARY\\RECON TOMO\\EMISSION"),
        text(0x08, 0x16, "UI", "1.2.840.10008.5.1.4.1.1.20"),
        text(0x08, 0x60, "CS", "NM"),
        text(0x18, 0x88, "DS", z),
        shorts(0x28, 0x02, "US", [1]),
        text(0x28, 0x08, "IS", slices),
        shorts(0x28, 0x09, "AT", [0x54, 0x80]),
        shorts(0x28, 0x10, "US", [rows]),
        shorts(0x28, 0x11, "US", [columns]),
        text(0x28, 0x30, "DS", format!("{y}\\{x}")),
        shorts(0x28, 0x100, "US", [16]),
        shorts(0x28, 0x101, "US", [16]),
        shorts(0x28, 0x102, "US", [15]),
        shorts(0x28, 0x103, "US", [0]),
        element(0x54, 0x22, "SQ", item),
        shorts(0x54, 0x80, "US", 1..=slices),
        shorts(0x7fe0, 0x10, "OW", volume.voxels.iter().map(|v| *v as u16)),
    ];
    let meta = text(2, 0x10, "UI", "1.2.840.10008.1.2.1");
    [vec![0; 128], b"DICM".to_vec(), meta, set.concat()].concat()
}

fn segmented(file: VolumeFile) -> Vec<NamedFile> {
    let parameters = FitParameters::default();
    let files = [file];
    let order = SegmentationOrder::of_built_in_hearts(&files, &parameters);
    let monitor = Monitor::silent();
    let made = from_files(&order, &ReadLimits::default(), &monitor).unwrap();
    made.files(&Format::ALL, None, &monitor).unwrap()
}

/// The report without the facts of the file.
fn report(file: &NamedFile) -> Value {
    let mut report: Value = serde_json::from_slice(&file.bytes).unwrap();
    let object = report.as_object_mut().unwrap();
    object.remove("input").unwrap();
    report
}

#[test]
fn equal_voxels_give_equal_bytes_whatever_the_container() {
    let parameters = PhantomParameters {
        shape: [64; 3],
        ..PhantomParameters::default()
    };
    let mut scan = phantom(&parameters, &Monitor::silent()).unwrap().volume;
    let most = scan.voxels.iter().copied().fold(0.0, f32::max);
    for value in &mut scan.voxels {
        *value = (value.max(0.0) / most * 20_000.0).round();
    }
    scan.integral = true;
    // Decimals that single precision does not hold exactly.
    let (position, spacing) = (
        ["-104.742228", "-96.311045", "629.8"],
        ["3.2999", "3.3", "3.3"],
    );
    let number = |text: &str| text.parse::<f64>().unwrap();
    let linear = nalgebra::Matrix3::from_diagonal(&Vec3::from(spacing.map(number)));
    scan.frame = VoxelToPatient::new(linear, Vec3::from(position.map(number))).unwrap();
    let files = [
        VolumeFile::in_memory("scan.dcm", dicom(&scan, position, spacing)),
        VolumeFile::in_memory(
            "short.nii.gz",
            nifti::write(&scan, StoredType::Int16, true).unwrap(),
        ),
        VolumeFile::in_memory(
            "float.nii",
            nifti::write(&scan, StoredType::Float32, false).unwrap(),
        ),
        VolumeFile::of_arrays("the array", [scan]),
    ];
    let [first, others @ ..] = files.map(segmented);
    for other in others {
        assert_eq!(first.len(), other.len());
        for (a, b) in first.iter().zip(&other) {
            assert_eq!(a.name, b.name);
            if a.name == "report.json" {
                assert_eq!(report(a), report(b));
            } else {
                assert!(a.bytes == b.bytes, "{}", a.name);
            }
        }
    }
}

#[test]
fn the_sign_of_a_zero_in_the_frame_leaves_no_trace_in_a_file() {
    let parameters = PhantomParameters {
        shape: [64; 3],
        ..PhantomParameters::default()
    };
    let mut scan = phantom(&parameters, &Monitor::silent()).unwrap().volume;
    let mut written = |zero: f64| {
        let columns = [[4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, zero, -4.0]];
        let linear = nalgebra::Matrix3::from_columns(&columns.map(Vec3::from));
        scan.frame = VoxelToPatient::new(linear, Vec3::new(1.0, 2.0, 3.0)).unwrap();
        nifti::write(&scan, StoredType::Float32, false).unwrap()
    };
    assert!(written(0.0) == written(-0.0));
}
