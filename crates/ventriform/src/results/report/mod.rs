//! Figures about a mesh, the report of a model, and the pages of a model, a segmentation, a beat and comparisons.
//!
//! [`measure`](measure::measure) takes any mesh and its reference surface S and gives counts and
//! topology (self-intersections found exactly), shape (radius ratios, angles, edge lengths,
//! valences), smoothness (dihedral angles) and closeness (two-sided distances, volume, area).
//! [`ModelReport::new`] joins these figures to the facts of the stages. [`model_page()`] makes a
//! self-contained page of that report, coloured by [`Closeness`]; [`segmentation_page()`] one of a
//! segmentation's [`SegmentationReport`], [`beat_page()`] one of a beat's [`BeatReport`], [`comparison_page()`] one of
//! a [`ComparisonReport`], [`serial_page()`] one of a [`SerialReport`], [`reading_page()`] one of what a reader states of such a
//! report ([`ReadingReport`]). [`segmentation_sheet()`] and [`comparison_sheet()`] make a picture of such a page, for
//! viewers that show nothing else: a [`DrawnPage`].
//!
//! Each document is defined here once: the structs are what is written, what is read of a stored file, and,
//! with the feature `schema`, what the OpenAPI document describes.
//!
//! A report is JSON with stable names: lengths in millimetres, angles in degrees, volumes in
//! millilitres, as the names' endings say. Everything but `timings_ms` is the same for the
//! same input, parameters and seed, whatever the number of threads.

mod beat_page;
mod beat_report;
pub mod closeness;
mod comparison_page;
pub(crate) mod comparison_report;
mod comparison_sheet;
pub mod distance;
mod distance_pictures;
pub mod elements;
mod embedded;
mod fit_report;
pub mod header_text;
pub mod impression;
mod input;
mod json_number;
pub mod measure;
mod model_page;
mod model_report;
mod page_parts;
mod patches;
mod perfusion_report;
mod projections_report;
mod raised_flag;
mod reading_page;
pub(crate) mod reading_report;
mod sections;
mod segmentation_page;
pub(crate) mod segmentation_report;
mod segmentation_sheet;
mod serial_page;
mod serial_report;
mod sheet_parts;
mod stage_facts;
mod summaries;
pub mod summary;
mod whose;

pub use beat_page::{BeatPage, beat_page};
pub use beat_report::{
    BeatParts, BeatReport, CurvePoint, GateReport, PhaseReport, RatesReport, SegmentMotionReport,
    TimingReport,
};
pub use closeness::{Closeness, MeasuredSurface};
pub use comparison_page::{ComparisonPage, comparison_page};
pub use comparison_report::{
    BeatChange, ComparedScan, ComparedSegmentReport, ComparedTerritoryReport, ComparisonReport,
    NoBeat, NoBeatCode, UptakeChange,
};
pub use comparison_sheet::{ComparisonSheet, comparison_sheet};
pub use distance_pictures::vertex_colours;
pub use fit_report::{
    EvidenceReport, FitReport, FittedVolumes, LocalisationReport, LongAxis, Posture, Thickness,
    Thicknesses, Uncertainties, Uncertainty, VolumeIntervalsReport, WallVolumes,
};
pub use input::{FileFacts, IntensityFacts, Scaling};
pub use measure::{MeasureParameters, Measures, measure};
pub use model_page::model_page;
pub use model_report::{ModelReport, ReportInput};
pub use perfusion_report::{PerfusionReport, SegmentScore, TerritoryScore};
pub use projections_report::{MoveReport, ProjectionsReport, UncorrectedReport, ViewReport};
pub use raised_flag::RaisedFlag;
pub use reading_page::{ReadingPage, reading_page};
pub use reading_report::{ReadKind, ReadScores, ReadingReport, ReadingSummary};
pub use sections::{
    FitnessFormStages, FitnessForms, FitnessReport, FitnessScales, FitnessTermStages, FitnessTerms,
    OptimiseReport, Program, RetileReport, StartSummary, SurfaceReport,
};
pub use segmentation_page::{SegmentationPage, segmentation_page};
pub use segmentation_report::{
    AgreementReport, AppliedReaderReport, CandidateReport, RefusedTemplateReport, Resolution,
    SegmentationParts, SegmentationReport,
};
pub use segmentation_sheet::{SegmentationSheet, segmentation_sheet};
pub use serial_page::{SerialPage, serial_page};
pub use serial_report::{
    FigureChangeReport, SerialPairReport, SerialReport, SerialScanReport, SerialSegmentReport,
};
pub use sheet_parts::DrawnPage;
pub use summaries::{
    BeatSummary, ComparisonSummary, ModelSummary, NormalGroupSummary, NormalsSummary,
    ReaderSummary, SegmentationSummary, SerialSummary, TemplateSummary, object,
};
