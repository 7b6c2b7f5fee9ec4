//! Answers about single items, kept until anything is written.
//!
//! The JSON of an item follows from the database and the settings. It is kept under the tenant that
//! asked and the id, with the version of the database ([`crate::jobs::Catalogue::version`]) under
//! which it was read. Whatever is written changes the version, and answers of other versions are
//! never used: neither what was erased, changed or put on hold meanwhile, nor what another tenant
//! has. Callers who see whose scan a volume is have answers of their own.
//!
//! Memory is limited: when there is no room for one more, all are dropped.

use super::problem::Answer;
use super::validators::ValidatedJson;
use crate::jobs::{Catalogue, Resource, Tenant};
use axum::http::HeaderMap;
use axum::response::Response;
use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

/// Memory for an answer's place in the maps.
const OVERHEAD: usize = 200;

/// The tenant of a caller, and whether the caller sees whose scan a volume is.
pub type Asker<'a> = (&'a Tenant, bool);

/// See the module.
pub struct KeptAnswers {
    limit: usize,
    kept: Mutex<Kept>,
}

#[derive(Default)]
struct Kept {
    version: u64,
    bytes: usize,
    /// For callers who do not see whose scan it is, and for those who do.
    by_tenant: [HashMap<Tenant, HashMap<String, ValidatedJson>>; 2],
}

impl Kept {
    fn drop_all(&mut self) {
        self.bytes = 0;
        self.by_tenant.iter_mut().for_each(HashMap::clear);
    }
}

impl KeptAnswers {
    /// Keeps answers of at most `limit` bytes together.
    pub fn new(limit: usize) -> Self {
        Self {
            limit,
            kept: Mutex::default(),
        }
    }

    /// The answer about a tenant's item: the kept one, or what `read` makes. `read` gives JSON that
    /// follows from the database alone, which is kept, or breaks off with an answer that is not.
    ///
    /// # Errors
    /// Those of `read`.
    pub async fn answer(
        &self,
        catalogue: &dyn Catalogue,
        asker: Asker<'_>,
        resource: Resource,
        id: &str,
        headers: &HeaderMap,
        read: impl AsyncFnOnce() -> Answer<ControlFlow<Response, ValidatedJson>>,
    ) -> Answer {
        let version = catalogue.version();
        if Resource::of(id) == Some(resource)
            && let Some(version) = version
            && let Some(answer) = self.get(version, asker, id)
        {
            return Ok(answer.answer(headers));
        }
        let answer = match read().await? {
            ControlFlow::Continue(answer) => answer,
            ControlFlow::Break(answer) => return Ok(answer),
        };
        if let Some(version) = version
            && catalogue.version() == Some(version)
        {
            self.keep(version, asker, id, &answer);
        }
        Ok(answer.answer(headers))
    }

    /// The answer about an item for a caller of that tenant who sees patients or not, if it was kept
    /// under that version.
    fn get(&self, version: u64, (tenant, patients): Asker<'_>, id: &str) -> Option<ValidatedJson> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.version != version {
            return None;
        }
        let by_tenant = &kept.by_tenant[usize::from(patients)];
        by_tenant.get(tenant)?.get(id).cloned()
    }

    /// Keeps an answer that was made of what was read under that version.
    fn keep(&self, version: u64, (tenant, patients): Asker<'_>, id: &str, answer: &ValidatedJson) {
        let bytes = answer.bytes() + id.len() + OVERHEAD;
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if version < kept.version || bytes > self.limit {
            return;
        }
        if version > kept.version || kept.bytes + bytes > self.limit {
            kept.drop_all();
            kept.version = version;
        }
        let by_tenant = &mut kept.by_tenant[usize::from(patients)];
        let of_tenant = by_tenant.entry(tenant.clone()).or_default();
        if of_tenant.insert(id.to_owned(), answer.clone()).is_none() {
            kept.bytes += bytes;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_used_for_its_tenant_and_version_only() {
        let (a, b): (Tenant, Tenant) = ("a".parse().unwrap(), "b".parse().unwrap());
        let answer = ValidatedJson::of(&"1").unwrap();
        let kept = KeptAnswers::new(10_000);
        kept.keep(2, (&a, true), "vol_1", &answer);
        assert!(kept.get(2, (&a, true), "vol_1").is_some());
        assert!(kept.get(2, (&b, true), "vol_1").is_none());
        assert!(kept.get(2, (&a, false), "vol_1").is_none());
        assert!(kept.get(2, (&a, true), "vol_2").is_none());
        assert!(kept.get(4, (&a, true), "vol_1").is_none());
        kept.keep(4, (&b, true), "vol_1", &answer);
        assert!(kept.get(4, (&a, true), "vol_1").is_none());
        kept.keep(2, (&a, true), "vol_1", &answer);
        assert!(kept.get(2, (&a, true), "vol_1").is_none(), "too late");
        assert!(kept.get(4, (&b, true), "vol_1").is_some());
    }

    #[test]
    fn memory_is_limited() {
        let tenant = Tenant::default();
        let answer = ValidatedJson::of(&"x".repeat(1000)).unwrap();
        let kept = KeptAnswers::new(10_000);
        for number in 0..1000 {
            kept.keep(0, (&tenant, true), &number.to_string(), &answer);
            assert!(kept.get(0, (&tenant, true), &number.to_string()).is_some());
            assert!(kept.kept.lock().unwrap().bytes <= 10_000);
        }
        let held = kept.kept.lock().unwrap();
        let count = held.by_tenant[1][&tenant].len();
        assert_eq!(held.bytes, {
            let bytes = |id: &String| answer.bytes() + id.len() + OVERHEAD;
            held.by_tenant[1][&tenant].keys().map(bytes).sum::<usize>()
        });
        assert!((2..10).contains(&count), "{count}");
        drop(held);
        KeptAnswers::new(100).keep(0, (&tenant, true), "vol_1", &answer);
    }
}
