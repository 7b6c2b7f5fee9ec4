//! Coded concepts of DICOM PS3.16 and of the terminologies that it uses.

/// A coded concept: value, coding scheme and meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Code {
    /// Code Value (0008,0100).
    pub value: &'static str,
    /// Coding Scheme Designator (0008,0102).
    pub scheme: &'static str,
    /// Code Meaning (0008,0104).
    pub meaning: &'static str,
}

/// Designator of the codes that no public scheme has.
pub const OWN_SCHEME: &str = "99VENTRIFORM";

/// A code of DICOM's own scheme.
pub const fn dcm(value: &'static str, meaning: &'static str) -> Code {
    code(value, "DCM", meaning)
}

/// A code of SNOMED CT.
pub const fn sct(value: &'static str, meaning: &'static str) -> Code {
    code(value, "SCT", meaning)
}

/// A unit of UCUM.
pub const fn ucum(value: &'static str, meaning: &'static str) -> Code {
    code(value, "UCUM", meaning)
}

/// A code of LOINC.
pub const fn loinc(value: &'static str, meaning: &'static str) -> Code {
    code(value, "LN", meaning)
}

/// A code of this software.
pub const fn own(value: &'static str, meaning: &'static str) -> Code {
    assert!(value.len() <= 16, "a Code Value has at most 16 characters");
    code(value, OWN_SCHEME, meaning)
}

const fn code(value: &'static str, scheme: &'static str, meaning: &'static str) -> Code {
    assert!(
        meaning.len() <= 64,
        "a Code Meaning has at most 64 characters"
    );
    Code {
        value,
        scheme,
        meaning,
    }
}
