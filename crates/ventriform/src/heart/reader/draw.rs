//! A fitted wall as a reader would draw it.
//!
//! By a level of the image, the surface gets smaller triangles, and every node moves along its normal
//! ([`super::level`]); where the surface would intersect itself, the nodes about go less far. By distances:
//!
//! 1. Every node moves along its ray from the long axis ([`VentricleWall`]), by the distance of the inner
//!    surface, of the outer one, or between the two in proportion to its depth in the wall. Where the
//!    wall would get thinner than [`MIN_THICKNESS_MM`](super::wall_edges::MIN_THICKNESS_MM), both move less.
//! 2. The rim moves along the long axis; nodes up to
//!    [`STRETCHED_LENGTH_MM`](crate::heart::deform::rim_frame::STRETCHED_LENGTH_MM) from it move less and less, so that the
//!    wall is stretched there.
//!
//! On a wall that is perpendicular to its rays, the surfaces move by exactly these distances.

use super::level::{self, WallImage};
use super::profile::{ReaderDrawing, ReaderOffsets};
use super::wall_edges::WallEdges;
use crate::base::geometry::Vec3;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::deform::{FittedModel, base_plane};
use crate::heart::model::wall::VentricleWall;
use crate::mesh::intersections::self_intersections;
use crate::mesh::subdivide::{Midpoints, Subdivided};
use crate::mesh::{FaceId, TriMesh};

/// Rounds in which displacements about triangles that intersect are made shorter, and the share of them that stays in
/// each.
const MAX_SHORTENING_ROUNDS: usize = 20;
const SHORTENED: f64 = 0.7;

/// A fit whose shown wall is as a reader draws it.
#[derive(Debug, Clone)]
pub struct DrawnFit {
    /// The fit. The two measured walls ([`FittedModel::surfaces`]) are as they were.
    pub model: FittedModel,
    /// The share of the drawing that was applied: 1, or less where the whole would make the surface intersect itself.
    pub share: f64,
    /// The nodes of the shown wall that its model lacks: a level is drawn with smaller triangles.
    pub midpoints: Midpoints,
}

/// `model` with the shown wall moved by `drawing`. `image` is read for a level. Organs other than ventricles stay as
/// they are.
///
/// # Errors
/// [`Cancelled`].
pub fn drawn(
    model: FittedModel,
    drawing: &ReaderDrawing,
    image: &WallImage,
    monitor: &Monitor,
) -> Result<DrawnFit, Cancelled> {
    let as_it_is = |model, share| DrawnFit {
        model,
        share,
        midpoints: Midpoints::default(),
    };
    let (Some(cup), Some(orientation), Some(wall)) =
        (model.cup, model.patient_orientation, &model.wall)
    else {
        return Ok(as_it_is(model, 0.0));
    };
    if drawing.is_none() {
        return Ok(as_it_is(model, 1.0));
    }
    let superior = &orientation.superior;
    let moved = match drawing {
        ReaderDrawing::Edge(offsets) => by_distances(&model.mesh, offsets, |offsets| {
            let mesh = with_surfaces_moved(&model.mesh, wall, offsets);
            base_plane::extended(&mesh, &cup, superior, offsets.rim)
        }),
        ReaderDrawing::Level(level) => by_level(&model.mesh, wall, image, *level),
    };
    let Some((Subdivided { mesh, midpoints }, share)) = moved else {
        return Ok(as_it_is(model, 0.0));
    };
    let wall = VentricleWall::new(&mesh, &cup, superior, monitor)?;
    let model = FittedModel {
        wall_ml: mesh.volume() / 1000.0,
        wall: Some(wall),
        mesh,
        ..model
    };
    Ok(DrawnFit {
        model,
        share,
        midpoints,
    })
}

/// The greatest share of `offsets` by which `moved` does not make `mesh` intersect itself, and the mesh moved so.
fn by_distances(
    mesh: &TriMesh,
    offsets: &ReaderOffsets,
    moved: impl Fn(&ReaderOffsets) -> TriMesh,
) -> Option<(Subdivided, f64)> {
    // A fit that intersects itself already must not do so more often.
    let before = self_intersections(mesh).len();
    [1.0, 0.75, 0.5, 0.25].into_iter().find_map(|share| {
        let offsets = ReaderOffsets::from_array(offsets.to_array().map(|o| share * o));
        let mesh = moved(&offsets);
        (self_intersections(&mesh).len() <= before).then(|| (Subdivided::not_yet(mesh), share))
    })
}

/// The surface of `mesh`, whose wall is `wall`, drawn at `level`, and the share of the way that it went. Where it would
/// intersect itself, its nodes go less far.
fn by_level(
    mesh: &TriMesh,
    wall: &VentricleWall,
    image: &WallImage,
    level: f64,
) -> Option<(Subdivided, f64)> {
    let finer = level::subdivided(mesh.clone());
    let before = self_intersections(&finer.mesh).len();
    let wanted = level::displacements(&finer.mesh, wall, image, level);
    let way = |displacements: &[Vec3]| displacements.iter().map(Vec3::norm).sum::<f64>();
    let mut displacements = wanted.clone();
    for _ in 0..MAX_SHORTENING_ROUNDS {
        let mut moved = finer.mesh.clone();
        for (node, by) in moved.vertices.iter_mut().zip(&displacements) {
            *node += by;
        }
        let intersecting = self_intersections(&moved);
        if intersecting.len() <= before {
            let share = way(&displacements) / way(&wanted).max(1e-9);
            let drawn = Subdivided {
                mesh: moved,
                midpoints: finer.midpoints,
            };
            return Some((drawn, share));
        }
        for node in nodes_about(&finer.mesh, intersecting.into_iter().flatten()) {
            displacements[node] *= SHORTENED;
        }
    }
    None
}

/// The nodes of `triangles` and of their neighbours.
fn nodes_about(mesh: &TriMesh, triangles: impl Iterator<Item = FaceId>) -> Vec<usize> {
    let mut inner = vec![false; mesh.vertices.len()];
    for triangle in triangles {
        for node in mesh.triangles[triangle.index()] {
            inner[node as usize] = true;
        }
    }
    let mut all = inner.clone();
    for triangle in &mesh.triangles {
        if triangle.iter().any(|node| inner[*node as usize]) {
            for node in triangle {
                all[*node as usize] = true;
            }
        }
    }
    (0..all.len()).filter(|node| all[*node]).collect()
}

/// `mesh`, whose wall is `wall`, with its inner and outer surface moved by `offsets`.
fn with_surfaces_moved(mesh: &TriMesh, wall: &VentricleWall, offsets: &ReaderOffsets) -> TriMesh {
    let edges = WallEdges::from_wall(wall);
    let mut moved = mesh.clone();
    for p in &mut moved.vertices {
        *p += edges.shift(wall, p, offsets);
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heart::model::wall::{RAY_COLUMNS, RAY_ROWS};
    use crate::image::locate::cup::Cup;
    use crate::mesh::shapes;

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
