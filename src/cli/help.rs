//! What the command line says of itself: `-h` on one screen, `--help` in full; and refusals and failures in words.
//!
//! The short help has the arguments that stand under no heading, and those of [`USUAL_SETTINGS`], each with the
//! beginning of its text; the number of the others under each heading; and the first examples. Lists of commands have
//! the beginnings of theirs.

use clap::{Arg, Command};
use std::error::Error;
use std::net::AddrParseError;
use std::num::{IntErrorKind, ParseFloatError, ParseIntError};
use std::str::ParseBoolError;

/// The settings that the short help of `serve` shows.
const USUAL_SETTINGS: [&str; 8] = [
    "listen",
    "data_dir",
    "workers",
    "database",
    "blobs",
    "tls_cert",
    "tls_key",
    "allow_anonymous",
];

/// Longest text of an argument in the short help, characters.
const SHORT_TEXT_CHARS: usize = 58;

/// Most lines of examples in the short help.
const SHORT_EXAMPLE_LINES: usize = 3;

/// The command, whose `-h` fits a screen.
pub fn with_short_help(command: Command) -> Command {
    let mut others: Vec<(String, usize)> = Vec::new();
    let command = command.mut_args(|arg| {
        let arg = with_short_text(arg);
        let heading = arg.get_help_heading().map(str::to_owned);
        let (Some(heading), false) = (heading, arg.is_hide_set()) else {
            return arg;
        };
        if USUAL_SETTINGS.contains(&arg.get_id().as_str()) {
            return arg;
        }
        match others.iter_mut().find(|(known, _)| *known == heading) {
            Some((_, count)) => *count += 1,
            None => others.push((heading, 1)),
        }
        arg.hide_short_help(true)
    });
    let whole = command.get_after_help().map(ToString::to_string);
    let mut end = whole.as_deref().map_or_else(String::new, examples);
    if !others.is_empty() {
        let others = others
            .iter()
            .map(|(name, count)| format!("{name} ({count})"));
        let others = others.collect::<Vec<_>>().join(", ");
        end += &format!("\nMore options in --help: {others}");
    }
    let command = command.mut_subcommands(|below| {
        let about = below.get_about().map(ToString::to_string);
        let below = with_short_help(below);
        match about {
            Some(about) => below.about(beginning(&about)).long_about(about),
            None => below,
        }
    });
    match whole {
        Some(whole) => command
            .after_long_help(whole)
            .after_help(end.trim().to_owned()),
        None if end.is_empty() => command,
        None => command.after_help(end.trim().to_owned()),
    }
}

/// The first lines of examples, in an epilogue that begins with some.
fn examples(whole: &str) -> String {
    let mut lines = whole.lines();
    let Some(first) = lines.next() else {
        return String::new();
    };
    let examples = lines.take_while(|line| line.starts_with("  "));
    let examples = examples.take(SHORT_EXAMPLE_LINES);
    let shown = std::iter::once(first).chain(examples);
    shown.collect::<Vec<_>>().join("\n")
}

fn with_short_text(arg: Arg) -> Arg {
    let Some(whole) = arg.get_help().map(ToString::to_string) else {
        return arg;
    };
    let short = beginning(&whole);
    let long = arg.get_long_help().map_or(whole, ToString::to_string);
    arg.help(short).long_help(long)
}

/// The beginning of a text: to the end of its first part, and no further than fits.
fn beginning(text: &str) -> String {
    let ends = ["; ", ": ", " (", ". ", " [", ", such as"];
    let end = ends.iter().filter_map(|end| text.find(end)).min();
    let first = &text[..end.unwrap_or(text.len())];
    if first.chars().count() <= SHORT_TEXT_CHARS {
        return first.to_owned();
    }
    let cut: String = first.chars().take(SHORT_TEXT_CHARS).collect();
    let cut = cut
        .rsplit_once(' ')
        .map_or(cut.as_str(), |(words, _)| words);
    format!("{cut} ...")
}

/// The refusal of arguments. Where a value was refused by the standard library, whose words name a fault of syntax only, it says
/// what to give.
pub fn refusal(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let Some(cause) = error.source() else {
        return text;
    };
    match permitted(cause) {
        Some(words) => text.replacen(&cause.to_string(), words, 1),
        None => text,
    }
}

/// Messages of the system that may stand in any failure, and what they mean.
const SYSTEM_MESSAGES: [(&str, &str); 10] = [
    (
        "No such file or directory (os error 2)",
        "there is no such file or folder",
    ),
    (
        "Permission denied (os error 13)",
        "the user of this command may not read or write it",
    ),
    (
        "Not a directory (os error 20)",
        "a part of the path is no folder",
    ),
    (
        "Is a directory (os error 21)",
        "it is a folder, and a file is needed",
    ),
    (
        "Too many open files (os error 24)",
        "too many files are open; allow more, as by ulimit -n 16384",
    ),
    ("No space left on device (os error 28)", "the disk is full"),
    ("Read-only file system (os error 30)", "it can only be read"),
    (
        "Connection refused (os error 111)",
        "no program listens there",
    ),
    (
        "Address already in use (os error 98)",
        "another program uses this address",
    ),
    (
        "Cannot assign requested address (os error 99)",
        "this machine does not have this address",
    ),
];

/// The reason of a failure, with the messages of the system in words.
pub fn failure(reason: &str) -> String {
    let mut text = reason.to_owned();
    for (message, words) in SYSTEM_MESSAGES {
        text = text.replace(message, words);
    }
    text
}

/// What to give instead of a value that was refused so.
fn permitted(cause: &(dyn Error + 'static)) -> Option<&'static str> {
    if let Some(error) = cause.downcast_ref::<ParseIntError>() {
        return Some(match error.kind() {
            IntErrorKind::PosOverflow | IntErrorKind::NegOverflow => {
                "the number is too large; give a smaller one, such as 8"
            }
            _ => "give a whole number, such as 8",
        });
    }
    if cause.is::<ParseFloatError>() {
        return Some("give a number, such as 1.5");
    }
    if cause.is::<AddrParseError>() {
        return Some("give an IP address with a port, such as 127.0.0.1:8080");
    }
    cause
        .is::<ParseBoolError>()
        .then_some("give `true` or `false`")
}
