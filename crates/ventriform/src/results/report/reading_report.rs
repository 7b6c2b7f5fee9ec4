//! What a reader states of a result: what is written as `reading.json`.
//!
//! Scores stand beside the automatic ones of the report that was read. Whose scan it is stands in the headers, not here.

use super::raised_flag::RaisedFlag;
use crate::parameters::{ReadingParameters, SegmentScores, StudyQuality};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The kind of result that was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum ReadKind {
    /// Rest and stress.
    Comparison,
    /// A single scan.
    Segmentation,
    /// The beat of a gated scan.
    Beat,
}

/// A reading. Everything but `scores` and `flags` is as the reader stated it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ReadingReport {
    /// Id of the result that was read.
    pub result: Option<String>,
    /// Its kind.
    pub kind: ReadKind,
    /// Id of the reading that this one replaces.
    pub amends: Option<String>,
    /// Who read.
    pub reader: String,
    /// When, RFC 3339 in UTC.
    pub read_at: String,
    /// `good`, `fair` or `poor`.
    pub quality: Option<String>,
    /// What limits the study.
    pub limits: Option<String>,
    /// The impression.
    pub impression: Option<String>,
    /// The scores of each scan that the reader scored.
    pub scores: Vec<ReadScores>,
    /// What the segments' scores at stress exceed those at rest by, if both were scored.
    pub sds: Option<u32>,
    /// Flags of the result that was read.
    pub flags: Vec<RaisedFlag>,
}

/// The scores of a scan, 0 (normal) to 4 (no uptake).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ReadScores {
    /// `stress`, `rest`, or `scan` where there is one scan.
    pub scan: String,
    /// Of the 17 segments, by the reader.
    #[cfg_attr(feature = "schema", schema(value_type = Vec<u8>))]
    pub segments: SegmentScores,
    /// Their sum, 0 to 68.
    pub sum: u32,
    /// The automatic ones; `null` without normal limits.
    pub automatic: Option<Vec<Option<u8>>>,
    /// Their sum.
    pub automatic_sum: Option<u32>,
}

/// The main statements of a reading; the report has all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ReadingSummary {
    /// Id of the result that was read.
    pub result: Option<String>,
    /// Id of the reading that this one replaces.
    pub amends: Option<String>,
    /// Who read.
    pub reader: String,
    /// When, RFC 3339 in UTC.
    pub read_at: String,
    /// `good`, `fair` or `poor`.
    pub quality: Option<String>,
    /// Summed stress score, or that of the only scan.
    pub sss: Option<u32>,
    /// Summed rest score.
    pub srs: Option<u32>,
    /// Summed difference score.
    pub sds: Option<u32>,
}

impl ReadScores {
    fn new(scan: &str, segments: SegmentScores, automatic: Option<Vec<Option<u8>>>) -> Self {
        let sum = |scores: &mut dyn Iterator<Item = u8>| scores.map(u32::from).sum();
        Self {
            scan: scan.to_owned(),
            segments,
            sum: sum(&mut segments.iter().copied()),
            automatic_sum: automatic
                .as_ref()
                .map(|scores| sum(&mut scores.iter().flatten().copied())),
            automatic,
        }
    }
}

impl ReadingReport {
    /// What `stated` says of the result with this report. `None` where the reader's name or the moment is missing.
    pub fn new(
        stated: &ReadingParameters,
        kind: ReadKind,
        report: &Map<String, Value>,
    ) -> Option<Self> {
        let scans = [
            ("stress", stated.stress_scores),
            ("rest", stated.rest_scores),
            ("scan", stated.scores),
        ];
        let scores = scans.into_iter().filter_map(|(scan, scores)| {
            Some(ReadScores::new(scan, scores?, automatic(report, scan)))
        });
        let flags = report.get("flags").cloned().unwrap_or_default();
        Some(Self {
            result: stated.result.clone(),
            kind,
            amends: stated.amends.clone(),
            reader: stated.reader.clone()?,
            read_at: stated.read_at.clone()?,
            quality: stated.quality.map(StudyQuality::as_str).map(str::to_owned),
            limits: stated.limits.clone(),
            impression: stated.impression.clone(),
            scores: scores.collect(),
            sds: (stated.stress_scores.zip(stated.rest_scores)).map(|(stress, rest)| {
                let exceeds = |(stress, rest): (u8, u8)| u32::from(stress.saturating_sub(rest));
                stress.into_iter().zip(rest).map(exceeds).sum()
            }),
            flags: serde_json::from_value(flags).unwrap_or_default(),
        })
    }

    /// The scores of that scan.
    pub fn scores_of(&self, scan: &str) -> Option<&ReadScores> {
        self.scores.iter().find(|scores| scores.scan == scan)
    }
}

impl ReadingSummary {
    /// The main statements of `reading`.
    pub fn from_reading(reading: &ReadingReport) -> Self {
        let sum = |scan: &str| reading.scores_of(scan).map(|scores| scores.sum);
        Self {
            result: reading.result.clone(),
            amends: reading.amends.clone(),
            reader: reading.reader.clone(),
            read_at: reading.read_at.clone(),
            quality: reading.quality.clone(),
            sss: sum("stress").or_else(|| sum("scan")),
            srs: sum("rest"),
            sds: reading.sds,
        }
    }
}

/// The automatic scores in the report of a comparison (`stress`, `rest`) or of one scan (`scan`).
fn automatic(report: &Map<String, Value>, scan: &str) -> Option<Vec<Option<u8>>> {
    let segments = match scan {
        "scan" => report.get("perfusion")?.get("segments")?,
        _ => report.get("segments")?,
    };
    let field = match scan {
        "scan" => "score".to_owned(),
        scan => format!("{scan}_score"),
    };
    let score = |segment: &Value| {
        let score = segment.get(&field)?.as_u64()?;
        u8::try_from(score).ok()
    };
    let scores: Vec<Option<u8>> = segments.as_array()?.iter().map(score).collect();
    scores.iter().any(Option::is_some).then_some(scores)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::results::report::comparison_report::tests::first_comparison;
    use crate::results::report::object;

    /// A reading of a comparison with limits.
    pub(crate) fn first_reading() -> ReadingReport {
        let mut report = first_comparison();
        for segment in &mut report.segments {
            segment.stress_score = Some(u8::from(segment.segment == 7) * 3);
            segment.rest_score = Some(0);
        }
        let mut scores = [0; 17];
        scores[6] = 4;
        let stated = ReadingParameters {
            result: Some("cmp_2c26b46b68ffc68ff99b453c1d304134".into()),
            reader: Some("Doe^Jane^^Dr.".into()),
            read_at: Some("2026-11-30T22:15:00Z".into()),
            stress_scores: Some(scores),
            rest_scores: Some([0; 17]),
            quality: Some(StudyQuality::Fair),
            impression: Some("Reversible defect.\nNo dilation.".into()),
            ..ReadingParameters::default()
        };
        ReadingReport::new(&stated, ReadKind::Comparison, &object(&report)).unwrap()
    }

    #[test]
    fn scores_stand_beside_the_automatic_ones() {
        let reading = first_reading();
        let stress = reading.scores_of("stress").unwrap();
        assert_eq!((stress.sum, stress.automatic_sum), (4, Some(3)));
        assert_eq!(stress.automatic.as_ref().unwrap()[6], Some(3));
        assert_eq!(reading.sds, Some(4));
        assert_eq!(reading.flags[0].code, "tid_uncertain");
        let summary = ReadingSummary::from_reading(&reading);
        assert_eq!((summary.sss, summary.srs), (Some(4), Some(0)));
        let text = serde_json::to_string(&reading).unwrap();
        assert_eq!(
            serde_json::from_str::<ReadingReport>(&text).unwrap(),
            reading
        );
    }
}
