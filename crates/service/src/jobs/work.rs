//! The interface of a kind of job: its parameters, its computation, its input and output.

use super::isolation::Isolation;
use crate::base::records::{Failure, Fault, LocalFile, Resource};
use crate::items::{StoredItem, WorkOutput};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::sync::Arc;
use ventriform::base::progress::{Cancelled, Monitor, Plan};

/// One kind of work. Its methods are called on blocking threads.
pub trait Work: Send + Sync + 'static {
    /// The kind of its results. [`Resource::noun`] is the kind's name in jobs.
    fn makes(&self) -> Resource;

    /// Its stages, with each stage's share of the time.
    fn plan(&self) -> Plan;

    /// Validates parameters and writes every default out.
    ///
    /// # Errors
    /// The first parameter that cannot be used.
    fn check_parameters(&self, given: GivenParameters<'_>) -> Result<Map<String, Value>, Failure>;

    /// [`Work::check_parameters`] of text, as from a query string.
    ///
    /// # Errors
    /// The first parameter that cannot be used.
    fn parameters_from_text(
        &self,
        pairs: &[(String, String)],
    ) -> Result<Map<String, Value>, Failure> {
        self.check_parameters(GivenParameters::Text(pairs))
    }

    /// [`Work::check_parameters`] of a JSON object.
    ///
    /// # Errors
    /// The first parameter that cannot be used.
    fn parameters_from_json(
        &self,
        object: &Map<String, Value>,
    ) -> Result<Map<String, Value>, Failure> {
        self.check_parameters(GivenParameters::Json(object))
    }

    /// Refuses an order that lacks what the parameters alone need not have, before it is filed. `volume` is that of the
    /// job; `None` if it is yet to be fetched.
    ///
    /// # Errors
    /// If an input is missing.
    fn check_order(
        &self,
        _volume: Option<&str>,
        _parameters: &Map<String, Value>,
    ) -> Result<(), Failure> {
        Ok(())
    }

    /// The needs of the work besides the volume, given these parameters. Nothing by default.
    fn needs(&self, _parameters: &Map<String, Value>) -> Needs {
        Needs::default()
    }

    /// Does the work. Reports progress, and checks the cancel token at least every 50 ms.
    ///
    /// # Errors
    /// [`WorkError::Cancelled`] if the token was raised, else the reason.
    fn run(&self, input: &WorkInput, monitor: &Monitor<'_>) -> Result<WorkOutput, WorkError>;

    /// Names of the product's files from which [`Work::page`] is made; empty if it has no page.
    fn page_files(&self) -> &'static [&'static str] {
        &[]
    }

    /// The report on a product as an HTML page, made from the product's files. It names whose scan
    /// it is as far as the fields of `scans` do: of its volume, of a comparison then of the one at rest.
    ///
    /// # Errors
    /// If a file is missing, cannot be read or cannot be parsed, or if there is no page.
    fn page(
        &self,
        _product: &StoredItem,
        _scans: &[Map<String, Value>],
    ) -> Result<String, Failure> {
        let detail = format!("A {} has no page.", self.makes().label());
        Err(Failure::new(Fault::Request, "not-found", detail).fix("Read its report instead."))
    }
}

/// Parameters as they were given.
#[derive(Debug, Clone, Copy)]
pub enum GivenParameters<'a> {
    /// Pairs of name and text.
    Text(&'a [(String, String)]),
    /// A JSON object; types are strict.
    Json(&'a Map<String, Value>),
}

/// Needs of a work besides its volume.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Needs {
    /// Volumes and products named by parameters: parameter name to id.
    pub items: BTreeMap<String, String>,
    /// Whether it needs the templates that the tenant flagged for every `model=auto`.
    pub library: bool,
    /// Names of the files it reads of each product and template. All files of a volume are
    /// provided.
    pub files: &'static [&'static str],
}

/// The input of a job.
#[derive(Debug, Clone)]
pub struct WorkInput {
    /// Id of the volume.
    pub volume: String,
    /// Files of the volume.
    pub files: Vec<LocalFile>,
    /// Parameters, as the same [`Work`] wrote them out.
    pub parameters: Map<String, Value>,
    /// The items of [`Needs::items`], by parameter name.
    pub items: BTreeMap<String, StoredItem>,
    /// The templates in the order of their ids, if [`Needs::library`] asked for them.
    pub library: Vec<StoredItem>,
    /// Voxels of the largest of the volumes.
    pub voxels: u64,
}

impl WorkInput {
    /// All files that the work may read.
    pub fn all_files(&self) -> Vec<LocalFile> {
        let items = self.items.values().chain(&self.library);
        let files = items.flat_map(|item| &item.files);
        self.files.iter().chain(files).cloned().collect()
    }
}

/// Why work made nothing.
#[derive(Debug, Clone, thiserror::Error)]
pub enum WorkError {
    /// The cancel token was raised.
    #[error("cancelled")]
    Cancelled,
    /// It failed.
    #[error(transparent)]
    Failed(#[from] Failure),
}

impl From<Cancelled> for WorkError {
    fn from(_: Cancelled) -> Self {
        WorkError::Cancelled
    }
}

/// The kinds of work that this process can do.
#[derive(Clone)]
pub struct Works {
    kinds: Vec<Arc<dyn Work>>,
    isolation: Option<Isolation>,
}

impl Works {
    /// The work of that kind.
    pub fn of_kind(&self, kind: &str) -> Option<&Arc<dyn Work>> {
        self.iter().find(|work| work.makes().noun() == kind)
    }

    /// Every kind of work.
    pub fn iter(&self) -> std::slice::Iter<'_, Arc<dyn Work>> {
        self.kinds.iter()
    }

    /// The same works, and how to do them in a process of their own.
    #[must_use]
    pub fn with_isolation(mut self, isolation: Isolation) -> Self {
        self.isolation = Some(isolation);
        self
    }

    /// The command that does a job in a process of its own; `None` if this program cannot.
    pub fn isolation(&self) -> Option<&Isolation> {
        self.isolation.as_ref()
    }
}

impl FromIterator<Arc<dyn Work>> for Works {
    fn from_iter<I: IntoIterator<Item = Arc<dyn Work>>>(works: I) -> Self {
        Self {
            kinds: works.into_iter().collect(),
            isolation: None,
        }
    }
}
