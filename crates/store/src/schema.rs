//! The tables of SQLite and PostgreSQL as migrations: SQL files in `migrations/` and `migrations_postgres/`, embedded
//! in the program. A file is named `VERSION_DESCRIPTION.sql`. What has been released is never changed, since a database
//! keeps the sum of each file that it was made by.
//!
//! `sqlx::migrate!` would do the same. Its macro crate compiles both drivers, TLS and tokio a second time for the
//! compiler's own use.

use include_dir::{Dir, include_dir};
use sqlx::SqlSafeStr;
use sqlx::migrate::{Migration, MigrationType, Migrator};

static SQLITE: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/src/migrations");
static POSTGRES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/src/migrations_postgres");

/// The tables on SQLite.
pub(super) fn sqlite() -> Migrator {
    embedded(&SQLITE)
}

/// The tables on PostgreSQL.
pub(super) fn postgres() -> Migrator {
    embedded(&POSTGRES)
}

fn embedded(folder: &'static Dir<'static>) -> Migrator {
    Migrator::with_migrations(folder.files().filter_map(migration).collect())
}

/// The migration in a file; `None` if its name or text is none, which a test refuses.
fn migration(file: &'static include_dir::File<'static>) -> Option<Migration> {
    let name = file.path().file_name()?.to_str()?;
    let (version, description) = name.strip_suffix(".sql")?.split_once('_')?;
    Some(Migration::new(
        version.parse().ok()?,
        description.replace('_', " ").into(),
        MigrationType::Simple,
        file.contents_utf8()?.into_sql_str(),
        false,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// sqlx's own reading of the folders is the truth.
    #[tokio::test]
    async fn embedded_migrations_are_those_of_the_folder() {
        for (embedded, folder) in [
            (sqlite(), "src/migrations"),
            (postgres(), "src/migrations_postgres"),
        ] {
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
            let read = Migrator::new(folder.as_path()).await.unwrap();
            let told = |migrator: &Migrator| {
                let of = |m: &Migration| {
                    let description = m.description.to_string();
                    (m.version, description, m.checksum.to_vec(), m.no_tx)
                };
                migrator.iter().map(of).collect::<Vec<_>>()
            };
            assert_eq!(told(&embedded), told(&read));
            assert!(embedded.iter().eq(read.iter()));
            let files = std::fs::read_dir(folder).unwrap().count();
            assert_eq!(embedded.iter().count(), files);
        }
    }
}
