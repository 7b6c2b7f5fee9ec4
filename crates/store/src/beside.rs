//! Opening the database for commands beside a service that may be running on it.
//!
//! Such a command works on the store of a service. One that finds none makes none: its answer would be that of an empty
//! store, and a key that it makes would open nothing. Only the first key may have to come before the first start, as a
//! service that is not on loopback starts with a key only; for that, a folder that exists and is empty, or a database
//! without tables, becomes a store ([`IfNone::Make`]).

use super::{
    BLOB_PLACE_FILE, DATABASE_FILE, LOCK_FILE, MARKER_FILE, OpenError, SqlStore,
    UNFINISHED_MIGRATION_FILE, blobs, open_database, postgres, unusable,
};
use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;
use ventriform_service::base::records::Resource;
use ventriform_service::config::PostgresSettings;

/// What to do where there is no store yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IfNone {
    /// Fail.
    Refuse,
    /// Make one in a folder that exists and is empty, or in a database without tables.
    Make,
}

/// The folder that a file system keeps at its top.
const FILE_SYSTEM_FOLDER: &str = "lost+found";

/// The database of the settings.
///
/// # Errors
/// [`OpenError::NoStore`] if there is none; others if it cannot be used, or a service of another version runs on it.
pub async fn open_beside(
    folder: &Path,
    database: Option<&PostgresSettings>,
    if_none: IfNone,
) -> Result<Arc<SqlStore>, OpenError> {
    match database {
        None => require_store(folder, if_none)?,
        // A server that does not answer is waited for below.
        Some(server) => {
            if if_none == IfNone::Refuse && matches!(postgres::has_tables(server).await, Ok(false))
            {
                return Err(OpenError::NoStore {
                    place: server.url.to_string(),
                    reason: "is a database without the tables of a service",
                });
            }
        }
    }
    open_database(folder, database).await
}

/// Refuses a folder that is no data folder of a service: a missing one, one that holds other things, and unless it may
/// be made into one, an empty one.
///
/// # Errors
/// [`OpenError::NoStore`]; others if the folder cannot be read.
pub fn require_store(folder: &Path, if_none: IfNone) -> Result<(), OpenError> {
    let none = |reason| {
        Err(OpenError::NoStore {
            place: folder.display().to_string(),
            reason,
        })
    };
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => {
            return none("is to be the data folder of a service, and there is no such folder");
        }
        Err(error) if error.kind() == ErrorKind::NotADirectory => {
            return none("is to be the data folder of a service, and is no folder");
        }
        Err(error) => return Err(unusable(folder, &error)),
    };
    let mut is_empty = true;
    for entry in entries {
        let name = entry.map_err(|error| unusable(folder, &error))?.file_name();
        let name = name.to_string_lossy();
        if is_of_a_store(&name) {
            return Ok(());
        }
        is_empty &= name == FILE_SYSTEM_FOLDER;
    }
    match (is_empty, if_none) {
        (true, IfNone::Make) => Ok(()),
        (true, IfNone::Refuse) => none("is empty: no service has used it as its data folder"),
        (false, _) => none("holds nothing of a service, so it is no data folder"),
    }
}

/// Whether a file or folder of that name in a data folder is the service's.
fn is_of_a_store(name: &str) -> bool {
    let files = [
        DATABASE_FILE,
        LOCK_FILE,
        MARKER_FILE,
        BLOB_PLACE_FILE,
        UNFINISHED_MIGRATION_FILE,
        blobs::QUARANTINE_FOLDER,
        blobs::RECEIVED_FOLDER,
    ];
    files.contains(&name)
        || Resource::WITH_FILES
            .iter()
            .any(|kind| kind.plural() == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn only_what_a_service_has_used_is_its_data_folder() {
        let base = tempfile::tempdir().unwrap();
        let made = |names: &[&str]| {
            let folder = tempfile::tempdir_in(base.path()).unwrap().keep();
            for name in names {
                fs::write(folder.join(name), "").unwrap();
            }
            folder
        };
        let allowed = |folder: &Path| {
            [IfNone::Refuse, IfNone::Make].map(|if_none| require_store(folder, if_none).is_ok())
        };
        for used in ["ventriform.db", "lock", "volumes", "database", "migration"] {
            assert_eq!(allowed(&made(&[used, "notes.txt"])), [true; 2], "{used}");
        }
        assert_eq!(allowed(&made(&[])), [false, true]);
        assert_eq!(allowed(&made(&["lost+found"])), [false, true]);
        let other = made(&["notes.txt"]);
        assert_eq!(allowed(&other), [false; 2]);
        for nowhere in [base.path().join("nowhere"), other.join("notes.txt")] {
            assert_eq!(allowed(&nowhere), [false; 2], "{}", nowhere.display());
        }
        assert!(!base.path().join("nowhere").exists());
    }
}
