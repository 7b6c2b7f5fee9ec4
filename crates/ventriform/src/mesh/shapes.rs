//! Closed meshes with known areas, volumes and topology: spheres, tori and ventricle-like cups.
//!
//! All are centred at or rotationally symmetric about the origin's z axis, in millimetres, with
//! triangles that face outward.

use std::f64::consts::TAU;

use super::TriMesh;
use super::subdivide::Subdivided;
use crate::base::geometry::Vec3;

/// A regular tetrahedron of edge length `edge` mm about the origin.
pub fn tetrahedron(edge: f64) -> TriMesh {
    let s = edge / 8f64.sqrt();
    TriMesh {
        vertices: [
            [1.0, 1.0, 1.0],
            [1.0, -1.0, -1.0],
            [-1.0, 1.0, -1.0],
            [-1.0, -1.0, 1.0],
        ]
        .map(|p| Vec3::from(p) * s)
        .to_vec(),
        triangles: vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]],
    }
}

/// A sphere about the origin: an icosahedron whose triangles are split in four `subdivisions`
/// times, with all vertices on the sphere. It has 10·4^s + 2 vertices.
pub fn icosphere(radius: f64, subdivisions: u32) -> TriMesh {
    let mut sphere = Subdivided::not_yet(icosahedron());
    for _ in 0..subdivisions {
        let before = sphere.mesh.vertices.len();
        sphere = sphere.once_more();
        for middle in &mut sphere.mesh.vertices[before..] {
            *middle = middle.normalize();
        }
    }
    let TriMesh {
        mut vertices,
        triangles,
    } = sphere.mesh;
    for v in &mut vertices {
        *v *= radius;
    }
    TriMesh {
        vertices,
        triangles,
    }
}

/// The icosahedron with its vertices on the unit sphere.
fn icosahedron() -> TriMesh {
    let g = f64::midpoint(1.0, 5f64.sqrt());
    let vertices = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ]
    .map(|p| Vec3::from(p).normalize())
    .to_vec();
    let triangles = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    TriMesh {
        vertices,
        triangles,
    }
}

/// A torus about the z axis, made of `around` × `across` quadrilaterals: `major` is the distance
/// from the axis to the tube's centre, `minor` the tube's radius, both in mm.
pub fn torus(major: f64, minor: f64, around: u32, across: u32) -> TriMesh {
    let mut mesh = TriMesh::default();
    for i in 0..around {
        for j in 0..across {
            let u = TAU * f64::from(i) / f64::from(around);
            let v = TAU * f64::from(j) / f64::from(across);
            let r = major + minor * v.cos();
            mesh.vertices
                .push(Vec3::new(r * u.cos(), r * u.sin(), minor * v.sin()));
            let id = |i: u32, j: u32| (i % around) * across + j % across;
            let [p, q, r, s] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            mesh.triangles.extend([[p, q, r], [p, r, s]]);
        }
    }
    mesh
}

/// A cup shaped like the ventricle's wall, of genus 0: half an ellipsoid of semi-axis `length`
/// (apex at -z) and equatorial `radius`, with a wall of `wall` mm that ends in a rounded rim at
/// z = 0. It has `around` meridians; the distance between its rows matches.
pub fn cup(length: f64, radius: f64, wall: f64, around: u32) -> TriMesh {
    use std::f64::consts::{FRAC_PI_2, PI};
    let step = TAU * radius / f64::from(around);
    let rows = ((FRAC_PI_2 * length.max(radius)) / step).ceil().max(3.0) as u32;
    let rim = ((PI * wall / 2.0) / step).ceil().max(2.0) as u32;
    // The profile runs from the outer apex up, over the rim, down to the inner apex.
    let mut profile = Vec::new();
    for i in 1..=rows {
        let a = FRAC_PI_2 * f64::from(i) / f64::from(rows);
        profile.push((radius * a.sin(), -length * a.cos()));
    }
    for i in 1..rim {
        let a = PI * f64::from(i) / f64::from(rim);
        let half = wall / 2.0;
        profile.push((radius - half + half * a.cos(), half * a.sin()));
    }
    for i in (1..=rows).rev() {
        let a = FRAC_PI_2 * f64::from(i) / f64::from(rows);
        profile.push(((radius - wall) * a.sin(), -(length - wall) * a.cos()));
    }
    let mut mesh = TriMesh::default();
    mesh.vertices.push(Vec3::new(0.0, 0.0, -length));
    for (row, (r, z)) in profile.iter().enumerate() {
        for i in 0..around {
            let u = TAU * (f64::from(i) + 0.5 * (row % 2) as f64) / f64::from(around);
            mesh.vertices.push(Vec3::new(r * u.cos(), r * u.sin(), *z));
        }
    }
    let last = mesh.vertices.len() as u32;
    mesh.vertices.push(Vec3::new(0.0, 0.0, wall - length));
    let id = |row: u32, i: u32| 1 + row * around + i % around;
    let height = profile.len() as u32;
    for i in 0..around {
        mesh.triangles.push([0, id(0, i + 1), id(0, i)]);
        mesh.triangles
            .push([last, id(height - 1, i), id(height - 1, i + 1)]);
        for row in 0..height - 1 {
            let [p, q] = [id(row, i), id(row, i + 1)];
            let [s, t] = [id(row + 1, i), id(row + 1, i + 1)];
            // Odd rows are rotated by half a step, so the shorter diagonal alternates.
            if row % 2 == 0 {
                mesh.triangles.extend([[p, q, s], [q, t, s]]);
            } else {
                mesh.triangles.extend([[p, q, t], [p, t, s]]);
            }
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn volumes_approach_the_analytic_ones_from_below() {
        let sphere = icosphere(10.0, 4).volume();
        let exact = 4.0 / 3.0 * PI * 1000.0;
        assert!(sphere < exact && sphere > 0.995 * exact);
        let ring = torus(9.0, 3.0, 100, 60).volume();
        let exact = 2.0 * PI * PI * 9.0 * 9.0;
        assert!(ring < exact && ring > 0.99 * exact);
        assert!((tetrahedron(2.0).volume() - 8.0 / (6.0 * 2f64.sqrt())).abs() < 1e-12);
        let (length, radius, wall) = (60.0, 30.0, 10.0);
        let shell = cup(length, radius, wall, 96).volume();
        let half = |l: f64, r: f64| 2.0 / 3.0 * PI * l * r * r;
        // The rim is half a torus (Pappus).
        let rim = PI * (wall / 2.0).powi(2) / 2.0 * 2.0 * PI * (radius - wall / 2.0);
        let exact = half(length, radius) - half(length - wall, radius - wall) + rim;
        assert!((shell / exact - 1.0).abs() < 0.01, "{shell} {exact}");
    }
}
