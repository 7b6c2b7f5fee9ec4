//! Figures of every triangle, edge and vertex of a mesh, whether it is a manifold or not.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::summary::{Histogram, Summary};
use crate::base::geometry::{Vec3, triangle};
use crate::mesh::TriMesh;
use crate::mesh::topology;

/// An undirected edge with the triangles at it: one, two, or more where the mesh is no manifold.
#[derive(Debug, Clone, PartialEq, Eq)]
struct EdgeTriangles {
    vertices: [u32; 2],
    /// For each triangle at the edge: its index, and whether it runs from the lower to the
    /// higher vertex.
    triangles: Vec<(u32, bool)>,
}

fn edges(triangles: &[[u32; 3]]) -> Vec<EdgeTriangles> {
    let mut sides: Vec<([u32; 2], u32, bool)> = Vec::with_capacity(3 * triangles.len());
    for (t, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            sides.push(([a.min(b), a.max(b)], t as u32, a < b));
        }
    }
    sides.sort_unstable();
    sides
        .chunk_by(|x, y| x.0 == y.0)
        .map(|group| EdgeTriangles {
            vertices: group[0].0,
            triangles: group.iter().map(|s| (s.1, s.2)).collect(),
        })
        .collect()
}

/// One entry for each triangle, edge or vertex.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Elements {
    /// Radius ratio 2r/R of every triangle, 1 = equilateral.
    pub radius_ratio: Vec<f64>,
    /// Smallest angle of every triangle, degrees.
    pub min_angle_deg: Vec<f64>,
    /// Largest angle of every triangle, degrees.
    pub max_angle_deg: Vec<f64>,
    /// Area of every triangle, mm².
    pub area_mm2: Vec<f64>,
    /// Length of every edge, mm.
    pub edge_length_mm: Vec<f64>,
    /// Angle between the normals of the two triangles of every edge that has two, degrees;
    /// 0 = flat.
    pub dihedral_deg: Vec<f64>,
    /// Number of edges at every vertex in use.
    pub valence: Vec<f64>,
}

impl Elements {
    /// Measures every element of `mesh`.
    pub fn measure(mesh: &TriMesh) -> Self {
        Self::from_edges(mesh, &edges(&mesh.triangles))
    }

    fn from_edges(mesh: &TriMesh, edges: &[EdgeTriangles]) -> Self {
        let corners: Vec<[Vec3; 3]> = (0..mesh.triangles.len()).map(|t| mesh.corners(t)).collect();
        let normals: Vec<Vec3> = (0..mesh.triangles.len())
            .map(|t| mesh.area_normal(t))
            .collect();
        let angles: Vec<[f64; 3]> = corners.iter().map(angles_deg).collect();
        let length = |e: &EdgeTriangles| {
            let [a, b] = e.vertices.map(|v| mesh.vertices[v as usize]);
            (b - a).norm()
        };
        let dihedral = |e: &EdgeTriangles| match e.triangles[..] {
            [(s, _), (t, _)] => {
                let angle = triangle::angle_between(&normals[s as usize], &normals[t as usize]);
                Some(angle.to_degrees())
            }
            _ => None,
        };
        let mut valence = vec![0.0; mesh.vertices.len()];
        for v in edges.iter().flat_map(|e| e.vertices) {
            valence[v as usize] += 1.0;
        }
        valence.retain(|&v| v > 0.0);
        Self {
            radius_ratio: corners
                .iter()
                .map(|[a, b, c]| triangle::radius_ratio(a, b, c))
                .collect(),
            min_angle_deg: angles.iter().map(|a| a[0].min(a[1]).min(a[2])).collect(),
            max_angle_deg: angles.iter().map(|a| a[0].max(a[1]).max(a[2])).collect(),
            area_mm2: normals.iter().map(|n| n.norm() / 2.0).collect(),
            edge_length_mm: edges.iter().map(length).collect(),
            dihedral_deg: edges.iter().filter_map(dihedral).collect(),
            valence,
        }
    }
}

fn angles_deg([a, b, c]: &[Vec3; 3]) -> [f64; 3] {
    [(a, b, c), (b, c, a), (c, a, b)]
        .map(|(p, q, r)| triangle::angle_between(&(q - p), &(r - p)).to_degrees())
}

/// Counts, topology and size of a mesh.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct MeshFacts {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of edges.
    pub edges: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// Connected components.
    pub components: usize,
    /// Euler characteristic V - E + F: 2 for each component without handles. Only vertices in
    /// use count.
    pub euler_characteristic: i64,
    /// Handles over all components, of a closed manifold.
    pub genus: Option<i64>,
    /// Whether it is a closed, oriented manifold, property by property.
    #[serde(flatten)]
    pub manifold: ManifoldFacts,
    /// Pairs of triangles that meet in more than shared vertices and edges, found exactly.
    pub self_intersections: usize,
    /// Area, mm².
    pub area_mm2: f64,
    /// Enclosed volume, millilitres.
    pub volume_ml: f64,
    /// Smallest coordinates, LPS mm.
    pub min_mm: [f64; 3],
    /// Largest coordinates, LPS mm.
    pub max_mm: [f64; 3],
}

/// The conditions of a closed, oriented manifold that faces outward.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ManifoldFacts {
    /// No edge has a single triangle.
    pub closed: bool,
    /// No edge has more than two triangles.
    pub edge_manifold: bool,
    /// The triangles about every vertex form one cycle, and every edge has two of them.
    pub vertex_manifold: bool,
    /// Neighbouring triangles traverse their common edge in opposite directions, so that their
    /// normals point to the same side.
    pub oriented: bool,
    /// The triangles face outward (the enclosed volume is positive).
    pub outward: bool,
    /// Components with a positive enclosed volume. The others bound cavities of the wall, or face
    /// the wrong way.
    pub outward_components: usize,
    /// The first defect found, in words.
    pub defect: Option<String>,
}

/// Figures of the triangles' shapes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Shape {
    /// Radius ratio 2r/R, 1 = equilateral.
    pub radius_ratio: Summary,
    /// Smallest angle of each triangle, degrees, 60 = equilateral.
    pub min_angle_deg: Summary,
    /// Largest angle of each triangle, degrees.
    pub max_angle_deg: Summary,
    /// Lengths of edges, mm.
    pub edge_length_mm: Summary,
    /// Areas of triangles, mm².
    pub area_mm2: Summary,
    /// Edges at each vertex.
    pub valence: Valence,
}

/// Numbers of edges that meet at a vertex.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Valence {
    /// Number of vertices for each valence.
    #[cfg_attr(feature = "schema", schema(value_type = BTreeMap<String, u64>))]
    pub counts: BTreeMap<u32, usize>,
    /// Share of vertices with six edges, the regular case.
    pub share_6: f64,
    /// Share of vertices with five, six or seven.
    pub share_5_to_7: f64,
}

/// Figures of the mesh's smoothness.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Smoothness {
    /// Angle between the normals of neighbouring triangles, degrees, 0 = flat.
    pub dihedral_deg: Summary,
}

impl Shape {
    /// The summaries of `elements`.
    pub fn from_elements(elements: &Elements) -> Self {
        Self {
            radius_ratio: Summary::from_values(&elements.radius_ratio),
            min_angle_deg: Summary::from_values(&elements.min_angle_deg),
            max_angle_deg: Summary::from_values(&elements.max_angle_deg),
            edge_length_mm: Summary::from_values(&elements.edge_length_mm),
            area_mm2: Summary::from_values(&elements.area_mm2),
            valence: Valence::from_valence(&elements.valence),
        }
    }
}

impl Valence {
    fn from_valence(valence: &[f64]) -> Self {
        let mut counts = BTreeMap::new();
        for &v in valence {
            *counts.entry(v as u32).or_insert(0) += 1;
        }
        let share = |lowest: u32, highest: u32| {
            let within: usize = counts.range(lowest..=highest).map(|(_, c)| c).sum();
            within as f64 / valence.len().max(1) as f64
        };
        Self {
            share_6: share(6, 6),
            share_5_to_7: share(5, 7),
            counts,
        }
    }
}

impl Smoothness {
    /// The summaries of `elements`.
    pub fn from_elements(elements: &Elements) -> Self {
        Self {
            dihedral_deg: Summary::from_values(&elements.dihedral_deg),
        }
    }
}

/// Distributions before and after optimisation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Histograms {
    /// Radius ratios 2r/R.
    pub radius_ratio: Histogram,
    /// Smallest angle of each triangle, degrees.
    pub min_angle_deg: Histogram,
    /// Lengths of edges, mm.
    pub edge_length_mm: Histogram,
    /// Angles between neighbouring triangles' normals, degrees.
    pub dihedral_deg: Histogram,
    /// Edges at each vertex.
    pub valence: Histogram,
}

impl Histograms {
    /// Counts the elements of both meshes over the same bins.
    pub fn new(retiled: &Elements, optimised: &Elements) -> Self {
        let continuous = |pick: fn(&Elements) -> &Vec<f64>| {
            Histogram::continuous(pick(retiled), pick(optimised))
        };
        Self {
            radius_ratio: continuous(|e| &e.radius_ratio),
            min_angle_deg: continuous(|e| &e.min_angle_deg),
            edge_length_mm: continuous(|e| &e.edge_length_mm),
            dihedral_deg: continuous(|e| &e.dihedral_deg),
            valence: Histogram::discrete(&retiled.valence, &optimised.valence),
        }
    }
}

/// Elements and topology of `mesh`, from one list of its edges; `self_intersections` is the number
/// of pairs that [`crate::mesh::intersections`] found.
pub(super) fn facts(mesh: &TriMesh, self_intersections: usize) -> (Elements, MeshFacts) {
    let edges = edges(&mesh.triangles);
    let elements = Elements::from_edges(mesh, &edges);
    let census = topology::check(mesh);
    let used = elements.valence.len();
    let euler = used as i64 - edges.len() as i64 + mesh.triangles.len() as i64;
    let components = topology::components(mesh.vertices.len(), &mesh.triangles);
    let volume = mesh.volume();
    let aabb = crate::base::geometry::bvh::Aabb::around(&mesh.vertices);
    let genus = census.as_ref().ok().map(topology::Census::genus);
    let manifold = ManifoldFacts {
        closed: edges.iter().all(|e| e.triangles.len() >= 2),
        edge_manifold: edges.iter().all(|e| e.triangles.len() <= 2),
        vertex_manifold: edges.iter().all(|e| e.triangles.len() == 2) && fans(mesh, &edges) == used,
        oriented: edges.iter().all(|e| match e.triangles[..] {
            [_] => true,
            [(_, s), (_, t)] => s != t,
            _ => false,
        }),
        outward: volume > 0.0,
        outward_components: outward_components(mesh, &components),
        defect: census.err().map(|d| d.to_string()),
    };
    let facts = MeshFacts {
        vertices: mesh.vertices.len(),
        edges: edges.len(),
        triangles: mesh.triangles.len(),
        components: components.iter().max().map_or(0, |m| *m as usize + 1),
        euler_characteristic: euler,
        genus,
        manifold,
        self_intersections,
        area_mm2: elements.area_mm2.iter().sum(),
        volume_ml: volume / 1000.0,
        min_mm: aabb.min.into(),
        max_mm: aabb.max.into(),
    };
    (elements, facts)
}

/// Number of components that face outward; `component` holds the component of every vertex.
pub(super) fn outward_components(mesh: &TriMesh, component: &[u32]) -> usize {
    let volumes = topology::component_volumes(&mesh.vertices, &mesh.triangles, component);
    volumes.iter().filter(|v| **v > 0.0).count()
}

/// Number of fans over all vertices. A fan is a set of triangle corners at one vertex that are
/// joined through edges with two triangles; a manifold has one for each vertex in use.
fn fans(mesh: &TriMesh, edges: &[EdgeTriangles]) -> usize {
    let corner = |t: u32, v: u32| {
        let place = mesh.triangles[t as usize].iter().position(|&c| c == v);
        3 * t + place.map_or(0, |k| k as u32)
    };
    let joined: Vec<[u32; 3]> = edges
        .iter()
        .filter_map(|e| match e.triangles[..] {
            [(s, _), (t, _)] => Some(e.vertices.map(|v| [corner(s, v), corner(t, v)])),
            _ => None,
        })
        .flatten()
        .map(|[p, q]| [p, q, q])
        .collect();
    let fan = topology::components(3 * mesh.triangles.len(), &joined);
    fan.iter().max().map_or(0, |m| *m as usize + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn a_regular_tetrahedron_is_measured_as_geometry_says() {
        let (elements, facts) = facts(&shapes::tetrahedron(2.0), 0);
        let near = |values: &[f64], count: usize, expected: f64| {
            assert_eq!(values.len(), count);
            assert!(
                values.iter().all(|x| (x - expected).abs() < 1e-9),
                "{values:?}"
            );
        };
        near(&elements.radius_ratio, 4, 1.0);
        near(&elements.min_angle_deg, 4, 60.0);
        near(&elements.max_angle_deg, 4, 60.0);
        near(&elements.area_mm2, 4, 3f64.sqrt());
        near(&elements.edge_length_mm, 6, 2.0);
        // The normals' angle is the supplement of the inner dihedral angle acos(1/3).
        near(&elements.dihedral_deg, 6, (-1f64 / 3.0).acos().to_degrees());
        near(&elements.valence, 4, 3.0);
        assert_eq!((facts.euler_characteristic, facts.genus), (2, Some(0)));
        assert!(
            facts.manifold.closed && facts.manifold.edge_manifold && facts.manifold.vertex_manifold
        );
        assert!(
            facts.manifold.oriented && facts.manifold.outward && facts.manifold.defect.is_none()
        );
    }

    #[test]
    fn facts_agree_with_the_census_on_closed_manifolds() {
        for mesh in [
            shapes::icosphere(20.0, 3),
            shapes::torus(9.0, 3.0, 30, 20),
            shapes::cup(60.0, 30.0, 10.0, 24),
        ] {
            let census = topology::check(&mesh).unwrap();
            let (_, facts) = facts(&mesh, 0);
            assert_eq!(facts.edges, census.edges);
            assert_eq!(facts.components, census.components);
            assert_eq!(facts.euler_characteristic, census.euler_characteristic);
            assert!(
                facts.manifold.closed
                    && facts.manifold.vertex_manifold
                    && facts.manifold.oriented
                    && facts.manifold.outward
            );
        }
    }

    #[test]
    fn each_defect_shows_in_its_own_fact() {
        let sphere = shapes::icosphere(10.0, 1);
        let with = |change: &dyn Fn(&mut TriMesh)| {
            let mut mesh = sphere.clone();
            change(&mut mesh);
            facts(&mesh, 0).1
        };
        let open = with(&|m| {
            m.triangles.pop();
        });
        assert!(
            !open.manifold.closed
                && open.manifold.edge_manifold
                && open.manifold.oriented
                && open.manifold.defect.is_some()
        );
        let doubled = with(&|m| m.triangles.push(m.triangles[0]));
        assert!(doubled.manifold.closed && !doubled.manifold.edge_manifold);
        let turned = with(&|m| m.triangles[0].swap(0, 1));
        assert!(
            turned.manifold.closed && turned.manifold.edge_manifold && !turned.manifold.oriented
        );
        let inward = with(&|m| m.triangles.iter_mut().for_each(|t| t.swap(0, 1)));
        assert!(inward.manifold.closed && inward.manifold.oriented && !inward.manifold.outward);
        assert_eq!(inward.manifold.outward_components, 0);
        // A small sphere far away faces inward: the whole still encloses a positive volume.
        let stray = with(&|m| {
            let n = m.vertices.len() as u32;
            let turned: Vec<_> = m
                .triangles
                .iter()
                .map(|t| [t[1] + n, t[0] + n, t[2] + n])
                .collect();
            let far: Vec<Vec3> = m
                .vertices
                .iter()
                .map(|v| v / 5.0 + Vec3::x() * 40.0)
                .collect();
            m.triangles.extend(turned);
            m.vertices.extend(far);
        });
        assert!(
            stray.manifold.oriented && stray.manifold.outward && stray.manifold.defect.is_none()
        );
        assert_eq!(
            (stray.components, stray.manifold.outward_components),
            (2, 1)
        );
        // Two spheres that share a vertex.
        let pinched = with(&|m| {
            let n = m.vertices.len() as u32;
            let other = m.triangles.clone();
            let join = |v: u32| if v == 0 { 0 } else { v + n - 1 };
            m.triangles.extend(other.iter().map(|t| t.map(join)));
            let copies: Vec<Vec3> = m.vertices[1..].iter().map(|v| v * 2.0).collect();
            m.vertices.extend(copies);
        });
        assert!(
            pinched.manifold.closed
                && pinched.manifold.edge_manifold
                && !pinched.manifold.vertex_manifold
        );
        assert_eq!((pinched.components, pinched.euler_characteristic), (1, 3));
    }
}
