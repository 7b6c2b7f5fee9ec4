//! The models of an order, checked and prepared for fitting.

use super::built_in;
use super::error::SegmentationError;
use super::named_template::{NamedTemplate, RefusedTemplate};
use super::order::NamedMesh;
use crate::base::progress::Monitor;
use crate::heart::model::{Organ, Template, TemplateError};

/// The built-in hearts, if `auto`, and the templates of `models`, and the models that were left out.
///
/// # Errors
/// [`SegmentationError::NoModel`] without any model; [`SegmentationError::UnsuitableModel`] where
/// none can be used, or one that must be; [`SegmentationError::Cancelled`].
pub fn prepare(
    auto: bool,
    models: &[NamedMesh],
    organ: Organ,
    monitor: &Monitor<'_>,
) -> Result<(Vec<NamedTemplate>, Vec<RefusedTemplate>), SegmentationError> {
    let mut templates = if auto && organ == Organ::LeftVentricle {
        built_in::templates(monitor)?
    } else {
        Vec::new()
    };
    if templates.is_empty() && models.is_empty() {
        return Err(SegmentationError::NoModel {
            organ: organ.as_str(),
        });
    }
    let mut refused = Vec::new();
    let mut first = None;
    for NamedMesh {
        name,
        mesh,
        required,
    } in models
    {
        let name = name.clone();
        match Template::new(mesh.clone(), organ, monitor) {
            Ok(template) => templates.push(NamedTemplate {
                name,
                template,
                built_in: false,
            }),
            Err(TemplateError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(error) => {
                let reason = error.to_string();
                let unsuitable = SegmentationError::UnsuitableModel { name, error };
                if *required {
                    return Err(unsuitable);
                }
                if let SegmentationError::UnsuitableModel { name, .. } = &unsuitable {
                    let name = name.clone();
                    refused.push(RefusedTemplate { name, reason });
                }
                first.get_or_insert(unsuitable);
            }
        }
    }
    match first {
        Some(error) if templates.is_empty() => Err(error),
        _ => Ok((templates, refused)),
    }
}
