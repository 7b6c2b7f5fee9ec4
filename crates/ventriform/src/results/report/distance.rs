//! Two-sided distances between a model and the surface it was made from.
//!
//! Means and percentiles: each side is sampled evenly by area, and for every sample the closest
//! point of the other side is found, as in Metro (Cignoni, Rocchini, Scopigno, Computer Graphics
//! Forum 1998).
//!
//! Samples miss the largest distance. `farthest` therefore computes a lower and an upper bound of
//! it: a point of a triangle is not farther from the other side than the triangle's farthest
//! corner is from any one triangle of the other side, and not farther than the distance of any of
//! its corners plus the point's distance to that corner. Triangles whose upper bound exceeds the
//! largest distance found are cut in four, until none can exceed it by more than 1 %. Corners are
//! asked rather than centroids, because neighbouring triangles share them: half as many queries.
//! Where a mesh is too large for that, samples and some of its vertices give the lower bound, and
//! there is no upper one.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, VecDeque};

use super::patches::Patches;
use super::summary::Summary;
use crate::base::geometry::bvh::{Bvh, Closest};
use crate::base::geometry::{Vec3, triangle};
use crate::base::progress::{Cancelled, Monitor};
use crate::mesh::TriMesh;
use crate::surface::optimise::Reference;

/// Queries between two checks of the cancel token, about 10 ms of work.
const QUERIES_PER_CHECK: usize = 8192;
/// Largest excess of the true largest distance over the one reported, as a share of the latter.
const EXCESS_TOLERANCE: f64 = 0.01;
/// Upper limit of the queries for a largest distance, in units of the even samples.
const MOST_REFINED: usize = 40;

/// No point of a triangle is farther from the nearest corner than this share of the longest side: the
/// circumradius of an equilateral triangle, 1/√3.
const CIRCUMRADIUS_SHARE: f64 = 0.577_350_269_189_625_8;

/// Number of recently closest triangles that are tried before the tree is searched: consecutive
/// vertices of a Marching Cubes surface alternate between the sheets of a wall.
const RECENT_TRIANGLES: usize = 6;

/// Distances between a model and its surface, and what they enclose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Distance {
    /// Mean of the two directions' means, mm.
    pub mean_mm: f64,
    /// Root mean square over both directions, mm.
    pub rms_mm: f64,
    /// The larger of the two directions' 95th percentiles, mm.
    pub hd95_mm: f64,
    /// The largest distance of either direction (Hausdorff) that was found, mm: a lower bound.
    pub hausdorff_mm: f64,
    /// Upper bound of the largest distance, mm; absent for very large meshes.
    pub hausdorff_at_most_mm: Option<f64>,
    /// The mean in units of the smallest voxel spacing.
    pub mean_voxels: f64,
    /// The Hausdorff distance in the same unit.
    pub hausdorff_voxels: f64,
    /// The smallest voxel spacing, mm.
    pub voxel_mm: f64,
    /// From points of the model to the surface.
    pub model_to_surface: Direction,
    /// From points of the surface to the model.
    pub surface_to_model: Direction,
    /// Volume enclosed by the model, millilitres.
    pub volume_ml: f64,
    /// Volume enclosed by the surface, millilitres.
    pub surface_volume_ml: f64,
    /// Volume that the model encloses beyond that of the surface, percent of it.
    pub volume_error_percent: f64,
    /// Area of the model beyond that of the surface, percent of it.
    pub area_error_percent: f64,
}

/// Distances of one side's points to the other side.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = DistanceDirection))]
pub struct Direction {
    /// Number of even samples.
    pub samples: usize,
    /// Mean over the even samples, mm.
    pub mean_mm: f64,
    /// Root mean square over the even samples, mm.
    pub rms_mm: f64,
    /// 95th percentile over the even samples, mm.
    pub p95_mm: f64,
    /// Largest distance found at any point, mm.
    pub max_mm: f64,
    /// Upper bound of the largest distance, mm; absent for very large meshes.
    pub max_at_most_mm: Option<f64>,
}

/// Measures `model` against `reference` with `samples` even samples on each side.
///
/// # Errors
/// [`Cancelled`].
pub fn distance(
    model: &TriMesh,
    reference: &Reference,
    samples: usize,
    monitor: &Monitor,
) -> Result<Distance, Cancelled> {
    let surface = &reference.mesh;
    let model_tree = Bvh::new(&model.vertices, &model.triangles);
    let (there, back) = rayon::join(
        || Direction::between(model, surface, &reference.bvh, samples, monitor),
        || Direction::between(surface, model, &model_tree, samples, monitor),
    );
    let (there, back) = (there?, back?);

    let mean_mm = f64::midpoint(there.mean_mm, back.mean_mm);
    let hausdorff_mm = there.max_mm.max(back.max_mm);
    let (volume, surface_volume) = (model.volume(), surface.volume());
    let percent = |ours: f64, theirs: f64| 100.0 * (ours.abs() - theirs.abs()) / theirs.abs();
    Ok(Distance {
        mean_mm,
        rms_mm: f64::midpoint(there.rms_mm.powi(2), back.rms_mm.powi(2)).sqrt(),
        hd95_mm: there.p95_mm.max(back.p95_mm),
        hausdorff_mm,
        hausdorff_at_most_mm: (there.max_at_most_mm.zip(back.max_at_most_mm))
            .map(|(a, b)| a.max(b)),
        mean_voxels: mean_mm / reference.spacing,
        hausdorff_voxels: hausdorff_mm / reference.spacing,
        voxel_mm: reference.spacing,
        model_to_surface: there,
        surface_to_model: back,
        volume_ml: volume / 1000.0,
        surface_volume_ml: surface_volume / 1000.0,
        volume_error_percent: percent(volume, surface_volume),
        area_error_percent: percent(model.area(), surface.area()),
    })
}

impl Direction {
    fn between(
        from: &TriMesh,
        to: &TriMesh,
        tree: &Bvh,
        samples: usize,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let even = Summary::from_values(&distances(&even_samples(from, samples), tree, monitor)?);
        let budget = MOST_REFINED * samples;
        let (max_mm, max_at_most_mm) = if from.vertices.len() <= budget {
            farthest(from, to, tree, even.max, budget, monitor)?
        } else {
            let some = distances(&some_vertices(from, samples), tree, monitor)?;
            (Summary::from_values(&some).max.max(even.max), None)
        };
        Ok(Self {
            samples,
            mean_mm: even.mean,
            rms_mm: even.rms,
            p95_mm: even.p95,
            max_mm,
            max_at_most_mm,
        })
    }
}

/// Lower and upper bound of the largest distance of any point of `from` to `to`. The lower bound
/// is a distance that was found, at least `found`. There is no upper bound where more than
/// `budget` queries would be needed to bring the two within [`EXCESS_TOLERANCE`].
fn farthest(
    from: &TriMesh,
    to: &TriMesh,
    tree: &Bvh,
    found: f64,
    budget: usize,
    monitor: &Monitor,
) -> Result<(f64, Option<f64>), Cancelled> {
    let mut points = from.vertices.clone();
    let mut closest = close_points(&points, to, tree, found, monitor)?;
    let distance = |c: &Closest| c.squared_distance.sqrt();
    let mut best = closest.iter().map(distance).fold(found, f64::max);
    let mut cells = from.triangles.clone();
    let patches = is_fine(from, to).then(|| Patches::new(to));
    loop {
        let limit = best * (1.0 + EXCESS_TOLERANCE) + f64::EPSILON;
        cells = (cells.into_par_iter().with_min_len(256))
            .filter(|cell| {
                let corners = cell.map(|v| points[v as usize]);
                let known = cell.map(|v| closest[v as usize]);
                bound_by_distances(&corners, &known) > limit
                    && !all_near_one_triangle(&corners, &known, to, limit)
                    && !(patches.as_ref())
                        .is_some_and(|patches| patches.cover(&corners, known[0].triangle, limit))
            })
            .collect();
        if cells.is_empty() {
            return Ok((best, Some(best * (1.0 + EXCESS_TOLERANCE))));
        }
        let (quarters, sides) = quarter(&cells, &points);
        cells = quarters;
        if points.len() + sides.len() > budget {
            return Ok((best, None));
        }
        let near = |side: f64| best.min(limit - side * CIRCUMRADIUS_SHARE);
        let new = close_middles(&sides, &closest, to, tree, near, monitor)?;
        best = new.iter().map(distance).fold(best, f64::max);
        points.extend(sides.iter().map(|side| side.middle));
        closest.extend(new);
    }
}

/// Triangles of a surface for one of a model at which few cells of the model are as small as its triangles: then patches
/// decide too little for their time.
const COARSE_MODEL_TRIANGLES: usize = 12;

/// Whether patches of `to` decide about enough cells of `from`.
fn is_fine(from: &TriMesh, to: &TriMesh) -> bool {
    COARSE_MODEL_TRIANGLES * from.triangles.len() >= to.triangles.len()
}

/// A side of cells that are being cut.
struct Side {
    ends: [u32; 2],
    middle: Vec3,
    /// The longest side of the smaller cells at the middle, mm.
    longest: f64,
}

/// The cells, each cut in four at the middles of its sides, which are numbered from the number of `points` on; and
/// these sides, once for the two cells that share one.
fn quarter(cells: &[[u32; 3]], points: &[Vec3]) -> (Vec<[u32; 3]>, Vec<Side>) {
    let mut sides: Vec<Side> = Vec::with_capacity(2 * cells.len());
    let mut known: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    let mut quarters = Vec::with_capacity(4 * cells.len());
    for &cell in cells {
        let longest = longest_side(&cell.map(|v| points[v as usize])) / 2.0;
        let mut middle = |k: usize| {
            let ends = [cell[k], cell[(k + 1) % 3]];
            let side = *known
                .entry([ends[0].min(ends[1]), ends[0].max(ends[1])])
                .or_insert_with(|| {
                    let [a, b] = ends.map(|v| points[v as usize]);
                    sides.push(Side {
                        ends,
                        middle: (a + b) / 2.0,
                        longest,
                    });
                    sides.len() - 1
                });
            sides[side].longest = sides[side].longest.max(longest);
            (points.len() + side) as u32
        };
        let [ab, bc, ca] = [0, 1, 2].map(&mut middle);
        let [a, b, c] = cell;
        quarters.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    (quarters, sides)
}

fn longest_side([a, b, c]: &[Vec3; 3]) -> f64 {
    let squared = [a - b, b - c, c - a].map(|side| side.norm_squared());
    squared.into_iter().fold(0.0, f64::max).sqrt()
}

/// Upper bound of the distance of a cell's points, from those of its corners.
fn bound_by_distances(cell: &[Vec3; 3], closest: &[Closest; 3]) -> f64 {
    let greatest = closest.iter().map(|c| c.squared_distance);
    greatest.fold(0.0, f64::max).sqrt() + longest_side(cell) * CIRCUMRADIUS_SHARE
}

/// Whether no point of a cell is farther than `limit` from one of the triangles closest to its corners. The
/// distance to one fixed triangle is convex, so it is largest at a corner.
fn all_near_one_triangle(
    cell: &[Vec3; 3],
    closest: &[Closest; 3],
    to: &TriMesh,
    limit: f64,
) -> bool {
    closest.iter().any(|one| {
        cell.iter().zip(closest).all(|(corner, own)| {
            let found = if own.triangle == one.triangle {
                *own
            } else {
                closest_on(to, one.triangle, corner)
            };
            found.squared_distance <= limit * limit
        })
    })
}

/// The distance from each point to the closest point of `to`, in the points' order.
fn distances(points: &[Vec3], to: &Bvh, monitor: &Monitor) -> Result<Vec<f64>, Cancelled> {
    let closest = closest_points(points, to, monitor)?;
    Ok(closest.iter().map(|c| c.squared_distance.sqrt()).collect())
}

/// The closest point of `to` for each point, in the points' order; none where `to` is empty.
fn closest_points(points: &[Vec3], to: &Bvh, monitor: &Monitor) -> Result<Vec<Closest>, Cancelled> {
    in_order(points, monitor, |points| {
        // Consecutive points are close together: the last answer is a good start for the next.
        let mut last = None;
        let find = |p: &Vec3| {
            let found = to.closest_from(p, last, |_| true)?;
            last = Some(found.triangle);
            Some(found)
        };
        points.iter().filter_map(find).collect()
    })
}

/// The results of `look` for the points, or what stands for them, some hundreds in one task, in the points' order.
fn in_order<P: Sync>(
    points: &[P],
    monitor: &Monitor,
    look: impl Fn(&[P]) -> Vec<Closest> + Sync,
) -> Result<Vec<Closest>, Cancelled> {
    let mut closest = Vec::with_capacity(points.len());
    for block in points.chunks(QUERIES_PER_CHECK) {
        monitor.check()?;
        let parts: Vec<Vec<Closest>> = block.par_chunks(256).map(&look).collect();
        closest.extend(parts.into_iter().flatten());
    }
    Ok(closest)
}

/// For each point, in order, the closest point of `to`. Where one of the triangles that were
/// closest to the points before is no farther than `near`, the closest point of that triangle
/// instead, which is found much faster.
fn close_points(
    points: &[Vec3],
    to: &TriMesh,
    tree: &Bvh,
    near: f64,
    monitor: &Monitor,
) -> Result<Vec<Closest>, Cancelled> {
    in_order(points, monitor, |points| {
        let mut recent: VecDeque<u32> = VecDeque::with_capacity(RECENT_TRIANGLES);
        let find = |p: &Vec3| {
            let known = recent.iter().map(|&t| closest_on(to, t, p));
            let mut known = known.filter(|c| c.squared_distance <= near * near);
            if let Some(found) = known.next() {
                return Some(found);
            }
            let found = tree.closest_from(p, recent.front().copied(), |_| true)?;
            recent.truncate(RECENT_TRIANGLES - 1);
            recent.push_front(found.triangle);
            Some(found)
        };
        points.iter().filter_map(find).collect()
    })
}

/// For the middle of each side, in order, the closest point of `to`. Where one of the triangles that are closest to
/// the ends is no farther than `near` of the longest side beside it, the closest point of that triangle instead.
fn close_middles(
    sides: &[Side],
    known: &[Closest],
    to: &TriMesh,
    tree: &Bvh,
    near: impl Fn(f64) -> f64 + Sync,
    monitor: &Monitor,
) -> Result<Vec<Closest>, Cancelled> {
    in_order(sides, monitor, |sides| {
        let find = |side: &Side| {
            let near = near(side.longest);
            let [a, b] = side.ends.map(|v| known[v as usize].triangle);
            let mut nearest = closest_on(to, a, &side.middle);
            if a != b && nearest.squared_distance.sqrt() > near {
                let other = closest_on(to, b, &side.middle);
                if other.squared_distance < nearest.squared_distance {
                    nearest = other;
                }
            }
            if nearest.squared_distance.sqrt() <= near {
                return Some(nearest);
            }
            tree.closest_from(&side.middle, Some(nearest.triangle), |_| true)
        };
        sides.iter().filter_map(find).collect()
    })
}

/// The point of triangle `t` closest to `p`.
fn closest_on(mesh: &TriMesh, t: u32, p: &Vec3) -> Closest {
    let [a, b, c] = mesh.corners(t as usize);
    let barycentric = triangle::closest_barycentric(p, &a, &b, &c);
    let [u, v, w] = barycentric;
    let point = a * u + b * v + c * w;
    Closest {
        triangle: t,
        barycentric,
        point,
        squared_distance: (point - p).norm_squared(),
    }
}

/// `count` points spread evenly over the area: one in each of `count` equal shares of it, in
/// the triangles' order, at the places of a two-dimensional Kronecker sequence (Roberts' R2),
/// which is even and needs no random numbers.
fn even_samples(mesh: &TriMesh, count: usize) -> Vec<Vec3> {
    // 1/g and 1/g² for the real root g of x³ = x + 1.
    const R2_SEQUENCE_STEP: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];
    let total = mesh.area();
    if !(total > 0.0) {
        return Vec::new();
    }
    let mut points = Vec::with_capacity(count);
    let mut covered = 0.0;
    for t in 0..mesh.triangles.len() {
        covered += mesh.area_normal(t).norm() / 2.0 / total;
        let [a, b, c] = mesh.corners(t);
        while points.len() < count && (points.len() as f64 + 0.5) / (count as f64) < covered {
            let [u, v] = R2_SEQUENCE_STEP.map(|s| (0.5 + s * points.len() as f64).fract());
            let (u, v) = if u + v > 1.0 {
                (1.0 - u, 1.0 - v)
            } else {
                (u, v)
            };
            points.push(a + (b - a) * u + (c - a) * v);
        }
    }
    points
}

/// Every vertex, or every k-th where there are more than `limit`.
fn some_vertices(mesh: &TriMesh, limit: usize) -> Vec<Vec3> {
    let stride = mesh.vertices.len().div_ceil(limit.max(1)).max(1);
    mesh.vertices.iter().step_by(stride).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use crate::surface::Surface;

    fn reference(mesh: TriMesh) -> Reference {
        Reference::new(&Surface::exact(mesh, 2.0))
    }

    #[test]
    fn concentric_spheres_lie_their_radii_apart() {
        let outer = reference(shapes::icosphere(32.0, 5));
        let inner = shapes::icosphere(30.0, 5);
        let d = distance(&inner, &outer, 3000, &Monitor::silent()).unwrap();
        for found in [d.mean_mm, d.rms_mm, d.hd95_mm, d.hausdorff_mm] {
            assert!((found - 2.0).abs() < 0.02, "{d:?}");
        }
        assert!((d.mean_voxels - d.mean_mm / 2.0).abs() < 1e-12);
        let expected = 100.0 * ((30f64 / 32.0).powi(3) - 1.0);
        assert!((d.volume_error_percent - expected).abs() < 1e-9);
        assert!((d.area_error_percent - 100.0 * ((30f64 / 32.0).powi(2) - 1.0)).abs() < 1e-9);
    }

    #[test]
    fn a_mesh_lies_on_itself() {
        let cup = shapes::cup(80.0, 32.0, 10.0, 30);
        let d = distance(&cup, &reference(cup.clone()), 2000, &Monitor::silent()).unwrap();
        assert!(d.hausdorff_mm < 1e-6);
        assert!(d.hausdorff_at_most_mm.is_some_and(|h| h < 1e-6));
        assert_eq!(d.volume_error_percent, 0.0);
    }

    #[test]
    fn a_spike_shows_in_the_hausdorff_distance_alone() {
        let sphere = shapes::icosphere(30.0, 4);
        let mut spiky = sphere.clone();
        spiky.vertices[0] *= 1.2;
        let d = distance(&spiky, &reference(sphere), 2000, &Monitor::silent()).unwrap();
        assert!((d.hausdorff_mm - 6.0).abs() < 0.1, "{d:?}");
        assert!(d.mean_mm < 0.05 && d.hd95_mm < 0.05);
    }

    #[test]
    fn the_largest_distance_is_enclosed_where_samples_miss_it() {
        let surface = shapes::cup(80.0, 32.0, 10.0, 60);
        let model = shapes::cup(80.0, 32.0, 10.0, 9);
        let tree = Bvh::new(&surface.vertices, &surface.triangles);
        let dense = distances(&even_samples(&model, 300_000), &tree, &Monitor::silent()).unwrap();
        let dense = Summary::from_values(&dense).max;
        let d = distance(&model, &reference(surface), 2000, &Monitor::silent()).unwrap();
        let (found, at_most) = (d.model_to_surface.max_mm, d.model_to_surface.max_at_most_mm);
        assert!(
            found >= 0.99 * dense && at_most.unwrap() >= dense,
            "{d:?} {dense}"
        );
        assert!((at_most.unwrap() - 1.01 * found).abs() < 1e-9);
    }

    #[test]
    fn every_point_of_a_triangle_is_near_a_corner() {
        let corner = |x: f64, y: f64| Vec3::new(x, y, 0.0);
        let mut tightest = f64::INFINITY;
        for k in 0..400 {
            // Slender, obtuse, and nearly equilateral ones.
            let t = f64::from(k);
            let cell = [
                corner(0.0, 0.0),
                corner(1.0, 0.0),
                corner((t * 0.618).fract(), 0.01 + (t * 0.005).fract() * 0.93),
            ];
            let bound = longest_side(&cell) * CIRCUMRADIUS_SHARE;
            for i in 0..=40 {
                for j in 0..=40 - i {
                    let [u, v] = [i, j].map(|x| f64::from(x) / 40.0);
                    let p = cell[0] + (cell[1] - cell[0]) * u + (cell[2] - cell[0]) * v;
                    let nearest = cell.iter().map(|c| (p - c).norm());
                    let nearest = nearest.fold(f64::INFINITY, f64::min);
                    assert!(nearest <= bound + 1e-12, "{cell:?} {p}");
                    tightest = tightest.min(bound - nearest);
                }
            }
        }
        assert!(tightest < 0.05, "{tightest}");
    }

    #[test]
    fn samples_are_even_in_area() {
        let mesh = shapes::cup(80.0, 32.0, 10.0, 30);
        let points = even_samples(&mesh, 5000);
        assert_eq!(points.len(), 5000);
        // The area below every level agrees with the share of points below it.
        for level in [-70.0, -50.0, -25.0, -5.0] {
            let share = points.iter().filter(|p| p.z < level).count() as f64 / 5000.0;
            let area: f64 = (0..mesh.triangles.len())
                .filter(|&t| mesh.corners(t).iter().map(|p| p.z).sum::<f64>() / 3.0 < level)
                .map(|t| mesh.area_normal(t).norm() / 2.0)
                .sum();
            assert!((share - area / mesh.area()).abs() < 0.02, "{level} {share}");
        }
    }

    #[test]
    fn cancelling_ends_it() {
        let token = crate::base::progress::CancelToken::new();
        token.cancel();
        let monitor = Monitor::new(&crate::base::progress::Silent, token);
        let mesh = shapes::icosphere(30.0, 2);
        let result = distance(&mesh, &reference(mesh.clone()), 100, &monitor);
        assert_eq!(result, Err(Cancelled));
    }
}
