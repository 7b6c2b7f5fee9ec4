//! API keys: how they are made, stored and checked.
//!
//! A key is `vf_` + id + `_` + secret: 16 hexadecimal digits that name its record, and 32 random
//! bytes in base64url. The record holds the SHA-256 of the secret only. A plain hash is enough
//! because the secret has 256 random bits, so nobody can guess it from the hash; a slow hash would
//! let strangers keep the processor busy.

use super::{Quota, Scope};
use crate::base::records::{Tenant, Timestamp, hex};
use base64::Engine;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use sha2::{Digest, Sha256};
use subtle::ConstantTimeEq;
use ventriform::base::text::is_printable;

/// The beginning of every key, so that scanners for leaked secrets find it.
const KEY_PREFIX: &str = "vf_";
/// Bytes of an id.
const ID_BYTES: usize = 8;
/// Bytes of a secret.
const SECRET_BYTES: usize = 32;
/// Longest name, characters.
const LONGEST_NAME: usize = 80;

/// Who made a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Maker {
    /// The operator, on the machine of the service.
    Operator,
    /// A caller of the service: the id of its key, `None` if it came with a token or without credentials.
    Caller(Option<String>),
}

/// The record of a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ApiKey {
    /// 16 hexadecimal digits.
    pub id: String,
    /// Its position in the order of making.
    pub sequence: i64,
    /// Its purpose, in the operator's words.
    pub name: String,
    /// Whose items and jobs it opens.
    pub tenant: Tenant,
    /// Its scope.
    pub scope: Scope,
    /// Limits that replace the general ones.
    pub quota: Quota,
    /// Who made it.
    pub maker: Maker,
    /// The subject of the issuer whose key it is: that made it with a token, or with a key of its own.
    pub owner: Option<String>,
    /// When it was made.
    pub created_at: Timestamp,
    /// From when on it is refused.
    pub expires_at: Option<Timestamp>,
    /// Since when it is refused because somebody revoked it.
    pub revoked_at: Option<Timestamp>,
    /// SHA-256 of the secret.
    pub digest: Vec<u8>,
}

/// The properties of a new key.
#[derive(Debug, Clone)]
pub struct KeyRequest {
    /// See [`ApiKey::name`].
    pub name: String,
    /// See [`ApiKey::tenant`].
    pub tenant: Tenant,
    /// See [`ApiKey::scope`].
    pub scope: Scope,
    /// See [`ApiKey::quota`].
    pub quota: Quota,
    /// See [`ApiKey::maker`].
    pub maker: Maker,
    /// See [`ApiKey::owner`].
    pub owner: Option<String>,
    /// See [`ApiKey::expires_at`].
    pub expires_at: Option<Timestamp>,
}

/// Why no key was made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum KeyError {
    /// The name is empty, long, or has control characters.
    #[error("the name of a key has 1 to {LONGEST_NAME} printable characters")]
    Name,
    /// The key would have expired already.
    #[error("the key would expire before it is made")]
    Expired,
    /// The system has no random numbers.
    #[error("the system gives no random numbers")]
    NoRandomNumbers,
}

/// The state of a key at some time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeyState {
    /// It opens the service.
    Active,
    /// Its time is over.
    Expired,
    /// Somebody revoked it.
    Revoked,
}

impl KeyState {
    /// The state's name.
    pub fn as_str(self) -> &'static str {
        match self {
            KeyState::Active => "active",
            KeyState::Expired => "expired",
            KeyState::Revoked => "revoked",
        }
    }
}

impl ApiKey {
    /// Makes a key: its record, and the text that its owner presents. The text is stored nowhere.
    ///
    /// # Errors
    /// If the name or the expiry cannot be used.
    pub fn make(request: KeyRequest, now: Timestamp) -> Result<(Self, String), KeyError> {
        let length = request.name.chars().count();
        if !(1..=LONGEST_NAME).contains(&length) || !request.name.chars().all(is_printable) {
            return Err(KeyError::Name);
        }
        if request.expires_at.is_some_and(|at| at <= now) {
            return Err(KeyError::Expired);
        }
        let (mut id, mut secret) = ([0; ID_BYTES], [0; SECRET_BYTES]);
        fill(&mut id)?;
        fill(&mut secret)?;
        let secret = BASE64_URL_SAFE_NO_PAD.encode(secret);
        let key = Self {
            id: hex(&id),
            sequence: 0,
            name: request.name,
            tenant: request.tenant,
            scope: request.scope,
            quota: request.quota,
            maker: request.maker,
            owner: request.owner,
            created_at: now,
            expires_at: request.expires_at,
            revoked_at: None,
            digest: digest(&secret),
        };
        let text = format!("{KEY_PREFIX}{}_{secret}", key.id);
        Ok((key, text))
    }

    /// Whether `secret` is the secret of this key. Takes the same time for every secret.
    pub fn has_secret(&self, secret: &str) -> bool {
        self.digest.ct_eq(&digest(secret)).into()
    }

    /// Its state at that time.
    pub fn state(&self, now: Timestamp) -> KeyState {
        match (self.revoked_at, self.expires_at) {
            (Some(_), _) => KeyState::Revoked,
            (None, Some(at)) if at <= now => KeyState::Expired,
            _ => KeyState::Active,
        }
    }
}

/// A key as its owner presents it, taken apart.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct PresentedKey<'a> {
    /// Names the record.
    pub id: &'a str,
    /// To be compared with the record.
    pub secret: &'a str,
}

impl<'a> PresentedKey<'a> {
    /// Takes a text apart. `None` if it is no key by its form.
    pub fn parse(text: &'a str) -> Option<Self> {
        let (id, secret) = text.strip_prefix(KEY_PREFIX)?.split_once('_')?;
        let digit = |b: u8| b.is_ascii_digit() || (b'a'..=b'f').contains(&b);
        let letter = |b: u8| b.is_ascii_alphanumeric() || b == b'-' || b == b'_';
        let formed = id.len() == 2 * ID_BYTES
            && id.bytes().all(digit)
            && secret.len() == (SECRET_BYTES * 8).div_ceil(6)
            && secret.bytes().all(letter);
        formed.then_some(Self { id, secret })
    }
}

fn digest(secret: &str) -> Vec<u8> {
    Sha256::digest(secret.as_bytes()).to_vec()
}

/// Fills the bytes by the system's generator for secrets.
fn fill(bytes: &mut [u8]) -> Result<(), KeyError> {
    let provider = rustls::crypto::ring::default_provider();
    let filled = provider.secure_random.fill(bytes);
    filled.map_err(|_| KeyError::NoRandomNumbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(name: &str) -> KeyRequest {
        KeyRequest {
            name: name.into(),
            tenant: Tenant::default(),
            scope: Scope::Read,
            quota: Quota::default(),
            maker: Maker::Operator,
            owner: None,
            expires_at: Some(100),
        }
    }

    #[test]
    fn a_key_is_recognised_by_its_secret_alone() {
        let (key, text) = ApiKey::make(request("scanner"), 10).unwrap();
        let (other, _) = ApiKey::make(request("scanner"), 10).unwrap();
        let presented = PresentedKey::parse(&text).unwrap();
        assert_eq!(presented.id, key.id);
        assert!(key.has_secret(presented.secret));
        assert!(!other.has_secret(presented.secret));
        let stored = format!("{key:?}");
        assert!(
            !stored.contains(presented.secret),
            "the record has no secret"
        );
    }

    #[test]
    fn a_key_ends_when_it_expires_or_is_revoked() {
        let (mut key, _) = ApiKey::make(request("scanner"), 10).unwrap();
        assert_eq!(key.state(99), KeyState::Active);
        assert_eq!(key.state(100), KeyState::Expired);
        key.revoked_at = Some(50);
        assert_eq!(key.state(51), KeyState::Revoked);
        assert_eq!(
            ApiKey::make(request("late"), 100).unwrap_err(),
            KeyError::Expired
        );
    }

    #[test]
    fn other_texts_are_no_keys() {
        let (_, text) = ApiKey::make(request("scanner"), 10).unwrap();
        for wrong in [
            "",
            "vf_",
            "vf__",
            &text[1..],
            &text[..text.len() - 1],
            &text.to_uppercase(),
            &format!("{text}x"),
            &text.replacen("_", "-", 2),
        ] {
            assert!(PresentedKey::parse(wrong).is_none(), "{wrong}");
        }
        for name in ["", "a\nb", &"x".repeat(81)] {
            assert_eq!(
                ApiKey::make(request(name), 10).unwrap_err(),
                KeyError::Name,
                "{name:?}"
            );
        }
    }
}
