//! The polar map: the wall's uptake laid flat, and its means over the AHA's 17 segments.
//!
//! In: a volume and the [`VentricleWall`] of a fitted model, as rays from the long axis. Out: a
//! [`PolarMap`], drawn by [`svg()`] and [`png()`], written as a [`PolarDocument`].
//!
//! 1. The image is blurred ([`PolarParameters::blur`]), because the largest of many noisy values
//!    is too large.
//! 2. Along each ray, the largest value is taken between the inner and the outer surface, extended by
//!    [`PolarParameters::extension`] on both sides.
//! 3. The reference, 100 per cent, is the mean of the largest values over the hottest quarter of
//!    this patient's wall. A high percentile would follow the noise of a few pixels.
//! 4. Means over the 17 segments of the American Heart Association (Cerqueira et al., Circulation
//!    2002), and the share of wall below [`PolarParameters::threshold`] of the reference. Each ray
//!    counts by the area of wall it stands for, several segments together by their whole areas.
//!
//! Levels ([`Levels`]): the long axis from the mean rim to the end of the cavity is cut into three equal
//! parts; a place of the wall is basal, mid or apical by the part that the middle of the wall lies in, and
//! belongs to the apex (segment 17) beyond the cavity's end. Rim and end of the cavity are those of the
//! anatomical wall: the apparent one ends too far from the apex, by what blur adds.
//!
//! On the map the apex is in the centre, the base at the rim, anterior on top, septum on the left, as seen
//! from the apex. With [`Projection::Standard`] the four levels have rings of equal width, as the
//! Association draws them; with [`Projection::Area`] every level has the share of the map that it has of
//! the wall.
//!
//! Where the muscle ends at the base is read in every direction from the image and the rim of the anatomical wall
//! (`heart/polar/base.rs`). Places beyond it, and the last
//! [`PolarParameters::rim_margin`] millimetres before it, of which blur takes much, are [`PlaceState::ValvePlane`]:
//! drawn hatched, and in no figure.
//!
//! [`FigureMap`] lays other figures of the same wall flat, such as its motion over a beat.
//!
//! Where nothing tells which side of the wall is anterior ([`OrientationSource::Unknown`]), the map has its
//! levels, but neither names of sides nor territories.
//!
//! Not guaranteed: the extent is not a TPD, a summed score or a diagnosis; [`crate::heart::normals`] compares
//! with healthy people. Without attenuation correction the base, which lies deeper in the body, is 20 to
//! 30 % below the apex in a heart of even uptake.

mod attenuation;
mod base;
mod document;
mod figure;
mod levels;
mod picture;
mod smoothing;

pub use document::{
    FigureDocument, FigureSegment, PolarAttenuation, PolarDocument, PolarSegment, PolarSummary,
    PolarTerritory,
};
pub use figure::{FigureMap, WallFigure};
pub use levels::{Level, Levels};
pub use picture::{colour_of, figure_png, figure_svg, png, svg};
pub use smoothing::MapGaussian;

use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
pub use crate::heart::model::wall::{RAY_COLUMNS, RAY_ROWS};
use crate::heart::model::wall::{VentricleWall, WallRay};
use crate::image::grid::Volume;
use crate::image::grid::field::Field;
use crate::image::locate::patient_orientation::OrientationSource;
use levels::MiddleSurface;
use serde::{Deserialize, Serialize};

/// Parameters of [`map`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PolarParameters {
    /// Share of the reference below which wall counts as a defect, 0..=1. Default 0.6: blur spreads
    /// the border of a defect, and only half-way between the uptake of the wall beside it (0.8 to 0.95 of the
    /// reference, without attenuation correction) and that of an infarct (0.25 to 0.4) does the border stay
    /// where it is. Over ten simulated infarcts of the apex
    /// the mean error of the extent is +4 % of the wall at 0.65 and +2 % at 0.6.
    pub threshold: f64,
    /// Length beyond the wall that is sampled on both sides, mm, 0..=10. Default 3.
    pub extension: f64,
    /// Gaussian blur of the image before it is sampled, sigma in mm, 0..=10. Default 3.
    pub blur: f64,
    /// Length of muscle at its end at the base that is masked, mm, 0..=20: blur takes more than a tenth of its uptake. Default 7.
    pub rim_margin: f64,
    /// Widths of the levels. Default [`Projection::Standard`].
    pub projection: Projection,
}

/// Widths of the levels on the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Projection {
    /// Rings of equal width.
    #[default]
    Standard,
    /// Each level has the share of the map's area that it has of the wall's.
    Area,
}

impl Default for PolarParameters {
    fn default() -> Self {
        Self {
            threshold: 0.6,
            extension: 3.0,
            blur: 3.0,
            rim_margin: 7.0,
            projection: Projection::Standard,
        }
    }
}

/// What a ray meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum PlaceState {
    /// Muscle.
    Muscle,
    /// The valves, or too little of the muscle's end to tell its uptake: hatched, and in no figure.
    ValvePlane,
    /// The fitted wall has no such place.
    NoWall,
}

/// The values along one ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pixel {
    /// Largest value on the way through the wall.
    pub max: f64,
    /// Area of wall that the ray stands for, mm².
    pub area: f64,
    /// The state of the place that the ray meets.
    pub state: PlaceState,
}

impl Pixel {
    /// Whether the ray meets muscle.
    pub fn is_muscle(&self) -> bool {
        self.state == PlaceState::Muscle
    }
}

/// One of the 17 segments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// 1..=17.
    pub number: usize,
    /// Area-weighted mean of the pixels' maxima in per cent of the reference; `None` where no
    /// ray met muscle.
    pub mean_percent: Option<f64>,
    /// Share of its muscle below the threshold, per cent.
    pub extent_percent: f64,
    /// Area of its muscle, mm².
    pub area: f64,
}

/// The segments that one coronary artery usually supplies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Territory {
    /// `LAD`, `LCX` or `RCA`.
    pub name: &'static str,
    /// As for a [`Segment`].
    pub mean_percent: Option<f64>,
    /// Share of its area below the threshold, per cent.
    pub extent_percent: f64,
    /// Wall area, mm².
    pub area: f64,
}

/// The map.
#[derive(Debug, Clone, PartialEq)]
pub struct PolarMap {
    /// [`RAY_ROWS`] × [`RAY_COLUMNS`] pixels, apex first; columns from lateral over anterior, septal
    /// and inferior. `None` where the fitted wall has no place.
    pub pixels: Vec<Option<Pixel>>,
    /// Mean maximum over the hottest quarter of the wall, image units: 100 per cent.
    pub reference: f64,
    /// Share of the reference below which wall counts as a defect.
    pub threshold: f64,
    /// The segments 1 to 17.
    pub segments: [Segment; 17],
    /// The territories of the three arteries.
    pub territories: [Territory; 3],
    /// Where the levels lie.
    pub levels: Levels,
    /// Widths of the levels.
    pub projection: Projection,
    /// The source of the patient's orientation. If it is unknown, levels hold, but no position of a level
    /// is known to be anterior: segments of a level are then counted from a convention.
    pub orientation: OrientationSource,
    /// Share of the whole wall below the threshold, per cent.
    pub extent_percent: f64,
}

/// Segments of the wall after the American Heart Association.
pub const SEGMENT_COUNT: usize = 17;

/// Names of the segments 1 to 17.
pub const SEGMENT_NAMES: [&str; SEGMENT_COUNT] = [
    "basal anterior",
    "basal anteroseptal",
    "basal inferoseptal",
    "basal inferior",
    "basal inferolateral",
    "basal anterolateral",
    "mid anterior",
    "mid anteroseptal",
    "mid inferoseptal",
    "mid inferior",
    "mid inferolateral",
    "mid anterolateral",
    "apical anterior",
    "apical septal",
    "apical inferior",
    "apical lateral",
    "apex",
];

/// The coronary artery that usually supplies a segment.
pub fn territory(segment: usize) -> &'static str {
    match segment {
        1 | 2 | 7 | 8 | 13 | 14 | 17 => "LAD",
        3 | 4 | 9 | 10 | 15 => "RCA",
        _ => "LCX",
    }
}

/// The names of the arteries of [`territory`].
pub const ARTERY_NAMES: [&str; 3] = ["LAD", "LCX", "RCA"];

/// The segments that the artery with this name usually supplies, 1..=17.
pub fn segments_of(artery: &str) -> impl Iterator<Item = usize> {
    (1..=17).filter(move |segment| territory(*segment) == artery)
}

/// The segment of a `level` at `angle` degrees counter-clockwise from lateral.
pub fn segment_at(level: Level, angle: f64) -> usize {
    // Sixths are centred on anterior (90°), quarters likewise.
    let sixth = ((angle - 60.0).rem_euclid(360.0) / 60.0) as usize % 6;
    let quarter = ((angle - 45.0).rem_euclid(360.0) / 90.0) as usize % 4;
    match level {
        Level::Apex => 17,
        Level::Apical => 13 + quarter,
        Level::Mid => 7 + sixth,
        Level::Basal => 1 + sixth,
    }
}

impl PolarMap {
    /// The map of a wall whose anterior side was taken from `source`.
    pub fn counted_by(self, source: OrientationSource) -> Self {
        Self {
            orientation: source,
            ..self
        }
    }

    /// The map of these pixels, counted by the volume's frame.
    fn through(
        pixels: Vec<Option<Pixel>>,
        levels: Levels,
        threshold: f64,
        projection: Projection,
    ) -> Self {
        let reference = reference(&pixels);
        let limit = threshold * reference;
        let indexed = || (0..pixels.len()).filter_map(|i| Some((i, pixels[i]?)));
        let segments: [Segment; 17] = std::array::from_fn(|s| {
            let own = indexed()
                .filter(|(i, _)| segment_of(&levels, i / RAY_COLUMNS, i % RAY_COLUMNS) == s + 1);
            summarise(s + 1, own.map(|(_, p)| p), reference, limit)
        });
        let territories = ARTERY_NAMES.map(|name| {
            let own = segments_of(name).map(|segment| &segments[segment - 1]);
            let (mean_percent, extent_percent, area) = together(own);
            Territory {
                name,
                mean_percent,
                extent_percent,
                area,
            }
        });
        let (_, extent_percent, _) = together(segments.iter());
        Self {
            reference,
            threshold,
            segments,
            territories,
            extent_percent,
            levels,
            projection,
            orientation: OrientationSource::default(),
            pixels,
        }
    }

    /// The map of another image of the same wall, such as a gate: `largest` are the largest values on each ray. Places,
    /// areas and sides stay.
    #[must_use]
    pub fn with_largest(&self, largest: &[f64]) -> Self {
        let pixels = (self.pixels.iter().zip(largest))
            .map(|(pixel, max)| pixel.map(|pixel| Pixel { max: *max, ..pixel }))
            .collect();
        Self::through(pixels, self.levels.clone(), self.threshold, self.projection)
            .counted_by(self.orientation)
    }

    /// Whether it is known which side of the map is anterior.
    pub fn is_oriented(&self) -> bool {
        self.orientation != OrientationSource::Unknown
    }

    /// The name of a segment: the Association's, or where no side is known, its level and its place there.
    pub fn name_of(&self, segment: usize) -> String {
        let (level, first, count) = match segment {
            _ if self.is_oriented() => return SEGMENT_NAMES[segment - 1].to_owned(),
            17 => return SEGMENT_NAMES[16].to_owned(),
            13..=16 => ("apical", 13, 4),
            7..=12 => ("mid", 7, 6),
            _ => ("basal", 1, 6),
        };
        format!("{level}, {} of {count}", segment - first + 1)
    }

    /// The uptake of the wall at a point, per cent of the reference, linear between the rays of `wall`, by
    /// which the map was made; NaN where no ray near it met muscle.
    pub fn uptake_at(&self, wall: &VentricleWall, point: &Vec3) -> f64 {
        let position = wall.position(point);
        let row = position.row.clamp(0.0, RAY_ROWS as f64 - 1.0);
        let (mut sum, mut weight) = (0.0, 0.0);
        for (r, of_row) in [(row.floor(), 1.0 - row.fract()), (row.ceil(), row.fract())] {
            for (c, of_column) in [
                (position.column.floor(), 1.0 - position.column.fract()),
                (position.column.floor() + 1.0, position.column.fract()),
            ] {
                let pixel = self.pixels[r as usize * RAY_COLUMNS + c as usize % RAY_COLUMNS];
                if let Some(pixel) = pixel.filter(Pixel::is_muscle) {
                    sum += of_row * of_column * pixel.max;
                    weight += of_row * of_column;
                }
            }
        }
        if weight > 0.0 && self.reference > 0.0 {
            100.0 * sum / weight / self.reference
        } else {
            f64::NAN
        }
    }

    /// The state of a pixel. Places beyond a column's last one with wall are of the valve plane.
    pub fn state(&self, row: usize, column: usize) -> PlaceState {
        let at = |row: usize| self.pixels[row * RAY_COLUMNS + column];
        match at(row) {
            Some(pixel) => pixel.state,
            None if row > RAY_ROWS / 2 && (row..RAY_ROWS).all(|row| at(row).is_none()) => {
                PlaceState::ValvePlane
            }
            None => PlaceState::NoWall,
        }
    }

    /// The segment of a pixel.
    pub fn segment_of(&self, row: usize, column: usize) -> usize {
        segment_of(&self.levels, row, column)
    }
}

fn segment_of(levels: &Levels, row: usize, column: usize) -> usize {
    let angle = 360.0 * (column as f64 + 0.5) / RAY_COLUMNS as f64;
    segment_at(levels.of_pixel(row, column), angle)
}

/// Samples `volume` along the rays of `wall`, the wall as it looks; `anatomical` is the wall itself, of the
/// same fit.
pub fn map(
    volume: &Volume,
    wall: &VentricleWall,
    anatomical: &VentricleWall,
    parameters: &PolarParameters,
) -> PolarMap {
    let ends = wall.rays.iter().filter_map(|r| {
        let reach = r.wall?[1] + parameters.extension;
        Some(r.start + r.direction * reach)
    });
    let points: Vec<Vec3> = ends.chain(wall.rays.iter().map(|r| r.start)).collect();
    let mut region = Aabb::around(&points);
    let border = Vec3::repeat(4.0 * parameters.blur);
    region.min -= border;
    region.max += border;
    let field = Field::new(volume, Some(&region), parameters.blur);
    let middle = MiddleSurface::from_wall(wall);
    let levels = Levels::new(&middle, anatomical);
    let reaches = reaches(wall);
    let largest: Vec<f64> = (wall.rays.iter().zip(&reaches))
        .map(|(ray, reach)| {
            reach.map_or(0.0, |reach| {
                largest(&field, ray, reach, parameters.extension)
            })
        })
        .collect();
    let ends = base::muscle_ends(&largest, wall, anatomical);
    let state = |row: usize, column: usize| {
        let left_mm = (ends[column] - (row as f64 + 0.5)) * wall.row_spacing;
        if left_mm < parameters.rim_margin {
            PlaceState::ValvePlane
        } else {
            PlaceState::Muscle
        }
    };
    let pixels: Vec<Option<Pixel>> = (wall.rays.iter().enumerate())
        .map(|(index, ray)| {
            let (row, column) = (index / RAY_COLUMNS, index % RAY_COLUMNS);
            ray.wall.map(|_| Pixel {
                max: largest[index],
                area: middle.area(row, column),
                state: state(row, column),
            })
        })
        .collect();
    PolarMap::through(pixels, levels, parameters.threshold, parameters.projection)
}

/// The distances at which each ray enters and leaves the wall; of one that misses it, those of the nearest ray of its column towards the apex that does not.
fn reaches(wall: &VentricleWall) -> Vec<Option<[f64; 2]>> {
    let mut last = [None; RAY_COLUMNS];
    let reach = |(index, ray): (usize, &WallRay)| {
        let last = &mut last[index % RAY_COLUMNS];
        *last = ray.wall.or(*last);
        *last
    };
    wall.rays.iter().enumerate().map(reach).collect()
}

/// Mean of the maxima over the hottest quarter of the muscle; 0 without any.
fn reference(pixels: &[Option<Pixel>]) -> f64 {
    let mut hottest: Vec<(f64, f64)> = pixels
        .iter()
        .flatten()
        .filter(|p| p.is_muscle())
        .map(|p| (p.max, p.area))
        .collect();
    hottest.sort_by(|a, b| b.0.total_cmp(&a.0));
    let quarter = 0.25 * hottest.iter().map(|h| h.1).sum::<f64>();
    let (mut area, mut sum) = (0.0, 0.0);
    for (max, piece) in hottest {
        let piece = piece.min(quarter - area);
        area += piece;
        sum += max * piece;
    }
    if area > 0.0 { sum / area } else { 0.0 }
}

/// The largest value on a ray between two distances, extended on both sides.
fn largest(field: &Field, ray: &WallRay, [enters, leaves]: [f64; 2], extension: f64) -> f64 {
    let from = (enters - extension).max(0.0);
    let to = leaves + extension;
    let steps = ((to - from).ceil() as usize).clamp(1, 200);
    let mut max = f64::NEG_INFINITY;
    for step in 0..=steps {
        let distance = from + (to - from) * step as f64 / steps as f64;
        max = max.max(field.at(&(ray.start + ray.direction * distance)));
    }
    max
}

fn summarise(
    number: usize,
    pixels: impl Iterator<Item = Pixel>,
    reference: f64,
    limit: f64,
) -> Segment {
    let (mut sum, mut low, mut area) = (0.0, 0.0, 0.0);
    for p in pixels {
        if !p.is_muscle() {
            continue;
        }
        area += p.area;
        sum += p.area * p.max;
        if p.max < limit {
            low += p.area;
        }
    }
    let known = area > 0.0 && reference > 0.0;
    Segment {
        number,
        mean_percent: known.then(|| 100.0 * sum / area / reference),
        extent_percent: if area > 0.0 { 100.0 * low / area } else { 0.0 },
        area,
    }
}

/// Mean, extent and area of several segments together, each by the area of its muscle.
fn together<'a>(segments: impl Iterator<Item = &'a Segment>) -> (Option<f64>, f64, f64) {
    let (mut sum, mut low, mut area) = (0.0, 0.0, 0.0);
    for segment in segments {
        if let Some(mean) = segment.mean_percent {
            sum += segment.area * mean;
            low += segment.area * segment.extent_percent;
            area += segment.area;
        }
    }
    if area > 0.0 {
        (Some(sum / area), low / area, area)
    } else {
        (None, 0.0, 0.0)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::image::draw::image::tests::decoded;
    use crate::image::grid::voxelise::voxelise;
    use crate::image::locate::cup::Cup;
    use crate::mesh::shapes;

    /// A map of muscle with this uptake (row, column), the places of a row together as large as those of any other.
    pub fn map_of(uptake: impl Fn(usize, usize) -> f64) -> PolarMap {
        let pixels = (0..RAY_ROWS * RAY_COLUMNS).map(|index| {
            Some(Pixel {
                max: uptake(index / RAY_COLUMNS, index % RAY_COLUMNS),
                area: 10.0,
                state: PlaceState::Muscle,
            })
        });
        PolarMap::through(pixels.collect(), Levels::even(), 0.6, Projection::Standard)
            .counted_by(OrientationSource::Frame)
    }

    /// A cup of revolution about an axis that points forward, with its wall hot but for the
    /// patient's left side, which has half the uptake.
    fn scene() -> (Volume, VentricleWall) {
        let mut mesh = shapes::cup(60.0, 32.0, 12.0, 24);
        // Apex from -z to -y (anterior).
        for p in &mut mesh.vertices {
            *p = Vec3::new(p.x, p.z, -p.y);
        }
        let frame = VoxelToPatient::centred([50; 3], [3.0; 3], Vec3::new(0.0, -25.0, 0.0)).unwrap();
        let mask = voxelise(
            &mesh,
            [50; 3],
            &frame,
            &crate::base::progress::Monitor::silent(),
        )
        .unwrap();
        let voxels = (0..50 * 50 * 50)
            .map(|v| {
                let index = Vec3::from([v % 50, v / 50 % 50, v / 2500].map(|x| x as f64));
                let left = frame.to_patient(&index).x > 0.0;
                f32::from(u8::from(mask.voxels[v])) * if left { 50.0 } else { 100.0 }
            })
            .collect();
        let volume = Volume {
            shape: [50; 3],
            voxels,
            frame,
            integral: false,
        };
        let cup = Cup {
            centre: Vec3::new(0.0, -25.0, 0.0),
            axis: -Vec3::y(),
            length: 65.0,
            breadth: 1.0,
        };
        let wall = VentricleWall::new(
            &mesh,
            &cup,
            &Vec3::z(),
            &crate::base::progress::Monitor::silent(),
        );
        (volume, wall.unwrap())
    }

    #[test]
    fn segments_are_where_the_heart_association_puts_them() {
        let at = segment_at;
        let basal = [90.0, 150.0, 210.0, 270.0, 330.0, 30.0].map(|a| at(Level::Basal, a));
        assert_eq!(basal, [1, 2, 3, 4, 5, 6]);
        assert_eq!([at(Level::Mid, 90.0), at(Level::Mid, 30.0)], [7, 12]);
        let apical = [90.0, 180.0, 270.0, 0.0].map(|a| at(Level::Apical, a));
        assert_eq!(apical, [13, 14, 15, 16]);
        assert_eq!(at(Level::Apex, 123.0), 17);
    }

    #[test]
    fn the_uptake_of_a_place_is_that_of_the_rays_beside_it() {
        let (volume, wall) = scene();
        let map = map(&volume, &wall, &wall, &PolarParameters::default());
        let at = |x: f64| map.uptake_at(&wall, &Vec3::new(x, -25.0, 0.0));
        // The left side has half the uptake of the right one.
        assert!((at(-26.0) - 100.0).abs() < 8.0, "{}", at(-26.0));
        assert!((at(26.0) - 50.0).abs() < 8.0, "{}", at(26.0));
        assert_eq!(colour_of(f64::NAN), [128.0 / 255.0; 3]);
        assert_ne!(colour_of(at(26.0)), colour_of(at(-26.0)));
    }

    #[test]
    fn a_map_without_orientation_names_no_side() {
        let (volume, wall) = scene();
        let map = map(&volume, &wall, &wall, &PolarParameters::default());
        assert_eq!(PolarSummary::from_map(&map).orientation, "frame");
        assert!(svg(&map).contains(">A</text>"));
        let map = map.counted_by(OrientationSource::Unknown);
        let summary = PolarSummary::from_map(&map);
        assert_eq!(summary.orientation, "unknown");
        assert_eq!(summary.territories, []);
        assert_eq!(summary.first_column, None);
        for segment in &summary.segments {
            let name = &segment.name;
            for side in ["anter", "sept", "infer", "lateral"] {
                assert!(!name.contains(side), "{name}");
            }
            assert_eq!(segment.territory, None);
        }
        let picture = svg(&map);
        assert!(picture.contains("ORIENTATION UNKNOWN"));
        assert!(!picture.contains(">A</text>") && !picture.contains("LAD"));
    }

    #[test]
    fn inferior_extent_is_told_where_nothing_corrected_attenuation() {
        let (volume, wall) = scene();
        let map = map(&volume, &wall, &wall, &PolarParameters::default());
        let mut summary = PolarSummary::from_map(&map);
        for segment in &mut summary.segments {
            segment.extent_percent = if segment.number == 4 { 40.0 } else { 10.0 };
        }
        let told = |corrected| {
            summary
                .clone()
                .with_attenuation(corrected, false)
                .attenuation
        };
        // The mean over all of the wall, of which segments 3, 4, 5, 9, 10, 11 and 15 have inferior in their names.
        let area = |numbers: &[usize]| -> f64 {
            let of = summary
                .segments
                .iter()
                .filter(|s| numbers.contains(&s.number));
            of.map(|s| s.area_mm2).sum()
        };
        let all: Vec<usize> = (1..=17).collect();
        let below = 40.0 * area(&[4]) + 10.0 * area(&[3, 5, 9, 10, 11, 15]);
        let expected = below / area(&all);
        for (corrected, said) in [(None, "Nothing says"), (Some(false), "was not corrected")] {
            let told = told(corrected).unwrap();
            assert_eq!(told.corrected, corrected);
            let part = told.inferior_extent_percent;
            assert!((part - expected).abs() < 0.01, "{part} of {expected}");
            assert!(told.note.contains(said), "{}", told.note);
        }
        assert_eq!(told(Some(true)), None);
        let mut even = summary.clone();
        for segment in &mut even.segments {
            segment.extent_percent = 0.0;
        }
        assert_eq!(even.with_attenuation(None, false).attenuation, None);
        let unknown = PolarSummary::from_map(&map.counted_by(OrientationSource::Unknown));
        assert_eq!(unknown.with_attenuation(None, false).attenuation, None);
    }

    #[test]
    fn areas_are_those_of_the_surface_midway_through_the_wall() {
        let (volume, wall) = scene();
        let map = map(&volume, &wall, &wall, &PolarParameters::default());
        // Half a spheroid with semi-axes of 54 and 26 mm, and a ring of 6 mm beyond its middle.
        let (a, b): (f64, f64) = (26.0, 54.0);
        let e = (1.0 - a * a / (b * b)).sqrt();
        let half = std::f64::consts::PI * a * a * (1.0 + b / (a * e) * e.asin());
        let ring = std::f64::consts::TAU * a * 6.0;
        let found: f64 = map.pixels.iter().flatten().map(|p| p.area).sum();
        assert!(
            (found / (half + ring) - 1.0).abs() < 0.05,
            "{found} of {}",
            half + ring
        );
        // Segment 17 is the cap beyond the cavity's end, 48 mm from the middle.
        let z = 48.0 / b;
        let zone = |z: f64| {
            let u = e * z;
            std::f64::consts::PI * a * b / e * (u * (1.0 - u * u).sqrt() + u.asin())
        };
        let cap = zone(1.0) - zone(z);
        let apex = map.segments[16].area;
        assert!((apex / cap - 1.0).abs() < 0.25, "{apex} of {cap}");
    }

    #[test]
    fn a_cold_left_side_shows_in_the_lateral_segments() {
        let (volume, wall) = scene();
        // The scene is as sharp as its voxels; more blur would feed the cold side.
        let parameters = PolarParameters {
            blur: 2.0,
            ..PolarParameters::default()
        };
        let map = map(&volume, &wall, &wall, &parameters);
        let mean = |s: usize| map.segments[s - 1].mean_percent.unwrap();
        for lateral in [5, 6, 11, 12, 16] {
            assert!(mean(lateral) < 65.0, "{lateral}: {}", mean(lateral));
        }
        for septal in [2, 3, 8, 9, 14] {
            assert!(mean(septal) > 90.0, "{septal}: {}", mean(septal));
        }
        assert!(
            (map.extent_percent - 50.0).abs() < 8.0,
            "{}",
            map.extent_percent
        );
        let areas: f64 = map.segments.iter().map(|s| s.area).sum();
        let muscle = map.pixels.iter().flatten().filter(|p| p.is_muscle());
        let all: f64 = muscle.map(|p| p.area).sum();
        assert!((areas - all).abs() < 1e-6);
    }

    #[test]
    fn the_cavity_has_the_volume_of_its_ellipsoid() {
        let (_, wall) = scene();
        // Half an ellipsoid 48 mm long with a radius of 20 mm, and the rim's upper half.
        let half = 2.0 / 3.0 * std::f64::consts::PI * 48.0 * 400.0 / 1000.0;
        let rim = 6.0 * std::f64::consts::PI * 400.0 / 1000.0;
        assert!(
            (wall.cavity_ml / (half + rim) - 1.0).abs() < 0.06,
            "{}",
            wall.cavity_ml
        );
        assert!((11.0..15.0).contains(&wall.thickness), "{}", wall.thickness);
        assert_eq!(wall.gaps, 0.0);
    }

    #[test]
    fn a_document_is_read_as_it_was_written() {
        let (volume, wall) = scene();
        let map = map(&volume, &wall, &wall, &PolarParameters::default());
        let document = PolarDocument::from_map(&map);
        let text = serde_json::to_string(&document).unwrap();
        assert_eq!(
            serde_json::from_str::<PolarDocument>(&text).unwrap(),
            document
        );
    }

    /// Colours of a phase meet where the cycle closes; outward motion has a colour of its own.
    #[test]
    fn other_figures_have_the_segments_of_the_map() {
        let (volume, wall) = scene();
        let map = map(&volume, &wall, &wall, &PolarParameters::default());
        let of = |figure: WallFigure, value: f64| FigureMap {
            map: &map,
            figure,
            values: map
                .pixels
                .iter()
                .map(|pixel| pixel.map(|_| value))
                .collect(),
            segments: std::array::from_fn(|index| (index > 0).then_some(value)),
        };
        let svg = |figure, value| figure_svg(&of(figure, value));
        let tiles = |text: &str| text.matches("<polygon").count();
        let [early, late] = [0.0, 360.0].map(|phase| svg(WallFigure::Phase, phase));
        let fills = |text: &str| -> Vec<String> {
            let all = text.split("fill=\"").skip(1);
            all.map(|rest| rest.split('"').next().unwrap().to_owned())
                .collect()
        };
        assert_eq!(fills(&early), fills(&late));
        assert_eq!(tiles(&early), tiles(&super::svg(&map)));
        assert!(svg(WallFigure::Motion, 6.0).contains(">mm</text>"));
        assert_ne!(
            fills(&svg(WallFigure::Motion, -2.0)),
            fills(&svg(WallFigure::Motion, 0.0))
        );
        let document = FigureDocument::from_figure(&of(WallFigure::Thickening, 37.123));
        assert_eq!(document.segments[0].mean, None);
        assert_eq!(document.segments[16].mean, Some(37.12));
        assert_eq!(
            document.segment_of,
            PolarDocument::from_map(&map).segment_of
        );
        let text = serde_json::to_string(&document).unwrap();
        assert_eq!(
            serde_json::from_str::<FigureDocument>(&text).unwrap(),
            document
        );
    }

    /// A gate has the wall of the sum, and its own reference.
    #[test]
    fn the_map_of_another_image_keeps_the_wall() {
        let (volume, wall) = scene();
        let map = map(&volume, &wall, &wall, &PolarParameters::default())
            .counted_by(OrientationSource::Unknown);
        let half = |pixel: &Option<Pixel>| pixel.map_or(7.0, |pixel| pixel.max / 2.0);
        let largest: Vec<f64> = map.pixels.iter().map(half).collect();
        let found = map.with_largest(&largest);
        assert!((found.reference - map.reference / 2.0).abs() < 1e-9);
        for (found, known) in found.segments.iter().zip(&map.segments) {
            assert!((found.area - known.area).abs() < 1e-9);
            let [found, known] = [found, known].map(|segment| segment.mean_percent.unwrap());
            assert!((found - known).abs() < 1e-9);
        }
        assert_eq!(found.orientation, map.orientation);
        assert_eq!(map.with_largest(&largest).pixels, found.pixels);
    }

    #[test]
    fn pictures_can_be_read_again() {
        let (volume, wall) = scene();
        let map = map(&volume, &wall, &wall, &PolarParameters::default());
        let (width, height, _) = decoded(&png(&map));
        assert_eq!((width, height), (760, 640));
        let text = svg(&map);
        assert!(text.starts_with("<svg") && text.ends_with("</svg>\n"));
        let segments = PolarSummary::from_map(&map).segments;
        assert_eq!(segments.len(), 17);
        assert_eq!(segments[16].name, "apex");
    }
}
