//! `/v1/jobs/{id}/events`: a job's changes as server-sent events.
//!
//! Each event holds the whole job, and its id is the job's revision, so a client that misses an
//! event loses nothing. A client that reconnects with `Last-Event-ID` gets the newest state, if it
//! is newer than that, and what follows. The last event shows a final state; then the stream ends.
//! A client that reconnects after that gets 204, on which an `EventSource` stops.

use super::{describe, find};
use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{self, LookupProblems};
use crate::wire::memory::end_rows;
use crate::wire::problem::{Answer, Problem, ProblemBody};
use crate::wire::public_base::PublicBase;
use crate::wire::query::NoQuery;
use crate::wire::request::PathSegments;
use crate::wire::streams::StreamPlace;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures::Stream;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use ventriform_service::base::records::Job;
use ventriform_service::callers::Scope;

const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// Follow a job
///
/// Server-sent events named `job`: the whole job after each change, with its revision as the id,
/// until its final state. Resumes after `Last-Event-ID`.
#[utoipa::path(get, path = "/v1/jobs/{id}/events", tag = "jobs",
    params(("id" = String, Path, description = "The job's id"),
        openapi::EventHeader),
    responses(
        openapi::EventsAnswer,
        (status = 204, description = "The client has already seen the final state"),
        (status = 429, description = "Too many streams are open", body = ProblemBody,
            content_type = "application/problem+json"),
        LookupProblems))]
pub async fn follow_job(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
    headers: HeaderMap,
) -> Answer {
    let seen = last_event_id(&headers)?;
    // Subscribing comes before reading, so that no change is missed in between.
    let changes = app.service.queue().changes();
    let job = find(&app, &caller.tenant, &id).await?;
    if job.state.is_final() && job.revision <= seen {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let place = app.streams.enter()?;
    // The stream holds the job, or what tells of it, as long as its client reads nothing.
    end_rows(2).await;
    Ok(stream(app, caller.scope, job, seen, changes, place))
}

fn last_event_id(headers: &HeaderMap) -> Answer<i64> {
    let Some(value) = headers.get("last-event-id") else {
        return Ok(0);
    };
    let number = value
        .to_str()
        .ok()
        .and_then(|text| text.trim().parse().ok());
    number.filter(|revision| *revision >= 0).ok_or_else(|| {
        Problem::bad_request("invalid-header", "`Last-Event-ID` must be a whole number.")
            .at("Last-Event-ID")
            .fix("Send the id of the last event that you received.")
    })
}

fn stream(
    app: App,
    scope: Scope,
    job: Job,
    seen: i64,
    changes: Receiver<Arc<Job>>,
    place: StreamPlace,
) -> Response {
    let follower = Follower {
        id: job.id.clone(),
        next: Some(job),
        app,
        scope,
        seen,
        changes,
        base: PublicBase::current(),
        _place: place,
    };
    let events = Sse::new(follower.events()).keep_alive(KeepAlive::new().interval(KEEP_ALIVE));
    // nginx would keep events back until its buffer is full.
    ([("x-accel-buffering", "no")], events).into_response()
}

struct Follower {
    app: App,
    /// What its client may see.
    scope: Scope,
    id: String,
    next: Option<Job>,
    seen: i64,
    changes: Receiver<Arc<Job>>,
    /// The address for links: the answer's body is made after the request was answered.
    base: Option<Arc<PublicBase>>,
    _place: StreamPlace,
}

impl Follower {
    fn events(self) -> impl Stream<Item = Result<Event, Infallible>> {
        futures::stream::unfold(Some(self), |follower| async move {
            let mut follower = follower?;
            let job = follower.newer().await?;
            follower.seen = job.revision;
            let last = job.state.is_final();
            let event = Event::default().event("job").id(job.revision.to_string());
            let wire = describe(&follower.app, follower.scope, job);
            let wire = match &follower.base {
                Some(base) => base.clone().scope(wire).await,
                None => wire.await,
            };
            let wire = wire.ok()?;
            let event = event.json_data(wire).ok()?;
            Some((Ok(event), (!last).then_some(follower)))
        })
    }

    /// The next state that is newer than the last one sent; `None` if the job is gone or the
    /// service shuts down.
    async fn newer(&mut self) -> Option<Job> {
        let queue = self.app.service.queue().clone();
        let look = queue.next_poll();
        tokio::pin!(look);
        loop {
            if let Some(job) = self.next.take()
                && job.revision > self.seen
            {
                return Some(job);
            }
            self.next = tokio::select! {
                change = self.changes.recv() => match change {
                    Ok(job) if job.id == self.id => Some((*job).clone()),
                    Ok(_) => None,
                    // The client reads more slowly than events arrive: read the table instead.
                    Err(RecvError::Lagged(_)) => Some(self.look().await?),
                    Err(RecvError::Closed) => return None,
                },
                () = &mut look => {
                    look.set(queue.next_poll());
                    Some(self.look().await?)
                }
                () = self.app.service.closing().cancelled() => return None,
            };
        }
    }

    async fn look(&self) -> Option<Job> {
        let job = self.app.service.followed_job(&self.id).await;
        job.ok().flatten()
    }
}
