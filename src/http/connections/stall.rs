//! A stream that ends when its client does not read.
//!
//! A write that the system cannot take waits for the client. It fails after the write timeout; a
//! single byte taken ends the wait. So that a client cannot hold a connection with one byte per
//! timeout, the bytes taken are compared with [`LEAST_RATE`] whenever the waits add up to the
//! timeout.

use super::registry::{OpenConnection, Phase};
use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::Sleep;

/// Bytes per second that a client must read on average while the service waits for it.
const LEAST_RATE: f64 = 1024.0;

/// A stream over `S` with the limits on waiting, which reports its bytes to its connection.
pub struct WatchedStream<S> {
    stream: S,
    connection: Arc<OpenConnection>,
    /// Longest wait.
    limit: Duration,
    /// When the current wait began, and the timer of its end.
    wait: Option<(Instant, Pin<Box<Sleep>>)>,
    /// Waits since the rate was last checked, and bytes taken meanwhile.
    waited: Duration,
    taken: u64,
}

impl<S> WatchedStream<S> {
    /// Watches `stream`.
    pub fn new(stream: S, connection: Arc<OpenConnection>, limit: Duration) -> Self {
        Self {
            stream,
            connection,
            limit,
            wait: None,
            waited: Duration::ZERO,
            taken: 0,
        }
    }

    /// The stream.
    pub fn get_ref(&self) -> &S {
        &self.stream
    }

    /// The stream took `bytes`.
    fn progress(&mut self, bytes: usize) -> io::Result<usize> {
        self.connection.moved();
        self.taken += bytes as u64;
        if let Some((since, _)) = self.wait.take() {
            self.connection.leave(Phase::Reading, Phase::Answer);
            self.waited += since.elapsed();
            if self.waited >= self.limit {
                if (self.taken as f64) < LEAST_RATE * self.waited.as_secs_f64() {
                    return Err(too_slow());
                }
                (self.waited, self.taken) = (Duration::ZERO, 0);
            }
        }
        Ok(bytes)
    }

    /// The stream took nothing.
    fn wait(&mut self, context: &mut Context<'_>) -> Poll<io::Error> {
        let (limit, connection) = (self.limit, &self.connection);
        let (_, timer) = self.wait.get_or_insert_with(|| {
            connection.leave(Phase::Answer, Phase::Reading);
            (Instant::now(), Box::pin(tokio::time::sleep(limit)))
        });
        ready!(timer.as_mut().poll(context));
        Poll::Ready(too_slow())
    }
}

fn too_slow() -> io::Error {
    io::Error::new(
        io::ErrorKind::TimedOut,
        "the client does not read its answer",
    )
}

impl<S: AsyncWrite + Unpin> WatchedStream<S> {
    /// Follows up on the outcome of a write.
    fn follow(
        &mut self,
        outcome: Poll<io::Result<usize>>,
        context: &mut Context<'_>,
    ) -> Poll<io::Result<usize>> {
        match outcome {
            Poll::Ready(Ok(bytes)) => Poll::Ready(self.progress(bytes)),
            Poll::Ready(Err(error)) => Poll::Ready(Err(error)),
            Poll::Pending => self.wait(context).map(Err),
        }
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for WatchedStream<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let outcome = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.follow(outcome, context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let outcome = Pin::new(&mut self.stream).poll_write_vectored(context, slices);
        self.follow(outcome, context)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for WatchedStream<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        ready!(Pin::new(&mut self.stream).poll_read(context, buffer))?;
        if buffer.filled().len() > before {
            self.connection.moved();
        }
        Poll::Ready(Ok(()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream, duplex};

    const LIMIT: Duration = Duration::from_millis(600);

    /// Writes 4 KiB through a pipe of 64 bytes to a client that reads `step` bytes after each
    /// `pause`.
    async fn write_to_a_reader_of(step: usize, pause: Duration) -> io::Result<()> {
        let (service, mut client): (_, DuplexStream) = duplex(64);
        let mut service = WatchedStream::new(service, Arc::new(OpenConnection::new(None)), LIMIT);
        let reader = tokio::spawn(async move {
            let mut buffer = vec![0; step];
            while matches!(client.read(&mut buffer).await, Ok(1..)) {
                tokio::time::sleep(pause).await;
            }
        });
        let written = service.write_all(&[7; 4096]).await;
        drop(service);
        reader.abort();
        written
    }

    #[tokio::test]
    async fn who_reads_goes_on_and_who_does_not_is_cut_off() {
        write_to_a_reader_of(64, Duration::from_millis(1))
            .await
            .unwrap();
        let never = write_to_a_reader_of(1, Duration::from_secs(60)).await;
        assert_eq!(never.unwrap_err().kind(), io::ErrorKind::TimedOut);
    }

    #[tokio::test]
    async fn one_byte_at_a_time_does_not_hold_a_connection() {
        // Never a pause as long as the limit, and 10 bytes per second.
        let drip = write_to_a_reader_of(1, Duration::from_millis(100)).await;
        assert_eq!(drip.unwrap_err().kind(), io::ErrorKind::TimedOut);
    }
}
