//! Figures of a fitted ventricle that tell good fits from bad ones.
//!
//! In go the fitted model and the wall seen from its axis; out comes [`Evidence`], the figures that
//! [`confidence`](super::confidence) turns into a chance and the flags give as reasons. No other
//! fit and no mask is needed.

use std::f64::consts::TAU;
use std::ops::Range;

use nalgebra::Matrix3;

use super::motion::Views;
use crate::base::geometry::Vec3;
use crate::base::numeric::order;
use crate::heart::model::wall::{RAY_COLUMNS, RAY_ROWS, VentricleWall, WallRay};
use crate::image::grid::field::Field;

/// Rows between the apical cap and the rim, where hearts are round.
const BODY_ROWS: Range<usize> = 14..28;
/// Columns about the middle of the septum.
const SEPTAL_COLUMNS: Range<usize> = 22..38;
/// Columns that are clear of the septum: those before the first and those from the second on.
const FREE_WALL_COLUMNS: [usize; 2] = [18, 42];

/// Figures of a fitted ventricle that tell good fits from bad ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// Share of the model's area whose sensors see an edge, 0..=1.
    pub active: f64,
    /// Weighted rms distance to the edges, mm.
    pub residual: f64,
    /// Root mean square of the strain.
    pub strain: f64,
    /// Share of the wall's brightness that the cavity lacks, 0..=1.
    pub hollowness: f64,
    /// Volume of the cavity, ml.
    pub cavity_ml: f64,
    /// Standard deviation of the wall's thickness over the wall, mm.
    pub thickness_spread: f64,
    /// Standard deviation of the distance from the axis to the middle of the wall, between the
    /// apical cap and the rim, as a share of its mean.
    pub unroundness: f64,
    /// Distance of the middle of the wall from the axis there, as a share of that mean.
    pub offset: f64,
    /// Length from rim to apex over the outer radius.
    pub slenderness: f64,
    /// Distance of the septum from the axis over that of the free wall.
    pub septal_bulge: f64,
    /// Distance of the septum outside the circles through the free wall, as a share of their radius.
    /// It does not depend on the axis, which moves towards a septum that is fitted too far out.
    pub septal_overshoot: f64,
    /// Share of the wall that takes up less than half as much as the bright wall does, 0..=1.
    pub dark: f64,
    /// Share of the wall beside which, 12 to 18 mm beyond its outer surface, something takes up more than
    /// half as much as the bright wall does, 0..=1: other organs, or the wall's own image elsewhere.
    pub beside: f64,
    /// Figures of the projections of the image; `None` where the wall projects to nothing.
    pub views: Option<Views>,
}

/// Agreement of a model with the edges of the image.
pub(super) struct Edges {
    /// [`Evidence::active`].
    pub active: f64,
    /// [`Evidence::residual`].
    pub residual: f64,
    /// [`Evidence::strain`].
    pub strain: f64,
}

impl Evidence {
    /// The figures of a fit whose apparent wall, before its rim was moved, is `wall`, in a heart that is hollow by
    /// `hollowness`, in this blurred `image` and its projections, the `views`; `None` for models whose wall no ray
    /// meets.
    pub(super) fn new(
        wall: &VentricleWall,
        edges: &Edges,
        hollowness: f64,
        image: &Field,
        views: Option<Views>,
    ) -> Option<Self> {
        let uptake = WallUptake::new(wall, image)?;
        let middle: Vec<f64> = (0..RAY_COLUMNS)
            .map(|column| mean(&middles(wall, column..column + 1)))
            .collect::<Option<_>>()?;
        let radii = middles(wall, 0..RAY_COLUMNS);
        let radius = mean(&radii)?;
        let squares: f64 = radii.iter().map(|r| (r - radius).powi(2)).sum();
        let outer: Vec<f64> = of_body(wall, 0..RAY_COLUMNS)
            .map(|[_, leaves]| leaves)
            .collect();
        let free: Vec<f64> = [0..FREE_WALL_COLUMNS[0], FREE_WALL_COLUMNS[1]..RAY_COLUMNS]
            .into_iter()
            .flat_map(|columns| middles(wall, columns))
            .collect();
        Some(Self {
            active: edges.active,
            residual: edges.residual,
            strain: edges.strain,
            hollowness,
            cavity_ml: wall.cavity_ml,
            thickness_spread: wall.thickness_spread,
            unroundness: (squares / radii.len() as f64).sqrt() / radius,
            offset: first_harmonic(&middle) / radius,
            slenderness: (wall.extent[1] - wall.extent[0]) / mean(&outer)?,
            septal_bulge: mean(&middles(wall, SEPTAL_COLUMNS))? / mean(&free)?,
            septal_overshoot: septal_overshoot(wall),
            dark: uptake.dark,
            beside: uptake.beside,
            views,
        })
    }
}

/// [`Evidence::dark`] and [`Evidence::beside`].
struct WallUptake {
    dark: f64,
    beside: f64,
}

/// Quantile of the wall's uptake that counts as that of bright wall.
const BRIGHT_WALL_QUANTILE: f64 = 0.85;
/// Distances of neighbours beyond the outer surface, least and greatest, mm.
const NEIGHBOUR_DISTANCE_MM: [i32; 2] = [12, 18];

impl WallUptake {
    fn new(wall: &VentricleWall, image: &Field) -> Option<Self> {
        let greatest = |ray: &WallRay, from: f64, to: f64| {
            let steps = (to - from).max(0.0).round() as usize;
            let at = |n: usize| image.at(&(ray.start + ray.direction * (from + n as f64)));
            (0..=steps).map(at).fold(f64::MIN, f64::max)
        };
        // Uptake of the wall, uptake beside it, share of the area.
        let rays: Vec<[f64; 3]> = wall
            .rays
            .iter()
            .filter_map(|ray| {
                let [enters, leaves] = ray.wall?;
                let middle = ray.direction * f64::midpoint(enters, leaves);
                let along = wall.along_axis(&(ray.start + middle)) - wall.along_axis(&ray.start);
                let across = (middle.norm_squared() - along * along).max(0.0).sqrt();
                let [near, far] = NEIGHBOUR_DISTANCE_MM.map(|mm| leaves + f64::from(mm));
                Some([
                    greatest(ray, enters, leaves),
                    greatest(ray, near, far),
                    across,
                ])
            })
            .collect();
        let mut uptakes: Vec<f64> = rays.iter().map(|r| r[0]).collect();
        uptakes.sort_by(f64::total_cmp);
        let area: f64 = rays.iter().map(|r| r[2]).sum();
        if uptakes.is_empty() || !(area > 0.0) {
            return None;
        }
        let half = 0.5 * order::quantile(&uptakes, BRIGHT_WALL_QUANTILE);
        let share = |what: &dyn Fn(&[f64; 3]) -> bool| {
            let of: f64 = rays.iter().filter(|r| what(r)).map(|r| r[2]).sum();
            of / area
        };
        Some(Self {
            dark: share(&|r| r[0] < half),
            beside: share(&|r| r[1] > half),
        })
    }
}

/// [`Evidence::septal_overshoot`], the mean over the rows of the body; 0 where none shows enough of the
/// septum and of the free wall.
fn septal_overshoot(wall: &VentricleWall) -> f64 {
    let of_row = |row: usize| {
        let places = |columns: Range<usize>| {
            columns.filter_map(move |column| {
                let [enters, leaves] = wall.rays[row * RAY_COLUMNS + column].wall?;
                let (sin, cos) = (TAU * (column as f64 + 0.5) / RAY_COLUMNS as f64).sin_cos();
                let middle = f64::midpoint(enters, leaves);
                Some([middle * cos, middle * sin])
            })
        };
        let free: Vec<[f64; 2]> = places(0..FREE_WALL_COLUMNS[0])
            .chain(places(FREE_WALL_COLUMNS[1]..RAY_COLUMNS))
            .collect();
        let septum: Vec<[f64; 2]> = places(SEPTAL_COLUMNS).collect();
        if 3 * free.len() < RAY_COLUMNS || 2 * septum.len() < SEPTAL_COLUMNS.len() {
            return None;
        }
        let ([x, y], radius) = circle(&free)?;
        let outside = |p: &[f64; 2]| (p[0] - x).hypot(p[1] - y) / radius - 1.0;
        mean(&septum.iter().map(outside).collect::<Vec<_>>())
    };
    mean(&BODY_ROWS.filter_map(of_row).collect::<Vec<_>>()).unwrap_or(0.0)
}

/// Centre and radius of the circle through points in the sense of least squares (Kåsa 1976); `None` if
/// they lie on a line.
fn circle(points: &[[f64; 2]]) -> Option<([f64; 2], f64)> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vec3::zeros());
    for [x, y] in points {
        let row = Vec3::new(2.0 * x, 2.0 * y, 1.0);
        normal += row * row.transpose();
        right += row * (x * x + y * y);
    }
    let [x, y, rest] = (normal.try_inverse()? * right).into();
    let radius = (rest + x * x + y * y).max(0.0).sqrt();
    (radius > 0.0).then_some(([x, y], radius))
}

/// Distances at which the rays of these columns, between the apical cap and the rim, enter and leave the wall.
fn of_body(wall: &VentricleWall, columns: Range<usize>) -> impl Iterator<Item = [f64; 2]> {
    const { assert!(BODY_ROWS.end <= RAY_ROWS) };
    let rows = BODY_ROWS.flat_map(move |row| columns.clone().map(move |c| row * RAY_COLUMNS + c));
    rows.filter_map(|index| wall.rays[index].wall)
}

/// Distances from the axis to the middle of the wall along those rays, mm.
fn middles(wall: &VentricleWall, columns: Range<usize>) -> Vec<f64> {
    of_body(wall, columns)
        .map(|[enters, leaves]| f64::midpoint(enters, leaves))
        .collect()
}

fn mean(values: &[f64]) -> Option<f64> {
    let sum: f64 = values.iter().sum();
    (!values.is_empty()).then(|| sum / values.len() as f64)
}

/// Amplitude of one oscillation per turn: the distance of a circle's centre from the axis.
fn first_harmonic(around: &[f64]) -> f64 {
    let (mut x, mut y) = (0.0, 0.0);
    for (n, value) in around.iter().enumerate() {
        let (sin, cos) = (TAU * (n as f64 + 0.5) / around.len() as f64).sin_cos();
        x += value * cos;
        y += value * sin;
    }
    2.0 * x.hypot(y) / around.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::base::progress::Monitor;
    use crate::image::grid::Volume;
    use crate::image::locate::cup::Cup;
    use crate::mesh::{TriMesh, shapes};

    #[test]
    fn a_circle_is_found_by_a_part_of_it() {
        let at = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            [3.0 + 20.0 * cos, 20.0 * sin - 5.0]
        };
        let points: Vec<[f64; 2]> = (0..20).map(|n| at(10.0 * f64::from(n))).collect();
        let ([x, y], radius) = circle(&points).unwrap();
        assert!((x - 3.0).abs() + (y + 5.0).abs() + (radius - 20.0).abs() < 1e-6);
        assert!(circle(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]).is_none());
    }

    #[test]
    fn the_first_harmonic_is_the_shift_of_a_circle() {
        let radius = |shift: f64| {
            let at = |n: usize| {
                let angle = TAU * (n as f64 + 0.5) / 60.0;
                shift * angle.cos() + (400.0 - (shift * angle.sin()).powi(2)).sqrt()
            };
            first_harmonic(&(0..60).map(at).collect::<Vec<_>>())
        };
        assert!(radius(0.0) < 1e-9);
        assert!((radius(1.5) - 1.5).abs() < 1e-9);
    }

    /// A cup of 70 mm, 30 mm outer radius and a wall of 10 mm; its axis points down.
    fn cup() -> TriMesh {
        shapes::cup(70.0, 30.0, 10.0, 48)
    }

    fn wall(mesh: &TriMesh) -> VentricleWall {
        let cup = Cup {
            centre: Vec3::new(0.0, 0.0, -25.0),
            axis: -Vec3::z(),
            length: 70.0,
            breadth: 1.0,
        };
        VentricleWall::new(mesh, &cup, &Vec3::y(), &Monitor::silent()).unwrap()
    }

    fn image(value: impl Fn(&Vec3) -> f64) -> Field {
        let centre = Vec3::new(0.0, 0.0, -30.0);
        let frame = VoxelToPatient::centred([60; 3], [2.0; 3], centre).unwrap();
        Field::new(&Volume::sampled([60; 3], frame, value), None, 0.0)
    }

    fn evidence_of(mesh: &TriMesh) -> Evidence {
        let edges = Edges {
            active: 0.6,
            residual: 0.8,
            strain: 0.2,
        };
        Evidence::new(&wall(mesh), &edges, 0.5, &image(|_| 1.0), None).unwrap()
    }

    /// A cup turned about its axis is round and lies about it; moved aside by 3 mm it lies 3 mm off the axis,
    /// and one whose septum (the columns about 180 degrees, at the patient's right) is moved out has a bulge there.
    #[test]
    fn a_round_heart_is_round_and_a_bulge_is_seen() {
        let still = evidence_of(&cup());
        assert!(
            (still.active, still.residual, still.strain, still.hollowness) == (0.6, 0.8, 0.2, 0.5)
        );
        // A half ellipsoid narrows a little within the rows of the body.
        assert!(
            still.unroundness < 0.12 && still.offset < 0.005,
            "{still:?}"
        );
        assert!((still.septal_bulge - 1.0).abs() < 0.01 && still.septal_overshoot.abs() < 0.01);
        // The rim's rounding is part of the length.
        assert!((still.slenderness - 75.0 / 27.7).abs() < 0.15, "{still:?}");
        // Half an ellipsoid of 50 ml, and what lies between it and the top of the rim.
        assert!((50.0..62.0).contains(&still.cavity_ml), "{still:?}");
        assert!((still.dark, still.beside) == (0.0, 1.0));

        let mut moved = cup();
        moved.vertices.iter_mut().for_each(|p| p.y += 3.0);
        let moved = evidence_of(&moved);
        let radius = 24.0;
        assert!(
            (moved.offset - 3.0 / radius).abs() < 0.02,
            "{}",
            moved.offset
        );
        assert!(moved.septal_overshoot.abs() < 0.02, "{moved:?}");
        // The rms of 3 cos about the mean radius.
        let exact = (still.unroundness.powi(2) + (3.0 / radius).powi(2) / 2.0).sqrt();
        assert!(
            (moved.unroundness - exact).abs() < 0.02,
            "{}",
            moved.unroundness
        );

        let round = wall(&cup());
        let septal = round.rays[20 * RAY_COLUMNS + 30].direction;
        let lateral = round.rays[20 * RAY_COLUMNS].direction;
        let mut bulged = cup();
        for p in &mut bulged.vertices {
            let across = Vec3::new(p.x, p.y, 0.0);
            if across.dot(&septal) > 0.5 * across.norm() {
                *p += septal * 3.0;
            }
        }
        // A third of a turn of the free wall and half of the septum have to show.
        let seen = |free: usize, septum: usize| {
            let mut part = wall(&bulged);
            let free = (FREE_WALL_COLUMNS[1]..RAY_COLUMNS)
                .chain(0..FREE_WALL_COLUMNS[0])
                .skip(free);
            for row in BODY_ROWS {
                for column in free
                    .clone()
                    .chain(SEPTAL_COLUMNS.start + septum..SEPTAL_COLUMNS.end)
                {
                    part.rays[row * RAY_COLUMNS + column].wall = None;
                }
            }
            septal_overshoot(&part)
        };
        assert_eq!((seen(19, 16), seen(36, 7)), (0.0, 0.0));
        assert!(seen(20, 16) > 0.05 && seen(36, 8) > 0.05);
        let bulged = evidence_of(&bulged);
        assert!(
            (1.08..1.16).contains(&bulged.septal_bulge),
            "{}",
            bulged.septal_bulge
        );
        assert!(
            (0.07..0.16).contains(&bulged.septal_overshoot),
            "{}",
            bulged.septal_overshoot
        );
        // Moved as a whole towards the septum it has no bulge but by the axis.
        let mut aside = cup();
        aside.vertices.iter_mut().for_each(|p| *p -= lateral * 3.0);
        let aside = evidence_of(&aside);
        assert!(
            aside.septal_bulge > 1.15 && aside.septal_overshoot.abs() < 0.02,
            "{aside:?}"
        );
    }

    #[test]
    fn dark_wall_and_bright_neighbours_are_shares_of_the_area() {
        let wall = wall(&cup());
        let uptake = |value: &dyn Fn(&Vec3) -> f64| WallUptake::new(&wall, &image(value)).unwrap();
        let uniform = uptake(&|_| 3.0);
        assert!((uniform.dark, uniform.beside) == (0.0, 1.0));
        let half = uptake(&|p| if p.y > 0.0 { 3.0 } else { 1.0 });
        assert!(
            (half.dark - 0.5).abs() < 0.04 && (half.beside - 0.5).abs() < 0.04,
            "{}",
            half.dark
        );
        // Most of the area lies across the axis, not about the apex.
        let apex = uptake(&|p| if p.z < -55.0 { 1.0 } else { 3.0 });
        assert!((0.02..0.2).contains(&apex.dark), "{}", apex.dark);
        // A neighbour from 12 to 18 mm beyond a wall of 30 mm radius counts, a farther one does not.
        for (from, to, seen) in [(43.0, 47.0, true), (52.0, 60.0, false), (33.0, 38.0, false)] {
            let at = |p: &Vec3| {
                let across = p.x.hypot(p.y);
                if (across / 31.0).hypot(p.z.min(0.0) / 71.0) < 1.0 {
                    3.0
                } else if (from..to).contains(&across) && p.y > 0.0 && p.z > -20.0 {
                    2.5
                } else {
                    0.0
                }
            };
            let found = uptake(&at);
            assert_eq!(found.dark, 0.0);
            assert_eq!(found.beside > 0.05, seen, "{from}: {}", found.beside);
            assert!(found.beside < 0.4);
        }
        assert!(WallUptake::new(&wall, &image(|_| 0.0)).is_some());
    }
}
