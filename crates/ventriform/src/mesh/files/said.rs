//! A file's statements about unit and frame.

use super::error::MeshFileError;
use super::statement::{MeshFrame, MeshUnit};

/// The statement of the caller or the file.
///
/// # Errors
/// [`MeshFileError::Contradiction`] if both do, and differ.
pub(super) fn agreed<T: Copy + PartialEq + Named>(
    field: &'static str,
    caller: Option<T>,
    file: Option<T>,
) -> Result<Option<T>, MeshFileError> {
    match (caller, file) {
        (Some(caller), Some(file)) if caller != file => Err(MeshFileError::Contradiction {
            field,
            file: file.name(),
            caller: caller.name(),
        }),
        _ => Ok(caller.or(file)),
    }
}

/// A value with a name in files and requests.
pub(super) trait Named {
    fn name(&self) -> &'static str;
}

impl Named for MeshUnit {
    fn name(&self) -> &'static str {
        self.as_str()
    }
}

impl Named for MeshFrame {
    fn name(&self) -> &'static str {
        self.as_str()
    }
}

/// Unit and frame in a file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Said {
    pub unit: Option<MeshUnit>,
    pub frame: Option<MeshFrame>,
}

impl Said {
    /// Takes what a comment says: `SPACE=LPS` or `SPACE=RAS`, and `UNIT=mm`.
    ///
    /// # Errors
    /// [`MeshFileError::UnknownWord`] for another word, [`MeshFileError::Contradiction`] if an earlier comment
    /// said otherwise.
    pub fn hear(&mut self, comment: &[u8]) -> Result<(), MeshFileError> {
        for word in after(comment, b"SPACE=") {
            self.frame("SPACE", word)?;
        }
        for word in after(comment, b"UNIT=") {
            self.unit("UNIT", word)?;
        }
        Ok(())
    }

    /// Takes the frame that the field `field` names.
    ///
    /// # Errors
    /// As [`Said::hear`].
    pub fn frame(&mut self, field: &'static str, word: &[u8]) -> Result<(), MeshFileError> {
        // The words of NRRD and of 3D Slicer.
        let frame = match word.to_ascii_lowercase().as_slice() {
            b"lps" | b"left-posterior-superior" => MeshFrame::Lps,
            b"ras" | b"right-anterior-superior" => MeshFrame::Ras,
            _ => return Err(unknown(field, word, "LPS or RAS")),
        };
        self.frame = agreed("frame", self.frame, Some(frame))?;
        Ok(())
    }

    /// Takes the unit that the field `field` names.
    ///
    /// # Errors
    /// As [`Said::hear`].
    pub fn unit(&mut self, field: &'static str, word: &[u8]) -> Result<(), MeshFileError> {
        let word = word.to_ascii_lowercase();
        let name = std::str::from_utf8(&word).ok();
        let unit = name.and_then(MeshUnit::named);
        let unit = unit.ok_or_else(|| unknown(field, &word, "mm, cm or m"))?;
        self.unit = agreed("unit", self.unit, Some(unit))?;
        Ok(())
    }
}

fn unknown(field: &'static str, word: &[u8], known: &'static str) -> MeshFileError {
    MeshFileError::UnknownWord {
        field,
        word: word[..word.len().min(32)].escape_ascii().to_string(),
        known,
    }
}

/// The words after `key`, each up to white space or punctuation.
fn after<'a>(comment: &'a [u8], key: &'static [u8]) -> impl Iterator<Item = &'a [u8]> {
    let places = comment.windows(key.len()).enumerate();
    let places = places.filter(move |(_, seen)| *seen == key);
    places.map(move |(at, _)| {
        let rest = &comment[at + key.len()..];
        let word = |b: &u8| b.is_ascii_alphanumeric() || *b == b'-' || *b == b'_';
        let end = rest.iter().position(|b| !word(b)).unwrap_or(rest.len());
        &rest[..end]
    })
}
