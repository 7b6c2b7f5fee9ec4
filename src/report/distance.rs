//! Two-sided distances between a model and the surface it was made from.
//!
//! Means and percentiles: each side is sampled evenly by area, and for every sample the closest
//! point of the other side is found, as in Metro (Cignoni, Rocchini, Scopigno, Computer Graphics
//! Forum 1998).
//!
//! Samples miss the largest distance. `farthest` therefore computes a lower and an upper bound of
//! it: a point of a triangle is not farther from the other side than the triangle's farthest
//! corner is from any one triangle of the other side, and not farther than the distance of the
//! triangle's centroid plus the point's distance to that centroid. Triangles whose upper bound
//! exceeds the largest distance found are cut in four, until none can exceed it by more than 1 %.
//! Where a mesh is too large for that, samples and some of its vertices give the lower bound, and
//! there is no upper one.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

use super::summary::Summary;
use crate::geometry::bvh::{Bvh, Closest};
use crate::geometry::{Vec3, triangle};
use crate::mesh::TriMesh;
use crate::optimise::Reference;
use crate::progress::{Cancelled, Monitor};

/// Queries between two checks of the cancel token, about 10 ms of work.
const CHUNK: usize = 8192;
/// Largest excess of the true largest distance over the one reported, as a share of the latter.
const TOLERANCE: f64 = 0.01;
/// Upper limit of the queries for a largest distance, in units of the even samples.
const MOST_REFINED: usize = 40;

/// Number of recently closest triangles that are tried before the tree is searched: consecutive
/// vertices of a Marching Cubes surface alternate between the sheets of a wall.
const RECENT: usize = 6;

/// Distances between a model and its surface, and what they enclose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
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
    /// How much more volume the model encloses than the surface, percent.
    pub volume_error_percent: f64,
    /// How much more area the model has than the surface, percent.
    pub area_error_percent: f64,
}

/// Distances of one side's points to the other side.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
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
        let even = Summary::of(&distances(&even_samples(from, samples), tree, monitor)?);
        let budget = MOST_REFINED * samples;
        let (max_mm, max_at_most_mm) = if from.vertices.len() <= budget {
            farthest(from, (to, tree), even.max, budget, monitor)?
        } else {
            let some = distances(&some_vertices(from, samples), tree, monitor)?;
            (Summary::of(&some).max.max(even.max), None)
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
/// `budget` queries would be needed to bring the two within [`TOLERANCE`].
fn farthest(
    from: &TriMesh,
    (to, tree): (&TriMesh, &Bvh),
    found: f64,
    budget: usize,
    monitor: &Monitor,
) -> Result<(f64, Option<f64>), Cancelled> {
    let corners = close_points(&from.vertices, (to, tree), found, monitor)?;
    let distance = |c: &Closest| c.squared_distance.sqrt();
    let mut best = corners.iter().map(distance).fold(found, f64::max);
    let mut spent = corners.len();
    let limit = |best: f64| best * (1.0 + TOLERANCE) + f64::EPSILON;
    let mut cells: Vec<[Vec3; 3]> = (0..from.triangles.len())
        .into_par_iter()
        .with_min_len(256)
        .filter(|&t| bound_by_corners(from, t, &corners, to) > limit(best))
        .flat_map_iter(|t| quarters(&from.corners(t)))
        .collect();
    while !cells.is_empty() {
        spent += cells.len();
        if spent > budget {
            return Ok((best, None));
        }
        let centroids: Vec<Vec3> = cells.iter().map(|[a, b, c]| (a + b + c) / 3.0).collect();
        let closest = closest_points(&centroids, tree, monitor)?;
        best = closest.iter().map(distance).fold(best, f64::max);
        cells = (cells.par_iter().zip(&centroids).zip(&closest))
            .with_min_len(256)
            .filter(|((cell, centroid), closest)| {
                let around = distance(closest) + farthest_corner(cell, |p| (p - *centroid).norm());
                let triangle = to.corners(closest.triangle as usize);
                let to_one = farthest_corner(cell, |p| distance_to(p, &triangle));
                around.min(to_one) > limit(best)
            })
            .flat_map_iter(|((cell, _), _)| quarters(cell))
            .collect();
    }
    Ok((best, Some(best * (1.0 + TOLERANCE))))
}

/// Upper bound of the distance of triangle `t`'s points, from the triangles closest to its
/// corners. The distance to one fixed triangle is convex, so it is largest at a corner.
fn bound_by_corners(from: &TriMesh, t: usize, closest: &[Closest], to: &TriMesh) -> f64 {
    let known = from.triangles[t].map(|v| closest[v as usize]);
    if known.iter().all(|c| c.triangle == known[0].triangle) {
        let squared = known.iter().map(|c| c.squared_distance);
        return squared.fold(0.0, f64::max).sqrt();
    }
    let cell = from.corners(t);
    let bounds = known.iter().map(|c| {
        let triangle = to.corners(c.triangle as usize);
        farthest_corner(&cell, |p| distance_to(p, &triangle))
    });
    bounds.fold(f64::INFINITY, f64::min)
}

fn farthest_corner(cell: &[Vec3; 3], distance: impl Fn(&Vec3) -> f64) -> f64 {
    cell.iter().map(distance).fold(0.0, f64::max)
}

fn distance_to(p: &Vec3, [a, b, c]: &[Vec3; 3]) -> f64 {
    let [u, v, w] = triangle::closest_barycentric(p, a, b, c);
    (a * u + b * v + c * w - p).norm()
}

/// The triangle cut at the middles of its sides.
fn quarters([a, b, c]: &[Vec3; 3]) -> [[Vec3; 3]; 4] {
    let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| (p + q) / 2.0);
    [[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [ab, bc, ca]]
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

/// The results of `look` for the points, some hundreds in one task, in the points' order.
fn in_order(
    points: &[Vec3],
    monitor: &Monitor,
    look: impl Fn(&[Vec3]) -> Vec<Closest> + Sync,
) -> Result<Vec<Closest>, Cancelled> {
    let mut closest = Vec::with_capacity(points.len());
    for block in points.chunks(CHUNK) {
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
    (to, tree): (&TriMesh, &Bvh),
    near: f64,
    monitor: &Monitor,
) -> Result<Vec<Closest>, Cancelled> {
    in_order(points, monitor, |points| {
        let mut recent: VecDeque<u32> = VecDeque::with_capacity(RECENT);
        let find = |p: &Vec3| {
            let known = recent.iter().map(|&t| closest_on(to, t, p));
            let mut known = known.filter(|c| c.squared_distance <= near * near);
            if let Some(found) = known.next() {
                return Some(found);
            }
            let found = tree.closest_from(p, recent.front().copied(), |_| true)?;
            recent.truncate(RECENT - 1);
            recent.push_front(found.triangle);
            Some(found)
        };
        points.iter().filter_map(find).collect()
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
    const STEP: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];
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
            let [u, v] = STEP.map(|s| (0.5 + s * points.len() as f64).fract());
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
        let dense = Summary::of(&dense).max;
        let d = distance(&model, &reference(surface), 2000, &Monitor::silent()).unwrap();
        let (found, at_most) = (d.model_to_surface.max_mm, d.model_to_surface.max_at_most_mm);
        assert!(
            found >= 0.99 * dense && at_most.unwrap() >= dense,
            "{d:?} {dense}"
        );
        assert!((at_most.unwrap() - 1.01 * found).abs() < 1e-9);
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
        let token = crate::progress::CancelToken::new();
        token.cancel();
        let monitor = Monitor::new(&crate::progress::Silent, token);
        let mesh = shapes::icosphere(30.0, 2);
        let result = distance(&mesh, &reference(mesh.clone()), 100, &monitor);
        assert_eq!(result, Err(Cancelled));
    }
}
