//! The two hearts of a comparison, each with the work that was made of its scan.

use crate::base::progress::{Cancelled, Monitor};
use crate::heart::comparison::{Answer, Change, ComparisonFlag, ScoreAnswers, WhichScan};
use crate::heart::normals::Perfusion;
use crate::heart::polar::PolarMap;
use crate::image::volume::{HeldGates, Provenance, Volume, VolumeFacts};
use crate::mesh::TriMesh;
use crate::parameters::{ComparisonChoice, FitParameters};
use crate::results::export::Metadata;
use crate::results::export::dicom::{Moment, SourceScan};
use crate::runs::gated::GatedHeart;
use crate::runs::segmentation::{Segmentation, SegmentedVolume};

/// A heart of a comparison.
#[derive(Debug)]
pub enum ComparedHeart {
    /// From an image that is not gated.
    Still(Box<SegmentedVolume>),
    /// From gates.
    Beating(Box<GatedHeart>),
}

impl ComparedHeart {
    /// The segmentation of the image, or of the gates' sum.
    pub fn segmentation(&self) -> &Segmentation {
        match self {
            Self::Still(made) => &made.segmentation,
            Self::Beating(made) => &made.segmentation,
        }
    }

    /// The beat, if there is one.
    pub fn beat(&self) -> Option<&GatedHeart> {
        match self {
            Self::Still(_) => None,
            Self::Beating(made) => Some(made),
        }
    }

    /// Whose scan it is; `None` unless the files are DICOM.
    pub fn provenance(&self) -> Option<&Provenance> {
        match self {
            Self::Still(made) => made.reading.provenance.as_ref(),
            Self::Beating(made) => made.reading.provenance(),
        }
    }

    /// Facts about the files.
    pub fn facts(&self) -> &VolumeFacts {
        match self {
            Self::Still(made) => &made.reading.facts,
            Self::Beating(made) => &made.reading.facts,
        }
    }

    /// The wall's uptake beside normal limits, if some were given.
    pub fn perfusion(&self) -> Option<&Perfusion> {
        match self {
            Self::Still(made) => made.perfusion.as_ref(),
            Self::Beating(made) => made.perfusion.as_ref(),
        }
    }

    /// The polar map of the wall's uptake.
    pub fn map(&self) -> Option<&PolarMap> {
        self.segmentation().polar.as_ref()
    }

    /// Volume of the cavity of the anatomical wall, ml.
    pub fn cavity_ml(&self) -> f64 {
        let surfaces = self.segmentation().fit.model.surfaces.as_ref();
        surfaces.map_or(f64::NAN, |both| both.anatomical.wall.cavity_ml)
    }

    /// Volume of the anatomical wall's muscle, ml.
    pub fn muscle_ml(&self) -> f64 {
        let surfaces = self.segmentation().fit.model.surfaces.as_ref();
        surfaces.map_or(f64::NAN, |both| both.anatomical.wall_ml)
    }

    /// The image's resolution, mm.
    pub fn resolution_mm(&self) -> Option<f64> {
        Some(self.segmentation().resolution?.value)
    }

    /// Reasons to look closer at the fit, and at the beat: each by its code and in words.
    pub(crate) fn flags(&self) -> Vec<(&'static str, String)> {
        let of_fit = self.segmentation().fit.judgement.flags.iter();
        let of_beat = self.beat().map(GatedHeart::flags).unwrap_or_default();
        of_fit
            .map(|flag| (flag.code(), flag.to_string()))
            .chain(of_beat.iter().map(|flag| (flag.code(), flag.to_string())))
            .collect()
    }

    /// The role that the header states; `None` if it states neither rest nor stress.
    pub fn stated_role(&self) -> Option<WhichScan> {
        match self.provenance()?.rest_or_stress.as_deref()? {
            "stress" => Some(WhichScan::Stress),
            "rest" => Some(WhichScan::Rest),
            _ => None,
        }
    }

    /// The wall that was fitted, LPS mm.
    pub fn mesh(&self) -> &TriMesh {
        &self.segmentation().fit.model.mesh
    }

    /// The image that was fitted: the scan, or the sum of its gates.
    pub fn image(&self) -> &Volume {
        match self {
            Self::Still(made) => &made.reading.volume,
            Self::Beating(made) => &made.sum,
        }
    }

    /// The scan that DICOM objects of the comparison belong to, with the given identity.
    pub fn scan(&self, identity: Provenance, made: Moment) -> SourceScan {
        let image = self.image();
        let placed = self.facts().affine_source.is_placed();
        SourceScan::new(identity, image.frame.clone(), image.shape, placed, made)
    }

    /// The description that files of the mesh hold, under this title.
    pub(crate) fn metadata(
        &self,
        title: String,
        monitor: &Monitor<'_>,
    ) -> Result<Metadata, Cancelled> {
        let (segmentation, mesh) = (self.segmentation(), self.mesh());
        let scan = self.provenance();
        Ok(Metadata {
            frame_of_reference_uid: scan
                .and_then(|scan| scan.frame_of_reference().map(str::to_owned)),
            parts: segmentation.parts(mesh, monitor)?,
            field: segmentation.uptake(mesh),
            ..Metadata::new(title)
        })
    }

    /// The name of the model that was fitted.
    pub fn template(&self) -> &str {
        let segmentation = self.segmentation();
        &segmentation.candidates[segmentation.chosen].name
    }

    /// Whether the scans have the same voxels.
    pub(super) fn has_voxels_of(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Still(a), Self::Still(b)) => a.reading.volume.voxels == b.reading.volume.voxels,
            (Self::Beating(a), Self::Beating(b)) => {
                let (a, b) = (&a.reading.gates, &b.reading.gates);
                a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.voxels == b.voxels)
            }
            _ => false,
        }
    }
}

/// Two scans of one patient, compared.
#[derive(Debug)]
pub struct ComparedHearts {
    /// At stress.
    pub stress: ComparedHeart,
    /// At rest.
    pub rest: ComparedHeart,
    /// What the files at stress and those at rest hold of a beat.
    pub gates: [HeldGates; 2],
    /// The change of the wall's uptake.
    pub change: Change,
    /// The scores beside normal limits, if both scans have them.
    pub scores: Option<ScoreAnswers>,
    /// Reasons to look closer.
    pub flags: Vec<ComparisonFlag>,
    /// The parameters of both fits.
    pub parameters: FitParameters,
    /// The parameters of the comparison.
    pub choice: ComparisonChoice,
}

impl ComparedHearts {
    /// The ratio of the cavities, stress to rest (transient ischaemic dilation).
    pub fn tid(&self) -> f64 {
        self.stress.cavity_ml() / self.rest.cavity_ml()
    }

    /// The same with the interval that noise gives it.
    pub fn tid_answer(&self) -> Answer {
        Answer::of_tid(self.tid(), self.change.noise.points)
    }
}
