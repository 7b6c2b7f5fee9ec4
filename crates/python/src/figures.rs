//! The main figures of a report, by the rows that describe them.

use crate::errors::{exception, refused};
use pyo3::prelude::*;
use serde_json::Value;
use ventriform::results::figures::{self, TABLES};

/// Name and figure with its unit of what the page of a report begins with; `schema` is the name of the report's class.
#[pyfunction]
pub fn headlines(py: Python<'_>, schema: &str, report: &[u8]) -> PyResult<Vec<(String, String)>> {
    let unusable = |field: &str, reason: String| {
        exception(
            py,
            &refused(field, reason, "Give a report and the name of its class."),
        )
    };
    let table = TABLES.iter().find(|(name, _)| *name == schema);
    let (_, rows) = table.ok_or_else(|| unusable("schema", format!("`{schema}` is no report")))?;
    let report: Value =
        serde_json::from_slice(report).map_err(|error| unusable("report", error.to_string()))?;
    let written = |one: figures::HeadlineFigure| {
        let figure = format!("{} {}", one.value, one.unit);
        (one.label, figure.trim_end().to_owned())
    };
    let headlines = figures::headlines(rows, &report).into_iter();
    Ok(headlines.map(written).collect())
}
