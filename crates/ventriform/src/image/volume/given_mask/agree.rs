//! The agreement of two masks that may lie on different grids.
//!
//! One of both is carried to the grid of the other, which grows where it has to: no voxel of either is lost. A surface
//! has no grid of its own and is always the one that is carried.

use super::GivenMask;
use super::error::GivenMaskError;
use crate::base::progress::Monitor;
use crate::image::grid::agreement::{Agreement, CompareError, compare};

/// The agreement of two masks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaskAgreement {
    /// The figures.
    pub agreement: Agreement,
    /// Whether the reference was resampled to the grid of the other mask.
    pub resampled: bool,
}

/// Why two masks were not compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MaskAgreementError {
    /// One of them cannot be brought to the grid of the other.
    #[error("{error}")]
    Unplaced {
        /// Whether the error is about the reference; otherwise it is about the mask to judge.
        of_reference: bool,
        /// The reason.
        error: GivenMaskError,
    },
    /// There are no figures.
    #[error(transparent)]
    Compare(#[from] CompareError),
}

impl GivenMask {
    /// The agreement with `reference`. With `resample`, a reference of another lattice takes the value of the nearest
    /// voxel.
    ///
    /// # Errors
    /// [`MaskAgreementError`], if the masks lie on different lattices, or too far apart.
    pub fn agreement(
        self,
        reference: Self,
        resample: bool,
        monitor: &Monitor,
    ) -> Result<MaskAgreement, MaskAgreementError> {
        let turned = self.surface.is_some() && reference.surface.is_none();
        let (holder, carried) = if turned {
            (reference, self)
        } else {
            (self, reference)
        };
        let refused = |error| MaskAgreementError::Unplaced {
            of_reference: !turned,
            error,
        };
        let holder = match carried.on((holder.mask.shape, &holder.frame), true, monitor) {
            Ok(placed) if placed.outside == 0 => holder,
            Err(
                error
                @ (GivenMaskError::Cancelled(_) | GivenMaskError::Elsewhere { inside: 0, .. }),
            ) => return Err(refused(error)),
            _ => holder.holding(&carried, monitor).map_err(refused)?,
        };
        let grid = (holder.mask.shape, &holder.frame);
        let placed = carried.on(grid, resample, monitor).map_err(refused)?;
        let (judged, compared) = if turned {
            (&placed.mask, &holder.mask)
        } else {
            (&holder.mask, &placed.mask)
        };
        let agreement = compare(judged, compared, holder.frame.spacing(), monitor);
        Ok(MaskAgreement {
            agreement: agreement?,
            resampled: placed.resampled,
        })
    }
}
