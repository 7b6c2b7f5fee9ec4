//! A structure's name as callers give it.

use std::convert::Infallible;
use std::str::FromStr;

/// A structure by number or name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MaskLabel {
    /// Label of a map, or Segment Number.
    Number(i64),
    /// Segment Label, or meaning or value of a segment's code; upper and lower case are the same.
    Name(String),
}

impl FromStr for MaskLabel {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        let text = text.trim();
        Ok(match text.parse() {
            Ok(number) => MaskLabel::Number(number),
            Err(_) => MaskLabel::Name(text.to_owned()),
        })
    }
}

impl std::fmt::Display for MaskLabel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            MaskLabel::Number(number) => write!(f, "{number}"),
            MaskLabel::Name(name) => write!(f, "\"{name}\""),
        }
    }
}
