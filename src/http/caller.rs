//! Who sent a request: a layer puts the [`Caller`] into every request, and handlers take it as an
//! extractor.

use super::problem::{Answer, Problem};
use crate::access::Scope;
use crate::jobs::Tenant;
use axum::extract::{FromRequestParts, Request};
use axum::http::request::Parts;
use axum::middleware::Next;
use axum::response::Response;

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
    /// The caller of a service that asks nobody who they are.
    pub fn anonymous() -> Self {
        Self {
            tenant: Tenant::default(),
            name: "anonymous".into(),
            scope: Scope::Admin,
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

/// Puts the caller into the request.
pub async fn identify(mut request: Request, next: Next) -> Response {
    request.extensions_mut().insert(Caller::anonymous());
    next.run(request).await
}
