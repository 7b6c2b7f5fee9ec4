//! Wavefront OBJ, with every coordinate as the shortest decimal that gives the same number when
//! read.

use std::fmt::Write;

use super::{Metadata, printable};
use crate::mesh::TriMesh;

/// An OBJ file.
pub fn encode(mesh: &TriMesh, metadata: &Metadata) -> Vec<u8> {
    let mut text = String::new();
    let written = write(&mut text, mesh, metadata);
    debug_assert!(written.is_ok(), "writing to a String cannot fail");
    text.into_bytes()
}

fn write(text: &mut String, mesh: &TriMesh, metadata: &Metadata) -> std::fmt::Result {
    for comment in metadata.comments() {
        writeln!(text, "# {comment}")?;
    }
    // The name must not contain spaces.
    let name = printable(&metadata.title).replace(' ', "_");
    writeln!(text, "o {}", if name.is_empty() { "model" } else { &name })?;
    for p in &mesh.vertices {
        writeln!(text, "v {} {} {}", p.x, p.y, p.z)?;
    }
    for n in mesh.vertex_normals() {
        writeln!(text, "vn {} {} {}", n.x, n.y, n.z)?;
    }
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| u64::from(v) + 1);
        writeln!(text, "f {a}//{a} {b}//{b} {c}//{c}")?;
    }
    Ok(())
}
