//! What the guard knows and counts.

use super::hosts::HostPolicy;
use super::reservations::Reservations;
use std::sync::Arc;
use ventriform_service::access::{Gate, Quota, Recorder, RequestCounter};
use ventriform_service::config::Settings;

/// What the guard knows and counts.
pub struct Guard {
    /// Tells callers by their credentials.
    pub gate: Gate,
    /// The audit trail.
    pub recorder: Arc<Recorder>,
    /// Which `Host` headers are answered.
    pub hosts: HostPolicy,
    /// Limits on every caller that has none of its own.
    pub quota: Quota,
    /// Refused credentials per minute and client address.
    pub failure_limit: u64,
    /// Whether the anonymous caller's requests are counted, by its address.
    pub count_anonymous: bool,
    /// Requests of each caller.
    pub requests: RequestCounter,
    /// Refused credentials of each address.
    pub failures: RequestCounter,
    /// What the requests under way may add.
    pub reservations: Reservations,
}

impl Guard {
    /// A guard that has counted nothing yet.
    pub fn new(
        gate: Gate,
        recorder: Recorder,
        hosts: HostPolicy,
        settings: &Settings,
        count_anonymous: bool,
    ) -> Self {
        Self {
            gate,
            recorder: Arc::new(recorder),
            hosts,
            quota: Quota {
                requests: settings.quota_requests.0,
                bytes: settings.quota_bytes.0.map(|size| size.0),
                jobs: settings.quota_jobs.0,
            },
            failure_limit: settings.auth_failure_limit,
            count_anonymous,
            requests: RequestCounter::default(),
            failures: RequestCounter::default(),
            reservations: Reservations::default(),
        }
    }
}
