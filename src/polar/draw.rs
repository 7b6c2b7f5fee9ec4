//! The polar map as a picture (SVG, PNG) and as JSON.

use std::f64::consts::TAU;
use std::fmt::Write;

use serde_json::{Value, json};

use super::{COLUMNS, NAMES, PolarMap, ROWS, glyphs, segment_at, territory};

/// Edge of the picture, pixels.
const SIZE: usize = 640;
/// Radius of the map.
const RADIUS: f64 = 280.0;
const CENTRE: f64 = SIZE as f64 / 2.0;

/// Dark to bright, equal steps of lightness (a polyline through matplotlib's `inferno`).
const COLOURS: [[f64; 3]; 6] = [
    [0.0, 0.0, 4.0],
    [66.0, 10.0, 104.0],
    [147.0, 38.0, 103.0],
    [221.0, 81.0, 58.0],
    [252.0, 165.0, 10.0],
    [252.0, 255.0, 164.0],
];
const NO_WALL: [u8; 3] = [128, 128, 128];
const PAPER: [u8; 3] = [255, 255, 255];
const INK: [u8; 3] = [200, 200, 200];

fn colour(share: f64) -> [u8; 3] {
    let at = share.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f64;
    let step = (at as usize).min(COLOURS.len() - 2);
    let t = at - step as f64;
    std::array::from_fn(|c| {
        (COLOURS[step][c] + t * (COLOURS[step + 1][c] - COLOURS[step][c])).round() as u8
    })
}

/// The colour of a place of the map.
fn shade(map: &PolarMap, row: usize, column: usize) -> [u8; 3] {
    match map.pixels[row * COLUMNS + column] {
        Some(pixel) if map.reference > 0.0 => colour(pixel.max / map.reference),
        _ => NO_WALL,
    }
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

/// Screen position of a share of the radius and an angle in turns from lateral.
fn screen(share: f64, turns: f64) -> (f64, f64) {
    let (sin, cos) = (TAU * turns).sin_cos();
    (CENTRE + RADIUS * share * cos, CENTRE - RADIUS * share * sin)
}

/// The four letters round the map: anterior, septal, inferior, lateral.
const SIDES: [(char, f64); 4] = [('A', 0.25), ('S', 0.5), ('I', 0.75), ('L', 0.0)];

/// The map as SVG with the segments' borders and means in per cent.
pub fn svg(map: &PolarMap) -> String {
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{SIZE}\" height=\"{SIZE}\" \
         viewBox=\"0 0 {SIZE} {SIZE}\" font-family=\"sans-serif\" font-size=\"18\" \
         text-anchor=\"middle\">\n<title>Polar map, per cent of {:.4}; extent below {:.0} %: \
         {:.1} % of the wall</title>\n",
        map.reference,
        100.0 * map.threshold,
        map.extent_percent
    );
    for row in 0..ROWS {
        for column in 0..COLUMNS {
            let [r, g, b] = shade(map, row, column);
            let _ = writeln!(
                out,
                "<path d=\"{}\" fill=\"#{r:02x}{g:02x}{b:02x}\"/>",
                tile(row, column)
            );
        }
    }
    out.push_str("<g fill=\"none\" stroke=\"#c8c8c8\" stroke-width=\"1.5\">\n");
    for share in [0.25, 0.5, 0.75, 1.0] {
        let _ = writeln!(
            out,
            "<circle cx=\"{CENTRE}\" cy=\"{CENTRE}\" r=\"{}\"/>",
            RADIUS * share
        );
    }
    for (from, to, count, first) in [(0.25, 0.5, 4, 0.125), (0.5, 1.0, 6, 1.0 / 6.0)] {
        for k in 0..count {
            let turns = first + f64::from(k) / f64::from(count);
            let ((x0, y0), (x1, y1)) = (screen(from, turns), screen(to, turns));
            let _ = writeln!(
                out,
                "<line x1=\"{x0:.2}\" y1=\"{y0:.2}\" x2=\"{x1:.2}\" y2=\"{y1:.2}\"/>"
            );
        }
    }
    out.push_str("</g>\n<g fill=\"#ffffff\" stroke=\"#000000\" stroke-width=\"0.6\">\n");
    for s in &map.segments {
        let (share, turns) = label_place(s.number);
        let (x, y) = screen(share, turns);
        let text = s
            .mean_percent
            .map_or_else(|| "-".to_owned(), |m| format!("{m:.0}"));
        let _ = writeln!(out, "<text x=\"{x:.1}\" y=\"{:.1}\">{text}</text>", y + 6.0);
    }
    out.push_str("</g>\n<g fill=\"#000000\">\n");
    for (letter, turns) in SIDES {
        let (x, y) = screen(1.07, turns);
        let _ = writeln!(
            out,
            "<text x=\"{x:.1}\" y=\"{:.1}\">{letter}</text>",
            y + 6.0
        );
    }
    out.push_str("</g>\n</svg>\n");
    out
}

/// The outline of one pixel, slightly enlarged so that no gaps show between neighbours.
fn tile(row: usize, column: usize) -> String {
    let shares = [row as f64, row as f64 + 1.03].map(|r| r / ROWS as f64);
    let turns = [column as f64, column as f64 + 1.03].map(|c| c / COLUMNS as f64);
    let corners = [
        screen(shares[0], turns[0]),
        screen(shares[1], turns[0]),
        screen(shares[1], turns[1]),
        screen(shares[0], turns[1]),
    ];
    let points = corners.map(|(x, y)| format!("{x:.2} {y:.2}"));
    format!("M{}Z", points.join("L"))
}

/// The map as an RGB PNG of 640 × 640 pixels.
///
/// # Errors
/// Only those of the encoder, which writes to memory.
pub fn png(map: &PolarMap) -> Result<Vec<u8>, png::EncodingError> {
    let mut canvas = vec![PAPER; SIZE * SIZE];
    // The segment of each pixel, 0 beside the map.
    let mut segments = vec![0; SIZE * SIZE];
    for y in 0..SIZE {
        for x in 0..SIZE {
            let (dx, dy) = (x as f64 + 0.5 - CENTRE, CENTRE - y as f64 - 0.5);
            let share = dx.hypot(dy) / RADIUS;
            if share < 1.0 {
                let turns = dy.atan2(dx).rem_euclid(TAU) / TAU;
                let row = ((share * ROWS as f64) as usize).min(ROWS - 1);
                let column = ((turns * COLUMNS as f64) as usize).min(COLUMNS - 1);
                canvas[x + SIZE * y] = shade(map, row, column);
                segments[x + SIZE * y] = segment_at(share, 360.0 * turns);
            }
        }
    }
    draw_borders(&mut canvas, &segments);
    for s in &map.segments {
        let (share, turns) = label_place(s.number);
        let (x, y) = screen(share, turns);
        let text = s
            .mean_percent
            .map_or_else(String::new, |m| format!("{m:.0}"));
        write_text(&mut canvas, (x, y), &text, PAPER, true);
    }
    for (letter, turns) in SIDES {
        let place = screen(1.07, turns);
        write_text(&mut canvas, place, &letter.to_string(), [0; 3], false);
    }
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, SIZE as u32, SIZE as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(canvas.as_flattened())?;
    writer.finish()?;
    Ok(out)
}

/// A border runs where the segment changes from one pixel to the next.
fn draw_borders(canvas: &mut [[u8; 3]], segments: &[usize]) {
    for y in 0..SIZE - 1 {
        for at in SIZE * y..SIZE * y + SIZE - 1 {
            let own = segments[at];
            if own != segments[at + 1] || own != segments[at + SIZE] {
                canvas[at] = INK;
            }
        }
    }
}

/// Writes `text` round `place`, twice the glyphs' size, with a dark rim if `rimmed`.
fn write_text(canvas: &mut [[u8; 3]], place: (f64, f64), text: &str, ink: [u8; 3], rimmed: bool) {
    const SCALE: isize = 2;
    let width = text.chars().count() as isize * 6 * SCALE - SCALE;
    let left = place.0 as isize - width / 2;
    let top = place.1 as isize - 7 * SCALE / 2;
    let mut dot = |x: isize, y: isize, ink: [u8; 3]| {
        if (0..SIZE as isize).contains(&x) && (0..SIZE as isize).contains(&y) {
            canvas[x as usize + SIZE * y as usize] = ink;
        }
    };
    let passes: &[(isize, [u8; 3])] = if rimmed {
        &[(1, [0; 3]), (0, [0; 3])]
    } else {
        &[(0, [0; 3])]
    };
    for (grow, shadow) in passes {
        let ink = if *grow > 0 { *shadow } else { ink };
        for (n, character) in text.chars().enumerate() {
            for (row, bits) in glyphs::rows(character).into_iter().enumerate() {
                for column in (0..5).filter(|c| bits >> (4 - c) & 1 == 1) {
                    let x = left + (n as isize * 6 + column as isize) * SCALE;
                    let y = top + row as isize * SCALE;
                    for dy in -grow..SCALE + grow {
                        for dx in -grow..SCALE + grow {
                            dot(x + dx, y + dy, ink);
                        }
                    }
                }
            }
        }
    }
}

/// The map as JSON: segments, extents, and the pixels in per cent of the reference (`null`
/// where there is no wall).
pub fn json(map: &PolarMap) -> Value {
    let round = |x: f64| (100.0 * x).round() / 100.0;
    let percent = |x: f64| {
        if map.reference > 0.0 {
            round(100.0 * x / map.reference)
        } else {
            0.0
        }
    };
    let segments: Vec<Value> = map
        .segments
        .iter()
        .map(|s| {
            json!({
                "number": s.number,
                "name": NAMES[s.number - 1],
                "territory": territory(s.number),
                "mean_percent": s.mean_percent.map(round),
                "extent_percent": round(s.extent_percent),
                "area_mm2": round(s.area),
            })
        })
        .collect();
    let rows: Vec<Value> = map
        .pixels
        .chunks(COLUMNS)
        .map(|row| row.iter().map(|p| p.map(|p| percent(p.max))).collect())
        .collect();
    json!({
        "reference": map.reference,
        "threshold_percent": 100.0 * map.threshold,
        "extent_percent": round(map.extent_percent),
        "note": "per cent of the hottest quarter of this scan's own wall; no normal database, not TPD",
        "segments": segments,
        "rows": ROWS,
        "columns": COLUMNS,
        "first_column": "lateral",
        "direction": "lateral, anterior, septal, inferior",
        "values_percent": rows,
    })
}
