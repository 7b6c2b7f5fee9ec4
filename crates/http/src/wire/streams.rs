//! The limits on streams of events, which last as long as the job they follow: in all, and of one client of a tenant or
//! one anonymous client.

use crate::wire::problem::{Answer, Problem};
use axum::http::{StatusCode, header};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use ventriform_service::base::memory::Requester;

/// The open streams.
pub struct EventStreams {
    limit: usize,
    of_one_client: usize,
    open: Arc<Mutex<BTreeMap<Requester, usize>>>,
}

/// The place of an open stream, until this is dropped.
pub struct StreamPlace {
    requester: Requester,
    open: Arc<Mutex<BTreeMap<Requester, usize>>>,
}

impl EventStreams {
    /// At most `limit` in all.
    pub fn new(limit: usize, of_one_client: usize) -> Self {
        Self {
            limit,
            of_one_client,
            open: Arc::default(),
        }
    }

    /// A place for a stream to the client of the current request.
    ///
    /// # Errors
    /// 429 if there are too many streams.
    pub fn enter(&self) -> Answer<StreamPlace> {
        let requester = Requester::current();
        let mut open = lock(&self.open);
        let own = open.get(&requester).copied().unwrap_or(0);
        // One that has less than its equal share finds room also where others have taken all.
        let requesters = open.len() + usize::from(own == 0);
        let full = open.values().sum::<usize>() >= self.limit && own * requesters >= self.limit;
        if own >= self.of_one_client || full {
            return Err(Problem::new(
                StatusCode::TOO_MANY_REQUESTS,
                "too-many-streams",
                "Too many streams of events are open, in all or of this client.",
            )
            .header(header::RETRY_AFTER, "5")
            .fix(
                "Close streams that are not needed, or ask for the job itself from time to time.",
            ));
        }
        open.insert(requester.clone(), own + 1);
        Ok(StreamPlace {
            requester,
            open: self.open.clone(),
        })
    }
}

impl Drop for StreamPlace {
    fn drop(&mut self) {
        let mut open = lock(&self.open);
        if let Some(own) = open.get_mut(&self.requester) {
            *own -= 1;
            if *own == 0 {
                open.remove(&self.requester);
            }
        }
    }
}

fn lock(open: &Mutex<BTreeMap<Requester, usize>>) -> MutexGuard<'_, BTreeMap<Requester, usize>> {
    // A panic cannot leave the counts half changed: each changes in one step.
    open.lock().unwrap_or_else(PoisonError::into_inner)
}
