//! A tenant's own names for volumes and jobs: `external_id` and labels, given with a request,
//! changed by a JSON merge patch (RFC 7396), and searched by.
//!
//! In a query string or a form: `external_id=A1` and `labels=study:42`, the latter repeated. In
//! JSON: `"external_id": "A1"` and `"labels": {"study": "42"}`. Shown to callers who see whose scan a volume is
//! ([`shown`]).

use crate::app::App;
use crate::edge::caller::Caller;
use crate::resources::scans;
use crate::wire::fields::FieldReader;
use crate::wire::job_fields::{EXTERNAL_ID_LENGTH, LABEL_VALUE_LENGTH, TagFields};
use crate::wire::memory::end_rows;
use crate::wire::problem::{Answer, Problem, shorten};
use axum::extract::Request;
use futures::future::BoxFuture;
use serde::Deserialize;
use std::collections::BTreeMap;
use utoipa::{IntoParams, ToSchema};
use ventriform::base::text::is_printable;
use ventriform_service::base::error::ServiceError;
use ventriform_service::base::records::{TagFilter, Tags};
use ventriform_service::callers::Scope;

/// Longest name of a label, characters.
const LABEL_NAME_LENGTH: usize = 64;

/// The names that this module reads: parameters of a query string or form, fields of a JSON object. (`label`
/// is a parameter of models: the label of an object in a label map.)
pub const TAG_FIELDS: [&str; 2] = ["external_id", "labels"];

/// The tags of a request or of a search, in a query string or a form.
#[derive(Default, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct TagQuery {
    /// The id in the caller's own system
    #[param(pattern = "^.{1,128}$")]
    external_id: Option<String>,
    /// A name and a value with a colon between them; repeat for several
    #[serde(default)]
    #[param(inline, style = Form, explode = true, max_items = 16)]
    labels: Vec<LabelText>,
}

#[derive(Deserialize, ToSchema)]
#[serde(transparent)]
#[schema(pattern = "^[A-Za-z0-9_./-]{1,64}:.{1,256}$", examples("study:42"))]
struct LabelText(String);

impl TagQuery {
    /// The tags that were given with a request.
    ///
    /// # Errors
    /// 422 if they are malformed or too many, 400 if the name of a label is given twice.
    pub fn tags(self, app: &App) -> Answer<Tags> {
        let external_id = self.external_id.as_deref().map(external_id).transpose()?;
        let mut labels = BTreeMap::new();
        for LabelText(text) in &self.labels {
            let (name, value) = label(text)?;
            if labels.insert(name, value).is_some() {
                return Err(Problem::bad_request(
                    "repeated-parameter",
                    "A label is given more than once.",
                )
                .at("labels")
                .fix("Give each name only once."));
            }
        }
        limit_labels(app, &labels)?;
        Ok(Tags {
            external_id,
            labels,
        })
    }

    /// The tags that are searched for.
    ///
    /// # Errors
    /// 400 where [`TagQuery::tags`] has 422.
    pub fn filter(self, app: &App) -> Answer<TagFilter> {
        let tags = self.tags(app).map_err(Problem::of_search)?;
        Ok(TagFilter {
            external_id: tags.external_id,
            labels: tags.labels,
        })
    }
}

/// The tags that callers of that scope see. People name volumes after patients and their files, so these go with whose scan
/// a volume is; who does not see them may search by them.
pub fn shown(tags: Tags, scope: Scope) -> Tags {
    match scans::sees_patients(scope) {
        true => tags,
        false => Tags::default(),
    }
}

impl TagFields {
    /// The tags after these changes of them: what is `null` goes, what is absent stays.
    ///
    /// # Errors
    /// 422 if they are malformed or too many.
    pub fn merged(&self, app: &App, mut tags: Tags) -> Answer<Tags> {
        if let Some(id) = &self.external_id {
            tags.external_id = id.as_deref().map(external_id).transpose()?;
        }
        match &self.labels {
            None => {}
            Some(None) => tags.labels.clear(),
            Some(Some(labels)) => {
                for (name, value) in labels {
                    let name = label_name(name)?;
                    match value {
                        None => tags.labels.remove(&name),
                        Some(text) => tags.labels.insert(name, label_value(text)?),
                    };
                }
            }
        }
        limit_labels(app, &tags.labels)?;
        Ok(tags)
    }
}

/// Attempts at a change of tags that others come before. Each time, one of the others has been made.
const CHANGE_TRIES: usize = 100;

/// Applies the JSON merge patch of a request to the tags of a tenant's item or job, as `tags_of` reads them. The body is
/// read first, so that nothing of the item is held while it comes; a change that comes between is read and merged anew.
///
/// # Errors
/// Those of [`FieldReader::read_patch`], [`FieldReader::all`], `tags_of` and [`TagFields::merged`], 503 if others change the tags all the time, 503 or 507 if the storage
/// fails.
pub async fn change<'a>(
    app: &App,
    caller: &Caller,
    id: &str,
    request: Request,
    tags_of: impl Fn() -> BoxFuture<'a, Answer<Tags>>,
) -> Answer<()> {
    let patch: TagFields = FieldReader::read_patch(app, request).await?.all()?;
    for _ in 0..CHANGE_TRIES {
        let before = tags_of().await?;
        let after = patch.merged(app, before.clone())?;
        // The tags are a small part of the row.
        end_rows(0).await;
        let changed = app.service.change_tags(&caller.by, id, before, after);
        if changed.await? {
            return Ok(());
        }
    }
    Err(ServiceError::contended("these tags").into())
}

fn external_id(text: &str) -> Answer<String> {
    printable("external_id", "`external_id`", text, EXTERNAL_ID_LENGTH)
}

/// `name:value`
fn label(text: &str) -> Answer<(String, String)> {
    let Some((name, value)) = text.split_once(':') else {
        return Err(Problem::invalid_field(
            "labels",
            format!("`{}` is not a label.", shorten(text)),
        )
        .fix("Give name and value with a colon between them, such as study:42."));
    };
    Ok((label_name(name)?, label_value(value)?))
}

fn label_name(text: &str) -> Answer<String> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
    if (1..=LABEL_NAME_LENGTH).contains(&text.len()) && text.chars().all(allowed) {
        Ok(text.to_owned())
    } else {
        Err(Problem::invalid_field(
            "labels",
            format!("`{}` is not the name of a label.", shorten(text)),
        )
        .fix(format!(
            "Give 1 to {LABEL_NAME_LENGTH} characters of A-Z, a-z, 0-9, `_`, `-`, `.` and `/`."
        )))
    }
}

fn label_value(text: &str) -> Answer<String> {
    printable("labels", "The value of a label", text, LABEL_VALUE_LENGTH)
}

fn printable(field: &str, what: &str, text: &str, longest: usize) -> Answer<String> {
    let length = text.chars().count();
    if (1..=longest).contains(&length) && text.chars().all(is_printable) {
        Ok(text.to_owned())
    } else {
        Err(Problem::invalid_field(
            field,
            format!("{what} must have 1 to {longest} printable characters."),
        )
        .fix("Give a shorter text without control characters."))
    }
}

fn limit_labels(app: &App, labels: &BTreeMap<String, String>) -> Answer<()> {
    let limit = app.service.settings().label_limit;
    if labels.len() <= limit {
        Ok(())
    } else {
        Err(
            Problem::invalid_field("labels", format!("There are more than {limit} labels."))
                .fix("Give fewer labels, or ask the operator to raise `label_limit`."),
        )
    }
}
