//! Coded concepts that no public scheme has.

use ventriform_dicom::write::code::Code;

/// Their scheme.
pub const OWN_SCHEME: &str = "99VENTRIFORM";

/// A code of this software.
pub const fn own(value: &'static str, meaning: &'static str) -> Code {
    Code::new(value, OWN_SCHEME, meaning)
}
