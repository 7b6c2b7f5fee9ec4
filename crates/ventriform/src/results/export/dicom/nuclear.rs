//! Nuclear Medicine Image Storage (PS3.3 A.5, C.8.4): slices that were reconstructed here as RECON TOMO, or of gates
//! RECON GATED TOMO, in the patient and study of the projections; and projections that were simulated as TOMO.
//!
//! Slices follow each other along the normal of their rows and columns, gate after gate. Pixels are whole numbers of 16
//! bits; the Real World Value Mapping Sequence says how many counts one of them is.

use super::{DicomError, ObjectFacts, SourceScan, put_facts};
use crate::base::geometry::Vec3;
use crate::image::reconstruct::Projections;
use crate::image::volume::Volume;
use ventriform_dicom::write::code::Code;
use ventriform_dicom::write::data_set::DataSet;
use ventriform_dicom::write::image::PixelFormat;
use ventriform_dicom::write::uid::Uids;
use ventriform_dicom::{tags, uids};

/// Greatest pixel.
const MOST: f32 = 65_535.0;

/// `volumes`, the only one or those of all gates, each `gate_ms` long, as a file of `scan`, whose series is described so;
/// `derivation` says how they were made.
///
/// # Errors
/// [`DicomError`], also for a grid whose axes are not at right angles or whose slices do not follow their normal.
pub fn nuclear_image(
    scan: &SourceScan,
    volumes: &[Volume],
    gate_ms: Option<f64>,
    description: &str,
    derivation: &str,
) -> Result<Vec<u8>, DicomError> {
    scan.check()?;
    let [nx, ny, nz] = scan.shape;
    let (columns, rows, slices) = (side(nx)?, side(ny)?, side(nz)?);
    let gates = side(volumes.len())?;
    let spacing = scan.frame.spacing();
    let origin = scan.frame.to_patient(&Vec3::zeros());
    let direction =
        |axis: usize| (scan.frame.to_patient(&Vec3::ith(axis, 1.0)) - origin) / spacing[axis];
    let (right, down, next) = (direction(0), direction(1), direction(2));
    let normal = right.cross(&down);
    if right.dot(&down).abs() > 1e-6 || (normal - next).norm() > 1e-6 {
        return Err(DicomError::Oblique);
    }
    let values = || volumes.iter().flat_map(|volume| volume.voxels.iter());
    let most = values().copied().fold(0.0, f32::max);
    let per_pixel = if most > 0.0 { most / MOST } else { 1.0 };
    let mut pixels = Vec::with_capacity(2 * nx * ny * nz * volumes.len());
    for value in values() {
        let stored = (value / per_pixel).round().clamp(0.0, MOST) as u16;
        pixels.extend(stored.to_le_bytes());
    }
    let names = Uids::over_all(|add| {
        add(env!("CARGO_PKG_VERSION").as_bytes());
        scan.add_to(add);
        add(description.as_bytes());
        add(derivation.as_bytes());
        add(&pixels);
    });

    let counts: f64 = values().map(|value| f64::from(*value)).sum();
    let kind = if gates > 1 {
        "RECON GATED TOMO"
    } else {
        "RECON TOMO"
    };
    let mut set = common(scan, &format!("DERIVED\\PRIMARY\\{kind}\\EMISSION"), counts);
    set.text(tags::DERIVATION_DESCRIPTION, derivation);
    scan.put_sources(&mut set);
    set.items(tags::ROTATION_INFORMATION_SEQUENCE, Vec::new());

    let mut detector = DataSet::new();
    detector.text(tags::COLLIMATOR_TYPE, "PARA");
    detector.decimals(
        tags::IMAGE_POSITION_PATIENT,
        &[origin.x, origin.y, origin.z],
    );
    let orientation = [right.x, right.y, right.z, down.x, down.y, down.z];
    detector.decimals(tags::IMAGE_ORIENTATION_PATIENT, &orientation);
    set.item(tags::DETECTOR_INFORMATION_SEQUENCE, detector);

    set.decimals(tags::SPACING_BETWEEN_SLICES, &[spacing[2]]);
    set.decimals(tags::SLICE_THICKNESS, &[spacing[2]]);
    set.decimals(tags::PIXEL_SPACING, &[spacing[1], spacing[0]]);
    let frames = nz * volumes.len();
    set.text(tags::NUMBER_OF_FRAMES, frames.to_string());
    set.short(tags::NUMBER_OF_DETECTORS, 1);
    set.short(tags::NUMBER_OF_SLICES, slices);
    let of_frames = |number: &dyn Fn(usize) -> u16| (0..frames).map(number).collect::<Vec<u16>>();
    let slice_vector = of_frames(&|frame| number(frame % nz));
    if gates > 1 {
        let pointers = [
            tags::RR_INTERVAL_VECTOR,
            tags::TIME_SLOT_VECTOR,
            tags::SLICE_VECTOR,
        ];
        set.tags(tags::FRAME_INCREMENT_POINTER, &pointers);
        set.shorts(tags::RR_INTERVAL_VECTOR, &vec![1; frames]);
        set.shorts(
            tags::TIME_SLOT_VECTOR,
            &of_frames(&|frame| number(frame / nz)),
        );
        set.short(tags::NUMBER_OF_RR_INTERVALS, 1);
        set.short(tags::NUMBER_OF_TIME_SLOTS, gates);
        let mut data = DataSet::new();
        if let Some(ms) = gate_ms {
            data.decimals(tags::FRAME_TIME, &[ms]);
            let interval = (ms * f64::from(gates)).round();
            data.text(tags::NOMINAL_INTERVAL, format!("{interval:.0}"));
        }
        let mut gated = DataSet::new();
        gated.item(tags::DATA_INFORMATION_SEQUENCE, data);
        set.item(tags::GATED_INFORMATION_SEQUENCE, gated);
    } else {
        set.tag(tags::FRAME_INCREMENT_POINTER, tags::SLICE_VECTOR);
    }
    set.shorts(tags::SLICE_VECTOR, &slice_vector);
    set.item(tags::REAL_WORLD_VALUE_MAPPING_SEQUENCE, mapping(per_pixel));
    put_pixels(&mut set, [columns, rows], pixels);
    let instance = [names.uid("image"), names.uid("series of the image")];
    put_facts(scan, &FACTS, instance, description.into(), &mut set);
    Ok(set.file()?)
}

/// Projections as a file of `scan`: the views of each detector in their order, `detectors` of them, which turn alike.
///
/// # Errors
/// [`DicomError`].
pub fn nuclear_projections(
    scan: &SourceScan,
    projections: &Projections,
    detectors: usize,
    description: &str,
) -> Result<Vec<u8>, DicomError> {
    scan.check()?;
    let (columns, rows) = (side(projections.columns)?, side(projections.rows)?);
    let frames = projections.views.len();
    let each = frames / detectors.max(1);
    let (detector_count, view_count) = (side(detectors)?, side(each)?);
    let mut pixels = Vec::with_capacity(2 * projections.counts.len());
    for count in &projections.counts {
        pixels.extend((count.round().clamp(0.0, MOST) as u16).to_le_bytes());
    }
    let names = Uids::over_all(|add| {
        scan.add_to(add);
        add(&pixels);
    });
    let counts: f64 = (0..frames).map(|view| projections.counts_of(view)).sum();
    let mut set = common(scan, "ORIGINAL\\PRIMARY\\TOMO\\EMISSION", counts);
    let angle = |view: usize| projections.views[view].angle_deg;
    let step = angle(1.min(frames - 1)) - angle(0);
    let starts = (0..detectors).map(|detector| {
        let mut item = DataSet::new();
        item.text(tags::COLLIMATOR_TYPE, "PARA");
        item.empty(tags::IMAGE_POSITION_PATIENT);
        item.empty(tags::IMAGE_ORIENTATION_PATIENT);
        item.decimals(
            tags::START_ANGLE,
            &[angle(detector * each).rem_euclid(360.0)],
        );
        item
    });
    set.items(tags::DETECTOR_INFORMATION_SEQUENCE, starts.collect());
    let mut rotation = DataSet::new();
    rotation.decimals(tags::START_ANGLE, &[angle(0).rem_euclid(360.0)]);
    rotation.decimals(tags::ANGULAR_STEP, &[step.abs()]);
    rotation.text(
        tags::ROTATION_DIRECTION,
        if step < 0.0 { "CW" } else { "CC" },
    );
    rotation.decimals(tags::SCAN_ARC, &[step.abs() * each as f64]);
    rotation.text(tags::ACTUAL_FRAME_DURATION, "20000");
    rotation.short(tags::NUMBER_OF_FRAMES_IN_ROTATION, view_count);
    set.item(tags::ROTATION_INFORMATION_SEQUENCE, rotation);
    let mm = projections.pixel_mm;
    set.decimals(tags::PIXEL_SPACING, &[mm, mm]);
    set.text(tags::NUMBER_OF_FRAMES, frames.to_string());
    set.short(tags::NUMBER_OF_DETECTORS, detector_count);
    let pointers = [
        tags::ENERGY_WINDOW_VECTOR,
        tags::DETECTOR_VECTOR,
        tags::ROTATION_VECTOR,
        tags::ANGULAR_VIEW_VECTOR,
    ];
    set.tags(tags::FRAME_INCREMENT_POINTER, &pointers);
    set.shorts(tags::ENERGY_WINDOW_VECTOR, &vec![1; frames]);
    set.shorts(tags::ROTATION_VECTOR, &vec![1; frames]);
    let vector = |of: &dyn Fn(usize) -> u16| (0..frames).map(of).collect::<Vec<u16>>();
    set.shorts(
        tags::DETECTOR_VECTOR,
        &vector(&|frame| number(frame / each).min(detector_count)),
    );
    set.shorts(
        tags::ANGULAR_VIEW_VECTOR,
        &vector(&|frame| number(frame % each).min(view_count)),
    );
    put_pixels(&mut set, [columns, rows], pixels);
    let instance = [names.uid("image"), names.uid("series of the image")];
    put_facts(scan, &FACTS, instance, description.into(), &mut set);
    Ok(set.file()?)
}

/// What both kinds are.
const FACTS: ObjectFacts = ObjectFacts {
    name: "nuclear medicine image",
    class: uids::NUCLEAR_MEDICINE_IMAGE_STORAGE,
    modality: "NM",
    series: 9108,
    description: "projections",
};

/// A number that has 16 bits in a file.
fn side(length: usize) -> Result<u16, DicomError> {
    u16::try_from(length).map_err(|_| DicomError::TooLarge)
}

/// A number from 1 of one from 0.
fn number(at: usize) -> u16 {
    at as u16 + 1
}

/// The modules of an image of this type with so many counts, apart from detectors, rotations and pixels.
fn common(scan: &SourceScan, image_type: &str, counts: f64) -> DataSet {
    let mut set = DataSet::new();
    scan.put_made(&mut set);
    set.text(tags::IMAGE_TYPE, image_type);
    set.text(tags::LOSSY_IMAGE_COMPRESSION, "00");
    set.empty(tags::PATIENT_ORIENTATION);
    set.items(tags::PATIENT_ORIENTATION_CODE_SEQUENCE, Vec::new());
    set.items(tags::PATIENT_GANTRY_RELATIONSHIP_CODE_SEQUENCE, Vec::new());
    scan.put_frame_of_reference(&mut set);
    set.text(tags::COUNTS_ACCUMULATED, format!("{counts:.0}"));
    set.empty(tags::LATERALITY);
    set.short(tags::NUMBER_OF_ENERGY_WINDOWS, 1);
    set.short(tags::NUMBER_OF_ROTATIONS, 1);
    set.items(tags::ENERGY_WINDOW_INFORMATION_SEQUENCE, Vec::new());
    set.items(tags::RADIOPHARMACEUTICAL_INFORMATION_SEQUENCE, Vec::new());
    set
}

fn put_pixels(set: &mut DataSet, [columns, rows]: [u16; 2], pixels: Vec<u8>) {
    let format = PixelFormat {
        rows,
        columns,
        samples: 1,
        photometric: "MONOCHROME2",
        bits: 16,
    };
    format.put(set);
    set.words(tags::PIXEL_DATA, pixels);
}

/// The item that says how many counts a pixel's unit is.
fn mapping(per_pixel: f32) -> DataSet {
    const COUNTS: Code = Code::new("{counts}", "UCUM", "counts");
    let mut item = DataSet::new();
    item.short(tags::REAL_WORLD_VALUE_FIRST_VALUE_MAPPED, 0);
    item.short(tags::REAL_WORLD_VALUE_LAST_VALUE_MAPPED, MOST as u16);
    item.doubles(tags::REAL_WORLD_VALUE_INTERCEPT, &[0.0]);
    item.doubles(tags::REAL_WORLD_VALUE_SLOPE, &[f64::from(per_pixel)]);
    item.text(tags::LUT_EXPLANATION, "counts");
    item.text(tags::LUT_LABEL, "COUNTS");
    item.code(tags::MEASUREMENT_UNITS_CODE_SEQUENCE, COUNTS);
    item
}
