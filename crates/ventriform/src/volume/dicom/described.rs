//! The segments of a Segmentation (Segment Sequence, PS3.3 C.8.20.4).

use super::attributes::{
    Attributes, SEGMENT_LABEL, SEGMENT_NUMBER, SEGMENT_REGION_MEANING, SEGMENT_REGION_VALUE,
    SEGMENT_TYPE_MEANING, SEGMENT_TYPE_VALUE,
};

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

impl Segment {
    /// The segments that `a` describes, in the order of the file.
    pub(super) fn all(a: &Attributes) -> Vec<Self> {
        let number = |item| a.shorts_of(SEGMENT_NUMBER, Some(item)).first().copied();
        let code = |item, value, meaning| {
            let [value, meaning] =
                [value, meaning].map(|attribute| a.prose_of(attribute, Some(item)));
            (value.is_some() || meaning.is_some()).then(|| SegmentCode {
                value: value.unwrap_or_default(),
                meaning: meaning.unwrap_or_default(),
            })
        };
        (0..)
            .map_while(|item| {
                Some(Self {
                    number: number(item)?,
                    label: a.prose_of(SEGMENT_LABEL, Some(item)),
                    codes: [
                        code(item, SEGMENT_TYPE_VALUE, SEGMENT_TYPE_MEANING),
                        code(item, SEGMENT_REGION_VALUE, SEGMENT_REGION_MEANING),
                    ]
                    .into_iter()
                    .flatten()
                    .collect(),
                })
            })
            .collect()
    }
}
