//! Text that comes from files and callers: which characters no name has, and how it is printed.
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

/// Whether a name may have `c`: no control character (C0, DEL, C1), separator of lines or paragraphs,
/// control of writing direction (embedding, override, isolate), mark of byte order, or sign that
/// stands for something lost.
pub fn is_printable(c: char) -> bool {
    !is_obeyed(c) && !matches!(c, '\u{feff}' | '\u{fffd}' | '\u{fffe}' | '\u{ffff}')
}

/// Whether terminals, logs or the order of writing obey `c` instead of showing it.
fn is_obeyed(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{2028}' | '\u{2029}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// `true` if `text` is of ASCII's printable characters and line feeds alone, as nearly all lines of a log are.
/// All bytes are looked at, so that the compiler can look at many at once.
fn is_plain(text: &str) -> bool {
    let plain = |b: u8| (b' '..0x7f).contains(&b) | (b == b'\n');
    text.bytes().fold(true, |all, b| all & plain(b))
}

/// `text` on one line, with every character that would be obeyed as `\n`, `\t`, `\u{1b}`, ...
pub fn escaped(text: &str) -> Cow<'_, str> {
    escape(text, &[])
}

/// As [`escaped`], except that line feeds and tabs stay.
pub fn escaped_lines(text: &str) -> Cow<'_, str> {
    if is_plain(text) {
        return text.into();
    }
    escape(text, &['\n', '\t'])
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

fn escape<'a>(text: &'a str, kept: &[char]) -> Cow<'a, str> {
    let escapes = |c: char| is_obeyed(c) && !kept.contains(&c);
    if !text.contains(escapes) {
        return text.into();
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if escapes(c) {
            shown.extend(c.escape_default())
        } else {
            shown.push(c)
        }
    }
    shown.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_obeyed_is_escaped_and_nothing_else() {
        for c in (0..=0x0010_ffff).filter_map(char::from_u32) {
            let obeyed = u32::from(c) < 0x20
                || (0x7f..0xa0).contains(&u32::from(c))
                || "\u{2028}\u{2029}\u{202a}\u{202b}\u{202c}\u{202d}\u{202e}\u{2066}\u{2067}\u{2068}\u{2069}"
                    .contains(c);
            let text = format!("a{c}b");
            let shown = escaped(&text);
            assert_eq!(shown == text, !obeyed, "{c:?}");
            if obeyed {
                let inner = &shown[1..shown.len() - 1];
                assert!(inner.starts_with('\\') && inner.is_ascii(), "{inner}");
                assert!(!is_printable(c));
            }
        }
        assert_eq!(escaped_lines("a\tb\nc\x1b[2J"), "a\tb\nc\\u{1b}[2J");
        assert_eq!(escaped("a\tb\nc"), "a\\tb\\nc");
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
