//! The report of a serial comparison.

use super::hearts::{SerialHearts, SerialPair, SerialScan};
use crate::base::numeric::decimals::round;
use crate::heart::comparison::FigureChange;
use crate::heart::polar::PolarSummary;
use crate::heart::serial::segment_error;
use crate::image::volume::Provenance;
use crate::parameters::SerialParameters;
use crate::results::report::{
    FigureChangeReport, FileFacts, RaisedFlag, Resolution, SerialPairReport, SerialReport,
    SerialScanReport, SerialSegmentReport,
};

/// The least change of a segment's uptake that matters, points.
const SEGMENT_MATTERS_POINTS: f64 = 10.0;

impl SerialHearts {
    /// The report.
    pub fn report(&self) -> SerialReport {
        let parameters = SerialParameters {
            fit: self.fit.clone(),
            choice: self.choice.clone(),
        };
        let scans = self.scans.iter().enumerate();
        SerialReport {
            scans: scans
                .map(|(place, scan)| scan_report(place + 1, scan))
                .collect(),
            changes: self.changes(),
            pairs: self
                .pairs
                .iter()
                .map(|pair| self.pair_report(pair))
                .collect(),
            gated: self.gated,
            flags: (self.flags.iter())
                .map(|flag| RaisedFlag::new(flag.code(), flag))
                .collect(),
            parameters: parameters.to_json(),
        }
    }

    /// Every figure that changed or did not, pair by pair.
    fn changes(&self) -> Vec<FigureChangeReport> {
        let of_pair = |pair: &SerialPair| {
            let (earlier, later) = (pair.earlier, pair.later);
            let figures = pair.figures(&self.scans).into_iter();
            figures
                .map(|own| change_report(own.place, [earlier + 1, later + 1], &own.change))
                .collect::<Vec<_>>()
        };
        self.pairs.iter().flat_map(of_pair).collect()
    }

    fn pair_report(&self, pair: &SerialPair) -> SerialPairReport {
        let change = &pair.change;
        let answers = &change.answers;
        let [earlier, later] = [pair.earlier, pair.later].map(|place| &self.scans[place]);
        let map = earlier.heart.map();
        let deviation = segment_error().of_noise(change.noise.points);
        let segments = change.segments.iter().map(|own| {
            let lost = own.figures.difference_points;
            let uptake = lost
                .map(|lost| FigureChange::of_deviation(-lost, deviation, SEGMENT_MATTERS_POINTS));
            let moved =
                |of: &dyn Fn(&SerialScan) -> Option<f64>| Some(round(of(later)? - of(earlier)?));
            let of_beat = |scan: &SerialScan, number: usize| {
                let segments = &scan.heart.beat()?.beat.segments;
                segments
                    .iter()
                    .find(|found| found.segment == number)
                    .copied()
            };
            SerialSegmentReport {
                segment: own.segment,
                name: map.map_or_else(String::new, |map| map.name_of(own.segment)),
                earlier_percent: own.figures.rest_percent.map(round),
                later_percent: own.figures.stress_percent.map(round),
                change_points: uptake.map(|own| round(own.change)),
                change_interval_points: uptake.map(|own| own.interval.map(round)),
                change_verdict: uptake.map(|own| own.verdict),
                motion_change_mm: moved(&|scan| Some(of_beat(scan, own.segment)?.motion_mm)),
                thickening_change_points: moved(&|scan| {
                    Some(of_beat(scan, own.segment)?.thickening_percent)
                }),
            }
        });
        SerialPairReport {
            earlier: pair.earlier + 1,
            later: pair.later + 1,
            worse_percent: round(answers.reversible.value),
            worse_interval_percent: answers.reversible.interval.map(round),
            worse_verdict: answers.reversible.verdict,
            better_percent: round(answers.reverse.value),
            better_interval_percent: answers.reverse.interval.map(round),
            better_verdict: answers.reverse.verdict,
            dark_in_both_percent: round(answers.fixed.value),
            lost_percent: round(change.lost_percent),
            detectable_percent: round(answers.detectable_percent),
            noise_points: round(change.noise.points),
            scale: round(change.scale),
            matched_percent: round(change.matched_percent),
            compared_percent: round(change.compared_percent),
            correlation: round(change.turn.correlation),
            segments: segments.collect(),
        }
    }
}

fn change_report(
    figure: &'static str,
    [earlier, later]: [usize; 2],
    change: &FigureChange,
) -> FigureChangeReport {
    FigureChangeReport {
        figure: figure.to_owned(),
        earlier,
        later,
        change: round(change.change),
        interval: change.interval.map(round),
        verdict: change.verdict,
        least_change: round(change.least),
    }
}

fn scan_report(number: usize, scan: &SerialScan) -> SerialScanReport {
    let heart = &scan.heart;
    let segmentation = heart.segmentation();
    let origin = scan.provenance();
    let facts = heart.facts();
    let figure = |place: &str| scan.figure(place).map(round);
    SerialScanReport {
        number,
        given: scan.given,
        date: origin.and_then(Provenance::day),
        series_description: origin.and_then(|own| own.series_description.clone()),
        template: heart.template().to_owned(),
        confidence: round(segmentation.fit.judgement.confidence),
        moved_mm: round(scan.registration.moved_mm),
        turned_degrees: round(scan.registration.motion.degrees()),
        correlation: round(scan.registration.correlation),
        resolution_mm: (segmentation.resolution).map(|own| Resolution::new(own.value, own.given)),
        beats_per_minute: scan.beats_per_minute().map(round),
        ef_percent: figure("ef_percent"),
        edv_ml: figure("edv_ml"),
        esv_ml: figure("esv_ml"),
        cavity_ml: figure("cavity_ml"),
        mass_g: figure("mass_g"),
        dark_percent: figure("dark_percent"),
        extent_percent: figure("extent_percent"),
        deficit_percent: figure("deficit_percent"),
        summed_score: figure("summed_score"),
        motion_mm: figure("motion_mm"),
        thickening_percent: figure("thickening_percent"),
        phase_sd_degrees: figure("phase_sd_degrees"),
        phase_bandwidth_degrees: figure("phase_bandwidth_degrees"),
        polar: heart.map().map(PolarSummary::from_map),
        input: FileFacts::from_facts(facts),
        warnings: facts.warnings.clone(),
    }
}
