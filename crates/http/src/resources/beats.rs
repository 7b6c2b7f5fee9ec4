//! `/v1/beats`: gated studies as one model in motion, and the request that uploads one and fits it.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{self, FileProblems, UploadProblems, WaitAnswers};
use crate::resources::files;
use crate::resources::jobs::PriorityQuery;
use crate::resources::jobs::filing::{self, UploadJob};
use crate::resources::products::{Offer, ProductCollection, body_of_product, object_paths};
use crate::resources::tags::TagQuery;
use crate::wire::links::path_of;
use crate::wire::problem::Answer;
use crate::wire::query::QueryReader;
use crate::wire::webhook_request::WebhookQuery;
use axum::extract::{Request, State};
use serde::Serialize;
use utoipa::ToSchema;
use ventriform::results::export::dicom::BeatEnd;
use ventriform::runs::gated::{FILE_NAMES, GATE_FILE_PATTERN, end_mesh, is_gate_mesh};
use ventriform_service::base::records::{Product, Resource};

/// The collection of beats.
pub struct Beats;

/// The mesh that stands for a beat where one is asked for: the wall at end diastole.
const DIASTOLE_MESH: &str = end_mesh(BeatEnd::Diastole);
const REPORT_FILE: &str = "beat.json";

impl ProductCollection for Beats {
    const RESOURCE_KIND: Resource = Resource::Beat;
    type Body = BeatBody;
    const MESH_NAMES: &'static [&'static str] = &[DIASTOLE_MESH, end_mesh(BeatEnd::Systole)];
    const MAIN_MESH: &'static str = DIASTOLE_MESH;
    const FILE_NAMES: &'static [&'static str] = FILE_NAMES;
    const NUMBERED_FILES: Option<&'static str> = Some(GATE_FILE_PATTERN);

    fn is_numbered_mesh(stem: &str) -> bool {
        is_gate_mesh(stem)
    }

    const REPORT_FILE: &'static str = REPORT_FILE;
    const FILE_SCHEMA: &'static str = "BeatFileName";
    const FILE_HELP: &'static str = "All meshes of a beat have the same nodes and triangles, and the parts that `part` \
        names. The `.dcm` files are DICOM objects of the scan's patient and study, made on \
        request; they need the scope `submit`, or `deidentify=true`.";
}

body_of_product!(
    /// A beat: one wall in motion, fitted to the gates of a volume, with its main figures.
    BeatBody,
    Beat,
    BeatLinks,
    ventriform::parameters::GatedParameters,
    ventriform::results::report::BeatSummary,
    "Volumes, ejection fraction, the spread of phases, the confidence of the fit to the gates' sum, and flags; the \
     report has all figures.",
    "bea_2c26b46b68ffc68ff99b453c1d304134"
);

/// Paths of one beat.
#[derive(Serialize, ToSchema)]
struct BeatLinks {
    /// This beat.
    #[serde(rename = "self")]
    itself: String,
    /// The wall at end diastole, in the format that `Accept` asks for.
    mesh: String,
    /// The report.
    report: String,
    /// The report as an HTML page.
    page: String,
    /// The volume curve.
    curve: String,
    /// The histogram of the wall's phases.
    phase: String,
    /// DICOM objects of the scan's patient and study, for the archive.
    dicom: Vec<String>,
    /// The volume.
    volume: String,
}

impl BeatLinks {
    fn from_product(beat: &Product) -> Self {
        let itself = path_of(&beat.id);
        Self {
            mesh: format!("{itself}/mesh"),
            report: format!("{itself}/report"),
            page: format!("{itself}/{}", files::REPORT_PAGE),
            curve: format!("{itself}/curve.svg"),
            phase: format!("{itself}/phase.svg"),
            dicom: object_paths(beat),
            volume: path_of(beat.volume.as_deref().unwrap_or_default()),
            itself,
        }
    }
}

/// The answers that a client which waits for a beat may ask for: the report, or the mesh at end diastole.
fn offers() -> Vec<Offer> {
    let report = Offer::new("application/json", REPORT_FILE);
    let meshes = Offer::meshes(DIASTOLE_MESH).into_iter();
    std::iter::once(report)
        .chain(meshes.filter(|offer| offer.media_type != "application/json"))
        .collect()
}

/// Fit one model in motion to a gated study
///
/// The body is the gated volume: a gated DICOM series, a 4-D NIfTI file whose volumes are the gates, or a form with one
/// NIfTI file for each gate, in the order of the numbers in their names or else of the form. The service
/// stores it, files a job, and answers 202 with the job. With `Prefer: wait=60` it waits up to 60 seconds for the job to
/// end and answers 200 with what `Accept` asks for: the report (`application/json`), or the wall at end diastole. Every
/// parameter is a query parameter: those of a beat, and those of the fit to the gates' sum, by which its axis and rim
/// are corrected.
#[utoipa::path(post, path = "/v1/beats", tag = "beats",
    request_body(content(
        (Vec<u8> = "application/octet-stream"),
        (openapi::UploadForm = "multipart/form-data"))),
    params(openapi::BeatQuery, TagQuery, PriorityQuery,
        openapi::IdempotencyHeader,
        openapi::PreferHeader, WebhookQuery, openapi::WebhookSecretHeader),
    responses(openapi::BeatAnswer, WaitAnswers, FileProblems, UploadProblems))]
pub async fn create_beat(
    State(app): State<App>,
    caller: Caller,
    query: QueryReader,
    request: Request,
) -> Answer {
    let job = UploadJob {
        makes: Resource::Beat,
        apart: &[],
        offers: offers(),
    };
    filing::file_upload(&app, &caller, job, query, request).await
}
