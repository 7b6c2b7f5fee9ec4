//! Real and odd DICOM files, against what pydicom 3 reads of them.

use std::path::{Path, PathBuf};
use ventriform::progress::Monitor;
use ventriform::volume::{self, AffineSource, ReadLimits, ReadOptions, Reading, VolumeFile};

/// A folder of the test data, unless it is absent.
fn data(folder: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared/data")
        .join(folder);
    if !path.is_dir() {
        eprintln!("skipped: ../shared/data/{folder} is absent");
        return None;
    }
    Some(path)
}

fn read(path: &Path) -> Result<Reading, volume::VolumeError> {
    let options = ReadOptions::default();
    let limits = ReadLimits::default();
    volume::read(
        &[VolumeFile::at(path)],
        &options,
        &limits,
        &Monitor::silent(),
    )
}

/// File, sum of the pixels, Image Position (Patient): computed with pydicom 3.
const PATIENTS: &[(&str, f64, [f64; 3])] = &[
    (
        "1.2.840.4267.32.117076509617201664779117387663005758527",
        353_947_599.0,
        [-74.742228, -176.311045, 629.8],
    ),
    (
        "1.2.840.4267.32.118564058634314627767242469443335771432",
        349_387_163.0,
        [-65.54984, -185.503433, 501.6],
    ),
    (
        "1.2.840.4267.32.118665136185166160396570866271079771944",
        388_444_269.0,
        [-57.771666, -193.281607, 592.6],
    ),
];

#[test]
fn patients_are_read_with_their_signed_spacing() {
    let Some(folder) = data("clinical") else {
        return;
    };
    for (name, sum, position) in PATIENTS {
        let reading = read(&folder.join(format!("{name}.dcm"))).unwrap();
        let facts = reading.facts;
        assert_eq!(facts.shape, [70, 70, 50]);
        assert_eq!(facts.intensity.sum, *sum);
        assert_eq!(facts.affine_source, AffineSource::ImagePosition);
        assert_eq!(facts.warnings, Vec::<String>::new());
        let m = facts.affine_lps;
        assert_eq!([m[(0, 0)], m[(1, 1)], m[(2, 2)]], [4.0, 4.0, -4.0]);
        // In single precision, as NIfTI would store it.
        let position = position.map(|x| f64::from(x as f32));
        assert_eq!([m[(0, 3)], m[(1, 3)], m[(2, 3)]], position);
    }
}

#[test]
fn the_experts_mask_lies_on_the_heart() {
    let Some(folder) = data("clinical") else {
        return;
    };
    let name = PATIENTS[1].0;
    let scan = read(&folder.join(format!("{name}.dcm"))).unwrap().volume;
    let mask = read(&folder.join(format!("{name}_mask.nii.gz"))).unwrap();
    assert_eq!(mask.facts.intensity.labels.map(|l| l.len()), Some(1));
    let mask = mask.volume;
    let apart = (scan.frame.matrix() - mask.frame.matrix()).abs().max();
    assert!(apart < 1e-4, "the grids are the same: {apart}");
    let inside = scan
        .voxels
        .iter()
        .zip(&mask.voxels)
        .filter(|(_, m)| **m == 1.0);
    let (sum, count) = inside.fold((0.0, 0), |(s, n), (v, _)| (s + f64::from(*v), n + 1));
    // Mirrored in any axis, the mean inside the mask would be 10038 at best.
    assert!((sum / f64::from(count) - 11_583.09).abs() < 0.01);
}

#[test]
fn odd_files_are_refused_and_none_panics() {
    let Some(folder) = data("dicom") else { return };
    let mut seen = 0;
    for part in ["nm", "odd_pydicom", "odd_fodicom"] {
        for entry in std::fs::read_dir(folder.join(part)).unwrap() {
            let path = entry.unwrap().path();
            let error = read(&path)
                .err()
                .unwrap_or_else(|| panic!("{path:?} was read"));
            let name = path.file_name().unwrap().to_string_lossy();
            assert!(error.to_string().contains(&*name), "{error}");
            seen += 1;
        }
    }
    assert!(seen > 60);
}

#[test]
fn refusals_tell_the_reason() {
    let Some(folder) = data("dicom") else { return };
    for (file, part) in [
        (
            "nm/tomo_projections_cardiac_stress_GE.dcm",
            "projections acquired around the patient",
        ),
        ("odd_pydicom/JPEG2000.dcm", "JPEG 2000 Image Compression"),
        ("odd_pydicom/rtdose_rle.dcm", "RLE Lossless"),
        (
            "odd_pydicom/image_dfl.dcm",
            "Deflated Explicit VR Little Endian",
        ),
        ("odd_pydicom/liver.dcm", "modality: SEG"),
        ("odd_pydicom/MR_small_bigendian.dcm", "modality: MR"),
        ("odd_pydicom/rtstruct.dcm", "modality: RTSTRUCT"),
        (
            "odd_pydicom/MR_truncated.dcm",
            "it needs 9692 bytes and has at most 9630",
        ),
        (
            "odd_fodicom/DICOMDIR",
            "SOP Class UID (0008,0016) is missing",
        ),
    ] {
        let error = read(&folder.join(file)).unwrap_err().to_string();
        assert!(error.contains(part), "{file}: {error}");
    }
}
