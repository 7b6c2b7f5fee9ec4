//! Moments and UIDs as DICOM writes them.

use crate::base::records::{Timestamp, random_id, rfc3339};

/// A moment as DICOM writes it (DT, UTC).
pub fn dicom_time(moment: Timestamp) -> String {
    let text = rfc3339(moment);
    let digits = text.chars().take(19).filter(char::is_ascii_digit);
    digits.collect::<String>() + "+0000"
}

/// A new UID: a UUID under 2.25 (PS3.5 B.2).
pub fn new_uid() -> String {
    let number = u128::from_str_radix(&random_id(""), 16).unwrap_or_default();
    format!("2.25.{number}")
}
