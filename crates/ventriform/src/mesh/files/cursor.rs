//! A place in a file, from which lines, words and bytes are taken.

use super::MeshFormat;
use super::error::MeshFileError;
use super::number::NumberType;
use super::parsed::damaged;
use crate::base::progress::Monitor;

/// Longest line of text, bytes.
const MAX_LINE_BYTES: usize = 1 << 16;
/// Longest word of text, bytes.
const MAX_WORD_BYTES: usize = 64;

pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    format: MeshFormat,
    monitor: Monitor<'static>,
}

impl<'a> Cursor<'a> {
    /// The beginning of `bytes`; everything that is taken checks the cancel token.
    pub fn new(bytes: &'a [u8], format: MeshFormat, monitor: &Monitor<'_>) -> Self {
        Self {
            bytes,
            at: 0,
            format,
            monitor: monitor.without_observer(),
        }
    }

    /// The monitor whose cancel token is checked.
    pub fn monitor(&self) -> &Monitor<'static> {
        &self.monitor
    }

    /// The bytes that are left.
    pub fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// An error at this place.
    pub fn damaged(&self, reason: impl Into<String>) -> MeshFileError {
        damaged(self.format, self.at, reason)
    }

    /// The next `count` bytes.
    ///
    /// # Errors
    /// If there are fewer.
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], MeshFileError> {
        self.monitor.check()?;
        let rest = self.rest();
        if count > rest.len() {
            return Err(self.damaged(format!(
                "{count} bytes should follow, and {} are left",
                rest.len()
            )));
        }
        self.at += count;
        Ok(&rest[..count])
    }

    /// Refuses `count` elements of at least `each` bytes if there are not so many bytes left.
    ///
    /// # Errors
    /// If there are fewer.
    pub fn require(&self, count: u64, each: usize, what: &str) -> Result<usize, MeshFileError> {
        let left = self.rest().len() as u64;
        // The last number of a text needs no white space after it.
        match count.checked_mul(each as u64) {
            Some(needed) if needed <= left + 1 => Ok(count as usize),
            _ => Err(self.damaged(format!(
                "{count} {what} are stated, and {left} bytes are left"
            ))),
        }
    }

    /// The next line without its end; `None` at the end of the file.
    ///
    /// # Errors
    /// If it is longer than [`MAX_LINE_BYTES`].
    pub fn line(&mut self) -> Result<Option<&'a [u8]>, MeshFileError> {
        self.monitor.check()?;
        let rest = self.rest();
        if rest.is_empty() {
            return Ok(None);
        }
        let seen = &rest[..rest.len().min(MAX_LINE_BYTES + 1)];
        let end = match seen.iter().position(|b| *b == b'\n') {
            Some(end) => end,
            None if seen.len() > MAX_LINE_BYTES => {
                return Err(self.damaged(format!("a line has more than {MAX_LINE_BYTES} bytes")));
            }
            None => seen.len(),
        };
        self.at += (end + 1).min(rest.len());
        let line = &rest[..end];
        Ok(Some(line.strip_suffix(b"\r").unwrap_or(line)))
    }

    /// The next word; `None` at the end of the file.
    ///
    /// # Errors
    /// If it is longer than [`MAX_WORD_BYTES`].
    pub fn word(&mut self) -> Result<Option<&'a [u8]>, MeshFileError> {
        self.monitor.check()?;
        let rest = self.rest();
        let white = rest.iter().position(|b| !b.is_ascii_whitespace());
        let Some(begin) = white else {
            self.at = self.bytes.len();
            return Ok(None);
        };
        self.at += begin;
        let rest = self.rest();
        let seen = &rest[..rest.len().min(MAX_WORD_BYTES + 1)];
        let end = seen.iter().position(u8::is_ascii_whitespace);
        let end = match end {
            Some(end) => end,
            None if seen.len() > MAX_WORD_BYTES => {
                return Err(self.damaged(format!("a word has more than {MAX_WORD_BYTES} bytes")));
            }
            None => seen.len(),
        };
        self.at += end;
        Ok(Some(&rest[..end]))
    }

    /// The next word as a number.
    ///
    /// # Errors
    /// If there is none.
    pub fn number(&mut self) -> Result<f64, MeshFileError> {
        let word = self.word()?;
        let word = word.ok_or_else(|| self.damaged("a number is missing"))?;
        number(word).ok_or_else(|| {
            self.damaged(format!("a number should end here: {}", word.escape_ascii()))
        })
    }

    /// The next number in binary.
    ///
    /// # Errors
    /// If bytes are missing.
    pub fn binary(&mut self, kind: NumberType, big_endian: bool) -> Result<f64, MeshFileError> {
        Ok(kind.read(self.take(kind.bytes())?, big_endian))
    }
}

/// The number that `word` is.
pub(super) fn number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// The words of a line.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty())
}
