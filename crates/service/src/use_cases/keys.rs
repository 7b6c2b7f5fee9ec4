//! API keys that callers make, list and revoke for their own tenant.
//!
//! In: who asks, and a [`KeyOrder`]. Out: the key, whose secret is stored nowhere.
//!
//! Guaranteed: a key has no wider scope and no greater limits than the key or token that makes it, and does not outlive
//! it; one made with a token may, if the operator allows it (`oidc_key_life`). No row of keys, one made by the other, is
//! longer than [`MOST_MAKERS`].

use crate::base::error::{ServiceError, ServiceResult, invalid_field};
use crate::base::records::{ListPage, ListRequest, Tenant, Timestamp, rfc3339};
use crate::callers::{
    Activity, Agent, ApiKey, Identity, KeyError, KeyRequest, MOST_MAKERS, Maker, Quota, Scope,
};
use crate::use_cases::service::Service;
use std::fmt::Display;

/// A key that a caller asks for.
#[derive(Debug, Clone)]
pub struct KeyOrder {
    /// What it is for.
    pub name: String,
    /// The acts that it allows.
    pub scope: Scope,
    /// From when on it is refused; if absent, when what makes it ends.
    pub expires_at: Option<Timestamp>,
    /// Its own limits; those of its maker where absent.
    pub quota: Quota,
}

impl Service {
    /// Makes a key for the tenant of `maker`. Returns its record and the text that its owner presents.
    ///
    /// # Errors
    /// `invalid-field` for what is more than `maker` may give, and for a name or an expiry that cannot be used.
    pub async fn create_key(
        &self,
        by: &Agent,
        maker: &Identity,
        order: KeyOrder,
    ) -> ServiceResult<(ApiKey, String)> {
        let now = self.now();
        let request = self.granted(maker, order, now)?;
        let (key, text) = ApiKey::make(request, now).map_err(unusable)?;
        let event = by.event(Activity::KeyCreated, now).on(&key.id);
        self.access.add_key(&key, &event).await?;
        Ok((key, text))
    }

    /// A page of a tenant's keys, newest first, revoked ones included.
    pub async fn keys(
        &self,
        tenant: &Tenant,
        page: ListRequest,
    ) -> ServiceResult<ListPage<ApiKey>> {
        Ok(self.access.keys(Some(tenant), page).await?)
    }

    /// Revokes a key of the tenant. `false` if it has none with that id.
    pub async fn revoke_key(&self, by: &Agent, id: &str) -> ServiceResult<bool> {
        let key = self.access.key(id).await?;
        if key.is_none_or(|key| key.tenant != *by.tenant()) {
            return Ok(false);
        }
        let now = self.now();
        let event = by.event(Activity::KeyRevoked, now).on(id);
        Ok(self.access.revoke_key(id, now, &event).await?)
    }

    /// Revokes the tenant's keys of one subject of the OpenID Connect issuer. Returns the ids of those that were not
    /// revoked before.
    pub async fn revoke_keys_of(&self, by: &Agent, owner: &str) -> ServiceResult<Vec<String>> {
        let now = self.now();
        let event = by.event(Activity::KeyRevoked, now);
        let revoked = self
            .access
            .revoke_keys_of(owner, Some(by.tenant()), now, &event);
        Ok(revoked.await?)
    }

    /// The key of an order, with no more than `maker` may give.
    fn granted(
        &self,
        maker: &Identity,
        order: KeyOrder,
        now: Timestamp,
    ) -> ServiceResult<KeyRequest> {
        if !maker.scope.includes(order.scope) {
            return Err(beyond("scope", maker.scope));
        }
        if order.scope == Scope::Admin && maker.makers.keys.len() + 1 >= MOST_MAKERS {
            // It could make one more.
            return Err(beyond("scope", Scope::Submit));
        }
        let last = self.last_end(maker, now);
        let expires_at = match (order.expires_at, last) {
            (Some(asked), Some(last)) if asked > last => {
                return Err(beyond("expires_at", rfc3339(last)));
            }
            (asked, _) => asked.or(maker.expires_at),
        };
        // What the maker has itself, and what the operator allows everybody.
        let (own, allowed) = (maker.quota, maker.limits(self.quotas.general));
        let bounded = |field, asked: Option<u64>, own, allowed: Option<u64>| match (asked, allowed)
        {
            (Some(asked), Some(allowed)) if asked > allowed => Err(beyond(field, allowed)),
            (asked, _) => Ok(asked.or(own)),
        };
        let asked = order.quota;
        Ok(KeyRequest {
            name: order.name,
            tenant: maker.tenant.clone(),
            scope: order.scope,
            quota: Quota {
                requests: bounded(
                    "requests_per_minute",
                    asked.requests,
                    own.requests,
                    allowed.requests,
                )?,
                bytes: bounded("stored_bytes", asked.bytes, own.bytes, allowed.bytes)?,
                jobs: bounded("queued_jobs", asked.jobs, own.jobs, allowed.jobs)?,
            },
            maker: Maker::Caller(maker.key.clone()),
            owner: maker.owner.clone(),
            expires_at,
        })
    }

    /// When a key of `maker` ends at the latest.
    fn last_end(&self, maker: &Identity, now: Timestamp) -> Option<Timestamp> {
        let end = maker.expires_at?;
        let is_token = maker.key.is_none() && maker.owner.is_some();
        if !is_token {
            return Some(end);
        }
        let life = self.settings.oidc_key_life.0.as_millis();
        let life = Timestamp::try_from(life).unwrap_or(Timestamp::MAX);
        Some(end.max(now.saturating_add(life)))
    }
}

/// A key gets no more than the one that makes it has, and than the operator allows.
fn beyond(field: &str, allowed: impl Display) -> ServiceError {
    let detail = format!("`{field}` is more than this caller may give: at most {allowed}.");
    let fix = "Give less, or leave it out; the operator can make keys with more by `ventriform keys create`.";
    invalid_field(field, detail).fix(fix).into()
}

fn unusable(error: KeyError) -> ServiceError {
    let (field, fix) = match error {
        KeyError::Name => ("name", "Give a short name."),
        KeyError::Expired => ("expires_at", "Give a time in the future."),
        KeyError::NoRandomNumbers => return ServiceError::internal(error),
    };
    let unusable = invalid_field(field, format!("Unusable: {error}."));
    unusable.fix(fix).into()
}
