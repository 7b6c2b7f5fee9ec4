//! A cache of answers that holds until the next write to the database.
//!
//! Values read about an item (its row, the JSON made of it) follow from the database and the
//! settings. They are kept under the tenant that asked and the id, with the version of the database
//! ([`Service::version`]) under which they were read. Whatever is written changes the
//! version, and what was kept under other versions is never used: neither what was erased, changed or
//! put on hold meanwhile, nor what another tenant has. Callers who see whose scan a volume is have
//! values of their own, and so have clients who reach the service under another path.
//!
//! Memory is limited: when there is no room for one more, all are dropped.

use crate::wire::problem::Answer;
use crate::wire::public_base::public_path;
use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};
use ventriform_service::base::records::{Resource, Tenant};
use ventriform_service::use_cases::service::Service;

/// Memory for a value's place in the maps.
const ENTRY_OVERHEAD_BYTES: usize = 200;

/// The tenant of a caller, and whether the caller sees whose scan a volume is.
pub type Asker<'a> = (&'a Tenant, bool);

/// A value that can be kept.
pub trait Keep: Clone {
    /// Memory that it takes, about.
    fn bytes(&self) -> usize;
}

/// See the module.
pub struct ResponseCache<V> {
    limit: usize,
    values: Mutex<Values<V>>,
}

struct Values<V> {
    version: u64,
    bytes: usize,
    /// For callers who do not see whose scan it is, and for those who do.
    by_tenant: [HashMap<Tenant, HashMap<String, V>>; 2],
}

impl<V> Values<V> {
    fn drop_all(&mut self) {
        self.bytes = 0;
        self.by_tenant.iter_mut().for_each(HashMap::clear);
    }
}

impl<V: Keep> ResponseCache<V> {
    /// Keeps values of at most `limit` bytes together.
    pub fn new(limit: usize) -> Self {
        Self {
            limit,
            values: Mutex::new(Values {
                version: 0,
                bytes: 0,
                by_tenant: Default::default(),
            }),
        }
    }

    /// The answer about a tenant's item: the kept value, or what `read` makes. `read` gives a value
    /// that follows from the database alone, which is kept, or breaks off with one that is not.
    ///
    /// # Errors
    /// Those of `read`.
    pub async fn get<B>(
        &self,
        service: &Service,
        asker: Asker<'_>,
        resource: Resource,
        id: &str,
        read: impl AsyncFnOnce() -> Answer<ControlFlow<B, V>>,
    ) -> Answer<ControlFlow<B, V>> {
        let version = service.version();
        if Resource::from_id(id) == Some(resource)
            && let Some(version) = version
            && let Some(value) = self.find(version, asker, &public_path(id))
        {
            return Ok(ControlFlow::Continue(value));
        }
        let found = read().await?;
        if let ControlFlow::Continue(value) = &found
            && let Some(version) = version
            && service.version() == Some(version)
        {
            self.keep(version, asker, &public_path(id), value);
        }
        Ok(found)
    }

    /// The value for a caller of that tenant who sees patients or not, if it was kept under that
    /// version.
    fn find(&self, version: u64, (tenant, patients): Asker<'_>, id: &str) -> Option<V> {
        let values = self.values.lock().unwrap_or_else(PoisonError::into_inner);
        if values.version != version {
            return None;
        }
        let by_tenant = &values.by_tenant[usize::from(patients)];
        by_tenant.get(tenant)?.get(id).cloned()
    }

    /// Keeps a value that was made of what was read under that version.
    fn keep(&self, version: u64, (tenant, patients): Asker<'_>, id: &str, value: &V) {
        let bytes = value.bytes() + id.len() + ENTRY_OVERHEAD_BYTES;
        let mut values = self.values.lock().unwrap_or_else(PoisonError::into_inner);
        if version < values.version || bytes > self.limit {
            return;
        }
        if version > values.version || values.bytes + bytes > self.limit {
            values.drop_all();
            values.version = version;
        }
        let by_tenant = &mut values.by_tenant[usize::from(patients)];
        let of_tenant = by_tenant.entry(tenant.clone()).or_default();
        if of_tenant.insert(id.to_owned(), value.clone()).is_none() {
            values.bytes += bytes;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::validators::ValidatedJson;

    #[test]
    fn a_value_is_used_for_its_tenant_and_version_only() {
        let (a, b): (Tenant, Tenant) = ("a".parse().unwrap(), "b".parse().unwrap());
        let answer = ValidatedJson::from_body(&"1").unwrap();
        let kept = ResponseCache::new(10_000);
        kept.keep(2, (&a, true), "vol_1", &answer);
        assert!(kept.find(2, (&a, true), "vol_1").is_some());
        assert!(kept.find(2, (&b, true), "vol_1").is_none());
        assert!(kept.find(2, (&a, false), "vol_1").is_none());
        assert!(kept.find(2, (&a, true), "vol_2").is_none());
        assert!(kept.find(4, (&a, true), "vol_1").is_none());
        kept.keep(4, (&b, true), "vol_1", &answer);
        assert!(kept.find(4, (&a, true), "vol_1").is_none());
        kept.keep(2, (&a, true), "vol_1", &answer);
        assert!(kept.find(2, (&a, true), "vol_1").is_none(), "too late");
        assert!(kept.find(4, (&b, true), "vol_1").is_some());
    }

    #[test]
    fn memory_is_limited() {
        let tenant = Tenant::default();
        let answer = ValidatedJson::from_body(&"x".repeat(1000)).unwrap();
        let kept = ResponseCache::new(10_000);
        for number in 0..1000 {
            kept.keep(0, (&tenant, true), &number.to_string(), &answer);
            assert!(kept.find(0, (&tenant, true), &number.to_string()).is_some());
            assert!(kept.values.lock().unwrap().bytes <= 10_000);
        }
        let held = kept.values.lock().unwrap();
        let count = held.by_tenant[1][&tenant].len();
        assert_eq!(held.bytes, {
            let bytes = |id: &String| answer.bytes() + id.len() + ENTRY_OVERHEAD_BYTES;
            held.by_tenant[1][&tenant].keys().map(bytes).sum::<usize>()
        });
        assert!((2..10).contains(&count), "{count}");
        drop(held);
        ResponseCache::new(100).keep(0, (&tenant, true), "vol_1", &answer);
    }
}
