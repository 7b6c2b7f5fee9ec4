//! The state of the guard.

use super::hosts::HostPolicy;
use ventriform_service::callers::{Gate, RequestCounter};

/// The state of the guard.
pub struct Guard {
    /// Tells callers by their credentials.
    pub gate: Gate,
    /// Which `Host` headers are answered.
    pub hosts: HostPolicy,
    /// Refused credentials per minute and client address.
    pub failure_limit: u64,
    /// Whether the anonymous caller's requests are counted, by its address.
    pub count_anonymous: bool,
    /// Requests of each caller.
    pub requests: RequestCounter,
    /// Refused credentials of each address.
    pub failures: RequestCounter,
}

impl Guard {
    /// A guard that has counted nothing yet.
    pub fn new(gate: Gate, hosts: HostPolicy, failure_limit: u64, count_anonymous: bool) -> Self {
        Self {
            gate,
            hosts,
            failure_limit,
            count_anonymous,
            requests: RequestCounter::default(),
            failures: RequestCounter::default(),
        }
    }
}
