//! The models of an order, checked and prepared for fitting.

use super::built_in;
use super::error::SegmentationError;
use super::order::{NamedMesh, SegmentationOrder};
use crate::model::{Organ, Template, TemplateError};
use crate::progress::Monitor;

/// A template with its name in the report.
#[derive(Debug, Clone)]
pub struct NamedTemplate {
    /// The name.
    pub name: String,
    /// The template.
    pub template: Template,
}

/// A model that was not fitted, or whose fit failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RefusedTemplate {
    /// The model's name.
    pub name: String,
    /// Why.
    pub reason: String,
}

/// The templates of the order's models, and the models that were left out.
///
/// # Errors
/// [`SegmentationError::NoModel`] without any model; [`SegmentationError::UnsuitableModel`] where
/// none can be used, or one that was named; [`SegmentationError::Cancelled`].
pub fn prepare(
    order: &SegmentationOrder<'_>,
    monitor: &Monitor<'_>,
) -> Result<(Vec<NamedTemplate>, Vec<RefusedTemplate>), SegmentationError> {
    let organ = order.parameters.organ;
    if order.models.is_empty() {
        return Ok((vec![built_in_template(organ, monitor)?], Vec::new()));
    }
    let (mut templates, mut refused) = (Vec::new(), Vec::new());
    let mut first = None;
    for NamedMesh { name, mesh } in &order.models {
        match Template::new(mesh.clone(), organ, monitor) {
            Ok(template) => templates.push(NamedTemplate {
                name: name.clone(),
                template,
            }),
            Err(TemplateError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(error) => {
                refused.push(RefusedTemplate {
                    name: name.clone(),
                    reason: error.to_string(),
                });
                let name = name.clone();
                first.get_or_insert(SegmentationError::UnsuitableModel { name, error });
            }
        }
    }
    match first {
        Some(error) if order.named || templates.is_empty() => Err(error),
        _ => Ok((templates, refused)),
    }
}

fn built_in_template(
    organ: Organ,
    monitor: &Monitor<'_>,
) -> Result<NamedTemplate, SegmentationError> {
    if organ != Organ::LeftVentricle {
        return Err(SegmentationError::NoModel {
            organ: organ.as_str(),
        });
    }
    Ok(NamedTemplate {
        name: built_in::NAME.into(),
        template: built_in::template(monitor)?,
    })
}
