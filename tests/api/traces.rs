//! Traces: what a collector gets.

use crate::helpers::{TestApp, text};
use crate::receiver::Receiver;
use opentelemetry_proto::tonic::collector::trace::v1::ExportTraceServiceRequest;
use opentelemetry_proto::tonic::trace::v1::Span;
use prost::Message;
use serde_json::json;
use std::time::{Duration, Instant};

const TRACE_ID: &str = "0af7651916cd43dd8448eb211c80319c";
const CALLER_SPAN_ID: &str = "b7ad6b7169203331";

/// The spans in the requests that a collector got.
pub fn spans_of(collector: &Receiver) -> Vec<Span> {
    let requests = collector.received().into_iter().map(|request| {
        assert_eq!(request.path, "/v1/traces");
        assert_eq!(request.header("content-type"), "application/x-protobuf");
        ExportTraceServiceRequest::decode(request.body).unwrap()
    });
    requests
        .flat_map(|request| request.resource_spans)
        .flat_map(|resource| resource.scope_spans)
        .flat_map(|scope| scope.spans)
        .collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[tokio::test]
async fn a_job_belongs_to_the_trace_of_the_request_that_filed_it() {
    let collector = Receiver::willing().await;
    let app = TestApp::with(|settings| {
        settings.otlp_endpoint = collector.url.parse().unwrap();
    })
    .await;
    let volume = app.volume("brief").await;
    let answer = app
        .post("/v1/jobs")
        .header("traceparent", format!("00-{TRACE_ID}-{CALLER_SPAN_ID}-01"))
        .json(&json!({ "volume": volume }));
    let answer = answer.send().await.unwrap();
    let continued = answer.headers()["traceparent"].to_str().unwrap().to_owned();
    let job = answer.json().await.unwrap();
    app.until(&job, &["succeeded"]).await;
    app.stop().await;

    let spans = spans_of(&collector);
    let of_trace = spans.iter().filter(|span| hex(&span.trace_id) == TRACE_ID);
    let of_trace: Vec<&Span> = of_trace.collect();
    let named = |name: &str| {
        let found = of_trace.iter().find(|span| span.name == name);
        *found.unwrap_or_else(|| panic!("no span `{name}` in {of_trace:#?}"))
    };
    let request = named("POST /v1/jobs");
    assert_eq!(hex(&request.parent_span_id), CALLER_SPAN_ID);
    assert_eq!(
        continued,
        format!("00-{TRACE_ID}-{}-01", hex(&request.span_id))
    );
    let whole = named("job model");
    assert_eq!(whole.parent_span_id, request.span_id);
    let mut end = whole.start_time_unix_nano;
    for name in ["queued", "retile", "commit"] {
        let part = named(name);
        assert_eq!(part.parent_span_id, whole.span_id, "{name}");
        assert!(
            part.end_time_unix_nano >= part.start_time_unix_nano,
            "{name}"
        );
        assert!(part.end_time_unix_nano >= end, "{name} follows");
        end = part.end_time_unix_nano;
    }
    assert!(whole.end_time_unix_nano >= end);
    let attributes = format!("{:?}", whole.attributes);
    assert!(attributes.contains(&text(&job["id"])) && attributes.contains("succeeded"));
    // The upload came without a trace and began one.
    let upload = spans
        .iter()
        .find(|span| span.name == "POST /v1/volumes")
        .unwrap();
    assert_ne!(hex(&upload.trace_id), TRACE_ID);
    assert!(upload.parent_span_id.is_empty());
}

#[tokio::test]
async fn a_job_keeps_its_trace_over_a_restart() {
    let collector = Receiver::willing().await;
    let app = TestApp::with(|settings| settings.shutdown_grace = "100ms".parse().unwrap()).await;
    let volume = app.volume("slow").await;
    let answer = app
        .post("/v1/jobs")
        .header("traceparent", format!("00-{TRACE_ID}-{CALLER_SPAN_ID}-01"))
        .json(&json!({ "volume": volume }));
    let job = answer.send().await.unwrap().json().await.unwrap();
    app.until(&job, &["running"]).await;
    let data = app.stop().await;
    let app = TestApp::on(data, crate::helpers::fake_engine(), |settings| {
        settings.otlp_endpoint = collector.url.parse().unwrap();
    })
    .await;
    app.until(&job, &["running"]).await;
    app.delete(&text(&job["links"]["self"]))
        .send()
        .await
        .unwrap();
    app.until(&job, &["cancelled"]).await;
    app.stop().await;
    let spans = spans_of(&collector);
    let whole = spans.iter().find(|span| span.name == "job model").unwrap();
    assert_eq!(hex(&whole.trace_id), TRACE_ID);
}

#[tokio::test]
async fn a_collector_that_is_away_costs_nothing_but_spans() {
    let endpoint = format!("http://127.0.0.1:{}", crate::helpers::quiet_port());
    let app = TestApp::with(|settings| {
        settings.otlp_endpoint = endpoint.parse().unwrap();
    })
    .await;
    for _ in 0..100 {
        app.json("/healthz").await;
    }
    let job = app.finished("sphere").await;
    assert_eq!(job["state"], "succeeded");
    let started = Instant::now();
    app.stop().await;
    assert!(started.elapsed() < Duration::from_secs(20));
}
