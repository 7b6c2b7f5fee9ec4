//! `/v1/jobs/{id}/events`.

use crate::helpers::{TestApp, problem, text};
use reqwest::StatusCode;
use serde_json::Value;

/// The id and the data of every event in a complete stream.
fn events(stream: &str) -> Vec<(i64, Value)> {
    stream
        .split("\n\n")
        .filter(|event| event.contains("data:"))
        .map(|event| {
            let line = |name: &str| {
                let mut lines = event.lines();
                lines
                    .find_map(|l| l.strip_prefix(name))
                    .unwrap()
                    .trim()
                    .to_owned()
            };
            let data = serde_json::from_str(&line("data:")).unwrap();
            (line("id:").parse().unwrap(), data)
        })
        .collect()
}

#[tokio::test]
async fn events_report_each_change_and_end_with_the_final_state() {
    let app = TestApp::start().await;
    let job = app.file("brief").await;
    let path = text(&job["links"]["events"]);
    let answer = app.get(&path).send().await.unwrap();
    assert!(
        answer.headers()["content-type"]
            .to_str()
            .unwrap()
            .starts_with("text/event-stream")
    );
    let events = events(&answer.text().await.unwrap());
    let states: Vec<_> = events.iter().map(|(_, job)| text(&job["state"])).collect();
    assert_eq!(states.last().unwrap(), "succeeded");
    assert!(states.contains(&"running".to_owned()));
    assert!(events.iter().any(|(_, job)| job["stage"] == "retile"));
    assert!(events.windows(2).all(|pair| pair[0].0 < pair[1].0));
    let progress: Vec<_> = events
        .iter()
        .map(|(_, j)| j["progress"].as_f64().unwrap())
        .collect();
    assert!(
        progress.windows(2).all(|pair| pair[0] <= pair[1]),
        "{progress:?}"
    );

    let last = events.last().unwrap().0;
    let resume = |id: i64| {
        app.get(&path)
            .header("last-event-id", id.to_string())
            .send()
    };
    assert_eq!(resume(last).await.unwrap().status(), StatusCode::NO_CONTENT);
    let rest = resume(last - 1).await.unwrap().text().await.unwrap();
    assert_eq!(self::events(&rest).len(), 1);
}

#[tokio::test]
async fn events_of_an_unknown_job_are_not_found() {
    let app = TestApp::start().await;
    let unknown = app.get("/v1/jobs/job_0/events").send().await.unwrap();
    problem(unknown, 404, "not-found").await;
    let job = app.file("sphere").await;
    let path = text(&job["links"]["events"]);
    let odd = app
        .get(&path)
        .header("last-event-id", "yesterday")
        .send()
        .await
        .unwrap();
    problem(odd, 400, "invalid-header").await;
}
