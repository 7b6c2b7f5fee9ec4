//! Webhooks: telling other programs, by HTTP requests to them, that jobs have started or ended.
//!
//! In: the webhook that a client gives with a job, and the endpoints that a tenant registers for
//! all its jobs. Out: signed requests in the form of Standard Webhooks
//! (<https://www.standardwebhooks.com>).
//!
//! 1. [`UrlGuard::check`] refuses URLs through which a client could reach what only this machine can
//!    reach.
//! 2. The database writes a [`Delivery`] in the transaction that changes the job's state.
//! 3. [`Dispatcher`] sends what is due, a few at a time and fairly among tenants and destinations ([`Lanes`]),
//!    each time through the guard, and signs it ([`SigningSecret`]).
//! 4. What fails is tried again later and later ([`RetrySchedule`]), until a receiver takes it, its
//!    time is over, or the receiver answers 410.
//!
//! Guaranteed: each end of a job is told at least once, across restarts and crashes, or is shown as
//! dead; the id and the content of a delivery are the same in every attempt; no request goes to
//! an address that was not checked; a receiver that hangs delays no other receiver, and no
//! tenant another one. Bodies hold
//! ids and states, and nothing from a file or from a client's request.
//!
//! Not guaranteed: that a delivery arrives only once, or in order. Receivers tell repetitions by
//! `webhook-id`.
//!
//! | where | what |
//! |---|---|
//! | `guard` | which URLs and addresses may be told |
//! | `secret` | signing secrets and signatures |
//! | `event`, `message` | what is told, and the body of a delivery |
//! | `record` | deliveries and endpoints, the trait that a database implements |
//! | `schedule`, `lanes` | when to try again, and whose turn it is |
//! | `sender`, `outcome`, `dispatcher` | one attempt and how it ends; all of them |
//! | `rounds` | the loop over a table of what is due; that of [`crate::network::archive`] too |

mod dispatcher;
mod event;
mod guard;
mod lanes;
mod message;
mod outcome;
mod record;
mod rounds;
mod schedule;
mod secret;
mod sender;

pub use dispatcher::{DeliveryCounts, Dispatcher, HookSettings};
pub use event::HookEvent;
pub use guard::{AllowList, CheckedUrl, Pin, PinnedNames, UrlGuard, UrlRefusal};
pub use lanes::{Lane, Lanes};
pub use message::message_body;
pub use outcome::AttemptOutcome;
pub use record::{
    Backlog, Delivery, DeliveryLimits, DeliveryState, DeliveryStore, DueDelivery, HookEndpoint,
    Settlement,
};
pub use rounds::{AttemptEnd, Errands, Rounds, random_share};
pub use schedule::{NextAttempt, RetrySchedule};
pub use secret::{InvalidSecret, SigningSecret, signature_header};
pub use sender::{Sender, retry_after};

use std::sync::Arc;

/// The webhooks of a service.
pub struct Hooks {
    /// The tables.
    pub(crate) store: Arc<dyn DeliveryStore>,
    /// Which URLs may be told.
    pub(crate) guard: UrlGuard,
    /// Sends deliveries.
    pub(crate) dispatcher: Arc<Dispatcher>,
}
