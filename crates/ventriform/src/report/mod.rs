//! Figures about a mesh, the report of a model, and the pages of a model and a segmentation.
//!
//! [`measure`](measure::measure) takes any mesh and its reference surface S and gives counts and
//! topology (self-intersections found exactly), shape (radius ratios, angles, edge lengths,
//! valences), smoothness (dihedral angles) and closeness (two-sided distances, volume, area).
//! [`ModelReport::new`] joins these figures to the facts of the stages. [`model_page()`] makes a
//! self-contained page of that report, coloured by [`Closeness`]; [`segmentation_page()`] one of a
//! segmentation's.
//!
//! A report is JSON with stable names: lengths in millimetres, angles in degrees, volumes in
//! millilitres, as the names' endings say. Everything but `timings_ms` is the same for the
//! same input, parameters and seed, whatever the number of threads.

pub mod closeness;
pub mod distance;
mod distance_pictures;
pub mod elements;
mod embedded;
mod input;
pub mod measure;
mod model_page;
mod model_report;
mod sections;
mod segmentation_page;
mod segmentation_report;
mod stage_facts;
pub mod summary;
mod whose;

pub use closeness::{Closeness, MeasuredSurface};
pub use distance_pictures::vertex_colours;
pub use input::input;
pub use measure::{MeasureParameters, Measures, measure};
pub use model_page::model_page;
pub use model_report::{ModelReport, ReportInput};
pub use sections::{
    FitnessForms, FitnessSection, FitnessTermsSection, Program, RetileSection, Stages,
    StartSummary, SurfaceSection,
};
pub use segmentation_page::{SegmentationPage, segmentation_page};
pub use segmentation_report::SegmentationReport;
