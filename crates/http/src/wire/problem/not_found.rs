//! Answers about missing things: 404 for what never was, 410 for what was erased, and 422 when a field of
//! an otherwise good request names such a thing.

use super::{Problem, shorten};
use crate::app::App;
use crate::wire::links::rfc3339;
use axum::http::StatusCode;
use ventriform_service::base::records::{Resource, Tenant, Timestamp};

/// 410 if the tenant erased `id`, else 404.
pub async fn missing(app: &App, tenant: &Tenant, resource: Resource, id: &str) -> Problem {
    match app.service.erased_at(tenant, id).await {
        Ok(Some(at)) if Resource::from_id(id) == Some(resource) => erased(resource, id, at),
        Ok(_) => unknown_id(resource, id),
        Err(error) => error.into(),
    }
}

fn unknown_id(resource: Resource, id: &str) -> Problem {
    Problem::new(
        StatusCode::NOT_FOUND,
        "not-found",
        format!("There is no {} `{}`.", resource.label(), shorten(id)),
    )
    .fix(format!(
        "Take an id from the list at GET /v1/{}.",
        resource.plural()
    ))
}

fn erased(resource: Resource, id: &str, at: Timestamp) -> Problem {
    let fix = match resource {
        Resource::Volume => "Upload the same file again; it gets the same id.",
        Resource::Model
        | Resource::Segmentation
        | Resource::Beat
        | Resource::Comparison
        | Resource::Serial => {
            "Send the same volume with the same parameters again; the result gets the same id."
        }
        Resource::Reading => "Read the result again.",
        Resource::Normals => {
            "Add the same file, or build the same cohort again; it gets the same id."
        }
        Resource::Template => "Add the same mesh again; it gets the same id.",
        Resource::Reader => "Add the same profile again; it gets the same id.",
        Resource::Job => "File a new job.",
    };
    Problem::new(
        StatusCode::GONE,
        "gone",
        format!(
            "The {} `{id}` was erased at {}.",
            resource.label(),
            rfc3339(at)
        ),
    )
    .fix(fix)
}

/// 404: a thing that exists has no file of that name; `names` are those it has.
pub fn no_such_file(resource: Resource, name: &str, names: &[String]) -> Problem {
    Problem::new(
        StatusCode::NOT_FOUND,
        "not-found",
        format!("This {} has no file `{}`.", resource.label(), shorten(name)),
    )
    .fix(format!("Ask for one of {}.", names.join(", ")))
}

/// 404: there is no receipt of an erasure with this id.
pub fn no_receipt(id: &str) -> Problem {
    Problem::new(
        StatusCode::NOT_FOUND,
        "not-found",
        format!("There is no receipt `{}`.", shorten(id)),
    )
    .fix("Take an id from the list at GET /v1/erasures.")
}

/// 404: no route has this path.
pub async fn no_such_path() -> Problem {
    Problem::new(
        StatusCode::NOT_FOUND,
        "no-such-path",
        "The API has no such path.",
    )
    .fix("GET /openapi.json lists all paths; /docs shows them in a browser.")
}
