//! From the `Authorization` of a request to a caller.

use super::{
    AccessStore, ApiKey, Identity, Issuer, IssuerError, KeyState, Maker, Makers, PresentedKey,
    Quota, Scope,
};
use crate::base::records::{Clock, StoreError, Tenant, Timestamp};
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How long the record of a key, or the absence of any key, is taken from memory: so long a
/// revocation by another process may take to show.
pub const FRESH_FOR: Duration = Duration::from_millis(500);

/// Most records in memory.
const MOST_KEPT: usize = 1024;

/// Most keys in a row of which each has made the next one.
pub const MOST_MAKERS: usize = 8;

/// Longest credentials, bytes. Tokens with many groups have a few thousand.
const AUTHORIZATION_BYTES: usize = 16 * 1024;

/// Why a request was not admitted.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// It has no credentials, and the service asks for some.
    #[error("no credentials")]
    Missing,
    /// Its `Authorization` is no bearer credential.
    #[error("no bearer credential")]
    NotBearer,
    /// There is no such key.
    #[error("unknown key")]
    UnknownKey,
    /// The key was revoked, or its time is over; or that of a key that made it.
    #[error("the key is {}", state.as_str())]
    EndedKey {
        /// The key's id.
        key: String,
        /// Whose key it was.
        tenant: Tenant,
        /// How it, or the key that made it, ended.
        state: KeyState,
    },
    /// The token is not valid here.
    #[error("the token is refused: {0}")]
    Token(String),
    /// The issuer's keys cannot be read, so no token can be checked.
    #[error("{0}")]
    Issuer(String),
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// Knows callers by their credentials.
pub struct Gate {
    store: Arc<dyn AccessStore>,
    clock: Arc<dyn Clock>,
    issuer: Option<Issuer>,
    /// The scope of a caller without credentials, and whether that holds although keys exist.
    anonymous: Scope,
    always_open: bool,
    /// Set once the service is closed. Opening it takes a new start.
    closed: AtomicBool,
    /// When the database was last asked whether the service is closed.
    asked: Mutex<Option<Instant>>,
    kept: Mutex<HashMap<String, (ApiKey, Instant)>>,
}

impl Gate {
    /// A gate on these keys and tokens of this issuer. Callers without credentials get the scope
    /// `anonymous`: for ever if `always_open`, else until the service is closed (by its first key, by an issuer, or
    /// because a repair or a restored copy leaves in doubt whether it was), and never if there is an issuer.
    pub fn new(
        store: Arc<dyn AccessStore>,
        clock: Arc<dyn Clock>,
        issuer: Option<Issuer>,
        anonymous: Scope,
        always_open: bool,
    ) -> Self {
        Self {
            store,
            clock,
            issuer,
            anonymous,
            always_open,
            closed: AtomicBool::new(false),
            asked: Mutex::new(None),
            kept: Mutex::default(),
        }
    }

    /// Who sends a request with this `Authorization`.
    ///
    /// # Errors
    /// If the credentials are missing or wrong, or cannot be checked.
    pub async fn identify(&self, authorization: Option<&[u8]>) -> Result<Identity, Refusal> {
        let Some(authorization) = authorization else {
            return if self.is_open().await? {
                Ok(self.anonymous())
            } else {
                Err(Refusal::Missing)
            };
        };
        let credential = bearer(authorization).ok_or(Refusal::NotBearer)?;
        if let Some(key) = PresentedKey::parse(credential) {
            return self.owner(key).await;
        }
        match &self.issuer {
            Some(issuer) => issuer
                .subject(credential, &*self.clock)
                .await
                .map_err(Refusal::from),
            None => Err(Refusal::UnknownKey),
        }
    }

    /// Whether the credentials of an identity that was admitted still open the service: its key and those that made
    /// it have not ended, its token has not expired; without credentials, whether the service still needs none.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn still_admits(&self, identity: &Identity) -> Result<bool, StoreError> {
        let expired = |end: Timestamp| end <= self.clock.latest();
        if identity.expires_at.is_some_and(expired) {
            return Ok(false);
        }
        let Some(id) = &identity.key else {
            return match identity.account {
                Some(_) => Ok(true),
                None => self.is_open().await,
            };
        };
        let Some(key) = self.key(id).await? else {
            return Ok(false);
        };
        if key.state(self.clock.latest()) != KeyState::Active {
            return Ok(false);
        }
        match self.makers(&key).await {
            Ok(_) => Ok(true),
            Err(Refusal::Store(error)) => Err(error),
            Err(_) => Ok(false),
        }
    }

    /// Whether callers need no credentials.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn is_open(&self) -> Result<bool, StoreError> {
        if self.always_open {
            return Ok(true);
        }
        if self.issuer.is_some() || self.closed.load(Ordering::Relaxed) {
            return Ok(false);
        }
        let fresh = lock(&self.asked).is_some_and(|at| at.elapsed() < FRESH_FOR);
        if !fresh {
            // The time is taken first: a key made while the database answers is seen next time.
            let now = Instant::now();
            if self.store.is_closed().await? {
                self.closed.store(true, Ordering::Relaxed);
                return Ok(false);
            }
            *lock(&self.asked) = Some(now);
        }
        Ok(true)
    }

    /// Forgets what it keeps, so that a change by this process shows at once.
    pub fn refresh(&self) {
        lock(&self.kept).clear();
        *lock(&self.asked) = None;
    }

    fn anonymous(&self) -> Identity {
        Identity {
            tenant: Tenant::default(),
            name: "anonymous".into(),
            scope: self.anonymous,
            key: None,
            quota: Quota::default(),
            makers: Makers::default(),
            expires_at: None,
            owner: None,
            account: None,
        }
    }

    async fn owner(&self, presented: PresentedKey<'_>) -> Result<Identity, Refusal> {
        let key = self.key(presented.id).await?.ok_or(Refusal::UnknownKey)?;
        if !key.has_secret(presented.secret) {
            return Err(Refusal::UnknownKey);
        }
        match key.state(self.clock.latest()) {
            KeyState::Active => Ok(Identity {
                makers: self.makers(&key).await?,
                account: Some(account(&key.id)),
                tenant: key.tenant,
                name: key.name,
                scope: key.scope,
                key: Some(key.id),
                quota: key.quota,
                expires_at: key.expires_at,
                owner: key.owner,
            }),
            state => Err(Refusal::EndedKey {
                key: key.id,
                tenant: key.tenant,
                state,
            }),
        }
    }

    /// The keys that have made a key.
    ///
    /// # Errors
    /// [`Refusal::EndedKey`] if one of them has ended: a key does not outlive its makers.
    async fn makers(&self, made: &ApiKey) -> Result<Makers, Refusal> {
        let mut makers = Makers {
            any: made.maker != Maker::Operator,
            keys: Vec::new(),
        };
        let now = self.clock.latest();
        let mut maker = made.maker.clone();
        while let Maker::Caller(Some(id)) = maker {
            // Rows of keys are never deleted, and a key is made before those that it makes.
            let Some(key) = self
                .key(&id)
                .await?
                .filter(|_| makers.keys.len() < MOST_MAKERS)
            else {
                break;
            };
            match key.state(now) {
                KeyState::Active => {}
                state => {
                    return Err(Refusal::EndedKey {
                        key: made.id.clone(),
                        tenant: made.tenant.clone(),
                        state,
                    });
                }
            }
            makers.keys.push((account(&key.id), key.quota));
            maker = key.maker;
        }
        Ok(makers)
    }

    /// The record of a key, at most [`FRESH_FOR`] old. Unknown ids are not kept, so strangers
    /// cannot fill the memory.
    async fn key(&self, id: &str) -> Result<Option<ApiKey>, StoreError> {
        let kept = lock(&self.kept).get(id).cloned();
        if let Some((key, at)) = kept
            && at.elapsed() < FRESH_FOR
        {
            return Ok(Some(key));
        }
        let now = Instant::now();
        let found = self.store.key(id).await?;
        let mut kept = lock(&self.kept);
        if let Some(key) = &found {
            if kept.len() >= MOST_KEPT {
                kept.clear();
            }
            kept.insert(id.to_owned(), (key.clone(), now));
        }
        Ok(found)
    }
}

impl From<IssuerError> for Refusal {
    fn from(error: IssuerError) -> Self {
        match error {
            IssuerError::Token(reason) => Refusal::Token(reason),
            IssuerError::Unavailable(reason) => Refusal::Issuer(reason),
        }
    }
}

/// The account of a key, where requests are counted.
fn account(key: &str) -> String {
    format!("key {key}")
}

/// The credential of an `Authorization: Bearer CREDENTIAL` (RFC 6750; the scheme in any case).
fn bearer(authorization: &[u8]) -> Option<&str> {
    let text = std::str::from_utf8(authorization).ok()?;
    let (scheme, credential) = text.split_once(' ')?;
    let credential = credential.trim();
    let usable = scheme.eq_ignore_ascii_case("bearer")
        && !credential.is_empty()
        && credential.len() <= AUTHORIZATION_BYTES;
    usable.then_some(credential)
}

/// A panic cannot leave these values half changed: each use is a single call.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_bearer_credentials_are_read() {
        assert_eq!(bearer(b"Bearer abc"), Some("abc"));
        assert_eq!(bearer(b"bearer  abc "), Some("abc"));
        for wrong in [
            &b"abc"[..],
            b"Basic abc",
            b"Bearer",
            b"Bearer ",
            b"\xff abc",
        ] {
            assert_eq!(bearer(wrong), None);
        }
        let long = format!("Bearer {}", "x".repeat(AUTHORIZATION_BYTES + 1));
        assert_eq!(bearer(long.as_bytes()), None);
    }
}
