//! The map of the API.

use super::app::App;
use super::openapi::Document;
use super::problem::{Problem, from_panic};
use super::{events, health, jobs, models, observe, pages, segmentations, templates, volumes};
use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::middleware;
use axum::routing::get;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::set_header::SetResponseHeaderLayer;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use utoipa_swagger_ui::SwaggerUi;

/// Every documented route.
pub fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::with_openapi(Document::openapi())
        .routes(routes!(volumes::create_volume, volumes::list_volumes))
        .routes(routes!(volumes::get_volume, volumes::delete_volume))
        .routes(routes!(volumes::preview_volume))
        .routes(routes!(jobs::create_job, jobs::list_jobs))
        .routes(routes!(jobs::get_job, jobs::delete_job))
        .routes(routes!(events::follow_job))
        .routes(routes!(models::create_model, models::list_models))
        .routes(routes!(models::get_model, models::delete_model))
        .routes(routes!(models::get_mesh))
        .routes(routes!(models::get_report))
        .routes(routes!(models::get_file))
        .routes(routes!(
            segmentations::create_segmentation,
            segmentations::list_segmentations
        ))
        .routes(routes!(
            segmentations::get_segmentation,
            segmentations::delete_segmentation
        ))
        .routes(routes!(segmentations::get_mesh))
        .routes(routes!(segmentations::get_report))
        .routes(routes!(segmentations::get_file))
        .routes(routes!(
            templates::create_template,
            templates::list_templates
        ))
        .routes(routes!(templates::get_template, templates::delete_template))
        .routes(routes!(templates::get_mesh))
        .routes(routes!(templates::get_file))
        .routes(routes!(health::alive))
        .routes(routes!(health::ready))
        .routes(routes!(health::metrics))
}

/// The whole service.
pub fn router(app: App) -> Router {
    let (api, _) = routes().split_for_parts();
    let document = axum::Json(super::openapi::document());
    api.route("/", get(pages::welcome))
        .route(
            "/openapi.json",
            get(move || async move { document.clone() }),
        )
        .merge(SwaggerUi::new("/docs").config(utoipa_swagger_ui::Config::from("/openapi.json")))
        .fallback(nothing_here)
        .method_not_allowed_fallback(not_that_way)
        // `upload` and `request` count for themselves, against the operator's limits.
        .layer(DefaultBodyLimit::disable())
        .layer(SetResponseHeaderLayer::if_not_present(
            header::X_CONTENT_TYPE_OPTIONS,
            HeaderValue::from_static("nosniff"),
        ))
        .layer(CatchPanicLayer::custom(from_panic))
        .layer(middleware::from_fn_with_state(
            app.clone(),
            observe::observe,
        ))
        .with_state(app)
}

async fn nothing_here() -> Problem {
    Problem::new(
        StatusCode::NOT_FOUND,
        "no-such-path",
        "There is nothing under this path.",
    )
    .fix("GET /openapi.json lists the paths; /docs shows them.")
}

async fn not_that_way(method: Method) -> Problem {
    Problem::new(
        StatusCode::METHOD_NOT_ALLOWED,
        "method-not-allowed",
        format!("{method} is not possible here."),
    )
    .fix("Use one of the methods in Allow.")
}
