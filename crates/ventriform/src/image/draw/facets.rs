//! Shaded triangles, seen along an axis.
//!
//! In: triangles in patient coordinates, a direction to look from, a [`Style`]. Out: square RGBA
//! pixels. Orthographic projection, a depth buffer, flat shading, triangle edges drawn in; facets
//! that face away are left out. Rendered at [`SAMPLES_PER_PIXEL_SIDE`] times the size and averaged, so that
//! outlines are smooth. The background is transparent, so that the picture suits light and dark
//! pages.

use super::image::Image;
use crate::base::geometry::Vec3;

/// Rows and columns of rendered pixels for each of the picture's.
const SAMPLES_PER_PIXEL_SIDE: usize = 2;
/// Share of the picture's side that the object may take.
const OBJECT_SHARE: f64 = 0.88;

/// A colour: red, green, blue, 0..=1, as shown on a screen.
pub type Colour = [f64; 3];

/// A direction to look from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Name of the view in radiology.
    pub name: &'static str,
    /// Patient direction (LPS) that points right in the picture.
    pub right: Vec3,
    /// Patient direction that points up in the picture.
    pub up: Vec3,
    /// Letters at the picture's right, top, left and bottom.
    pub letters: [char; 4],
}

impl View {
    /// The three views of a report.
    pub const ALL: [View; 3] = [
        View {
            name: "Anterior",
            right: Vec3::new(1.0, 0.0, 0.0),
            up: Vec3::new(0.0, 0.0, 1.0),
            letters: ['L', 'S', 'R', 'I'],
        },
        View {
            name: "Left lateral",
            right: Vec3::new(0.0, 1.0, 0.0),
            up: Vec3::new(0.0, 0.0, 1.0),
            letters: ['P', 'S', 'A', 'I'],
        },
        View {
            name: "Superior",
            right: Vec3::new(-1.0, 0.0, 0.0),
            up: Vec3::new(0.0, -1.0, 0.0),
            letters: ['R', 'A', 'L', 'P'],
        },
    ];

    /// Unit vector from the object to the eye.
    pub fn toward(&self) -> Vec3 {
        self.right.cross(&self.up)
    }
}

/// A triangle to draw, alone or as a part of a larger one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Facet {
    /// Corners, LPS mm, counter-clockwise seen from outside.
    pub corners: [Vec3; 3],
    /// Colour before shading.
    pub colour: Colour,
    /// Corners of the triangle whose sides are drawn: the same, or those of the triangle that
    /// this one is a part of.
    pub outline: [Vec3; 3],
}

/// Square supersampled pixels with their depths toward the eye.
struct DepthBuffer {
    side: usize,
    depth: Vec<f64>,
    pixels: Vec<Option<Colour>>,
}

/// Placement, size, lines and light of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Style {
    /// Point in the middle of the picture, LPS mm.
    pub centre: Vec3,
    /// Largest distance of the object from there along any axis, mm.
    pub reach: f64,
    /// Rows and columns of the picture, pixels.
    pub side: usize,
    /// Width of lines, pixels.
    pub line: f64,
    /// Share of ambient light, 0..=1; the rest comes from two lamps. Colours that stand for
    /// values need more of it than those of a material.
    pub ambient: f64,
}

/// Draws `facets` as seen from `view`: `style.side` rows and columns.
pub fn picture(facets: &[Facet], view: &View, style: &Style) -> Image<4> {
    let side = style.side;
    let fine = side * SAMPLES_PER_PIXEL_SIDE;
    let mut buffer = DepthBuffer {
        side: fine,
        depth: vec![f64::NEG_INFINITY; fine * fine],
        pixels: vec![None; fine * fine],
    };
    let scale = OBJECT_SHARE * fine as f64 / 2.0 / style.reach.max(f64::MIN_POSITIVE);
    let middle = fine as f64 / 2.0;
    let toward = view.toward();
    for facet in facets {
        let [a, b, c] = &facet.corners;
        let Some(normal) = (b - a).cross(&(c - a)).try_normalize(0.0) else {
            continue;
        };
        if normal.dot(&toward) <= 0.0 {
            continue;
        }
        // x right, y down, z toward the eye.
        let project = |p: Vec3| {
            let p = (p - style.centre) * scale;
            Vec3::new(
                middle + p.dot(&view.right),
                middle - p.dot(&view.up),
                p.dot(&toward),
            )
        };
        let seen = facet.corners.map(project);
        let sides = Sides::new(&facet.outline.map(project));
        let local = Vec3::new(
            normal.dot(&view.right),
            normal.dot(&view.up),
            normal.dot(&toward),
        );
        let colour = shade(facet.colour, &local, style.ambient);
        buffer.fill(
            &seen,
            colour,
            &sides,
            style.line * SAMPLES_PER_PIXEL_SIDE as f64,
        );
    }
    buffer.averaged(side)
}

/// Lambert's law under a key light from the upper left and a weak one from the lower right,
/// over some light from everywhere. `normal`: x right, y up, z toward the eye.
fn shade(colour: Colour, normal: &Vec3, ambient: f64) -> Colour {
    let key = normal.dot(&Vec3::new(-0.45, 0.6, 0.66)).max(0.0);
    let fill = normal.dot(&Vec3::new(0.7, -0.4, 0.59)).max(0.0);
    let light = ambient + (1.0 - ambient) * (0.94 * key + 0.24 * fill);
    colour.map(|c| (c * light).clamp(0.0, 1.0))
}

impl DepthBuffer {
    fn fill(&mut self, [a, b, c]: &[Vec3; 3], colour: Colour, sides: &Sides, width: f64) {
        let doubled_area = cross(a, b, c);
        if doubled_area == 0.0 {
            return;
        }
        let dark = colour.map(|c| 0.42 * c);
        let columns = self.span([a.x, b.x, c.x]);
        for row in self.span([a.y, b.y, c.y]) {
            for column in columns.clone() {
                let p = Vec3::new(column as f64 + 0.5, row as f64 + 0.5, 0.0);
                // Twice the areas over the sides ab, bc, ca.
                let over = [cross(a, b, &p), cross(b, c, &p), cross(c, a, &p)];
                if over.iter().any(|&w| w * doubled_area < 0.0) {
                    continue;
                }
                let depth = (a.z * over[1] + b.z * over[2] + c.z * over[0]) / doubled_area;
                let at = row * self.side + column;
                if depth > self.depth[at] {
                    self.depth[at] = depth;
                    let on_line = sides.distance(&p) < width / 2.0;
                    self.pixels[at] = Some(if on_line { dark } else { colour });
                }
            }
        }
    }

    fn span(&self, ends: [f64; 3]) -> std::ops::Range<usize> {
        let limit = self.side as f64;
        let min = ends.iter().fold(limit, |m, x| m.min(*x)).floor();
        let max = ends.iter().fold(0.0f64, |m, x| m.max(*x)).ceil();
        min.clamp(0.0, limit) as usize..max.clamp(0.0, limit) as usize
    }

    /// The mean of the fine pixels at each of `side` × `side` pixels; alpha is the share covered.
    fn averaged(&self, side: usize) -> Image<4> {
        let mut pixels = Vec::with_capacity(side * side);
        for row in 0..side {
            for column in 0..side {
                let mut sum = [0.0; 3];
                let mut covered = 0.0;
                for k in 0..SAMPLES_PER_PIXEL_SIDE * SAMPLES_PER_PIXEL_SIDE {
                    let y = row * SAMPLES_PER_PIXEL_SIDE + k / SAMPLES_PER_PIXEL_SIDE;
                    let x = column * SAMPLES_PER_PIXEL_SIDE + k % SAMPLES_PER_PIXEL_SIDE;
                    if let Some(colour) = self.pixels[y * self.side + x] {
                        covered += 1.0;
                        (0..3).for_each(|r| sum[r] += colour[r]);
                    }
                }
                let byte = |x: f64| (255.0 * x).round() as u8;
                let [r, g, b] = sum.map(|s| byte(s / f64::max(covered, 1.0)));
                let alpha =
                    byte(covered / (SAMPLES_PER_PIXEL_SIDE * SAMPLES_PER_PIXEL_SIDE) as f64);
                pixels.push([r, g, b, alpha]);
            }
        }
        Image {
            width: side,
            height: side,
            pixels,
        }
    }
}

/// Twice the signed area of a triangle in the picture.
fn cross(p: &Vec3, q: &Vec3, r: &Vec3) -> f64 {
    (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x)
}

/// The sides of a triangle in the picture as lines: for each the two factors and the offset
/// that give a point's signed distance.
struct Sides([[f64; 3]; 3]);

impl Sides {
    fn new([a, b, c]: &[Vec3; 3]) -> Self {
        Self([(a, b), (b, c), (c, a)].map(|(p, q)| {
            let along = (q - p).xy();
            let length = along.norm().max(f64::MIN_POSITIVE);
            let (x, y) = (-along.y / length, along.x / length);
            [x, y, -(x * p.x + y * p.y)]
        }))
    }

    /// Distance of a point in the triangle to its nearest side.
    fn distance(&self, p: &Vec3) -> f64 {
        let to = |[x, y, offset]: [f64; 3]| (x * p.x + y * p.y + offset).abs();
        to(self.0[0]).min(to(self.0[1])).min(to(self.0[2]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{TriMesh, shapes};

    fn facets(mesh: &TriMesh) -> Vec<Facet> {
        (0..mesh.triangles.len())
            .map(|t| Facet {
                corners: mesh.corners(t),
                colour: [1.0; 3],
                outline: mesh.corners(t),
            })
            .collect()
    }

    #[test]
    fn a_sphere_covers_its_disc_without_gaps() {
        let mesh = shapes::icosphere(10.0, 4);
        let style = Style {
            centre: Vec3::zeros(),
            reach: 10.0,
            side: 100,
            line: 1.0,
            ambient: 0.3,
        };
        let picture = picture(&facets(&mesh), &View::ALL[0], &style);
        let alpha = picture.pixels.iter().map(|pixel| f64::from(pixel[3]));
        let share = alpha.sum::<f64>() / 255.0 / (style.side * style.side) as f64;
        let disc = std::f64::consts::PI * (OBJECT_SHARE / 2.0).powi(2);
        assert!((share / disc - 1.0).abs() < 0.01, "{share} {disc}");
    }

    #[test]
    fn every_view_is_right_handed_and_named_by_its_letters() {
        let direction = |letter| match letter {
            'L' => Vec3::x(),
            'R' => -Vec3::x(),
            'P' => Vec3::y(),
            'A' => -Vec3::y(),
            'S' => Vec3::z(),
            _ => -Vec3::z(),
        };
        for view in View::ALL {
            let [right, top, left, bottom] = view.letters.map(direction);
            assert_eq!((right, top), (view.right, view.up));
            assert_eq!((left, bottom), (-view.right, -view.up));
            let expected = match view.name {
                "Anterior" => 'A',
                "Left lateral" => 'L',
                _ => 'S',
            };
            assert_eq!(view.toward(), direction(expected));
        }
    }
}
