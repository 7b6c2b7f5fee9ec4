//! The arguments of the commands that work on a cohort's folder.

use super::mesh_args::MeshArgs;
use clap::Args;
use std::path::PathBuf;
use ventriform::image::volume::given_mask::MaskChoice;
use ventriform::runs::evaluate::{Cohort, CohortError};

/// Which cohort, and how its templates' models are made. A command that takes these sets the
/// default of `points`.
#[derive(Debug, Args)]
pub struct CohortArgs {
    /// Folder of the cohort: one folder for each case with spect.nii.gz, lv_expert_img.nii.gz
    /// and lv_truth.nii.gz; manifest.json says which are templates (without it: names with t)
    #[arg(value_name = "COHORT")]
    folder: PathBuf,
    /// Numbers of points of our models
    #[arg(long, value_name = "N,...", value_delimiter = ',')]
    pub points: Vec<usize>,
    /// Template whose model is made from its expert's mask [default: the third, if it has one]
    #[arg(long, value_name = "CASE")]
    manual: Option<String>,
    /// Structure of the masks, where their files hold several: number of a label or segment, or name of a
    /// segment
    #[arg(long, value_name = "LABEL", allow_hyphen_values = true)]
    label: Option<String>,
    /// Resample masks that lie on another grid than their scan; without it they are not used
    #[arg(long)]
    resample: bool,
    #[command(flatten)]
    mesh: MeshArgs,
}

impl CohortArgs {
    /// Reads who is in the folder.
    ///
    /// # Errors
    /// [`CohortError`].
    pub fn open(&self) -> Result<Cohort, CohortError> {
        let mut cohort = Cohort::open(&self.folder, self.manual.as_deref())?;
        cohort.masks = MaskChoice {
            label: self.label.as_deref().map(|text| {
                let Ok(label) = text.parse();
                label
            }),
            resample: self.resample,
            mesh: self.mesh.into(),
        };
        Ok(cohort)
    }
}
