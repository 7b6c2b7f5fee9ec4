//! Jobs of kind `segmentation`: [`ventriform::runs::segmentation::from_files`] over stored models.

use super::failures::{profile_missing, unreadable_model, unwritten, work_error};
use super::files::volume_files;
use super::limits;
use super::models::{MESH_FILE, name_of, named_item, named_models, stored_models};
use super::page;
use super::parameters;
use crate::base::records::{Failure, Resource};
use crate::items::{OutputFile, StoredItem, WorkOutput};
use crate::jobs::{GivenParameters, Needs, Work, WorkError, WorkInput};
use serde_json::{Map, Value};
use ventriform::base::progress::{Monitor, Plan};
use ventriform::heart::reader::ReaderProfile;
use ventriform::image::volume::ReadLimits;
use ventriform::parameters::{FitParameters, Parameters};
use ventriform::results::export::Format;
use ventriform::results::report::object;
use ventriform::runs::advice::Explain;
use ventriform::runs::segmentation::{NamedFile, NamedReader, SegmentationOrder, from_files};

/// The file of a reader's profile.
pub(super) const PROFILE_FILE: &str = "profile.json";

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
        let (mut items, library) = named_models(parameters);
        let named = ["expert", "reader", limits::NORMALS_FIELD];
        items.extend((named.iter()).filter_map(|field| named_item(parameters, field)));
        Needs {
            items,
            library,
            files: &[MESH_FILE, PROFILE_FILE, limits::NORMALS_FILE],
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
        let normals = limits::of_input(input)?;
        let order = SegmentationOrder {
            volume: &volume_files(&input.files),
            expert: expert.as_deref(),
            normals: normals.as_ref(),
            auto: parameters.is_auto(),
            models: stored_models(input, &parameters)?,
            reader: reader(input)?,
            parameters: &parameters,
        };
        let made = from_files(&order, &self.limits, monitor).map_err(|error| work_error(&error))?;
        let files = made.files(&Format::ALL, Some(input.volume.clone()), monitor);
        let files = files.map_err(unwritten)?;
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
        scans: &[Map<String, Value>],
    ) -> Result<String, Failure> {
        page::segmentation_page(&|name| segmentation.read_whole(name), scans)
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
