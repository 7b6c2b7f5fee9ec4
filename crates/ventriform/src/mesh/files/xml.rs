//! The tags of a VTP file, one after the other.
//!
//! VTK's files may hold raw bytes after their last tag, which is not XML; parsers of XML refuse such files. Entities
//! and document types, which nothing here needs, are refused.

use super::MeshFormat;
use super::error::MeshFileError;
use super::parsed::damaged;

/// Most attributes of a tag.
const MAX_ATTRIBUTES: usize = 32;
/// Longest tag, bytes.
const MAX_TAG_BYTES: usize = 4096;

/// A tag.
#[derive(Debug)]
pub(super) struct Tag<'a> {
    pub name: &'a [u8],
    attributes: Vec<(&'a [u8], &'a [u8])>,
    /// `</name>`.
    pub closes: bool,
    /// `<name/>`.
    pub empty: bool,
    /// The byte after it.
    pub end: usize,
}

impl<'a> Tag<'a> {
    /// The value of an attribute.
    pub fn value(&self, name: &[u8]) -> Option<&'a [u8]> {
        let found = self.attributes.iter().find(|(own, _)| *own == name);
        found.map(|(_, value)| *value)
    }
}

/// The next tag of `bytes` from byte `at` on; `None` if there is none.
///
/// # Errors
/// If it is malformed.
pub(super) fn next(bytes: &[u8], mut at: usize) -> Result<Option<Tag<'_>>, MeshFileError> {
    let wrong = |at: usize, reason: &str| damaged(MeshFormat::Vtp, at, reason);
    loop {
        let Some(begin) = find(bytes, at, b"<") else {
            return Ok(None);
        };
        let rest = &bytes[begin..];
        let skip = if rest.starts_with(b"<!--") {
            Some(&b"-->"[..])
        } else if rest.starts_with(b"<?") {
            Some(&b"?>"[..])
        } else if rest.starts_with(b"<!") {
            return Err(wrong(begin, "document types and CDATA are not read"));
        } else {
            None
        };
        match skip {
            Some(end) => {
                let found = find(bytes, begin, end);
                at = found.ok_or_else(|| wrong(begin, "a comment does not end"))? + end.len();
            }
            None => return tag(bytes, begin).map(Some),
        }
    }
}

/// The first place of `what` from byte `at` on.
pub(super) fn find(bytes: &[u8], at: usize, what: &[u8]) -> Option<usize> {
    let rest = bytes.get(at..)?;
    let found = rest.windows(what.len()).position(|w| w == what)?;
    Some(at + found)
}

fn tag(bytes: &[u8], begin: usize) -> Result<Tag<'_>, MeshFileError> {
    let wrong = |reason: &str| damaged(MeshFormat::Vtp, begin, reason);
    let seen = &bytes[begin + 1..bytes.len().min(begin + 1 + MAX_TAG_BYTES)];
    let mut quote = None;
    let end = seen.iter().position(|b| {
        match (quote, *b) {
            (None, b'"' | b'\'') => quote = Some(*b),
            (Some(open), close) if open == close => quote = None,
            (None, b'>') => return true,
            _ => {}
        }
        false
    });
    let end = end.ok_or_else(|| wrong("a tag does not end"))?;
    let inside = &seen[..end];
    let closes = inside.starts_with(b"/");
    let empty = inside.ends_with(b"/");
    let inside = inside.strip_prefix(b"/").unwrap_or(inside);
    let inside = inside.strip_suffix(b"/").unwrap_or(inside);
    let name_end = inside.iter().position(u8::is_ascii_whitespace);
    let (name, mut rest) = inside.split_at(name_end.unwrap_or(inside.len()));
    let mut attributes = Vec::new();
    loop {
        rest = rest.trim_ascii_start();
        if rest.is_empty() {
            break;
        }
        let attribute = attribute(rest).filter(|_| attributes.len() < MAX_ATTRIBUTES);
        let (name, value, after) = attribute.ok_or_else(|| wrong("an attribute is malformed"))?;
        attributes.push((name, value));
        rest = after;
    }
    Ok(Tag {
        name,
        attributes,
        closes,
        empty,
        end: begin + 1 + end + 1,
    })
}

/// Name and value of the attribute at the beginning of `rest`, and what follows it.
fn attribute(rest: &[u8]) -> Option<(&[u8], &[u8], &[u8])> {
    let equals = rest.iter().position(|b| *b == b'=')?;
    let name = rest[..equals].trim_ascii();
    let after = rest[equals + 1..].trim_ascii_start();
    let quote = *after.first().filter(|b| matches!(**b, b'"' | b'\''))?;
    let end = after[1..].iter().position(|b| *b == quote)?;
    Some((name, &after[1..=end], &after[end + 2..]))
}
