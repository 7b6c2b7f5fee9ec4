//! `/metrics`, and the dashboard and alert rules that use it.

use crate::helpers::{TestApp, volume};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A service that has done something of everything.
async fn busy() -> (TestApp, String) {
    let app = TestApp::start().await;
    app.finished("sphere").await;
    app.finished("brief").await;
    app.finished("fail").await;
    app.get("/v1/jobs/job_0").send().await.unwrap();
    app.get("/nowhere/secret-name").send().await.unwrap();
    let text = app.metrics().await;
    (app, text)
}

/// The value of the series that begins with these words.
fn value(text: &str, series: &str) -> f64 {
    let line = text.lines().find(|line| line.starts_with(series));
    let line = line.unwrap_or_else(|| panic!("no {series} in\n{text}"));
    line.rsplit(' ').next().unwrap().parse().unwrap()
}

#[tokio::test]
async fn jobs_requests_and_the_process_are_counted() {
    let (app, text) = busy().await;
    for (series, least) in [
        ("ventriform_jobs_filed_total{kind=\"model\"}", 3.0),
        ("ventriform_job_attempts_total{kind=\"model\"}", 3.0),
        (
            "ventriform_jobs_finished_total{kind=\"model\",state=\"succeeded\"}",
            2.0,
        ),
        (
            "ventriform_job_failures_total{cause=\"no-surface\",kind=\"model\"}",
            1.0,
        ),
        (
            "ventriform_job_stage_duration_seconds_count{kind=\"model\",stage=\"retile\"}",
            1.0,
        ),
        (
            "ventriform_job_stage_duration_seconds_count{kind=\"model\",stage=\"commit\"}",
            1.0,
        ),
        ("ventriform_job_wait_seconds_count{kind=\"model\"}", 3.0),
        ("ventriform_http_connections ", 1.0),
        ("ventriform_decoding_wait_seconds_count ", 3.0),
        (
            "ventriform_job_duration_seconds_count{kind=\"model\",state=\"failed\"}",
            1.0,
        ),
        (
            "ventriform_http_requests_total{method=\"POST\",route=\"/v1/models\",status=\"202\"}",
            3.0,
        ),
        (
            "ventriform_http_requests_total{method=\"GET\",route=\"/v1/jobs/{id}\",status=\"404\"}",
            1.0,
        ),
        (
            "ventriform_http_requests_total{method=\"GET\",route=\"none\",status=\"404\"}",
            1.0,
        ),
        ("ventriform_http_received_bytes_total", 10.0),
        ("ventriform_http_sent_bytes_total", 1000.0),
        ("ventriform_stored_items{kind=\"volume\"}", 3.0),
        ("ventriform_database_bytes", 4096.0),
        ("ventriform_ready", 1.0),
        ("ventriform_queue_limit", 1000.0),
        ("ventriform_build_info{", 1.0),
    ] {
        assert!(value(&text, series) >= least, "{series}");
    }
    if cfg!(target_os = "linux") {
        assert!(value(&text, "process_resident_memory_bytes") > 1e6);
        assert!(value(&text, "process_open_fds") > 3.0);
        assert!(value(&text, "ventriform_disk_free_bytes") > 0.0);
    }
    assert_eq!(value(&text, "ventriform_webhooks_pending"), 0.0);
    assert_eq!(
        value(&text, "ventriform_oldest_queued_job_age_seconds"),
        0.0
    );
    assert!(
        !text.contains("secret-name") && !text.contains("job_0"),
        "{text}"
    );
    app.stop().await;
}

#[tokio::test]
async fn a_waiting_job_grows_old() {
    let app = TestApp::with(|settings| settings.workers = "1".parse().unwrap()).await;
    let running = app.file("slow").await;
    app.until(&running, &["running"]).await;
    app.post("/v1/models")
        .body(volume("sphere"))
        .send()
        .await
        .unwrap();
    tokio::time::sleep(std::time::Duration::from_millis(50)).await;
    let text = app.metrics().await;
    assert_eq!(value(&text, "ventriform_jobs{state=\"queued\"}"), 1.0);
    assert_eq!(value(&text, "ventriform_jobs{state=\"running\"}"), 1.0);
    assert!(value(&text, "ventriform_oldest_queued_job_age_seconds") > 0.0);
}

/// The names of metrics in a text: words that begin as ours and those of the process do.
fn named(text: &str) -> BTreeSet<String> {
    text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))
        .filter(|word| word.starts_with("ventriform_") || word.starts_with("process_"))
        .map(|word| {
            let word = word.strip_suffix("_bucket").unwrap_or(word);
            word.to_owned()
        })
        .collect()
}

#[tokio::test]
async fn the_dashboard_and_the_rules_name_metrics_that_exist() {
    let (_, text) = busy().await;
    let served: BTreeSet<String> = text
        .lines()
        .filter_map(|line| line.strip_prefix("# TYPE "))
        .filter_map(|line| line.split(' ').next())
        .map(str::to_owned)
        .collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let files = [
        "deploy/grafana/ventriform.json",
        "deploy/prometheus/alerts.yml",
        "docs/monitoring.md",
    ];
    let mut used = BTreeSet::new();
    for file in files {
        let names = named(&std::fs::read_to_string(root.join(file)).unwrap());
        assert!(names.len() > 8, "{file}: {names:?}");
        let missing: Vec<_> = names.difference(&served).collect();
        // Counters that are 0 have no series until something happens.
        let never: Vec<_> = missing
            .iter()
            .filter(|name| name.as_str() != "ventriform_job_retries_total")
            .collect();
        assert!(never.is_empty(), "{file} names {never:?}");
        used.extend(names);
    }
    let own = served.iter().filter(|name| name.starts_with("ventriform_"));
    let undocumented: Vec<_> = own.filter(|name| !used.contains(*name)).collect();
    assert!(undocumented.is_empty(), "{undocumented:?}");
    // A rate of a gauge, or a difference of a counter, would fire for another reason or never.
    let kinds: BTreeMap<&str, &str> = text
        .lines()
        .filter_map(|line| line.strip_prefix("# TYPE ")?.split_once(' '))
        .collect();
    for file in &files[..2] {
        let text = std::fs::read_to_string(root.join(file)).unwrap();
        for (functions, fitting) in [
            (&["rate(", "increase("][..], &["counter", "histogram"][..]),
            (&["delta(", "deriv(", "_over_time("], &["gauge"]),
        ] {
            for function in functions {
                for call in text.split(*function).skip(1) {
                    let name = call.split(['{', '[', '(']).next().unwrap();
                    let name = name.strip_suffix("_bucket").unwrap_or(name);
                    if let Some(kind) = kinds.get(name) {
                        assert!(fitting.contains(kind), "{file}: {function}{name}: {kind}");
                    }
                }
            }
        }
    }
    // promtool runs these (scripts/test.sh).
    let rules = std::fs::read_to_string(root.join(files[1])).unwrap();
    let tried = std::fs::read_to_string(root.join("deploy/prometheus/alerts_test.yml")).unwrap();
    let mut alerts = rules.lines().filter_map(|line| line.split_once("alert: "));
    let untried = alerts.find(|(_, name)| !tried.contains(&format!("alertname=\"{name}\"")));
    assert_eq!(untried, None);
    let board: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(root.join(files[0])).unwrap()).unwrap();
    assert!(board["panels"].as_array().unwrap().len() > 15);
}
