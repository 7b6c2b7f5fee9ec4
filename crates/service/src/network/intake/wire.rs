//! PDUs (PS3.8, 9.3) to and from a connection, within limits.
//!
//! The crate `dicom-ul` reads and writes the fields of a PDU. What frames them is read here: the type
//! and the stated length are checked before anything else is read, and memory is taken as bytes come.
//! Its own acceptor is not used: it reads whatever length is stated, waits for each PDU without a bound
//! on the whole, and accepts transfer syntaxes that this program does not read.

use dicom_ul::pdu::{MAXIMUM_PDU_SIZE, Pdu, read_pdu, write_pdu};
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};

/// Longest request for an association, bytes: 128 contexts with every transfer syntax there is.
const LONGEST_REQUEST: u32 = 512 << 10;
/// Most presentation contexts of a request (PS3.8, 9.3.2.2: their ids are odd and have one byte).
const MOST_CONTEXTS: usize = 128;
/// Most transfer syntaxes of one presentation context, more than the standard has.
const MOST_SYNTAXES: usize = 64;
/// Bytes of a request for an association before its variable items (PS3.8, table 9-11).
const REQUEST_ITEMS_AT: usize = 74;
/// Type of a presentation context in a request, and of a transfer syntax in one (PS3.8, 9.3.2.2).
const CONTEXT_ITEM: u8 = 0x20;
const SYNTAX_ITEM: u8 = 0x40;
/// Bytes of an item before its content, and of a presentation context before its items.
const ITEM_HEADER_BYTES: usize = 4;
const CONTEXT_HEADER_BYTES: usize = 4;
/// Longest PDU of any kind that has no content, bytes.
const LONGEST_OTHER: u32 = 1024;
/// Bytes before the content.
const PDU_HEADER_BYTES: usize = 6;
/// Memory taken at once for a PDU that is still to come.
const PORTION_BYTES: usize = 64 << 10;
/// How long the other side has to take what was last written and to close.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);
/// Bytes that are read and thrown away while the other side closes.
const CLOSING_BYTES: u64 = 1 << 20;

/// Why no PDU could be read or written.
#[derive(Debug, thiserror::Error)]
pub enum WireError {
    /// The connection was closed between two PDUs.
    #[error("the connection was closed")]
    Closed,
    /// The connection failed, or was closed within a PDU.
    #[error("{0}")]
    Failed(#[from] io::Error),
    /// The type of the PDU is none of PS3.8.
    #[error("PDU type {0:02X}H is unknown")]
    Unrecognised(u8),
    /// The stated length is not allowed for the type.
    #[error("a PDU of type {kind:02X}H states a length of {length} bytes; {limit} are allowed")]
    TooLong {
        /// The type.
        kind: u8,
        /// The stated length.
        length: u32,
        /// The greatest length.
        limit: u32,
    },
    /// A request for an association has more parts than are read.
    #[error("a request for an association has more than {limit} {what}")]
    TooMany {
        /// The parts.
        what: &'static str,
        /// The greatest number.
        limit: usize,
    },
    /// The content is not what PS3.8 says.
    #[error("the content of a PDU of type {0:02X}H is malformed")]
    Malformed(u8),
}

/// A connection.
pub struct Wire<S> {
    stream: S,
    /// Longest P-DATA-TF PDU that is read.
    longest: u32,
    /// Bytes received.
    received: u64,
}

impl<S: AsyncRead + AsyncWrite + Unpin + Send> Wire<S> {
    /// Over `stream`, with P-DATA-TF PDUs of at most `longest` bytes.
    pub fn new(stream: S, longest: u32) -> Self {
        Self {
            stream,
            longest,
            received: 0,
        }
    }

    /// Bytes received so far.
    pub fn received(&self) -> u64 {
        self.received
    }

    /// Reads the next PDU.
    ///
    /// # Errors
    /// [`WireError`]; after it, nothing more can be read.
    pub async fn read(&mut self) -> Result<Pdu, WireError> {
        let mut header = [0; PDU_HEADER_BYTES];
        if self.stream.read(&mut header[..1]).await? == 0 {
            return Err(WireError::Closed);
        }
        let limit = match header[0] {
            1 => LONGEST_REQUEST,
            4 => self.longest,
            2..=7 => LONGEST_OTHER,
            unknown => return Err(WireError::Unrecognised(unknown)),
        };
        self.stream.read_exact(&mut header[1..]).await?;
        let length = u32::from_be_bytes([header[2], header[3], header[4], header[5]]);
        if length > limit {
            return Err(WireError::TooLong {
                kind: header[0],
                length,
                limit,
            });
        }
        let length = length as usize;
        let mut bytes = Vec::with_capacity(PDU_HEADER_BYTES + length.min(PORTION_BYTES));
        bytes.extend_from_slice(&header);
        let mut content = (&mut self.stream).take(length as u64);
        while bytes.len() < PDU_HEADER_BYTES + length {
            if content.read_buf(&mut bytes).await? == 0 {
                return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
            }
        }
        self.received += bytes.len() as u64;
        decode(&bytes)
    }

    /// Writes a PDU.
    ///
    /// # Errors
    /// [`WireError`].
    pub async fn write(&mut self, pdu: &Pdu) -> Result<(), WireError> {
        let mut bytes = Vec::new();
        write_pdu(&mut bytes, pdu).map_err(io::Error::other)?;
        self.stream.write_all(&bytes).await?;
        Ok(self.stream.flush().await?)
    }

    /// Ends the connection so that the other side can read what was last written: closing with unread
    /// bytes would make the system take it back.
    pub async fn close(mut self) {
        let closing = async {
            if self.stream.shutdown().await.is_ok() {
                let mut rest = (&mut self.stream).take(CLOSING_BYTES);
                let _ = tokio::io::copy(&mut rest, &mut tokio::io::sink()).await;
            }
        };
        let _ = tokio::time::timeout(CLOSE_TIMEOUT, closing).await;
    }
}

/// The PDU in `bytes`, header and content.
///
/// # Errors
/// [`WireError::Malformed`], also if the reader of the fields panics; [`WireError::TooMany`].
pub fn decode(bytes: &[u8]) -> Result<Pdu, WireError> {
    if bytes.first() == Some(&1) {
        check_request(bytes)?;
    }
    let malformed = || WireError::Malformed(bytes.first().copied().unwrap_or(0));
    let read = || read_pdu(bytes, MAXIMUM_PDU_SIZE, false);
    match catch_unwind(AssertUnwindSafe(read)) {
        Ok(Ok(Some(pdu))) => Ok(pdu),
        _ => Err(malformed()),
    }
}

/// Counts the parts of a request for an association, of which each takes more memory than bytes once it is
/// read. Damaged items end the count; reading them is an error.
fn check_request(bytes: &[u8]) -> Result<(), WireError> {
    let mut contexts = 0;
    for (kind, content) in items(bytes.get(REQUEST_ITEMS_AT..).unwrap_or_default()) {
        if kind != CONTEXT_ITEM {
            continue;
        }
        contexts += 1;
        if contexts > MOST_CONTEXTS {
            return Err(WireError::TooMany {
                what: "presentation contexts",
                limit: MOST_CONTEXTS,
            });
        }
        let parts = items(content.get(CONTEXT_HEADER_BYTES..).unwrap_or_default());
        if parts.filter(|(kind, _)| *kind == SYNTAX_ITEM).count() > MOST_SYNTAXES {
            return Err(WireError::TooMany {
                what: "transfer syntaxes in one presentation context",
                limit: MOST_SYNTAXES,
            });
        }
    }
    Ok(())
}

/// The items that follow each other in `bytes`: type and content.
fn items(bytes: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    let mut rest = bytes;
    std::iter::from_fn(move || {
        let (header, after) = rest.split_at_checked(ITEM_HEADER_BYTES)?;
        let length = usize::from(u16::from_be_bytes([header[2], header[3]]));
        let (content, after) = after.split_at_checked(length)?;
        rest = after;
        Some((header[0], content))
    })
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;
    use dicom_ul::pdu::{PDataValue, PDataValueType};
    use proptest::prelude::*;

    async fn read(bytes: &[u8]) -> Result<Pdu, WireError> {
        let (mut theirs, ours) = tokio::io::duplex(bytes.len().max(1));
        theirs.write_all(bytes).await.unwrap();
        drop(theirs);
        Wire::new(ours, 4096).read().await
    }

    #[tokio::test]
    async fn a_stated_length_is_refused_before_the_content_is_awaited() {
        for (kind, limit) in [(4, 4096), (1, LONGEST_REQUEST), (5, LONGEST_OTHER)] {
            let mut bytes = vec![kind, 0];
            bytes.extend_from_slice(&(limit + 1).to_be_bytes());
            let refused = read(&bytes).await.unwrap_err();
            assert!(matches!(refused, WireError::TooLong { length, .. } if length == limit + 1));
        }
        let refused = read(&[4, 0, 255, 255, 255, 255]).await.unwrap_err();
        assert!(matches!(refused, WireError::TooLong { .. }));
        assert!(matches!(
            read(b"GET / HTTP/1.1").await,
            Err(WireError::Unrecognised(b'G'))
        ));
    }

    #[test]
    fn a_request_with_too_many_parts_is_refused() {
        use dicom_ul::pdu::{AssociationRQ, PresentationContextProposed};
        let request = |contexts: usize, syntaxes: usize| {
            let context = PresentationContextProposed {
                id: 1,
                abstract_syntax: "1.2.3".into(),
                transfer_syntaxes: vec!["1.2".into(); syntaxes],
            };
            let request = Pdu::AssociationRQ(AssociationRQ {
                protocol_version: 1,
                calling_ae_title: "A".into(),
                called_ae_title: "B".into(),
                application_context_name: "1.2.840.10008.3.1.1.1".into(),
                presentation_contexts: vec![context; contexts],
                user_variables: Vec::new(),
            });
            let mut bytes = Vec::new();
            write_pdu(&mut bytes, &request).unwrap();
            decode(&bytes)
        };
        assert!(request(MOST_CONTEXTS, MOST_SYNTAXES).is_ok());
        for (contexts, syntaxes) in [(MOST_CONTEXTS + 1, 1), (1, MOST_SYNTAXES + 1)] {
            let refused = request(contexts, syntaxes);
            assert!(matches!(refused, Err(WireError::TooMany { .. })));
        }
    }

    #[tokio::test]
    async fn the_end_within_a_pdu_is_told_from_the_end_between_two() {
        assert!(matches!(read(&[]).await, Err(WireError::Closed)));
        for cut in [&[4][..], &[4, 0, 0], &[4, 0, 0, 0, 0, 9, 1, 2]] {
            assert!(matches!(read(cut).await, Err(WireError::Failed(_))));
        }
    }

    #[tokio::test]
    async fn what_is_written_is_read_back() {
        let value = |value_type, length| PDataValue {
            presentation_context_id: 3,
            value_type,
            is_last: true,
            data: vec![7; length],
        };
        let data = vec![
            value(PDataValueType::Command, 9),
            value(PDataValueType::Data, 999),
        ];
        let pdus = [Pdu::PData { data }, Pdu::ReleaseRQ, Pdu::ReleaseRP];
        let (theirs, ours) = tokio::io::duplex(4096);
        let (mut theirs, mut ours) = (Wire::new(theirs, 4096), Wire::new(ours, 4096));
        for pdu in pdus {
            theirs.write(&pdu).await.unwrap();
            assert_eq!(ours.read().await.unwrap(), pdu);
        }
    }

    proptest! {
        #[test]
        fn any_bytes_give_a_pdu_or_an_error(
            kind in 0_u8..9,
            content in proptest::collection::vec(any::<u8>(), 0..600),
        ) {
            let mut bytes = vec![kind, 0];
            bytes.extend_from_slice(&(content.len() as u32).to_be_bytes());
            bytes.extend_from_slice(&content);
            let _ = decode(&bytes);
        }
    }
}
