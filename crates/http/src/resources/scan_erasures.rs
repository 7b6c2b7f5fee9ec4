//! `DELETE /v1/volumes`: all volumes of a patient, a study, a series or an accession, and what was made of them.
//!
//! Without a filter nothing is erased. `dry_run` shows what would go and what stands in the way; an erasure may name
//! that plan, and is refused if another would be carried out. All goes in one transaction with one receipt, or nothing
//! goes. Neither receipt nor audit trail holds a value of the filter.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::edge::guard::AlreadyRecorded;
use crate::openapi::{ErasureHeader, ScanErasureProblems};
use crate::resources::erasures::{ReceiptBody, acknowledged};
use crate::resources::scans::{VALUE_LENGTH, is_value};
use crate::wire::links::path_of;
use crate::wire::memory::charge;
use crate::wire::problem::{Answer, Problem};
use crate::wire::query::Query;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::IntoResponse;
use axum::{Extension, Json};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use ventriform_service::base::error::ServiceError;
use ventriform_service::base::records::{
    ErasedItem, ScanErasureOrder, ScanErasurePlan, ScanSelection, ScansErased,
};
use ventriform_service::callers::Activity;

/// Memory for the plan of as many files as one order may have, and for its receipt.
const PLAN_MEMORY: u64 = 8 << 20;

/// Ids that a problem names at most; a dry run has them all.
const NAMED_IDS: usize = 20;

/// Which volumes to erase: those for which all that is given holds. At least one of the first four is needed.
#[derive(Default, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ScanErasureQuery {
    /// Only of the patient with this Patient ID, in exactly these letters
    #[param(pattern = "^.{1,64}$")]
    patient: Option<String>,
    /// Only of the study with this Study Instance UID
    #[param(pattern = "^.{1,64}$")]
    study: Option<String>,
    /// Only of the series with this Series Instance UID
    #[param(pattern = "^.{1,64}$")]
    series: Option<String>,
    /// Only of scans with this Accession Number
    #[param(pattern = "^.{1,64}$")]
    accession: Option<String>,
    /// Whether to erase also the models, segmentations, beats, comparisons and templates that were made of the volumes, and the records of their jobs. Unlike in the erasure of one volume this is the default: who erases a patient or a study means all that is stored of it. With `false` a dry run lists in `stays` what would be left
    #[param(default = true)]
    cascade: Option<bool>,
    /// Whether to erase nothing, and only show what would go and what stands in the way
    #[param(default = false)]
    dry_run: Option<bool>,
    /// The `plan` that a dry run has shown: nothing is erased if something else would go by now
    #[param(pattern = "^[0-9a-f]{32}$")]
    plan: Option<String>,
}

/// What an erasure would erase, and what stands in its way.
#[derive(Serialize, ToSchema)]
#[schema(as = ErasurePlan)]
pub struct PlanBody {
    /// A name for exactly these items and jobs.
    #[schema(example = "9f86d081884c7d659a2feaa0c55ad015")]
    plan: String,
    /// The volumes that are selected.
    volumes: Vec<String>,
    /// The volumes and what would go with them.
    items: Vec<PlannedItemBody>,
    /// The ended jobs whose records would go.
    jobs: Vec<String>,
    /// What was made of the volumes and would stay, with `cascade=false`: send `cascade=true` to erase it too.
    stays: Vec<String>,
    /// Items on legal hold: selected, or another source of something that would go. Nothing is erased while there are any.
    legal_holds: Vec<String>,
    /// Jobs that have not ended and need one of the items. Nothing is erased while there are any.
    unfinished_jobs: Vec<String>,
    /// Items that a request needs at this moment. Nothing is erased while there are any.
    pinned: Vec<String>,
    /// Volumes whose scan a repair of the database has lost and that were not read again yet, so that they may be missing
    /// here.
    unread_volumes: u64,
}

/// An item that would be erased.
#[derive(Serialize, ToSchema)]
#[schema(as = PlannedItem)]
struct PlannedItemBody {
    /// Its id.
    #[schema(example = "vol_9f86d081884c7d659a2feaa0c55ad015")]
    id: String,
    /// Number of its files.
    files: usize,
    /// Size of all its files in bytes.
    bytes: u64,
}

impl From<ErasedItem> for PlannedItemBody {
    fn from(item: ErasedItem) -> Self {
        Self {
            files: item.files.len(),
            bytes: item.files.iter().map(|file| file.bytes).sum(),
            id: item.id,
        }
    }
}

impl From<ScanErasurePlan> for PlanBody {
    fn from(plan: ScanErasurePlan) -> Self {
        Self {
            plan: plan.tag(),
            volumes: plan.volumes,
            items: plan.items.into_iter().map(PlannedItemBody::from).collect(),
            jobs: plan.jobs,
            stays: plan.stays,
            legal_holds: plan.holds,
            unfinished_jobs: plan.unfinished_jobs,
            pinned: plan.pinned,
            unread_volumes: plan.unread,
        }
    }
}

impl ScanErasureQuery {
    /// The scans that are meant.
    ///
    /// # Errors
    /// 422 if none is given, or a value cannot be one of a header.
    fn selection(&self) -> Answer<ScanSelection> {
        let value = |name: &str, text: &Option<String>| {
            let text = text.as_deref().map(str::trim);
            match text {
                Some(text) if !is_value(text) => Err(Problem::invalid_field(
                    name,
                    format!("`{name}` must have 1 to {VALUE_LENGTH} printable characters."),
                )
                .fix("Give the value as the DICOM header has it. Nothing was erased.")),
                text => Ok(text.map(str::to_owned)),
            }
        };
        let selection = ScanSelection {
            patient: value("patient", &self.patient)?,
            study: value("study", &self.study)?,
            series: value("series", &self.series)?,
            accession: value("accession", &self.accession)?,
        };
        if selection.is_empty() {
            return Err(Problem::new(
                StatusCode::UNPROCESSABLE_ENTITY,
                "missing-filter",
                "It is not said which volumes to erase. Nothing was erased.",
            )
            .fix(
                "Give `patient`, `study`, `series` or `accession`, first with `dry_run=true`; or DELETE /v1/volumes/ID \
                 for one volume.",
            ));
        }
        Ok(selection)
    }
}

/// Erase all volumes of a patient, a study, a series or an accession
///
/// Those for which all filters hold go, with what was made of them unless `cascade` is false: all in one transaction, or
/// nothing while a legal hold, an unfinished job or a request keeps something. `dry_run=true` shows the plan; given as
/// `plan`, it is carried out only if it is still the same. One receipt names everything that went, and no value of a filter;
/// it is at the path in `Location`, and `Prefer: return=representation` asks for it in the answer. Needs the scope `admin`.
#[utoipa::path(delete, path = "/v1/volumes", tag = "volumes", operation_id = "delete_volumes",
    params(ScanErasureQuery, ErasureHeader),
    responses(
        (status = 200, description = "Erased; the receipt. Of a dry run: the plan",
            body = inline(ErasureAnswer)),
        (status = 204, description = "Erased",
            headers(("Location" = String, description = "The receipt's path"))),
        ScanErasureProblems))]
pub async fn erase_volumes(
    State(app): State<App>,
    caller: Caller,
    Query(query): Query<ScanErasureQuery>,
    headers: HeaderMap,
) -> Answer {
    let order = ScanErasureOrder {
        tenant: caller.tenant.clone(),
        selection: query.selection()?,
        cascade: query.cascade.unwrap_or(true),
        only_plan: query.plan,
        by: caller.by.of_erasure(),
    };
    charge(PLAN_MEMORY).await?;
    if query.dry_run.unwrap_or(false) {
        let plan = app.service.items().plan_scan_erasure(&order).await?;
        if plan.is_too_large {
            return Err(too_large());
        }
        // It tells what is stored of somebody, and changes nothing.
        caller.by.note(Activity::Search, "volumes".into()).await;
        let unkept = [(header::CACHE_CONTROL, "no-store")];
        let body = Json(PlanBody::from(plan));
        return Ok((unkept, Extension(AlreadyRecorded), body).into_response());
    }
    match app.service.items().erase_scans(order).await? {
        ScansErased::Done(receipt) => Ok(acknowledged(*receipt, &headers)),
        ScansErased::Kept(plan) => Err(kept(&plan)),
        ScansErased::Differs(plan) => Err(Problem::new(
            StatusCode::CONFLICT,
            "plan-changed",
            format!(
                "Something else would go than `plan` names: {} items now. Nothing was erased.",
                plan.items.len()
            ),
        )
        .at("plan")
        .fix("Look at the plan of a new dry run.")),
        ScansErased::Changed => Err(ServiceError::contended("these volumes").into()),
    }
}

/// The two answers with a body.
#[derive(serde::Serialize, ToSchema)]
#[serde(untagged)]
#[schema(as = ErasureAnswer)]
#[allow(dead_code, reason = "only its schema is used")]
enum ErasureAnswer {
    /// The receipt.
    #[schema(value_type = ReceiptBody)]
    Receipt(ReceiptBody),
    /// The plan of a dry run.
    #[schema(value_type = PlanBody)]
    Plan(PlanBody),
}

fn kept(plan: &ScanErasurePlan) -> Problem {
    if plan.is_too_large {
        return too_large();
    }
    if plan.volumes.is_empty() {
        let unread = match plan.unread {
            0 => String::new(),
            count => format!(" Of {count} volumes it is not known yet whose scan they are."),
        };
        return Problem::new(
            StatusCode::NOT_FOUND,
            "no-volumes",
            format!("No volume of this tenant matches.{unread} Nothing was erased."),
        )
        .fix("Compare the values with `dicom` of GET /v1/volumes, letter by letter.");
    }
    if let Some(first) = plan.holds.first() {
        return Problem::new(
            StatusCode::CONFLICT,
            "legal-hold",
            format!(
                "Legal holds on {} forbid to erase these volumes. Nothing was erased.",
                named(&plan.holds)
            ),
        )
        .fix(format!(
            "DELETE {}/hold, and so of the others, when the holds have ended; or choose a study or series without a \
             hold.",
            path_of(first)
        ));
    }
    let needed = if plan.unfinished_jobs.is_empty() {
        format!("Requests need {} at this moment.", named(&plan.pinned))
    } else {
        format!(
            "The unfinished jobs {} need these volumes.",
            named(&plan.unfinished_jobs)
        )
    };
    Problem::new(
        StatusCode::CONFLICT,
        "in-use",
        format!("{needed} Nothing was erased."),
    )
    .fix("Wait for them to end, or DELETE the jobs; then send the request again.")
}

fn too_large() -> Problem {
    Problem::new(
        StatusCode::UNPROCESSABLE_ENTITY,
        "too-many-items",
        format!(
            "More than {} volumes or {} files would go, which one receipt does not hold. Nothing was erased.",
            ScanErasurePlan::VOLUMES_LIMIT,
            ScanErasurePlan::FILES_LIMIT
        ),
    )
    .fix("Erase study by study, or series by series.")
}

/// The first of some ids, and the number of the others.
fn named(ids: &[String]) -> String {
    let first: Vec<String> = ids
        .iter()
        .take(NAMED_IDS)
        .map(|id| format!("`{id}`"))
        .collect();
    let first = first.join(", ");
    match ids.len().saturating_sub(NAMED_IDS) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}
