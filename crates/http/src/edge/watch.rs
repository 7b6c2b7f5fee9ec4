//! Ends what lasts longer than the credentials that opened it.
//!
//! A request is admitted once. Its answer may go on for hours: a stream of events, a download over a slow line, a wait
//! for a job. [`CredentialWatch`] asks every [`LOOK_EVERY`] whether the credentials still open the service, so that
//! such an answer ends soon after a key was revoked, or a key or token has expired. It is broken off, and its
//! connection closed, so that no client takes it for whole.
//!
//! Uploads are not ended: what a request has begun with valid credentials it may finish.

use crate::app::App;
use axum::body::{Body, HttpBody};
use axum::response::Response;
use bytes::Bytes;
use futures::future::BoxFuture;
use hyper::body::{Frame, SizeHint};
use std::fmt;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use ventriform_service::callers::Identity;

/// How often the credentials of an answer that lasts are looked at.
const LOOK_EVERY: Duration = Duration::from_secs(3);

/// An answer of up to so many bytes is sent at once.
const SHORT_BYTES: u64 = 64 << 10;

/// Watches the credentials of one request.
#[derive(Clone)]
pub struct CredentialWatch {
    app: App,
    identity: Arc<Identity>,
}

impl fmt::Debug for CredentialWatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CredentialWatch").finish_non_exhaustive()
    }
}

impl CredentialWatch {
    /// Watches the credentials of that identity.
    pub fn new(app: &App, identity: Arc<Identity>) -> Self {
        Self {
            app: app.clone(),
            identity,
        }
    }

    /// Waits until the credentials have ended.
    pub async fn ended(&self) {
        loop {
            tokio::time::sleep(LOOK_EVERY).await;
            match self.app.guard.gate.still_admits(&self.identity).await {
                Ok(true) => {}
                Ok(false) => return,
                // Nobody can have revoked a key in a database that does not answer; new requests are refused meanwhile.
                Err(error) => tracing::debug!(%error, "credentials could not be looked at"),
            }
        }
    }

    /// The answer, which ends with the credentials.
    pub fn over(self, response: Response) -> Response {
        let is_short = response
            .body()
            .size_hint()
            .upper()
            .is_some_and(|bytes| bytes <= SHORT_BYTES);
        if is_short {
            return response;
        }
        response.map(|body| {
            Body::new(WatchedBody {
                body,
                watch: Some(self),
                ended: None,
            })
        })
    }
}

/// A body that ends with the credentials of its request.
struct WatchedBody {
    body: Body,
    /// Until the first look at the body.
    watch: Option<CredentialWatch>,
    ended: Option<BoxFuture<'static, ()>>,
}

impl HttpBody for WatchedBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        if let Some(watch) = self.watch.take() {
            self.ended = Some(Box::pin(async move { watch.ended().await }));
        }
        if let Some(ended) = &mut self.ended
            && ended.as_mut().poll(context).is_ready()
        {
            self.ended = None;
            self.body = Body::empty();
            tracing::info!("an answer was ended because the credentials of its request have ended");
            let broken = std::io::Error::other("the credentials of the request have ended");
            return Poll::Ready(Some(Err(axum::Error::new(broken))));
        }
        Pin::new(&mut self.body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
