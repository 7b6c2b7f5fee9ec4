//! The polar map as a picture, for SVG and PNG.

use std::f64::consts::TAU;

use super::{COLUMNS, PolarMap, ROWS};
use crate::draw::vector::{Drawing, Point, Rgb, VectorShape};

/// Edge of the picture, pixels.
const SIZE: usize = 640;
/// Radius of the map.
const RADIUS: f64 = 280.0;
const CENTRE: f64 = SIZE as f64 / 2.0;
/// Height of a line of text.
const TEXT: f64 = 18.0;

/// Dark to bright, equal steps of lightness (a polyline through matplotlib's `inferno`).
const COLOURS: [[f64; 3]; 6] = [
    [0.0, 0.0, 4.0],
    [66.0, 10.0, 104.0],
    [147.0, 38.0, 103.0],
    [221.0, 81.0, 58.0],
    [252.0, 165.0, 10.0],
    [252.0, 255.0, 164.0],
];
const NO_WALL: Rgb = [128; 3];
const BORDER: Rgb = [200; 3];
const WHITE: Rgb = [255; 3];
const BLACK: Rgb = [0; 3];

/// The four letters round the map: anterior, septal, inferior, lateral, in turns from lateral.
const SIDES: [(char, f64); 4] = [('A', 0.25), ('S', 0.5), ('I', 0.75), ('L', 0.0)];

/// The map as SVG: uptake, borders of the segments, their means in per cent.
pub fn svg(map: &PolarMap) -> String {
    drawing(map).svg()
}

/// The same picture as an RGB PNG of 640 × 640 pixels.
pub fn png(map: &PolarMap) -> Vec<u8> {
    drawing(map).image().png()
}

fn drawing(map: &PolarMap) -> Drawing {
    let places = (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| (row, column)));
    let tiles = places.map(|(row, column)| VectorShape::Polygon {
        corners: tile(row, column),
        fill: shade(map, row, column),
    });
    Drawing {
        title: format!(
            "Polar map, per cent of {:.4}; extent below {:.0} %: {:.1} % of the wall",
            map.reference,
            100.0 * map.threshold,
            map.extent_percent
        ),
        width: SIZE,
        height: SIZE,
        shapes: tiles.chain(borders()).chain(labels(map)).collect(),
    }
}

/// The colour of a place of the map.
fn shade(map: &PolarMap, row: usize, column: usize) -> Rgb {
    match map.pixels[row * COLUMNS + column] {
        Some(pixel) if map.reference > 0.0 => colour(pixel.max / map.reference),
        _ => NO_WALL,
    }
}

fn colour(share: f64) -> Rgb {
    let at = share.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f64;
    let step = (at as usize).min(COLOURS.len() - 2);
    let t = at - step as f64;
    std::array::from_fn(|c| {
        (COLOURS[step][c] + t * (COLOURS[step + 1][c] - COLOURS[step][c])).round() as u8
    })
}

/// The outline of one pixel of the map, slightly enlarged so that no gaps show between
/// neighbours.
fn tile(row: usize, column: usize) -> Vec<Point> {
    let shares = [row as f64, row as f64 + 1.03].map(|r| r / ROWS as f64);
    let turns = [column as f64, column as f64 + 1.03].map(|c| c / COLUMNS as f64);
    vec![
        screen(shares[0], turns[0]),
        screen(shares[1], turns[0]),
        screen(shares[1], turns[1]),
        screen(shares[0], turns[1]),
    ]
}

/// The borders of the segments.
fn borders() -> impl Iterator<Item = VectorShape> {
    let (stroke, width) = (BORDER, 1.5);
    let circles = [0.25, 0.5, 0.75, 1.0].map(|share| VectorShape::Circle {
        centre: [CENTRE; 2],
        radius: RADIUS * share,
        stroke,
        width,
    });
    let spokes = [(0.25, 0.5, 4, 0.125), (0.5, 1.0, 6, 1.0 / 6.0)];
    let lines = spokes
        .into_iter()
        .flat_map(move |(from, to, count, first)| {
            (0..count).map(move |k| {
                let turns = first + f64::from(k) / f64::from(count);
                VectorShape::Line {
                    ends: [screen(from, turns), screen(to, turns)],
                    stroke,
                    width,
                }
            })
        });
    circles.into_iter().chain(lines)
}

/// The segments' means and the letters of the four sides.
fn labels(map: &PolarMap) -> impl Iterator<Item = VectorShape> + '_ {
    let means = map.segments.iter().map(|segment| {
        let mean = segment.mean_percent;
        let (share, turns) = label_place(segment.number);
        VectorShape::Label {
            middle: screen(share, turns),
            text: mean.map_or_else(|| "-".to_owned(), |mean| format!("{mean:.0}")),
            size: TEXT,
            ink: WHITE,
            rim: Some(BLACK),
        }
    });
    let letters = SIDES.map(|(letter, turns)| VectorShape::Label {
        middle: screen(1.07, turns),
        text: letter.to_string(),
        size: TEXT,
        ink: BLACK,
        rim: None,
    });
    means.chain(letters)
}

/// Centre of a segment: share of the radius and angle in turns from lateral.
fn label_place(segment: usize) -> (f64, f64) {
    match segment {
        17 => (0.0, 0.0),
        13..=16 => (0.375, 0.25 + (segment - 13) as f64 / 4.0),
        7..=12 => (0.625, 0.25 + (segment - 7) as f64 / 6.0),
        _ => (0.875, 0.25 + (segment - 1) as f64 / 6.0),
    }
}

/// Place in the picture of a share of the radius and an angle in turns from lateral.
fn screen(share: f64, turns: f64) -> Point {
    let (sin, cos) = (TAU * turns).sin_cos();
    [CENTRE + RADIUS * share * cos, CENTRE - RADIUS * share * sin]
}
