//! What the service asks of the domain: to look at a volume, and to do work on it.

use super::{Failure, Fitting, Generation, Reader, Resource, VolumeFacts};
use crate::progress::{Cancelled, Monitor, Plan};
use crate::volume::ReadLimits;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::PathBuf;
use std::sync::Arc;

/// Looks at what was sent. Called on blocking threads.
pub trait VolumeReader: Send + Sync + 'static {
    /// Reads and checks the files of one volume.
    ///
    /// # Errors
    /// Why the files are no volume that can be used.
    fn inspect(&self, files: &[PathBuf]) -> Result<VolumeFacts, Failure>;

    /// Three orthogonal middle slices as a PNG.
    ///
    /// # Errors
    /// As [`VolumeReader::inspect`].
    fn preview(&self, files: &[PathBuf]) -> Result<Vec<u8>, Failure>;

    /// Reads and checks a JSON mesh that shall serve as a template of `organ`. The output is
    /// the template: its main figures and every download.
    ///
    /// # Errors
    /// Why the mesh cannot be fitted.
    fn template(&self, mesh: &[u8], organ: &str) -> Result<Output, Failure>;
}

/// One kind of work. Called on a worker's threads.
pub trait Work: Send + Sync + 'static {
    /// What it makes; also the kind's name in jobs.
    fn makes(&self) -> Resource;

    /// Its stages, and what share of the time each takes.
    fn plan(&self) -> Plan;

    /// Checks parameters given as text and writes every default out.
    ///
    /// # Errors
    /// The first parameter that cannot be used.
    fn parameters_from_text(
        &self,
        pairs: &[(String, String)],
    ) -> Result<Map<String, Value>, Failure>;

    /// Checks parameters given as JSON and writes every default out.
    ///
    /// # Errors
    /// The first parameter that cannot be used.
    fn parameters_from_json(
        &self,
        object: &Map<String, Value>,
    ) -> Result<Map<String, Value>, Failure>;

    /// What else of the store these parameters call for. Nothing, usually.
    fn needs(&self, _parameters: &Map<String, Value>) -> Needs {
        Needs::default()
    }

    /// Does the work. Reports progress, and looks at the token at least every 50 ms.
    ///
    /// # Errors
    /// [`WorkError::Cancelled`] if the token was raised, else the reason.
    fn run(&self, input: &Input, monitor: &Monitor<'_>) -> Result<Output, WorkError>;

    /// The report on what it made as a page for people, of the files that are kept of it.
    /// Called on blocking threads.
    ///
    /// # Errors
    /// If the files cannot be read or are not understood.
    fn page(&self, stored: &Stored) -> Result<String, Failure>;
}

/// What work calls for besides its volume.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Needs {
    /// Field of the parameters and the id of the thing in it.
    pub things: BTreeMap<String, String>,
    /// Whether it wants the library of templates.
    pub library: bool,
}

/// A stored thing as work finds it.
#[derive(Debug, Clone)]
pub struct Stored {
    /// Its id.
    pub id: String,
    /// The parameters that it was made by; none for a volume.
    pub parameters: Map<String, Value>,
    /// Its files.
    pub files: Vec<PathBuf>,
}

impl Stored {
    /// The file of that name.
    pub fn file(&self, name: &str) -> Option<&PathBuf> {
        self.files.iter().find(|path| path.ends_with(name))
    }

    /// The content of the file of that name; `None` where there is none (any more).
    ///
    /// # Errors
    /// If it is there but cannot be read.
    pub fn read(&self, name: &str) -> std::io::Result<Option<Vec<u8>>> {
        let Some(path) = self.file(name) else {
            return Ok(None);
        };
        match std::fs::read(path) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }
}

/// What a job works on.
#[derive(Debug, Clone)]
pub struct Input {
    /// The volume's id, for the result to name.
    pub volume: String,
    /// The volume's files.
    pub files: Vec<PathBuf>,
    /// Parameters as the same [`Work`] wrote them out.
    pub parameters: Map<String, Value>,
    /// What [`Work::needs`] named, by field.
    pub things: BTreeMap<String, Stored>,
    /// The templates, by id, where [`Work::needs`] asked for them.
    pub library: Vec<Stored>,
}

/// What a job made.
#[derive(Debug, Clone, Default)]
pub struct Output {
    /// Counts and main figures.
    pub summary: Map<String, Value>,
    /// The downloads.
    pub files: Vec<OutputFile>,
}

/// One download.
#[derive(Debug, Clone)]
pub struct OutputFile {
    /// Its name: `mesh.glb`, `report.json` ...
    pub name: String,
    /// Its `Content-Type`.
    pub media_type: &'static str,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// Why work made nothing.
#[derive(Debug, Clone, thiserror::Error)]
pub enum WorkError {
    /// The token was raised.
    #[error("cancelled")]
    Cancelled,
    /// A reason for the caller.
    #[error(transparent)]
    Failed(#[from] Failure),
}

impl From<Cancelled> for WorkError {
    fn from(_: Cancelled) -> Self {
        WorkError::Cancelled
    }
}

/// All that the service can do with volumes.
#[derive(Clone)]
pub struct Engine {
    /// Looks at what was sent.
    pub reader: Arc<dyn VolumeReader>,
    /// The kinds of work.
    pub works: Vec<Arc<dyn Work>>,
}

impl Engine {
    /// The real one, within `limits`.
    pub fn new(limits: ReadLimits) -> Self {
        Self {
            reader: Arc::new(Reader { limits }),
            works: vec![
                Arc::new(Generation { limits }),
                Arc::new(Fitting { limits }),
            ],
        }
    }

    /// The work of that kind.
    pub fn work(&self, kind: &str) -> Option<&Arc<dyn Work>> {
        self.works.iter().find(|work| work.makes().noun() == kind)
    }
}
