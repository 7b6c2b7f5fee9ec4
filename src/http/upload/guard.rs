//! Limits on a body while it arrives.

use super::too_large;
use crate::http::app::App;
use crate::http::problem::{Answer, Problem};
use axum::body::{Body, Bytes};
use axum::http::StatusCode;
use futures::{Stream, StreamExt};
use std::sync::{Arc, Mutex, PoisonError};
use tokio::time::{Instant, timeout, timeout_at};

/// Most bytes of a multipart body between two pieces of content: headers and boundaries.
const UNSEEN_BYTES: usize = 256 << 10;

/// Watches a body: its size, its pauses, its whole time. Says why it was cut.
#[derive(Clone)]
pub struct Guard {
    app: App,
    state: Arc<Mutex<GuardState>>,
}

#[derive(Default)]
struct GuardState {
    total: u64,
    unseen: usize,
    problem: Option<Problem>,
}

impl Guard {
    /// A guard by the operator's limits.
    pub fn new(app: &App) -> Self {
        Self {
            app: app.clone(),
            state: Arc::default(),
        }
    }

    /// The body's pieces, until a limit is met.
    pub fn watch(
        &self,
        body: Body,
    ) -> impl Stream<Item = Result<Bytes, CutShort>> + Unpin + Send + use<> {
        let guard = self.clone();
        let deadline = Instant::now() + self.app.settings.upload_time_limit.0;
        let pieces = body.into_data_stream();
        Box::pin(futures::stream::unfold(
            (pieces, guard),
            move |(mut pieces, guard)| async move {
                let pause = guard.app.settings.body_timeout.0;
                let next = timeout_at(deadline, timeout(pause, pieces.next())).await;
                let piece = match next {
                    Ok(Ok(None)) => return None,
                    Ok(Ok(Some(Ok(piece)))) => guard.count(piece),
                    Ok(Ok(Some(Err(error)))) => Err(Problem::bad_request(
                        "broken-body",
                        format!("The body broke off: {error}."),
                    )),
                    _ => Err(Problem::new(
                        StatusCode::REQUEST_TIMEOUT,
                        "body-too-slow",
                        "The body did not arrive in time.",
                    )),
                };
                let piece = piece.map_err(|problem| {
                    guard.lock().problem = Some(problem);
                    CutShort
                });
                Some((piece, (pieces, guard)))
            },
        ))
    }

    fn count(&self, piece: Bytes) -> Answer<Bytes> {
        let mut state = self.lock();
        state.total += piece.len() as u64;
        state.unseen += piece.len();
        if state.total > self.app.settings.body_limit.0 {
            return Err(too_large(&self.app));
        }
        if state.unseen > UNSEEN_BYTES.max(4 * piece.len()) {
            return Err(Problem::bad_request(
                "malformed-form",
                "The form has a header or boundary without end.",
            ));
        }
        Ok(piece)
    }

    /// Content was handed on.
    pub fn seen(&self) {
        self.lock().unseen = 0;
    }

    /// Why the body was cut, told once.
    pub fn recorded(&self) -> Option<Problem> {
        self.lock().problem.take()
    }

    /// Why the body ended early.
    pub fn reason(&self) -> Problem {
        self.recorded()
            .unwrap_or_else(|| Problem::bad_request("broken-body", "The body broke off."))
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, GuardState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A body met a limit; the guard knows which.
#[derive(Debug, thiserror::Error)]
#[error("the body was cut short")]
pub struct CutShort;
