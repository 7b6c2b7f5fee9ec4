//! The mask as Segmentation Storage (PS3.3 A.51): one bit for each voxel. Segment 1 is the structure;
//! segment 2, of a ventricle, its cavity. No voxel is of both.
//!
//! Every slice of a segment is a frame, also where it is empty: viewers that count frames would otherwise
//! shift the mask. First come the frames of segment 1. Frames follow each other along row × column, against the order
//! of the slices if the volume is left-handed (negative Spacing Between Slices), and each has its own Image Position.
//! Each names the image or frame that its slice was read from, pixel for pixel (Spatial Locations Preserved), so that
//! readers find it by that.

use super::codes::{ANATOMICAL_STRUCTURE, LV_CAVITY, SEGMENTATION_STEP};
use super::source::for_processing;
use super::{CAVITY_CIELAB, DicomError, DicomResults, STRUCTURE_CIELAB, algorithm};
use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use crate::image::grid::voxelise::Mask;
use ventriform_dicom::tags;
use ventriform_dicom::write::data_set::DataSet;
use ventriform_dicom::write::image::{PixelFormat, packed_bits};
use ventriform_dicom::write::segmentation::{
    SegmentDescription, frame_groups, put_dimensions, shared_groups,
};

/// Rows, columns and positions of the slices of a volume as DICOM describes them.
pub(super) struct SlicePlanes {
    /// Direction of increasing column index, then of increasing row index; unit vectors.
    pub directions: [Vec3; 2],
    /// Distance of rows and of columns, mm.
    pub spacing: [f64; 2],
    /// Distance of the slices' planes, mm.
    pub distance: f64,
    /// Numbers of the slices in the order of their positions along row × column.
    pub order: Vec<usize>,
}

impl SlicePlanes {
    /// The planes of `slices` slices.
    ///
    /// # Errors
    /// [`DicomError::Oblique`] if rows and columns are not at right angles.
    pub(super) fn new(frame: &VoxelToPatient, slices: usize) -> Result<Self, DicomError> {
        let [columns, rows, next] = [0, 1, 2].map(|axis| frame.linear().column(axis).into_owned());
        let directions = [columns.normalize(), rows.normalize()];
        // The tolerance of readers for direction cosines.
        if directions[0].dot(&directions[1]).abs() > 1e-4 {
            return Err(DicomError::Oblique);
        }
        let along = next.dot(&directions[0].cross(&directions[1]).normalize());
        let mut order: Vec<usize> = (0..slices).collect();
        if along < 0.0 {
            order.reverse();
        }
        Ok(Self {
            directions,
            spacing: [rows.norm(), columns.norm()],
            distance: along.abs(),
            order,
        })
    }
}

/// Puts everything that is particular to this object.
pub(super) fn put(results: &DicomResults<'_>, set: &mut DataSet) -> Result<(), DicomError> {
    let scan = results.scan;
    let [columns, rows, slices] = scan.shape;
    let (Ok(rows), Ok(columns)) = (u16::try_from(rows), u16::try_from(columns)) else {
        return Err(DicomError::TooLarge);
    };
    let planes = SlicePlanes::new(&scan.frame, slices)?;
    scan.put_frame_of_reference(set);
    results.put_content(set);
    results.put_referenced_series(set);
    set.text(tags::IMAGE_TYPE, "DERIVED\\PRIMARY");
    let format = PixelFormat {
        rows,
        columns,
        samples: 1,
        photometric: "MONOCHROME2",
        bits: 1,
    };
    format.put(set);
    set.text(tags::LOSSY_IMAGE_COMPRESSION, "00");
    set.text(tags::SEGMENTATION_TYPE, "BINARY");
    let mut segment = DataSet::new();
    results.put_segment(&mut segment);
    put_look(&mut segment, STRUCTURE_CIELAB);
    let mut segments = vec![segment];
    let masks: Vec<&Mask> = [Some(results.mask), results.cavity]
        .into_iter()
        .flatten()
        .collect();
    if results.cavity.is_some() {
        let mut segment = DataSet::new();
        let tracking = results.uids.uid("tracking of the cavity");
        let description = SegmentDescription {
            number: 2,
            label: LV_CAVITY.meaning,
            category: ANATOMICAL_STRUCTURE,
            kind: LV_CAVITY,
            tracking_uid: &tracking,
        };
        description.put(&mut segment);
        put_look(&mut segment, CAVITY_CIELAB);
        segments.push(segment);
        set.text(tags::SEGMENTS_OVERLAP, "NO");
    }
    set.items(tags::SEGMENT_SEQUENCE, segments);

    put_dimensions(&results.uids.uid("dimensions"), set);
    set.text(tags::NUMBER_OF_FRAMES, (masks.len() * slices).to_string());
    let [x, y] = planes.directions;
    let cosines = [x.x, x.y, x.z, y.x, y.y, y.z];
    let shared = shared_groups(planes.spacing, planes.distance, cosines);
    set.item(tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE, shared);
    let numbers = 1..=masks.len() as u16;
    let frames = numbers.flat_map(|number| {
        let frames = planes.order.iter().enumerate();
        frames.map(move |(place, &k)| frame(results, number, place, k))
    });
    set.items(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE, frames.collect());
    set.bytes(
        tags::PIXEL_DATA,
        packed_bits(&pixels(&masks, &planes.order)),
    );
    Ok(())
}

/// By what a segment was made, and its colour.
fn put_look(segment: &mut DataSet, colour: [u16; 3]) {
    segment.text(tags::SEGMENT_ALGORITHM_NAME, "ventriform");
    segment.item(
        tags::SEGMENTATION_ALGORITHM_IDENTIFICATION_SEQUENCE,
        algorithm(),
    );
    segment.shorts(tags::RECOMMENDED_DISPLAY_CIE_LAB_VALUE, &colour);
}

/// The functional groups of a segment's frame at `place`, which shows slice `k`.
fn frame(results: &DicomResults<'_>, number: u16, place: usize, k: usize) -> DataSet {
    let first = Vec3::new(0.0, 0.0, k as f64);
    let corner = results.scan.frame.to_patient(&first);
    let mut group = frame_groups(number, place as u32 + 1, [corner.x, corner.y, corner.z]);
    if let Some(source) = results.scan.slice_reference(k) {
        let mut derivation = DataSet::new();
        let mut source = for_processing(source);
        // Rows, columns and slices are the scan's own.
        if results.scan.names_slice(k) {
            source.text(tags::SPATIAL_LOCATIONS_PRESERVED, "YES");
        }
        derivation.item(tags::SOURCE_IMAGE_SEQUENCE, source);
        derivation.code(tags::DERIVATION_CODE_SEQUENCE, SEGMENTATION_STEP);
        group.item(tags::DERIVATION_IMAGE_SEQUENCE, derivation);
    }
    group
}

/// The voxels of the slices of each mask in `order`.
fn pixels(masks: &[&Mask], order: &[usize]) -> Vec<bool> {
    let slices = masks.iter().flat_map(|mask| {
        let size = mask.shape[0] * mask.shape[1];
        order
            .iter()
            .map(move |k| &mask.voxels[k * size..(k + 1) * size])
    });
    slices.flatten().copied().collect()
}
