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
    /// For each pixel the number of its colour in `colours`; 0 where there is none.
    owners: Vec<u32>,
    /// The colours of facets, of each that of its face and that of its lines.
    colours: Vec<Colour>,
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
    let mut buffer = DepthBuffer::new(fine);
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
    fn new(side: usize) -> Self {
        Self {
            side,
            depth: vec![f64::NEG_INFINITY; side * side],
            owners: vec![0; side * side],
            colours: vec![[0.0; 3]],
        }
    }

    fn fill(&mut self, seen: &[Vec3; 3], colour: Colour, sides: &Sides, width: f64) {
        let [a, b, c] = seen;
        let doubled_area = cross(a, b, c);
        if doubled_area == 0.0 {
            return;
        }
        let face = self.colours.len() as u32;
        self.colours.extend([colour, colour.map(|c| 0.42 * c)]);
        for row in self.span([a.y, b.y, c.y]) {
            let y = row as f64 + 0.5;
            for column in self.covered(seen, y) {
                let p = Vec3::new(column as f64 + 0.5, y, 0.0);
                // Twice the areas over the sides ab, bc, ca.
                let over = [cross(a, b, &p), cross(b, c, &p), cross(c, a, &p)];
                if over.iter().any(|&w| w * doubled_area < 0.0) {
                    continue;
                }
                let depth = (a.z * over[1] + b.z * over[2] + c.z * over[0]) / doubled_area;
                let at = row * self.side + column;
                if depth > self.depth[at] {
                    self.depth[at] = depth;
                    let is_on_line = sides.distance(&p) < width / 2.0;
                    self.owners[at] = face + u32::from(is_on_line);
                }
            }
        }
    }

    /// The pixels of the row at height `y` that a triangle may cover: those between its sides, and one beside them.
    fn covered(&self, corners: &[Vec3; 3], y: f64) -> std::ops::Range<usize> {
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for (p, q) in (0..3).map(|k| (&corners[k], &corners[(k + 1) % 3])) {
            let (above, below) = (p.y - y, q.y - y);
            if above * below > 0.0 {
                continue;
            }
            let ends = if above == below {
                [p.x, q.x]
            } else {
                [p.x + (q.x - p.x) * (above / (above - below)); 2]
            };
            left = left.min(ends[0].min(ends[1]));
            right = right.max(ends[0].max(ends[1]));
        }
        if left > right {
            return 0..0;
        }
        self.span([left - 1.0, right + 1.0, left])
    }

    fn span(&self, ends: [f64; 3]) -> std::ops::Range<usize> {
        let limit = self.side as f64;
        let min = ends.iter().fold(limit, |m, x| m.min(*x)).floor();
        let max = ends.iter().fold(0.0f64, |m, x| m.max(*x)).ceil();
        min.clamp(0.0, limit) as usize..max.clamp(0.0, limit) as usize
    }

    /// The mean of the fine pixels at each of `side` × `side` pixels; alpha is the share covered.
    fn averaged(&self, side: usize) -> Image<4> {
        const SAMPLES: usize = SAMPLES_PER_PIXEL_SIDE * SAMPLES_PER_PIXEL_SIDE;
        let mut pixels = Vec::with_capacity(side * side);
        for row in 0..side {
            for column in 0..side {
                let owners: [u32; SAMPLES] = std::array::from_fn(|k| {
                    let y = row * SAMPLES_PER_PIXEL_SIDE + k / SAMPLES_PER_PIXEL_SIDE;
                    let x = column * SAMPLES_PER_PIXEL_SIDE + k % SAMPLES_PER_PIXEL_SIDE;
                    self.owners[y * self.side + x]
                });
                if owners == [0; SAMPLES] {
                    pixels.push([0; 4]);
                    continue;
                }
                let mut sum = [0.0; 3];
                let mut covered = 0.0;
                for owner in owners.into_iter().filter(|owner| *owner > 0) {
                    covered += 1.0;
                    let colour = &self.colours[owner as usize];
                    (0..3).for_each(|r| sum[r] += colour[r]);
                }
                let byte = |x: f64| (255.0 * x).round() as u8;
                let [r, g, b] = sum.map(|s| byte(s / covered));
                pixels.push([r, g, b, byte(covered / SAMPLES as f64)]);
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

    /// Every pixel that a triangle covers lies between the ends of its row.
    #[test]
    fn rows_leave_out_no_pixel_of_a_triangle() {
        let side = 60;
        let buffer = DepthBuffer::new(side);
        let mut seed = 1u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 8) / f64::from(1 << 24)
        };
        for turn in 0..400 {
            // Also slivers, level sides, and corners in the middle of a pixel or outside of the picture.
            let grid = if turn % 2 == 0 { 0.5 } else { 1e-9 };
            let mut corner = || {
                let [x, y] =
                    [random(), random()].map(|x| ((100.0 * x - 20.0) / grid).round() * grid);
                Vec3::new(x, y, 0.0)
            };
            let mut corners = [corner(), corner(), corner()];
            if turn % 5 == 0 {
                corners[1].y = corners[0].y;
            }
            let [a, b, c] = &corners;
            let doubled_area = cross(a, b, c);
            for (row, column) in (0..side * side).map(|n| (n / side, n % side)) {
                let p = Vec3::new(column as f64 + 0.5, row as f64 + 0.5, 0.0);
                let over = [cross(a, b, &p), cross(b, c, &p), cross(c, a, &p)];
                let is_covered =
                    doubled_area != 0.0 && over.iter().all(|w| w * doubled_area >= 0.0);
                let found = buffer.span([a.y, b.y, c.y]).contains(&row)
                    && buffer.covered(&corners, p.y).contains(&column);
                assert!(found || !is_covered, "{corners:?} {row} {column}");
            }
        }
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
