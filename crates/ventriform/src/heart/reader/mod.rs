//! A reader's way of drawing the wall: learnt from masks, applied to fits.
//!
//! There are two kinds. Some draw the edge that the image shows, one by millimetres farther out than another, and end
//! the wall at different heights of the base. Others draw where the image has a level, a share of the wall's own
//! uptake. In go the fits of some scans and the masks that a reader drew of them; out comes a [`ReaderProfile`]: three
//! distances in millimetres, or a level. In go a profile and a fit; out comes the wall as that reader would draw it.
//!
//! 1. [`measure`](mod@measure): how far the mask's inner surface, outer surface and rim lie from those of the
//!    fitted wall, as medians over the wall; and the level at which the drawn wall agrees best with the mask.
//! 2. [`learn`](mod@learn): the mean over the masks, drawn towards zero (a level: towards half) the more the fewer
//!    masks there are and the more they scatter. [`crate::runs::evaluate::calibration`] chooses the kind by masks left out.
//! 3. [`profile`]: the profile as JSON, checked when it is read.
//! 4. [`draw`]: a fitted wall, moved by the profile; [`level`]: where a level puts its nodes.
//!
//! Guaranteed: the same masks give the same profile; distances of zero leave a fit as it is; drawn by distances, the
//! wall keeps the nodes and triangles of the model, drawn by a level it has smaller ones. Not guaranteed: that the
//! reader's next mask lies where the profile says; the spread over the masks is in the profile.

pub mod draw;
pub mod learn;
pub mod level;
pub mod measure;
pub mod profile;
mod wall_edges;

pub use draw::{DrawnFit, drawn};
pub use learn::{learn, learn_level};
pub use level::WallImage;
pub use measure::{measure, measure_level};
pub use profile::{
    Learnt, LearntOn, ProfileDocument, ProfileError, ReaderDrawing, ReaderKind, ReaderLevel,
    ReaderOffset, ReaderOffsets, ReaderProfile,
};
