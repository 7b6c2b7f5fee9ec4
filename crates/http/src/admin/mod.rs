//! What operators and administrators ask for: keys, webhooks, the audit trail, readiness.

pub(crate) mod audit;
pub(crate) mod health;
pub(crate) mod keys;
pub(crate) mod webhooks;
