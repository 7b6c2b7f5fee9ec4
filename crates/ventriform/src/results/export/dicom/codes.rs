//! The coded concepts of the objects, from DICOM PS3.16.

use crate::image::volume::nifti::LabelEntry;
use crate::results::figures::code::own;
use ventriform_dicom::write::code::{Code, dcm, sct};

pub(super) const ANATOMICAL_STRUCTURE: Code = sct("91723000", "Anatomical Structure");
/// PS3.16 has the ventricle and its wall, but not its cavity.
pub(super) const LV_CAVITY: Code = own("LV-CAVITY", "Cavity of left ventricle");
pub(super) const DEFORMABLE_MODELS: Code = dcm("123111", "Deformable Models");
pub(super) const SEGMENTATION_STEP: Code = dcm("113076", "Segmentation");
pub(super) const SOURCE_FOR_PROCESSING: Code =
    dcm("121322", "Source image for image processing operation");

/// The colour of the structure, sRGB: the CIELab colour of its segment.
const STRUCTURE_RGB: [u8; 3] = [255, 150, 0];
/// The colour of the cavity, sRGB.
const CAVITY_COLOUR: [u8; 3] = [60, 120, 220];

/// A label of a map of labels with its terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LabelSegment {
    /// Value, name and colour.
    pub entry: LabelEntry,
    /// Category of the segmented property (CID 7150).
    category: Code,
    /// Its type.
    kind: Code,
}

impl LabelSegment {
    /// Category and type as coding scheme, value and meaning.
    pub fn terms(&self) -> [[&'static str; 3]; 2] {
        [self.category, self.kind].map(|code| [code.scheme, code.value, code.meaning])
    }
}

/// A segmented structure: its codes and the words for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Structure {
    /// Type of the segmented property (CID 7192, CID 7151).
    pub(super) kind: Code,
    /// Where findings lie (CID 4).
    pub(super) site: Code,
    /// Body Part Examined (0018,0015), a defined term of PS3.16 annex L; empty for none.
    pub(super) body_part: &'static str,
    /// A label for people.
    pub(super) label: &'static str,
}

impl Structure {
    /// The structure that a segmentation of `organ` shows (the parameter `organ`); tissue for
    /// names that are not known here.
    pub fn from_organ(organ: &str) -> Self {
        match organ {
            "left_ventricle" => Self {
                kind: sct("49848007", "Left Ventricle Myocardium"),
                site: sct("87878005", "Left ventricle"),
                body_part: "HEART",
                label: "Left ventricle myocardium",
            },
            "liver" => Self::whole(sct("10200004", "Liver"), "LIVER", "Liver"),
            "kidney" => Self::whole(sct("64033007", "Kidney"), "KIDNEY", "Kidney"),
            _ => Self::whole(sct("85756007", "Tissue"), "", "Tissue"),
        }
    }

    /// The name of the structure, for people.
    pub fn label(&self) -> &'static str {
        self.label
    }

    /// The segments of a map of labels: the structure as 1, and its cavity as 2 if there is one, with the
    /// colours and codes that the Segmentation has.
    pub fn segments(&self, cavity: bool) -> Vec<LabelSegment> {
        let whole = LabelSegment {
            entry: LabelEntry {
                value: 1,
                name: self.label,
                colour: STRUCTURE_RGB,
            },
            category: ANATOMICAL_STRUCTURE,
            kind: self.kind,
        };
        let cavity = cavity.then_some(LabelSegment {
            entry: LabelEntry {
                value: 2,
                name: LV_CAVITY.meaning,
                colour: CAVITY_COLOUR,
            },
            category: ANATOMICAL_STRUCTURE,
            kind: LV_CAVITY,
        });
        [Some(whole), cavity].into_iter().flatten().collect()
    }

    fn whole(code: Code, body_part: &'static str, label: &'static str) -> Self {
        Self {
            kind: code,
            site: code,
            body_part,
            label,
        }
    }
}
