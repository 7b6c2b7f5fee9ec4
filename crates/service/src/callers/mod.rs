//! Who may use the service, what each caller may do and how much, and the record of what was done.
//!
//! In: the `Authorization` of a request, and what the request did. Out: an [`Identity`] with a
//! tenant, a scope and quotas, or a [`Refusal`]; and a row of the audit trail.
//!
//! 1. [`Gate::identify`] tells who sends a request: the owner of an API key, the subject of a
//!    token from the OpenID Connect issuer, or, while the service asks nobody, the anonymous
//!    caller.
//! 2. [`Scope`] orders what callers may do; [`Quota`] and [`RequestCounter`] limit how much.
//! 3. [`Recorder`] appends to the audit trail, a chain of hashes in the database; [`verify`] walks
//!    the chain.
//!
//! Guaranteed: secrets are stored as hashes and compared in constant time; a revoked key is
//! refused at the latest after [`FRESH_FOR`], also when another process revoked it; a service that
//! ever had a key never admits anonymous callers again, unless its operator says so.
//!
//! Not guaranteed: counts of requests survive no restart, and are kept per process.
//!
//! | where | what |
//! |---|---|
//! | `scope`, `key`, `quota` | what callers may do; keys; limits |
//! | `gate`, `oidc`, `identity` | from `Authorization` to a caller; tokens of an issuer |
//! | `audit` | events, who acts, the chain, its check, its writer |
//! | `storage` | the trait that a database implements |

mod audit;
mod gate;
mod identity;
mod key;
mod oidc;
mod quota;
mod scope;
mod storage;

pub use audit::{
    Activity, Agent, Anchor, AuditEvent, AuditFilter, AuditLink, AuditRecord, AuditReport,
    BrokenLink, KeptRow, NO_HASH, NotRecorded, Outcome, Recorder, chain_hash, fhir, verify,
};
pub use gate::{FRESH_FOR, Gate, MOST_MAKERS, Refusal};
pub use identity::{Identity, Makers};
pub use key::{ApiKey, KeyError, KeyRequest, KeyState, Maker, PresentedKey};
pub use oidc::{Issuer, IssuerError, IssuerSettings};
pub use quota::{Allowance, QUOTA_WINDOW, Quota, RequestCounter, Usage};
pub use scope::{InvalidScope, Scope};
pub use storage::AccessStore;
