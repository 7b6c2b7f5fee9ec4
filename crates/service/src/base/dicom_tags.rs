//! Tags of DICOM as the DICOM JSON Model writes them (PS3.18 annex F): eight hexadecimal digits.
//!
//! The names are those of the data dictionary (PS3.6).

use dicom_core::Tag;
use dicom_dictionary_std::tags;

/// The eight digits of a tag.
const fn digits(tag: Tag) -> [u8; 8] {
    const HEX_DIGITS: &[u8; 16] = b"0123456789ABCDEF";
    let number = ((tag.0 as u32) << 16) | tag.1 as u32;
    let mut digits = [0; 8];
    let mut place = 0;
    while place < 8 {
        digits[place] = HEX_DIGITS[(number >> (28 - 4 * place)) as usize & 15];
        place += 1;
    }
    digits
}

macro_rules! json_tags {
    ($($name:ident)*) => {
        $(
            #[doc = concat!("The tag `", stringify!($name), "`.")]
            pub const $name: &str = {
                const TAG_DIGITS: [u8; 8] = digits(tags::$name);
                match str::from_utf8(&TAG_DIGITS) {
                    Ok(text) => text,
                    Err(_) => panic!("hexadecimal digits are ASCII"),
                }
            };
        )*
    };
}

json_tags! {
    CODE_MEANING
    CODE_VALUE
    CODING_SCHEME_DESIGNATOR
    CONTACT_DISPLAY_NAME
    CONTACT_URI
    DICOM_RETRIEVAL_SEQUENCE
    FAILED_SOP_SEQUENCE
    FAILURE_REASON
    INPUT_INFORMATION_SEQUENCE
    INPUT_READINESS_STATE
    OTHER_FAILURES_SEQUENCE
    OUTPUT_INFORMATION_SEQUENCE
    PERFORMED_PROCEDURE_STEP_END_DATE_TIME
    PERFORMED_PROCEDURE_STEP_START_DATE_TIME
    PERFORMED_STATION_NAME_CODE_SEQUENCE
    PERFORMED_WORKITEM_CODE_SEQUENCE
    PROCEDURE_STEP_CANCELLATION_DATE_TIME
    PROCEDURE_STEP_DISCONTINUATION_REASON_CODE_SEQUENCE
    PROCEDURE_STEP_LABEL
    PROCEDURE_STEP_PROGRESS
    PROCEDURE_STEP_PROGRESS_INFORMATION_SEQUENCE
    PROCEDURE_STEP_STATE
    REASON_FOR_CANCELLATION
    REFERENCED_SOP_CLASS_UID
    REFERENCED_SOP_INSTANCE_UID
    REFERENCED_SOP_SEQUENCE
    RETRIEVE_AE_TITLE
    RETRIEVE_URL
    SCHEDULED_PROCEDURE_STEP_MODIFICATION_DATE_TIME
    SCHEDULED_PROCEDURE_STEP_PRIORITY
    SCHEDULED_WORKITEM_CODE_SEQUENCE
    SERIES_INSTANCE_UID
    SOP_CLASS_UID
    SOP_INSTANCE_UID
    STUDY_INSTANCE_UID
    TRANSACTION_UID
    TYPE_OF_INSTANCES
    UNIFIED_PROCEDURE_STEP_PERFORMED_PROCEDURE_SEQUENCE
    WADORS_RETRIEVAL_SEQUENCE
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The digits of PS3.6.
    #[test]
    fn tags_are_written_as_the_standard_does() {
        assert_eq!(PROCEDURE_STEP_STATE, "00741000");
        assert_eq!(SOP_INSTANCE_UID, "00080018");
        assert_eq!(STUDY_INSTANCE_UID, "0020000D");
        assert_eq!(digits(Tag(0xFFFE, 0xE0DD)), *b"FFFEE0DD");
    }
}
