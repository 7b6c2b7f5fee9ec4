//! Writing results to files, and lines to the terminal.
//!
//! Everything that a command prints goes through [`say!`](say) and [`note!`](note): control characters
//! that come from files, names and stores are escaped ([`ventriform::base::text`]), and a reader that has
//! closed the pipe ends the printing without an error. Any other failure to print, such as a full
//! disk, is the failure of the command ([`finish`]).

use anyhow::{Context, Result, bail};
use std::fmt::Display;
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use ventriform::base::text::{escaped_json, escaped_lines};

/// Prints a line to standard output, as `println!` does.
macro_rules! say {
    ($($text:tt)*) => { $crate::cli::output::out(&format_args!($($text)*)) };
}

/// Prints a line to standard error, as `eprintln!` does.
macro_rules! note {
    ($($text:tt)*) => { $crate::cli::output::err(&format_args!($($text)*)) };
}

pub(super) use {note, say};

/// Why standard output could not be written; the first reason counts.
static WRITE_FAILURE: Mutex<Option<io::Error>> = Mutex::new(None);

/// Prints `text` and a line feed to standard output.
pub fn out(text: &dyn Display) {
    let text = text.to_string();
    write_out(format!("{}\n", escaped_lines(&text)).as_bytes());
}

/// Prints JSON text and a line feed to standard output.
pub fn json(text: &str) {
    write_out(format!("{}\n", escaped_json(text)).as_bytes());
}

/// Prints `bytes` as they are to standard output.
pub fn write_out(bytes: &[u8]) {
    keep(io::stdout().lock().write_all(bytes));
}

/// Prints `text` and a line feed to standard error. Where that is closed, nobody reads it.
pub fn err(text: &dyn Display) {
    let text = text.to_string();
    let line = format!("{}\n", escaped_lines(&text));
    io::stderr().lock().write_all(line.as_bytes()).ok();
}

fn keep(outcome: io::Result<()>) {
    if let Err(error) = outcome
        && error.kind() != ErrorKind::BrokenPipe
    {
        let mut failure = WRITE_FAILURE.lock().unwrap_or_else(PoisonError::into_inner);
        failure.get_or_insert(error);
    }
}

/// Ends the printing of a command.
///
/// # Errors
/// If standard output could not be written, other than because its reader is gone.
pub fn finish() -> Result<()> {
    keep(io::stdout().lock().flush());
    let failure = WRITE_FAILURE
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .take();
    match failure {
        Some(error) => bail!("standard output cannot be written: {error}"),
        None => Ok(()),
    }
}

/// Creates a folder and its parents, unless they exist.
pub fn create_folder(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path)
        .with_context(|| format!("cannot create the folder {}", path.display()))
}

/// Writes a file, replacing it if it exists.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}
