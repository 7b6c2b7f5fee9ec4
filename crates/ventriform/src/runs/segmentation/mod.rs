//! A patient's segmentation from beginning to end.
//!
//! In go a volume, models and parameters; out come the fitted model, its mask, volumes, polar map,
//! measures against an expert's mask, slices and a report.
//!
//! 1. [`SegmentationOrder`]: the files, models and parameters.
//! 2. [`from_files`](mod@from_files) reads the volume and the expert's mask and completes the parameters with what
//!    depends on the volume ([`FitParameters::on`](crate::parameters::FitParameters::on)).
//! 3. The models are checked and prepared; with `auto`, the built-in hearts join them. A model
//!    that was named must be usable; of those that are merely available, unusable ones are left
//!    out, and the report says why.
//! 4. The expert's mask is read and brought to the volume's grid ([`given_mask`](crate::image::volume::given_mask)).
//! 5. Every template is fitted, with one search for the organ ([`OrganSearch`]), and the fit with
//!    the greatest [confidence](crate::heart::judge::Judgement::confidence) is chosen, of equals the one with
//!    the greatest [merit](crate::heart::fit::Fit::merit). A template whose fit fails is left out,
//!    unless all fail or half of the built-in hearts find no wall. The fits of the built-in hearts
//!    judge the chosen one together ([`consensus`](crate::heart::judge::consensus)).
//! 6. With a reader's profile, the wall is drawn as that reader would ([`crate::heart::reader`]).
//! 7. [`segment`](mod@segment) makes mask, measures, polar map and [`slices`] of the fit.
//! 8. Of slices that were reconstructed here, [`Acquired`] measures the heart's motion in the projections; if it is to be
//!    corrected, the views are shifted back, and all is made again.
//! 9. [`SegmentedVolume::report`] is the report; [`SegmentedVolume::files`] are the files written, the same on
//!    the command line and over HTTP.

mod order;

mod acquired;
mod from_files;

pub mod built_in;
mod named_template;
mod normals;
mod templates;

mod fitting;

mod segment;
pub mod slices;

mod report;

mod cavity;
mod files;
mod mask_place;
mod region;

mod error;

pub use acquired::Acquired;
pub(crate) use acquired::{MadeOfSlices, with_motion};
pub use cavity::cavity;
pub use error::SegmentationError;
pub use files::{NamedFile, SegmentationFilesError};
pub(crate) use files::{
    csv_file, fhir_beside, figure_files, json_file, json_line, perfusion_files, png_file,
    region_file, svg_file, uptake_files,
};
pub(crate) use fitting::common_template;
pub use fitting::{OrganSearch, RankedTemplate, fit_built_in};
pub use from_files::{ExpertFacts, SegmentedVolume, from_files};
pub use named_template::{NamedTemplate, RefusedTemplate};
pub use normals::{heart_figures, judged_by_normals};
pub use order::{NamedMesh, NamedReader, SegmentationOrder};
pub(crate) use segment::segment_at;
pub use segment::{AppliedReader, ImageResolution, Segmentation, SegmentationParameters, segment};
pub use templates::prepare;
