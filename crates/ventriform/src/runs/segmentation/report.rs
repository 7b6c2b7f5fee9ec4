//! From a segmentation to its report.

use super::acquired::Acquired;
use super::from_files::SegmentedVolume;
use super::segment::Segmentation;
use crate::heart::polar::{PolarMap, PolarSummary};
use crate::parameters::Parameters;
use crate::results::report::{
    AgreementReport, AppliedReaderReport, CandidateReport, FileFacts, PerfusionReport,
    RefusedTemplateReport, Resolution, SegmentationParts, SegmentationReport, impression,
};

impl SegmentedVolume {
    /// The report: the segmentation's figures, every parameter, the facts about the volume's file and
    /// warnings.
    pub fn report(&self) -> SegmentationReport {
        let segmentation = &self.segmentation;
        let parts = SegmentationParts {
            template: segmentation.candidates[segmentation.chosen].name.clone(),
            choice: choice(segmentation),
            candidates: candidates(segmentation),
            refused: (segmentation.refused.iter())
                .map(|refused| RefusedTemplateReport {
                    template: refused.name.clone(),
                    reason: refused.reason.clone(),
                })
                .collect(),
            resolution: (segmentation.resolution)
                .map(|resolution| Resolution::new(resolution.value, resolution.given)),
            reader: segmentation.reader.as_ref().map(|applied| {
                let reader = &applied.reader;
                AppliedReaderReport::new(&reader.name, &reader.profile, applied.share)
            }),
            measures: segmentation
                .agreement
                .as_ref()
                .map(AgreementReport::from_agreement),
            polar: segmentation
                .polar
                .as_ref()
                .map(|map| self.polar_summary(map)),
            perfusion: (self.perfusion.as_ref().zip(segmentation.polar.as_ref()))
                .map(|(perfusion, map)| PerfusionReport::new(perfusion, map)),
            projections: self.acquired.as_ref().map(Acquired::report),
            parameters: self.parameters.to_json(),
            input: FileFacts::from_facts(&self.reading.facts),
            warnings: self.warnings(),
        };
        let mut report = SegmentationReport::new(&segmentation.fit, parts);
        let said = impression::of_segmentation(&report);
        report.impression = (!said.is_empty()).then_some(said);
        report
    }

    /// The map's summary, with a note on attenuation where no normal limits stand beside it.
    fn polar_summary(&self, map: &PolarMap) -> PolarSummary {
        let stated = self.parameters.scan.attenuation_corrected;
        let header = self.reading.provenance.as_ref();
        let corrected = stated.or_else(|| header?.attenuation_corrected());
        PolarSummary::from_map(map).with_attenuation(corrected, self.perfusion.is_some())
    }
}

fn candidates(segmentation: &Segmentation) -> Vec<CandidateReport> {
    let candidates = segmentation.candidates.iter();
    let figures = candidates.map(|candidate| CandidateReport {
        template: candidate.name.clone(),
        confidence: candidate.confidence,
        merit: candidate.merit,
        active: candidate.active,
        strain: candidate.strain,
        residual_mm: candidate.residual,
    });
    figures.map(CandidateReport::rounded).collect()
}

/// Why this template was chosen, in a sentence.
fn choice(segmentation: &Segmentation) -> String {
    let chosen = &segmentation.candidates[segmentation.chosen];
    let others = segmentation.candidates.iter().enumerate();
    let next = others
        .filter(|(place, _)| *place != segmentation.chosen)
        .map(|(_, candidate)| candidate)
        .max_by(|a, b| a.confidence.total_cmp(&b.confidence));
    match next {
        None => format!("{} was the only model fitted", chosen.name),
        Some(next) => format!(
            "{} has the greatest confidence by its own figures, {:.2} (next {}: {:.2}): edges seen \
             along {:.0} % of its surface, {:.1} mm off in the mean",
            chosen.name,
            chosen.confidence,
            next.name,
            next.confidence,
            100.0 * chosen.active,
            chosen.residual,
        ),
    }
}
