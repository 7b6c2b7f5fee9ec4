//! A picture described once and drawn twice: as SVG with text, and as pixels.
//!
//! In: shapes in pixels from the top left, x to the right and y down, each drawn over those
//! before it. Out: [`Drawing::svg`] or [`Drawing::image`]. In the pixels, lines, circles and text
//! are smooth: a pixel at an edge is blended by how far inside its centre lies. Polygons are not,
//! so that no seams show between neighbours. Text in the pixels has the characters and the four sizes of `glyphs`,
//! which are all of one width ([`text_width`]).

use maud::{Markup, html};

use super::glyphs::{Font, Weight};
use super::image::Image;
use super::text::data_uri;

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
        /// The height of the capitals' middle, and the place that `anchor` says.
        at: Point,
        /// The part of the text that is there.
        anchor: Anchor,
        /// The text.
        text: String,
        /// Thickness of its characters.
        weight: Weight,
        /// Height of a line of text, pixels (SVG's font size).
        size: f64,
        /// Its colour.
        ink: Rgb,
        /// Colour of a rim about each character.
        rim: Option<Rgb>,
    },
    /// Another picture.
    Picture {
        /// Its top left corner.
        corner: [usize; 2],
        /// Its pixels.
        image: Image<3>,
    },
}

/// The part of a text whose place is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Its left end.
    Start,
    /// Its middle.
    Middle,
    /// Its right end.
    End,
}

impl Anchor {
    fn svg(self) -> Option<&'static str> {
        match self {
            Self::Start => Some("start"),
            // That of the whole picture.
            Self::Middle => None,
            Self::End => Some("end"),
        }
    }
}

/// Width of the rim about a character, pixels.
const HALO_WIDTH_PX: f64 = 1.5;
/// Height of a capital as a share of a text's size.
const CAPITAL_HEIGHT_SHARE: f64 = 0.7;

/// Width of `text` in a picture's pixels.
pub fn text_width(text: &str, size: f64, weight: Weight) -> usize {
    text.chars().count() * Font::nearest(size, weight).character_width()
}

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
                at: [x, y],
                anchor,
                text,
                weight,
                size,
                ink,
                rim,
            } => html! {
                text x=(format_args!("{x:.1}")) y=(format_args!("{:.1}", y + CAPITAL_HEIGHT_SHARE / 2.0 * size))
                    text-anchor=[anchor.svg()] font-weight=[(*weight == Weight::Bold).then_some("bold")]
                    font-size=(size) fill=(hex(*ink)) stroke=[rim.map(hex)]
                    stroke-width=[rim.map(|_| 2.0 * HALO_WIDTH_PX)] paint-order=[rim.map(|_| "stroke")] {
                    (text)
                }
            },
            Self::Picture {
                corner: [x, y],
                image,
            } => html! {
                image x=(x) y=(y) width=(image.width) height=(image.height)
                    href=(data_uri("image/png", &image.png())) {}
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
                at,
                anchor,
                text,
                weight,
                size,
                ink,
                rim,
            } => {
                let font = Font::nearest(*size, *weight);
                let start = text_start(*at, *anchor, text, font);
                if let Some(rim) = rim {
                    paint_text(image, start, text, font, *rim, RIM);
                }
                paint_text(image, start, text, font, *ink, &[([0, 0], 1.0)]);
            }
            Self::Picture {
                corner: [left, top],
                image: picture,
            } => {
                let width = picture.width.min(image.width.saturating_sub(*left));
                // Beyond the right side there is no row of pixels to begin in.
                let rows = if width > 0 {
                    image.height.saturating_sub(*top)
                } else {
                    0
                };
                let lines = picture.pixels.chunks_exact(picture.width.max(1));
                for (row, pixels) in lines.take(rows).enumerate() {
                    let start = (top + row) * image.width + left;
                    image.pixels[start..start + width].copy_from_slice(&pixels[..width]);
                }
            }
        }
    }
}

/// The places about a character's pixel that its rim covers too: columns and rows away, and how many times as much, up
/// to all. A character's edge is smooth: beside a pixel that it covers by half, its rim covers the next one whole.
const RIM: &[([i64; 2], f64)] = &[
    ([0, 0], 2.0),
    ([-1, 0], 2.0),
    ([1, 0], 2.0),
    ([0, -1], 2.0),
    ([0, 1], 2.0),
    ([-1, -1], 1.2),
    ([1, -1], 1.2),
    ([-1, 1], 1.2),
    ([1, 1], 1.2),
];

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
                mix(&mut image.pixels[row * image.width + column], colour, share);
            }
        }
    }
}

fn mix(pixel: &mut Rgb, colour: Rgb, share: f64) {
    for (old, new) in pixel.iter_mut().zip(colour) {
        let mixed = f64::from(*old) * (1.0 - share) + f64::from(new) * share;
        *old = mixed.round() as u8;
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

/// Column and row of the top left pixel of `text`.
fn text_start([x, y]: Point, anchor: Anchor, text: &str, font: Font) -> [i64; 2] {
    let width = (text.chars().count() * font.character_width()) as f64;
    let left = match anchor {
        Anchor::Start => x,
        Anchor::Middle => x - width / 2.0,
        Anchor::End => x - width,
    };
    let top = y - font.capital_middle();
    [left.round() as i64, top.round() as i64]
}

/// Mixes `colour` into the pixels that `text` covers, and those at `places` beside them. What lies outside of the
/// picture is left out.
fn paint_text(
    image: &mut Image<3>,
    [left, top]: [i64; 2],
    text: &str,
    font: Font,
    colour: Rgb,
    places: &[([i64; 2], f64)],
) {
    let width = font.character_width();
    let mut shares = std::collections::BTreeMap::<usize, f64>::new();
    for (number, character) in text.chars().enumerate() {
        for (pixel, coverage) in font.coverage(character).iter().enumerate() {
            if *coverage == 0 {
                continue;
            }
            let column = left + (number * width + pixel % width) as i64;
            let row = top + (pixel / width) as i64;
            for ([across, down], share) in places {
                let within =
                    |at: i64, size: usize| usize::try_from(at).ok().filter(|at| *at < size);
                let column = within(column + across, image.width);
                let row = within(row + down, image.height);
                let (Some(column), Some(row)) = (column, row) else {
                    continue;
                };
                let all = shares.entry(row * image.width + column).or_default();
                *all = f64::max(*all, share * f64::from(*coverage) / 255.0).min(1.0);
            }
        }
    }
    for (pixel, share) in shares {
        mix(&mut image.pixels[pixel], colour, share);
    }
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
            at: [20.0, 20.0],
            anchor: Anchor::Middle,
            text: "0&".into(),
            weight: Weight::Bold,
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

    /// Columns with ink, first and last, of a text at 20 pixels from the left.
    fn ink_columns(anchor: Anchor) -> [usize; 2] {
        let label = drawing(VectorShape::Label {
            at: [20.0, 20.0],
            anchor,
            text: "HH".into(),
            weight: Weight::Regular,
            size: 12.0,
            ink: [0; 3],
            rim: None,
        });
        let image = label.image();
        let dark = |column: &usize| (0..40).any(|row| image.pixels[row * 40 + column][0] < 128);
        let columns: Vec<usize> = (0..40).filter(dark).collect();
        [columns[0], columns[columns.len() - 1]]
    }

    #[test]
    fn a_text_lies_where_its_anchor_says() {
        let width = text_width("HH", 12.0, Weight::Regular);
        let [left, right] = ink_columns(Anchor::Start);
        assert!(left >= 20 && right < 20 + width);
        let [left, right] = ink_columns(Anchor::End);
        assert!(left >= 20 - width && right < 20);
        let [left, right] = ink_columns(Anchor::Middle);
        assert!(left >= 20 - width.div_ceil(2) && right <= 20 + width.div_ceil(2));
    }

    #[test]
    fn what_lies_outside_of_the_picture_is_left_out() {
        let mut shapes = Vec::new();
        for at in [[-9.0, 20.0], [39.0, 1.0], [20.0, 40.0], [90.0, 90.0]] {
            shapes.push(VectorShape::Label {
                at,
                anchor: Anchor::Start,
                text: "Wg\u{5c71}".into(),
                weight: Weight::Bold,
                size: 23.0,
                ink: [0; 3],
                rim: Some([9; 3]),
            });
        }
        for corner in [[38, 37], [40, 0], [0, 40], [99, 38], [99, 99]] {
            let image = Image::filled(4, 5, [7, 200, 30]);
            shapes.push(VectorShape::Picture { corner, image });
        }
        let picture = Drawing {
            shapes,
            ..drawing(VectorShape::Circle {
                centre: [0.0; 2],
                radius: 1.0,
                stroke: [0; 3],
                width: 1.0,
            })
        };
        let image = picture.image();
        let count = |colour: Rgb| image.pixels.iter().filter(|p| **p == colour).count();
        assert_eq!(count([7, 200, 30]), 2 * 3);
        assert!(picture.svg().contains("data:image/png;base64,"));
    }
}
