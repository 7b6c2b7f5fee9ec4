//! The part of a report about the projections that slices were reconstructed of.

use super::json_number::round;
use crate::heart::views::{HeartMotion, Move};
use crate::image::reconstruct::Projections;
use crate::image::reconstruct::motion::ViewShift;
use serde::{Deserialize, Serialize};

/// The projections that slices were reconstructed of, and the heart's motion in them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ProjectionsReport {
    /// Edge of a pixel, mm.
    pub pixel_mm: f64,
    /// Counts of all views.
    pub counts: f64,
    /// The views, in the order in which the camera turned.
    pub views: Vec<ViewReport>,
    /// Whether the heart moved; `null` if that was not measured.
    pub moved: Option<bool>,
    /// How it moved.
    pub moves: Vec<MoveReport>,
    /// The greatest distance between its places in two views, mm: along the table, and across it on the detector.
    pub range_mm: Option<[f64; 2]>,
    /// What the fit gave before the views were shifted back; `null` if they were not.
    pub uncorrected: Option<UncorrectedReport>,
}

/// One view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ViewReport {
    /// Angle of the detector about the patient, degrees: 0 at the back, 90 at the left side.
    pub angle_deg: f64,
    /// Number in time, from 1; views of several detectors at one time have the same.
    pub time: usize,
    /// Counts.
    pub counts: f64,
    /// How far towards the head the heart lay from its mean place, mm, as measured in this view alone.
    pub along_mm: Option<f64>,
    /// How far towards higher columns of the detector, mm.
    pub across_mm: Option<f64>,
    /// The first by the moves that are told, mm.
    pub moved_along_mm: Option<f64>,
    /// The second by the moves that are told, mm.
    pub moved_across_mm: Option<f64>,
}

/// One movement of the heart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct MoveReport {
    /// `step`, or `drift` over the whole scan.
    pub kind: String,
    /// Number in time of the first view after a step, from 1.
    pub from_time: Option<usize>,
    /// Towards the head, mm.
    pub head_mm: f64,
    /// To the left of the patient, mm.
    pub left_mm: f64,
    /// To the back of the patient, mm.
    pub back_mm: f64,
}

/// What a fit gave before views were shifted back.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct UncorrectedReport {
    /// Confidence.
    pub confidence: f64,
    /// Volume of the wall, ml.
    pub wall_ml: f64,
    /// Volume of the cavity, ml.
    pub cavity_ml: Option<f64>,
    /// Uptake of the 17 segments, % of the reference.
    pub segments_percent: Vec<Option<f64>>,
    /// What each segment gained by the correction, points.
    pub segments_change: Vec<Option<f64>>,
}

impl ProjectionsReport {
    /// The report of `projections` in which the heart moved as `motion` says.
    pub fn new(
        projections: &Projections,
        motion: Option<&HeartMotion>,
        uncorrected: Option<UncorrectedReport>,
    ) -> Self {
        let views = projections.views.iter().enumerate().map(|(number, view)| {
            let shift =
                |of: fn(&HeartMotion) -> &[ViewShift]| motion.map(|motion| of(motion)[number]);
            let (measured, moved) = (shift(|m| &m.measured), shift(|m| &m.shifts));
            ViewReport {
                angle_deg: round(view.angle_deg.rem_euclid(360.0)),
                time: view.time + 1,
                counts: projections.counts_of(number),
                along_mm: measured.map(|shift| round(shift.along_mm)),
                across_mm: measured.map(|shift| round(shift.across_mm)),
                moved_along_mm: moved.map(|shift| round(shift.along_mm)),
                moved_across_mm: moved.map(|shift| round(shift.across_mm)),
            }
        });
        let views: Vec<ViewReport> = views.collect();
        Self {
            pixel_mm: round(projections.pixel_mm),
            counts: views.iter().map(|view| view.counts).sum(),
            views,
            moved: motion.map(HeartMotion::moved),
            moves: motion.map_or_else(Vec::new, |motion| {
                motion.moves.iter().map(MoveReport::of_move).collect()
            }),
            range_mm: motion.map(|motion| motion.range_mm().map(round)),
            uncorrected,
        }
    }
}

impl MoveReport {
    fn of_move(own: &Move) -> Self {
        let (kind, from_time, [head, left, back]) = match *own {
            Move::Along { view, head_mm } => ("step", Some(view + 1), [head_mm, 0.0, 0.0]),
            Move::Across {
                view,
                left_mm,
                back_mm,
            } => ("step", Some(view + 1), [0.0, left_mm, back_mm]),
            Move::Drift { head_mm } => ("drift", None, [head_mm, 0.0, 0.0]),
        };
        Self {
            kind: kind.into(),
            from_time,
            head_mm: round(head),
            left_mm: round(left),
            back_mm: round(back),
        }
    }

    /// The movement in words.
    pub fn text(&self) -> String {
        let parts = [
            (self.head_mm, "towards the head", "towards the feet"),
            (self.left_mm, "to the left", "to the right"),
            (self.back_mm, "to the back", "to the front"),
        ];
        let parts: Vec<String> = parts
            .into_iter()
            .filter(|(mm, ..)| *mm != 0.0)
            .map(|(mm, up, down)| {
                format!("{:.1} mm {}", mm.abs(), if mm > 0.0 { up } else { down })
            })
            .collect();
        let parts = parts.join(" and ");
        match self.from_time {
            Some(time) => format!("a step of {parts} before view {time}"),
            None => format!("a drift of {parts} over the whole scan"),
        }
    }
}
