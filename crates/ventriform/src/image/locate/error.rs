//! Why no ventricle was found.

use super::hot_voxels::Outshone;
use super::not_a_heart::NotAHeart;
use crate::base::progress::Cancelled;
use crate::image::grid::Volume;
use crate::image::grid::size::OddSize;

/// Why no ventricle was found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LocateError {
    /// All values of the volume are equal, or none is finite and positive.
    #[error("the volume shows nothing: it holds no positive values that differ")]
    Blank,
    /// No place looks like a ventricle.
    #[error("no heart found: the best candidate, at {centre:.0?} mm (LPS), \
        {reason}{}", .size.as_ref().map(|size| size.to_string()).unwrap_or_default())]
    NoHeart {
        /// Best candidate's centre, LPS mm.
        centre: [f64; 3],
        /// Its correlation with a ventricle.
        correlation: f64,
        /// Why it is not a heart.
        reason: NotAHeart,
        /// The size of the volume, if it is not that of a scan of a chest.
        size: Option<Box<OddSize>>,
    },
    /// Without a hint, no place in the volume is a candidate.
    #[error("no heart found: nowhere does a bright wall lie about a darker cavity")]
    NoCandidate,
    /// A few voxels outshine all others.
    #[error(transparent)]
    HotVoxels(#[from] Outshone),
    /// No place in the volume meets the hints.
    #[error("the hinted centre or region lies outside the volume")]
    HintOutside,
    /// The caller cancelled the search.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl LocateError {
    /// The error about `volume`: where no heart was found, with the size of an odd one.
    #[must_use]
    pub(crate) fn about(mut self, volume: &Volume) -> Self {
        if let Self::NoHeart { size, .. } = &mut self {
            *size = OddSize::from_volume(volume).map(Box::new);
        }
        self
    }
}
