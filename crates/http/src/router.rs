//! The map of the API, and the layers around it.

use super::app::App;
use super::openapi::{self, DocumentFrame};
use crate::admin::audit;
use crate::admin::health;
use crate::admin::keys;
use crate::admin::webhooks;
use crate::dicomweb::intake_status;
use crate::dicomweb::stow;
use crate::dicomweb::workitems;
use crate::edge::front_page;
use crate::edge::guard::{self, hosts, pages};
use crate::edge::observe::{self, REQUEST_ID};
use crate::resources::beats;
use crate::resources::beats::Beats;
use crate::resources::collection;
use crate::resources::comparisons;
use crate::resources::comparisons::Comparisons;
use crate::resources::erasures;
use crate::resources::identities;
use crate::resources::jobs;
use crate::resources::legal_hold;
use crate::resources::models;
use crate::resources::models::Models;
use crate::resources::normals;
use crate::resources::normals::{NORMALS_SIZE, Normals};
use crate::resources::products;
use crate::resources::readers;
use crate::resources::readers::{PROFILE_SIZE, Readers};
use crate::resources::readings;
use crate::resources::readings::Readings;
use crate::resources::scan_erasures;
use crate::resources::segmentations;
use crate::resources::segmentations::Segmentations;
use crate::resources::serials;
use crate::resources::serials::Serials;
use crate::resources::templates;
use crate::resources::templates::{MESH_SIZE, Templates};
use crate::resources::volume_download;
use crate::resources::volumes;
use crate::resources::volumes::Volumes;
use crate::resources::voxels;
use crate::wire::document::PublishedDocuments;
use crate::wire::idempotency;
use crate::wire::limits::BodyLimits;
use crate::wire::problem::not_found::no_such_path;
use crate::wire::problem::{from_panic, method_not_allowed};
use crate::wire::webhook_request;
use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::http::{HeaderMap, header};
use axum::middleware;
use axum::routing::get;
use tower::ServiceBuilder;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::request_id::{PropagateRequestIdLayer, SetRequestIdLayer};
use tower_http::sensitive_headers::SetSensitiveRequestHeadersLayer;
use tower_http::trace::TraceLayer;
use utoipa::OpenApi;
use utoipa_axum::router::{OpenApiRouter, UtoipaMethodRouter, UtoipaMethodRouterExt};
use utoipa_axum::routes;
use ventriform_service::config::Settings;

/// Every documented route.
fn routes(settings: &Settings) -> OpenApiRouter<App> {
    let upload = || BodyLimits::of_uploads(settings).layers();
    let json = |size| BodyLimits::of_json(settings, size).layers();
    let of_every_kind = [
        // GET /v1/KINDS, GET and DELETE /v1/KINDS/{id}
        collection::routes::<Volumes>().to_vec(),
        collection::routes::<Models>().to_vec(),
        collection::routes::<Segmentations>().to_vec(),
        collection::routes::<Beats>().to_vec(),
        collection::routes::<Comparisons>().to_vec(),
        collection::routes::<Serials>().to_vec(),
        collection::routes::<Readings>().to_vec(),
        collection::routes::<Normals>().to_vec(),
        collection::routes::<Templates>().to_vec(),
        collection::routes::<Readers>().to_vec(),
        // GET /v1/KINDS/{id}/mesh, .../report and .../{file}
        products::routes::<Models>(),
        products::routes::<Segmentations>(),
        products::routes::<Beats>(),
        products::routes::<Comparisons>(),
        products::routes::<Serials>(),
        products::routes::<Readings>(),
        products::routes::<Normals>(),
        products::routes::<Templates>(),
        products::routes::<Readers>(),
    ];
    let of_one_kind: [UtoipaMethodRouter<App>; 45] = [
        routes!(volumes::create_volume).layer(upload()),
        routes!(volumes::preview_volume),
        routes!(voxels::download_voxels),
        routes!(scan_erasures::erase_volumes),
        routes!(volumes::update_volume).layer(json(settings.json_limit)),
        routes!(volume_download::download_volume),
        routes!(volume_download::download_volume_file),
        routes!(legal_hold::hold_volume).layer(json(settings.json_limit)),
        routes!(legal_hold::release_volume),
        routes!(identities::get_identity, identities::erase_identity),
        routes!(identities::state_identity).layer(json(settings.json_limit)),
        routes!(erasures::list_erasures),
        routes!(erasures::get_erasure),
        routes!(models::create_model).layer(upload()),
        routes!(segmentations::create_segmentation).layer(upload()),
        routes!(beats::create_beat).layer(upload()),
        routes!(comparisons::create_comparison).layer(upload()),
        routes!(serials::create_serial).layer(json(settings.json_limit)),
        routes!(readings::create_reading).layer(json(settings.json_limit)),
        routes!(normals::create_normals).layer(json(NORMALS_SIZE)),
        routes!(templates::create_template).layer(json(MESH_SIZE)),
        routes!(readers::create_reader).layer(json(PROFILE_SIZE)),
        routes!(templates::update_template).layer(json(settings.json_limit)),
        routes!(jobs::create_job).layer(json(settings.json_limit)),
        routes!(jobs::list_jobs),
        routes!(jobs::get_job, jobs::delete_job),
        routes!(jobs::update_job).layer(json(settings.json_limit)),
        routes!(jobs::events::follow_job),
        routes!(
            keys::create_key,
            keys::list_keys,
            keys::revoke_keys_of_owner
        )
        .layer(json(settings.json_limit)),
        routes!(keys::revoke_key),
        routes!(audit::list_audit_events),
        routes!(webhooks::create_webhook, webhooks::list_webhooks).layer(json(settings.json_limit)),
        routes!(webhooks::create_webhook_secret),
        routes!(webhooks::delete_webhook),
        routes!(webhooks::list_deliveries),
        routes!(webhooks::redeliver),
        routes!(stow::store_instances).layer(upload()),
        routes!(stow::store_study_instances).layer(upload()),
        routes!(intake_status::list_received),
        routes!(intake_status::forget_received),
        routes!(intake_status::show_receiving),
        routes!(workitems::create_workitem, workitems::search_workitems)
            .layer(json(settings.json_limit)),
        routes!(
            workitems::get_workitem,
            workitems::update_workitem,
            workitems::delete_workitem
        )
        .layer(json(settings.json_limit)),
        routes!(workitems::change_workitem_state).layer(json(settings.json_limit)),
        routes!(workitems::cancel_workitem).layer(json(settings.json_limit)),
    ];
    of_every_kind
        .into_iter()
        .flatten()
        .chain(of_one_kind)
        .fold(
            OpenApiRouter::with_openapi(DocumentFrame::openapi()),
            OpenApiRouter::routes,
        )
        .merge(operations())
}

/// The documented routes and the pages.
fn public(settings: &Settings) -> Router<App> {
    let (api, collected) = routes(settings).split_for_parts();
    let document = PublishedDocuments::new(openapi::publish(collected));
    api.route("/", get(front_page::welcome))
        .route(
            "/openapi.json",
            get(move |headers: HeaderMap| async move { document.answer(&headers) }),
        )
        .route("/docs", get(front_page::documentation))
        .route("/docs/", get(front_page::documentation))
        .route("/assets/{version}/{name}", get(front_page::asset))
        .route("/examples/{name}", get(front_page::example))
        .route("/favicon.ico", get(front_page::icon))
}

/// The document as it is published at `/openapi.json` and committed under `openapi/`.
pub fn document() -> serde_json::Value {
    openapi::publish(routes(&Settings::default()).split_for_parts().1)
}

/// Paths for operators, which every process answers.
fn operations() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(health::alive))
        .routes(routes!(health::ready))
        .routes(routes!(health::metrics))
}

/// The whole service, or what a worker serves of it.
pub fn router(app: App) -> Router {
    let api = if app.service.settings().role.serves() {
        public(app.service.settings())
    } else {
        operations().split_for_parts().0
    };
    let tls = app.service.settings().tls_cert.0.is_some();
    // A request passes the layers from top to bottom, its answer from bottom to top.
    let layers = ServiceBuilder::new()
        .layer(SetSensitiveRequestHeadersLayer::new([
            header::AUTHORIZATION,
            header::PROXY_AUTHORIZATION,
            header::COOKIE,
            idempotency::KEY_HEADER,
            webhook_request::SECRET_HEADER,
        ]))
        .map_request(observe::drop_unusable_id)
        .layer(SetRequestIdLayer::new(REQUEST_ID, observe::TimeOrderedId))
        .layer(PropagateRequestIdLayer::new(REQUEST_ID))
        .layer(middleware::from_fn_with_state(
            app.clone(),
            observe::measure,
        ))
        .layer(
            TraceLayer::new_for_http()
                .make_span_with(observe::RequestSpan)
                .on_request(())
                .on_response(observe::Answered)
                .on_eos(())
                .on_failure(()),
        )
        .layer(CatchPanicLayer::custom(from_panic))
        .map_response(move |response| pages::protected(response, tls))
        .layer(middleware::from_fn_with_state(
            app.guard.hosts.clone(),
            hosts::check_host,
        ))
        // The routes that take a body have limits of their own.
        .layer(DefaultBodyLimit::disable());
    let api = api
        .fallback(no_such_path)
        .method_not_allowed_fallback(method_not_allowed)
        .layer(middleware::from_fn_with_state(app.clone(), guard::guard));
    // Browsers send preflights without credentials, so this stands before the guard.
    let api = match pages::cors(app.service.settings()) {
        Some(cors) => api.layer(cors),
        None => api,
    };
    api.layer(layers).with_state(app)
}
