//! Which triangles of a ventricle's closed surface are endocardium, which epicardium, which base.
//!
//! 1. Each triangle gets a side: it faces the long axis (inner) or away from it (outer), by its normal and the
//!    direction of the ray through its centre ([`VentricleWall::position`]), which near the apex fans out.
//!    Of each side the largest connected part counts; patches beside it get the side about them.
//! 2. Base are, near the rim, the triangles that face away from the apex more than to either side.
//! 3. Where inner and outer still share an edge, the triangle that faces away from the apex more is base,
//!    too. So the base always separates the endocardium from the epicardium.
//!
//! Triangles of a mesh without both sides have no parts.

use super::wall::VentricleWall;
use crate::base::geometry::Vec3;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::locate::cup::Cup;
use crate::mesh::TriMesh;
use crate::mesh::part::Part;

/// Greatest distance of the base from the rim, as a share of the length from rim to apex. Valve planes
/// are slanted, and the rim is their mean.
const MAX_BASE_SHARE: f64 = 0.3;

/// Most rounds in which patches beside the largest part of a side are given to the other side.
const MAX_REASSIGNMENTS: usize = 8;

/// The part of each triangle of `mesh`, a ventricle's wall with this `cup` (LPS mm); `None` if the mesh has
/// not got all parts.
///
/// # Errors
/// [`Cancelled`].
pub fn wall_parts(
    mesh: &TriMesh,
    cup: &Cup,
    monitor: &Monitor<'_>,
) -> Result<Option<Vec<Part>>, Cancelled> {
    // The sides of an angle about the axis do not matter here.
    let wall = VentricleWall::new(mesh, cup, &Vec3::z(), monitor)?;
    let [rim, apex] = wall.extent;
    let basal_end = rim + MAX_BASE_SHARE * (apex - rim);
    let facing: Vec<Facing> = (0..mesh.triangles.len())
        .map(|t| {
            let [a, b, c] = mesh.corners(t);
            let centre = (a + b + c) / 3.0;
            let normal = mesh.area_normal(t);
            let area = normal.norm();
            let normal = normal / area.max(f64::MIN_POSITIVE);
            Facing {
                area,
                outward: normal.dot(&wall.position(&centre).direction),
                away: -normal.dot(&cup.axis),
                basal: wall.along_axis(&centre) < basal_end,
            }
        })
        .collect();
    let neighbours = neighbours(mesh);
    let mut outer: Vec<bool> = facing.iter().map(|f| f.outward > 0.0).collect();
    for _ in 0..MAX_REASSIGNMENTS {
        if !flip_patches(&mut outer, &facing, &neighbours) {
            break;
        }
    }
    let mut parts: Vec<Part> = facing
        .iter()
        .zip(&outer)
        .map(|(f, outer)| match outer {
            _ if f.basal && f.away > f.outward.abs() => Part::Base,
            true => Part::Epicardium,
            false => Part::Endocardium,
        })
        .collect();
    for &[a, b] in &neighbours {
        if parts[a] != parts[b] && parts[a] != Part::Base && parts[b] != Part::Base {
            let more = if facing[a].away >= facing[b].away {
                a
            } else {
                b
            };
            parts[more] = Part::Base;
        }
    }
    let all = Part::ALL.iter().all(|part| parts.contains(part));
    Ok(all.then_some(parts))
}

/// Where a triangle faces.
struct Facing {
    /// Twice its area, mm².
    area: f64,
    /// Cosine of the angle between its normal and the direction away from the axis.
    outward: f64,
    /// Cosine of the angle between its normal and the direction from apex to base.
    away: f64,
    /// Whether it lies near the rim.
    basal: bool,
}

/// Pairs of triangles that share an edge, in a fixed order.
fn neighbours(mesh: &TriMesh) -> Vec<[usize; 2]> {
    let mut edges: Vec<([u32; 2], usize)> = Vec::with_capacity(3 * mesh.triangles.len());
    for (t, &[a, b, c]) in mesh.triangles.iter().enumerate() {
        for [p, q] in [[a, b], [b, c], [c, a]] {
            edges.push(([p.min(q), p.max(q)], t));
        }
    }
    edges.sort_unstable();
    edges
        .windows(2)
        .filter(|pair| pair[0].0 == pair[1].0)
        .map(|pair| [pair[0].1, pair[1].1])
        .collect()
}

/// Gives the patches of both sides that are not the side's largest to the other side. Returns whether there were any.
fn flip_patches(outer: &mut [bool], facing: &[Facing], neighbours: &[[usize; 2]]) -> bool {
    let mut root: Vec<usize> = (0..outer.len()).collect();
    for &[a, b] in neighbours {
        if outer[a] == outer[b] {
            let (a, b) = (find(&mut root, a), find(&mut root, b));
            root[a.max(b)] = a.min(b);
        }
    }
    let roots: Vec<usize> = (0..outer.len()).map(|t| find(&mut root, t)).collect();
    let mut areas = vec![0.0; outer.len()];
    for (t, &r) in roots.iter().enumerate() {
        areas[r] += facing[t].area;
    }
    let largest = |side: bool| {
        let of_side = (0..outer.len()).filter(|t| roots[*t] == *t && outer[*t] == side);
        of_side.max_by(|a, b| areas[*a].total_cmp(&areas[*b]).then(b.cmp(a)))
    };
    let kept = [largest(false), largest(true)];
    let mut flipped = false;
    for t in 0..outer.len() {
        if !kept.contains(&Some(roots[t])) {
            outer[t] = !outer[t];
            flipped = true;
        }
    }
    flipped
}

fn find(root: &mut [usize], mut t: usize) -> usize {
    while root[t] != t {
        root[t] = root[root[t]];
        t = root[t];
    }
    t
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    /// Area of a part, mm².
    fn area(mesh: &TriMesh, parts: &[Part], part: Part) -> f64 {
        let of_part = (0..parts.len()).filter(|t| parts[*t] == part);
        of_part.map(|t| mesh.area_normal(t).norm() / 2.0).sum()
    }

    fn cup_at(length: f64) -> Cup {
        Cup {
            centre: Vec3::new(0.0, 0.0, -length / 2.0),
            axis: -Vec3::z(),
            length,
            breadth: 1.0,
        }
    }

    #[test]
    fn the_parts_of_a_cup_have_the_areas_of_its_surfaces_and_never_mix() {
        for pieces in [10, 30, 60] {
            let mesh = shapes::cup(80.0, 32.0, 10.0, pieces);
            // The apex lies at -z, the rim at 0.
            let (base, cup) = (0.0, cup_at(80.0));
            let quiet = Monitor::silent();
            let parts = wall_parts(&mesh, &cup, &quiet).unwrap().unwrap();
            let [inner, outer, rim] = Part::ALL.map(|part| area(&mesh, &parts, part));
            assert!((inner + outer + rim - mesh.area()).abs() < 1e-6 * mesh.area());
            assert!(inner < outer, "{pieces}: {inner} {outer}");
            assert!(rim < 0.4 * inner, "{pieces}: {rim} {inner}");
            for [a, b] in neighbours(&mesh) {
                let both = [parts[a], parts[b]];
                let mixed = both.contains(&Part::Endocardium) && both.contains(&Part::Epicardium);
                assert!(!mixed, "triangles {a} and {b}");
            }
            // Away from the rim the side is that of the nearer surface of revolution.
            for (t, part) in parts.iter().enumerate() {
                let [a, b, c] = mesh.corners(t);
                let centre = (a + b + c) / 3.0;
                if (centre.z - base).abs() > 15.0 {
                    let inward = mesh.area_normal(t).dot(&(centre - cup.centre)) < 0.0;
                    let expected = if inward {
                        Part::Endocardium
                    } else {
                        Part::Epicardium
                    };
                    assert_eq!(*part, expected, "{pieces}: {centre:?}");
                }
            }
        }
    }

    #[test]
    fn a_ball_has_no_parts() {
        let mesh = shapes::icosphere(30.0, 3);
        let cup = cup_at(60.0);
        assert_eq!(wall_parts(&mesh, &cup, &Monitor::silent()).unwrap(), None);
    }
}
