//! Filing of jobs, whoever orders them: requests, rules for received series, work items.
//!
//! In: a [`JobOrder`]. Out: a job that is on disk. The tenant's quotas and the limit of the queue are checked here, and
//! an order under the same idempotency key gets the same job.

use crate::base::error::{Refusal, ServiceError, invalid_field, shorten};
use crate::base::records::{
    Deleted, Failure, Fault, Filed, Idempotency, Interrupted, Job, JobWebhook, NewJob, Priority,
    Resource, SendOrder, SeriesSource, StoreError, Tags, Tenant, content_id, rfc3339,
};
use crate::callers::{Agent, Quota};
use crate::jobs::Work;
use crate::limits::quotas::{Addition, Counting};
use crate::use_cases::service::Service;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::time::Duration;

/// Pause before an order is repeated that found the queue full, if the mean duration of jobs is not known, seconds.
const LONGEST_RETRY_S: f64 = 60.0;

/// An order of a job, without its work.
#[derive(Clone)]
pub struct JobOrder {
    /// Who orders it.
    pub by: Agent,
    /// The owner of the job.
    pub tenant: Tenant,
    /// The tenant's names for the job.
    pub tags: Tags,
    /// Its urgency.
    pub priority: Priority,
    /// Its idempotency key.
    pub key: Option<String>,
    /// The receiver of its events.
    pub webhook: Option<JobWebhook>,
    /// The series of its volume in an archive, unless the volume is stored.
    pub source: Option<SeriesSource>,
    /// The objects of its result that are sent to an archive.
    pub send: Option<SendOrder>,
    /// The trace context of the request.
    pub trace_parent: Option<String>,
    /// The quotas of whoever orders it.
    pub quota: Quota,
}

impl JobOrder {
    /// An order without anything optional.
    pub fn new(by: Agent, tenant: Tenant, quota: Quota) -> Self {
        Self {
            by,
            tenant,
            tags: Tags::default(),
            priority: Priority::default(),
            key: None,
            webhook: None,
            source: None,
            send: None,
            trace_parent: None,
            quota,
        }
    }

    /// The job of this order on a stored volume, or on the series of its source.
    fn into_job(
        self,
        work: &dyn Work,
        volume: Option<String>,
        parameters: Map<String, Value>,
    ) -> NewJob {
        NewJob {
            idempotency: self.idempotency(work.makes().noun(), volume.as_deref(), &parameters),
            tenant: self.tenant,
            kind: work.makes().noun().into(),
            priority: self.priority,
            tags: self.tags,
            needs: work.needs(&parameters).items,
            volume,
            parameters,
            webhook: self.webhook,
            source: self.source,
            send: self.send,
            trace_parent: self.trace_parent,
            storage_limit: self.quota.bytes,
        }
    }

    /// The key with a fingerprint of the order that it stands for.
    fn idempotency(
        &self,
        kind: &str,
        volume: Option<&str>,
        parameters: &Map<String, Value>,
    ) -> Option<Idempotency> {
        let key = self.key.clone()?;
        let parameters = Value::Object(parameters.clone()).to_string();
        // What an order does not give is not hashed, so that a field that is added leaves the fingerprints
        // of stored orders as they are. These are JSON objects with different fields, names are a JSON array:
        // no order is like another.
        let given = [
            self.webhook.as_ref().map(|webhook| json!(webhook)),
            self.source.as_ref().map(|source| json!(source)),
            self.send.as_ref().map(|send| json!(send)),
            (self.priority != Priority::default())
                .then(|| json!({"priority": self.priority.as_str()})),
            (self.tags != Tags::default())
                .then(|| json!([self.tags.external_id, self.tags.labels])),
        ];
        let given: Vec<String> = given.iter().flatten().map(Value::to_string).collect();
        let parts = [kind, volume.unwrap_or_default(), &parameters].into_iter();
        let parts = parts.chain(given.iter().map(String::as_str));
        Some(Idempotency {
            key,
            fingerprint: content_id("", parts.map(str::as_bytes)),
        })
    }
}

impl Service {
    /// The work of that kind.
    ///
    /// # Errors
    /// `invalid-field` that names the kinds.
    pub fn work_of(&self, kind: &str) -> Result<&dyn Work, ServiceError> {
        if let Some(work) = self.engine.works.of_kind(kind) {
            return Ok(&**work);
        }
        let detail = format!("There is no kind of job `{}`.", shorten(kind));
        let known = format!("Known kinds: {}.", self.kinds());
        Err(invalid_field("kind", detail).fix(known).into())
    }

    /// The kinds of jobs, for messages.
    pub(crate) fn kinds(&self) -> String {
        let kinds: Vec<_> = self.engine.works.iter().map(|w| w.makes().noun()).collect();
        kinds.join(", ")
    }

    /// Files a job on a stored volume, or on the series of its source. `counting` has counted its record; its texts
    /// are counted here.
    ///
    /// # Errors
    /// `queue-full`; `storage-quota` if its texts have no room; `idempotency-key-reused` if the key stands for another
    /// order; `invalid-field` if something that it needs does not exist.
    pub async fn file_job(
        &self,
        work: &dyn Work,
        volume: Option<String>,
        parameters: Map<String, Value>,
        order: JobOrder,
        counting: &Counting,
    ) -> Result<Job, ServiceError> {
        work.check_order(volume.as_deref(), &parameters)?;
        let (by, tenant) = (order.by.clone(), order.tenant.clone());
        let job = order.into_job(work, volume, parameters);
        self.count(&job, counting).await?;
        let filed = self.file(&by, job).await?;
        self.accepted(&tenant, filed).await
    }

    /// Writes the row of a job, with that of its filing.
    async fn file(&self, by: &Agent, job: NewJob) -> Result<Filed, StoreError> {
        let queue = self.queue.clone();
        let file = async move { queue.file(&job).await };
        by.change(file).await
    }

    /// Cancels a waiting job for `by`, or asks a running one to stop.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn interrupt_job(&self, by: &Agent, id: &str) -> Result<Interrupted, StoreError> {
        let (queue, id) = (self.queue.clone(), id.to_owned());
        let interrupt = async move { queue.interrupt(&id).await };
        by.change(interrupt).await
    }

    /// Erases the record of a job that has ended, for `by`.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn delete_job(&self, by: &Agent, id: &str) -> Result<Deleted, StoreError> {
        let (queue, id) = (self.queue.clone(), id.to_owned());
        let delete = async move {
            let deleted = queue.delete_job(&id).await?;
            queue.items().overwrite_erased().await;
            Ok(deleted)
        };
        by.change(delete).await
    }

    /// Counts the texts of a job that is about to be filed. Those of one that is filed already, told by its
    /// idempotency key, add nothing.
    async fn count(&self, job: &NewJob, counting: &Counting) -> Result<(), ServiceError> {
        let bytes = self.queue.table().text_bytes(job)?;
        let counted = counting.arrived(bytes).await;
        let key = job.idempotency.as_ref().map(|promise| &*promise.key);
        match counted {
            Err(_) if self.is_filed(&job.tenant, key).await? => Ok(()),
            counted => counted,
        }
    }

    /// The job of an earlier order under the same key; `None` if there was none. Ids are hashes, so the order can be
    /// compared by the id of a volume that is not stored yet.
    ///
    /// # Errors
    /// `idempotency-key-reused` if the key stands for another order.
    pub async fn filed_earlier(
        &self,
        work: &dyn Work,
        volume: Option<String>,
        parameters: Map<String, Value>,
        order: JobOrder,
    ) -> Result<Option<Job>, ServiceError> {
        let job = order.into_job(work, volume, parameters);
        let Some(promise) = job.idempotency else {
            return Ok(None);
        };
        let earlier = self
            .queue
            .table()
            .filed_under(&job.tenant, &promise.key)
            .await?;
        match earlier {
            Some((earlier, fingerprint)) => {
                let filed = promise.judge(earlier, &fingerprint);
                Ok(Some(self.accepted(&job.tenant, filed).await?))
            }
            None => Ok(None),
        }
    }

    /// Whether an order of the tenant was accepted under that key.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn is_filed(&self, tenant: &Tenant, key: Option<&str>) -> Result<bool, ServiceError> {
        let Some(key) = key else {
            return Ok(false);
        };
        Ok(self.queue.table().filed_under(tenant, key).await?.is_some())
    }

    /// Refuses an order that could not be filed now: the queue is full, or an item that it names does not exist.
    ///
    /// # Errors
    /// `queue-full`, or `invalid-field` for the name.
    pub async fn require_fileable(
        &self,
        tenant: &Tenant,
        needs: &BTreeMap<String, String>,
    ) -> Result<(), ServiceError> {
        let catalogue = self.items().catalogue();
        for (field, id) in needs {
            let there = match Resource::from_id(id) {
                Some(Resource::Volume) => catalogue.volume(tenant, id).await?.is_some(),
                _ => catalogue.product(tenant, id).await?.is_some(),
            };
            if !there {
                return Err(self.names_nothing(tenant, field, id).await?);
            }
        }
        if self.queue.is_full(tenant).await? {
            return Err(self.queue_full().await);
        }
        Ok(())
    }

    async fn accepted(&self, tenant: &Tenant, filed: Filed) -> Result<Job, ServiceError> {
        match filed {
            Filed::New(job) | Filed::Same(job) => Ok(job),
            Filed::QueueFull => Err(self.queue_full().await),
            Filed::KeyReused => Err(key_reused()),
            Filed::Missing { field, id } => Err(self.names_nothing(tenant, &field, &id).await?),
        }
    }

    async fn queue_full(&self) -> ServiceError {
        let seconds = match self.queue.table().load().await {
            Ok(load) => load.mean_duration_ms.unwrap_or_default() / 1000.0,
            Err(_) => LONGEST_RETRY_S,
        };
        let limit = self.settings.queue_limit;
        let detail = format!("{limit} jobs are already waiting, so this request was not accepted.");
        let failure = Failure::new(Fault::Service, "queue-full", detail)
            .fix("Try again after the number of seconds in Retry-After.");
        let pause = Duration::from_secs_f64(seconds.clamp(1.0, LONGEST_RETRY_S).ceil());
        ServiceError::new(Refusal::TooMany, failure).after(pause)
    }

    /// The refusal of an order whose `field` is the id of something that does not exist (any more).
    ///
    /// # Errors
    /// If the database fails.
    pub async fn names_nothing(
        &self,
        tenant: &Tenant,
        field: &str,
        id: &str,
    ) -> Result<ServiceError, ServiceError> {
        let resource = Resource::from_id(id).unwrap_or(match field {
            "model" => Resource::Model,
            "normals" => Resource::Normals,
            _ => Resource::Volume,
        });
        let (noun, short) = (resource.label(), shorten(id));
        let detail = match self.items().catalogue().erased_at(tenant, id).await? {
            Some(at) => format!("The {noun} `{short}` was erased at {}.", rfc3339(at)),
            None => format!("There is no {noun} `{short}`."),
        };
        let fix = match resource {
            Resource::Volume => "POST the file to /v1/volumes first.".to_owned(),
            _ => format!(
                "Take an id from the list at GET /v1/{}, or leave the choice to `auto`.",
                resource.plural()
            ),
        };
        Ok(invalid_field(field, detail).fix(fix).into())
    }
}

fn key_reused() -> ServiceError {
    let detail = "This idempotency key was already used for another request.";
    Failure::new(Fault::Request, "idempotency-key-reused", detail)
        .at("Idempotency-Key")
        .fix("Use a new key for each new request.")
        .into()
}

/// A job that nobody's request orders: a rule or a procedure of the settings does.
pub struct UnattendedJob<'a> {
    /// The agent of that entry.
    pub by: Agent,
    /// The entry of the settings that orders it: `rule` or `procedure`.
    pub ordered_by: &'static str,
    /// Its owner.
    pub tenant: &'a Tenant,
    /// Its kind.
    pub kind: &'a str,
    /// Its urgency.
    pub priority: Priority,
    /// Its parameters.
    pub parameters: &'a Map<String, Value>,
    /// Its volume, unless it has a source.
    pub volume: Option<&'a str>,
    /// The series of its volume in an archive.
    pub source: Option<SeriesSource>,
    /// The objects of its result that are sent to an archive; may be none.
    pub send: &'a [String],
    /// That archive; the one of the source if absent.
    pub to: Option<&'a str>,
    /// Its idempotency key.
    pub key: String,
}

impl Service {
    /// Files a job that nobody's request orders. Returns its id; the same under the same key, also if the settings
    /// have changed since.
    ///
    /// # Errors
    /// As [`Service::file_job`], and those of the tenant's quotas.
    pub async fn file_unattended(&self, job: UnattendedJob<'_>) -> Result<String, ServiceError> {
        let work = self.work_of(job.kind)?;
        let parameters = work.parameters_from_json(job.parameters)?;
        work.check_order(job.volume, &parameters)?;
        let send =
            self.listed_send_order(job.tenant, job.kind, job.send, job.to, job.source.as_ref())?;
        let quota = self.quotas.general;
        let reserved = self
            .quotas
            .reserve(job.tenant, quota, Addition::ONE_JOB, Some(&job.key));
        let counting = reserved.await?;
        let order = JobOrder {
            priority: job.priority,
            key: Some(job.key.clone()),
            source: job.source,
            send,
            ..JobOrder::new(job.by.clone(), job.tenant.clone(), quota)
        };
        let volume = job.volume.map(str::to_owned);
        let new = order.into_job(work, volume, parameters);
        self.count(&new, &counting).await?;
        let filed = self.file(&job.by, new).await?;
        drop(counting);
        match filed {
            Filed::New(job) | Filed::Same(job) => Ok(job.id),
            Filed::QueueFull => Err(self.queue_full().await),
            Filed::KeyReused => {
                let earlier = self.queue.table().filed_under(job.tenant, &job.key).await?;
                let earlier = earlier.map(|(job, _)| job.id);
                earlier.ok_or_else(key_reused)
            }
            Filed::Missing { field, .. } => Err(unknown_item(job.ordered_by, &field)),
        }
    }
}

fn unknown_item(ordered_by: &str, field: &str) -> ServiceError {
    let detail = format!("The {ordered_by}'s `{field}` names nothing that this tenant has.");
    Failure::new(Fault::Request, "unknown-item", detail)
        .at(field)
        .fix("Correct the settings, then send the series again.")
        .into()
}
