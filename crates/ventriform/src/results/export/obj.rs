//! Wavefront OBJ, with every coordinate as the shortest decimal that gives the same number when
//! read. Where the parts of the wall are known, each is a group, its triangles in their order.

use std::fmt::Write;

use super::{Metadata, printable};
use crate::mesh::TriMesh;
use crate::mesh::part::Part;

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
    let Some(parts) = metadata.parts_of(mesh) else {
        return mesh.triangles.iter().try_for_each(|t| face(text, t));
    };
    for part in Part::ALL {
        let of_part = mesh.triangles.iter().zip(parts);
        let mut of_part = of_part.filter(|(_, of)| **of == part).peekable();
        if of_part.peek().is_some() {
            writeln!(text, "g {}", part.as_str())?;
            of_part.try_for_each(|(t, _)| face(text, t))?;
        }
    }
    Ok(())
}

fn face(text: &mut String, triangle: &[u32; 3]) -> std::fmt::Result {
    let [a, b, c] = triangle.map(|v| u64::from(v) + 1);
    writeln!(text, "f {a}//{a} {b}//{b} {c}//{c}")
}
