//! Exact distances along a surface, for outside judges (`scripts/check_geodesics.py`).
//!
//! Reads `{"vertices": [[x, y, z], ...], "triangles": [[a, b, c], ...], "points": [[triangle,
//! u, v, w], ...]}` (barycentric coordinates) and prints the matrix of distances between all
//! points as JSON. The mesh must be closed.

use std::io::{read_to_string, stdin};

use anyhow::Context;
use serde::Deserialize;
use ventriform::geometry::Vec3;
use ventriform::mesh::TriMesh;
use ventriform::retile::geodesics::distances;
use ventriform::retile::{Geodesics, SurfacePoint};

#[derive(Deserialize)]
struct Question {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    points: Vec<(u32, f64, f64, f64)>,
}

fn main() -> anyhow::Result<()> {
    let text = read_to_string(stdin()).context("reading the question")?;
    let question: Question = serde_json::from_str(&text).context("the question's JSON")?;
    let mesh = TriMesh {
        vertices: question.vertices.into_iter().map(Vec3::from).collect(),
        triangles: question.triangles,
    };
    let points: Vec<SurfacePoint> = (question.points.into_iter())
        .map(|(triangle, u, v, w)| SurfacePoint {
            triangle,
            barycentric: [u, v, w],
        })
        .collect();
    let answer = distances(&mesh, Geodesics::Exact, &points, &points, f64::INFINITY)?;
    println!("{}", serde_json::to_string(&answer)?);
    Ok(())
}
