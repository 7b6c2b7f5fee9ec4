//! Text in the character sets of DICOM.
//!
//! In: the values of Specific Character Set (0008,0005) and the bytes of a value. Out: its text, or
//! the reason why it cannot be told. After PS3.3 C.12.1.1.2 and PS3.5 6.1.2, with the examples of
//! PS3.5 annexes H (Japanese), I (Korean), J and K (Chinese) as tests:
//!
//! - ISO_IR 192 (UTF-8), GB18030 and GBK stand alone; their decoders read the whole value.
//! - All other terms name sets of ISO 2022: one of codes below 128 (G0), one of those above (G1).
//!   Value 1 names those that are active at the beginning; escape sequences activate those of the
//!   other values. The beginning is restored at every delimiter: `\` between values, `^` and `=` in
//!   names, control characters in text of several lines.
//!
//! Guaranteed: no character is made up. Bytes above 127 without a set, codes that a set does not
//! assign, cut pairs, escape sequences of sets that the file does not name, and control characters
//! are errors. A term that DICOM does not define names no set: text of ASCII is read, no other.
//!
//! The tables of single sets are those of `encoding_rs`; where they follow the web's habits instead
//! of JIS X 0208, [`JIS_DIFFERENCES`] puts the standard's characters in place.

use crate::text::is_printable;
use dicom_core::VR;
use encoding_rs::{
    EUC_JP, EUC_KR, Encoding, GB18030, GBK, ISO_8859_2, ISO_8859_3, ISO_8859_4, ISO_8859_5,
    ISO_8859_6, ISO_8859_7, ISO_8859_8, ISO_8859_15, WINDOWS_874, WINDOWS_1254,
};

const ESCAPE_BYTE: u8 = 0x1b;

/// A coded character set.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Set {
    /// ISO 646, the default.
    Ascii,
    /// JIS X 0201 below 128: ASCII with yen sign and overline.
    Roman,
    /// JIS X 0201 above 127.
    Katakana,
    /// ISO 8859-1 above 127.
    Latin1,
    /// The codes from 0xA0 on of another single-byte set.
    Right(&'static Encoding),
    /// JIS X 0208, pairs below 128.
    Kanji,
    /// JIS X 0212, pairs below 128.
    MoreKanji,
    /// KS X 1001 or GB 2312, pairs above 127, as that encoding has them.
    Pairs(&'static Encoding),
}

/// A term and its sets, each with its escape sequence after ESC.
struct Term {
    /// The number after `ISO_IR ` or `ISO 2022 IR `.
    number: &'static str,
    g0: Option<(&'static [u8], Set)>,
    g1: Option<(&'static [u8], Set)>,
}

const ASCII_ESCAPE: (&[u8], Set) = (b"(B", Set::Ascii);
const ROMAN_ESCAPE: (&[u8], Set) = (b"(J", Set::Roman);

const fn right(number: &'static str, escape: &'static [u8], set: Set) -> Term {
    Term {
        number,
        g0: Some(ASCII_ESCAPE),
        g1: Some((escape, set)),
    }
}

/// PS3.3 tables C.12-2 to C.12-4.
const DEFINED_TERMS: [Term; 17] = [
    Term {
        number: "6",
        g0: Some(ASCII_ESCAPE),
        g1: None,
    },
    right("100", b"-A", Set::Latin1),
    right("101", b"-B", Set::Right(ISO_8859_2)),
    right("109", b"-C", Set::Right(ISO_8859_3)),
    right("110", b"-D", Set::Right(ISO_8859_4)),
    right("144", b"-L", Set::Right(ISO_8859_5)),
    right("127", b"-G", Set::Right(ISO_8859_6)),
    right("126", b"-F", Set::Right(ISO_8859_7)),
    right("138", b"-H", Set::Right(ISO_8859_8)),
    // ISO 8859-9 and TIS 620 are the right halves of these.
    right("148", b"-M", Set::Right(WINDOWS_1254)),
    right("166", b"-T", Set::Right(WINDOWS_874)),
    right("203", b"-b", Set::Right(ISO_8859_15)),
    Term {
        number: "13",
        g0: Some(ROMAN_ESCAPE),
        g1: Some((b")I", Set::Katakana)),
    },
    Term {
        number: "87",
        g0: Some((b"$B", Set::Kanji)),
        g1: None,
    },
    Term {
        number: "159",
        g0: Some((b"$(D", Set::MoreKanji)),
        g1: None,
    },
    Term {
        number: "149",
        g0: None,
        g1: Some((b"$)C", Set::Pairs(EUC_KR))),
    },
    Term {
        number: "58",
        g0: None,
        g1: Some((b"$)A", Set::Pairs(GBK))),
    },
];

/// Where `encoding_rs` gives another character than JIS X 0208 (Unicode's JIS0208.TXT) has.
const JIS_DIFFERENCES: [(char, char); 6] = [
    ('\u{ff5e}', '\u{301c}'),
    ('\u{2225}', '\u{2016}'),
    ('\u{ff0d}', '\u{2212}'),
    ('\u{ffe0}', '\u{00a2}'),
    ('\u{ffe1}', '\u{00a3}'),
    ('\u{ffe2}', '\u{00ac}'),
];

/// Division of text, by its value representation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Division {
    /// Codes, numbers, dates, UIDs: always ASCII.
    Codes,
    /// Values separated by backslashes: LO, SH, UC.
    Values,
    /// Names: also `^` and `=`.
    Names,
    /// Text of several lines: ST, LT, UT.
    Lines,
}

impl Division {
    /// That of text in the value representation `representation`.
    pub fn from_representation(representation: VR) -> Self {
        match representation {
            VR::PN => Self::Names,
            VR::LO | VR::SH | VR::UC => Self::Values,
            VR::ST | VR::LT | VR::UT => Self::Lines,
            _ => Self::Codes,
        }
    }

    /// Whether the sets of the beginning are active again before `byte`, which is no part of a pair.
    fn restores(self, byte: u8) -> bool {
        match byte {
            b'\\' => self != Self::Lines,
            b'^' | b'=' => self == Self::Names,
            byte => byte < b' ' || byte == 0x7f,
        }
    }
}

/// The character sets that a data set names.
#[derive(Debug, Clone)]
pub struct CharacterSets {
    /// An encoding of whole values, without escape sequences.
    whole: Option<&'static Encoding>,
    /// Those active at the beginning.
    first: (Set, Option<Set>),
    /// Escape sequences that may occur, and whether they change G1.
    escapes: Vec<(&'static [u8], Set, bool)>,
    /// A term that DICOM does not define, or not at its place.
    unknown: Option<String>,
}

impl CharacterSets {
    /// The sets that the values of Specific Character Set name; none of them: ASCII.
    pub fn from_terms(terms: &[String]) -> Self {
        let mut sets = Self {
            whole: None,
            first: (Set::Ascii, None),
            escapes: vec![(ASCII_ESCAPE.0, ASCII_ESCAPE.1, false)],
            unknown: None,
        };
        for (place, text) in terms.iter().enumerate() {
            let whole = match text.as_str() {
                "ISO_IR 192" => Some(encoding_rs::UTF_8),
                "GB18030" => Some(GB18030),
                "GBK" => Some(GBK),
                _ => None,
            };
            let number = text.strip_prefix("ISO 2022 IR ");
            let number = number.or_else(|| text.strip_prefix("ISO_IR "));
            let number = if text.is_empty() { Some("6") } else { number };
            let term = DEFINED_TERMS
                .iter()
                .find(|term| Some(term.number) == number);
            match (whole, term, place) {
                (Some(whole), _, 0) => sets.whole = Some(whole),
                (None, Some(term), place) => sets.add(term, place == 0),
                _ => sets.unknown = sets.unknown.or_else(|| Some(text.clone())),
            }
        }
        sets
    }

    fn add(&mut self, term: &Term, is_first: bool) {
        let g0 = term.g0.map(|(escape, set)| (escape, set, false));
        let g1 = term.g1.map(|(escape, set)| (escape, set, true));
        self.escapes.extend(g0.into_iter().chain(g1));
        // Japanese text returns from pairs to either of both.
        if matches!(g0, Some((_, Set::Kanji | Set::MoreKanji, _))) {
            self.escapes.push((ROMAN_ESCAPE.0, ROMAN_ESCAPE.1, false));
        }
        if is_first {
            let single = g0.map(|(_, set, _)| set).filter(|set| !set.is_pairs());
            self.first = (single.unwrap_or(Set::Ascii), g1.map(|(_, set, _)| set));
        }
    }

    /// The first term that names no set.
    pub fn unknown(&self) -> Option<&str> {
        self.unknown.as_deref()
    }

    /// The text of `bytes`, without padding.
    ///
    /// # Errors
    /// Why it cannot be told, and where. Nothing of the text is in it.
    pub fn decode(&self, bytes: &[u8], division: Division) -> Result<String, String> {
        let padding = |b: &&u8| matches!(**b, 0 | b' ');
        let bytes = &bytes[..bytes.len() - bytes.iter().rev().take_while(padding).count()];
        let text = match (self.whole, division) {
            (_, Division::Codes) => Self::from_terms(&[]).extended(bytes, division)?,
            (Some(whole), _) => decode_whole(whole, bytes)?,
            (None, _) => self.extended(bytes, division)?,
        };
        let lines = |c: char| division == Division::Lines && "\r\n\t\u{c}".contains(c);
        let control = text.chars().position(|c| !is_printable(c) && !lines(c));
        match control {
            Some(place) => Err(format!("character {} is a control character", place + 1)),
            None => Ok(text.trim_matches(' ').to_owned()),
        }
    }

    /// Text with code extensions (ISO 2022).
    fn extended(&self, bytes: &[u8], division: Division) -> Result<String, String> {
        let mut text = String::with_capacity(bytes.len());
        let (mut g0, mut g1) = self.first;
        let mut rest = bytes;
        while let Some(byte) = rest.first().copied() {
            let at = bytes.len() - rest.len() + 1;
            if byte == ESCAPE_BYTE {
                let known = self
                    .escapes
                    .iter()
                    .find(|(escape, ..)| rest[1..].starts_with(escape));
                let Some((escape, set, right)) = known else {
                    return Err(self.blame(format!(
                        "byte {at} begins an escape sequence of no set that the file names"
                    )));
                };
                if *right {
                    g1 = Some(*set);
                } else {
                    g0 = *set;
                }
                rest = &rest[1 + escape.len()..];
                continue;
            }
            let set = match byte {
                0..=b' ' | 0x7f => Set::Ascii,
                0x80.. => g1.ok_or_else(|| {
                    self.blame(format!("byte {at} is above 127, and no set has such"))
                })?,
                _ => g0,
            };
            if !set.is_pairs() && division.restores(byte) {
                (g0, g1) = self.first;
                // A backslash separates values whatever the set shows in its place.
                text.push(char::from(byte));
                rest = &rest[1..];
                continue;
            }
            let length = if set.is_pairs() { 2 } else { 1 };
            let character = rest
                .get(..length)
                .and_then(|code| set.character(code))
                .ok_or_else(|| format!("byte {at} begins no character of its set"))?;
            text.push(character);
            rest = &rest[length..];
        }
        Ok(text)
    }

    /// `reason`, with the term that names no set where there is one.
    fn blame(&self, reason: String) -> String {
        match &self.unknown {
            Some(term) => format!("{reason}: {term:?} is no defined term"),
            None => reason,
        }
    }
}

impl Set {
    fn is_pairs(self) -> bool {
        matches!(self, Set::Kanji | Set::MoreKanji | Set::Pairs(_))
    }

    /// The character with that code of one byte or, in sets of pairs, two.
    fn character(self, code: &[u8]) -> Option<char> {
        let byte = code[0];
        match self {
            Set::Ascii => byte.is_ascii().then_some(char::from(byte)),
            Set::Roman => Some(match byte {
                b'\\' => '\u{a5}',
                b'~' => '\u{203e}',
                _ => char::from(byte),
            }),
            Set::Katakana if !(0xa1..=0xdf).contains(&byte) => None,
            Set::Katakana => char::from_u32(0xff61 + u32::from(byte - 0xa1)),
            // 0x80 to 0x9F are control characters in all of these.
            Set::Latin1 => (byte >= 0xa0).then_some(char::from(byte)),
            Set::Right(encoding) => (byte >= 0xa0).then(|| one(encoding, &[byte]))?,
            Set::Kanji => {
                let found = one(EUC_JP, &pair(code, 0x21)?)?;
                let standard = JIS_DIFFERENCES.iter().find(|(web, _)| *web == found);
                Some(standard.map_or(found, |(_, standard)| *standard))
            }
            Set::MoreKanji => {
                let [first, second] = pair(code, 0x21)?;
                one(EUC_JP, &[0x8f, first, second])
            }
            Set::Pairs(encoding) => one(encoding, &pair(code, 0xa1)?),
        }
    }
}

/// The two bytes of `code` with their highest bits, if both are among the 94 from `lowest` on.
fn pair(code: &[u8], lowest: u8) -> Option<[u8; 2]> {
    let [first, second] = *code.as_array()?;
    let valid = |byte: u8| (lowest..lowest + 94).contains(&byte);
    (valid(first) && valid(second)).then_some([first | 0x80, second | 0x80])
}

/// The character that all of `code` is in `encoding`, unless it is private.
fn one(encoding: &'static Encoding, code: &[u8]) -> Option<char> {
    let text = encoding.decode_without_bom_handling_and_without_replacement(code)?;
    let mut characters = text.chars();
    let first = characters.next().filter(|c| !is_private(*c));
    first.filter(|_| characters.next().is_none())
}

fn is_private(c: char) -> bool {
    ('\u{e000}'..='\u{f8ff}').contains(&c)
}

/// The text of a value in an encoding that stands alone.
fn decode_whole(encoding: &'static Encoding, bytes: &[u8]) -> Result<String, String> {
    let name = encoding.name();
    if encoding != encoding_rs::UTF_8 {
        check_chinese(encoding, bytes)?;
    }
    let text = encoding.decode_without_bom_handling_and_without_replacement(bytes);
    let text = text.filter(|text| encoding == encoding_rs::UTF_8 || !text.contains(is_private));
    let text = text.ok_or_else(|| format!("the bytes are not {name}"))?;
    Ok(text.into_owned())
}

/// Refuses what the web's decoder of both encodings reads beyond the standards: single bytes 0x80, and
/// codes of four bytes in GBK.
fn check_chinese(encoding: &'static Encoding, bytes: &[u8]) -> Result<(), String> {
    let mut rest = bytes;
    while let Some(byte) = rest.first() {
        let four = rest.get(1).is_some_and(u8::is_ascii_digit);
        let length = match byte {
            ..0x80 => 1,
            0x80 | 0xff => 0,
            _ if four && encoding == GBK => 0,
            _ if four => 4,
            _ => 2,
        };
        if length == 0 || length > rest.len() {
            let at = bytes.len() - rest.len() + 1;
            return Err(format!(
                "byte {at} begins no character of {}",
                encoding.name()
            ));
        }
        rest = &rest[length..];
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The text of `bytes` in the sets that `terms` name, separated by backslashes.
    fn read(terms: &str, bytes: &[u8], division: Division) -> Result<String, String> {
        let terms: Vec<String> = terms.split('\\').map(str::to_owned).collect();
        CharacterSets::from_terms(&terms).decode(bytes, division)
    }

    fn name(terms: &str, bytes: &[u8]) -> Result<String, String> {
        read(terms, bytes, Division::Names)
    }

    /// PS3.5 annexes H, I, J and K, byte by byte as in David Clunie's example files, which pydicom brings along
    /// (`scripts/check/names.py` reads those files themselves).
    #[test]
    fn the_examples_of_the_standard_are_read() {
        let yamada: &[u8] = b"Yamada^Tarou=\x1b$B;3ED\x1b(B^\x1b$BB@O:\x1b(B=\
            \x1b$B$d$^$@\x1b(B^\x1b$B$?$m$&\x1b(B";
        let katakana: &[u8] = b"\xd4\xcf\xc0\xde^\xc0\xdb\xb3=\x1b$B;3ED\x1b(J^\x1b$BB@O:\x1b(J=\
            \x1b$B$d$^$@\x1b(J^\x1b$B$?$m$&\x1b(J";
        let hong: &[u8] = b"Hong^Gildong=\x1b$)C\xfb\xf3^\x1b$)C\xd1\xce\xd4\xd7=\
            \x1b$)C\xc8\xab^\x1b$)C\xb1\xe6\xb5\xbf";
        let examples: &[(&str, &[u8], &str)] = &[
            (
                "\\ISO 2022 IR 87",
                yamada,
                "Yamada^Tarou=山田^太郎=やまだ^たろう",
            ),
            (
                "ISO 2022 IR 6\\ISO 2022 IR 87",
                yamada,
                "Yamada^Tarou=山田^太郎=やまだ^たろう",
            ),
            (
                "ISO 2022 IR 13\\ISO 2022 IR 87",
                katakana,
                "ﾔﾏﾀﾞ^ﾀﾛｳ=山田^太郎=やまだ^たろう",
            ),
            ("\\ISO 2022 IR 149", hong, "Hong^Gildong=洪^吉洞=홍^길동"),
            (
                "\\ISO 2022 IR 149",
                b"\x1b$)C\xb1\xe8\xc8\xf1\xc1\xdf",
                "김희중",
            ),
            ("ISO_IR 100", b"\xc4neas^R\xfcdiger", "Äneas^Rüdiger"),
            (
                "ISO_IR 127",
                b"\xe2\xc8\xc7\xe6\xea^\xe4\xe6\xd2\xc7\xd1",
                "قباني^لنزار",
            ),
            (
                "ISO_IR 138",
                b"\xf9\xf8\xe5\xef^\xe3\xe1\xe5\xf8\xe4",
                "שרון^דבורה",
            ),
            ("ISO_IR 144", b"\xbb\xee\xdace\xdc\xd1yp\xd3", "Люкceмбypг"),
            (
                "ISO_IR 192",
                b"Wang^XiaoDong=\xe7\x8e\x8b^\xe5\xb0\x8f\xe4\xb8\x9c=",
                "Wang^XiaoDong=王^小东=",
            ),
            (
                "ISO_IR 192",
                b"Wang^XiaoDong=\xe7\x8e\x8b^\xe5\xb0\x8f\xe6\x9d\xb1=",
                "Wang^XiaoDong=王^小東=",
            ),
            (
                "GB18030",
                b"Wang^XiaoDong=\xcd\xf5^\xd0\xa1\xb6\xab=",
                "Wang^XiaoDong=王^小东=",
            ),
            (
                "GBK",
                b"Wang^XiaoDong=\xcd\xf5^\xd0\xa1\x96|=",
                "Wang^XiaoDong=王^小東=",
            ),
            (
                "\\ISO 2022 IR 58",
                b"Zhang^XiaoDong=\x1b$)A\xd5\xc5^\x1b$)A\xd0\xa1\xb6\xab=",
                "Zhang^XiaoDong=张^小东=",
            ),
        ];
        for (terms, bytes, text) in examples {
            assert_eq!(name(terms, bytes).as_deref(), Ok(*text), "{terms}");
        }
        let lines =
            b"1 \x1b$)A\xb5\xda\xd2\xbb\xd0\xd0\r\n\x1b$)A\xb5\xda\xb6\xfe\xd0\xd0\r\nA\\B^C ";
        let read_lines = read("\\ISO 2022 IR 58", lines, Division::Lines);
        assert_eq!(read_lines.as_deref(), Ok("1 第一行\r\n第二行\r\nA\\B^C"));
    }

    #[test]
    fn every_single_byte_set_and_its_escape_sequence_are_read() {
        let cases: &[(&str, &[u8], &[u8], &str)] = &[
            ("100", b"-A", b"Buc^J\xe9r\xf4me", "Buc^Jérôme"),
            ("101", b"-B", b"Wa\xb3\xeasa", "Wałęsa"),
            ("109", b"-C", b"\xa1", "Ħ"),
            ("110", b"-D", b"\xb1", "ą"),
            ("144", b"-L", b"\xbb\xeeda\xdc", "Люdaм"),
            ("127", b"-G", b"\xe2\xc8\xc7\xe6\xea", "قباني"),
            (
                "126",
                b"-F",
                b"\xc4\xe9\xef\xed\xf5\xf3\xe9\xef\xf2",
                "Διονυσιος",
            ),
            ("138", b"-H", b"\xf9\xf8\xe5\xef", "שרון"),
            ("148", b"-M", b"\xc7avu\xfeo\xf0lu", "Çavuşoğlu"),
            ("166", b"-T", b"\xb9\xd2\xc1\xca\xa1\xd8\xc5", "นามสกุล"),
            ("203", b"-b", b"\xa4", "€"),
            ("13", b")I", b"\xd4\xcf\xc0\xde", "ﾔﾏﾀﾞ"),
        ];
        for (number, escape, bytes, text) in cases {
            for term in [format!("ISO_IR {number}"), format!("ISO 2022 IR {number}")] {
                assert_eq!(name(&term, bytes).as_deref(), Ok(*text), "{term}");
                let both = format!("ISO 2022 IR 6\\{term}");
                let whole = [b"A=", &b"\x1b"[..], escape, bytes].concat();
                if !bytes.contains(&b'^') {
                    let expected = format!("A={text}");
                    assert_eq!(name(&both, &whole), Ok(expected), "{both}");
                }
                // Without the term, the same bytes name nothing.
                assert!(
                    name("ISO 2022 IR 6\\ISO 2022 IR 87", &whole).is_err(),
                    "{term}"
                );
            }
        }
        let all = "ISO 2022 IR 100\\ISO 2022 IR 144\\ISO 2022 IR 126";
        let mixed = b"\xc4^\x1b-F\xc4^\xc4=\x1b-L\xc4\x1b-A\xc4";
        assert_eq!(name(all, mixed).as_deref(), Ok("Ä^Δ^Ä=ФÄ"));
        assert_eq!(name("ISO_IR 13", b"~A\\B"), Ok("\u{203e}A\\B".into()));
        let kanji = b"\x1b$(D\x6c\x3f\x30\x21\x1b$B\x21\x41\x21\x42\x21\x5d\x1b(B";
        let sets = "\\ISO 2022 IR 87\\ISO 2022 IR 159";
        assert_eq!(name(sets, kanji).map(|t| t.chars().count()), Ok(5));
        assert!(name(sets, kanji).is_ok_and(|t| t.ends_with("丂〜‖−")));
    }

    #[test]
    fn sets_are_restored_at_every_delimiter_and_kept_elsewhere() {
        let greek = "\\ISO 2022 IR 126";
        let after = |between: &str, division| {
            let bytes = [b"\x1b-F\xc4", between.as_bytes(), b"\xc4"].concat();
            read(greek, &bytes, division).is_ok()
        };
        for (between, lines, values, names) in [
            ("A", true, true, true),
            (" ", true, true, true),
            ("\\", true, false, false),
            ("^", true, true, false),
            ("=", true, true, false),
            ("\r", false, false, false),
            ("\n", false, false, false),
            ("\u{c}", false, false, false),
            ("\t", false, false, false),
        ] {
            let kept = [
                after(between, Division::Lines),
                after(between, Division::Values),
                after(between, Division::Names),
            ];
            assert_eq!(kept, [lines, values, names], "{between:?}");
        }
        // The second byte of a pair is no delimiter: `$^` and `=;` are characters.
        let pairs = name("\\ISO 2022 IR 87", b"\x1b$B$^=;\x1b(B^A");
        assert_eq!(pairs.as_deref(), Ok("ま住^A"));
        assert!(!Division::Codes.restores(b'^'));
    }

    #[test]
    fn what_cannot_be_told_is_an_error() {
        for (terms, bytes) in [
            ("", &b"J\xe9r\xf4me"[..]),
            ("ISO_IR 6", b"J\xe9r\xf4me"),
            ("ISO_IR 999", b"J\xe9r\xf4me"),
            ("ISO_IR 999", b"\x1b$B;3\x1b(B"),
            ("ISO_IR 100\\ISO_IR 192", b"\x1b%G\xc3\xa9"),
            ("\\ISO_IR 192", b"\xc3\xa9"),
            ("ISO_IR 192", b"J\xe9r\xf4me"),
            ("ISO_IR 192", b"\x1b$B;3\x1b(B"),
            ("ISO_IR 192", "a\u{fffd}".as_bytes()),
            ("ISO_IR 192", "a\u{202e}b".as_bytes()),
            ("ISO_IR 192", "a\u{2028}b".as_bytes()),
            ("GB18030", b"\xcd\x20"),
            ("GB18030", b"\xcd"),
            ("GB18030", b"\x80"),
            ("GB18030", b"\x81\x30\x81"),
            ("GBK", b"\x81\x30\x81\x30"),
            ("ISO_IR 100", b"A\x80B"),
            ("ISO_IR 100", b"A\x9b2J"),
            ("ISO_IR 100", b"A\x1b[2J^B\n"),
            ("ISO_IR 100", b"A\tB"),
            ("ISO_IR 127", b"\xa1"),
            ("ISO_IR 138", b"\xbf"),
            ("ISO_IR 109", b"\xa5"),
            ("ISO_IR 166", b"\x85"),
            ("ISO_IR 13", b"\xe0"),
            ("\\ISO 2022 IR 87", b"\x1b$B;"),
            ("\\ISO 2022 IR 87", b"\x1b$B;3E\x1b(B"),
            ("\\ISO 2022 IR 87", b"\x1b$B\x7e\x7e\x1b(B"),
            ("\\ISO 2022 IR 87", b"\x1b$"),
            ("\\ISO 2022 IR 87", b"\x1b"),
            ("\\ISO 2022 IR 149", b"\xc8\xab"),
            ("\\ISO 2022 IR 149", b"\x1b$)C\xc8"),
            ("\\ISO 2022 IR 149", b"\x1b$)C\xc8a"),
            ("\\ISO 2022 IR 149", b"\x1b$)C\xc8\xab^\xc8\xab"),
            ("\\ISO 2022 IR 58", b"\x1b$)C\xc8\xab"),
        ] {
            let read = name(terms, bytes);
            assert!(read.is_err(), "{terms}: {bytes:?} is {read:?}");
        }
        // Dates, numbers and UIDs are ASCII whatever the file names.
        assert!(read("ISO_IR 192", "2025é".as_bytes(), Division::Codes).is_err());
        assert_eq!(
            read("GBK", b"20250115\0", Division::Codes).as_deref(),
            Ok("20250115")
        );
    }

    #[test]
    fn ascii_is_read_whatever_a_file_names() {
        for terms in [
            "",
            "ISO_IR 999",
            "ISO_IR 192",
            "GB18030",
            "\\ISO 2022 IR 87",
            "UTF-8",
        ] {
            let read = name(terms, b" Doe^Jane ");
            assert_eq!(read.as_deref(), Ok("Doe^Jane"), "{terms}");
        }
        let stated = |terms: &[&str]| {
            let terms: Vec<String> = terms.iter().map(|t| (*t).to_owned()).collect();
            CharacterSets::from_terms(&terms)
                .unknown()
                .map(str::to_owned)
        };
        assert_eq!(stated(&["", "ISO 2022 IR 87"]), None);
        assert_eq!(
            stated(&["ISO_IR 100", "KLINGON"]).as_deref(),
            Some("KLINGON")
        );
        assert_eq!(stated(&["", "GBK"]).as_deref(), Some("GBK"));
    }
}
