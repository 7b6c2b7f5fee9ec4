//! The part of a segmentation's JSON report that its page shows.
//!
//! The page is made from the stored report, perhaps by another version than the one that wrote
//! it. A field that is missing or `null` is therefore left out of the page; a field of another
//! type is an error of the reader's.

use serde::Deserialize;
use serde_json::{Map, Value};

/// A segmentation's report. Lengths in mm, volumes in ml.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct SegmentationReport {
    /// Name of the fitted model.
    pub template: Option<String>,
    /// Why that one was taken, as a sentence.
    pub choice: Option<String>,
    /// Models that were fitted.
    pub candidates: Vec<CandidateFigures>,
    /// Models that could not be fitted.
    pub refused: Vec<RefusedTemplateEntry>,
    /// Where the organ was found.
    pub localisation: Option<Map<String, Value>>,
    /// Which way is up in the patient.
    pub posture: Option<Map<String, Value>>,
    /// How the fit went.
    pub fit: Map<String, Value>,
    /// Volumes of wall (or organ) and cavity.
    pub volumes_ml: FittedVolumes,
    /// Mean thickness of the wall.
    pub wall_thickness_mm: Option<f64>,
    /// Mean thickness of both walls; ventricles only.
    pub thickness_mm: Option<BothThicknesses>,
    /// Mass of the anatomical wall, g; ventricles only.
    pub mass_g: Option<f64>,
    /// The reader's profile that the wall was drawn by.
    pub reader: Option<ReaderEntry>,
    /// Agreement with an expert's mask.
    pub measures: Option<AgreementFigures>,
    /// Uptake of the wall.
    pub polar: Option<PolarFigures>,
    /// Reasons to look closer.
    pub flags: Vec<RaisedFlag>,
    /// Parameters of the segmentation.
    pub parameters: Map<String, Value>,
    /// Facts about the volume's file.
    pub input: Map<String, Value>,
    /// Warnings about the volume's file.
    pub warnings: Vec<String>,
}

/// One model's fit.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct CandidateFigures {
    /// The model's name.
    pub template: Option<String>,
    /// What it is ranked by: its confidence by its own figures.
    pub confidence: Option<f64>,
    /// What decides between equals.
    pub merit: Option<f64>,
    /// Share of the surface along which an edge is seen.
    pub active: Option<f64>,
    /// Root of the mean squared strain.
    pub strain: Option<f64>,
    /// Distance to the edges, weighted root mean square.
    pub residual_mm: Option<f64>,
}

/// A model that could not be fitted.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize)]
#[serde(default)]
pub struct RefusedTemplateEntry {
    /// The model's name.
    pub template: Option<String>,
    /// Why.
    pub reason: Option<String>,
}

/// A reader's profile that was applied.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct ReaderEntry {
    /// Its name.
    pub name: Option<String>,
    /// Its distances.
    pub offsets_mm: ReaderOffsetFigures,
}

/// The distances of a reader's profile, mm.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct ReaderOffsetFigures {
    /// Of the inner surface, outward.
    pub endocardium: f64,
    /// Of the outer surface, outward.
    pub epicardium: f64,
    /// Of the rim, towards the base.
    pub rim: f64,
}

/// Thickness of both walls of a ventricle.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct BothThicknesses {
    /// As the wall looks.
    pub apparent: ThicknessFigures,
    /// Of the wall itself.
    pub anatomical: ThicknessFigures,
}

/// Thickness of a wall over its surface.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct ThicknessFigures {
    /// Mean, mm.
    pub mean: Option<f64>,
    /// Standard deviation, mm.
    pub spread: Option<f64>,
}

/// Volumes of one wall of a ventricle.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct WallVolumes {
    /// Of the wall.
    pub wall: Option<f64>,
    /// Of the cavity.
    pub cavity: Option<f64>,
}

/// Volumes of a fitted model.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct FittedVolumes {
    /// Of the wall, or of the whole organ.
    pub wall: Option<f64>,
    /// Of the cavity; ventricles only.
    pub cavity: Option<f64>,
    /// Of the wall as it looks; ventricles only.
    pub apparent: Option<WallVolumes>,
    /// Of the wall itself; ventricles only.
    pub anatomical: Option<WallVolumes>,
}

/// A segmentation's mask against an expert's.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct AgreementFigures {
    /// Jaccard index E_J.
    pub jaccard: Option<f64>,
    /// Dice index.
    pub dice: Option<f64>,
    /// Mean contour distance E_CD.
    pub contour_distance_voxels: Option<f64>,
    /// The same in mm.
    pub contour_distance_mm: Option<f64>,
    /// Hausdorff distance.
    pub hausdorff_mm: Option<f64>,
    /// Its 95th percentile.
    pub hausdorff95_mm: Option<f64>,
    /// Volume of the mask.
    pub volume_ml: Option<f64>,
    /// Volume of the expert's mask.
    pub expert_volume_ml: Option<f64>,
    /// How much larger the mask is.
    pub volume_difference_percent: Option<f64>,
}

/// A polar map without its pixels.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct PolarFigures {
    /// Share of the reference below which wall counts as a defect.
    pub threshold_percent: Option<f64>,
    /// Share of the wall below it.
    pub extent_percent: Option<f64>,
    /// What the patient's orientation was taken from; `unknown` if nothing tells it.
    pub orientation: String,
    /// The 17 segments.
    pub segments: Vec<SegmentFigures>,
    /// The territories of the coronary arteries.
    pub territories: Vec<TerritoryFigures>,
}

/// The segments that one coronary artery usually supplies, together.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct TerritoryFigures {
    /// The artery.
    pub name: String,
    /// Mean uptake in per cent of the reference.
    pub mean_percent: Option<f64>,
    /// Share of its area below the threshold.
    pub extent_percent: Option<f64>,
}

/// One segment of a polar map.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct SegmentFigures {
    /// 1..=17.
    pub number: Option<u64>,
    /// Its name.
    pub name: String,
    /// The coronary artery that usually feeds it; `None` without orientation.
    pub territory: Option<String>,
    /// Mean uptake in per cent of the reference.
    pub mean_percent: Option<f64>,
    /// Share of its area below the threshold.
    pub extent_percent: Option<f64>,
}

/// A reason to look closer.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize)]
#[serde(default)]
pub struct RaisedFlag {
    /// Its stable name.
    pub code: String,
    /// What was found, as a sentence.
    pub reason: String,
}

impl SegmentationReport {
    /// The parameter `organ`.
    pub fn organ(&self) -> &str {
        let organ = self.parameters.get("organ").and_then(Value::as_str);
        organ.unwrap_or("generic")
    }

    /// Whether the organ is a left ventricle.
    pub fn is_ventricle(&self) -> bool {
        self.organ() == "left_ventricle"
    }

    /// How sure the search for the heart is, 0..=1; NaN without that figure.
    pub fn place_confidence(&self) -> f64 {
        let found = self.localisation.as_ref();
        let number = found.and_then(|found| found.get("confidence")?.as_f64());
        number.unwrap_or(f64::NAN)
    }

    /// Which of the two walls of a ventricle the fit shows.
    pub fn edge(&self) -> &str {
        let edge = self.parameters.get("edge").and_then(Value::as_str);
        edge.unwrap_or("apparent")
    }

    /// A number of `fit`; NaN where there is none.
    pub fn fit_number(&self, name: &str) -> f64 {
        let number = self.fit.get(name).and_then(Value::as_f64);
        number.unwrap_or(f64::NAN)
    }
}
