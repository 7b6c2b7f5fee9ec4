//! The report of a serial comparison: what is written as `serial.json`.
//!
//! Scans and segments are counted from 1, scans in the order of their dates. Changes are the later figure less the earlier
//! one.

use super::input::FileFacts;
use super::raised_flag::RaisedFlag;
use super::segmentation_report::Resolution;
use crate::heart::comparison::Verdict;
use crate::heart::polar::PolarSummary;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The report of a serial comparison: scans of one patient, and what changed from scan to scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SerialReport {
    /// The scans, in the order of their dates.
    pub scans: Vec<SerialScanReport>,
    /// The change of every figure: of every scan against the first one, and then against the one before it.
    pub changes: Vec<FigureChangeReport>,
    /// The change of the wall's uptake, likewise.
    pub pairs: Vec<SerialPairReport>,
    /// Whether all scans are gated, so that there are beats.
    pub gated: bool,
    /// Reasons to look closer.
    pub flags: Vec<RaisedFlag>,
    /// Every parameter, defaults written out.
    pub parameters: Map<String, Value>,
}

/// A scan of a series. All are fitted from one common heart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = SerialScan))]
pub struct SerialScanReport {
    /// Its number.
    pub number: usize,
    /// Its number as it was given.
    pub given: usize,
    /// The date, `YYYY-MM-DD`; `null` where the header states none.
    pub date: Option<String>,
    /// Series Description, if the header has one.
    pub series_description: Option<String>,
    /// The model that was fitted.
    pub template: String,
    /// Confidence of the fit of this scan alone, 0..=1.
    pub confidence: f64,
    /// How far the heart lies from where it was in the first scan, mm.
    pub moved_mm: f64,
    /// By how much it is turned against the first scan, degrees.
    pub turned_degrees: f64,
    /// Correlation of the image with that of the first scan about the wall.
    pub correlation: f64,
    /// Full width at half maximum of the image's point response.
    pub resolution_mm: Option<Resolution>,
    /// Beats a minute; `null` unless the scan is gated and its R-R interval is known.
    pub beats_per_minute: Option<f64>,
    /// Ejection fraction, per cent; `null` unless all scans are gated, as for the others of the beat.
    pub ef_percent: Option<f64>,
    /// End-diastolic volume.
    pub edv_ml: Option<f64>,
    /// End-systolic volume.
    pub esv_ml: Option<f64>,
    /// Volume of the cavity in the image of all gates.
    pub cavity_ml: Option<f64>,
    /// Mass of the muscle by the fit of this scan alone; the volumes of all scans stand on one common mass.
    pub mass_g: Option<f64>,
    /// Share of the wall below the threshold, a share of the scan's own maximum.
    pub dark_percent: Option<f64>,
    /// Share of the wall below the normal limit; `null` without normal limits, as for the other two.
    pub extent_percent: Option<f64>,
    /// Deficit score.
    pub deficit_percent: Option<f64>,
    /// Summed score, 0 to 68.
    pub summed_score: Option<f64>,
    /// Inward motion, the mean of the segments.
    pub motion_mm: Option<f64>,
    /// Thickening, the mean of the segments.
    pub thickening_percent: Option<f64>,
    /// Standard deviation of the phases; `null` where they are not reliable.
    pub phase_sd_degrees: Option<f64>,
    /// Bandwidth of the phases.
    pub phase_bandwidth_degrees: Option<f64>,
    /// Uptake of the wall, by its own reference.
    pub polar: Option<PolarSummary>,
    /// The file.
    pub input: FileFacts,
    /// Warnings about the file.
    pub warnings: Vec<String>,
}

/// The change of a figure from an earlier to a later scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = FigureChange))]
pub struct FigureChangeReport {
    /// The figure: its name in `scans`.
    pub figure: String,
    /// The earlier scan.
    pub earlier: usize,
    /// The later one.
    pub later: usize,
    /// The later figure less the earlier one.
    pub change: f64,
    /// The 95 % interval of the change.
    pub interval: [f64; 2],
    /// Whether it changed.
    pub verdict: Verdict,
    /// The least change that nine of ten such pairs of scans would show.
    pub least_change: f64,
}

/// The change of the wall's uptake from an earlier to a later scan. Uptake is in per cent of the earlier scan's reference,
/// the later one scaled to it by the wall that did not change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = SerialPair))]
pub struct SerialPairReport {
    /// The earlier scan.
    pub earlier: usize,
    /// The later one.
    pub later: usize,
    /// Share of the wall that lost uptake, each region as far as half of the depth of its loss.
    pub worse_percent: f64,
    /// Its interval by noise: 5th and 95th percentile.
    pub worse_interval_percent: [f64; 2],
    /// Whether wall lost uptake.
    pub worse_verdict: Verdict,
    /// Share of the wall that gained uptake.
    pub better_percent: f64,
    /// Its interval.
    pub better_interval_percent: [f64; 2],
    /// Whether wall gained uptake.
    pub better_verdict: Verdict,
    /// Share of the wall below the threshold in both scans.
    pub dark_in_both_percent: f64,
    /// What the later scan lacks in the regions that lost uptake, per cent of the whole wall's uptake.
    pub lost_percent: f64,
    /// The least loss, per cent, that is found in nine of ten such pairs if it takes up a territory.
    pub detectable_percent: f64,
    /// Standard deviation of the smoothed difference by the noise of this pair, points.
    pub noise_points: f64,
    /// Counts of the later scan that are one count of the earlier one where nothing changed.
    pub scale: f64,
    /// Share of the wall by which the later scan was scaled.
    pub matched_percent: f64,
    /// Share of the wall with muscle in both scans.
    pub compared_percent: f64,
    /// Correlation of both maps.
    pub correlation: f64,
    /// The 17 segments.
    pub segments: Vec<SerialSegmentReport>,
}

/// The change of a segment from an earlier to a later scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = SerialSegment))]
pub struct SerialSegmentReport {
    /// Its number, 1 to 17.
    pub segment: usize,
    /// Its name.
    pub name: String,
    /// Its mean uptake in the earlier scan; `null` where nothing can be compared, as for the others.
    pub earlier_percent: Option<f64>,
    /// In the later one.
    pub later_percent: Option<f64>,
    /// The later less the earlier, points.
    pub change_points: Option<f64>,
    /// Its 95 % interval.
    pub change_interval_points: Option<[f64; 2]>,
    /// Whether it changed.
    pub change_verdict: Option<Verdict>,
    /// Change of the inward motion, mm; `null` unless all scans are gated.
    pub motion_change_mm: Option<f64>,
    /// Change of the thickening, points.
    pub thickening_change_points: Option<f64>,
}

impl SerialReport {
    /// The change of the figure between two scans.
    pub fn change(
        &self,
        figure: &str,
        earlier: usize,
        later: usize,
    ) -> Option<&FigureChangeReport> {
        let is = |own: &&FigureChangeReport| {
            (own.figure.as_str(), own.earlier, own.later) == (figure, earlier, later)
        };
        self.changes.iter().find(is)
    }
}
