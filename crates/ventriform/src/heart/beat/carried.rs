//! A mesh of the summed image's wall, carried through the beat.
//!
//! In: a mesh whose nodes lie in the wall of the summed image. Out: the same nodes and triangles at any moment. A node
//! keeps its ray and the share of the wall's thickness at which it lies, so the order of nodes along a ray never
//! changes, and the mesh encloses the muscle that the fit keeps.

use super::fields::{COLUMNS, Layout, Nodes, WallState};
use super::start::StillWall;
use crate::base::geometry::Vec3;
use crate::heart::model::wall::{self, RayCoordinates, VentricleWall};

/// Shares of the thickness beyond the wall that a node may have: nodes of a smooth surface lie a little beside the
/// rays' means.
const DEPTH_LIMITS: [f64; 2] = [-0.5, 1.5];

/// The nodes of a mesh in the coordinates of the wall.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CarriedNodes(Vec<CarriedNode>);

#[derive(Debug, Clone, Copy, PartialEq)]
struct CarriedNode {
    /// Arc as a share of the rim's.
    arc_share: f64,
    /// Turns about the axis from the lateral side.
    turn: f64,
    /// Share of the thickness between the inner (0) and the outer surface (1).
    depth: f64,
}

impl CarriedNodes {
    /// `vertices` lie in `wall`, whose distances at the nodes of the fields are `still`.
    pub fn new(vertices: &[Vec3], wall: &VentricleWall, still: &StillWall, rows: usize) -> Self {
        let [inner, outer]: [Vec<f64>; 2] =
            [0, 1].map(|side| still.walls.iter().map(|ends| ends[side]).collect());
        let node = |point: &Vec3| {
            let position = wall.position(point);
            let arc = (position.row + 0.5) * wall.row_spacing;
            // The ray of column n lies in the middle of its sector.
            let turn = (position.column + 0.5) / wall::RAY_COLUMNS as f64;
            let column = turn * COLUMNS as f64 % COLUMNS as f64;
            let nodes = Nodes::at(rows, arc, column);
            let (enters, leaves) = (nodes.value(&inner), nodes.value(&outer));
            let depth = (position.distance - enters) / (leaves - enters).max(1e-6);
            CarriedNode {
                arc_share: arc / nodes.rim(&still.rim).max(1e-6),
                turn,
                depth: depth.clamp(DEPTH_LIMITS[0], DEPTH_LIMITS[1]),
            }
        };
        Self(vertices.iter().map(node).collect())
    }

    /// The nodes in a wall, LPS mm.
    pub fn at(
        &self,
        coordinates: &RayCoordinates,
        layout: &Layout,
        state: &WallState,
        rim: &[f64],
    ) -> Vec<Vec3> {
        let moved = |node: &CarriedNode| {
            let column = node.turn * COLUMNS as f64 % COLUMNS as f64;
            let arc = node.arc_share * Nodes::at(layout.rows, 0.0, column).rim(rim);
            let nodes = Nodes::at(layout.rows, arc, column);
            let (mid, thick) = (nodes.value(&state.mid_wall), nodes.value(&state.thickness));
            let distance = (mid + (node.depth - 0.5) * thick).max(0.0);
            let (start, direction) = coordinates.ray(arc, node.turn, state.stretch);
            start + direction * distance
        };
        self.0.iter().map(moved).collect()
    }
}
