//! Signing secrets and signatures of Standard Webhooks.
//!
//! A secret is 24 to 64 random bytes, written as `whsec_` and base64. A signature is the
//! HMAC-SHA256 of `ID.TIMESTAMP.BODY`, written as `v1,` and base64. With two secrets, while one
//! replaces the other, there are two signatures, separated by a space.

use crate::base::records::random_key;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;
use std::fmt;
use std::str::FromStr;

const SECRET_PREFIX: &str = "whsec_";

/// Lengths of a secret's key, bytes.
const KEY_BYTES: std::ops::RangeInclusive<usize> = 24..=64;

/// A key for signing deliveries. It is not shown by `Debug`.
#[derive(Clone, PartialEq, Eq)]
pub struct SigningSecret(Vec<u8>);

/// A text is not a signing secret.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a signing secret is `{SECRET_PREFIX}` and the base64 of 24 to 64 bytes")]
pub struct InvalidSecret;

impl SigningSecret {
    /// A new secret of 32 bytes.
    pub fn random() -> Self {
        Self(random_key().to_vec())
    }

    /// The secret as it is given to receivers.
    pub fn reveal(&self) -> String {
        format!("{SECRET_PREFIX}{}", STANDARD.encode(&self.0))
    }

    /// The signature of one attempt. `seconds` is the time of `webhook-timestamp`, since 1970.
    pub fn sign(&self, id: &str, seconds: i64, body: &str) -> String {
        // HMAC takes keys of every length.
        let Ok(mut mac) = Hmac::<Sha256>::new_from_slice(&self.0) else {
            return String::new();
        };
        mac.update(format!("{id}.{seconds}.{body}").as_bytes());
        format!("v1,{}", STANDARD.encode(mac.finalize().into_bytes()))
    }
}

impl FromStr for SigningSecret {
    type Err = InvalidSecret;

    fn from_str(text: &str) -> Result<Self, InvalidSecret> {
        let encoded = text.strip_prefix(SECRET_PREFIX).ok_or(InvalidSecret)?;
        let key = STANDARD.decode(encoded).map_err(|_| InvalidSecret)?;
        if KEY_BYTES.contains(&key.len()) {
            Ok(Self(key))
        } else {
            Err(InvalidSecret)
        }
    }
}

impl fmt::Debug for SigningSecret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SigningSecret(..)")
    }
}

/// The header `webhook-signature`: one signature for each secret.
pub fn signature_header(secrets: &[SigningSecret], id: &str, seconds: i64, body: &str) -> String {
    let signatures: Vec<String> = secrets
        .iter()
        .map(|secret| secret.sign(id, seconds, body))
        .collect();
    signatures.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_of_the_specification_is_signed_as_it_says() {
        // From the reference libraries of Standard Webhooks.
        let secret: SigningSecret = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw".parse().unwrap();
        let signature = secret.sign(
            "msg_p5jXN8AQM9LWM0D4loKWxJek",
            1614265330,
            "{\"test\": 2432232314}",
        );
        assert_eq!(signature, "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=");
    }

    #[test]
    fn secrets_are_read_back_and_never_shown_by_debug() {
        let secret = SigningSecret::random();
        let text = secret.reveal();
        assert_eq!(text.parse(), Ok(secret.clone()));
        assert_ne!(SigningSecret::random(), secret);
        assert!(!format!("{secret:?}").contains(&text[6..20]));
    }

    #[test]
    fn short_secrets_and_other_texts_are_refused() {
        for text in ["", "whsec_", "whsec_c2hvcnQ=", "secret", "whsec_%%%"] {
            assert_eq!(text.parse::<SigningSecret>(), Err(InvalidSecret), "{text}");
        }
    }
}
