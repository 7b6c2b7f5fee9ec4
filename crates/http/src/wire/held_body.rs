//! A body that holds a value until it has been handed over for sending, or given up.
//!
//! In: a body. Out: the same bytes, in pieces of at most [`PIECE_BYTES`]. The connection takes a piece when it has
//! room for one. A body that handed over a large frame as a whole would end, and give up what it holds, while the
//! connection still keeps the frame for a client that does not read.
//!
//! Guaranteed: when the value is dropped, at most one piece and the buffer of the connection have not been sent.

use axum::body::{Body, Bytes, HttpBody};
use hyper::body::{Frame, SizeHint};
use std::pin::Pin;
use std::task::{Context, Poll, ready};

/// The most bytes that are handed over at a time.
const PIECE_BYTES: usize = 64 << 10;

/// `body`, and a value that is dropped with it.
pub struct HeldBody<T> {
    body: Body,
    /// The rest of a frame.
    rest: Bytes,
    _held: T,
}

impl<T> HeldBody<T> {
    /// `body`, as long as which `held` lives.
    pub fn new(body: Body, held: T) -> Self {
        Self {
            body,
            rest: Bytes::new(),
            _held: held,
        }
    }

    fn next_piece(&mut self) -> Frame<Bytes> {
        let size = self.rest.len().min(PIECE_BYTES);
        Frame::data(self.rest.split_to(size))
    }
}

impl<T: Unpin> HttpBody for HeldBody<T> {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        if !self.rest.is_empty() {
            return Poll::Ready(Some(Ok(self.next_piece())));
        }
        let frame = match ready!(Pin::new(&mut self.body).poll_frame(context)) {
            Some(Ok(frame)) => frame,
            other => return Poll::Ready(other),
        };
        Poll::Ready(Some(Ok(match frame.into_data() {
            Ok(data) => {
                self.rest = data;
                self.next_piece()
            }
            Err(trailers) => trailers,
        })))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_empty() && self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        let (left, mut hint) = (self.rest.len() as u64, self.body.size_hint());
        if let Some(upper) = hint.upper() {
            hint.set_upper(upper + left);
        }
        hint.set_lower(hint.lower() + left);
        hint
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn a_large_frame_is_handed_over_in_pieces_and_its_memory_held_until_the_last() {
        for size in [1, PIECE_BYTES, PIECE_BYTES + 1, 1_000_000] {
            let bytes: Vec<u8> = (0..size).map(|n| (n % 251) as u8).collect();
            let held = Arc::new(());
            let mut body = HeldBody::new(Body::from(bytes.clone()), held.clone());
            let mut context = Context::from_waker(std::task::Waker::noop());
            let mut sent = Vec::new();
            while !body.is_end_stream() {
                let left = (size - sent.len()) as u64;
                assert_eq!(body.size_hint().exact(), Some(left));
                assert_eq!(Arc::strong_count(&held), 2);
                let Poll::Ready(Some(Ok(frame))) = Pin::new(&mut body).poll_frame(&mut context)
                else {
                    panic!("a body in memory has its frames at once");
                };
                let piece = frame.into_data().unwrap();
                assert!((1..=PIECE_BYTES).contains(&piece.len()));
                sent.extend(piece);
            }
            assert_eq!(sent, bytes);
        }
    }
}
