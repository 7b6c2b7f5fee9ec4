//! Marching Cubes over labels: the surface between inside and outside voxels.
//!
//! In: [`Labels`] (which voxels are inside), the samples, the iso-value and the frame. Out: a
//! closed, oriented 2-manifold in LPS millimetres, whose Euler characteristic is twice that
//! of the 6-connected object ([`super::table`] explains why). The labels alone decide the
//! triangles; the samples only place the vertices on the grid's edges. Where both agree this
//! is the iso-surface; where a voxel was cut from a neighbouring organ or to repair topology,
//! the vertex stands in the middle of its edge.
//!
//! Lorensen & Cline (1987), organised like Flying Edges (Schroeder, Maynard & Geveci, LDAV
//! 2015): a first pass over rows counts crossed edges and triangles, a prefix sum gives every
//! row its place in the output, a second pass writes. Labels are bits, so that 64 cells are
//! skipped at once. A vertex belongs to the row in which its edge begins; rows are numbered
//! along x-, then y-, then z-edges. Hence vertices are welded by construction and the result
//! does not depend on the number of threads.

use rayon::prelude::*;

use super::table::{CUBE_CASES, Case};
use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::labels::{Labels, following, set_bits};
use crate::mesh::TriMesh;

/// Least distance of a vertex from its edge's ends, in voxels. Keeps triangles from
/// degenerating where samples equal the iso-value; moves no vertex by more.
pub const MIN_END_DISTANCE: f32 = 0.05;

/// The samples that place the vertices.
#[derive(Debug, Clone, Copy)]
pub struct Samples<'a> {
    /// Values, i fastest.
    pub values: &'a [f32],
    /// Number of values along i, j, k.
    pub shape: [usize; 3],
    /// The value beyond the array's border and in place of NaN; below the iso-value.
    pub beyond: f32,
}

/// Beginning of a row's output.
#[derive(Debug, Clone, Copy, Default)]
struct Place {
    /// First vertex on an edge along x, y, z.
    vertices: [u32; 3],
    /// First vertex of the row that follows.
    end: u32,
    /// Whether any cell between this row and its neighbours is crossed.
    active: bool,
}

/// More vertices than 32-bit indices can name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "the surface would have {vertices} vertices; at most {} can be named",
    u32::MAX
)]
pub struct TooManyVertices {
    /// Number of vertices.
    pub vertices: u64,
}

/// Why there is no mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MarchingCubesError {
    /// The caller cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// See [`TooManyVertices`].
    #[error(transparent)]
    TooManyVertices(#[from] TooManyVertices),
}

/// The surface of `labels` at `iso`.
///
/// # Errors
/// [`MarchingCubesError`].
pub fn marching_cubes(
    labels: &Labels,
    samples: &Samples,
    iso: f32,
    frame: &VoxelToPatient,
    monitor: &Monitor,
) -> Result<TriMesh, MarchingCubesError> {
    let cases = &*CUBE_CASES;
    let [rows, planes] = labels.rows();
    // Pass 1: what every row and every slab of cells will write.
    let slabs: Vec<(Vec<RowCount>, usize)> = (0..planes)
        .into_par_iter()
        .map(|k| {
            monitor.check()?;
            Ok(count_slab(labels, k, cases))
        })
        .collect::<Result<_, Cancelled>>()?;
    let total: u64 = slabs
        .iter()
        .flat_map(|(rows, _)| rows)
        .map(|r| r.crossings.iter().map(|&n| u64::from(n)).sum::<u64>())
        .sum();
    if total >= u64::from(u32::MAX) {
        return Err(TooManyVertices { vertices: total }.into());
    }
    let places = places(&slabs, rows);

    // Pass 2: every slab writes into its own piece of the output.
    let triangle_total = slabs.iter().map(|(_, triangles)| triangles).sum();
    let mut vertices = vec![Vec3::zeros(); total as usize];
    let mut triangles = vec![[0u32; 3]; triangle_total];
    let mut pieces = Vec::with_capacity(planes);
    let (mut free_vertices, mut free_triangles) = (&mut vertices[..], &mut triangles[..]);
    for (k, (_, triangle_count)) in slabs.iter().enumerate() {
        let first = places[rows * k].vertices[0];
        let end = places[rows * k + rows - 1].end;
        let (v, rest) = free_vertices.split_at_mut((end - first) as usize);
        free_vertices = rest;
        let (t, rest) = free_triangles.split_at_mut(*triangle_count);
        free_triangles = rest;
        pieces.push((k, v, t));
    }
    let turn = frame.is_left_handed();
    let placement = VertexPlacement::new(labels, samples, iso, frame);
    pieces.into_par_iter().try_for_each(|(k, v, t)| {
        if !v.is_empty() {
            write_vertices(labels, &places[rows * k..], &placement, k, v);
        }
        if !t.is_empty() {
            write_triangles(labels, &places[rows * k..], k, cases, turn, t);
        }
        monitor.check()
    })?;
    Ok(TriMesh {
        vertices,
        triangles,
    })
}

/// Crossed edges that begin in a row, along x, y, z.
#[derive(Debug, Clone, Copy, Default)]
struct RowCount {
    crossings: [u32; 3],
    active: bool,
}

/// Rows of labels at the four corners of a line of cells: (j, k), (j+1, k), (j, k+1),
/// (j+1, k+1). Rows beyond the border are empty.
fn four_rows<'a>(labels: &'a Labels, j: usize, k: usize, empty: &'a [u64]) -> [&'a [u64]; 4] {
    let [rows, planes] = labels.rows();
    let row = |j: usize, k: usize| {
        if j < rows && k < planes {
            labels.row(j, k)
        } else {
            empty
        }
    };
    [row(j, k), row(j + 1, k), row(j, k + 1), row(j + 1, k + 1)]
}

/// The case of the cell at `bit`, from the four rows' words and the same moved by one.
fn case_at(words: &[u64; 4], moved: &[u64; 4], bit: usize) -> usize {
    let mut case = 0;
    for r in 0..4 {
        case |= (words[r] >> bit & 1) << (2 * r) | (moved[r] >> bit & 1) << (2 * r + 1);
    }
    case as usize
}

/// Cells of one word that are crossed: their corners are neither all in nor all out.
fn active_cells(words: &[u64; 4], moved: &[u64; 4]) -> u64 {
    let any = words.iter().chain(moved).fold(0, |a, w| a | w);
    let all = words.iter().chain(moved).fold(u64::MAX, |a, w| a & w);
    any & !all
}

fn count_slab(labels: &Labels, k: usize, cases: &[Case; 256]) -> (Vec<RowCount>, usize) {
    let [rows, _] = labels.rows();
    let empty = vec![0; labels.words()];
    let mut triangles = 0;
    let counts = (0..rows)
        .map(|j| {
            let four = four_rows(labels, j, k, &empty);
            let mut count = RowCount::default();
            if four.iter().all(|row| row.iter().all(|&w| w == 0)) {
                return count;
            }
            for w in 0..labels.words() {
                let words = four.map(|row| row[w]);
                let moved = four.map(|row| following(row, w));
                let active = active_cells(&words, &moved);
                if active == 0 {
                    continue;
                }
                count.active = true;
                let crossed = [
                    words[0] ^ moved[0],
                    words[0] ^ words[1],
                    words[0] ^ words[2],
                ];
                for axis in 0..3 {
                    count.crossings[axis] += crossed[axis].count_ones();
                }
                for bit in set_bits(active) {
                    triangles += usize::from(cases[case_at(&words, &moved, bit)].count);
                }
            }
            count
        })
        .collect();
    (counts, triangles)
}

fn places(slabs: &[(Vec<RowCount>, usize)], rows: usize) -> Vec<Place> {
    let mut places = Vec::with_capacity(slabs.len() * rows);
    let mut next = 0;
    for row in slabs.iter().flat_map(|(rows, _)| rows) {
        let [x, y, z] = row.crossings;
        places.push(Place {
            vertices: [next, next + x, next + x + y],
            end: next + x + y + z,
            active: row.active,
        });
        next += x + y + z;
    }
    places
}

/// Places the vertices on edges that begin in plane `k`; `places` begins with plane k's rows.
fn write_vertices(
    labels: &Labels,
    places: &[Place],
    placement: &VertexPlacement,
    k: usize,
    out: &mut [Vec3],
) {
    let [rows, _] = labels.rows();
    let empty = vec![0; labels.words()];
    let first = places[0].vertices[0];
    for j in (0..rows).filter(|&j| places[j].vertices[0] < places[j].end) {
        let four = four_rows(labels, j, k, &empty);
        for axis in 0..3 {
            let mut at = (places[j].vertices[axis] - first) as usize;
            for w in 0..labels.words() {
                let here = four[0][w];
                let there = match axis {
                    0 => following(four[0], w),
                    1 => four[1][w],
                    _ => four[2][w],
                };
                for bit in set_bits(here ^ there) {
                    let begin = [64 * w + bit, j, k];
                    out[at] = placement.vertex(begin, axis, here >> bit & 1 == 1);
                    at += 1;
                }
            }
        }
    }
}

/// Values that determine a vertex's position on its edge.
struct VertexPlacement<'a> {
    samples: &'a Samples<'a>,
    iso: f32,
    /// Steps along i, j, k and the place of the border's first voxel, mm.
    steps: [Vec3; 3],
    origin: Vec3,
    /// First voxel of the labels' box; the border's first voxel lies one before.
    first: [usize; 3],
}

impl<'a> VertexPlacement<'a> {
    fn new(labels: &Labels, samples: &'a Samples, iso: f32, frame: &VoxelToPatient) -> Self {
        let corner = Vec3::from_fn(|r, _| labels.origin[r] as f64 - 1.0);
        Self {
            samples,
            iso,
            steps: [0, 1, 2].map(|r| frame.linear().column(r).into_owned()),
            origin: frame.to_patient(&corner),
            first: labels.origin,
        }
    }

    /// The vertex on the edge along `axis` that begins at `begin` (border included).
    fn vertex(&self, begin: [usize; 3], axis: usize, begin_is_inside: bool) -> Vec3 {
        let t = f64::from(self.parameter(begin, axis, begin_is_inside));
        let [i, j, k] = begin.map(|x| x as f64);
        let [x, y, z] = &self.steps;
        self.origin + x * i + y * j + z * k + self.steps[axis] * t
    }

    /// Where the surface crosses the edge, 0..1.
    fn parameter(&self, begin: [usize; 3], axis: usize, begin_is_inside: bool) -> f32 {
        let (f0, f1) = self.ends(begin, axis);
        let (inside, outside) = if begin_is_inside { (f0, f1) } else { (f1, f0) };
        if inside >= self.iso && outside < self.iso {
            // In f64: the difference of two large f32 may overflow.
            let f0 = f64::from(f0);
            let t = (f64::from(self.iso) - f0) / (f64::from(f1) - f0);
            // An infinite sample leaves no ratio: take the middle.
            if t.is_finite() {
                return (t as f32).clamp(MIN_END_DISTANCE, 1.0 - MIN_END_DISTANCE);
            }
        }
        0.5
    }

    /// The samples at both ends of an edge.
    fn ends(&self, begin: [usize; 3], axis: usize) -> (f32, f32) {
        let [nx, ny, nz] = self.samples.shape;
        // Before the first sample this wraps round and is out of every range.
        let [i, j, k] = [0, 1, 2].map(|r| (begin[r] + self.first[r]).wrapping_sub(1));
        let mut next = [i, j, k];
        next[axis] = next[axis].wrapping_add(1);
        let value = |[i, j, k]: [usize; 3]| {
            if i < nx && j < ny && k < nz {
                let value = self.samples.values[i + nx * (j + ny * k)];
                if !value.is_nan() {
                    return value;
                }
            }
            self.samples.beyond
        };
        (value([i, j, k]), value(next))
    }
}

/// Running vertex numbers along the four rows of a line of cells.
struct Numbers {
    x: [u32; 4],
    y: [u32; 2],
    z: [u32; 2],
}

/// Writes the triangles of the cells between planes `k` and `k + 1`; `places` begins with
/// plane k's rows.
fn write_triangles(
    labels: &Labels,
    places: &[Place],
    k: usize,
    cases: &[Case; 256],
    turn: bool,
    out: &mut [[u32; 3]],
) {
    let [rows, _] = labels.rows();
    let empty = vec![0; labels.words()];
    let mut written = 0;
    for j in (0..rows).filter(|&j| places[j].active) {
        let four = four_rows(labels, j, k, &empty);
        let place = |j: usize, k: usize| places.get(j + rows * k).copied().unwrap_or_default();
        let four_places = [place(j, 0), place(j + 1, 0), place(j, 1), place(j + 1, 1)];
        let mut numbers = Numbers {
            x: four_places.map(|p| p.vertices[0]),
            y: [four_places[0].vertices[1], four_places[2].vertices[1]],
            z: [four_places[0].vertices[2], four_places[1].vertices[2]],
        };
        for w in 0..labels.words() {
            let words = four.map(|row| row[w]);
            let moved = four.map(|row| following(row, w));
            for bit in set_bits(active_cells(&words, &moved)) {
                let case = case_at(&words, &moved, bit);
                let edges = numbers.advance(case);
                let cell = &cases[case];
                for t in cell.edges[..3 * usize::from(cell.count)].chunks_exact(3) {
                    let [a, b, c] = [t[0], t[1], t[2]].map(|e| edges[usize::from(e)]);
                    out[written] = if turn { [a, c, b] } else { [a, b, c] };
                    written += 1;
                }
            }
        }
    }
}

impl Numbers {
    /// The vertices on the twelve edges of the next crossed cell; the numbers move on past
    /// it. Cells between two crossed ones cross nothing and move nothing.
    fn advance(&mut self, case: usize) -> [u32; 12] {
        let corner = |c: usize| (case >> c & 1) as u32;
        let crossed = |a: usize, b: usize| corner(a) ^ corner(b);
        // Edges along y at i, in planes k and k+1; then the same at i + 1, which come next in
        // the row. Along z in rows j and j+1.
        let (y0, y1) = (crossed(0, 2), crossed(4, 6));
        let (z0, z1) = (crossed(0, 4), crossed(2, 6));
        let [y, z] = [self.y, self.z];
        let edges = [
            self.x[0],
            self.x[1],
            self.x[2],
            self.x[3],
            y[0],
            y[0] + y0,
            y[1],
            y[1] + y1,
            z[0],
            z[0] + z0,
            z[1],
            z[1] + z1,
        ];
        for row in 0..4 {
            self.x[row] += crossed(2 * row, 2 * row + 1);
        }
        self.y = [y[0] + y0, y[1] + y1];
        self.z = [z[0] + z0, z[1] + z1];
        edges
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::random::{Purpose, stream};
    use crate::mesh::topology;
    use nalgebra::Matrix3;
    use rand::RngExt;
    use std::collections::BTreeMap;

    fn mesh_of(
        values: &[f32],
        shape: [usize; 3],
        iso: f32,
        frame: &VoxelToPatient,
    ) -> (Labels, TriMesh) {
        let labels = Labels::threshold(values, shape, [0; 3], shape, iso);
        let low = values.iter().copied().fold(f32::INFINITY, f32::min);
        let high = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let samples = Samples {
            values,
            shape,
            beyond: iso - (high - low).max(1.0),
        };
        let mesh = marching_cubes(&labels, &samples, iso, frame, &Monitor::silent()).unwrap();
        (labels, mesh)
    }

    fn unit(shape: [usize; 3]) -> VoxelToPatient {
        VoxelToPatient::centred(shape, [1.0; 3], Vec3::zeros()).unwrap()
    }

    fn sampled(shape: [usize; 3], f: impl Fn(Vec3) -> f64) -> Vec<f32> {
        let frame = unit(shape);
        let mut values = Vec::new();
        for k in 0..shape[2] {
            for j in 0..shape[1] {
                for i in 0..shape[0] {
                    let p = frame.to_patient(&Vec3::new(i as f64, j as f64, k as f64));
                    values.push(f(p) as f32);
                }
            }
        }
        values
    }

    /// The same surface cell by cell with a map of edges: the oracle.
    fn simple(values: &[f32], shape: [usize; 3], iso: f32, beyond: f32) -> Vec<[Vec3; 3]> {
        let at = |p: [i64; 3]| {
            if (0..3).any(|r| p[r] < 0 || p[r] >= shape[r] as i64) {
                return beyond;
            }
            let p = p.map(|x| x as usize);
            values[p[0] + shape[0] * (p[1] + shape[1] * p[2])]
        };
        let frame = unit(shape);
        let mut triangles = Vec::new();
        let range = |r: usize| -1..shape[r] as i64;
        for k in range(2) {
            for j in range(1) {
                for i in range(0) {
                    let corner = |c: i64| [i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)];
                    let mut vertex = BTreeMap::new();
                    for a in 0..8u8 {
                        for bit in [1, 2, 4] {
                            let b = a | bit;
                            if a == b {
                                continue;
                            }
                            let (p, q) = (corner(i64::from(a)), corner(i64::from(b)));
                            let (f, g) = (at(p), at(q));
                            let t = f64::from(
                                ((iso - f) / (g - f))
                                    .clamp(MIN_END_DISTANCE, 1.0 - MIN_END_DISTANCE),
                            );
                            let [p, q] = [p, q].map(|p| Vec3::from(p.map(|x| x as f64)));
                            let place = frame.to_patient(&(p + (q - p) * t));
                            vertex.insert(super::super::table::edge_between(a, b), place);
                        }
                    }
                    let case = (0..8).fold(0, |c, b| c | usize::from(at(corner(b)) >= iso) << b);
                    let case = &CUBE_CASES[case];
                    for t in case.edges[..3 * usize::from(case.count)].chunks(3) {
                        triangles.push([vertex[&t[0]], vertex[&t[1]], vertex[&t[2]]]);
                    }
                }
            }
        }
        triangles
    }

    #[test]
    fn random_labels_give_closed_manifolds_with_the_digital_euler_characteristic() {
        let mut random = stream(3, Purpose::PhantomNoise);
        for round in 0..10_000 {
            let shape = if round % 100 == 0 {
                [66, 4, 5]
            } else {
                [5, 5, 5]
            };
            let density = 0.1 + 0.08 * f64::from(round % 11);
            let n = shape.iter().product();
            let values: Vec<f32> = (0..n)
                .map(|_| f32::from(u8::from(random.random_bool(density))))
                .collect();
            let (labels, mesh) = mesh_of(&values, shape, 0.5, &unit(shape));
            if labels.count() == 0 {
                assert!(mesh.triangles.is_empty());
                continue;
            }
            let census = topology::check(&mesh).unwrap();
            assert_eq!(
                census.euler_characteristic,
                2 * labels.euler_characteristic(),
                "round {round}"
            );
            assert!(mesh.volume() > 0.0);
        }
    }

    #[test]
    fn rows_of_bits_and_plain_cells_give_the_same_triangles() {
        let mut random = stream(4, Purpose::PhantomNoise);
        for shape in [[3, 3, 3], [64, 7, 5], [130, 4, 6], [62, 5, 5], [1, 1, 1]] {
            let n = shape.iter().product();
            let values: Vec<f32> = (0..n).map(|_| random.random_range(0.0..1.0)).collect();
            let iso = 0.55;
            let (_, mesh) = mesh_of(&values, shape, iso, &unit(shape));
            let low = values.iter().copied().fold(f32::INFINITY, f32::min);
            let high = values.iter().copied().fold(0.0, f32::max);
            let plain = simple(&values, shape, iso, iso - (high - low).max(1.0));
            assert_eq!(mesh.triangles.len(), plain.len());
            for (t, expected) in plain.iter().enumerate() {
                for (p, q) in mesh.corners(t).iter().zip(expected) {
                    assert!((p - q).norm() < 1e-5, "{p} {q}");
                }
            }
        }
    }

    #[test]
    fn sphere_and_torus_converge_with_the_square_of_the_voxel() {
        let error = |n: usize| {
            let radius = 0.35 * n as f64;
            let values = sampled([n; 3], |p| radius - p.norm());
            let (_, mesh) = mesh_of(&values, [n; 3], 0.0, &unit([n; 3]));
            assert_eq!(topology::check(&mesh).unwrap().euler_characteristic, 2);
            let exact = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
            let far = mesh.vertices.iter().map(|v| (v.norm() - radius).abs());
            assert!(far.fold(0.0, f64::max) < 0.06);
            1.0 - mesh.volume() / exact
        };
        let (coarse, fine) = (error(20), error(40));
        assert!(
            coarse > 0.0 && fine > 0.0 && coarse / fine > 3.0,
            "{coarse} {fine}"
        );
        let ring = sampled([48, 48, 20], |p| 5.0 - (p.xy().norm() - 14.0).hypot(p.z));
        let (_, mesh) = mesh_of(&ring, [48, 48, 20], 0.0, &unit([48, 48, 20]));
        assert_eq!(topology::check(&mesh).unwrap().euler_characteristic, 0);
    }

    #[test]
    fn surfaces_face_outward_for_every_handedness_and_are_closed_at_the_border() {
        let values = vec![1.0; 27];
        for signs in 0..8 {
            let sign = |b: i32| if signs >> b & 1 == 1 { -2.0 } else { 2.0 };
            let linear = Matrix3::from_diagonal(&Vec3::new(sign(0), sign(1), sign(2)));
            let frame = VoxelToPatient::new(linear, Vec3::new(5.0, 6.0, 7.0)).unwrap();
            let (_, mesh) = mesh_of(&values, [3; 3], 1.0, &frame);
            assert_eq!(topology::check(&mesh).unwrap().euler_characteristic, 2);
            assert!(mesh.volume() > 64.0);
        }
    }

    #[test]
    fn infinite_and_missing_samples_leave_finite_vertices() {
        let mut values = sampled([9; 3], |p| 3.0 - p.norm());
        values[4 + 9 * (4 + 9 * 4)] = f32::INFINITY;
        values[6 + 9 * (4 + 9 * 4)] = f32::NAN;
        values[7 + 9 * (4 + 9 * 4)] = f32::NEG_INFINITY;
        let labels = Labels::threshold(&values, [9; 3], [0; 3], [9; 3], 0.0);
        let samples = Samples {
            values: &values,
            shape: [9; 3],
            beyond: -3.0,
        };
        let mesh = marching_cubes(&labels, &samples, 0.0, &unit([9; 3]), &Monitor::silent());
        let mesh = mesh.unwrap();
        topology::check(&mesh).unwrap();
        assert!(
            mesh.vertices
                .iter()
                .all(|v| v.iter().all(|x| x.is_finite()))
        );
    }

    #[test]
    fn thread_count_does_not_show() {
        let mut random = stream(5, Purpose::PhantomNoise);
        let values: Vec<f32> = (0..20 * 20 * 20)
            .map(|_| random.random_range(0.0..1.0))
            .collect();
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| mesh_of(&values, [20; 3], 0.6, &unit([20; 3])).1)
        };
        let one = run(1);
        for threads in [2, 3, 8] {
            assert_eq!(run(threads), one);
        }
    }
}
