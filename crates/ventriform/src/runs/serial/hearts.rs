//! The hearts of a serial comparison.

use crate::heart::beat::SegmentMotion;
use crate::heart::comparison::{Answer, Change, FigureChange, ScoreAnswers};
use crate::heart::serial::{Registration, SERIAL_FIGURES, SerialFlag};
use crate::image::volume::Provenance;
use crate::parameters::{FitParameters, SerialChoice};
use crate::runs::rest_stress::ComparedHeart;

/// Least changes that matter: of a share of the wall, a deficit and a summed score.
const EXTENT_MATTERS_PERCENT: f64 = 5.0;
const DEFICIT_MATTERS_PERCENT: f64 = 5.0;
const SCORE_MATTERS: f64 = 3.0;

/// A scan of a series.
#[derive(Debug)]
pub struct SerialScan {
    /// Its number as it was given, from 1.
    pub given: usize,
    /// The heart, fitted from the common one.
    pub heart: ComparedHeart,
    /// Where it lies against that of the first scan.
    pub registration: Registration,
    /// Mass of the muscle by the fit of this scan alone, g.
    pub own_mass_g: f64,
    /// Whether it was fitted from the common heart. Otherwise no wall was found from there.
    pub fitted_again: bool,
}

/// Two scans beside each other, by their places in the order of dates, from 0.
#[derive(Debug)]
pub struct SerialPair {
    /// The earlier one.
    pub earlier: usize,
    /// The later one.
    pub later: usize,
    /// The change of uptake: the later scan stands where that at stress does in a comparison of rest and stress.
    pub change: Change,
    /// The scores beside normal limits, of the later scan before those of the earlier one.
    pub scores: Option<ScoreAnswers>,
}

/// The figure of a pair that changed or did not.
#[derive(Debug, Clone, Copy)]
pub(super) struct PairFigure {
    /// Its place in the report of a scan.
    pub place: &'static str,
    /// Its change.
    pub change: FigureChange,
}

/// The scans of one patient, compared.
#[derive(Debug)]
pub struct SerialHearts {
    /// The scans, in the order of their dates, or as they were given.
    pub scans: Vec<SerialScan>,
    /// Every scan against the first one, and then against the one before it.
    pub pairs: Vec<SerialPair>,
    /// Whether all scans are gated.
    pub gated: bool,
    /// Reasons to look closer.
    pub flags: Vec<SerialFlag>,
    /// The parameters of the fits.
    pub fit: FitParameters,
    /// The parameters of the comparison.
    pub choice: SerialChoice,
}

impl SerialScan {
    /// Whose scan it is; `None` unless the files are DICOM.
    pub fn provenance(&self) -> Option<&Provenance> {
        self.heart.provenance()
    }

    /// The figure at a place of the report of a scan; `None` where the scan has none.
    pub fn figure(&self, place: &str) -> Option<f64> {
        let beat = self.heart.beat().map(|own| &own.beat);
        let phases = beat.filter(|beat| beat.has_phases());
        let mean = |of: &dyn Fn(&SegmentMotion) -> f64| {
            let segments = &beat?.segments;
            let sum: f64 = segments.iter().map(of).sum();
            (!segments.is_empty()).then(|| sum / segments.len() as f64)
        };
        match place {
            "ef_percent" => beat?.ef_percent,
            "edv_ml" => Some(beat?.end_diastole.cavity_ml),
            "esv_ml" => Some(beat?.end_systole.cavity_ml),
            "cavity_ml" => Some(self.heart.cavity_ml()),
            "mass_g" => Some(self.own_mass_g),
            "dark_percent" => Some(self.heart.map()?.extent_percent),
            "motion_mm" => mean(&|segment| segment.motion_mm),
            "thickening_percent" => mean(&|segment| segment.thickening_percent),
            "phase_sd_degrees" => Some(phases?.phases.sd_degrees),
            "phase_bandwidth_degrees" => Some(phases?.phases.bandwidth_degrees),
            "extent_percent" => Some(self.heart.perfusion()?.extent_percent),
            "deficit_percent" => Some(self.heart.perfusion()?.deficit_percent),
            "summed_score" => Some(f64::from(self.heart.perfusion()?.summed_score)),
            _ => None,
        }
        .filter(|value| value.is_finite())
    }

    /// Beats a minute; `None` unless the scan is gated and its R-R interval is known.
    pub fn beats_per_minute(&self) -> Option<f64> {
        Some(60_000.0 / self.heart.beat()?.rr_ms?)
    }
}

impl SerialPair {
    /// The figures that both of `scans` have, with their changes.
    pub(super) fn figures(&self, scans: &[SerialScan]) -> Vec<PairFigure> {
        let [earlier, later] = [self.earlier, self.later].map(|place| &scans[place]);
        let noise_points = self.change.noise.points;
        let measured = SERIAL_FIGURES.iter().filter_map(|figure| {
            let (before, after) = (earlier.figure(figure.place)?, later.figure(figure.place)?);
            Some(PairFigure {
                place: figure.place,
                change: figure.change(before, after, noise_points),
            })
        });
        let mut figures: Vec<PairFigure> = measured.collect();
        if let Some(scores) = &self.scores {
            let [after, before] = scores.extent;
            let of = |place, [before, after]: [Answer; 2], matters| {
                let values = [before.value, after.value];
                let intervals = [before.interval, after.interval];
                PairFigure {
                    place,
                    change: FigureChange::of_intervals(values, intervals, matters),
                }
            };
            figures.push(of(
                "extent_percent",
                [before, after],
                EXTENT_MATTERS_PERCENT,
            ));
            let [after, before] = scores.deficit;
            figures.push(of(
                "deficit_percent",
                [before, after],
                DEFICIT_MATTERS_PERCENT,
            ));
            figures.push(of("summed_score", [scores.srs, scores.sss], SCORE_MATTERS));
        }
        figures
    }
}
