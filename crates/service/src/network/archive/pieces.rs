//! The input of a parser of `multipart` bodies: piece by piece, and within a limit on what it gathers.
//!
//! `multer` reads on as long as there is something to read and keeps that in memory. A pause after each
//! piece makes it hand out what it has, so that what was read since the parser last returned something is
//! headers and boundaries alone; [`Unparsed`] limits that.

use bytes::Bytes;
use futures::{Stream, StreamExt, stream};
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::task::Poll;

/// Most bytes between two pieces of content: headers, boundaries, and what comes before the first.
const HEADER_BYTES: usize = 64 << 10;

/// A header or a boundary without end.
#[derive(Debug, thiserror::Error)]
#[error("a header or boundary does not end")]
pub struct EndlessHeader;

/// Bytes of a body that were read since the parser last returned something.
#[derive(Debug, Clone, Default)]
pub struct Unparsed(Arc<AtomicUsize>);

impl Unparsed {
    /// The pieces of `body` for a parser. It ends with [`EndlessHeader`] if the parser gathers too much.
    pub fn pieces<S, E>(
        &self,
        mut body: S,
    ) -> impl Stream<Item = Result<Bytes, Box<dyn Error + Send + Sync>>> + use<S, E>
    where
        S: Stream<Item = Result<Bytes, E>> + Unpin,
        E: Into<Box<dyn Error + Send + Sync>>,
    {
        let unparsed = self.clone();
        let mut given = false;
        stream::poll_fn(move |context| {
            if std::mem::take(&mut given) {
                context.waker().wake_by_ref();
                return Poll::Pending;
            }
            let piece = std::task::ready!(body.poll_next_unpin(context));
            given = piece.is_some();
            Poll::Ready(piece.map(|piece| unparsed.add(piece.map_err(Into::into)?)))
        })
    }

    /// Adds a piece of the body.
    fn add(&self, piece: Bytes) -> Result<Bytes, Box<dyn Error + Send + Sync>> {
        let length = piece.len();
        let waiting = self.0.fetch_add(length, Ordering::Relaxed) + length;
        if waiting > HEADER_BYTES.max(4 * length) {
            return Err(EndlessHeader.into());
        }
        Ok(piece)
    }

    /// The parser returned a part or a piece of one.
    pub fn reset(&self) {
        self.0.store(0, Ordering::Relaxed);
    }
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;
    use multer::Multipart;
    use std::convert::Infallible;

    /// The lengths of the pieces of the only part of a body that lies there as a whole.
    async fn lengths(body: String) -> Result<Vec<usize>, multer::Error> {
        let pieces = body.into_bytes();
        let pieces: Vec<_> = pieces.chunks(1000).map(Bytes::copy_from_slice).collect();
        let unparsed = Unparsed::default();
        let pieces = stream::iter(pieces.into_iter().map(Ok::<_, Infallible>));
        let mut parts = Multipart::new(unparsed.pieces(pieces), "b");
        let mut part = parts.next_field().await?.unwrap();
        unparsed.reset();
        let mut lengths = Vec::new();
        while let Some(piece) = part.chunk().await? {
            unparsed.reset();
            lengths.push(piece.len());
        }
        Ok(lengths)
    }

    #[tokio::test]
    async fn a_large_part_is_handed_out_piece_by_piece() {
        let head = "--b\r\nContent-Disposition: form-data; name=\"file\"\r\n\r\n";
        let body = format!("{head}{}\r\n--b--\r\n", "x".repeat(900_000));
        let lengths = lengths(body).await.unwrap();
        assert_eq!(lengths.iter().sum::<usize>(), 900_000);
        assert!(lengths.iter().all(|length| *length <= 3000), "{lengths:?}");
    }

    #[tokio::test]
    async fn a_header_without_end_is_not_gathered() {
        let endless = format!("--b\r\nA: {}", "a".repeat(2 * HEADER_BYTES));
        match lengths(endless).await {
            Err(multer::Error::StreamReadFailed(cause)) => assert!(cause.is::<EndlessHeader>()),
            other => panic!("{other:?}"),
        }
    }
}
