//! Bearer tokens of an OpenID Connect issuer: JWTs (RFC 7519), signed by a key of the issuer's
//! JWKS (RFC 7517).
//!
//! 1. The header names algorithm and key. Only RS256/384/512, PS256/384/512, ES256, ES384 and
//!    EdDSA are read, and only with a key made for that algorithm. So neither `none` nor a token
//!    "signed" with a public key as an HMAC secret is accepted. A header with `crit` is refused: it names
//!    extensions that a reader must understand (RFC 7515, 4.1.11), and none is known here.
//! 2. Signature, issuer, audience, expiry (required) and `nbf` are checked, with a leeway: the expiry by the latest
//!    time that it may be ([`Clock::latest`]), so that no token becomes valid again when the clock is set back.
//! 3. Claims give tenant and scope. The setting is the claim's name, or a path of names with dots
//!    between them (`realm_access.roles`).
//!
//! The JWKS is read when the first token comes, again each [`REFRESH_AFTER`], and for an unknown
//! key at most once per [`RETRY_AFTER`]. A token whose key is known does not wait for that: the keys are
//! used as they are, for at most [`STALE_AFTER`], and read anew beside the requests.

use super::{Identity, Makers, Quota, Scope};
use crate::base::http_client::{
    ClientFactory, ClientOptions, HttpClient, Redirects, bounded_body, request_uri,
};
use crate::base::records::{Clock, Tenant, Timestamp, content_id, milliseconds};
use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use bytes::Bytes;
use http::Request;
use jsonwebtoken::jwk::{AlgorithmParameters, EllipticCurve, Jwk};
use jsonwebtoken::{Algorithm, DecodingKey, Header, Validation, decode, decode_header};
use serde_json::{Map, Value};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::{Duration, Instant};
use url::Url;
use ventriform::base::text::is_printable;

/// How long a JWKS is used without reading it again.
const REFRESH_AFTER: Duration = Duration::from_secs(3600);
/// Least time between two attempts to read it.
const RETRY_AFTER: Duration = Duration::from_secs(30);
/// How long it is used if it cannot be read again.
const STALE_AFTER: Duration = Duration::from_secs(24 * 3600);
/// Longest time for the issuer to answer.
const ISSUER_TIMEOUT: Duration = Duration::from_secs(5);
/// Largest document of the issuer, bytes.
const ANSWER_BYTES: usize = 1 << 20;
/// Most keys of a JWKS.
const MOST_KEYS: usize = 100;
/// Longest subject that is kept as a name, characters.
const LONGEST_NAME: usize = 128;
/// The prefix of the name of a scope.
const SCOPE_PREFIX: &str = "ventriform:";

/// Which tokens are accepted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct IssuerSettings {
    /// The value of `iss`, and the base of the discovery document.
    pub issuer: String,
    /// A value that `aud` must hold.
    pub audience: String,
    /// Address of the JWKS; `None` takes it from the discovery document.
    pub jwks: Option<String>,
    /// The claim that names the tenant; `None` puts every subject into the tenant `default`.
    pub tenant_claim: Option<String>,
    /// The claim that holds scopes: words of one text, or a list of words.
    pub scope_claim: String,
    /// How far the clocks of issuer and service may differ.
    pub leeway: Duration,
}

/// Why a token tells no caller.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum IssuerError {
    /// The token is not valid here. The text says why, without the token's content.
    #[error("{0}")]
    Token(String),
    /// The issuer's keys cannot be read.
    #[error("{0}")]
    Unavailable(String),
}

/// The issuer, with its keys as they were read last.
pub struct Issuer(Arc<Known>);

struct Known {
    settings: IssuerSettings,
    client: Arc<dyn HttpClient>,
    keys: RwLock<Option<Keys>>,
    /// When reading was last tried. Owned while reading, so that one request reads at a time.
    tried: tokio::sync::Mutex<Option<Instant>>,
}

#[derive(Clone)]
struct Keys {
    keys: Arc<Vec<TokenKey>>,
    read: Instant,
}

struct TokenKey {
    id: Option<String>,
    algorithms: Vec<Algorithm>,
    key: DecodingKey,
}

impl Issuer {
    /// An issuer whose keys are read when the first token comes, by a client of that factory.
    ///
    /// # Errors
    /// If an address of the settings is neither https nor on this machine.
    pub fn new(settings: IssuerSettings, clients: &dyn ClientFactory) -> Result<Self, IssuerError> {
        let addresses = std::iter::once(&settings.issuer).chain(&settings.jwks);
        for address in addresses {
            check_address(address)?;
        }
        let client = clients
            .build(ClientOptions {
                total_timeout: Some(ISSUER_TIMEOUT),
                redirects: Redirects::Never,
                environment_proxies: true,
                ..ClientOptions::default()
            })
            .map_err(|error| IssuerError::Unavailable(error.to_string()))?;
        Ok(Self(Arc::new(Known {
            settings,
            client,
            keys: RwLock::new(None),
            tried: tokio::sync::Mutex::new(None),
        })))
    }

    /// Who presents this token.
    ///
    /// # Errors
    /// If it is not valid, or cannot be checked.
    pub async fn subject(&self, token: &str, clock: &dyn Clock) -> Result<Identity, IssuerError> {
        let header =
            decode_header(token).map_err(|_| refused("it is not a JWT of a supported kind"))?;
        if matches!(
            header.alg,
            Algorithm::HS256 | Algorithm::HS384 | Algorithm::HS512
        ) {
            return Err(refused("it is signed with a shared secret"));
        }
        if demands_extensions(token) {
            return Err(refused(
                "it demands extensions (`crit`) that are unknown here",
            ));
        }
        let keys = self.0.keys_for(&header).await?;
        let mut candidates = keys.iter().filter(|key| key.fits(&header)).peekable();
        if candidates.peek().is_none() {
            return Err(refused("no key of the issuer fits it"));
        }
        let validation = self.0.validation(header.alg);
        let mut reason = refused("its signature is wrong");
        for key in candidates {
            match decode::<Map<String, Value>>(token, &key.key, &validation) {
                Ok(token) => {
                    let expires_at = self.0.expiry(&token.claims, clock)?;
                    return self.0.identity(&token.claims, expires_at);
                }
                Err(error) => reason = why(&error),
            }
        }
        Err(reason)
    }
}

impl Known {
    fn validation(&self, algorithm: Algorithm) -> Validation {
        let mut validation = Validation::new(algorithm);
        validation.set_issuer(&[&self.settings.issuer]);
        validation.set_audience(&[&self.settings.audience]);
        validation.set_required_spec_claims(&["exp", "iss", "aud", "sub"]);
        // Both by the clock of the service.
        (validation.validate_exp, validation.validate_nbf) = (false, false);
        validation
    }

    /// When a token expires, which is valid now.
    fn expiry(
        &self,
        claims: &Map<String, Value>,
        clock: &dyn Clock,
    ) -> Result<Timestamp, IssuerError> {
        let leeway = milliseconds(self.settings.leeway);
        let time = |name: &str| claims.get(name).and_then(milliseconds_of);
        let expires_at = time("exp").ok_or_else(|| refused(LACKS_CLAIM))?;
        if expires_at.saturating_add(leeway) < clock.latest() {
            return Err(refused(EXPIRED));
        }
        if time("nbf").is_some_and(|begins| begins > clock.now().saturating_add(leeway)) {
            return Err(refused(NOT_YET));
        }
        Ok(expires_at)
    }

    fn identity(
        &self,
        claims: &Map<String, Value>,
        expires_at: Timestamp,
    ) -> Result<Identity, IssuerError> {
        let text = |name: &str| claims.get(name).and_then(Value::as_str);
        let subject = text("sub").unwrap_or_default();
        let tenant = match &self.settings.tenant_claim {
            None => Tenant::default(),
            Some(name) => claim(claims, name)
                .and_then(Value::as_str)
                .and_then(|tenant| tenant.parse().ok())
                .ok_or_else(|| refused(&format!("its claim `{name}` names no tenant")))?,
        };
        let name = &self.settings.scope_claim;
        let scope = widest_scope(claim(claims, name))
            .ok_or_else(|| refused(&format!("its claim `{name}` holds no scope")))?;
        let name: String = subject
            .chars()
            .filter(|c| is_printable(*c))
            .take(LONGEST_NAME)
            .collect();
        Ok(Identity {
            account: Some(content_id(
                "subject ",
                [self.settings.issuer.as_bytes(), subject.as_bytes()],
            )),
            tenant,
            owner: Some(name.clone()),
            name,
            scope,
            key: None,
            quota: Quota::default(),
            makers: Makers::default(),
            expires_at: Some(expires_at),
        })
    }

    /// The issuer's keys, read anew if that is due or may find the key of this header.
    async fn keys_for(
        self: &Arc<Self>,
        header: &Header,
    ) -> Result<Arc<Vec<TokenKey>>, IssuerError> {
        let fits = |keys: &Keys| keys.keys.iter().any(|key| key.fits(header));
        let fresh = |keys: &Keys| keys.read.elapsed() < REFRESH_AFTER && fits(keys);
        if let Some(keys) = self.known().filter(fresh) {
            return Ok(keys.keys);
        }
        let stale = |keys: &Keys| keys.read.elapsed() < STALE_AFTER && fits(keys);
        if let Some(keys) = self.known().filter(stale) {
            let known = self.clone();
            // Whoever holds the lock is reading already.
            if let Ok(tried) = self.tried.try_lock()
                && is_due(*tried)
            {
                drop(tried);
                tokio::spawn(async move { known.renew(|_| false).await });
            }
            return Ok(keys.keys);
        }
        self.renew(fresh).await;
        let usable = self.known().filter(|k| k.read.elapsed() < STALE_AFTER);
        usable.map(|keys| keys.keys).ok_or_else(|| {
            IssuerError::Unavailable("the keys of the issuer cannot be read".to_owned())
        })
    }

    /// Reads the keys, unless that was tried a moment ago or another request has read keys that will do
    /// while this one waited for its turn.
    async fn renew(&self, will_do: impl Fn(&Keys) -> bool) {
        let mut tried = self.tried.lock().await;
        if self.known().is_some_and(|keys| will_do(&keys)) || !is_due(*tried) {
            return;
        }
        *tried = Some(Instant::now());
        match self.read().await {
            Ok(keys) => {
                let mut known = self.keys.write().unwrap_or_else(PoisonError::into_inner);
                *known = Some(Keys {
                    keys: Arc::new(keys),
                    read: Instant::now(),
                });
            }
            Err(reason) => {
                tracing::error!(reason, "the keys of the issuer cannot be read");
            }
        }
    }

    fn known(&self) -> Option<Keys> {
        let keys = self.keys.read().unwrap_or_else(PoisonError::into_inner);
        keys.clone()
    }

    async fn read(&self) -> Result<Vec<TokenKey>, String> {
        let address = match &self.settings.jwks {
            Some(address) => address.clone(),
            None => self.discover().await?,
        };
        let set = self.document(&address).await?;
        let keys = set.get("keys").and_then(Value::as_array);
        let keys = keys.ok_or_else(|| format!("{address} holds no `keys`"))?;
        // Keys of unknown kinds may stand beside those that tokens are signed with.
        let keys = keys.iter().take(MOST_KEYS).filter_map(TokenKey::read);
        Ok(keys.collect())
    }

    async fn discover(&self) -> Result<String, String> {
        let base = self.settings.issuer.trim_end_matches('/');
        let address = format!("{base}/.well-known/openid-configuration");
        let document = self.document(&address).await?;
        let text = |name: &str| document.get(name).and_then(Value::as_str);
        if text("issuer") != Some(&self.settings.issuer) {
            return Err(format!("{address} is the document of another issuer"));
        }
        let jwks = text("jwks_uri").ok_or_else(|| format!("{address} holds no `jwks_uri`"))?;
        check_address(jwks).map_err(|error| error.to_string())?;
        Ok(jwks.to_owned())
    }

    async fn document(&self, address: &str) -> Result<Value, String> {
        let uri = request_uri(address).map_err(|error| error.to_string())?;
        let request = Request::get(uri).body(Bytes::new());
        let request = request.map_err(|error| error.to_string())?;
        let answer = self.client.send(request).await;
        let answer = answer.map_err(|error| error.to_string())?;
        let status = answer.status();
        if status.is_client_error() || status.is_server_error() {
            return Err(format!("{address} answered with status {status}"));
        }
        let body = bounded_body(answer.into_body(), ANSWER_BYTES).await;
        let body = body.map_err(|error| error.to_string())?;
        let body = body.ok_or_else(|| format!("{address} is larger than {ANSWER_BYTES} bytes"))?;
        serde_json::from_slice(&body).map_err(|error| format!("{address}: {error}"))
    }
}

impl TokenKey {
    /// A key for signatures; `None` for keys of other kinds.
    fn read(value: &Value) -> Option<Self> {
        if value.get("use").is_some_and(|usage| usage != "sig") {
            return None;
        }
        let jwk: Jwk = serde_json::from_value(value.clone()).ok()?;
        let algorithms = match &jwk.algorithm {
            AlgorithmParameters::RSA(_) => vec![
                Algorithm::RS256,
                Algorithm::RS384,
                Algorithm::RS512,
                Algorithm::PS256,
                Algorithm::PS384,
                Algorithm::PS512,
            ],
            AlgorithmParameters::EllipticCurve(key) => match key.curve {
                EllipticCurve::P256 => vec![Algorithm::ES256],
                EllipticCurve::P384 => vec![Algorithm::ES384],
                _ => return None,
            },
            AlgorithmParameters::OctetKeyPair(key) if key.curve == EllipticCurve::Ed25519 => {
                vec![Algorithm::EdDSA]
            }
            _ => return None,
        };
        let stated = value.get("alg").and_then(Value::as_str);
        let stated = stated.map(|name| name.parse::<Algorithm>());
        let algorithms = match stated {
            None => algorithms,
            Some(Ok(one)) if algorithms.contains(&one) => vec![one],
            Some(_) => return None,
        };
        Some(Self {
            key: DecodingKey::from_jwk(&jwk).ok()?,
            id: jwk.common.key_id,
            algorithms,
        })
    }

    /// Whether a token with this header may be signed by this key.
    fn fits(&self, header: &Header) -> bool {
        let named = header.kid.is_none() || header.kid == self.id;
        named && self.algorithms.contains(&header.alg)
    }
}

/// Whether it is time to read the keys after the last attempt.
fn is_due(tried: Option<Instant>) -> bool {
    tried.is_none_or(|at| at.elapsed() >= RETRY_AFTER)
}

/// Whether the header of a token has `crit`, whatever it holds.
fn demands_extensions(token: &str) -> bool {
    let header = token.split('.').next().unwrap_or_default();
    let header = URL_SAFE_NO_PAD.decode(header).unwrap_or_default();
    let header = serde_json::from_slice::<Map<String, Value>>(&header);
    header.is_ok_and(|header| header.contains_key("crit"))
}

/// The claim of that name, or what lies at the path of names with dots between them. Names may hold dots
/// themselves (`https://clinic.example/roles`); the longest name that is there counts.
fn claim<'a>(claims: &'a Map<String, Value>, name: &str) -> Option<&'a Value> {
    if let Some(value) = claims.get(name) {
        return Some(value);
    }
    let dots = name.rmatch_indices('.');
    dots.map(|(at, _)| (&name[..at], &name[at + 1..]))
        .find_map(|(first, rest)| claim(claims.get(first)?.as_object()?, rest))
}

/// The widest scope that a claim holds.
fn widest_scope(claim: Option<&Value>) -> Option<Scope> {
    let scope = |word: &str| {
        let word = word.strip_prefix(SCOPE_PREFIX).unwrap_or(word);
        word.parse::<Scope>().ok()
    };
    match claim? {
        Value::String(words) => words.split_whitespace().filter_map(scope).max(),
        Value::Array(words) => words.iter().filter_map(|w| scope(w.as_str()?)).max(),
        _ => None,
    }
}

/// Milliseconds since 1970 of a NumericDate (RFC 7519, 2); `None` if the claim is none.
fn milliseconds_of(claim: &Value) -> Option<Timestamp> {
    let seconds = claim.as_f64().filter(|seconds| *seconds >= 0.0)?;
    // Saturates.
    Some((seconds * 1000.0).round() as Timestamp)
}

const EXPIRED: &str = "it has expired";
const NOT_YET: &str = "it is not valid yet";
const LACKS_CLAIM: &str = "it lacks one of exp, iss, aud and sub";

fn refused(reason: &str) -> IssuerError {
    IssuerError::Token(reason.to_owned())
}

fn why(error: &jsonwebtoken::errors::Error) -> IssuerError {
    use jsonwebtoken::errors::ErrorKind;
    refused(match error.kind() {
        ErrorKind::InvalidIssuer => "it is of another issuer",
        ErrorKind::InvalidAudience => "it is for another audience",
        ErrorKind::MissingRequiredClaim(_) => LACKS_CLAIM,
        ErrorKind::InvalidSignature => "its signature is wrong",
        _ => "it cannot be read",
    })
}

/// Addresses of an issuer are https, so that nobody on the way can put in keys of his own; plain
/// http only on this machine.
fn check_address(address: &str) -> Result<(), IssuerError> {
    let url = Url::parse(address).ok();
    let usable = url.is_some_and(|url| {
        let host = url.host_str().unwrap_or_default();
        let here = host == "localhost"
            || host
                .trim_matches(['[', ']'])
                .parse::<std::net::IpAddr>()
                .is_ok_and(|ip| ip.is_loopback());
        url.scheme() == "https" || (url.scheme() == "http" && here)
    });
    if usable {
        Ok(())
    } else {
        Err(IssuerError::Unavailable(format!(
            "{address} is not an https address"
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::http_client::fake::FakeClient;
    use crate::base::records::SystemClock;
    use serde_json::json;
    use std::sync::atomic::Ordering;

    #[test]
    fn scopes_are_read_from_texts_and_lists() {
        let widest = |claim: Value| widest_scope(Some(&claim));
        assert_eq!(widest(json!("openid read submit")), Some(Scope::Submit));
        assert_eq!(widest(json!("ventriform:admin")), Some(Scope::Admin));
        assert_eq!(widest(json!(["email", "read"])), Some(Scope::Read));
        for none in [json!("openid Admin"), json!([1]), json!({"admin": true})] {
            assert_eq!(widest(none.clone()), None, "{none}");
        }
        assert_eq!(widest_scope(None), None);
    }

    #[test]
    fn claims_are_found_by_name_and_by_path() {
        let claims = json!({
            "scope": "read",
            "realm_access": {"roles": ["submit"]},
            "resource_access": {"heart.example": {"roles": ["admin"]}},
            "https://clinic.example/roles": ["read", "admin"],
            "a.b": {"c": 1},
            "a": {"b": {"c": 2}, "b.c": 3},
        });
        let claims = claims.as_object().unwrap();
        for (name, found) in [
            ("scope", Some(json!("read"))),
            ("realm_access.roles", Some(json!(["submit"]))),
            (
                "resource_access.heart.example.roles",
                Some(json!(["admin"])),
            ),
            (
                "https://clinic.example/roles",
                Some(json!(["read", "admin"])),
            ),
            ("a.b.c", Some(json!(1))),
            ("realm_access.groups", None),
            ("scope.roles", None),
            ("realm_access.", None),
            (".", None),
        ] {
            assert_eq!(claim(claims, name), found.as_ref(), "{name}");
        }
    }

    #[test]
    fn any_crit_demands_extensions() {
        for (header, demands) in [
            (json!({"alg": "ES256", "crit": ["b64"], "b64": false}), true),
            (json!({"alg": "ES256", "crit": []}), true),
            (json!({"alg": "ES256", "crit": null}), true),
            (json!({"alg": "ES256", "kid": "crit"}), false),
        ] {
            let token = URL_SAFE_NO_PAD.encode(header.to_string()) + ".e30.c2ln";
            assert_eq!(demands_extensions(&token), demands, "{header}");
        }
    }

    #[test]
    fn keys_that_are_not_for_signatures_are_skipped() {
        let rsa = json!({"kty": "RSA", "n": "AQAB", "e": "AQAB", "kid": "a"});
        assert_eq!(TokenKey::read(&rsa).unwrap().algorithms.len(), 6);
        let with = |name: &str, value: &str| {
            let mut key = rsa.clone();
            key[name] = value.into();
            TokenKey::read(&key)
        };
        assert!(with("use", "enc").is_none());
        assert!(with("alg", "RSA-OAEP").is_none());
        assert!(with("alg", "HS256").is_none());
        assert_eq!(with("alg", "RS256").unwrap().algorithms, [Algorithm::RS256]);
        let shared = json!({"kty": "oct", "k": "c2VjcmV0"});
        assert!(TokenKey::read(&shared).is_none());
    }

    /// Appendix A.2 of RFC 7515: a token of 2011, signed with RS256.
    #[tokio::test]
    async fn signatures_of_rsa_keys_are_checked() {
        let jwk = json!({"kty": "RSA", "e": "AQAB", "n": concat!(
            "ofgWCuLjybRlzo0tZWJjNiuSfb4p4fAkd_wWJcyQoTbji9k0l8W26mPddxHmfHQp-Vaw-4qPCJrcS2mJPMEzP1Pt",
            "0Bm4d4QlL-yRT-SFd2lZS-pCgNMsD1W_YpRPEwOWvG6b32690r2jZ47soMZo9wGzjb_7OMg0LOL-bSf63kpaSHSX",
            "ndS5z5rexMdbBYUsLA9e-KXBdQOS-UTo7WTBEMa2R2CapHg665xsmtdVMTBQY4uDZlxvb3qCo5ZwKh9kG4LT6_I5",
            "IhlJH7aGhyxXFvUK-DWNmoudF8NAco9_h9iaGNj8q2ethFkMLs91kzk2PAcDTW9gb54h4FRWyuXpoQ")});
        let token = concat!(
            "eyJhbGciOiJSUzI1NiJ9.eyJpc3MiOiJqb2UiLA0KICJleHAiOjEzMDA4MTkzODAsDQogImh0dHA6Ly9leGFtcGxlL",
            "mNvbS9pc19yb290Ijp0cnVlfQ.cC4hiUPoj9Eetdgtv3hF80EGrhuB__dzERat0XF9g2VtQgr9PJbu3XOiZj5RZmh7",
            "AAuHIm4Bh-0Qc_lF5YKt_O8W2Fp5jujGbds9uJdbF9CUAr7t1dnZcAcQjbKBYNX4BAynRFdiuB--f_nZLgrnbyTyWz",
            "O75vRK5h6xBArLIARNPvkSjtQBMHlb1L07Qe7K0GarZRmB_eSN9383LcOLn6_dO--xi12jzDwusC-eOkHWEsqtFZES",
            "c6BfI7noOPqvhJ1phCnvWh6IeYI2w9QOYEUipUTI8np6LbgGY9Fs98rqVt5AXLIhWkWywlVmtVrBp0igcN_IoypGlU",
            "PQGe77Rw"
        );
        let settings = IssuerSettings {
            issuer: "https://joe.example".into(),
            audience: "ventriform".into(),
            jwks: None,
            tenant_claim: None,
            scope_claim: "scope".into(),
            leeway: Duration::ZERO,
        };
        let issuer = Issuer::new(settings, &FakeClient::default()).unwrap();
        *issuer.0.keys.write().unwrap() = Some(Keys {
            keys: Arc::new(vec![TokenKey::read(&jwk).unwrap()]),
            read: Instant::now(),
        });
        let lacks = refused("it lacks one of exp, iss, aud and sub");
        assert_eq!(issuer.subject(token, &SystemClock).await, Err(lacks));
        let forged = token.replace("cC4hiU", "cC4hiV");
        let wrong = refused("its signature is wrong");
        assert_eq!(issuer.subject(&forged, &SystemClock).await, Err(wrong));
    }

    #[test]
    fn issuers_are_reached_by_https_or_on_this_machine() {
        for good in [
            "https://id.example",
            "http://127.0.0.1:1/x",
            "http://[::1]/",
        ] {
            assert!(check_address(good).is_ok(), "{good}");
        }
        for bad in ["http://id.example", "ftp://127.0.0.1", "id.example", ""] {
            assert!(check_address(bad).is_err(), "{bad}");
        }
    }

    /// An issuer that is asked by that client, with keys read that long ago, and a token of it.
    fn slow_issuer(age: Duration, client: &FakeClient) -> (Issuer, String) {
        let url = "https://id.example";
        let settings = IssuerSettings {
            issuer: url.into(),
            audience: "ventriform".into(),
            jwks: Some(format!("{url}/keys")),
            tenant_claim: None,
            scope_claim: "scope".into(),
            leeway: Duration::from_secs(60),
        };
        let issuer = Issuer::new(settings, client).unwrap();
        let pair = rcgen::KeyPair::generate_for(&rcgen::PKCS_ECDSA_P256_SHA256).unwrap();
        let point = pair.public_key_raw();
        let base64 = |bytes: &[u8]| URL_SAFE_NO_PAD.encode(bytes);
        let key = json!({"kty": "EC", "crv": "P-256", "kid": "a",
            "x": base64(&point[1..33]), "y": base64(&point[33..])});
        *issuer.0.keys.write().unwrap() = Some(Keys {
            keys: Arc::new(vec![TokenKey::read(&key).unwrap()]),
            read: Instant::now() - age,
        });
        let expires = std::time::SystemTime::now()
            .duration_since(std::time::UNIX_EPOCH)
            .unwrap()
            .as_secs()
            + 300;
        let claims =
            json!({"iss": url, "aud": "ventriform", "sub": "me", "exp": expires, "scope": "read"});
        let mut header = Header::new(Algorithm::ES256);
        header.kid = Some("a".into());
        let secret = jsonwebtoken::EncodingKey::from_ec_der(pair.serialized_der());
        let token = jsonwebtoken::encode(&header, &claims, &secret).unwrap();
        (issuer, token)
    }

    #[tokio::test]
    async fn stale_keys_are_used_at_once_and_renewed_beside_the_requests() {
        let client = FakeClient::default();
        let (issuer, token) = slow_issuer(2 * REFRESH_AFTER, &client);
        let begun = Instant::now();
        for _ in 0..20 {
            assert_eq!(
                issuer.subject(&token, &SystemClock).await.unwrap().name,
                "me"
            );
        }
        assert!(begun.elapsed() < ISSUER_TIMEOUT, "{:?}", begun.elapsed());
        // One of them made the service ask, and no other did.
        tokio::time::sleep(Duration::from_millis(200)).await;
        assert_eq!(client.requests.load(Ordering::SeqCst), 1);
    }

    #[tokio::test]
    async fn keys_that_are_too_old_are_not_used() {
        let client = FakeClient {
            unreachable: true,
            ..FakeClient::default()
        };
        let (issuer, token) = slow_issuer(STALE_AFTER, &client);
        let refused = issuer.subject(&token, &SystemClock).await.unwrap_err();
        assert!(matches!(refused, IssuerError::Unavailable(_)), "{refused}");
    }
}
