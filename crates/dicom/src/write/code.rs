//! Coded concepts, as DICOM PS3.16 and other schemes define them.

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

impl Code {
    /// The concept `value` of the coding scheme `scheme`.
    ///
    /// # Panics
    /// If the value has more than 16 characters or the meaning more than 64; of a constant, when it is compiled.
    pub const fn new(value: &'static str, scheme: &'static str, meaning: &'static str) -> Self {
        assert!(value.len() <= 16, "a Code Value has at most 16 characters");
        assert!(
            meaning.len() <= 64,
            "a Code Meaning has at most 64 characters"
        );
        Self {
            value,
            scheme,
            meaning,
        }
    }
}

/// A code of DICOM's own scheme.
pub const fn dcm(value: &'static str, meaning: &'static str) -> Code {
    Code::new(value, "DCM", meaning)
}

/// A code of SNOMED CT.
pub const fn sct(value: &'static str, meaning: &'static str) -> Code {
    Code::new(value, "SCT", meaning)
}

/// A unit of UCUM.
pub const fn ucum(value: &'static str, meaning: &'static str) -> Code {
    Code::new(value, "UCUM", meaning)
}

/// A code of LOINC.
pub const fn loinc(value: &'static str, meaning: &'static str) -> Code {
    Code::new(value, "LN", meaning)
}
