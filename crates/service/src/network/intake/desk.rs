//! The reception of objects, for those who bring them and those who look after them.

use super::{IntakeStore, ReceivedFiles, Receiver, Sessions};
use std::sync::Arc;

/// The reception of objects.
pub struct Intake {
    /// Takes objects.
    pub(crate) receiver: Arc<Receiver>,
    /// The groups that wait.
    pub(crate) sessions: Arc<Sessions>,
    /// The tables.
    pub(crate) store: Arc<dyn IntakeStore>,
    /// The files.
    pub(crate) files: Arc<dyn ReceivedFiles>,
}
