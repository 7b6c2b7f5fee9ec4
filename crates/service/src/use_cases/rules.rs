//! Rules for received series: their volumes are stored as an upload is, and the jobs that the settings ask for are
//! filed as a request's are.

use crate::base::client::ClientAddress;
use crate::base::error::{AttemptError, ServiceError};
use crate::base::records::{Failure, Fault, LocalFile, Priority, Resource, Tags, Tenant};
use crate::network::intake::{IntakeGroup, Rule, VolumeMaker};
use crate::use_cases::filing::UnattendedJob;
use crate::use_cases::pairs::{PairError, pair_of};
use crate::use_cases::service::Service;
use crate::use_cases::uploads::VolumeUpload;
use async_trait::async_trait;
use futures::TryStreamExt;
use serde_json::{Map, Value};
use tokio_util::io::ReaderStream;

/// Bytes of a file that are read at a time.
const CHUNK_BYTES: usize = 256 << 10;

#[async_trait]
impl VolumeMaker for Service {
    async fn make(&self, group: &IntakeGroup, files: &[LocalFile]) -> Result<String, AttemptError> {
        // What was received counts already.
        let mut upload = VolumeUpload::new(self, &self.quotas.counted_before());
        for file in files {
            let file = tokio::fs::File::open(file).await;
            let file = file.map_err(|error| AttemptError::retry(error.to_string()))?;
            let pieces = ReaderStream::with_capacity(file, CHUNK_BYTES);
            upload.write(pieces.map_err(ServiceError::internal)).await?;
        }
        let tags = Tags::default();
        let origin = &group.origin;
        let by = self.agent(&origin.tenant, format!("intake:{}", origin.sender));
        let by = by.at(&origin.address);
        let stored = self.store_volume(&by, &origin.tenant, upload, &tags);
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
    ) -> Result<Option<String>, AttemptError> {
        let rules = &self.settings.rules.0;
        let number = rules.iter().position(|known| known == rule).unwrap_or(0) + 1;
        let mut job = UnattendedJob {
            by: self.agent(&group.origin.tenant, format!("rule:{number}")),
            ordered_by: "rule",
            tenant: &group.origin.tenant,
            kind: &rule.kind,
            priority: Priority::default(),
            parameters: &rule.parameters,
            volume: Some(volume),
            source: None,
            send: &rule.send,
            to: rule.to.as_deref(),
            key,
        };
        if rule.kind != Resource::Comparison.noun() {
            return Ok(Some(self.file_unattended(job).await?));
        }
        let of_study = (group.study.as_str(), volume);
        let pair = pair_of(self.items().catalogue(), job.tenant, of_study, rule).await;
        let Some(pair) = pair.map_err(of_pair)? else {
            return Ok(None);
        };
        let mut parameters = rule.parameters.clone();
        parameters.insert("rest".into(), pair.rest.clone().into());
        job.key = format!("pair-{}-{}", pair.stress, pair.rest);
        job.parameters = &parameters;
        job.volume = Some(&pair.stress);
        Ok(Some(self.file_unattended(job).await?))
    }
}

fn of_pair(error: PairError) -> AttemptError {
    match error {
        PairError::Store(error) => error.into(),
        PairError::NoRole => {
            let failure = Failure::new(Fault::Content, "rest-or-stress", error.to_string());
            AttemptError::Permanent(failure.fix(
                "Give in the rule `stress` and `rest`, parts of the Series Description that tell them, or `first`, the \
                 scan that is made first on the same day with the lower dose; or compare the volumes by POST \
                 /v1/comparisons.",
            ))
        }
    }
}

impl Service {
    /// Checks the rules and the procedures of the settings: kinds, parameters, objects to send and archives.
    ///
    /// # Errors
    /// The fault, with the number of the rule or procedure.
    pub(crate) fn check_rules(&self) -> Result<(), String> {
        for (number, rule) in self.settings.rules.0.iter().enumerate() {
            // An archive may serve some tenants only; whose the volumes are is not known yet.
            let mut archives = self.settings.archives.0.iter();
            let archive = archives.find(|archive| Some(&archive.name) == rule.to.as_ref());
            let tenant = archive.and_then(|archive| archive.tenants.first().cloned());
            let tenant = tenant.unwrap_or_default();
            self.check_work(
                &tenant,
                &rule.kind,
                &rule.parameters,
                &rule.send,
                rule.to.as_deref(),
            )
            .map_err(|reason| format!("rule {}: {reason}", number + 1))?;
            let is_pair = rule.kind == Resource::Comparison.noun();
            let tells = rule.stress.is_some() || rule.rest.is_some() || rule.first.is_some();
            if !is_pair && tells {
                let number = number + 1;
                return Err(format!(
                    "rule {number}: `stress`, `rest` and `first` tell both scans of a comparison, and its kind is `{}`",
                    rule.kind
                ));
            }
            if rule.kind == Resource::Normals.noun() {
                let number = number + 1;
                return Err(format!("rule {number}: a series makes no normal limits"));
            }
        }
        for (number, procedure) in self.settings.procedures.0.iter().enumerate() {
            let wrong = |reason: String| format!("procedure {}: {reason}", number + 1);
            let tenant = &procedure.tenant;
            let archive = self.settings.archives.named(&procedure.archive, tenant);
            if archive.is_none_or(|archive| archive.dicomweb.is_none()) {
                let name = &procedure.archive;
                return Err(wrong(format!(
                    "the tenant has no archive `{name}` with `dicomweb`"
                )));
            }
            if [Resource::Comparison, Resource::Normals]
                .iter()
                .any(|kind| procedure.kind == kind.noun())
            {
                let kind = &procedure.kind;
                return Err(wrong(format!(
                    "a work item has one series, and a job of kind `{kind}` needs more; let a rule order it"
                )));
            }
            let to = if procedure.send.is_empty() {
                procedure.to.as_ref()
            } else {
                procedure.to.as_ref().or(Some(&procedure.archive))
            };
            let to = to.map(String::as_str);
            self.check_work(
                tenant,
                &procedure.kind,
                &procedure.parameters,
                &procedure.send,
                to,
            )
            .map_err(wrong)?;
        }
        Ok(())
    }

    fn check_work(
        &self,
        tenant: &Tenant,
        kind: &str,
        parameters: &Map<String, Value>,
        send: &[String],
        to: Option<&str>,
    ) -> Result<(), String> {
        let Some(work) = self.engine.work(kind) else {
            let kinds = self.kinds();
            return Err(format!(
                "there is no kind of job `{kind}`; known are {kinds}"
            ));
        };
        work.parameters_from_json(parameters)
            .map_err(|failure| failure.detail)?;
        self.listed_send_order(tenant, kind, send, to, None)
            .map_err(|failure| failure.detail)?;
        Ok(())
    }
}
