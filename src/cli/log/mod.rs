//! The log of the service: lines of `tracing` on standard error.
//!
//! The threads that serve only form a line and append it to a buffer; a thread of its own escapes and writes
//! what has gathered, at most every [`FLUSH_EVERY`]. So no request waits for whoever reads standard error, and
//! a line costs neither a system call nor an allocation: with a call for each line, or a queue of lines
//! (tracing-appender), small requests took a tenth longer. At most [`GATHERED_BYTES`] wait; lines beyond that
//! are dropped, and a line says how many.

mod plain_line;

use anyhow::{Context, Result};
use plain_line::{PlainFields, PlainLine};
use std::borrow::Cow;
use std::io::{self, IsTerminal, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::MakeWriter;
use ventriform::base::text::{escaped_json, escaped_lines};
use ventriform_service::config::{LogFormat, Settings};

/// Time from the first line of a batch until the batch is written.
const FLUSH_EVERY: Duration = Duration::from_millis(10);

/// Longest time to write the lines that wait when the service has ended.
const LAST_LINES: Duration = Duration::from_secs(2);

/// Most bytes of lines that wait to be written.
const GATHERED_BYTES: usize = 4 << 20;

/// The format of a line.
#[derive(Debug, Clone, Copy)]
enum Line {
    Json,
    Coloured,
    Plain,
}

impl Line {
    /// The lines of `text` with their control characters escaped.
    fn escaped(self, text: &str) -> Cow<'_, str> {
        match self {
            Self::Json => escaped_json(text),
            Self::Coloured => escaped_but_colours(text),
            Self::Plain => escaped_lines(text),
        }
    }
}

/// Starts the log. Dropping what is returned writes the lines that wait.
///
/// # Errors
/// If the filter is invalid, or the system refuses the thread that writes.
pub fn start(settings: &Settings, variable: impl Fn(&str) -> Option<String>) -> Result<LogThread> {
    let filter = EnvFilter::try_new(&settings.log).with_context(|| {
        format!(
            "log = `{}` is not a valid log filter; give one such as `info` or `ventriform=debug`",
            settings.log
        )
    })?;
    let colours = has_colours(io::stderr().is_terminal(), variable);
    let line = match settings.log_format {
        LogFormat::Json => Line::Json,
        LogFormat::Text if colours => Line::Coloured,
        LogFormat::Text => Line::Plain,
    };
    let (lines, thread) =
        write_lines(io::stderr(), line).context("cannot start the thread that writes the log")?;
    let log = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(colours)
        .log_internal_errors(false)
        .with_writer(lines);
    match line {
        Line::Json => log.json().init(),
        Line::Coloured => log.init(),
        Line::Plain => log
            .fmt_fields(PlainFields)
            .event_format(PlainLine::default())
            .init(),
    }
    Ok(thread)
}

/// Starts a thread that writes lines to `to`, until what is returned last is dropped.
fn write_lines(to: impl Write + Send + 'static, line: Line) -> io::Result<(Lines, LogThread)> {
    let lines = Lines(Arc::default());
    let read = lines.clone();
    let thread = thread::Builder::new()
        .name("log".into())
        .spawn(move || read.write_to(to, line))?;
    let thread = LogThread {
        lines: lines.clone(),
        thread,
    };
    Ok((lines, thread))
}

/// The thread that writes the log. Dropping it writes the lines that wait and ends it; if nobody reads them,
/// they are given up after [`LAST_LINES`].
pub struct LogThread {
    lines: Lines,
    thread: JoinHandle<()>,
}

impl Drop for LogThread {
    fn drop(&mut self) {
        self.lines.gathered().ended = true;
        self.lines.0.1.notify_one();
        let end = Instant::now() + LAST_LINES;
        while !self.thread.is_finished() && Instant::now() < end {
            thread::sleep(Duration::from_millis(1));
        }
    }
}

/// Lines that wait to be written.
#[derive(Default)]
struct Gathered {
    text: Vec<u8>,
    /// Lines that found no room since the last batch.
    dropped: u64,
    ended: bool,
}

/// The lines that wait, shared by those who form and the thread that writes them.
#[derive(Clone)]
struct Lines(Arc<(Mutex<Gathered>, Condvar)>);

impl Lines {
    fn gathered(&self) -> MutexGuard<'_, Gathered> {
        self.0.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn write_to(&self, mut to: impl Write, line: Line) {
        let mut batch = Gathered::default();
        while !batch.ended {
            batch.text.clear();
            let empty = |lines: &mut Gathered| lines.text.is_empty() && !lines.ended;
            let first = self.0.1.wait_while(self.gathered(), empty);
            if !first.unwrap_or_else(PoisonError::into_inner).ended {
                thread::sleep(FLUSH_EVERY);
            }
            let mut gathered = self.gathered();
            std::mem::swap(&mut batch.text, &mut gathered.text);
            batch.dropped = std::mem::take(&mut gathered.dropped);
            batch.ended = gathered.ended;
            drop(gathered);
            // There is nowhere left to report that standard error is closed.
            let _ = batch.write_to(&mut to, line);
        }
    }
}

impl Gathered {
    /// Writes the lines with their control characters escaped, and the number of those dropped.
    fn write_to(&self, to: &mut impl Write, line: Line) -> io::Result<()> {
        let text = String::from_utf8_lossy(&self.text);
        to.write_all(line.escaped(&text).as_bytes())?;
        if self.dropped > 0 {
            let (lines, message) = (
                self.dropped,
                "log lines were dropped: standard error is read too slowly",
            );
            match line {
                Line::Json => {
                    let fields = serde_json::json!({ "message": message, "lines": lines });
                    let line = serde_json::json!({ "level": "WARN", "fields": fields });
                    writeln!(to, "{line}")?;
                }
                Line::Coloured | Line::Plain => writeln!(to, "WARN {message} lines={lines}")?,
            }
        }
        to.flush()
    }
}

impl<'a> MakeWriter<'a> for Lines {
    type Writer = &'a Self;

    fn make_writer(&'a self) -> Self::Writer {
        self
    }
}

impl Write for &Lines {
    /// Appends one line, or counts it as dropped.
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        let mut gathered = self.gathered();
        let first = gathered.text.is_empty();
        if gathered.text.len() + line.len() <= GATHERED_BYTES {
            gathered.text.extend_from_slice(line);
        } else {
            gathered.dropped += 1;
        }
        drop(gathered);
        if first {
            self.0.1.notify_one();
        }
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A line of text. Colours of the formatter stay; it has escaped what values contain of ESC.
fn escaped_but_colours(line: &str) -> Cow<'_, str> {
    if !line.contains('\x1b') {
        return escaped_lines(line);
    }
    let parts: Vec<Cow<'_, str>> = line.split('\x1b').map(escaped_lines).collect();
    parts.join("\x1b").into()
}

/// Whether log lines may have colours: only on a terminal, and not if `NO_COLOR` has a value
/// (<https://no-color.org>).
fn has_colours(terminal: bool, variable: impl Fn(&str) -> Option<String>) -> bool {
    terminal && variable("NO_COLOR").is_none_or(|value| value.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn logs_have_colours_on_terminals_only() {
        let given = |value: &'static str| move |_: &str| Some(value.to_owned());
        assert!(has_colours(true, |_| None) && has_colours(true, given("")));
        assert!(!has_colours(true, given("1")));
        assert!(!has_colours(false, |_| None));
    }

    /// Standard error whose reader waits until the test lets go of it.
    #[derive(Clone, Default)]
    struct SlowReader(Arc<Mutex<String>>);

    impl Write for SlowReader {
        fn write(&mut self, line: &[u8]) -> io::Result<usize> {
            self.0
                .lock()
                .unwrap()
                .push_str(str::from_utf8(line).unwrap());
            Ok(line.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn lines_beyond_the_buffer_are_counted_in_the_log() {
        for format in [Line::Plain, Line::Json] {
            let reader = SlowReader::default();
            let (lines, thread) = write_lines(reader.clone(), format).unwrap();
            let line = [b"a line\x1b[2J".as_slice(), &[b'.'; 100_000], b"\n"].concat();
            let read = reader.0.lock().unwrap();
            for _ in 0..300 {
                (&lines).write_all(&line).unwrap();
                thread::sleep(Duration::from_micros(100));
            }
            drop(read);
            drop(thread);
            let log = reader.0.lock().unwrap();
            assert!(!log.contains('\x1b'));
            let written = log.matches("a line").count();
            let told: u64 = (log.lines().filter(|line| line.contains("dropped")))
                .map(|line| match format {
                    Line::Coloured | Line::Plain => {
                        line.split("lines=").nth(1).unwrap().parse::<u64>().unwrap()
                    }
                    Line::Json => {
                        let line: serde_json::Value = serde_json::from_str(line).unwrap();
                        line["fields"]["lines"].as_u64().unwrap()
                    }
                })
                .sum();
            assert!(told > 0, "{written} of 300 were written");
            assert_eq!(written as u64 + told, 300);
        }
    }
}
