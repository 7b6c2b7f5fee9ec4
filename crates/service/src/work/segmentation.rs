//! Jobs of kind `segmentation`: [`ventriform::segmentation::from_files`] over stored models.

use super::files::volume_files;
use super::page;
use super::parameters;
use super::problems::{
    Explain, mesh_missing, not_exportable, profile_missing, unreadable_model, work_error,
};
use crate::items::{OutputFile, StoredItem, WorkOutput};
use crate::jobs::{GivenParameters, Needs, Work, WorkError, WorkInput};
use crate::records::{Failure, Resource};
use serde_json::{Map, Value};
use ventriform::export::{Format, read_json};
use ventriform::parameters::{FitParameters, Parameters};
use ventriform::progress::{Monitor, Plan};
use ventriform::reader::ReaderProfile;
use ventriform::report::object;
use ventriform::segmentation::{
    NamedFile, NamedMesh, NamedReader, SegmentationError, SegmentationFilesError,
    SegmentationOrder, from_files,
};
use ventriform::volume::ReadLimits;

/// The file of a reader's profile.
pub(super) const PROFILE_FILE: &str = "profile.json";
/// The file of a model that is fitted.
const MESH_FILE: &str = "mesh.json";

/// Fits models to volumes.
#[derive(Debug, Clone, Copy)]
pub struct SegmentationWork {
    /// Limits on the volume.
    pub limits: ReadLimits,
}

impl Work for SegmentationWork {
    fn makes(&self) -> Resource {
        Resource::Segmentation
    }

    fn needs(&self, parameters: &Map<String, Value>) -> Needs {
        let text = |field: &str| parameters.get(field)?.as_str();
        let models =
            FitParameters::named_models(text("model").unwrap_or(FitParameters::AUTO_MODEL));
        let named = |field: &str| Some((field.to_owned(), text(field)?.to_owned()));
        let (expert, reader) = (named("expert"), named("reader"));
        Needs {
            library: !models.iter().any(|(field, _)| field == "model"),
            items: models.into_iter().chain(expert).chain(reader).collect(),
            files: &[MESH_FILE, PROFILE_FILE],
        }
    }

    fn check_parameters(&self, given: GivenParameters<'_>) -> Result<Map<String, Value>, Failure> {
        parameters::check::<FitParameters>(given)
    }

    fn plan(&self) -> Plan {
        Plan::SEGMENTATION
    }

    fn run(&self, input: &WorkInput, monitor: &Monitor<'_>) -> Result<WorkOutput, WorkError> {
        let parameters =
            FitParameters::from_json(&input.parameters).map_err(|error| error.explain())?;
        let expert = input.items.get("expert");
        let expert = expert.map(|expert| volume_files(&expert.files));
        let order = SegmentationOrder {
            volume: &volume_files(&input.files),
            expert: expert.as_deref(),
            auto: parameters.is_auto(),
            models: models(input, &parameters)?,
            reader: reader(input)?,
            parameters: &parameters,
        };
        let made = from_files(&order, &self.limits, monitor).map_err(|error| work_error(&error))?;
        let files = made.files(&Format::ALL, Some(input.volume.clone()), monitor);
        let files = files.map_err(|error| match error {
            SegmentationFilesError::Cancelled(cancelled) => cancelled.into(),
            error => WorkError::Failed(not_exportable(&error)),
        })?;
        Ok(WorkOutput {
            summary: object(&made.summary()),
            files: files.into_iter().map(OutputFile::from).collect(),
        })
    }

    fn page_files(&self) -> &'static [&'static str] {
        page::SEGMENTATION_FILES
    }

    fn page(
        &self,
        segmentation: &StoredItem,
        scan: &Map<String, Value>,
    ) -> Result<String, Failure> {
        page::segmentation_page(&|name| segmentation.read(name), scan)
            .map_err(|error| error.explain())
    }
}

impl From<NamedFile> for OutputFile {
    fn from(file: NamedFile) -> Self {
        Self {
            name: file.name,
            media_type: file.media_type.into(),
            bytes: file.bytes,
        }
    }
}

/// The models to fit beside the built-in hearts: those that the parameters name, and with `auto` the
/// flagged templates of the organ.
fn models(input: &WorkInput, parameters: &FitParameters) -> Result<Vec<NamedMesh>, WorkError> {
    let organ = parameters.organ.as_str();
    let organ_of = |item: &StoredItem| {
        let organ = item.parameters.get("organ");
        organ.and_then(Value::as_str).map(str::to_owned)
    };
    let (mut models, mut named) = (Vec::new(), Vec::new());
    for (field, id) in FitParameters::named_models(&parameters.model) {
        let item = input.items.get(&field).ok_or_else(|| mesh_missing(&id))?;
        if let Some(other) = organ_of(item).filter(|shown| shown != organ) {
            return Err(work_error(&SegmentationError::OtherOrgan {
                name: item.id.clone(),
                shows: other,
                wanted: organ,
            }));
        }
        models.push(mesh(item, true)?.ok_or_else(|| mesh_missing(&item.id))?);
        named.push(&item.id);
    }
    for item in &input.library {
        if organ_of(item).is_some_and(|shown| shown == organ) && !named.contains(&&item.id) {
            // A template that was deleted a moment ago is left out.
            models.extend(mesh(item, false)?);
        }
    }
    Ok(models)
}

/// The reader's profile of the parameters.
fn reader(input: &WorkInput) -> Result<Option<NamedReader>, WorkError> {
    let Some(item) = input.items.get("reader") else {
        return Ok(None);
    };
    let name = name_of(item);
    let bytes = item.read(PROFILE_FILE).map_err(|e| unreadable_model(&e))?;
    let bytes = bytes.ok_or_else(|| profile_missing(&item.id))?;
    let profile = ReaderProfile::from_json(&bytes).map_err(|error| work_error(&error))?;
    Ok(Some(NamedReader { name, profile }))
}

/// The name under which reports mention a stored item.
fn name_of(item: &StoredItem) -> String {
    match item.parameters.get("name").and_then(Value::as_str) {
        Some(name) => format!("{name} ({})", item.id),
        None => item.id.clone(),
    }
}

/// The mesh of a stored model, with the name under which reports mention it; `None` if its file
/// does not exist.
fn mesh(item: &StoredItem, required: bool) -> Result<Option<NamedMesh>, WorkError> {
    let name = name_of(item);
    let Some(bytes) = item.read(MESH_FILE).map_err(|e| unreadable_model(&e))? else {
        return Ok(None);
    };
    match read_json::decode(&bytes) {
        Ok(mesh) => Ok(Some(NamedMesh {
            name,
            mesh,
            required,
        })),
        Err(error) => Err(work_error(&SegmentationError::UnreadableModel {
            name,
            error,
        })),
    }
}
