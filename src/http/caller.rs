//! Who sent a request: the layer [`super::guard`] puts the [`Caller`] into every request, and
//! handlers take it as an extractor.

use super::problem::{Answer, Problem};
use crate::access::{Identity, Scope};
use crate::jobs::Tenant;
use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use axum::http::{StatusCode, header};

/// Who sent the request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Caller {
    /// Whose items and jobs it sees.
    pub tenant: Tenant,
    /// Its name, for people who read the log.
    pub name: String,
    /// What it may do.
    pub scope: Scope,
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

impl From<&Identity> for Caller {
    fn from(identity: &Identity) -> Self {
        Self {
            tenant: identity.tenant.clone(),
            name: identity.name.clone(),
            scope: identity.scope,
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
