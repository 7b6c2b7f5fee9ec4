//! What a job says of archives: the series that its volume comes from, and what of its result is
//! sent where.

use crate::app::App;
use crate::problem::{Answer, Problem, shorten};
use crate::request::{text, unknown};
use serde_json::{Map, Value};
use ventriform::export::dicom::is_uid;
use ventriform_service::records::{Resource, SendOrder, SeriesSource, Tenant};
use ventriform_service::work::dicom;

/// The fields of `source`.
const FIELDS: [&str; 4] = ["archive", "dicomweb", "study", "series"];

/// The series in the field `source` of a job.
///
/// # Errors
/// 422 that names the part which cannot be used.
pub async fn source_of(
    app: &App,
    tenant: &Tenant,
    object: &Map<String, Value>,
) -> Answer<Option<SeriesSource>> {
    let given = match object.get("source") {
        None => return Ok(None),
        Some(Value::Object(given)) => given,
        Some(_) => {
            return Err(
                Problem::invalid_field("source", "`source` must be a JSON object.").fix(
                    "Give an object such as {\"archive\": \"pacs\", \"study\": UID, \"series\": UID}.",
                ),
            );
        }
    };
    let source = read(app, tenant, given).await;
    source.map(Some).map_err(|problem| problem.within("source"))
}

async fn read(app: &App, tenant: &Tenant, given: &Map<String, Value>) -> Answer<SeriesSource> {
    if let Some(name) = given.keys().find(|name| !FIELDS.contains(&name.as_str())) {
        return Err(unknown("field", name, &FIELDS));
    }
    let (archive, dicomweb) = match (text(given, "archive")?, text(given, "dicomweb")?) {
        (Some(name), None) => (Some(with_dicomweb(app, tenant, name)?), None),
        (None, Some(url)) => match app.settings.archives.at(url, tenant) {
            Some(archive) => (Some(archive.name.clone()), None),
            None => (None, Some(allowed(app, url).await?)),
        },
        (None, None) => {
            return Err(
                Problem::invalid_field("archive", "The source names no archive.")
                    .fix(known(app, tenant)),
            );
        }
        (Some(_), Some(_)) => {
            let both = "A source has an `archive` or a `dicomweb`, not both.";
            return Err(Problem::invalid_field("dicomweb", both).fix("Leave one of them out."));
        }
    };
    Ok(SeriesSource {
        archive,
        dicomweb,
        study: uid(given, "study")?,
        series: uid(given, "series")?,
    })
}

fn uid(given: &Map<String, Value>, field: &str) -> Answer<String> {
    let text = text(given, field)?;
    let wrong = match text {
        Some(text) if is_uid(text) => return Ok(text.to_owned()),
        Some(_) => "is no DICOM UID",
        None => "is missing",
    };
    let problem = Problem::invalid_field(field, format!("`{field}` {wrong}."));
    Err(problem.fix(
        "Give the Study and Series Instance UID: numbers separated by dots, at most 64 characters.",
    ))
}

/// The name of an archive from which can be fetched.
fn with_dicomweb(app: &App, tenant: &Tenant, name: &str) -> Answer<String> {
    match app.settings.archives.named(name, tenant) {
        Some(archive) if archive.dicomweb.is_some() => Ok(name.to_owned()),
        Some(_) => Err(Problem::invalid_field(
            "archive",
            format!("Nothing can be fetched from the archive `{name}`: it has no DICOMweb."),
        )
        .fix("Let it send the series by C-STORE, or ask the operator to set its `dicomweb`.")),
        None => Err(no_archive("archive", app, tenant, name)),
    }
}

/// A URL for which no archive is configured, if the operator allows it.
async fn allowed(app: &App, url: &str) -> Answer<String> {
    match app.archives.guard.check(url).await {
        Ok(_) if url.contains('?') => Err(Problem::invalid_field(
            "dicomweb",
            "The base URL of a DICOMweb service has no query.",
        )
        .fix("Leave out what begins with `?`.")),
        Ok(_) => Ok(url.trim_end_matches('/').to_owned()),
        Err(refusal) => Err(Problem::invalid_field(
            "dicomweb",
            format!("Nothing can be fetched from there. {refusal}"),
        )
        .fix(
            "Name a configured archive, or ask the operator for an entry in `[[archives]]` or in \
             `dicomweb_allow`.",
        )),
    }
}

/// What is to be sent to an archive, from the fields `send` and `to` of a job of that kind.
///
/// # Errors
/// 422 that names the field which cannot be used.
pub fn send_of(
    app: &App,
    tenant: &Tenant,
    object: &Map<String, Value>,
    kind: &str,
    source: Option<&SeriesSource>,
) -> Answer<Option<SendOrder>> {
    let to = text(object, "to")?;
    let names = match object.get("send") {
        None if to.is_none() => return Ok(None),
        None => {
            let alone = "`to` is given without `send`.";
            return Err(Problem::invalid_field("send", alone).fix(sendable_fix(kind)));
        }
        Some(names) => serde_json::from_value::<Vec<String>>(names.clone()).map_err(|_| {
            Problem::invalid_field("send", "`send` must be a list of names.")
                .fix(sendable_fix(kind))
        })?,
    };
    let known = sendable(kind);
    for (number, name) in names.iter().enumerate() {
        let wrong = match known.contains(&name.as_str()) {
            true if !names[..number].contains(name) => continue,
            true => format!("`{name}` is named twice."),
            false => format!("A {kind} has no DICOM object `{}`.", shorten(name)),
        };
        return Err(Problem::invalid_field("send", wrong).fix(sendable_fix(kind)));
    }
    if names.is_empty() {
        return Err(Problem::invalid_field("send", "`send` is empty.").fix(sendable_fix(kind)));
    }
    let to = to.or(source.and_then(|source| source.archive.as_deref()));
    let to = to.ok_or_else(|| {
        Problem::invalid_field("to", "It is not said where to send.").fix(self::known(app, tenant))
    })?;
    if app.settings.archives.named(to, tenant).is_none() {
        return Err(no_archive("to", app, tenant, to));
    }
    Ok(Some(SendOrder {
        names,
        to: to.to_owned(),
    }))
}

/// The names of the DICOM objects that a result of that kind has.
fn sendable(kind: &str) -> Vec<&'static str> {
    let kind = Resource::ALL.into_iter().find(|known| known.noun() == kind);
    let all = kind.map(dicom::objects).unwrap_or_default();
    all.iter().map(|object| object.file_name()).collect()
}

fn sendable_fix(kind: &str) -> String {
    format!("Give some of {}.", sendable(kind).join(", "))
}

fn no_archive(field: &str, app: &App, tenant: &Tenant, name: &str) -> Problem {
    let detail = format!("There is no archive `{}`.", shorten(name));
    Problem::invalid_field(field, detail).fix(known(app, tenant))
}

fn known(app: &App, tenant: &Tenant) -> String {
    let archives = app.settings.archives.of(tenant);
    let names: Vec<&str> = archives.map(|archive| archive.name.as_str()).collect();
    match names.is_empty() {
        true => "No archive is configured: ask the operator for an entry in `[[archives]]`.".into(),
        false => format!("Known archives: {}.", names.join(", ")),
    }
}
