//! What keeps the model's shape: springs, torsion, wall thickness.
//!
//! With rest directions d_ij (the posed template's edges), D = Σ |d_ij|² over the edges, and
//! x_ij = x_j - x_i:
//!
//! - springs: k_s / 2 · Σ (|x_ij| - |d_ij|)² / D;
//! - torsion, local: k_t / 4 · Σ_i Σ_j |x_ij - R_i d_ij|² / D, where R_i is the rotation that
//!   takes the edges of node i best from rest to now. It keeps the directions of edges at a
//!   node to each other and so resists folding and kinks;
//! - torsion, of the body: k_b / 2 · Σ |x_ij - R d_ij|² / D with one R for all nodes. A thin
//!   sheet may undulate at hardly any local cost, the less the finer the mesh is; this term
//!   charges undulations by their slope, the same for every mesh;
//! - thickness: k_w / 2 · Σ a_p (|x_p| - l_p)² over pairs of nodes across the wall, a_p being
//!   the share of the model's area that the pair stands for.
//!
//! Energies are mm²; k_s, k_t, k_b are mm², k_w is a number. Because of the division by D
//! and the shares of area, none of them depends on the number of nodes. All terms are blind
//! to translation and rotation, and their forces balance: no net force, no net torque.
//!
//! Every term is written as a spring towards a target vector (projective dynamics): for
//! fixed rotations and unit vectors the energy is quadratic with a constant matrix, and
//! refreshing the targets never raises it.

use nalgebra::Matrix3;

use super::system::BlockMatrix;
use crate::geometry::Vec3;
use crate::mesh::TriMesh;

/// Stiffness of each kind of force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stiffness {
    /// k_s, mm². Default 5.
    pub spring: f64,
    /// k_t, mm². Default 15.
    pub torsion: f64,
    /// k_b, mm². Default 12.
    pub body: f64,
    /// k_w. Default 0.1.
    pub thickness: f64,
}

impl Default for Stiffness {
    fn default() -> Self {
        Self {
            spring: 5.0,
            torsion: 15.0,
            body: 12.0,
            thickness: 0.1,
        }
    }
}

impl Stiffness {
    /// Everything `factor` times as stiff.
    pub fn times(self, factor: f64) -> Self {
        Self {
            spring: self.spring * factor,
            torsion: self.torsion * factor,
            body: self.body * factor,
            thickness: self.thickness * factor,
        }
    }
}

/// A pair of nodes across the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strut {
    /// The nodes.
    pub nodes: [u32; 2],
    /// Share of the model's area that the pair stands for.
    pub share: f64,
}

/// The elastic body: edges, struts and their rest state.
#[derive(Debug, Clone)]
pub struct Elastic {
    nodes: usize,
    edges: Vec<[u32; 2]>,
    struts: Vec<Strut>,
    directions: Vec<Vec3>,
    lengths: Vec<f64>,
    stiffness: Stiffness,
    unit: f64,
}

impl Elastic {
    /// A body at rest in `mesh`.
    pub fn new(mesh: &TriMesh, struts: &[Strut], stiffness: Stiffness) -> Self {
        let mut body = Self {
            nodes: mesh.vertices.len(),
            edges: edges(mesh),
            struts: struts.to_vec(),
            directions: Vec::new(),
            lengths: Vec::new(),
            stiffness,
            unit: 1.0,
        };
        body.set_rest(&mesh.vertices);
        body
    }

    /// Makes `positions` the rest state.
    pub fn set_rest(&mut self, positions: &[Vec3]) {
        let along = |[a, b]: [u32; 2]| positions[b as usize] - positions[a as usize];
        self.directions = self.edges.iter().map(|e| along(*e)).collect();
        self.lengths = self.struts.iter().map(|s| along(s.nodes).norm()).collect();
        self.unit = 1.0
            / self
                .directions
                .iter()
                .map(Vec3::norm_squared)
                .sum::<f64>()
                .max(f64::MIN_POSITIVE);
    }

    /// Every pair of nodes that a force acts between.
    pub fn pairs(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        let struts = self.struts.iter().map(|s| s.nodes);
        self.edges.iter().copied().chain(struts)
    }

    /// The constant matrix of the quadratic form.
    pub fn add_matrix(&self, matrix: &mut BlockMatrix) {
        let k = self.stiffness;
        for [a, b] in &self.edges {
            matrix.add_spring(*a, *b, (k.spring + k.torsion + k.body) * self.unit);
        }
        for strut in &self.struts {
            let [a, b] = strut.nodes;
            matrix.add_spring(a, b, k.thickness * strut.share);
        }
    }

    /// Adds the pull of the targets that belong to `positions` to `rhs`.
    pub fn add_targets(&self, positions: &[Vec3], rhs: &mut [Vec3]) {
        let k = self.stiffness;
        let frames = self.frames(positions);
        let body = self.body_frame(positions);
        for ([a, b], d) in self.edges.iter().zip(&self.directions) {
            let (i, j) = (*a as usize, *b as usize);
            let along = direction(positions, [*a, *b]);
            let target = (frames[i] + frames[j]) * d * (0.5 * k.torsion)
                + body * d * k.body
                + along * (d.norm() * k.spring);
            rhs[i] -= target * self.unit;
            rhs[j] += target * self.unit;
        }
        for (strut, length) in self.struts.iter().zip(&self.lengths) {
            let [a, b] = strut.nodes;
            let pull = direction(positions, [a, b]) * (k.thickness * strut.share * length);
            rhs[a as usize] -= pull;
            rhs[b as usize] += pull;
        }
    }

    /// The energy stored, mm².
    pub fn energy(&self, positions: &[Vec3]) -> f64 {
        let k = self.stiffness;
        let frames = self.frames(positions);
        let body = self.body_frame(positions);
        let mut energy = 0.0;
        for ([a, b], d) in self.edges.iter().zip(&self.directions) {
            let (i, j) = (*a as usize, *b as usize);
            let now = positions[j] - positions[i];
            let local = (now - frames[i] * d).norm_squared() + (now - frames[j] * d).norm_squared();
            energy += self.unit
                * (0.25 * k.torsion * local
                    + 0.5 * k.body * (now - body * d).norm_squared()
                    + 0.5 * k.spring * (now.norm() - d.norm()).powi(2));
        }
        for (strut, length) in self.struts.iter().zip(&self.lengths) {
            let [a, b] = strut.nodes.map(|v| positions[v as usize]);
            energy += 0.5 * k.thickness * strut.share * ((b - a).norm() - length).powi(2);
        }
        energy
    }

    /// Mean squared strain of the edges against directions turned as a whole.
    pub fn strain(&self, positions: &[Vec3]) -> f64 {
        let body = self.body_frame(positions);
        let squared: f64 = self
            .edges
            .iter()
            .zip(&self.directions)
            .map(|([a, b], d)| {
                (positions[*b as usize] - positions[*a as usize] - body * d).norm_squared()
            })
            .sum();
        squared * self.unit
    }

    /// The force on every node: the negative gradient of the energy.
    pub fn forces(&self, positions: &[Vec3]) -> Vec<Vec3> {
        let k = self.stiffness;
        let mut forces = vec![Vec3::zeros(); self.nodes];
        self.add_targets(positions, &mut forces);
        let mut between = |[a, b]: [u32; 2], weight: f64| {
            let pull = (positions[b as usize] - positions[a as usize]) * weight;
            forces[a as usize] += pull;
            forces[b as usize] -= pull;
        };
        for edge in &self.edges {
            between(*edge, (k.spring + k.torsion + k.body) * self.unit);
        }
        for strut in &self.struts {
            between(strut.nodes, k.thickness * strut.share);
        }
        forces
    }

    /// The rotation of every node's edges from rest to now.
    fn frames(&self, positions: &[Vec3]) -> Vec<Matrix3<f64>> {
        let mut moments = vec![Matrix3::zeros(); self.nodes];
        for ([a, b], d) in self.edges.iter().zip(&self.directions) {
            let (i, j) = (*a as usize, *b as usize);
            let moment = (positions[j] - positions[i]) * d.transpose();
            moments[i] += moment;
            moments[j] += moment;
        }
        moments.iter().map(rotation_of).collect()
    }

    fn body_frame(&self, positions: &[Vec3]) -> Matrix3<f64> {
        let mut moment = Matrix3::zeros();
        for ([a, b], d) in self.edges.iter().zip(&self.directions) {
            moment += (positions[*b as usize] - positions[*a as usize]) * d.transpose();
        }
        rotation_of(&moment)
    }
}

/// The rotation nearest to `m` (polar decomposition by SVD; a mirror is turned back).
pub fn rotation_of(m: &Matrix3<f64>) -> Matrix3<f64> {
    let svd = m.svd(true, true);
    let (Some(mut u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Matrix3::identity();
    };
    if (u * v_t).determinant() < 0.0 {
        let smallest = svd.singular_values.imin();
        u.column_mut(smallest).neg_mut();
    }
    u * v_t
}

fn direction(positions: &[Vec3], [a, b]: [u32; 2]) -> Vec3 {
    (positions[b as usize] - positions[a as usize])
        .try_normalize(0.0)
        .unwrap_or_else(Vec3::zeros)
}

/// Every edge once, the lower node first, sorted.
pub fn edges(mesh: &TriMesh) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = mesh
        .triangles
        .iter()
        .flat_map(|t| [0, 1, 2].map(|k| [t[k], t[(k + 1) % 3]]))
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// The share of the mesh's area that belongs to each vertex (a third of its triangles').
pub fn area_shares(mesh: &TriMesh) -> Vec<f64> {
    let mut shares = vec![0.0; mesh.vertices.len()];
    let total = mesh.area() * 6.0;
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let share = mesh.area_normal(t).norm() / total;
        for v in triangle {
            shares[*v as usize] += share;
        }
    }
    shares
}

/// Pairs of nodes across the wall: for every node the one that lies against its inner side,
/// looks the other way, and is nearest (length over squared cosine). Pairs longer than 2.5
/// times the middle one bridge something else than the wall and are left out.
pub fn struts(mesh: &TriMesh) -> Vec<Strut> {
    let normals = mesh.vertex_normals();
    let shares = area_shares(mesh);
    let mut found: Vec<(f64, Strut)> = Vec::new();
    for (i, (p, n)) in mesh.vertices.iter().zip(&normals).enumerate() {
        let opposite = mesh
            .vertices
            .iter()
            .zip(&normals)
            .enumerate()
            .filter_map(|(j, (q, m))| {
                let d = q - p;
                let length = d.norm();
                let cos = -n.dot(&d) / length;
                (n.dot(m) < -0.3 && cos > 0.6).then(|| (length / (cos * cos), length, j))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, length, j)) = opposite {
            let nodes = [i.min(j) as u32, i.max(j) as u32];
            let share = shares[i];
            found.push((length, Strut { nodes, share }));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let limit = found.get(found.len() / 2).map_or(0.0, |f| 2.5 * f.0);
    let mut struts: Vec<Strut> = found
        .into_iter()
        .filter(|f| f.0 <= limit)
        .map(|f| f.1)
        .collect();
    struts.sort_by_key(|s| s.nodes);
    struts.dedup_by(|later, kept| {
        let same = later.nodes == kept.nodes;
        if same {
            kept.share += later.share;
        }
        same
    });
    struts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use nalgebra::Rotation3;

    fn cup() -> (TriMesh, Elastic) {
        let mesh = shapes::cup(70.0, 30.0, 12.0, 16);
        let body = Elastic::new(&mesh, &struts(&mesh), Stiffness::default());
        (mesh, body)
    }

    fn shaken(positions: &[Vec3]) -> Vec<Vec3> {
        positions
            .iter()
            .enumerate()
            .map(|(i, p)| {
                let t = i as f64;
                p + Vec3::new((t * 1.3).sin(), (t * 0.7).cos(), (t * 2.1).sin()) * 2.0
            })
            .collect()
    }

    #[test]
    fn a_moved_and_turned_model_feels_nothing() {
        let (mesh, body) = cup();
        let turn = Rotation3::from_euler_angles(0.4, -2.0, 1.1);
        let moved: Vec<Vec3> = mesh
            .vertices
            .iter()
            .map(|p| turn * p + Vec3::new(30.0, -4.0, 9.0))
            .collect();
        assert!(body.energy(&moved) < 1e-20);
        assert!(body.forces(&moved).iter().all(|f| f.norm() < 1e-12));
    }

    #[test]
    fn forces_balance() {
        let (mesh, body) = cup();
        let x = shaken(&mesh.vertices);
        let forces = body.forces(&x);
        let largest = forces.iter().map(Vec3::norm).fold(0.0, f64::max);
        let force: Vec3 = forces.iter().sum();
        let torque: Vec3 = x.iter().zip(&forces).map(|(x, f)| x.cross(f)).sum();
        assert!(force.norm() < 1e-10 * largest);
        // Struts and springs pull along their own line; R_i are best rotations, so torsion
        // has no torque either.
        assert!(torque.norm() < 1e-8 * largest, "{torque} {largest}");
    }

    #[test]
    fn force_is_the_gradient_of_energy() {
        let (mesh, body) = cup();
        let x = shaken(&mesh.vertices);
        let forces = body.forces(&x);
        for node in [0, 7, 40] {
            for axis in 0..3 {
                let at = |h: f64| {
                    let mut y = x.clone();
                    y[node][axis] += h;
                    body.energy(&y)
                };
                let slope = (at(1e-4) - at(-1e-4)) / 2e-4;
                assert!((slope + forces[node][axis]).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn struts_span_the_wall() {
        let (mesh, _) = cup();
        let struts = struts(&mesh);
        let spanning = struts.iter().map(|s| s.share).sum::<f64>();
        assert!(spanning > 0.6, "{spanning}");
        for s in struts {
            let [a, b] = s.nodes.map(|v| mesh.vertices[v as usize]);
            let length = (a - b).norm();
            assert!((10.0..30.0).contains(&length), "{length}");
        }
    }
}
