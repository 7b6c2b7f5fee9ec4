//! The grid on which masks and labels are written, and how their files state it.

use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::voxelise::{Mask, voxelise};
use crate::image::volume::Reading;
use crate::image::volume::nifti::StatedGrid;
use crate::mesh::TriMesh;
use crate::parameters::MaskGrid;
use std::borrow::Cow;

/// The greatest cosine between two axes that counts as a right angle: 0.06 degrees. Headers with four decimals
/// reach a tenth of it.
const RIGHT_ANGLE: f64 = 1e-3;

/// Greatest number of voxels of a grid at right angles, over that of the scan. A gantry tilted by 30
/// degrees makes it less than 3.
const MOST_VOXELS: usize = 16;

/// The grid of written masks.
pub(super) struct MaskPlace<'a> {
    /// Voxel index to LPS millimetres.
    pub frame: VoxelToPatient,
    /// Voxels along i, j, k.
    pub shape: [usize; 3],
    /// The grid as the scan's file states it, if it is NIfTI and the grid is the scan's.
    pub stated: Option<&'a StatedGrid>,
    /// Whether it is another grid than the scan's.
    covering: bool,
}

impl<'a> MaskPlace<'a> {
    /// The grid for masks of the scan `reading`; `None` if one at right angles would have too many voxels.
    pub fn new(reading: &'a Reading, wanted: MaskGrid) -> Option<Self> {
        let volume = &reading.volume;
        if wanted == MaskGrid::Orthogonal && is_sheared(&volume.frame) {
            let most = MOST_VOXELS.saturating_mul(volume.voxels.len());
            let (frame, shape) = volume.frame.orthogonal_cover(volume.shape, most)?;
            return Some(Self {
                frame,
                shape,
                stated: None,
                covering: true,
            });
        }
        Some(Self {
            frame: volume.frame.clone(),
            shape: volume.shape,
            stated: reading.stated_grid.as_ref(),
            covering: false,
        })
    }

    /// `mask`, which is that of the inside of `mesh` on the scan's grid, on this grid.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn mask<'m>(
        &self,
        mask: &'m Mask,
        mesh: &TriMesh,
        monitor: &Monitor,
    ) -> Result<Cow<'m, Mask>, Cancelled> {
        Ok(if self.covering {
            Cow::Owned(voxelise(mesh, self.shape, &self.frame, monitor)?)
        } else {
            Cow::Borrowed(mask)
        })
    }

    /// Warning about masks on the grid of `frame` if its axes are not at right angles.
    pub fn warning(frame: &VoxelToPatient, wanted: MaskGrid) -> Option<String> {
        let degrees = frame.shear().min(1.0).acos().to_degrees();
        is_sheared(frame).then(|| match wanted {
            MaskGrid::Scan => format!(
                "Two axes of the scan's grid meet at {degrees:.1} degrees (a tilted gantry, or a sheared \
                 affine): NIfTI's qform cannot state that, and programs built on ITK refuse such masks or \
                 misplace them. mask_grid=orthogonal writes masks at right angles."
            ),
            MaskGrid::Orthogonal => format!(
                "Two axes of the scan's grid meet at {degrees:.1} degrees: masks and labels lie on a grid at right \
                 angles that covers the scan, not on the scan's own."
            ),
        })
    }
}

fn is_sheared(frame: &VoxelToPatient) -> bool {
    frame.shear() > RIGHT_ANGLE
}
