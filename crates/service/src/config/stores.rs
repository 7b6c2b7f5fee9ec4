//! The stores of a service: one value for each kind of record, made once by the program.

use crate::base::records::{BlobStore, Catalogue, FigureStore, JobStore, Peers, TimeStore};
use crate::callers::AccessStore;
use crate::network::archive::ArchiveStore;
use crate::network::hooks::DeliveryStore;
use crate::network::intake::{IntakeStore, ReceivedFiles};
use crate::network::worklist::Worklist;
use futures::future::BoxFuture;
use std::sync::Arc;

/// The stores of one service.
pub struct Stores {
    /// Jobs.
    pub jobs: Arc<dyn JobStore>,
    /// Volumes, products, and who owns them.
    pub catalogue: Arc<dyn Catalogue>,
    /// Keys and the audit trail.
    pub access: Arc<dyn AccessStore>,
    /// Work items of other systems.
    pub worklist: Arc<dyn Worklist>,
    /// Deliveries of webhooks.
    pub deliveries: Arc<dyn DeliveryStore>,
    /// Deliveries to archives.
    pub archives: Arc<dyn ArchiveStore>,
    /// Objects received by DICOM.
    pub intake: Arc<dyn IntakeStore>,
    /// Figures that only the database knows.
    pub figures: Arc<dyn FigureStore>,
    /// The times that outlive a process.
    pub time: Arc<dyn TimeStore>,
    /// The files of items.
    pub blobs: Arc<dyn BlobStore>,
    /// The files of received objects.
    pub received: Arc<dyn ReceivedFiles>,
    /// The other processes on the database and the files, if there can be any.
    pub peers: Option<Arc<dyn Peers>>,
    /// Closes the database and unlocks the data folder. Dropping it unlocks the folder, too.
    pub close: Box<dyn FnOnce() -> BoxFuture<'static, ()> + Send + Sync>,
}
