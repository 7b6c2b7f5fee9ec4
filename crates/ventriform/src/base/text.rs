//! Text that comes from files and callers, printed; and the lists of documents, read.
//!
//! A terminal obeys control characters, a log ends its line at others, and controls of writing
//! direction show a text in an order in which it is not stored (Unicode Technical Report 36, 3.1).
//! Names that are taken have none of them ([`is_printable`]); whatever is printed has them escaped
//! ([`escaped`], [`escaped_lines`]). Digests are printed by [`hex`]. Lists of documents are read by [`at_most`].

use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt::{self, Write as _};
use std::marker::PhantomData;
use ventriform_dicom::text::{escaped_except, is_obeyed};

pub use ventriform_dicom::text::{escaped, is_printable};

/// A list of a document, which is refused at the entry after `MOST`. What entries are parsed to may have many times the
/// bytes of their text.
pub(crate) fn at_most<'de, T, D, const MOST: usize>(deserializer: D) -> Result<Vec<T>, D::Error>
where
    T: Deserialize<'de>,
    D: Deserializer<'de>,
{
    struct AtMost<T, const MOST: usize>(PhantomData<T>);
    impl<'de, T: Deserialize<'de>, const MOST: usize> Visitor<'de> for AtMost<T, MOST> {
        type Value = Vec<T>;
        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "a list of at most {MOST} entries")
        }
        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<T>, A::Error> {
            let mut entries = Vec::new();
            while let Some(entry) = list.next_element()? {
                if entries.len() == MOST {
                    let reason = format!("a list has more than {MOST} entries");
                    return Err(A::Error::custom(reason));
                }
                entries.push(entry);
            }
            Ok(entries)
        }
    }
    deserializer.deserialize_seq(AtMost::<T, MOST>(PhantomData))
}

/// The bytes as lower-case hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").expect("a string takes any text");
        text
    })
}

/// `true` if `text` is of ASCII's printable characters and line feeds alone, as nearly all lines of a log are.
/// All bytes are looked at, so that the compiler can look at many at once.
fn is_plain(text: &str) -> bool {
    let plain = |b: u8| (b' '..0x7f).contains(&b) | (b == b'\n');
    text.bytes().fold(true, |all, b| all & plain(b))
}

/// As [`escaped`], except that line feeds and tabs stay.
pub fn escaped_lines(text: &str) -> Cow<'_, str> {
    if is_plain(text) {
        return text.into();
    }
    escaped_except(text, &['\n', '\t'])
}

/// JSON text with the same characters as `\uXXXX`; line feeds between values stay.
pub fn escaped_json(text: &str) -> Cow<'_, str> {
    let escapes = |c: char| is_obeyed(c) && c != '\n';
    if is_plain(text) || !text.contains(escapes) {
        return text.into();
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if escapes(c) {
            // All of them are below U+10000.
            shown.push_str(&format!("\\u{:04x}", u32::from(c)));
        } else {
            shown.push(c);
        }
    }
    shown.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_values_stay_apart() {
        assert_eq!(escaped_lines("a\tb\nc\x1b[2J"), "a\tb\nc\\u{1b}[2J");
        let value = serde_json::json!({"name": "a\u{9b}31m\u{202e}b\u{7f}\u{2028}c\x1b\n"});
        let shown = serde_json::to_string_pretty(&value).unwrap();
        let safe = escaped_json(&shown);
        assert!(safe.chars().all(|c| c == '\n' || !is_obeyed(c)), "{safe:?}");
        assert_eq!(
            serde_json::from_str::<serde_json::Value>(&safe).unwrap(),
            value
        );
    }
}
