//! The normal equations of the fit and their solution.
//!
//! The unknowns are the displacements of the N vertices. Every term of the fit couples only the
//! corners of one triangle, so the matrix has a 3×3 block on the diagonal for each vertex and
//! one off it for each edge of the mesh. One further term, over all vertices at once, is stored
//! separately as a rank-one update. The system is solved by [conjugate
//! gradients](crate::base::numeric::conjugate_gradient) with the inverted diagonal blocks as
//! preconditioner. All sums run in a fixed order, whatever the number of threads.

use nalgebra::{Matrix3, Vector6};
use rayon::prelude::*;

use crate::base::geometry::Vec3;
use crate::base::numeric::conjugate_gradient::{LinearSystem, Tolerance, dot, solve_observed};
use crate::base::progress::{Cancelled, Monitor};
use crate::mesh::half_edges::HalfEdges;
use crate::mesh::{HalfEdgeId, VertexId};

/// A symmetric 3×3 block: xx, yy, zz, xy, xz, yz.
type Block = Vector6<f64>;

/// Fewer vertices or edges than this are not worth another thread.
const MIN_PER_THREAD: usize = 512;

/// The contributions of one triangle's terms to the system.
#[derive(Debug, Clone, Default)]
pub struct Element {
    /// The block of each corner k with itself.
    corners: [Block; 3],
    /// The block of each corner k with corner k + 1; that of the opposite order is the same,
    /// since all blocks are symmetric.
    edges: [Block; 3],
    /// The contribution to the right-hand side at each corner.
    right: [Vec3; 3],
}

impl Element {
    /// Adds weight·(n·Σ bₖ xₖ − r)² over the corners k: the point with barycentric coordinates `b`
    /// should move by `r` along the unit normal `n`.
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

    /// Adds weight·Σₖ |P((xₖ − x̄) − rₖ)|² over the corners k, where x̄ is the mean of the xₖ and P
    /// the projection onto the plane with unit normal `n`: the triangle's shape should change
    /// by r.
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

/// The inverse; the identity for a singular block.
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

/// A symmetric positive semidefinite system over the displacements of all vertices.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    diagonal: Vec<Block>,
    /// The blocks (i, j) with i ≠ j, one for each edge; the same block belongs at (j, i).
    off_diagonal: Vec<(VertexId, VertexId, Block)>,
    right: Vec<Vec3>,
    /// The term over all vertices: its coefficients and weight.
    global: Option<(Vec<Vec3>, f64)>,
}

impl NormalEquations {
    /// The sum of the `elements` of all triangles and of damping·|x_v|² for every vertex. Each
    /// vertex and edge sums the triangles around it in their cyclic order, on any thread.
    pub fn new(elements: &[Element], half_edges: &HalfEdges, damping: f64) -> Self {
        let damping = Block::new(damping, damping, damping, 0.0, 0.0, 0.0);
        let place = |h: HalfEdgeId| (&elements[h.face().index()], h.corner());
        let gather = |v: VertexId| {
            let start = (damping, Vec3::zeros());
            half_edges.around(v).fold(start, |(block, right), h| {
                let (element, k) = place(h);
                (block + element.corners[k], right + element.right[k])
            })
        };
        let (diagonal, right) = (0..half_edges.vertex_count() as u32)
            .into_par_iter()
            .with_min_len(MIN_PER_THREAD)
            .map(|v| gather(VertexId(v)))
            .unzip();
        let join = |h: HalfEdgeId| {
            let ((here, k), (there, l)) = (place(h), place(half_edges.twin(h)));
            let block = here.edges[k] + there.edges[l];
            (half_edges.origin(h), half_edges.target(h), block)
        };
        let edges: Vec<HalfEdgeId> = half_edges.edges().collect();
        let edges = edges.par_iter().with_min_len(MIN_PER_THREAD);
        Self {
            diagonal,
            off_diagonal: edges.map(|&h| join(h)).collect(),
            right,
            global: None,
        }
    }

    /// Sets the one term that couples all vertices, weight·(Σ_v c_v·x_v − r)².
    pub fn set_global(&mut self, coefficients: Vec<Vec3>, r: f64, weight: f64) {
        for (right, c) in self.right.iter_mut().zip(&coefficients) {
            *right += c * (r * weight);
        }
        self.global = Some((coefficients, weight));
    }

    /// The solution, up to a residual of `tolerance` times the right-hand side (in the norm of
    /// the preconditioner) or after `limit` rounds.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn solve(
        &self,
        tolerance: f64,
        limit: usize,
        monitor: &Monitor,
    ) -> Result<Vec<Vec3>, Cancelled> {
        let system = PreconditionedEquations {
            equations: self,
            inverse: self.diagonal.iter().map(inverse).collect(),
        };
        let mut x = vec![Vec3::zeros(); self.right.len()];
        // At x = 0 the residual is the right-hand side.
        let residual = self.right.clone();
        let tolerance = Tolerance::OfFirst(tolerance);
        solve_observed(&system, &mut x, residual, tolerance, limit, || {
            monitor.check()
        })?;
        Ok(x)
    }
}

/// Normal equations with their inverted diagonal blocks.
struct PreconditionedEquations<'a> {
    equations: &'a NormalEquations,
    inverse: Vec<Block>,
}

impl LinearSystem for PreconditionedEquations<'_> {
    fn multiply(&self, x: &[Vec3], y: &mut [Vec3]) {
        let equations = self.equations;
        multiply_blocks(&equations.diagonal, x, y);
        for (i, j, block) in &equations.off_diagonal {
            y[i.index()] += times(block, &x[j.index()]);
            y[j.index()] += times(block, &x[i.index()]);
        }
        if let Some((coefficients, weight)) = &equations.global {
            let along = weight * dot(coefficients, x);
            for (y, c) in y.iter_mut().zip(coefficients) {
                *y += c * along;
            }
        }
    }

    fn precondition(&self, r: &[Vec3], z: &mut [Vec3]) {
        multiply_blocks(&self.inverse, r, z);
    }
}

fn multiply_blocks(blocks: &[Block], x: &[Vec3], y: &mut [Vec3]) {
    for ((y, block), x) in y.iter_mut().zip(blocks).zip(x) {
        *y = times(block, x);
    }
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
        let half_edges = HalfEdges::new(n, mesh.triangles.clone()).unwrap();
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
        let mut equations = NormalEquations::new(&elements, &half_edges, 0.05);
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
