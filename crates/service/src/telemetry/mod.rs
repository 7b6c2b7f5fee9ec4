//! Figures and traces for operators: metrics, spans, readiness.
//!
//! Every label and every attribute has a fixed set of values; none holds a text of a client or a file.

mod job_watch;
mod metrics;
mod readiness;
mod spans;

pub use job_watch::JobWatch;
pub use metrics::{IntakeMetrics, JobMetrics, MetricReadings, Metrics, RequestMetrics};
pub use readiness::{Check, Dependencies, Readiness, why_unready};
pub use spans::{JobSpan, OtlpError, ServerSpan, Spans};
