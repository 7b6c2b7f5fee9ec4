//! Computes exact geodesic distances, for comparison with other programs by
//! `scripts/check/geodesics.py`.
//!
//! Reads `{"vertices": [[x, y, z], ...], "triangles": [[a, b, c], ...], "points": [[triangle, u, v, w],
//! ...]}` from standard input (u, v, w are barycentric coordinates) and prints the matrix of distances
//! between all points as JSON. The mesh must be closed.

use std::io::{read_to_string, stdin};

use anyhow::Context;
use serde::Deserialize;
use ventriform::base::geometry::Vec3;
use ventriform::mesh::{FaceId, TriMesh};
use ventriform::surface::retile::geodesics::distances;
use ventriform::surface::retile::{Geodesics, SurfacePoint};

#[derive(Deserialize)]
struct Query {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    points: Vec<(u32, f64, f64, f64)>,
}

fn main() -> anyhow::Result<()> {
    let text = read_to_string(stdin()).context("cannot read standard input")?;
    let query: Query =
        serde_json::from_str(&text).context("standard input is not the expected JSON")?;
    let mesh = TriMesh {
        vertices: query.vertices.into_iter().map(Vec3::from).collect(),
        triangles: query.triangles,
    };
    let points: Vec<SurfacePoint> = (query.points.into_iter())
        .map(|(triangle, u, v, w)| SurfacePoint {
            triangle: FaceId(triangle),
            barycentric: [u, v, w],
        })
        .collect();
    let matrix = distances(&mesh, Geodesics::Exact, &points, &points, f64::INFINITY)?;
    println!("{}", serde_json::to_string(&matrix)?);
    Ok(())
}
