//! A scan beside normal limits, as it is written in reports.

use super::json_number::round;
use super::raised_flag::RaisedFlag;
use crate::normals::{ComparedFigure, GroupSex, NormalsFlag, Perfusion, Z_LIMIT};
use crate::polar::PolarMap;
use serde::{Deserialize, Serialize};

/// What the deficit score is, for whoever reads it.
const DEFICIT_NOTE: &str =
    "deficit score against the normal limits named here; TPD-like, not comparable with QPS's";

/// The wall's uptake beside normal limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = Perfusion))]
pub struct PerfusionReport {
    /// The limits.
    pub normals: NormalsUsed,
    /// What the figures are.
    pub note: String,
    /// Standard deviations below the normal mean at which the limit lies.
    pub z_limit: f64,
    /// Deficit score: mean score of the wall, per cent of the greatest.
    pub deficit_percent: f64,
    /// Share of the wall below the limit.
    pub extent_percent: f64,
    /// Mean of |z| there; null where nothing is below it.
    pub severity: Option<f64>,
    /// Sum of the segments' scores, 0 to 68.
    pub summed_score: u32,
    /// The same in per cent of 68.
    pub summed_percent: f64,
    /// The 17 segments.
    pub segments: Vec<SegmentScore>,
    /// The walls of the three arteries.
    pub territories: Vec<TerritoryScore>,
    /// Figures of the heart beside their limits; empty where the file has none.
    pub figures: Vec<FigureBeside>,
    /// Reasons to look closer.
    pub flags: Vec<RaisedFlag>,
}

/// The group of normal limits that a scan was compared with.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct NormalsUsed {
    /// SHA-256 of the limits, hexadecimal.
    pub sha256: String,
    /// Whether the people are simulated.
    pub simulated: bool,
    /// What the people are.
    pub people: String,
    /// `M`, `F` or `mixed`.
    pub sex: GroupSex,
    /// The protocol.
    pub protocol: String,
    /// The tracer.
    pub tracer: String,
    /// Whether attenuation was corrected.
    pub attenuation_corrected: bool,
    /// Number of people.
    pub cases: usize,
}

/// A segment beside its limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SegmentScore {
    /// Its number, 1 to 17.
    pub segment: usize,
    /// Its name.
    pub name: String,
    /// Mean of z: standard deviations from the normal mean, negative below; null where nothing can be compared.
    pub z: Option<f64>,
    /// Score, 0 to 4.
    pub score: Option<u8>,
    /// Share of its wall below the limit.
    pub extent_percent: f64,
    /// Mean score of its wall, per cent of the greatest.
    pub deficit_percent: f64,
    /// Share of its area that has limits and muscle.
    pub compared_percent: f64,
}

/// The wall of an artery beside its limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct TerritoryScore {
    /// LAD, LCX or RCA.
    pub name: String,
    /// Share of its wall below the limit.
    pub extent_percent: f64,
    /// Mean score of its wall, per cent of the greatest.
    pub deficit_percent: f64,
    /// Sum of its segments' scores.
    pub summed_score: u32,
}

/// A figure beside its limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FigureBeside {
    /// Its name in the limits, with its unit.
    pub figure: String,
    /// The segment, 1 to 17; null for the whole heart.
    pub segment: Option<usize>,
    /// This scan's.
    pub value: f64,
    /// Standard deviations from the normal mean; null where people do not differ.
    pub z: Option<f64>,
    /// Whether it lies between `low` and `high`.
    pub within: bool,
    /// Number of people.
    pub n: usize,
    /// Normal mean.
    pub mean: f64,
    /// Normal standard deviation.
    pub sd: f64,
    /// Quantile of 2.5 per cent.
    pub low: f64,
    /// Quantile of 97.5 per cent.
    pub high: f64,
}

impl PerfusionReport {
    /// The figures of `perfusion`, whose segments `map` names.
    pub fn of(perfusion: &Perfusion, map: &PolarMap) -> Self {
        let group = &perfusion.group;
        let flag = |flag: &NormalsFlag| RaisedFlag::new(flag.code(), flag);
        Self {
            normals: NormalsUsed {
                sha256: group.sha256.clone(),
                simulated: group.simulated,
                people: group.people.clone(),
                sex: group.sex,
                protocol: group.protocol.clone(),
                tracer: group.tracer.clone(),
                attenuation_corrected: group.attenuation_corrected,
                cases: group.cases,
            },
            note: DEFICIT_NOTE.to_owned(),
            z_limit: Z_LIMIT,
            deficit_percent: round(perfusion.deficit_percent),
            extent_percent: round(perfusion.extent_percent),
            severity: perfusion.severity.map(round),
            summed_score: perfusion.summed_score,
            summed_percent: round(perfusion.summed_percent),
            segments: (perfusion.segments.iter())
                .map(|segment| SegmentScore {
                    segment: segment.segment,
                    name: map.name_of(segment.segment),
                    z: segment.z.map(round),
                    score: segment.score,
                    extent_percent: round(segment.extent_percent),
                    deficit_percent: round(segment.deficit_percent),
                    compared_percent: round(segment.compared_percent),
                })
                .collect(),
            territories: (perfusion.territories.iter())
                .map(|territory| TerritoryScore {
                    name: territory.name.to_owned(),
                    extent_percent: round(territory.extent_percent),
                    deficit_percent: round(territory.deficit_percent),
                    summed_score: territory.summed_score,
                })
                .collect(),
            figures: perfusion.figures.iter().map(FigureBeside::of).collect(),
            flags: perfusion.flags.iter().map(flag).collect(),
        }
    }
}

impl FigureBeside {
    fn of(figure: &ComparedFigure) -> Self {
        Self {
            figure: figure.figure.clone(),
            segment: figure.segment,
            value: round(figure.value),
            z: figure.z.map(round),
            within: figure.within,
            n: figure.n,
            mean: round(figure.mean),
            sd: round(figure.sd),
            low: round(figure.low),
            high: round(figure.high),
        }
    }
}
