//! The service as a whole: settings, then stores and the HTTP client, then the HTTP service on them.

use std::net::TcpListener;
use std::sync::Arc;
use ventriform_http::{Running, ServeError};
use ventriform_http_client::ReqwestFactory;
use ventriform_service::config::Settings;
use ventriform_service::work::Engine;
use ventriform_store::{S3Location, Store, StoreSettings};

/// Starts the service on a bound listener.
///
/// # Errors
/// If the data folder is in use or unusable, or the system refuses threads or sockets.
pub async fn start(
    settings: Settings,
    engine: Engine,
    listener: TcpListener,
) -> Result<Running, ServeError> {
    let folder = settings.data_dir.clone();
    let stores = store_settings(&settings);
    let open = async move {
        let store = Store::open_with(&folder, stores).await;
        store.map(Store::into_stores)
    };
    ventriform_http::start(settings, engine, listener, open, Arc::new(ReqwestFactory)).await
}

/// Where the files are, if not in the data folder.
pub fn s3_location(settings: &Settings) -> Option<S3Location> {
    let (bucket, prefix) = settings.blobs.bucket()?;
    Some(S3Location {
        bucket: bucket.to_owned(),
        prefix: prefix.to_owned(),
        variables: settings.aws.0.clone(),
    })
}

/// The settings of a store.
pub fn store_settings(settings: &Settings) -> StoreSettings {
    StoreSettings {
        min_free: settings.min_free.0.map(|size| size.0),
        write_wait: settings.write_wait.0,
        database: settings.postgres(),
        s3: s3_location(settings),
        cache: settings.blob_cache.0,
    }
}
