//! Tenants: what belongs to one does not exist for another.

use serde_json::json;
use ventriform::jobs::Catalogue;
use ventriform::jobs::{Filed, Idempotency, JobStore, NewJob, StoredVolume, Tenant};
use ventriform::store::Store;

#[tokio::test]
async fn an_idempotency_key_is_its_tenants_own() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let volume = StoredVolume {
        id: "vol_1".into(),
        sequence: 0,
        created_at: 0,
        bytes: 1,
        files: Vec::new(),
        facts: json!({}),
    };
    store.rows.add_volume(&volume).await.unwrap();
    let order = |tenant: &str| NewJob {
        tenant: tenant.parse().unwrap(),
        kind: "model".into(),
        volume: "vol_1".into(),
        needs: Default::default(),
        parameters: Default::default(),
        idempotency: Some(Idempotency {
            key: "k".into(),
            fingerprint: "f".into(),
        }),
        webhook: None,
        trace_parent: None,
    };
    let file = async |tenant: &str| store.rows.file(&order(tenant), 10, 0).await.unwrap();
    let Filed::New(first) = file("a").await else {
        panic!("not filed");
    };
    let Filed::Same(again) = file("a").await else {
        panic!("not recognised");
    };
    let Filed::New(other) = file("b").await else {
        panic!("another tenant's key was met");
    };
    assert_eq!(first.id, again.id);
    assert_ne!(first.id, other.id);
    assert_eq!(other.tenant, "b".parse::<Tenant>().unwrap());
}
