//! The polar map as a picture, for SVG and PNG.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use serde::Deserialize;

use super::figure::{FigureMap, WallFigure};
use super::{Level, Pixel, PlaceState, PolarMap, Projection, RAY_COLUMNS, RAY_ROWS, territory};
use crate::image::draw::glyphs::Weight;
use crate::image::draw::vector::{Anchor, Drawing, Point, Rgb, VectorShape};

/// Height of the picture, pixels.
const PICTURE_HEIGHT_PX: usize = 640;
/// Its width: the map, and the colour bar on its right.
const PICTURE_WIDTH_PX: usize = 760;
/// Radius of the map.
const MAP_RADIUS_PX: f64 = 280.0;
const MAP_CENTRE_PX: f64 = PICTURE_HEIGHT_PX as f64 / 2.0;
/// Height of a line of text.
const TEXT_HEIGHT_PX: f64 = 18.0;

/// Share of the colours from which ink on them is black.
const BRIGHT_SHARE: f64 = 0.62;

/// The colours of maps, which the page (`web/src/viewer/colours.ts`) reads from the same file.
#[derive(Deserialize)]
struct Palette {
    /// Dark to bright, equal steps of lightness (a polyline through matplotlib's `inferno`).
    colours: [[f64; 3]; 6],
    /// Outside of the wall.
    no_wall: Rgb,
    /// The hatching of the valve plane.
    valve_plane: Rgb,
    /// The line about the wall below the threshold.
    threshold: Rgb,
}

static PALETTE: LazyLock<Palette> = LazyLock::new(|| {
    serde_json::from_str(include_str!("../../../assets/uptake.json"))
        .expect("the file holds what `Palette` names")
});

/// The colours of other figures than uptake, beside those of [`Palette`].
#[derive(Deserialize)]
struct FigurePalette {
    /// A wall that moves outward, or gets thinner.
    outward: Rgb,
    /// Round the cycle from 0 degrees on: 12 hues of one lightness and chroma (CIELAB 70 and 46, as far as sRGB has
    /// them).
    cycle: [[f64; 3]; 12],
    /// More uptake at stress, as much, less.
    difference: [[f64; 3]; 3],
}

static FIGURE_PALETTE: LazyLock<FigurePalette> = LazyLock::new(|| {
    serde_json::from_str(include_str!("../../../assets/figures.json"))
        .expect("the file holds what `FigurePalette` names")
});

const BORDER_COLOUR: Rgb = [200; 3];
/// Borders between the territories of two arteries.
const TERRITORY_BORDER: Rgb = [255; 3];
const WHITE_RGB: Rgb = [255; 3];
const BLACK_RGB: Rgb = [0; 3];

/// The four letters round the map: anterior, septal, inferior, lateral, in turns from lateral.
const SIDE_LETTERS: [(char, f64); 4] = [('A', 0.25), ('S', 0.5), ('I', 0.75), ('L', 0.0)];

/// The map as SVG: uptake, borders of segments and territories, the means of both in per cent, a line about the wall
/// below the threshold, a colour bar with the threshold marked. Grey is outside of the wall, hatched the valve plane.
/// Without orientation, "ORIENTATION UNKNOWN" instead of sides and territories.
pub fn svg(map: &PolarMap) -> String {
    drawing(map).svg()
}

/// The same picture as an RGB PNG of 760 × 640 pixels.
pub fn png(map: &PolarMap) -> Vec<u8> {
    drawing(map).image().png()
}

/// A figure of the wall as SVG: the same map, the segments' means, and a colour bar with the figure's unit.
pub fn figure_svg(figure: &FigureMap<'_>) -> String {
    figure_drawing(figure).svg()
}

/// The same picture as an RGB PNG of 760 × 640 pixels.
pub fn figure_png(figure: &FigureMap<'_>) -> Vec<u8> {
    figure_drawing(figure).image().png()
}

fn figure_drawing(figure: &FigureMap<'_>) -> Drawing {
    let map = figure.map;
    let rings = rings(map);
    let what = figure.figure;
    let [least, most] = what.range();
    let share_of = |value: f64| (value - least) / (most - least);
    let colour_at = |value: f64| match what {
        WallFigure::Phase => cycle_colour(value / 360.0),
        WallFigure::Difference => difference_colour(value / most),
        WallFigure::Motion | WallFigure::Thickening if value < 0.0 => FIGURE_PALETTE.outward,
        _ => colour(share_of(value)),
    };
    let shade = |row: usize, column: usize| {
        figure.values[row * RAY_COLUMNS + column].map_or(PALETTE.no_wall, &colour_at)
    };
    let means = figure.segments.iter().enumerate().map(|(index, mean)| {
        let bright = match what {
            WallFigure::Phase => true,
            WallFigure::Difference => false,
            _ => mean.is_some_and(|mean| share_of(mean) > BRIGHT_SHARE),
        };
        label(index + 1, *mean, what.decimals(), bright, &rings)
    });
    let bar = ColourBar {
        unit: what.unit(),
        ticks: what.ticks(),
        share: share_of,
        colour: |share| colour_at(least + share * (most - least)),
    };
    let hatched = if what.is_of_uptake() {
        hatching(map, &rings)
    } else {
        Vec::new()
    };
    Drawing {
        title: format!("{}{}", what.title(), unknown_side(map)),
        width: PICTURE_WIDTH_PX,
        height: PICTURE_HEIGHT_PX,
        shapes: tiles(map, &rings, shade)
            .chain(hatched)
            .chain(borders(map, &rings))
            .chain(means)
            .chain(sides(map))
            .chain(bar.shapes())
            .collect(),
    }
}

/// The end of a title where no side is known.
fn unknown_side(map: &PolarMap) -> &'static str {
    if map.is_oriented() {
        ""
    } else {
        "; orientation unknown"
    }
}

fn drawing(map: &PolarMap) -> Drawing {
    let rings = rings(map);
    let means = map.segments.iter().map(|segment| {
        // The reference is a mean of the brightest wall, so a segment may lie a little above it.
        let mean = segment.mean_percent.map(|mean| mean.min(100.0));
        let bright = mean.is_some_and(|mean| mean > 100.0 * BRIGHT_SHARE);
        label(segment.number, mean, 0, bright, &rings)
    });
    Drawing {
        title: format!(
            "Polar map, per cent of {}; extent below {:.0} %: {:.1} % of the wall; grey: no wall; hatched: valve \
             plane{}",
            counts(map.reference),
            100.0 * map.threshold,
            map.extent_percent,
            unknown_side(map)
        ),
        width: PICTURE_WIDTH_PX,
        height: PICTURE_HEIGHT_PX,
        shapes: tiles(map, &rings, |row, column| shade(map, row, column))
            .chain(hatching(map, &rings))
            .chain(threshold_line(map, &rings))
            .chain(borders(map, &rings))
            .chain(means)
            .chain(sides(map))
            .chain(uptake_bar(map))
            .chain(sums(map))
            .collect(),
    }
}

/// A value of the image: counts are whole; images of a scale below ten keep two digits.
fn counts(value: f64) -> String {
    if value < 10.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.0}")
    }
}

/// The pixels of the map in the colours of `shade` (row, column).
fn tiles(
    map: &PolarMap,
    rings: &[f64; 4],
    shade: impl Fn(usize, usize) -> Rgb,
) -> impl Iterator<Item = VectorShape> {
    let places = (0..RAY_ROWS).flat_map(|row| (0..RAY_COLUMNS).map(move |column| (row, column)));
    places.map(move |(row, column)| VectorShape::Polygon {
        corners: tile(map, rings, row, column),
        fill: shade(row, column),
    })
}

/// A diagonal across every pixel of the valve plane.
fn hatching(map: &PolarMap, rings: &[f64; 4]) -> Vec<VectorShape> {
    let places = (0..RAY_ROWS).flat_map(|row| (0..RAY_COLUMNS).map(move |column| (row, column)));
    let masked = places.filter(|(row, column)| map.state(*row, *column) == PlaceState::ValvePlane);
    let place = |rows: usize, column: usize, side: usize| {
        let share = map.levels.share(rows as f64, column, rings);
        screen(share, (column + side) as f64 / RAY_COLUMNS as f64)
    };
    let line = |(row, column)| VectorShape::Line {
        ends: [place(row, column, 0), place(row + 1, column, 1)],
        stroke: PALETTE.valve_plane,
        width: 1.5,
    };
    masked.map(line).collect()
}

/// The radii at which the levels end, as shares of the map's.
pub(super) fn rings(map: &PolarMap) -> [f64; 4] {
    let standard = [0.25, 0.5, 0.75, 1.0];
    if map.projection == Projection::Standard {
        return standard;
    }
    let area = |level: Level| -> f64 {
        let places = (0..RAY_ROWS * RAY_COLUMNS).filter(|index| {
            map.levels
                .of_pixel(index / RAY_COLUMNS, index % RAY_COLUMNS)
                == level
        });
        places
            .filter_map(|index| Some(map.pixels[index]?.area))
            .sum()
    };
    let areas = Level::ALL.map(area);
    let all: f64 = areas.iter().sum();
    if !(all > 0.0) {
        return standard;
    }
    let mut inner = 0.0;
    areas.map(|area| {
        inner += area / all;
        inner.sqrt()
    })
}

/// The colour of a place of the map.
fn shade(map: &PolarMap, row: usize, column: usize) -> Rgb {
    match map.pixels[row * RAY_COLUMNS + column].filter(Pixel::is_muscle) {
        Some(pixel) if map.reference > 0.0 => colour(pixel.max / map.reference),
        _ => PALETTE.no_wall,
    }
}

/// The colour of an uptake in per cent of the reference, sRGB, 0..=1; grey where there is no wall (NaN).
pub fn colour_of(percent: f64) -> [f64; 3] {
    let rgb = if percent.is_nan() {
        PALETTE.no_wall
    } else {
        colour(percent / 100.0)
    };
    rgb.map(|part| f64::from(part) / 255.0)
}

fn colour(share: f64) -> Rgb {
    let colours = &PALETTE.colours;
    let at = share.clamp(0.0, 1.0) * (colours.len() - 1) as f64;
    let step = (at as usize).min(colours.len() - 2);
    between(colours[step], colours[step + 1], at - step as f64)
}

/// The colour of a place of the cycle, 0..1.
fn cycle_colour(turns: f64) -> Rgb {
    let colours = &FIGURE_PALETTE.cycle;
    let at = turns.rem_euclid(1.0) * colours.len() as f64;
    let step = (at as usize).min(colours.len() - 1);
    between(
        colours[step],
        colours[(step + 1) % colours.len()],
        at - step as f64,
    )
}

/// The colour of a difference, -1 (more at stress) to 1.
fn difference_colour(share: f64) -> Rgb {
    let [more, alike, less] = FIGURE_PALETTE.difference;
    let end = if share < 0.0 { more } else { less };
    between(alike, end, share.abs().min(1.0))
}

fn between(from: [f64; 3], to: [f64; 3], share: f64) -> Rgb {
    std::array::from_fn(|c| (from[c] + share * (to[c] - from[c])).round() as u8)
}

/// The outline of one pixel of the map, slightly enlarged so that no gaps show between
/// neighbours.
fn tile(map: &PolarMap, rings: &[f64; 4], row: usize, column: usize) -> Vec<Point> {
    let shares = [row as f64, row as f64 + 1.03].map(|rows| map.levels.share(rows, column, rings));
    let turns = [column as f64, column as f64 + 1.03].map(|c| c / RAY_COLUMNS as f64);
    vec![
        screen(shares[0], turns[0]),
        screen(shares[1], turns[0]),
        screen(shares[1], turns[1]),
        screen(shares[0], turns[1]),
    ]
}

/// The edges between pixels below the threshold and others.
fn threshold_line(map: &PolarMap, rings: &[f64; 4]) -> Vec<VectorShape> {
    let limit = map.threshold * map.reference;
    let below = |row: usize, column: usize| {
        let pixel = map.pixels[row * RAY_COLUMNS + column % RAY_COLUMNS];
        pixel
            .filter(Pixel::is_muscle)
            .map(|pixel| pixel.max < limit)
    };
    let place = |rows: usize, column: usize, side: usize| {
        let share = map.levels.share(rows as f64, column % RAY_COLUMNS, rings);
        screen(share, (column + side) as f64 / RAY_COLUMNS as f64)
    };
    let line = |ends: [Point; 2]| VectorShape::Line {
        ends,
        stroke: PALETTE.threshold,
        width: 2.5,
    };
    let mut lines = Vec::new();
    for column in 0..RAY_COLUMNS {
        for row in 0..RAY_ROWS {
            let Some(here) = below(row, column) else {
                continue;
            };
            if row + 1 < RAY_ROWS && below(row + 1, column) == Some(!here) {
                lines.push(line([place(row + 1, column, 0), place(row + 1, column, 1)]));
            }
            if below(row, column + 1) == Some(!here) {
                lines.push(line([place(row, column, 1), place(row + 1, column, 1)]));
            }
        }
    }
    lines
}

/// The borders of the segments; those between two territories are thicker.
fn borders(map: &PolarMap, rings: &[f64; 4]) -> Vec<VectorShape> {
    let mut shapes: Vec<VectorShape> = rings
        .iter()
        .map(|share| VectorShape::Circle {
            centre: [MAP_CENTRE_PX; 2],
            radius: MAP_RADIUS_PX * share,
            stroke: BORDER_COLOUR,
            width: 1.5,
        })
        .collect();
    // First segment of a level, number of its segments.
    for (level, first, count) in [(1, 13, 4), (2, 7, 6), (3, 1, 6)] {
        for k in 0..count {
            // Segments follow each other counter-clockwise; the first is centred on anterior.
            let turns = 0.25 + (k as f64 - 0.5) / count as f64;
            let pair = [(k + count - 1) % count, k].map(|k| territory(first + k));
            let (stroke, width) = if pair[0] == pair[1] || !map.is_oriented() {
                (BORDER_COLOUR, 1.5)
            } else {
                (TERRITORY_BORDER, 4.0)
            };
            shapes.push(VectorShape::Line {
                ends: [screen(rings[level - 1], turns), screen(rings[level], turns)],
                stroke,
                width,
            });
        }
    }
    shapes
}

/// The mean of a segment: black on bright tiles, white on dark ones.
fn label(
    segment: usize,
    mean: Option<f64>,
    decimals: usize,
    bright: bool,
    rings: &[f64; 4],
) -> VectorShape {
    let (share, turns) = label_place(segment, rings);
    VectorShape::Label {
        at: screen(share, turns),
        anchor: Anchor::Middle,
        text: mean.map_or_else(|| "-".to_owned(), |mean| written(mean, decimals)),
        weight: Weight::Bold,
        size: TEXT_HEIGHT_PX,
        ink: if bright { BLACK_RGB } else { WHITE_RGB },
        rim: Some(if bright { WHITE_RGB } else { BLACK_RGB }),
    }
}

/// A figure with its decimals; without a sign where those are zeros.
fn written(figure: f64, decimals: usize) -> String {
    let text = format!("{figure:.decimals$}");
    match text.strip_prefix('-') {
        Some(zeros) if zeros.parse() == Ok(0.0) => zeros.to_owned(),
        _ => text,
    }
}

/// The letters of the four sides, or that they are not known.
fn sides(map: &PolarMap) -> impl Iterator<Item = VectorShape> {
    let letters = SIDE_LETTERS
        .map(|(letter, turns)| text(screen(1.07, turns), letter.to_string()))
        .into_iter()
        .filter(|_| map.is_oriented());
    let unknown = text(
        [MAP_CENTRE_PX, PICTURE_HEIGHT_PX as f64 - 18.0],
        "ORIENTATION UNKNOWN".to_owned(),
    );
    let unknown = (!map.is_oriented()).then_some(unknown);
    letters.chain(unknown)
}

fn text(middle: Point, text: String) -> VectorShape {
    VectorShape::Label {
        at: middle,
        anchor: Anchor::Middle,
        text,
        weight: Weight::Regular,
        size: TEXT_HEIGHT_PX,
        ink: BLACK_RGB,
        rim: None,
    }
}

/// Centre of a segment: share of the radius and angle in turns from lateral.
fn label_place(segment: usize, rings: &[f64; 4]) -> (f64, f64) {
    let between = |level: usize| f64::midpoint(rings[level - 1], rings[level]);
    match segment {
        17 => (0.0, 0.0),
        13..=16 => (between(1), 0.25 + (segment - 13) as f64 / 4.0),
        7..=12 => (between(2), 0.25 + (segment - 7) as f64 / 6.0),
        _ => (between(3), 0.25 + (segment - 1) as f64 / 6.0),
    }
}

/// Left, right, top and bottom of the colour bar, pixels.
const COLOUR_BAR_PX: [f64; 4] = [652.0, 676.0, 140.0, 500.0];

/// The colours of a figure, with its unit.
struct ColourBar<S: Fn(f64) -> f64, C: Fn(f64) -> Rgb> {
    unit: &'static str,
    ticks: &'static [f64],
    /// Place of a value on the bar, 0 at the bottom to 1 on top.
    share: S,
    /// The colour of a place.
    colour: C,
}

impl<S: Fn(f64) -> f64, C: Fn(f64) -> Rgb> ColourBar<S, C> {
    fn shapes(&self) -> Vec<VectorShape> {
        const COLOUR_BAR_STEPS: usize = 100;
        let [left, right, top, _] = COLOUR_BAR_PX;
        let mut shapes: Vec<VectorShape> = (0..COLOUR_BAR_STEPS)
            .map(|step| {
                let ends = [step as f64, step as f64 + 1.03]
                    .map(|s| bar_height(s / COLOUR_BAR_STEPS as f64));
                VectorShape::Polygon {
                    corners: vec![
                        [left, ends[0]],
                        [right, ends[0]],
                        [right, ends[1]],
                        [left, ends[1]],
                    ],
                    fill: (self.colour)((step as f64 + 0.5) / COLOUR_BAR_STEPS as f64),
                }
            })
            .collect();
        for tick in self.ticks {
            let y = bar_height((self.share)(*tick));
            shapes.push(VectorShape::Line {
                ends: [[right, y], [right + 6.0, y]],
                stroke: BLACK_RGB,
                width: 1.5,
            });
            shapes.push(text([right + 28.0, y], tick.to_string()));
        }
        shapes.push(text(
            [(left + right) / 2.0, top - 24.0],
            self.unit.to_owned(),
        ));
        shapes
    }
}

/// The place on the screen of a share of the colour bar.
fn bar_height(share: f64) -> f64 {
    let [_, _, top, bottom] = COLOUR_BAR_PX;
    bottom - (bottom - top) * share
}

/// The colours from 0 to 100 per cent, with the threshold.
fn uptake_bar(map: &PolarMap) -> Vec<VectorShape> {
    let bar = ColourBar {
        unit: "%",
        ticks: &[0.0, 25.0, 50.0, 75.0, 100.0],
        share: |percent| percent / 100.0,
        colour,
    };
    let mut shapes = bar.shapes();
    let [left, right, ..] = COLOUR_BAR_PX;
    let y = bar_height(map.threshold.clamp(0.0, 1.0));
    shapes.push(VectorShape::Line {
        ends: [[left - 6.0, y], [right + 6.0, y]],
        stroke: PALETTE.threshold,
        width: 3.0,
    });
    shapes
}

/// The territories' means, below the colour bar.
fn sums(map: &PolarMap) -> Vec<VectorShape> {
    let lines = map.territories.iter().enumerate();
    lines
        .filter(|_| map.is_oriented())
        .map(|(line, territory)| {
            let mean = territory.mean_percent;
            let mean = mean.map_or_else(|| "-".to_owned(), |mean| format!("{mean:.0}"));
            let y = 540.0 + 28.0 * line as f64;
            text([688.0, y], format!("{} {mean}", territory.name))
        })
        .collect()
}

/// Place in the picture of a share of the radius and an angle in turns from lateral.
fn screen(share: f64, turns: f64) -> Point {
    let (sin, cos) = (TAU * turns).sin_cos();
    [
        MAP_CENTRE_PX + MAP_RADIUS_PX * share * cos,
        MAP_CENTRE_PX - MAP_RADIUS_PX * share * sin,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_zero_has_a_sign() {
        let texts = [(-0.4, 0), (-0.0, 1), (-0.04, 1), (-0.6, 0), (12.3, 1)];
        let texts = texts.map(|(figure, decimals)| written(figure, decimals));
        assert_eq!(texts, ["0", "0.0", "0.0", "-1", "12.3"]);
    }
}
