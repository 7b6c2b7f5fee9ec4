//! The polar map as it is written in `polar.json` and summed up in reports, and maps of other figures.

use super::figure::{FigureMap, WallFigure};
use super::picture::rings;
use super::{Pixel, PlaceState, PolarMap, RAY_COLUMNS, RAY_ROWS, Segment, territory};
use serde::{Deserialize, Serialize};

/// A polar map without its pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct PolarSummary {
    /// The intensity that counts as 100 per cent.
    pub reference: f64,
    /// Share of it below which wall counts as a defect.
    pub threshold_percent: f64,
    /// Share of the wall below it.
    pub extent_percent: f64,
    /// The reference of the percentages.
    pub note: String,
    /// The 17 segments.
    pub segments: Vec<PolarSegment>,
    /// The walls of the three arteries; none if the orientation is unknown.
    pub territories: Vec<PolarTerritory>,
    /// Rows of pixels, from apex to base.
    pub rows: usize,
    /// Columns of pixels, around the axis.
    pub columns: usize,
    /// Source of the sides of the wall: `superior`, `anterior`, `body`, `frame` or `unknown`.
    pub orientation: String,
    /// Where the first column looks; null if the orientation is unknown.
    pub first_column: Option<String>,
    /// The order of the columns; null if the orientation is unknown.
    pub direction: Option<String>,
    /// What attenuation may have to do with the extent; in reports only, where nothing says that it was corrected,
    /// no normal limits were used, and inferior wall lies below the threshold.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attenuation: Option<PolarAttenuation>,
}

/// What attenuation may have to do with the extent of a map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct PolarAttenuation {
    /// False if the header or the caller says that attenuation was not corrected; null if nothing says it.
    pub corrected: Option<bool>,
    /// The part of `extent_percent` that lies in inferior, inferoseptal and inferolateral segments.
    pub inferior_extent_percent: f64,
    /// Both in words, and what is usual without correction.
    pub note: String,
}

/// A polar map, as in `polar.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = PolarMap))]
pub struct PolarDocument {
    /// All but the pixels.
    #[serde(flatten)]
    pub summary: PolarSummary,
    /// The pixels in per cent of the reference; null where there is no muscle.
    pub values_percent: Vec<Vec<Option<f64>>>,
    /// What lies at each pixel: `muscle`, `valve_plane` (hatched, and in no figure) or `no_wall`.
    pub states: Vec<Vec<PlaceState>>,
    /// The number of the segment to which each pixel belongs.
    pub segment_of: Vec<Vec<usize>>,
    /// For every column, the distances from the apex in rows at which apex, apical, mid and basal level
    /// end; row n reaches from n to n + 1.
    pub level_ends: Vec<[f64; 4]>,
    /// The radii at which these levels end on the drawn map, as shares of its own.
    pub rings: [f64; 4],
}

/// The wall that an artery usually feeds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = Territory))]
pub struct PolarTerritory {
    /// LAD, LCX or RCA.
    pub name: String,
    /// Mean uptake in per cent of the reference.
    pub mean_percent: Option<f64>,
    /// Share of its area below the threshold.
    pub extent_percent: f64,
    /// Area of its muscle, mm².
    pub area_mm2: f64,
}

/// One segment of a polar map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct PolarSegment {
    /// 1 to 17.
    pub number: usize,
    /// Its name.
    pub name: String,
    /// The coronary artery that usually feeds it; null if the orientation is unknown.
    pub territory: Option<String>,
    /// Mean uptake in per cent of the reference.
    pub mean_percent: Option<f64>,
    /// Share of its area below the threshold.
    pub extent_percent: f64,
    /// Area of its muscle, mm².
    pub area_mm2: f64,
}

/// A figure of the wall on a polar map, as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = PolarFigure))]
pub struct FigureDocument {
    /// The figure.
    pub figure: WallFigure,
    /// Its unit: `mm`, `%`, `degrees` of the cycle, `SD` or `score`.
    pub unit: String,
    /// The values of the first and the last colour of the drawn map.
    pub range: [f64; 2],
    /// Rows of pixels, from apex to base.
    pub rows: usize,
    /// Columns of pixels, around the axis.
    pub columns: usize,
    /// Source of the sides of the wall: `superior`, `anterior`, `body`, `frame` or `unknown`.
    pub orientation: String,
    /// The 17 segments.
    pub segments: Vec<FigureSegment>,
    /// The pixels; null where there is no wall, none that moves, or nothing to compare.
    pub values: Vec<Vec<Option<f64>>>,
    /// What lies at each pixel, of figures of uptake: `muscle`, `valve_plane` (hatched, and in no figure) or `no_wall`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub states: Option<Vec<Vec<PlaceState>>>,
    /// The number of the segment to which each pixel belongs.
    pub segment_of: Vec<Vec<usize>>,
    /// For every column, the distances from the apex in rows at which apex, apical, mid and basal level
    /// end; row n reaches from n to n + 1.
    pub level_ends: Vec<[f64; 4]>,
    /// The radii at which these levels end on the drawn map, as shares of its own.
    pub rings: [f64; 4],
}

/// The mean of a figure over a segment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FigureSegment {
    /// 1 to 17.
    pub number: usize,
    /// Its name.
    pub name: String,
    /// The mean; null where there is none.
    pub mean: Option<f64>,
}

pub(super) fn round(x: f64) -> f64 {
    (100.0 * x).round() / 100.0
}

impl PolarSummary {
    /// Segments and extents. Without orientation no territories, and `None` for what depends on sides.
    pub fn from_map(map: &PolarMap) -> Self {
        let oriented = map.is_oriented();
        let segment = |s: &Segment| PolarSegment {
            number: s.number,
            name: map.name_of(s.number),
            territory: oriented.then(|| territory(s.number).to_owned()),
            mean_percent: s.mean_percent.map(round),
            extent_percent: round(s.extent_percent),
            area_mm2: round(s.area),
        };
        let territories = map.territories.iter().filter(|_| oriented);
        let territories = territories.map(|t| PolarTerritory {
            name: t.name.to_owned(),
            mean_percent: t.mean_percent.map(round),
            extent_percent: round(t.extent_percent),
            area_mm2: round(t.area),
        });
        Self {
            reference: map.reference,
            threshold_percent: 100.0 * map.threshold,
            extent_percent: round(map.extent_percent),
            note: "per cent of the hottest quarter of this scan's own wall; no normal database, not TPD"
                .to_owned(),
            segments: map.segments.iter().map(segment).collect(),
            territories: territories.collect(),
            rows: RAY_ROWS,
            columns: RAY_COLUMNS,
            orientation: map.orientation.as_str().to_owned(),
            first_column: oriented.then(|| "lateral".to_owned()),
            direction: oriented.then(|| "lateral, anterior, septal, inferior".to_owned()),
            attenuation: None,
        }
    }
}

impl PolarDocument {
    /// The summary, the pixels in per cent of the reference (`None` where there is no muscle), and where the
    /// picture has them.
    pub fn from_map(map: &PolarMap) -> Self {
        let percent = |x: f64| {
            if map.reference > 0.0 {
                round(100.0 * x / map.reference)
            } else {
                0.0
            }
        };
        let pixels = map.pixels.chunks(RAY_COLUMNS);
        let pixels = pixels.map(|row| {
            let muscle = |p: &Option<Pixel>| p.filter(Pixel::is_muscle).map(|p| percent(p.max));
            row.iter().map(muscle).collect()
        });
        Self {
            summary: PolarSummary::from_map(map),
            values_percent: pixels.collect(),
            states: states(map),
            segment_of: segment_numbers(map),
            level_ends: level_ends(map),
            rings: ring_shares(map),
        }
    }
}

impl FigureDocument {
    /// The figure with where the picture has it.
    pub fn from_figure(figure: &FigureMap<'_>) -> Self {
        let map = figure.map;
        let segment = |(index, mean): (usize, &Option<f64>)| FigureSegment {
            number: index + 1,
            name: map.name_of(index + 1),
            mean: mean.map(round),
        };
        let rows = figure.values.chunks(RAY_COLUMNS);
        Self {
            figure: figure.figure,
            unit: figure.figure.unit().to_owned(),
            range: figure.figure.range(),
            rows: RAY_ROWS,
            columns: RAY_COLUMNS,
            orientation: map.orientation.as_str().to_owned(),
            segments: figure.segments.iter().enumerate().map(segment).collect(),
            values: rows
                .map(|row| row.iter().map(|value| value.map(round)).collect())
                .collect(),
            states: figure.figure.is_of_uptake().then(|| states(map)),
            segment_of: segment_numbers(map),
            level_ends: level_ends(map),
            rings: ring_shares(map),
        }
    }
}

/// The state of each pixel.
fn states(map: &PolarMap) -> Vec<Vec<PlaceState>> {
    let row = |row| {
        (0..RAY_COLUMNS)
            .map(move |column| map.state(row, column))
            .collect()
    };
    (0..RAY_ROWS).map(row).collect()
}

/// The number of the segment to which each pixel belongs.
fn segment_numbers(map: &PolarMap) -> Vec<Vec<usize>> {
    let numbers = |row| (0..RAY_COLUMNS).map(move |column| map.segment_of(row, column));
    (0..RAY_ROWS).map(|row| numbers(row).collect()).collect()
}

/// For every column, where the levels end, in rows.
fn level_ends(map: &PolarMap) -> Vec<[f64; 4]> {
    let ends = map.levels.ends().iter();
    let ends = ends.map(|ends| ends.map(|rows| (1e3 * rows).round() / 1e3));
    ends.collect()
}

/// The radii at which the levels end on the drawn map.
fn ring_shares(map: &PolarMap) -> [f64; 4] {
    rings(map).map(|share| (1e4 * share).round() / 1e4)
}
