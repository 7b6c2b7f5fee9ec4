//! Connections that end before there was a request that the routes could answer: what the log says of them.
//!
//! A request that is routed has a line of its own ([`crate::edge::observe`]). What is refused before has one
//! here: a head that is no HTTP or too long, one that does not come in time, a handshake of TLS that fails,
//! plain HTTP where TLS is spoken. A client that closes a connection has refused nothing, and neither has the
//! service when an idle one ends: those are lines at `debug`.

use super::BoxError;
use super::stall::Late;
use std::error::Error;
use std::io;
use std::net::IpAddr;

/// Why a connection was closed, where no error of the connection says so.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// Its client speaks HTTP on a port of TLS.
    #[error("plain HTTP came where TLS is spoken")]
    PlainHttp,
    /// The handshake of TLS took longer than `header_timeout`.
    #[error("the TLS handshake did not end in time")]
    SlowHandshake,
    /// Nothing came within `header_timeout`.
    #[error("no request came in time")]
    NoRequest,
    /// It was one too many, and did not end in time.
    #[error("a connection beyond the limits did not end in time")]
    Reserve,
}

impl Refused {
    /// Writes the line of a connection of `client` that ended with this error.
    pub fn log(client: IpAddr, error: &BoxError) {
        let reason = reason(&**error);
        match status(&**error) {
            Some(status) => tracing::info!(%client, status, reason, "a connection was refused"),
            None if is_refusal(&**error) => {
                tracing::info!(%client, reason, "a connection was refused");
            }
            None => tracing::debug!(%client, reason, "a connection ended early"),
        }
    }
}

/// The status that the client was answered with, if it was.
fn status(error: &(dyn Error + 'static)) -> Option<u16> {
    if error.downcast_ref() == Some(&Refused::PlainHttp) {
        return Some(400);
    }
    let error = error.downcast_ref::<hyper::Error>()?;
    let text = error.to_string();
    match () {
        () if text.contains("URI too long") => Some(414),
        () if error.is_parse_too_large() => Some(431),
        // The preface of HTTP/2 is not answered.
        () if text.contains("HTTP2") => None,
        () if error.is_parse() => Some(400),
        () => None,
    }
}

/// Whether the service ended the connection, and not its client.
fn is_refusal(error: &(dyn Error + 'static)) -> bool {
    if error.is::<Refused>() {
        return true;
    }
    if let Some(error) = error.downcast_ref::<hyper::Error>()
        && error.is_parse()
    {
        return true;
    }
    // From the handshake of TLS, or below hyper.
    let mut cause = Some(error);
    while let Some(error) = cause {
        if let Some(late) = inner::<Late>(error) {
            return !late.idle;
        }
        if let Some(error) = error.downcast_ref::<io::Error>() {
            return inner::<rustls::Error>(error).is_some()
                || matches!(
                    error.kind(),
                    io::ErrorKind::TimedOut | io::ErrorKind::InvalidData
                );
        }
        cause = error.source();
    }
    false
}

/// The cause of an error of the system's kind.
fn inner<'a, E: Error + 'static>(error: &'a (dyn Error + 'static)) -> Option<&'a E> {
    error.downcast_ref::<io::Error>()?.get_ref()?.downcast_ref()
}

/// The texts of an error and its causes, once each.
fn reason(error: &(dyn Error + 'static)) -> String {
    let mut said = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let text = error.to_string();
        if !said.contains(&text) {
            said = format!("{said}: {text}");
        }
        cause = error.source();
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_service_refuses_is_told_from_what_clients_end() {
        let late =
            |idle| -> BoxError { io::Error::new(io::ErrorKind::TimedOut, Late { idle }).into() };
        let of = |kind: io::ErrorKind| -> BoxError { io::Error::from(kind).into() };
        for (error, refused) in [
            (late(false), true),
            (late(true), false),
            (of(io::ErrorKind::ConnectionReset), false),
            (of(io::ErrorKind::UnexpectedEof), false),
            (of(io::ErrorKind::InvalidData), true),
            (Refused::SlowHandshake.into(), true),
            (Refused::PlainHttp.into(), true),
        ] {
            assert_eq!(is_refusal(&*error), refused, "{error}");
        }
        assert_eq!(status(&*BoxError::from(Refused::PlainHttp)), Some(400));
        assert_eq!(status(&*late(false)), None);
    }
}
