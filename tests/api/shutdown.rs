//! Shutdown.

use crate::helpers::{TestApp, fake_engine};

#[tokio::test]
async fn a_job_that_ends_within_the_grace_period_is_committed() {
    let app = TestApp::start().await;
    let job = app.file("brief").await;
    app.until(&job, &["running"]).await;
    let data = app.stop().await;
    let heir = TestApp::on(data, fake_engine(), |_| {}).await;
    let done = heir.until(&job, &["succeeded"]).await;
    assert_eq!(done["attempts"], 1);
}

#[tokio::test]
async fn a_job_that_outlasts_the_grace_period_returns_to_the_queue_uncounted() {
    let app = TestApp::with(|s| s.shutdown_grace = "50ms".parse().unwrap()).await;
    let job = app.file("slow").await;
    app.until(&job, &["running"]).await;
    let data = app.stop().await;
    let heir = TestApp::on(data, fake_engine(), |s| {
        s.shutdown_grace = "50ms".parse().unwrap();
    })
    .await;
    let again = heir.until(&job, &["running"]).await;
    assert_eq!(again["attempts"], 1);
}

#[tokio::test]
async fn a_second_service_cannot_use_the_same_folder() {
    let app = TestApp::start().await;
    let settings = ventriform_service::config::Settings {
        data_dir: app.data.path().to_owned(),
        ..Default::default()
    };
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let Err(error) = ventriform_program::server::start(settings, fake_engine(), listener).await
    else {
        panic!("the folder is in use");
    };
    assert!(error.to_string().contains("in use"));
}
