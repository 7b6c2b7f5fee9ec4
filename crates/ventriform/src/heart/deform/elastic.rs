//! The elastic forces that keep the model's shape: springs, torsion, wall thickness.
//!
//! With rest directions d_ij (the posed template's edges), D = Σ |d_ij|² over the edges, and
//! x_ij = x_j - x_i:
//!
//! - springs: k_s / 2 · Σ (|x_ij| - |d_ij|)² / D;
//! - torsion, local: k_t / 4 · Σ_i Σ_j |x_ij - R_i d_ij|² / D, where R_i is the rotation that
//!   maps the edges of node i best from rest to now. It keeps the directions of edges at a
//!   node relative to each other and so resists folding and kinks;
//! - torsion, of the body: k_b / 2 · Σ |x_ij - R d_ij|² / D with one R for all nodes. Undulations
//!   of a thin sheet have little local energy, the less the finer the mesh; the energy of this
//!   term depends on their slope, equally for every mesh;
//! - thickness: k_w / 2 · Σ a_p (|x_p| - l_p)² over pairs of nodes across the wall, a_p being
//!   the share of the model's area that the pair stands for;
//! - support (off): k_p / 2N · Σ (|x_p| - l_p)² over *all* pairs of nodes nearer to each other
//!   than a radius at rest. A node's sensors have the weight 1/N, so k_p is the stiffness of
//!   one spring relative to the sensors of one node. Earlier stable mass-spring models were
//!   stiffened in this way; it is here to show the effect: the number of pairs grows with N²,
//!   the energy with N, and a finer model follows the image less. Scaled by 1/N it does not.
//!
//! Energies are mm²; k_s, k_t, k_b are mm², k_w and k_p are numbers. Because of the division
//! by D and the shares of area, none of the first four depends on the number of nodes. All
//! terms are invariant to translation and rotation, and their forces balance: no net force, no
//! net torque.
//!
//! Every term is written as a spring towards a target vector (projective dynamics): for
//! fixed rotations and unit vectors the energy is quadratic with a constant matrix, and
//! refreshing the targets never raises it.

use nalgebra::Matrix3;

use crate::base::geometry::Vec3;
use crate::base::geometry::rotation::nearest_rotation;
use crate::base::numeric::block_matrix::BlockMatrix;
use crate::heart::model::struts::Strut;
use crate::mesh::TriMesh;

/// Stiffness of each kind of force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stiffness {
    /// k_s, mm². Default 2.5.
    pub spring: f64,
    /// k_t, mm². Default 7.5.
    pub torsion: f64,
    /// k_b, mm². Default 6.
    pub body: f64,
    /// k_w. Default 0.02.
    pub thickness: f64,
    /// k_p. Default 0: no support springs.
    pub support: f64,
    /// Greatest length of a support spring, mm. Default 46, the 14 voxels of the experiment.
    pub support_radius: f64,
    /// Dependence of k_p on the number of nodes. Default [`SupportScaling::Fixed`].
    pub support_scaling: SupportScaling,
}

/// Dependence of a support spring's stiffness on the number of nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SupportScaling {
    /// Every spring has the stiffness k_p.
    Fixed,
    /// k_p · 150/N: equal to [`SupportScaling::Fixed`] at 150 nodes.
    PerNode,
}

/// Nodes at which both scalings agree.
const SUPPORT_NODES: f64 = 150.0;

impl Default for Stiffness {
    fn default() -> Self {
        Self {
            spring: 2.5,
            torsion: 7.5,
            body: 6.0,
            thickness: 0.02,
            support: 0.0,
            support_radius: 46.0,
            support_scaling: SupportScaling::Fixed,
        }
    }
}

impl Stiffness {
    /// The same with every stiffness multiplied by `factor`.
    pub fn times(self, factor: f64) -> Self {
        Self {
            spring: self.spring * factor,
            torsion: self.torsion * factor,
            body: self.body * factor,
            thickness: self.thickness * factor,
            support: self.support * factor,
            ..self
        }
    }
}

/// A spring that is no edge: a strut or a support.
#[derive(Debug, Clone, Copy)]
struct Spring {
    nodes: [u32; 2],
    weight: f64,
    length: f64,
}

/// The rotations of a body's edges from rest to some positions: R_i and R of the energies.
#[derive(Debug, Clone)]
pub struct Turns {
    of_nodes: Vec<Matrix3<f64>>,
    of_body: Matrix3<f64>,
}

/// The elastic body: edges, struts, supports and their rest state.
#[derive(Debug, Clone)]
pub struct Elastic {
    nodes: usize,
    edges: Vec<[u32; 2]>,
    springs: Vec<Spring>,
    directions: Vec<Vec3>,
    stiffness: Stiffness,
    unit: f64,
}

impl Elastic {
    /// A body at rest in `mesh`.
    pub fn new(mesh: &TriMesh, struts: &[Strut], stiffness: Stiffness) -> Self {
        let mut body = Self {
            nodes: mesh.vertices.len(),
            edges: edges(mesh),
            springs: springs(mesh, struts, &stiffness),
            directions: Vec::new(),
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
        for spring in &mut self.springs {
            spring.length = along(spring.nodes).norm();
        }
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
        let springs = self.springs.iter().map(|s| s.nodes);
        self.edges.iter().copied().chain(springs)
    }

    /// The constant matrix of the quadratic form.
    pub fn add_matrix(&self, matrix: &mut BlockMatrix) {
        let k = self.stiffness;
        for [a, b] in &self.edges {
            matrix.add_spring(*a, *b, (k.spring + k.torsion + k.body) * self.unit);
        }
        for Spring { nodes, weight, .. } in &self.springs {
            matrix.add_spring(nodes[0], nodes[1], *weight);
        }
    }

    /// Adds the pull of the targets that belong to `positions`, where the edges are turned by `turns`, to `rhs`.
    pub fn add_targets(&self, positions: &[Vec3], turns: &Turns, rhs: &mut [Vec3]) {
        let k = self.stiffness;
        let (frames, body) = (&turns.of_nodes, &turns.of_body);
        for ([a, b], d) in self.edges.iter().zip(&self.directions) {
            let (i, j) = (*a as usize, *b as usize);
            let along = direction(positions, [*a, *b]);
            let target = (frames[i] + frames[j]) * d * (0.5 * k.torsion)
                + body * d * k.body
                + along * (d.norm() * k.spring);
            rhs[i] -= target * self.unit;
            rhs[j] += target * self.unit;
        }
        for spring in &self.springs {
            let [a, b] = spring.nodes;
            let pull = direction(positions, [a, b]) * (spring.weight * spring.length);
            rhs[a as usize] -= pull;
            rhs[b as usize] += pull;
        }
    }

    /// The elastic energy, mm².
    pub fn energy(&self, positions: &[Vec3]) -> f64 {
        self.energy_of(positions, &self.turns(positions))
    }

    /// The elastic energy at `positions`, where the edges are turned by `turns`, mm².
    pub fn energy_of(&self, positions: &[Vec3], turns: &Turns) -> f64 {
        let k = self.stiffness;
        let (frames, body) = (&turns.of_nodes, &turns.of_body);
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
        for spring in &self.springs {
            let [a, b] = spring.nodes.map(|v| positions[v as usize]);
            energy += 0.5 * spring.weight * ((b - a).norm() - spring.length).powi(2);
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
        self.add_targets(positions, &self.turns(positions), &mut forces);
        let mut between = |[a, b]: [u32; 2], weight: f64| {
            let pull = (positions[b as usize] - positions[a as usize]) * weight;
            forces[a as usize] += pull;
            forces[b as usize] -= pull;
        };
        for edge in &self.edges {
            between(*edge, (k.spring + k.torsion + k.body) * self.unit);
        }
        for spring in &self.springs {
            between(spring.nodes, spring.weight);
        }
        forces
    }

    /// The rotations of the edges from rest to `positions`.
    pub fn turns(&self, positions: &[Vec3]) -> Turns {
        Turns {
            of_nodes: self.frames(positions),
            of_body: self.body_frame(positions),
        }
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
        moments.iter().map(nearest_rotation).collect()
    }

    fn body_frame(&self, positions: &[Vec3]) -> Matrix3<f64> {
        let mut moment = Matrix3::zeros();
        for ([a, b], d) in self.edges.iter().zip(&self.directions) {
            moment += (positions[*b as usize] - positions[*a as usize]) * d.transpose();
        }
        nearest_rotation(&moment)
    }
}

/// The struts and, if they have a stiffness, the support springs; lengths are set later.
fn springs(mesh: &TriMesh, struts: &[Strut], k: &Stiffness) -> Vec<Spring> {
    let strut = |s: &Strut| Spring {
        nodes: s.nodes,
        weight: k.thickness * s.share,
        length: 0.0,
    };
    let mut springs: Vec<Spring> = struts.iter().map(strut).collect();
    if k.support == 0.0 {
        return springs;
    }
    let nodes = mesh.vertices.len();
    let share = k.support / nodes as f64;
    let weight = match k.support_scaling {
        SupportScaling::Fixed => share,
        SupportScaling::PerNode => share * SUPPORT_NODES / nodes as f64,
    };
    for a in 0..nodes {
        let near = |b: &usize| (mesh.vertices[*b] - mesh.vertices[a]).norm() <= k.support_radius;
        springs.extend((a + 1..nodes).filter(near).map(|b| Spring {
            nodes: [a as u32, b as u32],
            weight,
            length: 0.0,
        }));
    }
    springs
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::progress::Monitor;
    use crate::heart::model::struts::struts;
    use crate::mesh::shapes;
    use nalgebra::Rotation3;

    fn cup() -> (TriMesh, Elastic) {
        let mesh = shapes::cup(70.0, 30.0, 12.0, 16);
        let body = Elastic::new(
            &mesh,
            &struts(&mesh, &Monitor::silent()).unwrap(),
            Stiffness::default(),
        );
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
    fn a_moved_and_turned_model_has_no_energy() {
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
    fn fixed_supports_stiffen_a_finer_model_and_scaled_ones_do_not() {
        let energy = |subdivisions, support_scaling| {
            let mesh = shapes::icosphere(30.0, subdivisions);
            let stiffness = Stiffness {
                spring: 0.0,
                torsion: 0.0,
                body: 0.0,
                support: 1.0,
                support_scaling,
                ..Stiffness::default()
            };
            let body = Elastic::new(&mesh, &[], stiffness);
            let stretched: Vec<Vec3> = mesh
                .vertices
                .iter()
                .map(|p| Vec3::new(p.x, p.y, 1.1 * p.z))
                .collect();
            assert!(body.energy(&mesh.vertices) < 1e-20);
            body.energy(&stretched)
        };
        // 162 and 642 nodes: four times as many.
        let growth = |scaling| energy(3, scaling) / energy(2, scaling);
        assert!((3.7..4.3).contains(&growth(SupportScaling::Fixed)));
        assert!((0.93..1.07).contains(&growth(SupportScaling::PerNode)));
    }

    /// A body scaled as a whole: every term follows from the scale alone.
    #[test]
    fn a_scaled_model_has_the_energy_of_its_strain() {
        let (mesh, body) = cup();
        let k = Stiffness::default();
        for scale in [0.8, 1.25] {
            let scaled: Vec<Vec3> = mesh.vertices.iter().map(|p| p * scale).collect();
            let square = (scale - 1.0) * (scale - 1.0);
            let struts: f64 = struts(&mesh, &Monitor::silent())
                .unwrap()
                .iter()
                .map(|s| {
                    let [a, b] = s.nodes.map(|v| mesh.vertices[v as usize]);
                    0.5 * k.thickness * s.share * square * (b - a).norm_squared()
                })
                .sum();
            // Local torsion counts each edge at both of its ends.
            let edges = 0.5 * square * (k.spring + k.torsion + k.body);
            let energy = body.energy(&scaled);
            assert!((energy / (edges + struts) - 1.0).abs() < 1e-9, "{energy}");
            assert!((body.strain(&scaled) / square - 1.0).abs() < 1e-9);
        }
        let turn = Rotation3::from_euler_angles(1.4, 0.3, -0.7);
        let turned: Vec<Vec3> = mesh.vertices.iter().map(|p| turn * p).collect();
        assert!(body.strain(&turned) < 1e-20);
        let mut again = body.clone();
        again.set_rest(&shaken(&mesh.vertices));
        assert!(again.energy(&shaken(&mesh.vertices)) < 1e-20);
    }

    #[test]
    fn times_stiffens_all_but_the_radius() {
        let of = |stiffness: Stiffness| {
            let Stiffness {
                spring,
                torsion,
                body,
                thickness,
                support,
                ..
            } = stiffness;
            [spring, torsion, body, thickness, support]
        };
        let soft = Stiffness {
            support: 0.3,
            ..Stiffness::default()
        };
        let stiff = soft.times(3.0);
        for (soft, stiff) in of(soft).iter().zip(of(stiff)) {
            assert!((stiff / soft - 3.0).abs() < 1e-12);
        }
        assert_eq!(stiff.support_radius, soft.support_radius);
    }
}
