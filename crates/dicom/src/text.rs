//! Text that comes from files: which characters no name has, and how it is printed.
//!
//! A terminal obeys control characters, a log ends its line at others, and controls of writing
//! direction show a text in an order in which it is not stored (Unicode Technical Report 36, 3.1).
//! Names that are taken have none of them ([`is_printable`]); whatever is printed has them escaped
//! ([`escaped`]).

use std::borrow::Cow;

/// Whether a name may have `c`: no control character (C0, DEL, C1), separator of lines or paragraphs,
/// control of writing direction (embedding, override, isolate), mark of byte order, or sign that
/// stands for something lost.
pub fn is_printable(c: char) -> bool {
    !is_obeyed(c) && !matches!(c, '\u{feff}' | '\u{fffd}' | '\u{fffe}' | '\u{ffff}')
}

/// Whether terminals, logs or the order of writing obey `c` instead of showing it.
pub fn is_obeyed(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{2028}' | '\u{2029}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// `text` on one line, with every character that would be obeyed as `\n`, `\t`, `\u{1b}`, ...
pub fn escaped(text: &str) -> Cow<'_, str> {
    escaped_except(text, &[])
}

/// As [`escaped`], except that the characters `kept` stay.
pub fn escaped_except<'a>(text: &'a str, kept: &[char]) -> Cow<'a, str> {
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
        assert_eq!(
            escaped_except("a\tb\nc\x1b[2J", &['\n', '\t']),
            "a\tb\nc\\u{1b}[2J"
        );
        assert_eq!(escaped("a\tb\nc"), "a\\tb\\nc");
    }
}
