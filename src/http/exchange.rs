//! What handlers need of archives.

use crate::hooks::UrlGuard;

/// What handlers need of archives.
pub struct Exchange {
    /// Which DICOMweb services jobs may name beside the configured archives.
    pub guard: UrlGuard,
}
