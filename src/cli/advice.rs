//! From errors, which state facts, to what the operator does about them: the commands, flags and settings that help.

use crate::server::ServeError;
use std::error::Error;
use ventriform_service::run::start::StartError;
use ventriform_store::{DoctorError, MigrateError, OpenError};

/// The reason of a failed command, with advice where there is some.
pub fn advised(error: &anyhow::Error) -> String {
    let facts = format!("{error:#}");
    match error.chain().find_map(advice) {
        Some(advice) => format!("{facts}. {advice}"),
        None => facts,
    }
}

fn advice(error: &(dyn Error + 'static)) -> Option<String> {
    match error.downcast_ref() {
        Some(ServeError::Store(error)) => return on_opening(error),
        Some(ServeError::Start(error)) => return on_starting(error),
        _ => {}
    }
    if let Some(DoctorError::Open(error)) = error.downcast_ref() {
        return on_opening(error);
    }
    match error.downcast_ref() {
        Some(MigrateError::Open(error)) => return on_opening(error),
        Some(error) => return on_migrating(error),
        None => {}
    }
    error.downcast_ref().and_then(on_opening)
}

fn on_starting(error: &StartError) -> Option<String> {
    let advice = match error {
        StartError::Role { .. } => {
            "Give every process the same `--database postgres://...` and `--blobs s3://...`, or leave the role at `all`"
        }
        StartError::OpenHttp(_) => {
            "Make a key by `ventriform keys create --name NAME --scope submit --data-dir DIR`, or set `oidc_issuer`, or \
             serve everybody by `--allow-anonymous`"
        }
        StartError::OpenDicom(_) => {
            "List them as `[[senders]]` in the file of `--config`, or let everybody send by `--allow-anonymous`"
        }
        _ => return None,
    };
    Some(advice.to_owned())
}

fn on_opening(error: &OpenError) -> Option<String> {
    Some(match error {
        OpenError::InUse(_) => "Stop that process, or choose another data folder".to_owned(),
        OpenError::DatabaseMissing(folder) => format!(
            "Restore it from a backup together with its -wal file, or make a new one from what lies beside the files: \
             ventriform doctor --data-dir {} --repair",
            folder.display()
        ),
        OpenError::LogMissing(folder) => format!(
            "Restore it together with the database; if it is lost, accept that and check the rest: ventriform doctor \
             --data-dir {} --repair",
            folder.display()
        ),
        OpenError::FilesElsewhere { folder, blobs } => format!(
            "Start the service with `--blobs {blobs}`, or on another folder. If they were moved to another bucket, note \
             it: ventriform migrate --moved-files s3://BUCKET/PREFIX --data-dir {}. Commands that work on the files of \
             a folder cannot be used on it",
            folder.display()
        ),
        OpenError::FilesHere { .. } => {
            "Start the service without `--blobs`, or on another folder".to_owned()
        }
        OpenError::RowsMissing { .. } => {
            "Restore it from a backup, or give another bucket or prefix".to_owned()
        }
        OpenError::DatabaseEmpty { .. } => {
            "Give the database that belongs to the folder, or another folder (data_dir)".to_owned()
        }
        OpenError::OtherFiles { url, own, .. } => format!(
            "Give every process on a database the same `blobs`; a database whose files are in a folder is used with \
             that folder alone. If the files were moved, note it: ventriform migrate --moved-files {own} --database \
             {url}"
        ),
        OpenError::OnServer { marker, .. } => format!(
            "Give that database by --database or VENTRIFORM_DATABASE; it is checked and copied by the tools of \
             PostgreSQL, such as pg_dump. If the folder does not belong to it any more, delete {}",
            marker.display()
        ),
        OpenError::Unfinished { .. } => {
            "Give the same `ventriform migrate` again, which goes on where it stopped".to_owned()
        }
        OpenError::InFile(_) => {
            "Start without --database, or give another folder (data_dir)".to_owned()
        }
        _ => return None,
    })
}

fn on_migrating(error: &MigrateError) -> Option<String> {
    let advice = match error {
        MigrateError::Occupied { .. } => {
            "Give an empty database, an empty prefix of a bucket, or a folder that does not exist"
        }
        MigrateError::Damaged(_) => {
            "Restore them from a backup, or set them aside by `ventriform doctor --data-dir DIR --repair`; then give \
             the same command again, which goes on where it stopped"
        }
        _ => return None,
    };
    Some(advice.to_owned())
}
