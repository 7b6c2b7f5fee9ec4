//! Other figures of a wall than its uptake, laid flat as a polar map is.
//!
//! In: a figure of every ray and of every segment, and the [`PolarMap`] of the same wall, which knows segments and
//! sides. Out: a [`FigureMap`], drawn by [`figure_svg`](super::figure_svg), written as a
//! [`FigureDocument`](super::FigureDocument). The colours have the same range for every patient.

use super::PolarMap;
use serde::{Deserialize, Serialize};

/// A figure of the wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum WallFigure {
    /// Motion inward from end diastole to end systole, mm.
    Motion,
    /// Thickening from end diastole to end systole, per cent.
    Thickening,
    /// Phase of the greatest thickness, degrees of the cycle.
    Phase,
    /// Uptake at rest less that at stress, per cent of that at rest.
    Difference,
    /// Uptake against normal limits, standard deviations from the normal mean.
    Z,
    /// Score of the uptake against normal limits, 0 to 4.
    Score,
}

impl WallFigure {
    /// Those of a beat.
    pub const OF_BEAT: [Self; 3] = [Self::Motion, Self::Thickening, Self::Phase];

    /// Its name in reports and file names.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Motion => "motion",
            Self::Thickening => "thickening",
            Self::Phase => "phase",
            Self::Difference => "difference",
            Self::Z => "z",
            Self::Score => "score",
        }
    }

    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Motion => "mm",
            Self::Thickening | Self::Difference => "%",
            Self::Phase => "degrees",
            Self::Z => "SD",
            Self::Score => "score",
        }
    }

    /// The values of the first and the last colour.
    pub fn range(self) -> [f64; 2] {
        match self {
            Self::Motion => [0.0, 12.0],
            Self::Thickening => [0.0, 80.0],
            Self::Phase => [0.0, 360.0],
            Self::Difference => [-50.0, 50.0],
            Self::Z => [-5.0, 0.0],
            Self::Score => [4.0, 0.0],
        }
    }

    /// Decimals of a segment's mean on the drawn map.
    pub(super) fn decimals(self) -> usize {
        usize::from(self == Self::Z)
    }

    /// Whether the figure stands on uptake, so that it has no place in the valve plane.
    pub fn is_of_uptake(self) -> bool {
        matches!(self, Self::Difference | Self::Z | Self::Score)
    }

    pub(super) fn ticks(self) -> &'static [f64] {
        match self {
            Self::Motion => &[0.0, 3.0, 6.0, 9.0, 12.0],
            Self::Thickening => &[0.0, 20.0, 40.0, 60.0, 80.0],
            Self::Phase => &[0.0, 90.0, 180.0, 270.0, 360.0],
            Self::Difference => &[-50.0, -25.0, 0.0, 25.0, 50.0],
            Self::Z => &[-5.0, -4.0, -3.0, -2.0, -1.0, 0.0],
            Self::Score => &[4.0, 3.0, 2.0, 1.0, 0.0],
        }
    }

    pub(super) fn title(self) -> &'static str {
        match self {
            Self::Motion => {
                "Motion of the wall inward from end diastole to end systole, mm; blue: outward; grey: no wall"
            }
            Self::Thickening => {
                "Thickening of the wall from end diastole to end systole, per cent; blue: thinning; grey: no wall"
            }
            Self::Phase => {
                "Phase of the wall's greatest thickness, degrees of the cycle; grey: no wall, or none that moves"
            }
            Self::Difference => {
                "Uptake at rest less that at stress, per cent of the rest scan's reference; orange: less at stress; \
                 grey: no wall in one of them; hatched: valve plane at rest"
            }
            Self::Z => {
                "Uptake against normal limits, standard deviations from the normal mean; grey: nothing to compare; \
                 hatched: valve plane"
            }
            Self::Score => {
                "Score of the uptake against normal limits, 0 to 4; grey: nothing to compare; hatched: valve plane"
            }
        }
    }
}

/// A figure of the wall on a polar map.
#[derive(Debug, Clone)]
pub struct FigureMap<'a> {
    /// The map of the same wall's uptake.
    pub map: &'a PolarMap,
    /// The figure.
    pub figure: WallFigure,
    /// The figure of every ray, as many as the map has pixels, in their order; `None` where there is none.
    pub values: Vec<Option<f64>>,
    /// The figure of the segments 1 to 17; `None` where there is none.
    pub segments: [Option<f64>; 17],
}
