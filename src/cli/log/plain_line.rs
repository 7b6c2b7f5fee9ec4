//! A line of the log as text without colours.
//!
//! In: an event of `tracing` and the spans around it. Out: the line that `tracing_subscriber` writes: time, level,
//! spans with their fields, target, fields.
//!
//! The formatter of `tracing_subscriber` takes every word through the machinery of `Debug` and makes the date anew for
//! every line, which took a tenth of the instructions of a small request. Here, texts of printable ASCII are copied,
//! and a thread makes a date once a second.
//!
//! Guaranteed: the same text, but for the time itself. Not guaranteed: years before 1970 (the time is then 1970).

use std::cell::{Cell, RefCell};
use std::fmt::{self, Debug};
use std::time::{SystemTime, UNIX_EPOCH};
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::field::RecordFields;
use tracing_subscriber::fmt::format::{Format, FormatEvent, FormatFields, Full, Writer};
use tracing_subscriber::fmt::{FmtContext, FormattedFields};
use tracing_subscriber::registry::LookupSpan;
use ventriform_service::base::records::rfc3339;

/// The target under which events of the crate `log` arrive; their own is among their fields.
const TARGET_OF_LOG: &str = "log";

/// The most memory that a thread keeps for the text of fields.
const KEPT_BYTES: usize = 4 << 10;

/// The formatter of lines.
#[derive(Debug, Default)]
pub struct PlainLine {
    /// That of the library, for events of the crate `log`.
    usual: Format<Full>,
}

/// The formatter of fields.
#[derive(Debug, Default)]
pub struct PlainFields;

impl<S> FormatEvent<S, PlainFields> for PlainLine
where
    S: Subscriber + for<'a> LookupSpan<'a>,
{
    fn format_event(
        &self,
        context: &FmtContext<'_, S, PlainFields>,
        mut writer: Writer<'_>,
        event: &Event<'_>,
    ) -> fmt::Result {
        let about = event.metadata();
        if about.target() == TARGET_OF_LOG {
            return self.usual.format_event(context, writer, event);
        }
        write_time(&mut writer)?;
        writer.write_str(match *about.level() {
            Level::TRACE => " TRACE ",
            Level::DEBUG => " DEBUG ",
            Level::INFO => "  INFO ",
            Level::WARN => "  WARN ",
            Level::ERROR => " ERROR ",
        })?;
        if let Some(scope) = context.event_scope() {
            let mut within = false;
            for span in scope.from_root() {
                writer.write_str(span.metadata().name())?;
                let extensions = span.extensions();
                let fields = extensions.get::<FormattedFields<PlainFields>>();
                if let Some(fields) = fields.filter(|fields| !fields.is_empty()) {
                    writer.write_char('{')?;
                    writer.write_str(fields)?;
                    writer.write_char('}')?;
                }
                writer.write_char(':')?;
                within = true;
            }
            if within {
                writer.write_char(' ')?;
            }
        }
        writer.write_str(about.target())?;
        writer.write_str(": ")?;
        context.format_fields(writer.by_ref(), event)?;
        writer.write_char('\n')
    }
}

impl<'writer> FormatFields<'writer> for PlainFields {
    fn format_fields<R: RecordFields>(&self, mut to: Writer<'writer>, fields: R) -> fmt::Result {
        thread_local! {
            /// The text of the last fields: so that of the next ones needs no memory, and their span allocates once.
            static TEXT: Cell<String> = const { Cell::new(String::new()) };
        }
        TEXT.with(|kept| {
            let mut text = kept.take();
            text.clear();
            let mut visitor = FieldWriter {
                writer: Writer::new(&mut text),
                begun: false,
                outcome: Ok(()),
            };
            fields.record(&mut visitor);
            let written = visitor.outcome.and_then(|()| to.write_str(&text));
            if text.capacity() <= KEPT_BYTES {
                kept.set(text);
            }
            written
        })
    }
}

/// Writes fields one after another.
struct FieldWriter<'writer> {
    writer: Writer<'writer>,
    begun: bool,
    outcome: fmt::Result,
}

impl<'writer> FieldWriter<'writer> {
    fn field(&mut self, field: &Field, value: impl FnOnce(&mut Writer<'writer>) -> fmt::Result) {
        if self.outcome.is_ok() {
            self.outcome = self.name(field).and_then(|()| value(&mut self.writer));
        }
    }

    fn name(&mut self, field: &Field) -> fmt::Result {
        if self.begun {
            self.writer.write_char(' ')?;
        }
        self.begun = true;
        match field.name() {
            "message" => Ok(()),
            name => {
                self.writer
                    .write_str(name.strip_prefix("r#").unwrap_or(name))?;
                self.writer.write_char('=')
            }
        }
    }
}

impl Visit for FieldWriter<'_> {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        self.field(field, |writer| write!(writer, "{value:?}"));
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        let as_it_is = |b: u8| matches!(b, b' '..=b'~') && b != b'"' && b != b'\\';
        if !value.bytes().all(as_it_is) {
            return self.record_debug(field, &value);
        }
        self.field(field, |writer| {
            writer.write_char('"')?;
            writer.write_str(value)?;
            writer.write_char('"')
        });
    }
}

/// Writes the time in UTC (RFC 3339), to a microsecond.
fn write_time(writer: &mut Writer<'_>) -> fmt::Result {
    thread_local! {
        /// The last second in which this thread has written a line, since 1970, and its date and time of day.
        static LAST_SECOND: RefCell<Option<(u64, String)>> = const { RefCell::new(None) };
    }
    let now = SystemTime::now();
    let since = now.duration_since(UNIX_EPOCH).unwrap_or_default();
    LAST_SECOND.with_borrow_mut(|last| {
        let second = since.as_secs();
        if last.as_ref().is_none_or(|(of, _)| *of != second) {
            *last = Some((second, to_the_second(second)));
        }
        match last {
            Some((_, text)) => writer.write_str(text),
            None => Ok(()),
        }
    })?;
    let mut digits = *b".000000Z";
    let mut micros = since.subsec_micros();
    for digit in digits[1..7].iter_mut().rev() {
        *digit += (micros % 10) as u8;
        micros /= 10;
    }
    writer.write_str(str::from_utf8(&digits).unwrap_or_default())
}

/// Date and time of day of a `second` since 1970.
fn to_the_second(second: u64) -> String {
    let mut text = rfc3339(second.saturating_mul(1000).cast_signed());
    text.truncate("1970-01-01T00:00:00".len());
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;
    use std::sync::{Arc, Mutex};
    use std::time::Duration;
    use time::OffsetDateTime;
    use tracing_subscriber::field::MakeExt;
    use tracing_subscriber::fmt::format::debug_fn;

    #[derive(Clone, Default)]
    struct Written(Arc<Mutex<Vec<u8>>>);

    impl io::Write for Written {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// Events of every level and kind of value, within spans and without.
    fn speak() {
        let source = io::Error::other("a \"cause\"\n\u{1b}[2J");
        tracing::info!("plain");
        tracing::warn!(
            text = "with \"quotes\" and \\",
            other = "grün\u{7f}\t",
            "{} args",
            2
        );
        tracing::error!(error = %source, debug = ?source, error_value = &source as &dyn std::error::Error);
        tracing::debug!(r#type = "reserved", message = "given as a field");
        let outer = tracing::info_span!("outer", id = "7", later = tracing::field::Empty);
        let _entered = outer.enter();
        tracing::trace!(u = 7_u64, i = -7_i64, f = 0.5, b = true, big = u128::MAX);
        outer.record("later", "then \u{202e}");
        let inner = tracing::warn_span!("inner");
        let _within = inner.enter();
        tracing::info!(target: "elsewhere", none = Option::<u8>::None, some = Some(3));
        tracing::info!(parent: None, "without a span");
        tracing::info!({ status = 200_u16, ms = 0_u64 }, "answered");
    }

    /// The lines without their times.
    fn lines(written: &Written) -> Vec<String> {
        let text = String::from_utf8(written.0.lock().unwrap().clone()).unwrap();
        text.lines()
            .map(|line| match line.split_once(' ') {
                Some((time, rest)) if time.ends_with('Z') => rest.to_owned(),
                _ => line.to_owned(),
            })
            .collect()
    }

    #[test]
    fn lines_are_those_of_the_usual_formatter() {
        let [usual, ours] = [Written::default(), Written::default()];
        let sink = usual.clone();
        let fields = |writer: &mut Writer<'_>, field: &Field, value: &dyn Debug| {
            let name = field.name();
            match name.strip_prefix("r#").unwrap_or(name) {
                "message" => write!(writer, "{value:?}"),
                name => write!(writer, "{name}={value:?}"),
            }
        };
        let subscriber = tracing_subscriber::fmt()
            .with_max_level(Level::TRACE)
            .with_ansi(false)
            .with_writer(move || sink.clone())
            .fmt_fields(debug_fn(fields).delimited(" "))
            .finish();
        tracing::subscriber::with_default(subscriber, speak);
        let sink = ours.clone();
        let subscriber = tracing_subscriber::fmt()
            .with_max_level(Level::TRACE)
            .with_ansi(false)
            .with_writer(move || sink.clone())
            .fmt_fields(PlainFields)
            .event_format(PlainLine::default())
            .finish();
        tracing::subscriber::with_default(subscriber, speak);
        let lines = [&usual, &ours].map(lines);
        assert!(lines[0].len() >= 9, "{lines:#?}");
        assert_eq!(lines[1], lines[0]);
    }

    #[test]
    fn times_are_those_of_the_calendar() {
        let mut text = String::new();
        let before = OffsetDateTime::now_utc();
        write_time(&mut Writer::new(&mut text)).unwrap();
        let after = OffsetDateTime::now_utc();
        let format = &time::format_description::well_known::Rfc3339;
        let told = OffsetDateTime::parse(&text, format).unwrap();
        let microsecond = Duration::from_micros(1);
        assert!(before - microsecond <= told && told <= after, "{text}");
        assert_eq!(text.len(), "2026-11-28T12:00:00.000000Z".len());
        for (seconds, wanted) in [
            (0, "1970-01-01T00:00:00"),
            (951_782_399, "2000-02-28T23:59:59"),
            (951_782_400, "2000-02-29T00:00:00"),
        ] {
            assert_eq!(to_the_second(seconds), wanted);
        }
    }
}
