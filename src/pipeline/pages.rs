//! Pages for people, made of what is kept of a model or a segmentation.
//!
//! A page is mostly pictures, ten times as large as everything else and as long in the making
//! as the model; few are looked at. So none is kept: each is made of its product's own files
//! when it is asked for, and does not miss the volume when that was erased.

use crate::export::read_json::{self, ReadMeshError};
use crate::report::html::{Pictured, segmentation};
use crate::report::{self, Closeness, Report};
use std::io;

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// A file that it is made of is missing.
    #[error("there is no {0}")]
    Missing(&'static str),
    /// A file cannot be read.
    #[error("{0}: {1}")]
    Io(&'static str, io::Error),
    /// A report or the distances are not understood.
    #[error("{0}: {1}")]
    Json(&'static str, serde_json::Error),
    /// The mesh is not understood.
    #[error("mesh.json: {0}")]
    Mesh(#[from] ReadMeshError),
}

/// The files of a product by name; `None` where there is no such file.
pub type Shelf<'a> = dyn Fn(&str) -> io::Result<Option<Vec<u8>>> + 'a;

/// The page of a model, of its `report.json`, `mesh.json` and `distance.json`.
///
/// # Errors
/// [`PageError`].
pub fn model_page(shelf: &Shelf<'_>) -> Result<String, PageError> {
    let text = needed(shelf, "report.json")?;
    let report: Report = from_json("report.json", &text)?;
    let mesh = read_json::decode(&needed(shelf, "mesh.json")?)?;
    let closeness: Option<Closeness> = perhaps(shelf, "distance.json")?
        .map(|text| from_json("distance.json", &text))
        .transpose()?;
    Ok(report::html(&report, &mesh, closeness.as_ref()))
}

/// The page of a segmentation, of its `report.json`, `mesh.json`, `slices.png` and
/// `polar.svg`.
///
/// # Errors
/// [`PageError`].
pub fn segmentation_page(shelf: &Shelf<'_>) -> Result<String, PageError> {
    let report = from_json("report.json", &needed(shelf, "report.json")?)?;
    let mesh = read_json::decode(&needed(shelf, "mesh.json")?)?;
    let (slices, polar) = (perhaps(shelf, "slices.png")?, perhaps(shelf, "polar.svg")?);
    Ok(segmentation(&Pictured {
        report: &report,
        mesh: &mesh,
        slices: slices.as_deref(),
        polar: polar.as_deref(),
    }))
}

fn perhaps(shelf: &Shelf<'_>, name: &'static str) -> Result<Option<Vec<u8>>, PageError> {
    shelf(name).map_err(|error| PageError::Io(name, error))
}

fn needed(shelf: &Shelf<'_>, name: &'static str) -> Result<Vec<u8>, PageError> {
    perhaps(shelf, name)?.ok_or(PageError::Missing(name))
}

fn from_json<T: serde::de::DeserializeOwned>(
    name: &'static str,
    text: &[u8],
) -> Result<T, PageError> {
    serde_json::from_slice(text).map_err(|error| PageError::Json(name, error))
}
