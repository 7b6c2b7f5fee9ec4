//! Figures for Prometheus.

use crate::jobs::QueueLoad;
use axum::http::StatusCode;
use prometheus::{Gauge, IntCounterVec, IntGaugeVec, Opts, Registry, TextEncoder};
use std::time::Instant;

/// The metrics of one service.
pub struct Metrics {
    registry: Registry,
    jobs: IntGaugeVec,
    answers: IntCounterVec,
    uptime: Gauge,
    started: Instant,
}

impl Metrics {
    /// The metrics of a service that starts now: all are 0.
    ///
    /// # Panics
    /// Never: the names are valid and distinct.
    pub fn new() -> Self {
        Self::registered().expect("the names of the metrics are valid and distinct")
    }

    fn registered() -> Result<Self, prometheus::Error> {
        let jobs = Opts::new("ventriform_jobs", "Jobs that have not ended.");
        let answers = Opts::new(
            "ventriform_http_answers_total",
            "Answers by class of status.",
        );
        let metrics = Self {
            registry: Registry::new(),
            jobs: IntGaugeVec::new(jobs, &["state"])?,
            answers: IntCounterVec::new(answers, &["class"])?,
            uptime: Gauge::new("ventriform_uptime_seconds", "Time since the start.")?,
            started: Instant::now(),
        };
        for class in 1..=5 {
            metrics.answers.with_label_values(&[format!("{class}xx")]);
        }
        metrics.registry.register(Box::new(metrics.jobs.clone()))?;
        metrics
            .registry
            .register(Box::new(metrics.answers.clone()))?;
        metrics
            .registry
            .register(Box::new(metrics.uptime.clone()))?;
        Ok(metrics)
    }

    /// Counts an answer.
    pub fn count_answer(&self, status: StatusCode) {
        let class = format!("{}xx", status.as_u16() / 100);
        self.answers.with_label_values(&[class]).inc();
    }

    /// All figures in the text format of Prometheus (version 0.0.4).
    ///
    /// # Errors
    /// Never, as every metric has a value.
    pub fn text(&self, load: &QueueLoad) -> Result<String, prometheus::Error> {
        for (state, jobs) in [("queued", load.queued), ("running", load.running)] {
            let jobs = i64::try_from(jobs).unwrap_or(i64::MAX);
            self.jobs.with_label_values(&[state]).set(jobs);
        }
        self.uptime.set(self.started.elapsed().as_secs_f64());
        TextEncoder::new().encode_to_string(&self.registry.gather())
    }
}
