//! Real and odd DICOM files, against what pydicom 3 reads of them.

use crate::shared_data::shared_data;
use std::path::Path;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::{
    self, AffineSource, FileFormat, ReadLimits, ReadOptions, Reading, VolumeFile,
};

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
const PATIENT_FILES: &[(&str, f64, [f64; 3])] = &[
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
    let Some(folder) = shared_data("clinical") else {
        return;
    };
    for (name, sum, position) in PATIENT_FILES {
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
    let Some(folder) = shared_data("clinical") else {
        return;
    };
    let name = PATIENT_FILES[1].0;
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

/// File, slices, sum of the values with slope and intercept, and the diagonal of the affine: computed
/// with pydicom 3 and its decoders, voxels of the Pixel Padding Value as -1000 HU.
const ODD_FILES: &[(&str, usize, f64, [f64; 3])] = &[
    (
        "D_CLUNIE_CT1_RLE_FRAGS.dcm",
        1,
        -115_524_515.0,
        CT_SPACING_MM,
    ),
    (
        "GH177_D_CLUNIE_CT1_IVRLE_BigEndian_ELE_undefinded_length.dcm",
        1,
        -115_524_515.0,
        CT_SPACING_MM,
    ),
    (
        "GH177_D_CLUNIE_CT1_IVRLE_BigEndian_undefined_length.dcm",
        1,
        -115_524_515.0,
        CT_SPACING_MM,
    ),
    ("GH184.dcm", 1, 3_228_937.134_038, PET_SPACING_MM),
    ("GH610.dcm", 1, 1.166_530_305_741_4, PET_SPACING_MM),
    ("CT_small.dcm", 1, -1_950_906.0, CT_SPACING_MM),
    (
        "J2K_pixelrep_mismatch.dcm",
        1,
        -172_605_258.0,
        TILTED_SPACING_MM,
    ),
    ("MR_small.dcm", 1, 2_125_338.0, MR_SPACING_MM),
    ("MR_small_RLE.dcm", 1, 2_125_338.0, MR_SPACING_MM),
    ("MR_small_bigendian.dcm", 1, 2_125_338.0, MR_SPACING_MM),
    ("MR_small_expb.dcm", 1, 2_125_338.0, MR_SPACING_MM),
    ("MR_small_implicit.dcm", 1, 2_125_338.0, MR_SPACING_MM),
    ("MR_small_jp2klossless.dcm", 1, 2_125_338.0, MR_SPACING_MM),
    (
        "MR_small_jpeg_ls_lossless.dcm",
        1,
        2_125_338.0,
        MR_SPACING_MM,
    ),
    ("MR_small_padded.dcm", 1, 2_125_338.0, MR_SPACING_MM),
    (
        "bad_sequence.dcm",
        1,
        -20_086_954.0,
        [0.287_109_375, 0.287_109_375, 1.0],
    ),
    (
        "eCT_Supplemental.dcm",
        2,
        -337_621_504.0,
        [-0.388672, 0.388672, -10.0],
    ),
    ("liver.dcm", 3, 107_098.0, [0.810547, 0.810547, 1.0]),
    ("liver_1frame.dcm", 1, 36_233.0, [0.810547, 0.810547, 1.0]),
    ("zipMR.gz", 1, 2_125_338.0, MR_SPACING_MM),
];

const CT_SPACING_MM: [f64; 3] = [0.661_468, 0.661_468, 5.0];
const PET_SPACING_MM: [f64; 3] = [5.468_75, 5.468_75, 3.27];
const TILTED_SPACING_MM: [f64; 3] = [0.431, 0.399618, 4.635942];
const MR_SPACING_MM: [f64; 3] = [0.3125, 0.3125, 0.8];

#[test]
fn odd_files_are_read_as_by_pydicom_or_refused_and_none_panics() {
    let Some(folder) = shared_data("dicom") else {
        return;
    };
    let (mut seen, mut right, mut projections) = (0, 0, 0);
    for part in ["nm", "odd_pydicom", "odd_fodicom"] {
        for entry in std::fs::read_dir(folder.join(part)).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy();
            seen += 1;
            let known = ODD_FILES.iter().find(|(odd, ..)| *odd == name);
            match (read(&path), known) {
                (Ok(reading), Some((_, slices, sum, diagonal))) => {
                    let facts = reading.facts;
                    assert_eq!(facts.shape[2], *slices, "{name}");
                    let off = (facts.intensity.sum - sum).abs();
                    // Rescale Slope is read in single precision, as NIfTI has it.
                    let precision = f64::from(f32::EPSILON);
                    assert!(
                        off <= precision * sum.abs(),
                        "{name}: {}",
                        facts.intensity.sum
                    );
                    let m = facts.affine_lps;
                    let found = [m[(0, 0)], m[(1, 1)], m[(2, 2)]];
                    let near = |(a, b): (f64, &f64)| (a - b).abs() < 1e-4;
                    assert!(
                        found.into_iter().zip(diagonal).all(near),
                        "{name}: {found:?}"
                    );
                    assert_eq!(facts.affine_source, AffineSource::ImagePosition);
                    right += 1;
                }
                // Its slices are made here; pydicom reads projections.
                (Ok(reading), None) if reading.facts.format == FileFormat::DicomProjections => {
                    assert_eq!(reading.facts.shape, [64; 3], "{name}");
                    projections += 1;
                }
                (Err(error), None) => assert!(error.to_string().contains(&*name), "{error}"),
                (result, _) => panic!("{name}: {:?}", result.map(|reading| reading.facts)),
            }
        }
    }
    assert!(seen > 60);
    assert_eq!((right, projections), (ODD_FILES.len(), 1));
}

#[test]
fn refusals_tell_the_reason() {
    let Some(folder) = shared_data("dicom") else {
        return;
    };
    for (file, part) in [
        ("odd_pydicom/JPEG2000.dcm", "Secondary Capture Image"),
        ("odd_pydicom/rtdose_rle.dcm", "modality RTDOSE"),
        ("odd_pydicom/image_dfl.dcm", "Secondary Capture Image"),
        ("odd_pydicom/JPGExtended.dcm", "JPEG Extended"),
        (
            "odd_pydicom/rtstruct.dcm",
            "contours, not voxels; send the image series",
        ),
        ("odd_pydicom/rtplan_truncated.dcm", "an RT Plan"),
        (
            "odd_pydicom/MR_truncated.dcm",
            "it needs 9692 bytes and has at most 9630",
        ),
        ("odd_fodicom/DICOMDIR", "send the image files that it lists"),
    ] {
        let error = read(&folder.join(file)).unwrap_err().to_string();
        assert!(error.contains(part), "{file}: {error}");
    }
}
