//! Parts of a Segmentation (PS3.3 A.51): its segments, and the functional groups of its frames.
//!
//! Each frame shows one slice of one segment. The dimensions are the segment's number, then the position of the slice.

use super::code::Code;
use super::data_set::DataSet;
use dicom_core::Tag;
use dicom_dictionary_std::tags;

/// A segment that an algorithm made.
#[derive(Debug, Clone, Copy)]
pub struct SegmentDescription<'a> {
    /// Segment Number (0062,0004), from 1.
    pub number: u16,
    /// Segment Label (0062,0005).
    pub label: &'a str,
    /// Category of the segmented property (CID 7150).
    pub category: Code,
    /// Its type.
    pub kind: Code,
    /// Tracking UID (0062,0021).
    pub tracking_uid: &'a str,
}

impl SegmentDescription<'_> {
    /// Puts the description into `segment`, the item of the Segment Sequence.
    pub fn put(&self, segment: &mut DataSet) {
        segment.short(tags::SEGMENT_NUMBER, self.number);
        segment.text(tags::SEGMENT_LABEL, self.label);
        segment.text(tags::SEGMENT_ALGORITHM_TYPE, "AUTOMATIC");
        segment.code(
            tags::SEGMENTED_PROPERTY_CATEGORY_CODE_SEQUENCE,
            self.category,
        );
        segment.code(tags::SEGMENTED_PROPERTY_TYPE_CODE_SEQUENCE, self.kind);
        segment.text(tags::TRACKING_ID, self.label);
        segment.text(tags::TRACKING_UID, self.tracking_uid);
    }
}

/// Puts the Multi-frame Dimension module into `set`; `organization` is its UID.
pub fn put_dimensions(organization: &str, set: &mut DataSet) {
    let mut item = DataSet::new();
    item.text(tags::DIMENSION_ORGANIZATION_UID, organization);
    set.item(tags::DIMENSION_ORGANIZATION_SEQUENCE, item);
    let index = |pointer: Tag, group: Tag, label: &str| {
        let mut item = DataSet::new();
        item.tag(tags::DIMENSION_INDEX_POINTER, pointer);
        item.tag(tags::FUNCTIONAL_GROUP_POINTER, group);
        item.text(tags::DIMENSION_ORGANIZATION_UID, organization);
        item.text(tags::DIMENSION_DESCRIPTION_LABEL, label);
        item
    };
    let segment = index(
        tags::REFERENCED_SEGMENT_NUMBER,
        tags::SEGMENT_IDENTIFICATION_SEQUENCE,
        "Segment Number",
    );
    let position = index(
        tags::IMAGE_POSITION_PATIENT,
        tags::PLANE_POSITION_SEQUENCE,
        "Image Position",
    );
    set.items(tags::DIMENSION_INDEX_SEQUENCE, vec![segment, position]);
}

/// The functional groups that all frames share: `spacing` of rows and of columns and `distance` of slices, mm, and the
/// direction cosines of a row and of a column.
pub fn shared_groups(spacing: [f64; 2], distance: f64, cosines: [f64; 6]) -> DataSet {
    let mut measures = DataSet::new();
    measures.decimals(tags::PIXEL_SPACING, &spacing);
    measures.decimals(tags::SLICE_THICKNESS, &[distance]);
    measures.decimals(tags::SPACING_BETWEEN_SLICES, &[distance]);
    let mut orientation = DataSet::new();
    orientation.decimals(tags::IMAGE_ORIENTATION_PATIENT, &cosines);
    let mut group = DataSet::new();
    group.item(tags::PIXEL_MEASURES_SEQUENCE, measures);
    group.item(tags::PLANE_ORIENTATION_SEQUENCE, orientation);
    group
}

/// The functional groups of the frame of segment `number` whose slice is the one at `place`, from 1, and whose first
/// pixel lies at `position`, LPS mm.
pub fn frame_groups(number: u16, place: u32, position: [f64; 3]) -> DataSet {
    let mut group = DataSet::new();
    let mut content = DataSet::new();
    content.longs(tags::DIMENSION_INDEX_VALUES, vec![number.into(), place]);
    group.item(tags::FRAME_CONTENT_SEQUENCE, content);
    let mut plane = DataSet::new();
    plane.decimals(tags::IMAGE_POSITION_PATIENT, &position);
    group.item(tags::PLANE_POSITION_SEQUENCE, plane);
    let mut segment = DataSet::new();
    segment.short(tags::REFERENCED_SEGMENT_NUMBER, number);
    group.item(tags::SEGMENT_IDENTIFICATION_SEQUENCE, segment);
    group
}
