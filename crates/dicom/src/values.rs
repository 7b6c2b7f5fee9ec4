//! Which texts are values of their representation (PS3.5 6.2 and 9.1).
//!
//! In: a text, as a file states it. Out: dates, times and the patient's sex as the standard writes them, identifiers,
//! and as much of a longer text as its representation may have. A file may hold anything; an archive refuses an object
//! with another value, or files it where nobody finds it.

/// Longest UID, characters.
const LONGEST_UID: usize = 64;

/// Most digits of a fraction of a second.
const MOST_FRACTION_DIGITS: usize = 6;

/// The value representation of a text, as far as it is checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Representation {
    /// UI.
    Uid,
    /// DA.
    Date,
    /// TM.
    Time,
    /// CS of the patient's sex: M, F or O.
    Sex,
}

/// The value representation of a text that may be too long.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Text {
    /// LO.
    Long,
    /// SH.
    Short,
    /// PN: up to three groups between equals signs.
    Name,
}

impl Text {
    /// Most characters of a value, of a name those of each group (PS3.5 6.2).
    pub fn most(self) -> usize {
        match self {
            Self::Long | Self::Name => 64,
            Self::Short => 16,
        }
    }

    /// As much of `text` as fits; `None` if all does.
    pub fn fitted(self, text: &str) -> Option<String> {
        let cut = |part: &str| -> String { part.chars().take(self.most()).collect() };
        let fitted = match self {
            Self::Name => text
                .split('=')
                .take(3)
                .map(cut)
                .collect::<Vec<_>>()
                .join("="),
            _ => cut(text),
        };
        (fitted != text).then(|| fitted.trim_end().to_owned())
    }
}

impl Representation {
    /// `text` as the standard writes it; `None` if it is no such value.
    pub fn settled(self, text: &str) -> Option<String> {
        let text = text.trim_matches(['\0', ' ']);
        match self {
            Self::Uid => is_uid(text).then(|| text.to_owned()),
            Self::Date => date(text),
            Self::Time => time(text),
            Self::Sex => sex(text),
        }
    }

    /// What another text is not, in words that follow `is`.
    pub fn expected(self) -> &'static str {
        match self {
            Self::Uid => {
                "no UID (numbers without leading zeros, separated by dots, at most 64 characters)"
            }
            Self::Date => "no date (YYYYMMDD)",
            Self::Time => "no time (HHMMSS.FFFFFF)",
            Self::Sex => "not M, F or O",
        }
    }
}

/// Whether `text` is a unique identifier (PS3.5 section 9.1).
pub fn is_uid(text: &str) -> bool {
    let number = |part: &str| {
        let digits = !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
        digits && (part == "0" || !part.starts_with('0'))
    };
    text.len() <= LONGEST_UID && text.contains('.') && text.split('.').all(number)
}

/// Whether `text` is a date of the calendar as `YYYYMMDD`.
pub fn is_date(text: &str) -> bool {
    let number = |range: std::ops::Range<usize>| text.get(range)?.parse::<u32>().ok();
    let digits = text.len() == 8 && text.bytes().all(|b| b.is_ascii_digit());
    let (true, Some(year), Some(month), Some(day)) =
        (digits, number(0..4), number(4..6), number(6..8))
    else {
        return false;
    };
    let leap = year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    let days = match month {
        2 if leap => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => 0,
    };
    year > 0 && (1..=days).contains(&day)
}

/// The date that `text` states: `YYYYMMDD`, with dots, dashes or slashes, or with a time after it.
fn date(text: &str) -> Option<String> {
    let digits: String = match text.as_bytes() {
        [_, _, _, _, a @ (b'.' | b'-' | b'/'), _, _, b, _, _] if a == b => {
            text.split(char::from(*a)).collect()
        }
        [..] if text.len() > 8 && text.is_char_boundary(8) => {
            time(&text[8..])?;
            text[..8].to_owned()
        }
        _ => text.to_owned(),
    };
    is_date(&digits).then_some(digits)
}

/// The time of day that `text` states: `HH`, `HHMM`, `HHMMSS` or `HHMMSS.FFFFFF`, or with colons between the numbers.
fn time(text: &str) -> Option<String> {
    let (whole, fraction) = match text.split_once('.') {
        Some((whole, fraction)) => (whole, Some(fraction)),
        None => (text, None),
    };
    let parts: Vec<&str> = if whole.contains(':') {
        whole.split(':').collect()
    } else {
        let places = (0..whole.len()).step_by(2);
        places
            .map(|at| whole.get(at..at + 2))
            .collect::<Option<_>>()?
    };
    let numbers = parts.iter().zip([23, 59, 60]);
    let two_digits = |part: &str| part.len() == 2 && part.bytes().all(|b| b.is_ascii_digit());
    let valid = (1..=3).contains(&parts.len())
        && numbers.into_iter().all(|(part, most)| {
            two_digits(part) && part.parse::<u32>().is_ok_and(|number| number <= most)
        });
    let fraction = match fraction {
        None => None,
        Some(digits) if parts.len() == 3 && !digits.is_empty() => {
            let all = digits.bytes().all(|b| b.is_ascii_digit());
            Some(all.then(|| &digits[..digits.len().min(MOST_FRACTION_DIGITS)])?)
        }
        Some(_) => return None,
    };
    let fraction = fraction.map_or_else(String::new, |digits| format!(".{digits}"));
    valid.then(|| parts.concat() + &fraction)
}

/// The patient's sex that `text` states, in whatever letters.
fn sex(text: &str) -> Option<String> {
    let letter = match text.to_ascii_uppercase().as_str() {
        "M" | "MALE" => "M",
        "F" | "FEMALE" => "F",
        "O" | "OTHER" => "O",
        _ => return None,
    };
    Some(letter.to_owned())
}

/// A date (DA) as `YYYY-MM-DD`; `None` of another text.
pub fn dashed_date(text: &str) -> Option<String> {
    let is_date = text.len() == 8 && text.bytes().all(|byte| byte.is_ascii_digit());
    is_date.then(|| format!("{}-{}-{}", &text[..4], &text[4..6], &text[6..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_numbers_between_dots() {
        for right in ["1.2", "1.2.840.10008.5.1.4.1.1.20", "2.25.0", "0.1"] {
            assert!(is_uid(right), "{right}");
        }
        for wrong in [
            "", ".", "..", "1", "1..2", "1.", ".1", "01.2", "1.02", "1.a", "1.2 ", "1.2\\1.3",
        ] {
            assert!(!is_uid(wrong), "{wrong}");
        }
        assert!(
            is_uid(&format!("1.{}", "2".repeat(62))) && !is_uid(&format!("1.{}", "2".repeat(63)))
        );
    }

    #[test]
    fn dates_and_times_are_put_right_or_left_out() {
        for (text, right) in [
            ("20240229", Some("20240229")),
            ("2025.03.10", Some("20250310")),
            ("2025-03-10", Some("20250310")),
            ("2025/03/10", Some("20250310")),
            ("20250310091500", Some("20250310")),
            ("20250229", None),
            ("20251310", None),
            ("20250400", None),
            ("00000000", None),
            ("2025.03-10", None),
            ("202503", None),
            ("10032025", None),
            ("20250310-20250311", None),
            ("2025\u{663}310", None),
            ("today", None),
        ] {
            assert_eq!(date(text).as_deref(), right, "{text}");
        }
        for (text, right) in [
            ("09", Some("09")),
            ("0915", Some("0915")),
            ("091500", Some("091500")),
            ("091500.123456", Some("091500.123456")),
            ("091500.12345678", Some("091500.123456")),
            ("09:15:00", Some("091500")),
            ("09:15", Some("0915")),
            ("09:15:00.5", Some("091500.5")),
            ("245000", None),
            ("096000", None),
            ("9", None),
            ("0915.5", None),
            ("091500.", None),
            ("morning", None),
            ("", None),
        ] {
            assert_eq!(time(text).as_deref(), right, "{text}");
        }
    }

    #[test]
    fn names_have_three_groups_and_each_fits() {
        let group = "A".repeat(64);
        assert_eq!(Text::Name.fitted(&format!("{group}={group}={group}")), None);
        let long = format!("{group}B={group}={group}C=D");
        let cut = format!("{group}={group}={group}");
        assert_eq!(Text::Name.fitted(&long), Some(cut));
    }

    #[test]
    fn dates_have_eight_digits() {
        assert_eq!(dashed_date("20261130").unwrap(), "2026-11-30");
        for other in ["", "2026.11.30", "2026113", "2026113x", "２026113"] {
            assert_eq!(dashed_date(other), None, "{other}");
        }
    }
}
