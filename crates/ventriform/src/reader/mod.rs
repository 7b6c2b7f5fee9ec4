//! A reader's way of drawing the wall: learnt from masks, applied to fits.
//!
//! Readers place the same edge differently, one by millimetres farther out than another, and end the wall
//! at different heights of the base. In go the fits of some scans and the masks that a reader drew of
//! them; out comes a [`ReaderProfile`]: three distances in millimetres. In go a profile and a fit; out comes
//! the wall as that reader would draw it.
//!
//! 1. [`measure`](mod@measure): how far the mask's inner surface, outer surface and rim lie from those of the
//!    fitted wall, as medians over the wall.
//! 2. [`learn`](mod@learn): the mean over the masks, drawn towards zero the more the fewer masks there are and
//!    the more they scatter.
//! 3. [`profile`]: the profile as JSON, checked when it is read.
//! 4. [`draw`]: a fitted wall, moved by the profile.
//!
//! Guaranteed: the same masks give the same profile; a profile of zeros leaves a fit as it is, and
//! the nodes and triangles stay those of the model. Not guaranteed: that the reader's next mask
//! lies where the profile says; the spread over the masks is in the profile.

pub mod draw;
pub mod learn;
pub mod measure;
pub mod profile;

pub use draw::drawn;
pub use learn::learn;
pub use measure::measure;
pub use profile::{
    LearntOn, ProfileDocument, ProfileError, ReaderOffset, ReaderOffsets, ReaderProfile,
};
