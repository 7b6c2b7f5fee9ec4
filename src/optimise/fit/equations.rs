//! Least squares over the vertices' displacements: normal equations and their solution.
//!
//! Unknowns are one displacement (3 numbers) for each of N vertices. Every term of the fit
//! couples the corners of one triangle only, so the matrix has one 3×3 block on the diagonal
//! for each vertex and one off it for each edge of the mesh; one further row, over all
//! vertices at once, is kept apart as a rank-one update. It is solved by conjugate
//! gradients with the inverted diagonal blocks as preconditioner. All sums run in a fixed
//! order.

use nalgebra::Matrix3;

use crate::geometry::Vec3;
use crate::optimise::connectivity::Connectivity;
use crate::progress::{Cancelled, Monitor};

/// A symmetric positive semidefinite system A x = g over 3-vectors at vertices.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    diagonal: Vec<Matrix3<f64>>,
    /// The blocks (i, j) with i ≠ j, one for each edge; the block (j, i) is its transpose.
    off_diagonal: Vec<(u32, u32, Matrix3<f64>)>,
    right: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    /// The row over all vertices: its coefficients and weight.
    global: Option<(Vec<Vec3>, f64)>,
    /// For every half-edge its edge's place in `off_diagonal`.
    edge_of: Vec<u32>,
}

impl NormalEquations {
    /// The empty system over `connectivity`'s vertices and edges.
    pub fn new(vertices: usize, connectivity: &Connectivity) -> Self {
        let mut edge_of = vec![0; connectivity.halfedges() as usize];
        let mut off_diagonal = Vec::with_capacity(edge_of.len() / 2);
        for h in connectivity.edges() {
            for side in [h, connectivity.twin(h)] {
                edge_of[side as usize] = off_diagonal.len() as u32;
            }
            let ends = (connectivity.origin(h), connectivity.target(h));
            off_diagonal.push((ends.0, ends.1, Matrix3::zeros()));
        }
        Self {
            diagonal: vec![Matrix3::zeros(); vertices],
            off_diagonal,
            right: vec![Vec3::zeros(); vertices],
            global: None,
            triangles: connectivity.triangles().to_vec(),
            edge_of,
        }
    }

    /// Adds weight·(n·Σ bₖ xₖ − r)² over the corners k of triangle `t`: a plane with normal
    /// `n` from which the point with barycentric coordinates `b` is to move by `r`.
    pub fn add_plane(&mut self, t: u32, b: &[f64; 3], n: &Vec3, r: f64, weight: f64) {
        let nn = n * n.transpose() * weight;
        let pull = n * (weight * r);
        self.add_blocks(t, |k, l| nn * (b[k] * b[l]));
        for k in 0..3 {
            self.right[self.triangles[t as usize][k] as usize] += pull * b[k];
        }
    }

    /// Adds weight·Σₖ |P((xₖ − x̄) − rₖ)|² over the corners k of triangle `t`, where x̄ is their
    /// mean and P the `projection`: the shape of the triangle is to change by r.
    pub fn add_shape(&mut self, t: u32, r: &[Vec3; 3], projection: &Matrix3<f64>, weight: f64) {
        let scaled = projection * weight;
        self.add_blocks(t, |k, l| {
            scaled * (if k == l { 2.0 / 3.0 } else { -1.0 / 3.0 })
        });
        let mean = (r[0] + r[1] + r[2]) / 3.0;
        for k in 0..3 {
            self.right[self.triangles[t as usize][k] as usize] += scaled * (r[k] - mean);
        }
    }

    /// Adds weight·|x_v − r|².
    pub fn add_anchor(&mut self, v: u32, r: &Vec3, weight: f64) {
        self.diagonal[v as usize] += Matrix3::identity() * weight;
        self.right[v as usize] += r * weight;
    }

    /// Sets the one row weight·(Σ_v c_v·x_v − r)² that couples all vertices.
    pub fn set_global(&mut self, coefficients: Vec<Vec3>, r: f64, weight: f64) {
        for (right, c) in self.right.iter_mut().zip(&coefficients) {
            *right += c * (r * weight);
        }
        self.global = Some((coefficients, weight));
    }

    fn add_blocks(&mut self, t: u32, block: impl Fn(usize, usize) -> Matrix3<f64>) {
        let triangle = self.triangles[t as usize];
        for k in 0..3 {
            self.diagonal[triangle[k] as usize] += block(k, k);
            // Blocks of a term are symmetric, so (i, j) and (j, i) need not be told apart.
            let edge = self.edge_of[3 * t as usize + k] as usize;
            self.off_diagonal[edge].2 += block(k, (k + 1) % 3);
        }
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
        let inverse: Vec<Matrix3<f64>> = self
            .diagonal
            .iter()
            .map(|d| d.try_inverse().unwrap_or_else(Matrix3::identity))
            .collect();
        let precondition =
            |r: &[Vec3]| -> Vec<Vec3> { inverse.iter().zip(r).map(|(d, r)| d * r).collect() };
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
        let mut y: Vec<Vec3> = self.diagonal.iter().zip(x).map(|(d, x)| d * x).collect();
        for (i, j, block) in &self.off_diagonal {
            y[*i as usize] += block * x[*j as usize];
            y[*j as usize] += block.tr_mul(&x[*i as usize]);
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
        let mut equations = NormalEquations::new(n, &connectivity);
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
                equations.add_plane(t as u32, &b, &normal, r, w);
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
            equations.add_shape(t as u32, &target, &projection, 0.7);
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
        for v in 0..n as u32 {
            let r = Vec3::new(draw(), draw(), draw());
            equations.add_anchor(v, &r, 0.05);
            for c in 0..3 {
                let mut row = vec![0.0; 3 * n];
                row[3 * v as usize + c] = 0.05f64.sqrt();
                rows.push((row, r[c] * 0.05f64.sqrt()));
            }
        }
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
