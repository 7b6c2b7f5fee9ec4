//! Who sent a request: the layer [`crate::edge::guard`] puts the [`Caller`] into every request, and
//! handlers take it as an extractor.

use crate::edge::watch::CredentialWatch;
use crate::wire::problem::{Answer, Problem};
use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use axum::http::{StatusCode, header};
use std::sync::Arc;
use ventriform_service::base::records::Tenant;
use ventriform_service::callers::{Agent, Identity, Quota, Scope};

/// Who sent the request.
#[derive(Debug, Clone)]
pub struct Caller {
    /// The agent in the audit trail for which it changes something.
    pub by: Agent,
    /// Whose items and jobs it sees.
    pub tenant: Tenant,
    /// Its name, for people who read the log.
    pub name: String,
    /// Its scope.
    pub scope: Scope,
    /// Limits on what its tenant may store and queue by its requests; those of its key, or the general limits.
    pub quota: Quota,
    /// Who it is, with the key and the keys that have made that.
    pub identity: Arc<Identity>,
    /// Tells when its credentials end while it waits.
    pub watch: CredentialWatch,
}

impl Caller {
    /// Refuses a caller that may not do what `needed` stands for.
    ///
    /// # Errors
    /// 403 if its scope is narrower.
    pub fn require(&self, needed: Scope) -> Answer<()> {
        if self.scope.includes(needed) {
            return Ok(());
        }
        Err(Problem::new(
            StatusCode::FORBIDDEN,
            "insufficient-scope",
            format!(
                "This needs the scope `{needed}`; the credentials of this request have `{}`.",
                self.scope
            ),
        )
        .fix(format!(
            "Use a key made by `ventriform keys create --scope {needed}`."
        ))
        .header(
            header::WWW_AUTHENTICATE,
            format!(
                "Bearer realm=\"ventriform\", error=\"insufficient_scope\", scope=\"{needed}\""
            ),
        ))
    }
}

impl Caller {
    /// The caller of that identity, with the limits that apply to it.
    pub fn new(identity: Arc<Identity>, quota: Quota, by: Agent, watch: CredentialWatch) -> Self {
        Self {
            by,
            tenant: identity.tenant.clone(),
            name: identity.name.clone(),
            scope: identity.scope,
            quota,
            identity,
            watch,
        }
    }
}

impl<S: Send + Sync> FromRequestParts<S> for Caller {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Answer<Self> {
        let caller = parts.extensions.get::<Self>().cloned();
        caller.ok_or_else(|| Problem::internal("this route does not know its callers"))
    }
}
