//! Requests read and answers written: bodies, queries, pages of lists, problems, validators.

pub(crate) mod client;
pub(crate) mod document;
pub(crate) mod fields;
pub(crate) mod held_body;
pub(crate) mod idempotency;
pub(crate) mod job_fields;
pub(crate) mod limits;
pub(crate) mod links;
pub(crate) mod memory;
pub(crate) mod negotiate;
pub(crate) mod packed;
pub(crate) mod pagination;
pub(crate) mod problem;
pub(crate) mod public_base;
pub(crate) mod query;
pub(crate) mod request;
pub(crate) mod response_cache;
pub(crate) mod streams;
pub(crate) mod upload;
pub(crate) mod validators;
pub(crate) mod webhook_request;
pub(crate) mod words;
