//! The models that jobs fit: named by the parameter `model`, or flagged for every `auto`.

use super::failures::{mesh_missing, unreadable_model, work_error};
use crate::items::StoredItem;
use crate::jobs::{WorkError, WorkInput};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use ventriform::parameters::FitParameters;
use ventriform::results::export::read_json;
use ventriform::runs::segmentation::{NamedMesh, SegmentationError};

/// The file of a model that is fitted.
pub(super) const MESH_FILE: &str = "mesh.json";

/// The item that the parameter `field` names, with that field.
pub(super) fn named_item(parameters: &Map<String, Value>, field: &str) -> Option<(String, String)> {
    let id = parameters.get(field)?.as_str()?;
    Some((field.to_owned(), id.to_owned()))
}

/// The ids of the models that `parameters` name, by field, and whether the flagged templates are fitted too.
pub(super) fn named_models(parameters: &Map<String, Value>) -> (BTreeMap<String, String>, bool) {
    let model = parameters.get("model").and_then(Value::as_str);
    let model = model.unwrap_or(FitParameters::AUTO_MODEL);
    let named: BTreeMap<_, _> = FitParameters::named_models(model).into_iter().collect();
    let library = !named.contains_key("model");
    (named, library)
}

/// The models to fit beside the built-in hearts: those that the parameters name, and with `auto` the
/// flagged templates of the organ.
pub(super) fn stored_models(
    input: &WorkInput,
    parameters: &FitParameters,
) -> Result<Vec<NamedMesh>, WorkError> {
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

/// The name under which reports mention a stored item.
pub(super) fn name_of(item: &StoredItem) -> String {
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
