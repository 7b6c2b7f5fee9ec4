//! Errors of SQLite as kinds of failures of the storage.

use crate::jobs::{StoreError, StoreFault};

/// Primary result codes of SQLite (<https://sqlite.org/rescode.html>).
const BUSY: i32 = 5;
const LOCKED: i32 = 6;
const READ_ONLY: i32 = 8;
const IO_ERROR: i32 = 10;
const CORRUPT: i32 = 11;
const FULL: i32 = 13;
const CANNOT_OPEN: i32 = 14;
const NOT_A_DATABASE: i32 = 26;

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        StoreError::Database {
            cause: cause(&error),
            message: error.to_string(),
        }
    }
}

fn cause(error: &sqlx::Error) -> StoreFault {
    match error {
        sqlx::Error::Database(error) => {
            let extended: i32 = error.code().and_then(|c| c.parse().ok()).unwrap_or(0);
            match extended & 0xff {
                FULL => StoreFault::Full,
                BUSY | LOCKED => StoreFault::Busy,
                IO_ERROR | READ_ONLY | CANNOT_OPEN => StoreFault::Disk,
                CORRUPT | NOT_A_DATABASE => StoreFault::DamagedDatabase,
                _ => StoreFault::Other,
            }
        }
        sqlx::Error::PoolTimedOut => StoreFault::Busy,
        sqlx::Error::Io(_) => StoreFault::Disk,
        _ => StoreFault::Other,
    }
}
