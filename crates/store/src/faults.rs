//! Errors of SQLite and of PostgreSQL as kinds of failures of the storage.

use sqlx::postgres::PgPool;
use ventriform_service::base::records::{StoreError, StoreFault};

/// Primary result codes of SQLite (<https://sqlite.org/rescode.html>).
const SQLITE_ERROR: i32 = 1;
const NOT_PERMITTED: i32 = 3;
const SQLITE_BUSY: i32 = 5;
const SQLITE_LOCKED: i32 = 6;
const READ_ONLY: i32 = 8;
const IO_ERROR: i32 = 10;
const SQLITE_CORRUPT: i32 = 11;
const SQLITE_FULL: i32 = 13;
const CANNOT_OPEN: i32 = 14;
const WRONG_FORMAT: i32 = 24;
const NOT_A_DATABASE: i32 = 26;

/// An error of SQLite.
pub(super) fn of_sqlite(error: sqlx::Error) -> StoreError {
    StoreError::Database {
        cause: cause(&error),
        message: error.to_string(),
    }
}

fn cause(error: &sqlx::Error) -> StoreFault {
    match error {
        sqlx::Error::Database(error) => {
            let extended: i32 = error.code().and_then(|c| c.parse().ok()).unwrap_or(0);
            match extended & 0xff {
                SQLITE_FULL => StoreFault::Full,
                SQLITE_BUSY | SQLITE_LOCKED => StoreFault::Busy,
                IO_ERROR | READ_ONLY | CANNOT_OPEN | NOT_PERMITTED => StoreFault::Disk,
                SQLITE_CORRUPT | WRONG_FORMAT | NOT_A_DATABASE => StoreFault::DamagedDatabase,
                SQLITE_ERROR if lacks_table(error.message()) => StoreFault::DamagedDatabase,
                _ => StoreFault::Other,
            }
        }
        sqlx::Error::PoolTimedOut => StoreFault::Busy,
        sqlx::Error::Io(_) => StoreFault::Disk,
        _ => StoreFault::Other,
    }
}

/// Whether SQLite says that a table or a column is gone, which every statement of this program names rightly.
fn lacks_table(message: &str) -> bool {
    ["no such table: ", "no such column: "]
        .iter()
        .any(|said| message.starts_with(said))
}

/// An error of PostgreSQL.
pub(super) fn of_postgres(error: sqlx::Error) -> StoreError {
    let cause = match &error {
        _ if connection_was_lost(&error) => StoreFault::Away,
        _ if plan_is_stale(&error) => StoreFault::Busy,
        _ => sqlstate(&error).map_or(StoreFault::Other, |code| cause_of(&code)),
    };
    StoreError::Database {
        cause,
        message: error.to_string(),
    }
}

/// An error of PostgreSQL while a connection was taken from a pool, or of a statement on it.
pub(super) fn of_pool(pool: &PgPool, error: sqlx::Error) -> StoreError {
    let all_used = pool.size() >= pool.options().get_max_connections();
    match error {
        sqlx::Error::PoolTimedOut if all_used => StoreError::Database {
            cause: StoreFault::Busy,
            message: "all connections to the database are in use (database_connections)".into(),
        },
        sqlx::Error::PoolTimedOut => StoreError::Database {
            cause: StoreFault::Away,
            message: "the server does not accept connections".into(),
        },
        error => of_postgres(error),
    }
}

/// The kind of failure that a code of PostgreSQL stands for
/// (<https://www.postgresql.org/docs/current/errcodes-appendix.html>).
fn cause_of(code: &str) -> StoreFault {
    match code {
        // disk_full
        "53100" => StoreFault::Full,
        // out_of_memory, serialization_failure, deadlock_detected, lock_not_available,
        // query_canceled, idle_in_transaction_session_timeout
        "53200" | "40001" | "40P01" | "55P03" | "57014" | "25P03" => StoreFault::Busy,
        // read_only_sql_transaction: a standby, which may be promoted
        "25006" => StoreFault::Away,
        _ if code.starts_with("58") => StoreFault::Disk,
        // undefined_table, undefined_column: every statement of this program names them rightly
        "42P01" | "42703" => StoreFault::DamagedDatabase,
        // insufficient_privilege
        "42501" => StoreFault::Away,
        // data_corrupted, index_corrupted
        _ if code.starts_with("XX00") && code != "XX000" => StoreFault::DamagedDatabase,
        _ => StoreFault::Other,
    }
}

/// The code of an error that PostgreSQL itself reports.
pub(super) fn sqlstate(error: &sqlx::Error) -> Option<String> {
    let code = error.as_database_error()?.code()?;
    Some(code.into_owned())
}

/// Whether the columns of a table have changed since the server prepared the statement. It has done nothing.
pub(super) fn plan_is_stale(error: &sqlx::Error) -> bool {
    // feature_not_supported, which stands for much else.
    sqlstate(error).is_some_and(|code| code == "0A000") && error.to_string().contains("cached plan")
}

/// Whether the connection is gone, or none could be made for a reason that may pass: the server is not
/// reached, starts, stops, or has no place for another connection.
pub(super) fn connection_was_lost(error: &sqlx::Error) -> bool {
    match error {
        sqlx::Error::Io(_) | sqlx::Error::WorkerCrashed => true,
        // What a broken connection leaves behind is not understood.
        sqlx::Error::Protocol(_) => true,
        _ => sqlstate(error).is_some_and(|code| {
            // connection_exception; admin_shutdown, crash_shutdown, cannot_connect_now;
            // too_many_connections
            code.starts_with("08") || ["57P01", "57P02", "57P03", "53300"].contains(&&*code)
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lost_connection_may_pass_and_a_wrong_statement_may_not() {
        let lost = sqlx::Error::Io(std::io::ErrorKind::ConnectionReset.into());
        assert_eq!(of_postgres(lost).cause(), StoreFault::Away);
        assert!(StoreFault::Away.may_pass());
        assert_eq!(cause_of("40001"), StoreFault::Busy);
        assert_eq!(cause_of("53100"), StoreFault::Full);
        assert_eq!(cause_of("XX001"), StoreFault::DamagedDatabase);
        assert_eq!(cause_of("XX002"), StoreFault::DamagedDatabase);
        assert_eq!(cause_of("42P01"), StoreFault::DamagedDatabase);
        assert_eq!(cause_of("42501"), StoreFault::Away);
        assert_eq!(cause_of("58030"), StoreFault::Disk);
        assert!(lacks_table("no such table: holdings") && !lacks_table("near x: no such table"));
        assert_eq!(cause_of("XX000"), StoreFault::Other);
        assert_eq!(cause_of("42601"), StoreFault::Other);
    }
}
