//! The segments of a Segmentation (Segment Sequence, PS3.3 C.8.20.4).

use super::super::{Segment, SegmentCode};
use ventriform_dicom::read::attributes::{
    Attributes, SEGMENT_LABEL, SEGMENT_NUMBER, SEGMENT_REGION_MEANING, SEGMENT_REGION_VALUE,
    SEGMENT_TYPE_MEANING, SEGMENT_TYPE_VALUE,
};

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
