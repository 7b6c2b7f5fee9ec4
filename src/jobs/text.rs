//! Which characters may stand in names, labels and reasons, which come out in logs, tables and pages.

/// Whether a character is not seen as itself: control characters; separators of lines and paragraphs; marks that turn
/// the direction of the text after them, so that it reads as something else; the mark of a byte order.
pub fn is_unprintable(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}')
}

/// The text with those characters written as escapes, except the ends of lines.
pub fn printed(text: &str) -> String {
    let shown = |c: char| match c {
        '\n' => c.to_string(),
        c if is_unprintable(c) => c.escape_unicode().to_string(),
        c => c.to_string(),
    };
    text.chars().map(shown).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_seen_as_itself_is_escaped() {
        for hidden in "\0\u{1b}\u{7f}\u{85}\u{9b}\u{2028}\u{202e}\u{2067}\u{feff}\r".chars() {
            assert!(is_unprintable(hidden), "{hidden:?}");
            let printed = printed(&format!("a{hidden}b"));
            assert!(
                printed.chars().all(|c| (' '..='~').contains(&c)),
                "{printed}"
            );
        }
        // Letters of every script, marks that join them, and both joiners are text.
        let text = "Zo\u{eb} \u{5d0}\u{5d1} \u{928}\u{94d}\u{200d}\u{937} \u{0e01}\n\u{1f469}\u{200d}\u{2695}";
        assert_eq!(printed(text), text);
    }
}
