//! Volumes and jobs of what other systems have sent: stored as an upload is, filed as a request is.

use super::app::App;
use super::jobs::Filing;
use super::jobs::archives::send_of;
use super::jobs::filing::new_job;
use super::problem::Problem;
use super::upload::Bundle;
use crate::intake::{IntakeGroup, MakeError, Rule, VolumeMaker};
use crate::jobs::{Failure, Fault, Filed, LocalFile, Tags};
use async_trait::async_trait;
use futures::TryStreamExt;
use serde_json::{Map, Value};
use tokio_util::io::ReaderStream;

/// Bytes of a file that are read at a time.
const CHUNK: usize = 256 << 10;

impl From<Problem> for MakeError {
    fn from(problem: Problem) -> Self {
        match problem.into_failure() {
            Ok(failure) => Self::Never(failure),
            Err(passing) => Self::Later(passing),
        }
    }
}

#[async_trait]
impl VolumeMaker for App {
    async fn make(&self, group: &IntakeGroup, files: &[LocalFile]) -> Result<String, MakeError> {
        let mut bundle = Bundle::new(self);
        for file in files {
            let file = tokio::fs::File::open(file).await;
            let file = file.map_err(|error| MakeError::Later(error.to_string()))?;
            let pieces = ReaderStream::with_capacity(file, CHUNK).map_err(Problem::internal);
            bundle.write(pieces).await?;
        }
        let tenant = &group.origin.tenant;
        let stored = bundle.store(self, tenant, &Tags::default()).await?;
        Ok(stored.volume.item.id)
    }

    async fn file(
        &self,
        group: &IntakeGroup,
        rule: &Rule,
        volume: &str,
        key: String,
    ) -> Result<String, MakeError> {
        let tenant = &group.origin.tenant;
        let work = self.engine.work(&rule.kind).ok_or_else(|| unknown(rule))?;
        let parameters = work
            .parameters_from_json(&rule.parameters)
            .map_err(MakeError::Never)?;
        let send = send_of(self, tenant, &order(rule), &rule.kind, None)?;
        if let Some(quota) = self.guard.quota.jobs
            && self.access.usage(tenant).await?.jobs >= quota
        {
            return Err(MakeError::Later(
                "the tenant has too many waiting jobs".into(),
            ));
        }
        let filing = Filing {
            tenant: tenant.clone(),
            tags: Tags::default(),
            key: Some(key.clone()),
            webhook: None,
            source: None,
            send,
            trace_parent: None,
        };
        let job = new_job(&**work, Some(volume.to_owned()), parameters, filing);
        match self.queue.file(&job).await? {
            Filed::New(job) | Filed::Same(job) => Ok(job.id),
            // The rules have changed since it was filed.
            Filed::KeyReused => match self.queue.jobs.filed_under(tenant, &key).await? {
                Some((job, _)) => Ok(job.id),
                None => Err(MakeError::Later("the job is gone".into())),
            },
            Filed::QueueFull => Err(MakeError::Later("the queue of jobs is full".into())),
            Filed::Missing { field, .. } => Err(MakeError::Never(
                Failure::new(
                    Fault::Request,
                    "unknown-item",
                    format!("The rule's `{field}` names nothing that this tenant has."),
                )
                .at(field)
                .fix("Correct the rule in the settings, then send the series again."),
            )),
        }
    }
}

fn unknown(rule: &Rule) -> MakeError {
    MakeError::Never(Failure::new(
        Fault::Request,
        "unknown-kind",
        format!("There is no kind of job `{}`.", rule.kind),
    ))
}

/// What a rule sends where, as a request for a job says it.
fn order(rule: &Rule) -> Map<String, Value> {
    let mut order = Map::new();
    if !rule.send.is_empty() {
        order.insert("send".into(), rule.send.clone().into());
    }
    if let Some(to) = &rule.to {
        order.insert("to".into(), to.clone().into());
    }
    order
}

/// Checks the rules of the settings: kinds, parameters, what is sent and where.
///
/// # Errors
/// What is wrong, with the number of the rule.
pub fn check_rules(app: &App) -> Result<(), String> {
    for (number, rule) in app.settings.rules.0.iter().enumerate() {
        let wrong = |reason: String| format!("rule {}: {reason}", number + 1);
        let Some(work) = app.engine.work(&rule.kind) else {
            let kinds: Vec<_> = app.engine.works.iter().map(|w| w.makes().noun()).collect();
            return Err(wrong(format!(
                "there is no kind of job `{}`; known are {}",
                rule.kind,
                kinds.join(", ")
            )));
        };
        work.parameters_from_json(&rule.parameters)
            .map_err(|failure| wrong(failure.detail))?;
        // An archive may serve some tenants only; whose the volumes are is not known yet.
        let mut archives = app.settings.archives.0.iter();
        let archive = archives.find(|archive| Some(&archive.name) == rule.to.as_ref());
        let tenant = archive.and_then(|archive| archive.tenants.first().cloned());
        send_of(
            app,
            &tenant.unwrap_or_default(),
            &order(rule),
            &rule.kind,
            None,
        )
        .map_err(|problem| wrong(problem.into_body().detail))?;
    }
    Ok(())
}
