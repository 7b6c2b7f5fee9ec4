//! A picture described once and drawn twice: as SVG with text, and as pixels.
//!
//! In: shapes in pixels from the top left, x to the right and y down, each drawn over those
//! before it. Out: [`Drawing::svg`] or [`Drawing::image`]. In the pixels, lines, circles and text
//! are smooth: a pixel at an edge is blended by how far inside its centre lies. Polygons are not,
//! so that no seams show between neighbours. Text in the pixels consists of strokes and can
//! contain only the characters of `glyphs`.

use maud::{Markup, html};

use super::glyphs;
use super::image::Image;

/// Pixels to the right and down from the top left corner.
pub type Point = [f64; 2];
/// Red, green, blue.
pub type Rgb = [u8; 3];

/// A picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    /// Alternative text.
    pub title: String,
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The marks, from back to front.
    pub shapes: Vec<VectorShape>,
}

/// One thing in a [`Drawing`].
#[derive(Debug, Clone, PartialEq)]
pub enum VectorShape {
    /// A filled convex polygon.
    Polygon {
        /// Its corners in order, either way round.
        corners: Vec<Point>,
        /// Its colour.
        fill: Rgb,
    },
    /// A line between two points.
    Line {
        /// The two points.
        ends: [Point; 2],
        /// Its colour.
        stroke: Rgb,
        /// Its width, pixels.
        width: f64,
    },
    /// A circle that is not filled.
    Circle {
        /// Its centre.
        centre: Point,
        /// Its radius, pixels.
        radius: f64,
        /// Its colour.
        stroke: Rgb,
        /// The line's width, pixels.
        width: f64,
    },
    /// A line of text.
    Label {
        /// Its middle.
        middle: Point,
        /// The text.
        text: String,
        /// Height of a line of text, pixels (SVG's font size).
        size: f64,
        /// Its colour.
        ink: Rgb,
        /// Colour of a rim about each character.
        rim: Option<Rgb>,
    },
}

/// Width of the rim about a character, pixels.
const HALO_WIDTH_PX: f64 = 1.5;
/// Height of a capital as a share of a text's size.
const CAPITAL_HEIGHT_SHARE: f64 = 0.7;
/// Width of a character's strokes as a share of a text's size.
const STROKE_WIDTH_SHARE: f64 = 0.1;
/// Width of a stroke's unit as a share of its height: characters are slim.
const GLYPH_ASPECT: f64 = 0.75;
/// Room between characters as a share of their width.
const GLYPH_SPACING_SHARE: f64 = 0.4;

impl Drawing {
    /// An SVG file with a viewer's own sans-serif font.
    pub fn svg(&self) -> String {
        let (width, height) = (self.width, self.height);
        html! {
            svg xmlns="http://www.w3.org/2000/svg" width=(width) height=(height)
                viewBox=(format_args!("0 0 {width} {height}"))
                font-family="sans-serif" text-anchor="middle" stroke-linejoin="round" {
                title { (self.title) }
                @for shape in &self.shapes { (shape.svg()) }
            }
        }
        .into_string()
            + "\n"
    }

    /// The pixels on white.
    pub fn image(&self) -> Image<3> {
        let mut image = Image::filled(self.width, self.height, [255; 3]);
        for shape in &self.shapes {
            shape.paint(&mut image);
        }
        image
    }
}

fn hex([r, g, b]: Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

impl VectorShape {
    fn svg(&self) -> Markup {
        match self {
            Self::Polygon { corners, fill } => {
                let points = corners.iter().map(|[x, y]| format!("{x:.2} {y:.2}"));
                let path = format!("M{}Z", points.collect::<Vec<_>>().join("L"));
                html! { path d=(path) fill=(hex(*fill)) {} }
            }
            Self::Line {
                ends: [[x1, y1], [x2, y2]],
                stroke,
                width,
            } => html! {
                line x1=(format_args!("{x1:.2}")) y1=(format_args!("{y1:.2}"))
                    x2=(format_args!("{x2:.2}")) y2=(format_args!("{y2:.2}"))
                    stroke=(hex(*stroke)) stroke-width=(width) {}
            },
            Self::Circle {
                centre: [x, y],
                radius,
                stroke,
                width,
            } => html! {
                circle cx=(x) cy=(y) r=(radius) fill="none" stroke=(hex(*stroke))
                    stroke-width=(width) {}
            },
            Self::Label {
                middle: [x, y],
                text,
                size,
                ink,
                rim,
            } => html! {
                text x=(format_args!("{x:.1}")) y=(format_args!("{:.1}", y + CAPITAL_HEIGHT_SHARE / 2.0 * size))
                    font-size=(size) fill=(hex(*ink)) stroke=[rim.map(hex)]
                    stroke-width=[rim.map(|_| 2.0 * HALO_WIDTH_PX)] paint-order=[rim.map(|_| "stroke")] {
                    (text)
                }
            },
        }
    }

    /// Draws it over the pixels.
    pub(crate) fn paint(&self, image: &mut Image<3>) {
        match self {
            Self::Polygon { corners, fill } => paint_polygon(image, corners, *fill),
            Self::Line {
                ends,
                stroke,
                width,
            } => paint_line(image, *ends, *stroke, *width),
            Self::Circle {
                centre: [x, y],
                radius,
                stroke,
                width,
            } => {
                let reach = radius + width / 2.0 + 1.0;
                let corners = [[x - reach, y - reach], [x + reach, y + reach]];
                blend(image, &corners, *stroke, |[px, py]| {
                    0.5 + width / 2.0 - ((px - x).hypot(py - y) - radius).abs()
                });
            }
            Self::Label {
                middle,
                text,
                size,
                ink,
                rim,
            } => {
                let width = STROKE_WIDTH_SHARE * size;
                let lines = text_lines(*middle, text, *size);
                for ends in lines.iter().filter(|_| rim.is_some()) {
                    paint_line(
                        image,
                        *ends,
                        rim.unwrap_or_default(),
                        width + 2.0 * HALO_WIDTH_PX,
                    );
                }
                for ends in lines {
                    paint_line(image, ends, *ink, width);
                }
            }
        }
    }
}

/// Mixes `colour` into the pixels of the box about `corners` by the share that `coverage` gives for
/// their centres, clamped to 0..=1.
fn blend(image: &mut Image<3>, corners: &[Point], colour: Rgb, coverage: impl Fn(Point) -> f64) {
    let span = |axis: usize, size: usize| {
        let ends = corners.iter().map(|corner| corner[axis]);
        let low = ends.clone().fold(f64::INFINITY, f64::min) - 1.0;
        let high = ends.fold(f64::NEG_INFINITY, f64::max) + 1.0;
        let limit = size as f64;
        low.floor().clamp(0.0, limit) as usize..high.ceil().clamp(0.0, limit) as usize
    };
    let columns = span(0, image.width);
    for row in span(1, image.height) {
        for column in columns.clone() {
            let share = coverage([column as f64 + 0.5, row as f64 + 0.5]).clamp(0.0, 1.0);
            if share > 0.0 {
                let pixel = &mut image.pixels[row * image.width + column];
                for (old, new) in pixel.iter_mut().zip(colour) {
                    let mixed = f64::from(*old) * (1.0 - share) + f64::from(new) * share;
                    *old = mixed.round() as u8;
                }
            }
        }
    }
}

/// Fills the pixels whose centres lie within.
fn paint_polygon(image: &mut Image<3>, corners: &[Point], fill: Rgb) {
    let next = corners.iter().cycle().skip(1);
    // Of each side two factors and the offset that give a point's signed distance.
    let sides: Vec<[f64; 3]> = corners
        .iter()
        .zip(next)
        .filter_map(|([x0, y0], [x1, y1])| {
            let length = (x1 - x0).hypot(y1 - y0);
            let (a, b) = ((y0 - y1) / length, (x1 - x0) / length);
            (length > 0.0).then_some([a, b, -(a * x0 + b * y0)])
        })
        .collect();
    let count = corners.len() as f64;
    let middle = [0, 1].map(|axis| corners.iter().map(|c| c[axis]).sum::<f64>() / count);
    let distance = |[a, b, offset]: &[f64; 3], [x, y]: Point| a * x + b * y + offset;
    // Positive within, whichever way the corners run.
    let inward: Vec<[f64; 3]> = sides
        .into_iter()
        .map(|side| side.map(|f| f * distance(&side, middle).signum()))
        .collect();
    blend(image, corners, fill, |point| {
        let within = inward.iter().all(|side| distance(side, point) >= 0.0);
        if within { 1.0 } else { 0.0 }
    });
}

/// A line with round ends.
fn paint_line(image: &mut Image<3>, [from, to]: [Point; 2], stroke: Rgb, width: f64) {
    let along = [to[0] - from[0], to[1] - from[1]];
    let squared = along[0] * along[0] + along[1] * along[1];
    let reach = width / 2.0;
    let corners = [
        [from[0].min(to[0]) - reach, from[1].min(to[1]) - reach],
        [from[0].max(to[0]) + reach, from[1].max(to[1]) + reach],
    ];
    blend(image, &corners, stroke, |[x, y]| {
        let way = [x - from[0], y - from[1]];
        let share = (way[0] * along[0] + way[1] * along[1]) / squared.max(f64::MIN_POSITIVE);
        let share = share.clamp(0.0, 1.0);
        let distance = (way[0] - share * along[0]).hypot(way[1] - share * along[1]);
        0.5 + width / 2.0 - distance
    });
}

/// The strokes of `text` about `middle` as lines.
fn text_lines([x, y]: Point, text: &str, size: f64) -> Vec<[Point; 2]> {
    let unit = CAPITAL_HEIGHT_SHARE * size / glyphs::CAPITAL_HEIGHT;
    let width = glyphs::GLYPH_WIDTH * GLYPH_ASPECT * unit;
    let advance = width * (1.0 + GLYPH_SPACING_SHARE);
    let count = text.chars().count() as f64;
    let left = x - (count * advance - GLYPH_SPACING_SHARE * width) / 2.0;
    let top = y - CAPITAL_HEIGHT_SHARE * size / 2.0;
    let mut lines = Vec::new();
    for (place, character) in text.chars().enumerate() {
        let start = left + place as f64 * advance;
        let point = |(x, y): (i8, i8)| {
            [
                start + f64::from(x) * GLYPH_ASPECT * unit,
                top + f64::from(y) * unit,
            ]
        };
        for stroke in glyphs::strokes(character) {
            lines.extend(stroke.windows(2).map(|p| [point(p[0]), point(p[1])]));
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawing(shape: VectorShape) -> Drawing {
        Drawing {
            title: "a < b".into(),
            width: 40,
            height: 40,
            shapes: vec![shape],
        }
    }

    /// Sum of how dark the pixels of a black shape are, in pixels.
    fn ink(shape: VectorShape) -> f64 {
        let image = drawing(shape).image();
        let dark = image.pixels.iter().map(|p| 1.0 - f64::from(p[0]) / 255.0);
        dark.sum()
    }

    #[test]
    fn shapes_cover_their_areas_in_pixels() {
        let square = vec![[10.3, 10.0], [10.3, 20.4], [20.7, 20.4], [20.7, 10.0]];
        let fill = [0; 3];
        let area = ink(VectorShape::Polygon {
            corners: square.iter().rev().copied().collect(),
            fill,
        });
        // Centres of 11 columns and 10 rows of pixels.
        assert_eq!(area, 110.0);
        let turned = ink(VectorShape::Polygon {
            corners: square,
            fill,
        });
        assert_eq!(area, turned);
        let stroke = [0; 3];
        let line = ink(VectorShape::Line {
            ends: [[5.0, 8.0], [30.0, 30.0]],
            stroke,
            width: 2.0,
        });
        let length = 25f64.hypot(22.0);
        assert!((line / (2.0 * length + 3.0) - 1.0).abs() < 0.05, "{line}");
        let circle = ink(VectorShape::Circle {
            centre: [20.0, 20.0],
            radius: 12.0,
            stroke,
            width: 2.0,
        });
        let expected = 2.0 * std::f64::consts::TAU * 12.0;
        assert!((circle / expected - 1.0).abs() < 0.05, "{circle}");
    }

    #[test]
    fn both_pictures_have_the_label() {
        let label = drawing(VectorShape::Label {
            middle: [20.0, 20.0],
            text: "0&".into(),
            size: 20.0,
            ink: [0; 3],
            rim: Some([255, 0, 0]),
        });
        let svg = label.svg();
        assert!(svg.contains("a &lt; b") && svg.contains("0&amp;"));
        assert!(svg.contains("paint-order=\"stroke\""));
        let image = label.image();
        let count = |colour: Rgb| image.pixels.iter().filter(|p| **p == colour).count();
        assert!(count([0; 3]) > 5 && count([255, 0, 0]) > 20);
    }
}
