//! Traces for OpenTelemetry: spans of requests and of jobs, sent by OTLP over HTTP with protobuf.
//!
//! A request continues the trace of its `traceparent`, or begins one. A job belongs to the trace of
//! the request that filed it, in whichever process it runs: its span covers the time from filing to
//! its end, and has one child for the time in the queue, one for each stage, and one for the
//! storing of the result.
//!
//! Spans hold methods, patterns of paths, statuses, ids of jobs, kinds, states and codes of
//! failures, and nothing that a client or a file says.
//!
//! Without an endpoint nothing is made. With one, spans wait in a queue of limited length for a
//! thread that sends them; what does not fit, or cannot be sent, is dropped.

use crate::base::http_client::{ClientFactory, ClientOptions, HttpClient, Redirects, SendError};
use crate::base::records::{Job, Timestamp};
use async_trait::async_trait;
use bytes::Bytes;
use futures::StreamExt;
use opentelemetry::trace::{
    Span, SpanContext, SpanId, SpanKind, Status, TraceContextExt, TraceFlags, TraceId, TraceState,
    Tracer, TracerProvider,
};
use opentelemetry::{Context, KeyValue};
use opentelemetry_http::{HttpError, Request, Response};
use opentelemetry_otlp::{Protocol, SpanExporter, WithExportConfig, WithHttpConfig};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::trace::{SdkTracer, SdkTracerProvider};
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio::runtime::Handle;
use url::Url;

/// Longest time to send a batch of spans, and to send the last ones on shutdown.
const SEND_LIMIT: Duration = Duration::from_secs(5);

/// Largest answer of a collector that is read, bytes.
const ANSWER_BYTES: usize = 64 << 10;

/// Most redirects of a collector.
const MAX_REDIRECTS: usize = 10;

/// The path of traces below a collector's address (OTLP over HTTP).
const TRACES_PATH: &str = "/v1/traces";

/// Makes spans, if a collector is set.
#[derive(Clone, Default)]
pub struct Spans(Option<SdkTracerProvider>);

/// An OTLP endpoint cannot be used.
#[derive(Debug, thiserror::Error)]
#[error(
    "otlp_endpoint = `{endpoint}`: {reason}; give the collector's address, such as http://127.0.0.1:4318"
)]
pub struct OtlpError {
    endpoint: String,
    reason: String,
}

impl Spans {
    /// Sends spans to the collector at this address, by a client of that factory; makes none without one. To be
    /// called within the runtime that sends them.
    ///
    /// # Errors
    /// If the address is not a URL.
    pub fn new(endpoint: Option<&str>, clients: &dyn ClientFactory) -> Result<Self, OtlpError> {
        let Some(endpoint) = endpoint else {
            return Ok(Self(None));
        };
        let unusable = |reason: String| OtlpError {
            endpoint: endpoint.to_owned(),
            reason,
        };
        let url = Url::parse(endpoint).map_err(|e| unusable(e.to_string()))?;
        if !matches!(url.scheme(), "http" | "https") {
            return Err(unusable(
                "it begins with neither http:// nor https://".into(),
            ));
        }
        let client = clients
            .build(ClientOptions {
                total_timeout: Some(SEND_LIMIT),
                redirects: Redirects::Anywhere(MAX_REDIRECTS),
                environment_proxies: true,
                ..ClientOptions::default()
            })
            .map_err(|e| unusable(e.to_string()))?;
        let exporter = SpanExporter::builder()
            .with_http()
            .with_http_client(CollectorClient {
                client,
                runtime: Handle::current(),
            })
            .with_protocol(Protocol::HttpBinary)
            .with_endpoint(traces_url(endpoint))
            .with_timeout(SEND_LIMIT)
            .build()
            .map_err(|e| unusable(e.to_string()))?;
        let resource = Resource::builder_empty()
            .with_service_name("ventriform")
            .with_attribute(KeyValue::new("service.version", env!("CARGO_PKG_VERSION")))
            .build();
        let provider = SdkTracerProvider::builder()
            .with_batch_exporter(exporter)
            .with_resource(resource)
            .build();
        Ok(Self(Some(provider)))
    }

    fn tracer(&self) -> Option<SdkTracer> {
        self.0
            .as_ref()
            .map(|provider| provider.tracer("ventriform"))
    }

    /// A span for a request, within the trace of `parent`, a value of the header `traceparent`.
    pub fn request(&self, method: &str, route: &str, parent: Option<&str>) -> Option<ServerSpan> {
        let tracer = self.tracer()?;
        let span = tracer
            .span_builder(format!("{method} {route}"))
            .with_kind(SpanKind::Server)
            .with_attributes([
                KeyValue::new("http.request.method", method.to_owned()),
                KeyValue::new("http.route", route.to_owned()),
            ])
            .start_with_context(&tracer, &context_of(parent));
        Some(ServerSpan(span))
    }

    /// Spans for a job that starts now.
    pub fn job(&self, job: &Job) -> Option<JobSpan> {
        let tracer = self.tracer()?;
        let parent = context_of(job.trace_parent.as_deref());
        let span = tracer
            .span_builder(format!("job {}", job.kind))
            .with_kind(SpanKind::Consumer)
            .with_start_time(time_of(job.created_at))
            .with_attributes([
                KeyValue::new("ventriform.job.id", job.id.clone()),
                KeyValue::new("ventriform.job.kind", job.kind.clone()),
                KeyValue::new("ventriform.job.attempt", i64::from(job.attempts)),
            ])
            .start_with_context(&tracer, &parent);
        let context = parent.with_remote_span_context(span.span_context().clone());
        let mut queued = tracer
            .span_builder("queued")
            .with_start_time(time_of(job.created_at))
            .start_with_context(&tracer, &context);
        queued.end_with_timestamp(job.started_at.map_or_else(SystemTime::now, time_of));
        Some(JobSpan {
            tracer,
            span,
            context,
            stage: None,
        })
    }

    /// Sends what waits, for at most a few seconds.
    pub async fn flush(&self) {
        let Some(provider) = self.0.clone() else {
            return;
        };
        let ended = tokio::task::spawn_blocking(move || provider.shutdown_with_timeout(SEND_LIMIT));
        if let Ok(Err(error)) = ended.await {
            tracing::warn!(%error, "the last spans were not sent");
        }
    }
}

/// The span of a request that is being answered.
pub struct ServerSpan(opentelemetry_sdk::trace::Span);

impl ServerSpan {
    /// The header `traceparent` by which the answer, and what the request starts, continue the
    /// trace.
    pub fn trace_parent(&self) -> String {
        let context = self.0.span_context();
        format!(
            "00-{}-{}-{:02x}",
            context.trace_id(),
            context.span_id(),
            context.trace_flags()
        )
    }

    /// Ends it with the answer's status.
    pub fn end(mut self, status: u16) {
        let key = "http.response.status_code";
        self.0.set_attribute(KeyValue::new(key, i64::from(status)));
        if status >= 500 {
            self.0.set_status(Status::error(""));
        }
        self.0.end();
    }
}

/// The spans of a job that runs.
pub struct JobSpan {
    tracer: SdkTracer,
    span: opentelemetry_sdk::trace::Span,
    context: Context,
    stage: Option<opentelemetry_sdk::trace::Span>,
}

impl JobSpan {
    /// Ends the current stage and begins the next.
    pub fn enter(&mut self, stage: Option<&str>) {
        if let Some(mut ended) = self.stage.take() {
            ended.end();
        }
        self.stage = stage.map(|stage| {
            let builder = self.tracer.span_builder(stage.to_owned());
            builder.start_with_context(&self.tracer, &self.context)
        });
    }

    /// Ends the job's span in its state.
    pub fn end(mut self, job: &Job) {
        self.enter(None);
        let state = KeyValue::new("ventriform.job.state", job.state.as_str());
        self.span.set_attribute(state);
        if let Some(failure) = &job.failure {
            let cause = KeyValue::new("error.type", failure.code.clone());
            self.span.set_attribute(cause);
            self.span.set_status(Status::error(""));
        }
        self.span.end();
    }
}

fn traces_url(endpoint: &str) -> String {
    let base = endpoint.trim_end_matches('/');
    if base.ends_with(TRACES_PATH) {
        base.to_owned()
    } else {
        format!("{base}{TRACES_PATH}")
    }
}

/// The context of a valid `traceparent`; an empty one if there is none.
fn context_of(parent: Option<&str>) -> Context {
    let context = Context::new();
    let parts: Vec<&str> = parent.unwrap_or_default().split('-').collect();
    let [_, trace, span, flags] = parts[..] else {
        return context;
    };
    let (Ok(trace), Ok(span), Ok(flags)) = (
        TraceId::from_hex(trace),
        SpanId::from_hex(span),
        u8::from_str_radix(flags, 16),
    ) else {
        return context;
    };
    let flags = TraceFlags::new(flags) & TraceFlags::SAMPLED;
    let remote = SpanContext::new(trace, span, flags, true, TraceState::default());
    context.with_remote_span_context(remote)
}

fn time_of(at: Timestamp) -> SystemTime {
    UNIX_EPOCH + Duration::from_millis(u64::try_from(at).unwrap_or(0))
}

/// Sends batches with the service's HTTP client. The exporter calls it from a thread of its own,
/// so the request is made on the runtime.
#[derive(Debug)]
struct CollectorClient {
    client: Arc<dyn HttpClient>,
    runtime: Handle,
}

#[async_trait]
impl opentelemetry_http::HttpClient for CollectorClient {
    async fn send_bytes(&self, request: Request<Bytes>) -> Result<Response<Bytes>, HttpError> {
        let client = self.client.clone();
        let sent = self.runtime.spawn(async move {
            let (head, mut pieces) = client.send(request).await?.into_parts();
            let mut body = Vec::new();
            while let Some(piece) = pieces.next().await {
                body.extend_from_slice(&piece?);
                if body.len() > ANSWER_BYTES {
                    break;
                }
            }
            Ok::<_, SendError>((head.status, body))
        });
        let (status, body) = sent.await??;
        let answer = Response::builder().status(status);
        Ok(answer.body(Bytes::from(body))?)
    }
}
