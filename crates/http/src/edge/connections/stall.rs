//! A stream that ends when its client does not read or send, and that ends so that the last answer
//! is not lost.
//!
//! **Reading an answer.** A write that the system cannot take waits for the client. It fails after the
//! write timeout; a single byte taken ends the wait. So that a client cannot hold a connection with one
//! byte per timeout, the bytes taken are compared with [`LEAST_RATE`] whenever the waits add up to the
//! timeout.
//!
//! **Sending a head.** The first head of a connection, and every head that has begun, has the head's
//! time limit; between two requests the connection may be idle for longer.
//!
//! **The end.** A connection that is closed while bytes of its client are unread is reset by the
//! system, and a reset takes back the answer that the client has not read yet. So where a request was
//! refused before its body had come, writing ends first; then bytes are read and thrown away until
//! the client closes, within limits ([`Linger`]). Under TLS this happens below the encryption. Meanwhile
//! the connection stalls: another one may take its place.

use super::registry::{OpenConnection, Phase};
use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant as TimerInstant, Sleep};

/// Bytes per second that a client must read on average while the service waits for it.
const LEAST_RATE: f64 = 1024.0;

/// Bytes thrown away at once.
const LINGER_PIECE: usize = 64 << 10;

/// The head of a request did not come in time.
#[derive(Debug, Clone, Copy, thiserror::Error)]
#[error("no request came in time")]
pub struct Late {
    /// Whether it was to be another request after one that was answered, and nothing of it came.
    pub idle: bool,
}

/// Time for which a stream whose client may still send is read at its end.
#[derive(Debug, Clone, Copy)]
pub struct Linger {
    /// Longest time for the client to read the last answer and to close.
    pub total: Duration,
    /// Longest pause in what it still sends.
    pub pause: Duration,
    /// Bytes that are read and thrown away. What comes then stays with the system, so that a client
    /// which reads only when it cannot send finds the answer.
    pub bytes: u64,
}

/// Time for which a stream waits for its client.
#[derive(Debug, Clone, Copy)]
pub struct StreamLimits {
    /// For it to read.
    pub write: Duration,
    /// For a head.
    pub head: Duration,
    /// For the first byte of a head after another request.
    pub idle: Duration,
    /// For it to close.
    pub linger: Linger,
}

/// A stream over `S` with the limits on waiting, which reports its bytes to its connection.
pub struct WatchedStream<S> {
    stream: S,
    connection: Arc<OpenConnection>,
    limits: StreamLimits,
    /// Requests answered before the last head of which bytes have come, and when the first of them came.
    begun: Option<(u64, TimerInstant)>,
    /// Ends no later than the head that is awaited would be late. It is set anew only to end earlier and after its end,
    /// not for each request: that takes the lock of all timers.
    timer: Option<Pin<Box<Sleep>>>,
    /// The end, once it has begun.
    ending: Option<Ending>,
    /// When the current wait began, and the timer of its end.
    wait: Option<(Instant, Pin<Box<Sleep>>)>,
    /// Waits since the rate was last checked, and bytes taken meanwhile.
    waited: Duration,
    taken: u64,
}

/// The end of a stream whose client may still send.
struct Ending {
    /// Bytes that may still be thrown away.
    left: u64,
    piece: Vec<u8>,
    /// Longest pause, and the timer of its end.
    pause: (Duration, Pin<Box<Sleep>>),
    last: Pin<Box<Sleep>>,
}

impl Ending {
    fn begin(linger: &Linger) -> Self {
        let timer = |time| Box::pin(tokio::time::sleep(time));
        Self {
            left: linger.bytes,
            piece: vec![0; LINGER_PIECE],
            pause: (linger.pause, timer(linger.pause)),
            last: timer(linger.total),
        }
    }

    /// Throws away what comes, until it ends.
    fn poll(
        &mut self,
        stream: &mut (impl AsyncRead + Unpin),
        context: &mut Context<'_>,
    ) -> Poll<()> {
        while self.left > 0 {
            let mut buffer = ReadBuf::new(&mut self.piece);
            let read = Pin::new(&mut *stream).poll_read(context, &mut buffer);
            let bytes = buffer.filled().len() as u64;
            match read {
                Poll::Ready(Ok(())) if bytes > 0 => {
                    self.left = self.left.saturating_sub(bytes);
                    let (pause, timer) = &mut self.pause;
                    timer.as_mut().reset(TimerInstant::now() + *pause);
                }
                Poll::Ready(_) => return Poll::Ready(()),
                Poll::Pending => {
                    if self.pause.1.as_mut().poll(context).is_ready() {
                        return Poll::Ready(());
                    }
                    break;
                }
            }
        }
        self.last.as_mut().poll(context)
    }
}

impl<S> WatchedStream<S> {
    /// Watches `stream`.
    pub fn new(stream: S, connection: Arc<OpenConnection>, limits: StreamLimits) -> Self {
        Self {
            stream,
            connection,
            limits,
            begun: None,
            timer: None,
            ending: None,
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
            if self.waited >= self.limits.write {
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
        let (limit, connection) = (self.limits.write, &self.connection);
        let (_, timer) = self.wait.get_or_insert_with(|| {
            connection.leave(Phase::Answer, Phase::Reading);
            (Instant::now(), Box::pin(tokio::time::sleep(limit)))
        });
        ready!(timer.as_mut().poll(context));
        Poll::Ready(too_slow())
    }
}

impl<S> WatchedStream<S> {
    /// Bytes came, perhaps those of a head.
    fn received(&mut self) {
        self.connection.received();
        if let Some((number, _)) = self.connection.awaits_head()
            && self.begun.is_none_or(|(of, _)| of != number)
        {
            self.begun = Some((number, TimerInstant::now()));
        }
    }

    /// When the head that is awaited is late, and whether until then nothing came after a request that was answered;
    /// `None` while no head is awaited.
    fn head_end(&self) -> Option<(TimerInstant, bool)> {
        let (number, since) = self.connection.awaits_head()?;
        let since = TimerInstant::from_std(since);
        Some(match self.begun {
            Some((of, begun)) if of == number => (begun + self.limits.head, false),
            _ if number == 0 => (since + self.limits.head, false),
            _ => (since + self.limits.idle, true),
        })
    }

    /// No bytes came.
    fn await_head(&mut self, context: &mut Context<'_>) -> Poll<io::Error> {
        loop {
            let now = TimerInstant::now();
            let end = match self.head_end() {
                Some((end, idle)) if now >= end => {
                    if !idle {
                        self.connection.set_late();
                    }
                    return Poll::Ready(io::Error::new(io::ErrorKind::TimedOut, Late { idle }));
                }
                Some((end, _)) => end,
                // The answer may end without another look at the stream, so this is looked at again
                // before a head that is awaited from now on could be late.
                None => now + self.limits.idle,
            };
            let timer = self
                .timer
                .get_or_insert_with(|| Box::pin(tokio::time::sleep_until(end)));
            if timer.is_elapsed() || timer.deadline() > end {
                timer.as_mut().reset(end);
            }
            ready!(timer.as_mut().poll(context));
        }
    }
}

fn too_slow() -> io::Error {
    io::Error::new(
        io::ErrorKind::TimedOut,
        "the client does not read its answer",
    )
}

impl<S: AsyncRead + AsyncWrite + Unpin> WatchedStream<S> {
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

impl<S: AsyncRead + AsyncWrite + Unpin> AsyncWrite for WatchedStream<S> {
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
        let this = &mut *self;
        if this.ending.is_none() {
            ready!(Pin::new(&mut this.stream).poll_shutdown(context))?;
            if !this.connection.has_unread() {
                return Poll::Ready(Ok(()));
            }
        }
        let limits = &this.limits.linger;
        let ending = this.ending.get_or_insert_with(|| Ending::begin(limits));
        ending.poll(&mut this.stream, context).map(Ok)
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for WatchedStream<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let read = Pin::new(&mut self.stream).poll_read(context, buffer);
        if read.is_pending() {
            return self.await_head(context).map(Err);
        }
        if buffer.filled().len() > before {
            self.received();
        }
        read
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream, duplex};

    const TEST_LIMIT: Duration = Duration::from_millis(600);
    const TEST_LIMITS: StreamLimits = StreamLimits {
        write: TEST_LIMIT,
        head: Duration::from_millis(300),
        idle: Duration::from_secs(2),
        linger: Linger {
            total: Duration::from_millis(1500),
            pause: Duration::from_millis(400),
            bytes: 1 << 20,
        },
    };

    /// Writes 4 KiB through a pipe of 64 bytes to a client that reads `step` bytes after each
    /// `pause`.
    async fn write_to_a_reader_of(step: usize, pause: Duration) -> io::Result<()> {
        let (service, mut client): (_, DuplexStream) = duplex(64);
        let mut service =
            WatchedStream::new(service, Arc::new(OpenConnection::new(None)), TEST_LIMITS);
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

    /// Reads until the stream gives up; meanwhile `sent` bytes come, one each 20 ms. Returns the time
    /// that it took.
    async fn waits_in_vain(connection: Arc<OpenConnection>, sent: usize) -> Duration {
        let (service, mut client) = duplex(64);
        let mut service = WatchedStream::new(service, connection, TEST_LIMITS);
        let sender = tokio::spawn(async move {
            for _ in 0..sent {
                client.write_all(b"G").await.unwrap();
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
            tokio::time::sleep(Duration::from_secs(60)).await;
            drop(client);
        });
        let begun = Instant::now();
        let mut buffer = [0; 8];
        let ended = loop {
            match service.read(&mut buffer).await {
                Ok(1..) => {}
                other => break other,
            }
        };
        sender.abort();
        assert_eq!(ended.unwrap_err().kind(), io::ErrorKind::TimedOut);
        begun.elapsed()
    }

    #[tokio::test]
    async fn a_connection_is_idle_between_requests_for_longer_than_a_head_may_take() {
        let used = || {
            let used = Arc::new(OpenConnection::new(None));
            used.begin(true);
            used.answered();
            used
        };
        assert!(waits_in_vain(used(), 0).await >= TEST_LIMITS.idle);
        // An answer that ends while the stream is being waited for is not looked at again by hyper.
        let busy = Arc::new(OpenConnection::new(None));
        busy.begin(true);
        busy.enter(Phase::Answer);
        let ending = busy.clone();
        let answer = tokio::spawn(async move {
            tokio::time::sleep(TEST_LIMITS.head).await;
            ending.answered();
        });
        let waited = waits_in_vain(busy, 0).await;
        assert!(waited >= TEST_LIMITS.head + TEST_LIMITS.idle, "{waited:?}");
        answer.await.unwrap();
        // Connections are made as they are needed, since their wait begins then.
        for (before, sent) in [(false, 0), (false, 9), (true, 9)] {
            let connection = if before {
                used()
            } else {
                Arc::new(OpenConnection::new(None))
            };
            let waited = waits_in_vain(connection, sent).await;
            assert!(
                (TEST_LIMITS.head..TEST_LIMITS.idle).contains(&waited),
                "{waited:?}"
            );
        }
    }

    #[tokio::test]
    async fn who_still_sends_when_the_answer_is_written_is_read_for_a_limited_time() {
        let Linger { total, pause, .. } = TEST_LIMITS.linger;
        for (whole, every, expected) in [
            (false, Duration::from_secs(60), pause..total),
            (false, pause / 8, total..Duration::MAX),
            (true, pause / 8, Duration::ZERO..pause),
        ] {
            let connection = Arc::new(OpenConnection::new(None));
            connection.begin(whole);
            let (service, mut client) = duplex(64);
            let mut service = WatchedStream::new(service, connection.clone(), TEST_LIMITS);
            client.write_all(b"POST").await.unwrap();
            service.read_exact(&mut [0; 4]).await.unwrap();
            connection.answered();
            let sender = tokio::spawn(async move {
                loop {
                    tokio::time::sleep(every).await;
                    if client.write_all(b"x").await.is_err() {
                        return;
                    }
                }
            });
            let begun = Instant::now();
            service.shutdown().await.unwrap();
            let took = begun.elapsed();
            sender.abort();
            assert!(expected.contains(&took), "{took:?} is not in {expected:?}");
        }
    }

    #[tokio::test]
    async fn the_end_is_over_when_the_client_closes_and_it_has_the_answer() {
        let connection = Arc::new(OpenConnection::new(None));
        connection.begin(false);
        // As much as is thrown away at most, and more than the pipe holds.
        for bytes in [1 << 10, TEST_LIMITS.linger.bytes as usize / 2] {
            let (service, client) = duplex(4096);
            let mut service = WatchedStream::new(service, connection.clone(), TEST_LIMITS);
            let (mut answer, mut request) = tokio::io::split(client);
            let sender = tokio::spawn(async move {
                request.write_all(&vec![0; bytes]).await.unwrap();
                request.shutdown().await.unwrap();
            });
            service.read_exact(&mut [0; 4]).await.unwrap();
            connection.answered();
            service.write_all(b"refused").await.unwrap();
            let end = tokio::spawn(async move { service.shutdown().await });
            sender.await.unwrap();
            let mut text = Vec::new();
            answer.read_to_end(&mut text).await.unwrap();
            assert_eq!(text, b"refused");
            end.await.unwrap().unwrap();
        }
    }
}
