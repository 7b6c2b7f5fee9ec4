//! The notes about a database beside it: what they say, and where they lie. What follows from them is in
//! [`super::kept`].

use crate::blobs;
use async_trait::async_trait;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use ventriform_service::base::records::{BlobError, StoreError, StoreResult, Timestamp, random_id};
use ventriform_service::callers::Anchor;

/// The name of the note, in the folder and in the bucket.
pub(crate) const NOTE_FILE: &str = "kept.json";

/// A place for a note that is no folder.
#[async_trait]
pub(crate) trait NotePlace: Send + Sync {
    /// The name of the place.
    fn place(&self) -> String;

    /// What is there, if anything.
    async fn read_note(&self) -> Result<Option<Vec<u8>>, BlobError>;

    /// Replaces it.
    async fn write_note(&self, text: Vec<u8>) -> Result<(), BlobError>;
}

/// A note about a database.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Note {
    /// The identity of the database.
    pub store: String,
    /// Whether callers without credentials are refused.
    pub closed: bool,
    /// Position of the newest row of the audit trail.
    pub sequence: i64,
    /// Its hash.
    pub hash: String,
    /// When it was written.
    pub noted_at: Timestamp,
    /// Where it was written: a bucket, or the number of the file's inode.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<String>,
}

/// What was found at a place for notes.
pub(crate) enum Found {
    /// Nothing.
    Nothing,
    /// It cannot be read as a note, or is a copy of one.
    Doubtful {
        why: &'static str,
        note: Option<Note>,
    },
    /// A note where it was written.
    Whole(Note),
}

impl Found {
    /// The note, also if it is a copy.
    pub fn note(&self) -> Option<&Note> {
        match self {
            Self::Whole(note) => Some(note),
            Self::Doubtful { note, .. } => note.as_ref(),
            Self::Nothing => None,
        }
    }
}

/// The places of the notes about one database.
#[derive(Default, Clone)]
pub(crate) struct Beside {
    /// The data folder.
    pub folder: Option<PathBuf>,
    /// The bucket.
    pub bucket: Option<Arc<dyn NotePlace>>,
}

impl Beside {
    /// A data folder alone.
    pub fn folder(folder: &Path) -> Self {
        Self {
            folder: Some(folder.to_owned()),
            bucket: None,
        }
    }

    /// What is there now, place by place.
    pub async fn read(&self) -> StoreResult<Vec<Found>> {
        let mut found = Vec::new();
        if let Some(folder) = &self.folder {
            found.push(read_file(&folder.join(NOTE_FILE)).map_err(|e| cannot("read", &e))?);
        }
        if let Some(bucket) = &self.bucket {
            found.push(match bucket.read_note().await? {
                Some(text) => parsed(&text, Some(bucket.place())),
                None => Found::Nothing,
            });
        }
        Ok(found)
    }

    /// Writes a note to each place.
    pub async fn write(&self, note: &Note) -> StoreResult<()> {
        if let Some(bucket) = &self.bucket {
            let note = Note {
                place: Some(bucket.place()),
                ..note.clone()
            };
            let text = serde_json::to_vec(&note).map_err(|e| cannot("write", &e))?;
            bucket.write_note(text).await?;
        }
        match &self.folder {
            Some(folder) => write_file(folder, note.clone()).map_err(|e| cannot("write", &e)),
            None => Ok(()),
        }
    }
}

fn cannot(what: &str, error: &dyn std::fmt::Display) -> StoreError {
    StoreError::database(format!("{NOTE_FILE} cannot be {what}: {error}"))
}

/// The note in `text`, found at `place`.
fn parsed(text: &[u8], place: Option<String>) -> Found {
    match serde_json::from_slice::<Note>(text) {
        Ok(note) if note.place.is_some() && note.place != place => Found::Doubtful {
            why: "it is a copy",
            note: Some(note),
        },
        Ok(note) => Found::Whole(note),
        Err(_) => Found::Doubtful {
            why: "it is damaged",
            note: None,
        },
    }
}

fn read_file(path: &Path) -> io::Result<Found> {
    let text = match fs::read(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Found::Nothing),
        read => read?,
    };
    Ok(parsed(&text, inode(&fs::metadata(path)?)))
}

fn write_file(folder: &Path, mut note: Note) -> io::Result<()> {
    let draft = folder.join(random_id(&format!("{NOTE_FILE}.")));
    let file = fs::File::create_new(&draft)?;
    note.place = inode(&file.metadata()?);
    drop(file);
    let written = fs::write(&draft, serde_json::to_vec(&note)?)
        .and_then(|()| blobs::sync(&draft))
        .and_then(|()| fs::rename(&draft, folder.join(NOTE_FILE)))
        .and_then(|()| blobs::sync(folder));
    if written.is_err() {
        let _ = fs::remove_file(&draft);
    }
    written
}

#[cfg(unix)]
#[allow(clippy::unnecessary_wraps, reason = "other systems number no inodes")]
fn inode(file: &fs::Metadata) -> Option<String> {
    use std::os::unix::fs::MetadataExt;
    Some(format!("inode {}", file.ino()))
}

#[cfg(not(unix))]
fn inode(_: &fs::Metadata) -> Option<String> {
    None
}

impl Note {
    /// The newest row of the trail that it names.
    pub fn head(&self) -> Anchor {
        Anchor {
            sequence: self.sequence,
            hash: self.hash.clone(),
        }
    }
}
