//! Volumes and jobs of what other systems have sent: stored as an upload is, filed as a request is.

use super::app::App;
use super::client::ClientAddress;
use super::guard::Counting;
use super::jobs::Filing;
use super::jobs::archives::{send_of, source_of};
use super::jobs::filing::new_job;
use super::problem::Problem;
use super::upload::Bundle;
use async_trait::async_trait;
use futures::TryStreamExt;
use serde_json::{Map, Value};
use tokio_util::io::ReaderStream;
use ventriform_service::intake::{IntakeGroup, MakeError, Rule, VolumeMaker};
use ventriform_service::records::{Failure, Fault, Filed, LocalFile, Priority, Tags, Tenant};

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
        let mut bundle = Bundle::new(self, &Counting::default());
        for file in files {
            let file = tokio::fs::File::open(file).await;
            let file = file.map_err(|error| MakeError::Later(error.to_string()))?;
            let pieces = ReaderStream::with_capacity(file, CHUNK).map_err(Problem::internal);
            bundle.write(pieces).await?;
        }
        let tenant = &group.origin.tenant;
        let tags = Tags::default();
        let stored = bundle.store(self, tenant, &tags);
        // Decoding is shared out between the senders.
        let stored = match group.origin.address.parse() {
            Ok(address) => ClientAddress::of_peer(address).scope(stored).await?,
            Err(_) => stored.await?,
        };
        Ok(stored.volume.item.id)
    }

    async fn file(
        &self,
        group: &IntakeGroup,
        rule: &Rule,
        volume: &str,
        key: String,
    ) -> Result<String, MakeError> {
        let order = UnattendedJob {
            by: "rule",
            tenant: &group.origin.tenant,
            kind: &rule.kind,
            priority: Priority::default(),
            parameters: &rule.parameters,
            volume: Some(volume),
            order: order(&rule.send, rule.to.as_deref()),
            key,
        };
        file_unattended(self, order).await
    }
}

/// A job that nobody's request asks for.
pub struct UnattendedJob<'a> {
    /// What in the settings asks for it.
    pub by: &'static str,
    /// Whose job it is.
    pub tenant: &'a Tenant,
    /// Its kind.
    pub kind: &'a str,
    /// How urgent it is.
    pub priority: Priority,
    /// Its parameters.
    pub parameters: &'a Map<String, Value>,
    /// Its volume, unless `order` names a source.
    pub volume: Option<&'a str>,
    /// `source`, `send` and `to`, as a request for a job says them.
    pub order: Map<String, Value>,
    /// Its idempotency key.
    pub key: String,
}

/// Files a job that nobody's request asks for. Returns its id; the same under the same key.
///
/// # Errors
/// Whether it may be filed later.
pub async fn file_unattended(app: &App, job: UnattendedJob<'_>) -> Result<String, MakeError> {
    let (tenant, kind, key) = (job.tenant, job.kind, job.key);
    let work = app.engine.work(kind).ok_or_else(|| unknown(kind))?;
    let parameters = work
        .parameters_from_json(job.parameters)
        .map_err(MakeError::Never)?;
    let source = source_of(app, tenant, &job.order).await?;
    let send = send_of(app, tenant, &job.order, kind, source.as_ref())?;
    if let Some(quota) = app.guard.quota.jobs
        && app.access.usage(tenant).await?.jobs >= quota
    {
        let full = "the tenant has too many waiting jobs";
        return Err(MakeError::Later(full.into()));
    }
    let filing = Filing {
        tenant: tenant.clone(),
        tags: Tags::default(),
        priority: job.priority,
        key: Some(key.clone()),
        webhook: None,
        source,
        send,
        trace_parent: None,
        storage_limit: app.guard.quota.bytes,
    };
    let volume = job.volume.map(str::to_owned);
    let new = new_job(&**work, volume, parameters, filing);
    match app.queue.file(&new).await? {
        Filed::New(job) | Filed::Same(job) => Ok(job.id),
        // The settings have changed since it was filed.
        Filed::KeyReused => match app.queue.table().filed_under(tenant, &key).await? {
            Some((job, _)) => Ok(job.id),
            None => Err(MakeError::Later("the job is gone".into())),
        },
        Filed::QueueFull => Err(MakeError::Later("the queue of jobs is full".into())),
        Filed::Missing { field, .. } => Err(MakeError::Never(
            Failure::new(
                Fault::Request,
                "unknown-item",
                format!(
                    "The {}'s `{field}` names nothing that this tenant has.",
                    job.by
                ),
            )
            .at(field)
            .fix("Correct the settings, then send the series again."),
        )),
    }
}

fn unknown(kind: &str) -> MakeError {
    MakeError::Never(Failure::new(
        Fault::Request,
        "unknown-kind",
        format!("There is no kind of job `{kind}`."),
    ))
}

/// What is sent where, as a request for a job says it.
pub fn order(send: &[String], to: Option<&str>) -> Map<String, Value> {
    let mut order = Map::new();
    if !send.is_empty() {
        order.insert("send".into(), send.into());
    }
    if let Some(to) = to {
        order.insert("to".into(), to.into());
    }
    order
}

/// Checks the rules and the procedures of the settings: kinds, parameters, what is sent and where.
///
/// # Errors
/// What is wrong, with the number of the rule or procedure.
pub fn check_rules(app: &App) -> Result<(), String> {
    for (number, rule) in app.settings.rules.0.iter().enumerate() {
        // An archive may serve some tenants only; whose the volumes are is not known yet.
        let mut archives = app.settings.archives.0.iter();
        let archive = archives.find(|archive| Some(&archive.name) == rule.to.as_ref());
        let tenant = archive.and_then(|archive| archive.tenants.first().cloned());
        let tenant = tenant.unwrap_or_default();
        let order = order(&rule.send, rule.to.as_deref());
        check(app, (&rule.kind, &rule.parameters), &tenant, &order)
            .map_err(|reason| format!("rule {}: {reason}", number + 1))?;
    }
    for (number, procedure) in app.settings.procedures.0.iter().enumerate() {
        let wrong = |reason: String| format!("procedure {}: {reason}", number + 1);
        let archive = app
            .settings
            .archives
            .named(&procedure.archive, &procedure.tenant);
        if archive.is_none_or(|archive| archive.dicomweb.is_none()) {
            let name = &procedure.archive;
            return Err(wrong(format!(
                "the tenant has no archive `{name}` with `dicomweb`"
            )));
        }
        let to = match procedure.send.is_empty() {
            true => procedure.to.as_ref(),
            false => procedure.to.as_ref().or(Some(&procedure.archive)),
        };
        let order = order(&procedure.send, to.map(String::as_str));
        let work = (&procedure.kind[..], &procedure.parameters);
        check(app, work, &procedure.tenant, &order).map_err(wrong)?;
    }
    Ok(())
}

fn check(
    app: &App,
    (kind, parameters): (&str, &Map<String, Value>),
    tenant: &Tenant,
    order: &Map<String, Value>,
) -> Result<(), String> {
    let Some(work) = app.engine.work(kind) else {
        let kinds: Vec<_> = app.engine.works.iter().map(|w| w.makes().noun()).collect();
        return Err(format!(
            "there is no kind of job `{kind}`; known are {}",
            kinds.join(", ")
        ));
    };
    work.parameters_from_json(parameters)
        .map_err(|failure| failure.detail)?;
    send_of(app, tenant, order, kind, None).map_err(|problem| problem.into_body().detail)?;
    Ok(())
}
