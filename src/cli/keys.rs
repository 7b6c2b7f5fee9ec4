//! `ventriform keys`: makes, lists and revokes API keys in a data folder, also while the service
//! runs on it.

use super::data_args::DataArgs;
use super::output::{note, say};
use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use tokio::runtime::Runtime;
use ventriform::base::text::escaped;
use ventriform_service::base::records::{
    Clock, ListRequest, SystemClock, Tenant, Timestamp, rfc3339,
};
use ventriform_service::callers::{
    AccessStore, Activity, ApiKey, AuditEvent, KeyRequest, Maker, Quota, Scope,
};
use ventriform_service::config::{Size, Span};
use ventriform_store::IfNone;

/// Make, list and revoke API keys, also while the service runs
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform keys create --name scanner-2 --scope submit --data-dir data
  ventriform keys create --name auditor --scope admin --tenant clinic-b --expires 90d
  ventriform keys list --data-dir data
  ventriform keys revoke 0123456789abcdef --data-dir data
  ventriform keys revoke --owner contractor-7 --data-dir data
  ventriform keys open --data-dir data

Once there is a key, the service answers only requests with `Authorization: Bearer KEY`, also when all keys have
ended, and when a repair or a restored copy leaves in doubt whether there was one.")]
pub struct KeysArgs {
    #[command(subcommand)]
    command: KeysCommand,
}

#[derive(Debug, Subcommand)]
enum KeysCommand {
    /// Make a key and print it; it is shown only this once
    Create(CreateArgs),
    /// List all keys, newest first
    List(DataArgs),
    /// Revoke a key; a running service refuses it within a second
    Revoke(RevokeArgs),
    /// Admit callers without credentials again, though the service once had keys or may have had some; written to the
    /// audit trail. Refused while a key is valid. A running service does so after its next start
    Open(DataArgs),
}

#[derive(Debug, Args)]
struct CreateArgs {
    /// What the key is for; shown in lists and in the audit trail
    #[arg(long, value_name = "NAME")]
    name: String,
    /// What it allows: read, submit (also upload, file jobs, erase) or admin (also keys and audit)
    #[arg(long, value_name = "SCOPE")]
    scope: Scope,
    /// Tenant of the key. Items of other tenants are not found with it
    #[arg(long, value_name = "TENANT", default_value = "default")]
    tenant: Tenant,
    /// How long it is valid, such as 90d; for ever unless given
    #[arg(long, value_name = "SPAN")]
    expires: Option<Span>,
    /// Requests per minute, instead of the setting quota_requests
    #[arg(long, value_name = "NUMBER")]
    requests_per_minute: Option<u64>,
    /// Storage limit of the tenant, such as 10GiB, in place of quota_bytes
    #[arg(long, value_name = "SIZE")]
    stored_bytes: Option<Size>,
    /// Waiting jobs of the tenant, instead of the setting quota_jobs
    #[arg(long, value_name = "NUMBER")]
    queued_jobs: Option<u64>,
    #[command(flatten)]
    data: DataArgs,
}

#[derive(Debug, Args)]
struct RevokeArgs {
    /// The key's id, as `keys list` shows it
    #[arg(required_unless_present = "owner")]
    id: Option<String>,
    /// Instead: all keys of this subject of the OpenID Connect issuer, as `keys list` names it
    #[arg(long, value_name = "SUBJECT", conflicts_with = "id")]
    owner: Option<String>,
    #[command(flatten)]
    data: DataArgs,
}

/// Who acts in the audit trail.
pub(super) const AUDIT_AGENT: &str = "command line";

/// Runs the command.
///
/// # Errors
/// If an argument or the data folder cannot be used.
pub fn run(args: &KeysArgs) -> Result<()> {
    Runtime::new()?.block_on(async {
        match &args.command {
            KeysCommand::Create(args) => create(args).await,
            KeysCommand::List(args) => list(args).await,
            KeysCommand::Revoke(args) => revoke(args).await,
            KeysCommand::Open(args) => open(args).await,
        }
    })
}

async fn create(args: &CreateArgs) -> Result<()> {
    let now = SystemClock.now();
    let span = |span: Span| i64::try_from(span.0.as_millis()).unwrap_or(i64::MAX);
    let request = KeyRequest {
        name: args.name.clone(),
        tenant: args.tenant.clone(),
        scope: args.scope,
        quota: Quota {
            requests: args.requests_per_minute,
            bytes: args.stored_bytes.map(|size| size.0),
            jobs: args.queued_jobs,
        },
        maker: Maker::Operator,
        owner: None,
        expires_at: args.expires.map(|s| now.saturating_add(span(s))),
    };
    let (key, text) = ApiKey::make(request, now)?;
    let store = args.data.open(IfNone::Make).await?;
    let event = event(Activity::KeyCreated, &key, now);
    store.add_key(&key, &event).await?;
    note!(
        "key {} of tenant {} with scope {}; it is shown only this once",
        key.id,
        key.tenant,
        key.scope
    );
    say!("{text}");
    Ok(())
}

async fn list(args: &DataArgs) -> Result<()> {
    let store = args.open(IfNone::Refuse).await?;
    let now = SystemClock.now();
    let mut before = None;
    say!("id\tstate\tscope\ttenant\tcreated\texpires\tname\towner");
    loop {
        let page = store.keys(None, ListRequest { before, limit: 100 }).await?;
        for key in &page.items {
            say!(
                "{}\t{}\t{}\t{}\t{}\t{}\t{}\t{}",
                key.id,
                key.state(now).as_str(),
                key.scope,
                key.tenant,
                rfc3339(key.created_at),
                key.expires_at.map_or_else(|| "never".to_owned(), rfc3339),
                escaped(&key.name),
                key.owner.as_deref().map_or_else(|| "-".into(), escaped),
            );
        }
        before = page.next;
        if before.is_none() {
            return Ok(());
        }
    }
}

async fn revoke(args: &RevokeArgs) -> Result<()> {
    let store = args.data.open(IfNone::Refuse).await?;
    let now = SystemClock.now();
    if let Some(owner) = &args.owner {
        let agent = AUDIT_AGENT.to_owned();
        let event = AuditEvent::new(now, Activity::KeyRevoked, Tenant::default(), agent);
        let revoked = store.revoke_keys_of(owner, None, now, &event).await?;
        if revoked.is_empty() {
            bail!("no key of {owner} is active; `ventriform keys list` shows all");
        }
        for id in revoked {
            say!("{id} is revoked");
        }
        return Ok(());
    }
    let id = args.id.as_deref().unwrap_or_default();
    let Some(key) = store.key(id).await? else {
        bail!("there is no key {id}; `ventriform keys list` shows all");
    };
    let event = event(Activity::KeyRevoked, &key, now);
    store.revoke_key(id, now, &event).await?;
    say!("{id} is revoked");
    Ok(())
}

async fn open(args: &DataArgs) -> Result<()> {
    let store = args.open(IfNone::Refuse).await?;
    let now = SystemClock.now();
    let event = AuditEvent::new(
        now,
        Activity::AccessOpened,
        Tenant::default(),
        AUDIT_AGENT.into(),
    );
    if !store.open_access(now, &event).await? {
        bail!("there are valid keys: `ventriform keys list` shows them; revoke them first");
    }
    say!("callers without credentials are admitted from the next start of the service on");
    Ok(())
}

fn event(activity: Activity, key: &ApiKey, now: Timestamp) -> AuditEvent {
    AuditEvent::new(now, activity, key.tenant.clone(), AUDIT_AGENT.into()).on(&key.id)
}
