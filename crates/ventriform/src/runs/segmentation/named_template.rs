//! A template with its name, and one that was left out.

use crate::heart::model::Template;

/// A template with its name in the report.
#[derive(Debug, Clone)]
pub struct NamedTemplate {
    /// The name.
    pub name: String,
    /// The template.
    pub template: Template,
    /// Whether it is one of the built-in hearts.
    pub built_in: bool,
}

/// A model that was not fitted, or whose fit failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RefusedTemplate {
    /// The model's name.
    pub name: String,
    /// Why.
    pub reason: String,
}
