//! The fields `source`, `send` and `to` of a job: the series that its volume comes from, and the objects of its result
//! that are sent to an archive.

use crate::app::App;
use crate::wire::problem::{Answer, Problem};
use crate::wire::request::{text, unknown};
use serde_json::{Map, Value};
use ventriform_service::base::records::{SendOrder, SeriesSource, Tenant};
use ventriform_service::use_cases::series::{GivenSeries, sendable_fix};

/// The fields of `source`.
const SOURCE_FIELDS: [&str; 4] = ["archive", "dicomweb", "study", "series"];

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
    let given = given_series(given).map_err(|problem| problem.within("source"))?;
    let source = app.service.series_source(tenant, given).await;
    Ok(Some(source.map_err(|failure| failure.within("source"))?))
}

fn given_series(given: &Map<String, Value>) -> Answer<GivenSeries<'_>> {
    if let Some(name) = given
        .keys()
        .find(|name| !SOURCE_FIELDS.contains(&name.as_str()))
    {
        return Err(unknown("field", name, &SOURCE_FIELDS));
    }
    Ok(GivenSeries {
        archive: text(given, "archive")?,
        dicomweb: text(given, "dicomweb")?,
        study: text(given, "study")?,
        series: text(given, "series")?,
    })
}

/// The order in the fields `send` and `to` of a job of that kind.
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
    let names = object.get("send").map(|names| {
        serde_json::from_value(names.clone()).map_err(|_| {
            Problem::invalid_field("send", "`send` must be a list of names.")
                .fix(sendable_fix(kind))
        })
    });
    let send = app
        .service
        .send_order(tenant, kind, names.transpose()?, to, source);
    Ok(send?)
}
