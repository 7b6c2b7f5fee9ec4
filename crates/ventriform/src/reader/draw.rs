//! A fitted wall as a reader would draw it.
//!
//! By a level of the image, every node moves along its normal ([`super::level`]). By distances:
//!
//! 1. Every node moves along its ray from the long axis ([`VentricleWall`]), by the distance of the inner
//!    surface, of the outer one, or between the two in proportion to its depth in the wall. Where the
//!    wall would get thinner than [`MIN_THICKNESS_MM`](super::wall_edges::MIN_THICKNESS_MM), both move less.
//! 2. The rim moves along the long axis; nodes up to [`base_plane::STRETCHED_LENGTH_MM`] from it move
//!    less and less, so that the wall is stretched there.
//!
//! On a wall that is perpendicular to its rays, the surfaces move by exactly these distances.

use super::level::{self, WallImage};
use super::profile::{ReaderDrawing, ReaderOffsets};
use super::wall_edges::WallEdges;
use crate::deform::{FittedModel, base_plane};
use crate::mesh::TriMesh;
use crate::mesh::intersections::self_intersections;
use crate::model::wall::VentricleWall;
use crate::progress::{Cancelled, Monitor};

/// `fit` with the shown wall moved by `drawing`, and the share of it that was applied: 1, or less
/// where the whole would make the surface intersect itself. `image` is read for a level. The two measured walls
/// ([`FittedModel::surfaces`]) stay. Organs other than ventricles stay as they are.
///
/// # Errors
/// [`Cancelled`].
pub fn drawn(
    fit: FittedModel,
    drawing: &ReaderDrawing,
    image: &WallImage,
    monitor: &Monitor,
) -> Result<(FittedModel, f64), Cancelled> {
    let (Some(cup), Some(orientation), Some(wall)) = (fit.cup, fit.patient_orientation, &fit.wall)
    else {
        return Ok((fit, 0.0));
    };
    if drawing.is_none() {
        return Ok((fit, 1.0));
    }
    let superior = &orientation.superior;
    let displacements = match drawing {
        ReaderDrawing::Edge(_) => Vec::new(),
        ReaderDrawing::Level(level) => level::displacements(&fit.mesh, wall, image, *level),
    };
    let moved = |share: f64| match drawing {
        ReaderDrawing::Edge(offsets) => {
            let offsets = ReaderOffsets::from_array(offsets.to_array().map(|o| share * o));
            let mesh = with_surfaces_moved(&fit.mesh, wall, &offsets);
            base_plane::extended(&mesh, &cup, superior, offsets.rim)
        }
        ReaderDrawing::Level(_) => {
            let mut mesh = fit.mesh.clone();
            for (node, by) in mesh.vertices.iter_mut().zip(&displacements) {
                *node += by * share;
            }
            mesh
        }
    };
    // A fit that intersects itself already must not do so more often.
    let before = self_intersections(&fit.mesh).len();
    let unharmed = |mesh: &TriMesh| self_intersections(mesh).len() <= before;
    let found = [1.0, 0.75, 0.5, 0.25]
        .into_iter()
        .map(|share| (share, moved(share)))
        .find(|(_, mesh)| unharmed(mesh));
    let Some((share, mesh)) = found else {
        return Ok((fit, 0.0));
    };
    let wall = VentricleWall::new(&mesh, &cup, superior, monitor)?;
    let fit = FittedModel {
        wall_ml: mesh.volume() / 1000.0,
        wall: Some(wall),
        mesh,
        ..fit
    };
    Ok((fit, share))
}

/// `mesh`, whose wall is `wall`, with its inner and outer surface moved by `offsets`.
fn with_surfaces_moved(mesh: &TriMesh, wall: &VentricleWall, offsets: &ReaderOffsets) -> TriMesh {
    let edges = WallEdges::of(wall);
    let mut moved = mesh.clone();
    for p in &mut moved.vertices {
        *p += edges.shift(wall, p, offsets);
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec3;
    use crate::locate::cup::Cup;
    use crate::mesh::shapes;
    use crate::model::wall::{RAY_COLUMNS, RAY_ROWS};

    /// A long half ellipsoid, 188 and 200 mm from its centre at the apex (-z), with radii of 19 and 31 mm at
    /// its rim: there nearly a tube about the axis, across which the rays run.
    fn tube() -> (TriMesh, Cup, VentricleWall) {
        let mesh = shapes::cup(200.0, 31.0, 12.0, 48);
        let cup = Cup {
            centre: Vec3::zeros(),
            axis: -Vec3::z(),
            length: 200.0,
            breadth: 1.0,
        };
        let wall = VentricleWall::new(&mesh, &cup, &Vec3::y(), &Monitor::silent()).unwrap();
        (mesh, cup, wall)
    }

    /// Distance from the axis.
    fn radius(p: &Vec3) -> f64 {
        p.x.hypot(p.y)
    }

    #[test]
    fn the_surfaces_of_a_tube_move_by_the_given_distances() {
        let (mesh, cup, wall) = tube();
        for [endocardium, epicardium] in [[1.5, 0.0], [0.0, -1.0], [-2.0, 2.0], [1.0, 1.0]] {
            let offsets = ReaderOffsets {
                endocardium,
                epicardium,
                rim: 0.0,
            };
            let moved = with_surfaces_moved(&mesh, &wall, &offsets);
            let mut judged = [0; 2];
            for (before, after) in mesh.vertices.iter().zip(&moved.vertices) {
                // The rounded rim is neither surface.
                if !(-80.0..-10.0).contains(&before.z) {
                    continue;
                }
                let side = usize::from(radius(before) > 24.0);
                let by = radius(after) - radius(before);
                let wanted = [endocardium, epicardium][side];
                assert!((by - wanted).abs() < 0.06, "{by} for {wanted}: {before}");
                judged[side] += 1;
            }
            assert!(judged.iter().all(|n| *n > 200), "{judged:?}");
        }
        let lower = base_plane::extended(&mesh, &cup, &Vec3::y(), 3.0);
        let top = |mesh: &TriMesh| mesh.vertices.iter().map(|p| p.z).fold(f64::MIN, f64::max);
        assert!((top(&lower) - top(&mesh) - 3.0).abs() < 0.2);
        let apex = |mesh: &TriMesh| mesh.vertices.iter().map(|p| p.z).fold(f64::MAX, f64::min);
        assert_eq!(apex(&lower), apex(&mesh));
    }

    #[test]
    fn no_wall_gets_thinner_than_three_millimetres() {
        let (mesh, _, wall) = tube();
        let offsets = ReaderOffsets::from_array([8.0, -8.0, 0.0]);
        let moved = with_surfaces_moved(&mesh, &wall, &offsets);
        let wall = VentricleWall::new(&moved, &tube().1, &Vec3::y(), &Monitor::silent()).unwrap();
        let thin = wall.rays[RAY_ROWS / 2 * RAY_COLUMNS..]
            .iter()
            .filter_map(|r| r.wall);
        for [enters, leaves] in thin.take(10 * RAY_COLUMNS) {
            let thickness = leaves - enters;
            assert!((2.5..3.5).contains(&thickness), "{thickness}");
        }
        assert!(self_intersections(&moved).is_empty());
    }
}
