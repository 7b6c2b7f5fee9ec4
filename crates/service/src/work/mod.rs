//! The works: the bridge from the queue to the domain.
//!
//! | file | what |
//! |---|---|
//! | `model` | jobs of kind `model`: a volume's files to a surface model |
//! | `segmentation` | jobs of kind `segmentation`: a stored model fitted to a volume |
//! | `beat` | jobs of kind `beat`: one wall in motion fitted to the gates of a volume |
//! | `comparison` | jobs of kind `comparison`: rest and stress of one patient |
//! | `serial` | jobs of kind `serial`: scans of one patient over the years |
//! | `reading` | jobs of kind `reading`: what a reader states of a stored result |
//! | `normals` | jobs of kind `normals`: normal limits of a cohort of stored volumes |
//! | `models` | the models that jobs fit |
//! | `limits` | normal limits, as uploaded and as jobs need them |
//! | `template` | a mesh to a template of the library |
//! | `profile` | a reader's profile, checked |
//! | `upload` | validating and previewing an uploaded volume |
//! | [`dicom`] | DICOM objects of a stored result |
//! | `page` | the HTML page of a stored result |
//! | `failures` | why jobs and requests end: what the library explains, and what only a service meets |
//!
//! Everything here is synchronous and runs on the threads of a worker or of a blocking pool. It
//! reads local files and returns bytes; it neither stores anything nor sees the queue.

mod beat;
mod comparison;
pub mod dicom;
mod failures;
mod files;
mod limits;
mod model;
mod models;
mod normals;
mod page;
mod parameters;
pub mod part;
mod profile;
mod reading;
mod segmentation;
mod serial;
mod template;
mod upload;

pub use beat::BeatWork;
pub use comparison::ComparisonWork;
pub use model::ModelWork;
pub use normals::{MOST_CASES, NormalsWork, first_volume};
pub use page::PageError;
pub use reading::ReadingWork;
pub use segmentation::SegmentationWork;
pub use serial::SerialWork;
pub use template::TEMPLATE_BYTES;
pub use upload::{
    DomainReader, INSPECTION_MEMORY, IntensityFacts, UploadFacts, UploadReader, preview_memory,
    voxels_memory,
};

use crate::jobs::{Work, Works};
use std::sync::Arc;
use ventriform::image::volume::ReadLimits;

/// All that the service can do with volumes and models. Tests replace its parts.
#[derive(Clone)]
pub struct Engine {
    /// Validates uploads.
    pub reader: Arc<dyn UploadReader>,
    /// Computes jobs, by kind.
    pub works: Works,
    /// Limits on the volumes that are read.
    pub limits: ReadLimits,
}

impl Engine {
    /// The engine of the product; `limits` bound the volumes it reads.
    pub fn new(limits: ReadLimits) -> Self {
        let works: [Arc<dyn Work>; 7] = [
            Arc::new(ModelWork { limits }),
            Arc::new(SegmentationWork { limits }),
            Arc::new(BeatWork { limits }),
            Arc::new(ComparisonWork { limits }),
            Arc::new(SerialWork { limits }),
            Arc::new(ReadingWork),
            Arc::new(NormalsWork { limits }),
        ];
        Self {
            reader: Arc::new(DomainReader { limits }),
            works: works.into_iter().collect(),
            limits,
        }
    }

    /// The work that computes jobs of that kind.
    pub fn work(&self, kind: &str) -> Option<&Arc<dyn Work>> {
        self.works.of_kind(kind)
    }
}
