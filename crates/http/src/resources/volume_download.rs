//! `/v1/volumes/{id}/content` and `/v1/volumes/{id}/files`: the uploaded files, byte for byte.
//!
//! A volume of one file has `content`; every volume has `files/{name}`. The names are the store's: those that the
//! client gave may name a patient and are not kept. A file that may name the patient itself needs the scope
//! `submit`: that is every file but a NIfTI file that holds voxels, where they lie and nothing else.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{self, ConditionalHeaders, DownloadAnswers, LookupProblems};
use crate::resources::collection::find;
use crate::resources::files::{self, Download};
use crate::resources::volumes::{Volumes, media_type};
use crate::wire::links::path_of;
use crate::wire::problem::not_found::no_such_file;
use crate::wire::problem::{Answer, Problem};
use crate::wire::query::NoQuery;
use crate::wire::request::PathSegments;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use ventriform_service::base::records::{FileRecord, Resource, StoredVolume};
use ventriform_service::callers::Scope;

/// Download an upload
///
/// The uploaded file, byte for byte. A volume of several files has none; its files are listed in
/// the volume's JSON.
#[utoipa::path(get, path = "/v1/volumes/{id}/content", tag = "volumes",
    operation_id = "get_volume_content",
    params(("id" = String, Path, description = "The volume's id"), ConditionalHeaders),
    responses(openapi::OriginalAnswer, DownloadAnswers, openapi::ScopeProblems, LookupProblems))]
pub async fn download_volume(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
    headers: HeaderMap,
) -> Answer {
    let volume = find::<Volumes>(&app, &caller.tenant, &id).await?;
    match &volume.files[..] {
        [file] => send(&app, &caller, &volume, file, &headers).await,
        _ => Err(Problem::new(
            StatusCode::NOT_FOUND,
            "several-files",
            format!("The volume `{id}` has {} files.", volume.files.len()),
        )
        .fix(format!(
            "Download them one by one; GET {} lists them in `originals`.",
            path_of(&id)
        ))),
    }
}

/// Download one file of an upload
#[utoipa::path(get, path = "/v1/volumes/{id}/files/{name}", tag = "volumes",
    operation_id = "get_volume_file",
    params(("id" = String, Path, description = "The volume's id"),
        ("name" = String, Path, description = "The file's name, as the volume's JSON lists it"),
        ConditionalHeaders),
    responses(openapi::OriginalAnswer, DownloadAnswers, openapi::ScopeProblems, LookupProblems))]
pub async fn download_volume_file(
    State(app): State<App>,
    caller: Caller,
    PathSegments((id, name)): PathSegments<(String, String)>,
    _: NoQuery,
    headers: HeaderMap,
) -> Answer {
    let volume = find::<Volumes>(&app, &caller.tenant, &id).await?;
    match volume.files.iter().find(|file| file.name == name) {
        Some(file) => send(&app, &caller, &volume, file, &headers).await,
        None => {
            let first = volume.files.iter().take(10).map(|file| file.name.clone());
            let names: Vec<String> = first.collect();
            Err(no_such_file(Resource::Volume, &name, &names))
        }
    }
}

async fn send(
    app: &App,
    caller: &Caller,
    volume: &StoredVolume,
    file: &FileRecord,
    headers: &HeaderMap,
) -> Answer {
    if !caller.scope.includes(Scope::Submit) && !app.service.is_bare(volume, file).await? {
        caller.require(Scope::Submit)?;
    }
    let download = Download {
        id: &volume.id,
        record: file.clone(),
        path: format!("{}/files/{}", path_of(&volume.id), file.name),
        media_type: media_type(&file.name),
        attached: true,
    };
    files::send_file(app, &download, headers).await
}
