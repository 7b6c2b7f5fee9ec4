//! The segments that a segmentation describes.

/// A segment of a segmentation, as its file describes it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Segment {
    /// Segment Number: the value of its voxels.
    pub number: u16,
    /// Segment Label.
    pub label: Option<String>,
    /// Codes of its type, then of its anatomic region, as far as stated.
    pub codes: Vec<SegmentCode>,
}

/// A coded concept of a segment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SegmentCode {
    /// Code Value.
    pub value: String,
    /// Code Meaning.
    pub meaning: String,
}
