//! Checks one value, text or JSON, against its [`Kind`].

use super::kind::Kind;
use serde_json::Value;

/// A value as the user gave it.
#[derive(Debug, Clone, Copy)]
pub enum RawValue<'a> {
    /// From a query string or a command line.
    Text(&'a str),
    /// From a JSON document.
    Json(&'a Value),
}

/// A value of the right type and in its range.
#[derive(Debug, Clone, PartialEq)]
pub enum Checked {
    Integer(u64),
    Number(f64),
    Switch(bool),
    Integers(Vec<i64>),
    Numbers(Vec<f64>),
    Text(String),
}

/// The getters for the variants. [`RawValue::check`] returns the variant that belongs to the
/// [`Kind`] of the parameter, so each row of a table calls the getter of its own kind.
impl Checked {
    pub(super) fn u64(&self) -> u64 {
        match self {
            Checked::Integer(n) => *n,
            _ => unreachable!("checked against Kind::Integer"),
        }
    }

    pub(super) fn usize(&self) -> usize {
        usize::try_from(self.u64()).unwrap_or(usize::MAX)
    }

    pub(super) fn f64(&self) -> f64 {
        match self {
            Checked::Number(x) => *x,
            _ => unreachable!("checked against Kind::Number"),
        }
    }

    pub(super) fn switch(&self) -> bool {
        match self {
            Checked::Switch(on) => *on,
            _ => unreachable!("checked against Kind::Switch"),
        }
    }

    pub(super) fn numbers(&self) -> &[f64] {
        match self {
            Checked::Numbers(list) => list,
            _ => unreachable!("checked against Kind::Numbers"),
        }
    }

    /// Three numbers, unless the value of a direction is a word.
    pub(super) fn direction(&self) -> Option<&[f64]> {
        match self {
            Checked::Numbers(list) => Some(list),
            _ => None,
        }
    }

    pub(super) fn text(&self) -> &str {
        match self {
            Checked::Text(t) => t,
            _ => unreachable!("checked against a Kind of text"),
        }
    }

    pub(super) fn integers(&self) -> &[i64] {
        match self {
            Checked::Integers(list) => list,
            _ => unreachable!("checked against Kind::Integers"),
        }
    }

    pub(super) fn indices(&self) -> Result<Vec<usize>, String> {
        self.integers()
            .iter()
            .map(|&n| usize::try_from(n).map_err(|_| format!("{n} is not a voxel index")))
            .collect()
    }

    /// The first and the last voxel of a box.
    pub(super) fn corners(&self) -> Result<[[usize; 3]; 2], String> {
        let list = self.indices()?;
        let corners = [[list[0], list[1], list[2]], [list[3], list[4], list[5]]];
        if (0..3).any(|axis| corners[0][axis] > corners[1][axis]) {
            Err("the first corner lies beyond the last one".into())
        } else {
            Ok(corners)
        }
    }
}

impl RawValue<'_> {
    /// Checks type and range.
    pub(super) fn check(&self, kind: &Kind) -> Result<Checked, String> {
        match *kind {
            Kind::Integer { min, max } => {
                let n = self
                    .as_u64()
                    .ok_or(format!("{self} is not a whole number"))?;
                if n < min || n > max {
                    return Err(format!("{n} is out of range"));
                }
                Ok(Checked::Integer(n))
            }
            Kind::Number { min, max } => {
                let x = self.as_f64().ok_or(format!("{self} is not a number"))?;
                if !(min..=max).contains(&x) {
                    return Err(format!("{x} is out of range"));
                }
                Ok(Checked::Number(x))
            }
            Kind::Switch => match self {
                RawValue::Text("true") | RawValue::Json(Value::Bool(true)) => {
                    Ok(Checked::Switch(true))
                }
                RawValue::Text("false") | RawValue::Json(Value::Bool(false)) => {
                    Ok(Checked::Switch(false))
                }
                _ => Err(format!("{self} is neither true nor false")),
            },
            Kind::Choice(words) => match self.as_text() {
                Some(word) if words.contains(&word) => Ok(Checked::Text(word.into())),
                _ => Err(format!("{self} is not one of the choices")),
            },
            Kind::Direction(words) => match (self.as_text(), self.as_numbers()) {
                (Some(word), _) if words.contains(&word) => Ok(Checked::Text(word.into())),
                (_, Some(list)) if list.len() == 3 => Ok(Checked::Numbers(list)),
                _ => Err(format!("{self} is not a direction")),
            },
            Kind::Integers { count } => match self.as_integers() {
                Some(list) if list.len() == count => Ok(Checked::Integers(list)),
                Some(list) => Err(format!("expected {count} numbers, got {}", list.len())),
                None => Err(format!("{self} is not a list of whole numbers")),
            },
            Kind::Numbers { count } => match self.as_numbers() {
                Some(list) if list.len() == count => Ok(Checked::Numbers(list)),
                Some(list) => Err(format!("expected {count} numbers, got {}", list.len())),
                None => Err(format!("{self} is not a list of finite numbers")),
            },
            Kind::Points { most } => match self.as_numbers() {
                Some(list) if list.is_empty() || list.len() % 3 != 0 => Err(format!(
                    "expected three numbers for each point, got {}",
                    list.len()
                )),
                Some(list) if list.len() > 3 * most => {
                    Err(format!("{} points, at most {most}", list.len() / 3))
                }
                Some(list) => Ok(Checked::Numbers(list)),
                None => Err(format!("{self} is not a list of finite numbers")),
            },
            Kind::Stored {
                prefixes,
                word,
                more,
            } => match self.as_text() {
                Some(text) if is_id(text, prefixes) => Ok(Checked::Text(text.into())),
                Some(text) if more > 0 || !word.is_empty() => {
                    let mut ids: Vec<&str> = text.split(',').collect();
                    // Where no word is known, the first id stands in its place.
                    let begins = match word {
                        "" => is_id(ids[0], prefixes),
                        word => ids.remove(0) == word,
                    };
                    let more = more + usize::from(word.is_empty());
                    let known = ids.iter().all(|id| is_id(id, prefixes));
                    let twice = (1..ids.len()).any(|n| ids[..n].contains(&ids[n]));
                    match begins && known {
                        true if twice => Err(format!("{self} names an id twice")),
                        true if ids.len() > more => {
                            Err(format!("{self} names {} ids, at most {more}", ids.len()))
                        }
                        true => Ok(Checked::Text(text.into())),
                        false => Err(format!("{self} is not an id of this kind")),
                    }
                }
                _ => Err(format!("{self} is not an id of this kind")),
            },
            // A label may be a number: 2 and "2" are the same.
            Kind::Text { .. } => match self {
                RawValue::Json(Value::Number(n)) if n.is_i64() => Ok(Checked::Text(n.to_string())),
                _ => self
                    .as_text()
                    .map(|t| Checked::Text(t.into()))
                    .ok_or(format!("{self} is not text")),
            },
        }
    }

    fn as_u64(&self) -> Option<u64> {
        match self {
            RawValue::Text(t) => t.parse().ok(),
            RawValue::Json(v) => v.as_u64(),
        }
    }

    fn as_f64(&self) -> Option<f64> {
        match self {
            RawValue::Text(t) => t.parse().ok().filter(|x: &f64| x.is_finite()),
            RawValue::Json(v) => v.as_f64(),
        }
    }

    fn as_text(&self) -> Option<&str> {
        match self {
            RawValue::Text(t) => Some(t),
            RawValue::Json(v) => v.as_str(),
        }
    }

    fn as_integers(&self) -> Option<Vec<i64>> {
        match self {
            RawValue::Json(Value::Array(list)) => list.iter().map(Value::as_i64).collect(),
            RawValue::Json(Value::Number(n)) => n.as_i64().map(|n| vec![n]),
            _ => self
                .as_text()?
                .split(',')
                .map(|part| part.trim().parse().ok())
                .collect(),
        }
    }

    fn as_numbers(&self) -> Option<Vec<f64>> {
        match self {
            RawValue::Json(Value::Array(list)) => list.iter().map(Value::as_f64).collect(),
            _ => self
                .as_text()?
                .split(',')
                .map(|part| part.trim().parse().ok().filter(|x: &f64| x.is_finite()))
                .collect(),
        }
    }
}

/// Whether `text` consists of one of `prefixes` and 1 to 64 hexadecimal digits.
fn is_id(text: &str, prefixes: &[&str]) -> bool {
    let digits = prefixes.iter().find_map(|prefix| text.strip_prefix(prefix));
    digits.is_some_and(|d| (1..=64).contains(&d.len()) && d.bytes().all(|b| b.is_ascii_hexdigit()))
}

impl std::fmt::Display for RawValue<'_> {
    /// The value as given, cut to 60 characters for an error message.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let text = match self {
            RawValue::Text(t) => format!("`{t}`"),
            RawValue::Json(v) => format!("`{v}`"),
        };
        match text.char_indices().nth(60) {
            Some((end, _)) => write!(f, "{}...`", &text[..end]),
            None => f.write_str(&text),
        }
    }
}
