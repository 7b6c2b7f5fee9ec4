//! Takes the noise of a scan off its surface.
//!
//! The iso-surface of a noisy volume lies about the surface that the same volume without noise
//! would have. In: the surface of Marching Cubes, an evenly spaced twin of it, and the volume's
//! values. Out: vertices on the same triangles, moved along the normals, and the noise measured.
//!
//! 1. The surface is split into a smooth part and a rest by a low-pass filter of a voxel and a
//!    quarter. The rest is noise, except for what the filter takes off edges and rims: that is
//!    estimated by filtering the smooth part again, and subtracted.
//! 2. Noise ([`SurfaceNoise`]): the level is the median of the rest; the correlation length comes
//!    from how much the rest of neighbouring vertices differs. The noise is that of the intensities:
//!    where the image rises steeply across the surface it moves the surface less.
//! 3. Each vertex is smoothed over a length L of its own. A low-pass filter of length L takes an
//!    error of the order R (L/R)⁴ off a surface with a radius of curvature R, and leaves
//!    σ c / L of noise that moves the surface by σ and is correlated over c. The two are in balance
//!    for L = C R (σ c / R²)^(1/5): the rim of the wall is smoothed over a few millimetres, its flanks
//!    over ten. C was chosen on phantoms.
//! 4. Where the moved surface would intersect itself, as it can at a thin bridge, its vertices go back.
//!
//! The filter is 1 / (1 + (L² Δ)³), where Δ is the cotangent Laplacian (Pinkall & Polthier,
//! Experimental Mathematics 1993) on the evenly spaced twin, applied as a series of Chebyshev
//! polynomials (Mason & Handscomb, 2003). It leaves all but the finest shape as it is: the radius of a
//! sphere changes by a thousandth, L being a fifth of it.
//!
//! Guaranteed: the triangles stay; a surface that does not intersect itself does not do so afterwards; no
//! vertex moves by more than three times the noise there or half a voxel, so that whatever stands out from
//! the noise stays; the same bytes on any number of threads.
//! Not guaranteed: that what is left is the truth. Noise that is correlated over much more than
//! L looks like shape.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Bvh;
use crate::base::numeric::order::upper_median;
use crate::base::progress::{Cancelled, Monitor};
use crate::mesh::intersections::self_intersections_while;
use crate::mesh::{TriMesh, vertex_normals};

/// Length of the filter that separates noise from shape, voxels.
const PROBE_LENGTH_VOXELS: f64 = 1.25;
/// C: smoothing length over that at which error and noise are in balance.
const SMOOTHING_LENGTH_RATIO: f64 = 0.63;
/// The part of the rest that is shape, over what a second pass of the filter takes off. Of noise the second
/// pass takes off a fifth.
const SHAPE_RATIO: f64 = 2.0;
/// Largest width of the correlation over the length of the filter: the filter passes next to nothing of
/// noise that is wider.
const MAX_WIDTH_RATIO: f64 = 1.2;
/// Largest movement of a vertex over the noise there.
const LARGEST_MOVE: f64 = 3.0;
/// Largest cotangent of an angle; larger ones belong to slivers.
const LARGEST_COTANGENT: f64 = 2.0;
/// Smallest cotangent: a negative one could make the filter amplify.
const SMALLEST_COTANGENT: f64 = 0.02;
/// Smallest area of a vertex over the mean.
const SMALLEST_AREA: f64 = 0.7;
/// Smallest steepness of the image over its median; flatter places are not smoothed more.
const SMALLEST_STEEPNESS: f64 = 0.3;
/// Largest eigenvalue over the mean of its bounds at the vertices: the degree of the polynomials depends on
/// the largest. The few vertices beyond are smoothed over a little less than their length.
const LARGEST_RATE: f64 = 2.0;
/// Highest degree of the polynomials.
const MAX_DEGREE: usize = 300;
/// Degree over the square root of the operator's largest eigenvalue: with it the series is exact to a
/// hundredth.
const DEGREE_RATIO: f64 = 5.0;
/// Median of the absolute values of a Gaussian variable over its standard deviation.
const MEDIAN_OF_GAUSSIAN: f64 = 0.674_489_750_196_081_7;
/// Fewest vertices of a surface whose noise can be measured.
const FEWEST_VERTICES: usize = 200;
/// Fewest vertices per parallel task.
const PER_TASK: usize = 512;

/// The noise of a scan where its surface lies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SurfaceNoise {
    /// Standard deviation of the intensities, in the volume's units.
    pub intensity: f64,
    /// Standard deviation of the surface's place, mm: that of the intensities over the steepness
    /// of the image across the surface, the median over all vertices.
    pub offset_mm: f64,
    /// Full width at half maximum of the noise's correlation between places, mm; 0 without noise.
    pub correlation_mm: f64,
    /// Root mean square of the distances by which the vertices were moved, mm.
    pub moved_mm: f64,
}

/// Moves the vertices of `mesh` to where they would be without noise. `even` are the same
/// vertices spread evenly, `intensity` the value of the image at a point, `spacing` the size of a voxel, mm.
/// Returns the noise and, if vertices moved, the search tree over the triangles in their new places. `None`
/// for a surface too small for its noise to be measured.
///
/// # Errors
/// [`Cancelled`].
pub fn denoise(
    mesh: &mut TriMesh,
    even: &[Vec3],
    intensity: impl Fn(&Vec3) -> f64 + Sync,
    spacing: f64,
    monitor: &Monitor,
) -> Result<Option<(SurfaceNoise, Option<Bvh>)>, Cancelled> {
    if mesh.vertices.len() < FEWEST_VERTICES {
        return Ok(None);
    }
    let laplacian = Laplacian::new(even, &mesh.triangles);
    monitor.check()?;
    let probe = PROBE_LENGTH_VOXELS * spacing;
    let uniform = |length: f64| vec![length; even.len()];
    let [smooth, again] = laplacian.filter(&mesh.vertices, &uniform(probe), [1, 2], monitor)?;
    let normals = vertex_normals(&smooth, &mesh.triangles);
    let heights = |of: &[Vec3], over: &[Vec3]| -> Vec<f64> {
        (of.iter().zip(over).zip(&normals))
            .map(|((p, q), n)| (p - q).dot(n))
            .collect()
    };
    monitor.check()?;
    let rest = heights(&mesh.vertices, &smooth);
    let bent = heights(&smooth, &again);

    let steepness = steepness(&smooth, &normals, &intensity, spacing);
    monitor.check()?;
    let typical = upper_median(steepness.iter().copied());
    if !(typical > 0.0) {
        return Ok(None);
    }
    let steepness: Vec<f64> = (steepness.iter())
        .map(|g| g.max(SMALLEST_STEEPNESS * typical))
        .collect();
    let spread = |heights: &[f64]| {
        upper_median(heights.iter().zip(&steepness).map(|(h, g)| h.abs() * g)) / MEDIAN_OF_GAUSSIAN
    };
    let seen = (spread(&rest).powi(2) - (SHAPE_RATIO * spread(&bent)).powi(2)).max(0.0);
    let width = laplacian.width(&rest, &smooth, probe);
    let level = (seen / share_seen(width, probe)).sqrt();
    let mut noise = SurfaceNoise {
        intensity: level,
        offset_mm: level / typical,
        // Of the Gaussian exp(-d²/4w²).
        correlation_mm: 4.0 * 2f64.ln().sqrt() * width,
        moved_mm: 0.0,
    };
    if !(level > 0.0) {
        noise.correlation_mm = 0.0;
        return Ok(Some((noise, None)));
    }

    let wider = noise.correlation_mm / 2.0;
    let (shape, normals) = if wider > probe {
        let [shape] = laplacian.filter(&mesh.vertices, &uniform(wider), [1], monitor)?;
        let normals = vertex_normals(&shape, &mesh.triangles);
        (shape, normals)
    } else {
        (smooth, normals)
    };
    let least = (4.0 * std::f64::consts::PI / mesh.area()).sqrt();
    let curvatures = laplacian.curvatures(&shape, &normals, 0.3 * spacing);
    let lengths: Vec<f64> = (curvatures.iter().zip(&steepness))
        .map(|(k, g)| {
            let radius = 1.0 / k.max(least);
            let error = level / g * noise.correlation_mm / (radius * radius);
            SMOOTHING_LENGTH_RATIO * radius * error.powf(0.2)
        })
        .collect();
    let [smooth] = laplacian.filter(&mesh.vertices, &lengths, [1], monitor)?;
    let original = mesh.vertices.clone();
    for (v, vertex) in mesh.vertices.iter_mut().enumerate() {
        let most = (LARGEST_MOVE * level / steepness[v]).min(0.5 * spacing);
        let by = (smooth[v] - *vertex).dot(&normals[v]).clamp(-most, most);
        *vertex += normals[v] * by;
    }
    let tree = take_back_intersections(mesh, &original, monitor)?;
    let squares: f64 = (mesh.vertices.iter().zip(&original))
        .map(|(moved, from)| (moved - from).norm_squared())
        .sum();
    noise.moved_mm = (squares / mesh.vertices.len() as f64).sqrt();
    Ok(Some((noise, Some(tree))))
}

/// Puts vertices back to their original places wherever triangles intersect that did not. Ends, since each
/// round puts at least one back. Returns the search tree over the triangles.
fn take_back_intersections(
    mesh: &mut TriMesh,
    original: &[Vec3],
    monitor: &Monitor,
) -> Result<Bvh, Cancelled> {
    loop {
        monitor.check()?;
        let mut back = false;
        let tree = Bvh::new_while(&mesh.vertices, &mesh.triangles, || monitor.check())?;
        let pairs = self_intersections_while(mesh, &tree, || monitor.check())?;
        for triangle in pairs.into_iter().flatten() {
            for v in mesh.triangles[triangle.index()] {
                let (vertex, from) = (&mut mesh.vertices[v as usize], original[v as usize]);
                back |= *vertex != from;
                *vertex = from;
            }
        }
        if !back {
            return Ok(tree);
        }
    }
}

/// The fall of the intensity along the normal at every vertex, per mm.
fn steepness(
    vertices: &[Vec3],
    normals: &[Vec3],
    intensity: &(impl Fn(&Vec3) -> f64 + Sync),
    spacing: f64,
) -> Vec<f64> {
    (vertices.par_iter().zip(normals))
        .with_min_len(PER_TASK)
        .map(|(p, n)| {
            let step = n * spacing;
            (intensity(&(p - step)) - intensity(&(p + step))) / (2.0 * spacing)
        })
        .collect()
}

/// The share of the variance of noise, correlated as exp(-d²/4 `width`²), that is left of the rest after
/// what a second pass of the filter takes off is subtracted.
fn share_seen(width: f64, probe: f64) -> f64 {
    // The spectrum is exp(-(width k)²); u = (width k)².
    const SPECTRUM_STEPS: usize = 1000;
    const SPECTRUM_STEP: f64 = 0.01;
    (0..SPECTRUM_STEPS)
        .map(|n| {
            let u = (n as f64 + 0.5) * SPECTRUM_STEP;
            let passed = 1.0 / (1.0 + (u * (probe / width).powi(2)).powi(3));
            let stopped = 1.0 - passed;
            (stopped.powi(2) - (SHAPE_RATIO * passed * stopped).powi(2))
                * (-u).exp()
                * SPECTRUM_STEP
        })
        .sum()
}

/// A vector of single precision, with a fourth number so that it fills a register.
type Lanes = [f32; 4];

/// The addition of a vertex to a step of the recurrence: its own value times `own`, less the weighted sum of its
/// neighbours' times `others`.
#[derive(Clone, Copy)]
struct Step {
    own: f32,
    others: f32,
}

/// The cotangent Laplacian of a closed mesh: at vertex i, Σ_j w_ij (x_i - x_j) / area_i.
struct Laplacian {
    /// Where the neighbours of each vertex begin, and the end of the last.
    first: Vec<usize>,
    /// Each vertex's neighbours and the weights of the edges to them.
    neighbours: Vec<(u32, f32)>,
    /// Sum of the weights at each vertex.
    degree: Vec<f64>,
    /// Area of each vertex, mm².
    area: Vec<f64>,
}

impl Laplacian {
    fn new(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let mut first = vec![0; vertices.len() + 1];
        // In a closed, oriented mesh each neighbour of a vertex follows it in exactly one triangle.
        for &v in triangles.iter().flatten() {
            first[v as usize + 1] += 1;
        }
        for v in 0..vertices.len() {
            first[v + 1] += first[v];
        }
        let mut next = first.clone();
        let mut neighbours = vec![(0, 0f32); 3 * triangles.len()];
        for t in triangles {
            for k in 0..3 {
                let place = &mut next[t[k] as usize];
                neighbours[*place].0 = t[(k + 1) % 3];
                *place += 1;
            }
        }
        let mut area = vec![0.0; vertices.len()];
        for t in triangles {
            let corners = t.map(|v| vertices[v as usize]);
            let doubled = (corners[1] - corners[0])
                .cross(&(corners[2] - corners[0]))
                .norm();
            for k in 0..3 {
                let [a, b] = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
                let along = (a - corners[k]).dot(&(b - corners[k]));
                let cotangent = (along / doubled.max(f64::MIN_POSITIVE))
                    .clamp(SMALLEST_COTANGENT, LARGEST_COTANGENT);
                let [a, b] = [t[(k + 1) % 3], t[(k + 2) % 3]];
                for (from, to) in [(a, b), (b, a)] {
                    let range = first[from as usize]..first[from as usize + 1];
                    let edge = neighbours[range].iter_mut().find(|(n, _)| *n == to);
                    edge.expect("the mesh is closed").1 += cotangent as f32 / 2.0;
                }
                area[t[k] as usize] += doubled / 6.0;
            }
        }
        let mean = area.iter().sum::<f64>() / area.len() as f64;
        for area in &mut area {
            *area = area.max(SMALLEST_AREA * mean);
        }
        let degree = (0..vertices.len())
            .map(|v| {
                let near = neighbours[first[v]..first[v + 1]].iter();
                near.map(|n| f64::from(n.1)).sum()
            })
            .collect();
        Self {
            first,
            neighbours,
            degree,
            area,
        }
    }

    fn around(&self, v: usize) -> &[(u32, f32)] {
        &self.neighbours[self.first[v]..self.first[v + 1]]
    }

    /// Low-pass filters the positions over a length at every vertex, mm, each of `passes` times.
    ///
    /// # Errors
    /// [`Cancelled`].
    fn filter<const N: usize>(
        &self,
        positions: &[Vec3],
        lengths: &[f64],
        passes: [i32; N],
        monitor: &Monitor,
    ) -> Result<[Vec<Vec3>; N], Cancelled> {
        let wanted = |v: usize| lengths[v].powi(2) / self.area[v];
        let sum: f64 = (0..positions.len())
            .map(|v| 2.0 * self.degree[v] * wanted(v))
            .sum();
        let largest = (LARGEST_RATE * sum / positions.len() as f64)
            .min(((MAX_DEGREE - 4) as f64 / DEGREE_RATIO).powi(2));
        let scale: Vec<f64> = (0..positions.len())
            .map(|v| wanted(v).min(largest / (2.0 * self.degree[v])))
            .collect();
        let degree = (DEGREE_RATIO * largest.sqrt()).ceil() as usize + 4;
        let half = largest / 2.0;
        let steps: Vec<Step> = (0..positions.len())
            .map(|v| Step {
                own: (scale[v] * self.degree[v] / half - 1.0) as f32,
                others: (scale[v] / half) as f32,
            })
            .collect();
        // (M / half - 1) x at vertex v, where M is the scaled Laplacian.
        let apply = |x: &[Lanes], v: usize| -> Lanes {
            let mut sum = [0.0; 4];
            for &(u, w) in self.around(v) {
                let other = x[u as usize];
                for k in 0..4 {
                    sum[k] += w * other[k];
                }
            }
            let (Step { own, others }, x) = (steps[v], x[v]);
            std::array::from_fn(|k| own * x[k] - others * sum[k])
        };

        // 1 less the filter is divisible by x, and one x is applied exactly: the series need not be exact
        // where x is small and positions are large. What is left of them then is millimetres, for which
        // single precision is enough.
        let series = passes.map(|passes| {
            let taken = |x: f64| (1.0 - (1.0 + x.powi(3)).powi(-passes)) / x;
            chebyshev(taken, largest, degree)
        });
        let mut before: Vec<Lanes> = (0..positions.len())
            .into_par_iter()
            .with_min_len(PER_TASK)
            .map(|v| {
                let near = self.around(v).iter();
                let sum: Vec3 = near
                    .map(|(u, w)| (positions[v] - positions[*u as usize]) * f64::from(*w))
                    .sum();
                let taken = sum * scale[v];
                [taken.x as f32, taken.y as f32, taken.z as f32, 0.0]
            })
            .collect();
        let mut last: Vec<Lanes> = (0..positions.len())
            .into_par_iter()
            .with_min_len(PER_TASK)
            .map(|v| apply(&before, v))
            .collect();
        let mut sums: Vec<[Lanes; N]> = (before.iter().zip(&last))
            .map(|(zeroth, first)| {
                std::array::from_fn(|n| {
                    let [a, b] = [series[n][0] as f32, series[n][1] as f32];
                    std::array::from_fn(|k| a * zeroth[k] + b * first[k])
                })
            })
            .collect();
        for j in 2..=degree {
            monitor.check()?;
            let factors: [f32; N] = std::array::from_fn(|n| series[n][j] as f32);
            (before.par_iter_mut().zip(&mut sums).enumerate())
                .with_min_len(PER_TASK)
                .for_each(|(v, (before, sums))| {
                    let applied = apply(&last, v);
                    for k in 0..4 {
                        before[k] = 2.0 * applied[k] - before[k];
                    }
                    for (sum, factor) in sums.iter_mut().zip(factors) {
                        for k in 0..4 {
                            sum[k] += factor * before[k];
                        }
                    }
                });
            std::mem::swap(&mut before, &mut last);
        }
        Ok(std::array::from_fn(|n| {
            (positions.iter().zip(&sums))
                .map(|(p, sums)| p - Vec3::from_fn(|r, _| f64::from(sums[n][r])))
                .collect()
        }))
    }

    /// The width w, mm, of the correlation exp(-d²/4w²) of the heights at distance d, from
    /// those of neighbouring vertices: without what a filter of length `probe` has taken off.
    fn width(&self, heights: &[f64], positions: &[Vec3], probe: f64) -> f64 {
        let (mut differences, mut distances) = (0.0, 0.0);
        for v in 0..heights.len() {
            for &(u, _) in self.around(v) {
                differences += (heights[v] - heights[u as usize]).powi(2);
                distances += (positions[v] - positions[u as usize]).norm_squared();
            }
        }
        let mean = heights.iter().map(|h| h * h).sum::<f64>() / heights.len() as f64;
        // 1/w² is the mean square of the wave number, of which the filter leaves that above 1/probe.
        let square = 2.0 * differences / (mean * distances).max(f64::MIN_POSITIVE);
        (square - 1.0 / (probe * probe))
            .max((MAX_WIDTH_RATIO * probe).powi(-2))
            .sqrt()
            .recip()
    }

    /// The largest normal curvature along the edges around each vertex, averaged over neighbours, 1/mm.
    /// Shorter edges count as long as `shortest`, mm.
    fn curvatures(&self, positions: &[Vec3], normals: &[Vec3], shortest: f64) -> Vec<f64> {
        let mut curvatures: Vec<f64> = (0..positions.len())
            .map(|v| {
                let along = |&(u, _): &(u32, f32)| {
                    let u = u as usize;
                    let length = (positions[v] - positions[u]).norm().max(shortest);
                    (normals[v] - normals[u]).norm() / length
                };
                self.around(v).iter().map(along).fold(0.0, f64::max)
            })
            .collect();
        for _ in 0..2 {
            curvatures = (0..positions.len())
                .map(|v| {
                    let near = self.around(v).iter();
                    let sum: f64 = near
                        .map(|(u, w)| curvatures[*u as usize] * f64::from(*w))
                        .sum();
                    f64::midpoint(curvatures[v], sum / self.degree[v])
                })
                .collect();
        }
        curvatures
    }
}

/// The first `degree` + 1 coefficients of the series of Chebyshev polynomials that interpolates `f`
/// on 0..=`largest`.
fn chebyshev(f: impl Fn(f64) -> f64, largest: f64, degree: usize) -> Vec<f64> {
    let count = (degree + 1) as f64;
    let angles: Vec<f64> = (0..=degree)
        .map(|k| (k as f64 + 0.5) * std::f64::consts::PI / count)
        .collect();
    let values: Vec<f64> = (angles.iter())
        .map(|a| f((a.cos() + 1.0) * largest / 2.0))
        .collect();
    (0..=degree)
        .map(|j| {
            let terms = angles.iter().zip(&values);
            let sum: f64 = terms.map(|(a, y)| y * (j as f64 * a).cos()).sum();
            sum * if j == 0 { 1.0 } else { 2.0 } / count
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::intersections::self_intersections;
    use crate::mesh::shapes;
    use crate::surface::smoothing::taubin;

    const RADIUS_MM: f64 = 30.0;
    /// Steepness of the test image, per mm.
    const STEEPNESS_PER_MM: f64 = 5.0;

    /// A sphere whose vertices lie `noise` mm off in the mean, correlated over a few edges.
    fn noisy(noise: f64) -> TriMesh {
        let mut mesh = shapes::icosphere(RADIUS_MM, 5);
        let mut state = 1u64;
        let mut heights: Vec<f64> = (mesh.vertices.iter())
            .map(|_| {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                (state >> 33) as f64 / f64::from(1u32 << 31) - 0.5
            })
            .collect();
        for _ in 0..3 {
            let mut sums = heights.clone();
            for &[a, b, c] in &mesh.triangles {
                for (u, v) in [(a, b), (b, c), (c, a)] {
                    sums[u as usize] += heights[v as usize] / 3.0;
                }
            }
            heights = sums;
        }
        let mean = heights.iter().sum::<f64>() / heights.len() as f64;
        heights.iter_mut().for_each(|h| *h -= mean);
        let square = heights.iter().map(|h| h * h).sum::<f64>() / heights.len() as f64;
        for (v, h) in mesh.vertices.iter_mut().zip(&heights) {
            *v *= 1.0 + noise * h / square.sqrt() / RADIUS_MM;
        }
        mesh
    }

    fn denoised(mesh: &mut TriMesh) -> SurfaceNoise {
        let even = taubin(&mesh.vertices, &mesh.triangles, 15, &Monitor::silent()).unwrap();
        let image = |p: &Vec3| STEEPNESS_PER_MM * (2.0 * RADIUS_MM - p.norm());
        let silent = Monitor::silent();
        denoise(mesh, &even, image, 2.0, &silent)
            .unwrap()
            .unwrap()
            .0
    }

    /// Root mean square of the distances from the sphere.
    fn error(mesh: &TriMesh) -> f64 {
        let square = |v: &Vec3| (v.norm() - RADIUS_MM).powi(2);
        (mesh.vertices.iter().map(square).sum::<f64>() / mesh.vertices.len() as f64).sqrt()
    }

    #[test]
    fn the_noise_is_measured_and_most_of_it_taken_off() {
        for noise in [0.1, 0.4] {
            let mut mesh = noisy(noise);
            let found = denoised(&mut mesh);
            let ratio = found.offset_mm / noise;
            assert!((0.7..1.3).contains(&ratio), "{found:?}");
            let intensity = found.offset_mm * STEEPNESS_PER_MM;
            assert!(
                (found.intensity / intensity - 1.0).abs() < 0.01,
                "{found:?}"
            );
            assert!((2.0..8.0).contains(&found.correlation_mm), "{found:?}");
            assert!(error(&mesh) < 0.4 * noise, "{noise}: {}", error(&mesh));
            let exact = shapes::icosphere(RADIUS_MM, 5).volume();
            // The radius by little more than a thousandth.
            let ratio = mesh.volume() / exact;
            assert!((ratio - 1.0).abs() < 4e-3, "{noise}: {ratio} of the volume");
        }
    }

    #[test]
    fn a_surface_without_noise_stays() {
        let mut mesh = noisy(0.0);
        let found = denoised(&mut mesh);
        assert!(found.offset_mm < 0.01, "{found:?}");
        assert!(error(&mesh) < 0.01);
    }

    /// A papillary muscle or a thin part of the wall: what stands out from the noise stays.
    #[test]
    fn detail_above_the_noise_stays() {
        let mut mesh = noisy(0.1);
        let top = mesh.vertices[0];
        let height = |p: &Vec3| 3.0 * (-(p - top).norm_squared() / 18.0).exp();
        for v in &mut mesh.vertices {
            *v += v.normalize() * height(v);
        }
        let found = denoised(&mut mesh);
        assert!((0.05..0.2).contains(&found.offset_mm), "{found:?}");
        let left = mesh.vertices[0].norm() - RADIUS_MM;
        assert!(left > 2.5, "{left} mm of 3");
    }

    #[test]
    fn only_what_would_intersect_goes_back() {
        let original = noisy(0.0);
        let mut mesh = original.clone();
        // All shrinks a little, and one vertex goes through its neighbours to the other side.
        mesh.vertices.iter_mut().for_each(|v| *v *= 0.99);
        mesh.vertices[0] *= -1.2;
        take_back_intersections(&mut mesh, &original.vertices, &Monitor::silent()).unwrap();
        assert!(self_intersections(&mesh).is_empty());
        assert_eq!(mesh.vertices[0], original.vertices[0]);
        let moved = (mesh.vertices.iter().zip(&original.vertices)).filter(|(a, b)| a != b);
        assert!(moved.count() > original.vertices.len() / 2);
    }

    #[test]
    fn a_few_triangles_have_no_noise() {
        let mut mesh = shapes::icosphere(RADIUS_MM, 1);
        let even = mesh.vertices.clone();
        let silent = Monitor::silent();
        let found = denoise(&mut mesh, &even, |p| -p.norm(), 2.0, &silent).unwrap();
        assert!(found.is_none());
        assert_eq!(mesh.vertices, even);
    }

    #[test]
    fn the_series_is_that_of_the_function() {
        let f = |x: f64| x * x / (1.0 + x.powi(3));
        let largest: f64 = 60.0;
        let degree = (DEGREE_RATIO * largest.sqrt()).ceil() as usize + 4;
        let series = chebyshev(f, largest, degree);
        for x in [0.0, 0.1, 0.9, 2.0, 17.0, 60.0_f64] {
            let angle = (2.0 * x / largest - 1.0).acos();
            let terms = series.iter().enumerate();
            let value: f64 = terms.map(|(j, c)| c * (j as f64 * angle).cos()).sum();
            assert!((value - f(x)).abs() < 0.01, "{x}: {value}, not {}", f(x));
        }
    }
}
