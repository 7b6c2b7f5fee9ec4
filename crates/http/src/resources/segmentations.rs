//! `/v1/segmentations`: models fitted to volumes, and the request that uploads a volume and fits
//! a model to it.

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
use ventriform_service::base::records::{Product, Resource};

const MASK_FILE: &str = "mask.nii.gz";

/// The collection of segmentations.
pub struct Segmentations;

impl ProductCollection for Segmentations {
    const RESOURCE_KIND: Resource = Resource::Segmentation;
    type Body = SegmentationBody;
    const MESH_NAMES: &'static [&'static str] = &["mesh", "mesh_anatomical", "mesh_apparent"];
    const FILE_NAMES: &'static [&'static str] = &[
        MASK_FILE,
        "mask_anatomical.nii.gz",
        "mask_apparent.nii.gz",
        "labels.nii.gz",
        "labels.seg.nrrd",
        "report.json",
        files::REPORT_PAGE,
        "slices.png",
        "region.nii.gz",
        "projections.png",
        "polar.json",
        "polar.svg",
        "polar.png",
        "polar_z.json",
        "polar_z.svg",
        "polar_z.png",
        "polar_score.json",
        "polar_score.svg",
        "polar_score.png",
    ];
    const FILE_SCHEMA: &'static str = "SegmentationFileName";
    const FILE_HELP: &'static str = "The `.dcm` files are DICOM objects of the scan's patient and study, made on request; \
        they need the scope `submit`, or `deidentify=true`.";
}

body_of_product!(
    /// A segmentation: a model fitted to a volume, with its main figures and its reliability.
    SegmentationBody,
    Segmentation,
    SegmentationLinks,
    ventriform::parameters::FitParameters,
    ventriform::results::report::SegmentationSummary,
    "The chosen model and the merit of every candidate, why the fit stopped, its confidence, \
     volumes, agreement with the expert's mask, and warnings; the report has all figures.",
    "seg_2c26b46b68ffc68ff99b453c1d304134"
);

/// Paths of one segmentation.
#[derive(Serialize, ToSchema)]
struct SegmentationLinks {
    /// This segmentation.
    #[serde(rename = "self")]
    itself: String,
    /// The mask on the volume's grid.
    mask: String,
    /// The fitted mesh, in the format that `Accept` asks for.
    mesh: String,
    /// The report.
    report: String,
    /// The report as an HTML page.
    page: String,
    /// The polar map; left ventricles only.
    #[serde(skip_serializing_if = "Option::is_none")]
    polar: Option<String>,
    /// DICOM objects of the scan's patient and study, for the archive.
    dicom: Vec<String>,
    /// The volume.
    volume: String,
}

impl SegmentationLinks {
    fn from_product(segmentation: &Product) -> Self {
        let itself = path_of(&segmentation.id);
        let polar = segmentation.file("polar.svg");
        Self {
            mask: format!("{itself}/{MASK_FILE}"),
            mesh: format!("{itself}/mesh"),
            report: format!("{itself}/report"),
            page: format!("{itself}/{}", files::REPORT_PAGE),
            polar: polar.map(|file| format!("{itself}/{}", file.name)),
            dicom: object_paths(segmentation),
            volume: path_of(segmentation.volume.as_deref().unwrap_or_default()),
            itself,
        }
    }
}

/// The answers that a client which waits for a segmentation may ask for: the mask, the mesh or the report.
fn offers() -> Vec<Offer> {
    let masks = [
        "application/gzip",
        "application/nifti",
        "application/x-nifti",
    ];
    let meshes = Offer::meshes("mesh").into_iter();
    masks
        .map(|media_type| Offer::new(media_type, MASK_FILE))
        .into_iter()
        .chain(meshes.filter(|offer| offer.file != "mesh.json"))
        .chain([Offer::new("application/json", "report.json")])
        .collect()
}

/// Segment a volume
///
/// The body is the volume, or a form with the file `volume` and optionally the file `expert`, an
/// expert's mask to measure against. The service stores them, files a job, and answers 202 with
/// the job. With `Prefer: wait=60` it waits up to 60 seconds for the job to end and answers 200
/// with what `Accept` asks for: the mask on the volume's grid, the fitted mesh, or the report
/// (`application/json`). Every parameter is a query parameter; `model` names the model to fit,
/// and `auto` chooses the best one of the library.
#[utoipa::path(post, path = "/v1/segmentations", tag = "segmentations",
    request_body(content(
        (Vec<u8> = "application/octet-stream"),
        (openapi::SegmentationForm = "multipart/form-data"))),
    params(openapi::SegmentationQuery, TagQuery, PriorityQuery,
        openapi::IdempotencyHeader,
        openapi::PreferHeader, WebhookQuery, openapi::WebhookSecretHeader),
    responses(openapi::SegmentationAnswer, WaitAnswers, FileProblems, UploadProblems))]
pub async fn create_segmentation(
    State(app): State<App>,
    caller: Caller,
    query: QueryReader,
    request: Request,
) -> Answer {
    let job = UploadJob {
        makes: Resource::Segmentation,
        apart: &["expert"],
        offers: offers(),
    };
    filing::file_upload(&app, &caller, job, query, request).await
}
