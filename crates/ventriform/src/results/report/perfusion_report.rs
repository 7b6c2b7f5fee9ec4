//! A scan beside normal limits, as it is written in reports.

use super::json_number::round;
use super::raised_flag::RaisedFlag;
use crate::heart::normals::{FigureBeside, NormalsFlag, NormalsUsed, Perfusion, Z_LIMIT};
use crate::heart::polar::PolarMap;
use serde::{Deserialize, Serialize};

/// The meaning of the deficit score, for its reader.
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

impl PerfusionReport {
    /// The figures of `perfusion`, whose segments `map` names.
    pub fn new(perfusion: &Perfusion, map: &PolarMap) -> Self {
        let flag = |flag: &NormalsFlag| RaisedFlag::new(flag.code(), flag);
        Self {
            normals: perfusion.group.clone(),
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
            figures: perfusion
                .figures
                .iter()
                .map(FigureBeside::rounded)
                .collect(),
            flags: perfusion.flags.iter().map(flag).collect(),
        }
    }
}
