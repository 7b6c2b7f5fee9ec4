//! Least squares over the vertices' displacements: normal equations and their solution.
//!
//! Unknowns are one displacement (3 numbers) for each of N vertices. Every term of the fit
//! couples the corners of one triangle only, so the matrix has one 3×3 block on the diagonal
//! for each vertex and one off it for each edge of the mesh; one further row, over all
//! vertices at once, is kept apart as a rank-one update. It is solved by conjugate
//! gradients with the inverted diagonal blocks as preconditioner. All sums run in a fixed
//! order, on any number of threads.

use nalgebra::{Matrix3, Vector6};
use rayon::prelude::*;

use crate::geometry::Vec3;
use crate::optimise::connectivity::Connectivity;
use crate::progress::{Cancelled, Monitor};

/// A symmetric 3×3 block: xx, yy, zz, xy, xz, yz.
type Block = Vector6<f64>;

/// Sums of fewer vertices or edges are not worth another thread.
const LEAST_SHARED: usize = 512;

/// What the terms of one triangle add to the system.
#[derive(Debug, Clone, Default)]
pub struct Element {
    /// The block of each corner k with itself.
    corners: [Block; 3],
    /// The block of each corner k with corner k + 1, for one of both orders: blocks of a term
    /// are symmetric.
    edges: [Block; 3],
    right: [Vec3; 3],
}

impl Element {
    /// Adds weight·(n·Σ bₖ xₖ − r)² over the corners k: a plane with normal `n` from which the
    /// point with barycentric coordinates `b` is to move by `r`.
    pub fn add_plane(&mut self, b: &[f64; 3], n: &Vec3, r: f64, weight: f64) {
        let nn = Block::new(
            n.x * n.x,
            n.y * n.y,
            n.z * n.z,
            n.x * n.y,
            n.x * n.z,
            n.y * n.z,
        );
        let pull = n * (weight * r);
        for k in 0..3 {
            self.corners[k] += nn * (weight * b[k] * b[k]);
            self.edges[k] += nn * (weight * b[k] * b[(k + 1) % 3]);
            self.right[k] += pull * b[k];
        }
    }

    /// Adds weight·Σₖ |P((xₖ − x̄) − rₖ)|² over the corners k, where x̄ is their mean and P the
    /// projection onto the plane with unit normal `n`: the triangle's shape is to change by r.
    pub fn add_shape(&mut self, r: &[Vec3; 3], n: &Vec3, weight: f64) {
        let projection = Block::new(
            1.0 - n.x * n.x,
            1.0 - n.y * n.y,
            1.0 - n.z * n.z,
            -n.x * n.y,
            -n.x * n.z,
            -n.y * n.z,
        );
        let mean = (r[0] + r[1] + r[2]) / 3.0;
        for k in 0..3 {
            self.corners[k] += projection * (weight * 2.0 / 3.0);
            self.edges[k] -= projection * (weight / 3.0);
            self.right[k] += times(&projection, &(r[k] - mean)) * weight;
        }
    }
}

fn times(block: &Block, x: &Vec3) -> Vec3 {
    let [xx, yy, zz, xy, xz, yz] = block.data.0[0];
    Vec3::new(
        xx * x.x + xy * x.y + xz * x.z,
        xy * x.x + yy * x.y + yz * x.z,
        xz * x.x + yz * x.y + zz * x.z,
    )
}

/// The inverse; the identity where there is none.
fn inverse(block: &Block) -> Block {
    let [xx, yy, zz, xy, xz, yz] = block.data.0[0];
    let inverted = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz).try_inverse();
    let m = inverted.unwrap_or_else(Matrix3::identity);
    Block::new(
        m.m11,
        m.m22,
        m.m33,
        f64::midpoint(m.m12, m.m21),
        f64::midpoint(m.m13, m.m31),
        f64::midpoint(m.m23, m.m32),
    )
}

/// A symmetric positive semidefinite system A x = g over 3-vectors at vertices.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    diagonal: Vec<Block>,
    /// The blocks (i, j) with i ≠ j, one for each edge, which stand at (j, i) as well.
    off_diagonal: Vec<(u32, u32, Block)>,
    right: Vec<Vec3>,
    /// The row over all vertices: its coefficients and weight.
    global: Option<(Vec<Vec3>, f64)>,
}

impl NormalEquations {
    /// The sum of the `elements` of all triangles, and damping·|x_v|² for every vertex. Each
    /// vertex and edge gathers from the triangles round it in their cyclic order, whichever
    /// thread does so.
    pub fn new(elements: &[Element], connectivity: &Connectivity, damping: f64) -> Self {
        let damping = Block::new(damping, damping, damping, 0.0, 0.0, 0.0);
        let place = |h: u32| (&elements[h as usize / 3], h as usize % 3);
        let gather = |v: u32| {
            let start = (damping, Vec3::zeros());
            connectivity.around(v).fold(start, |(block, right), h| {
                let (element, k) = place(h);
                (block + element.corners[k], right + element.right[k])
            })
        };
        let (diagonal, right) = (0..connectivity.vertices())
            .into_par_iter()
            .with_min_len(LEAST_SHARED)
            .map(gather)
            .unzip();
        let join = |h: u32| {
            let ((here, k), (there, l)) = (place(h), place(connectivity.twin(h)));
            let block = here.edges[k] + there.edges[l];
            (connectivity.origin(h), connectivity.target(h), block)
        };
        let edges: Vec<u32> = connectivity.edges().collect();
        let edges = edges.par_iter().with_min_len(LEAST_SHARED);
        Self {
            diagonal,
            off_diagonal: edges.map(|&h| join(h)).collect(),
            right,
            global: None,
        }
    }

    /// Sets the one row weight·(Σ_v c_v·x_v − r)² that couples all vertices.
    pub fn set_global(&mut self, coefficients: Vec<Vec3>, r: f64, weight: f64) {
        for (right, c) in self.right.iter_mut().zip(&coefficients) {
            *right += c * (r * weight);
        }
        self.global = Some((coefficients, weight));
    }

    /// The solution, to a residual of `tolerance` times the right-hand side's norm (in the
    /// preconditioner's metric), or after `most` steps.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn solve(
        &self,
        tolerance: f64,
        most: usize,
        monitor: &Monitor,
    ) -> Result<Vec<Vec3>, Cancelled> {
        let inverse: Vec<Block> = self.diagonal.iter().map(inverse).collect();
        let precondition = |r: &[Vec3]| products(&inverse, r);
        let mut x = vec![Vec3::zeros(); self.right.len()];
        let mut residual = self.right.clone();
        let mut z = precondition(&residual);
        let mut direction = z.clone();
        let mut rz = dot(&residual, &z);
        let goal = tolerance * tolerance * rz;
        for _ in 0..most {
            monitor.check()?;
            if !(rz > goal) {
                break;
            }
            let image = self.times(&direction);
            let curvature = dot(&direction, &image);
            if !(curvature > 0.0) {
                break;
            }
            let step = rz / curvature;
            for i in 0..x.len() {
                x[i] += direction[i] * step;
                residual[i] -= image[i] * step;
            }
            z = precondition(&residual);
            let following = dot(&residual, &z);
            let ratio = following / rz;
            rz = following;
            for i in 0..x.len() {
                direction[i] = z[i] + direction[i] * ratio;
            }
        }
        Ok(x)
    }

    fn times(&self, x: &[Vec3]) -> Vec<Vec3> {
        let mut y = products(&self.diagonal, x);
        for (i, j, block) in &self.off_diagonal {
            y[*i as usize] += times(block, &x[*j as usize]);
            y[*j as usize] += times(block, &x[*i as usize]);
        }
        if let Some((coefficients, weight)) = &self.global {
            let along = weight * dot(coefficients, x);
            for (y, c) in y.iter_mut().zip(coefficients) {
                *y += c * along;
            }
        }
        y
    }
}

fn products(blocks: &[Block], x: &[Vec3]) -> Vec<Vec3> {
    blocks.iter().zip(x).map(|(b, x)| times(b, x)).collect()
}

fn dot(x: &[Vec3], y: &[Vec3]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x.dot(y)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn the_solution_is_that_of_the_dense_normal_equations() {
        let mesh = shapes::icosphere(10.0, 1);
        let n = mesh.vertices.len();
        let connectivity = Connectivity::new(n, mesh.triangles.clone()).unwrap();
        let mut elements = vec![Element::default(); mesh.triangles.len()];
        let mut rows: Vec<(Vec<f64>, f64)> = Vec::new();
        let mut number = 0.3f64;
        let mut draw = || {
            number = (number * 91.7 + 0.37).fract();
            number - 0.5
        };
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            for _ in 0..2 {
                let b = [0.2 + draw() / 5.0, 0.3, 0.4];
                let normal = Vec3::new(draw(), draw(), draw()).normalize();
                let (r, w) = (draw(), 1.0 + draw());
                elements[t].add_plane(&b, &normal, r, w);
                let mut row = vec![0.0; 3 * n];
                for k in 0..3 {
                    for c in 0..3 {
                        row[3 * triangle[k] as usize + c] += b[k] * normal[c] * w.sqrt();
                    }
                }
                rows.push((row, r * w.sqrt()));
            }
            let normal = mesh.area_normal(t).normalize();
            let projection = Matrix3::identity() - normal * normal.transpose();
            let mut target = [0, 1, 2].map(|_| Vec3::new(draw(), draw(), draw()));
            let mean = (target[0] + target[1] + target[2]) / 3.0;
            target.iter_mut().for_each(|r| *r -= mean);
            elements[t].add_shape(&target, &normal, 0.7);
            for k in 0..3 {
                for c in 0..3 {
                    let mut row = vec![0.0; 3 * n];
                    for l in 0..3 {
                        let share = f64::from(u8::from(k == l)) - 1.0 / 3.0;
                        for e in 0..3 {
                            row[3 * triangle[l] as usize + e] +=
                                share * projection[(c, e)] * 0.7f64.sqrt();
                        }
                    }
                    rows.push((row, (projection * target[k])[c] * 0.7f64.sqrt()));
                }
            }
        }
        for unknown in 0..3 * n {
            let mut row = vec![0.0; 3 * n];
            row[unknown] = 0.05f64.sqrt();
            rows.push((row, 0.0));
        }
        let mut equations = NormalEquations::new(&elements, &connectivity, 0.05);
        let coefficients: Vec<Vec3> = (0..n).map(|_| Vec3::new(draw(), draw(), draw())).collect();
        let row = coefficients
            .iter()
            .flat_map(|c| c.iter().map(|x| x * 0.3f64.sqrt()));
        rows.push((row.collect(), 2.0 * 0.3f64.sqrt()));
        equations.set_global(coefficients, 2.0, 0.3);
        let a = DMatrix::from_row_iterator(
            rows.len(),
            3 * n,
            rows.iter().flat_map(|(row, _)| row.iter().copied()),
        );
        let right = DVector::from_iterator(rows.len(), rows.iter().map(|(_, r)| *r));
        let dense = (a.transpose() * &a)
            .cholesky()
            .unwrap()
            .solve(&(a.transpose() * right));
        let found = equations.solve(1e-12, 1000, &Monitor::silent()).unwrap();
        for v in 0..n {
            for c in 0..3 {
                assert!((found[v][c] - dense[3 * v + c]).abs() < 1e-9);
            }
        }
    }
}
