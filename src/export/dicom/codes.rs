//! The coded concepts of the objects, from DICOM PS3.16.

/// A coded concept: value, coding scheme and meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Code {
    /// Code Value (0008,0100).
    pub value: &'static str,
    /// Coding Scheme Designator (0008,0102).
    pub scheme: &'static str,
    /// Code Meaning (0008,0104).
    pub meaning: &'static str,
}

/// Designator of the codes that no public scheme has.
pub(super) const OWN_SCHEME: &str = "99VENTRIFORM";

/// A code of DICOM's own scheme.
pub(super) const fn dcm(value: &'static str, meaning: &'static str) -> Code {
    code(value, "DCM", meaning)
}

/// A code of SNOMED CT.
pub(super) const fn sct(value: &'static str, meaning: &'static str) -> Code {
    code(value, "SCT", meaning)
}

/// A unit of UCUM.
pub(super) const fn ucum(value: &'static str, meaning: &'static str) -> Code {
    code(value, "UCUM", meaning)
}

/// A code of this software.
pub(super) const fn own(value: &'static str, meaning: &'static str) -> Code {
    code(value, OWN_SCHEME, meaning)
}

const fn code(value: &'static str, scheme: &'static str, meaning: &'static str) -> Code {
    Code {
        value,
        scheme,
        meaning,
    }
}

pub(super) const ANATOMICAL_STRUCTURE: Code = sct("91723000", "Anatomical Structure");
/// PS3.16 has the ventricle and its wall, but not its cavity.
pub(super) const CAVITY: Code = own("LV-CAVITY", "Cavity of left ventricle");
pub(super) const DEFORMABLE_MODELS: Code = dcm("123111", "Deformable Models");
pub(super) const SEGMENTATION: Code = dcm("113076", "Segmentation");
pub(super) const SOURCE_FOR_PROCESSING: Code =
    dcm("121322", "Source image for image processing operation");
pub(super) const MILLIMETRE: Code = ucum("mm", "mm");

/// What is segmented: its codes and the words for it.
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
    pub fn of(organ: &str) -> Self {
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

    fn whole(code: Code, body_part: &'static str, label: &'static str) -> Self {
        Self {
            kind: code,
            site: code,
            body_part,
            label,
        }
    }
}
