//! Standard deviation of each node's distance from the wall of a fitted ventricle.
//!
//! In go what is known of each node ([`NodeEvidence`]) and the chance of a good fit; out comes a standard
//! deviation, mm, along the normal ([`of_nodes`]).
//!
//! Its logarithm is a linear function of four numbers: how strong the edge is at the node (the mean
//! weight of its sensors: a flat profile has none), the logarithm of the root mean square distance from
//! the fits of the other built-in hearts, the logarithm of the odds of a good fit, and the way from
//! apex to rim. The coefficients are a quantile regression: 68 % of the nodes are to lie nearer to the wall
//! (the apparent one to an expert's mask, the anatomical one to the true wall). They come from 23250 nodes
//! (`scripts/measure/calibrate_walls.py` estimates them again) of 155 simulated hearts of the seeds that [`confidence`]
//! is calibrated on. There 70 % lie within one standard deviation and 93 and 91 % within two (each heart left out with
//! a fifth of all), about as many where the result is small as where it is great. docs/log/walls.md has the figures of
//! held-out hearts.
//!
//! Not guaranteed: a heart in the wrong place. Its nodes are as near to each other's fits as those of a right one.

use super::confidence;
use super::node_terms::NodeTerms;
use super::uncertainty_calibration::{ANATOMICAL_TERMS, APPARENT_TERMS, MEDIAN_SPREAD_MM};
use crate::base::geometry::Vec3;
use crate::heart::deform::sensors::{PER_TRIANGLE, SensorReading};
use crate::heart::deform::{FittedModel, WallEdge};
use crate::heart::model::wall::{RAY_ROWS, VentricleWall};
use crate::mesh::TriMesh;
use crate::mesh::subdivide::Midpoints;

/// Figures of a node behind its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NodeEvidence {
    /// Mean weight of the sensors about the node, 0..=1: 0 where the profile is flat.
    pub seen: f64,
    /// The way along the wall from the apex, 0, to the rim, 1.
    pub way: f64,
    /// Root mean square distance from the fits of the other built-in hearts, mm; `None` without.
    pub spread: Option<f64>,
}

/// The standard deviation of the distance of each node from both walls, mm.
#[derive(Debug, Clone, PartialEq)]
pub struct WallUncertainty {
    /// From the wall as it looks in the image.
    pub apparent: Vec<f64>,
    /// From the wall itself.
    pub anatomical: Vec<f64>,
}

impl WallUncertainty {
    /// That of both walls of `model`, a good fit with this `chance`; `None` for organs other than ventricles.
    pub(super) fn of_model(
        model: &FittedModel,
        nodes: &[NodeEvidence],
        chance: f64,
    ) -> Option<Self> {
        model.surfaces.as_ref()?;
        Some(Self {
            apparent: of_nodes(nodes, chance, WallEdge::Apparent),
            anatomical: of_nodes(nodes, chance, WallEdge::Anatomical),
        })
    }

    /// With the wall with this `edge` at the nodes of its finer surface too, which lie at `midpoints`.
    #[must_use]
    pub fn carried_to(mut self, edge: WallEdge, midpoints: &Midpoints) -> Self {
        let of_edge = match edge {
            WallEdge::Apparent => &mut self.apparent,
            WallEdge::Anatomical => &mut self.anatomical,
        };
        *of_edge = midpoints.at_vertices(of_edge);
        self
    }

    /// That of the wall with this `edge`.
    pub fn at_edge(&self, edge: WallEdge) -> &[f64] {
        match edge {
            WallEdge::Apparent => &self.apparent,
            WallEdge::Anatomical => &self.anatomical,
        }
    }
}

/// The sensors' readings about each node of `mesh`, and its way along the `wall`.
pub(super) fn node_evidence(
    mesh: &TriMesh,
    wall: &VentricleWall,
    readings: &[SensorReading],
) -> Vec<NodeEvidence> {
    let mut sums = vec![[0.0; 2]; mesh.vertices.len()];
    for (triangle, sensors) in mesh
        .triangles
        .iter()
        .zip(readings.chunks_exact(PER_TRIANGLE))
    {
        for node in triangle {
            let [seen, share] = &mut sums[*node as usize];
            *seen += sensors.iter().map(|r| r.weight * r.share).sum::<f64>();
            *share += sensors.iter().map(|r| r.share).sum::<f64>();
        }
    }
    let of = |(p, [seen, share]): (&Vec3, [f64; 2])| NodeEvidence {
        seen: if share > 0.0 { seen / share } else { 0.0 },
        way: ((wall.position(p).row + 0.5) / RAY_ROWS as f64).clamp(0.0, 1.0),
        spread: None,
    };
    mesh.vertices.iter().zip(sums).map(of).collect()
}

/// Least and greatest result, mm.
const UNCERTAINTY_RANGE_MM: [f64; 2] = [0.5, 15.0];

/// The standard deviation of the distance of each node from the wall of that `edge`, mm, where a good fit
/// has this `chance`.
pub fn of_nodes(nodes: &[NodeEvidence], chance: f64, edge: WallEdge) -> Vec<f64> {
    let terms = match edge {
        WallEdge::Apparent => &APPARENT_TERMS,
        WallEdge::Anatomical => &ANATOMICAL_TERMS,
    };
    let odds = confidence::log_odds(chance);
    let of = |node: &NodeEvidence| {
        let way = node.way.clamp(0.0, 1.0) - 0.5;
        let spread = node.spread.unwrap_or(MEDIAN_SPREAD_MM);
        let values = NodeTerms {
            constant: 1.0,
            seen: node.seen,
            ln_spread: (spread + 0.3).ln(),
            log_odds: odds,
            way,
            way_squared: way * way,
        };
        (terms.dot(&values).exp()).clamp(UNCERTAINTY_RANGE_MM[0], UNCERTAINTY_RANGE_MM[1])
    };
    nodes.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Strong edges, fits that agree, and good odds make a place certain; the ends of the wall are less
    /// certain than its middle, and the true rim less than the true apex.
    #[test]
    fn what_is_known_of_a_node_makes_it_certain() {
        let node = NodeEvidence {
            seen: 0.5,
            way: 0.5,
            spread: Some(0.8),
        };
        for edge in [WallEdge::Apparent, WallEdge::Anatomical] {
            let of = |node: NodeEvidence, chance: f64| of_nodes(&[node], chance, edge)[0];
            let usual = of(node, 0.8);
            assert!((1.0..4.0).contains(&usual), "{usual}");
            assert!(of(NodeEvidence { seen: 0.9, ..node }, 0.8) < 0.8 * usual);
            let spread = |spread| of(NodeEvidence { spread, ..node }, 0.8);
            assert!(spread(Some(3.0)) > 1.3 * usual && spread(Some(0.1)) < 0.8 * usual);
            assert_eq!(spread(None), usual);
            assert!(of(node, 0.99) < 0.9 * usual && of(node, 0.2) > 1.1 * usual);
            let [apex, rim] = [0.0, 1.0].map(|way| of(NodeEvidence { way, ..node }, 0.8));
            assert!(apex.min(rim) > 1.2 * usual, "{apex} {usual} {rim}");
            assert!((apex / rim).ln().abs() < 0.2);
            assert_eq!(edge == WallEdge::Anatomical, rim > apex);
            assert_eq!(of(NodeEvidence { way: 7.0, ..node }, 0.8), rim);
            let lost = NodeEvidence {
                seen: 0.0,
                way: 1.0,
                spread: Some(1e6),
            };
            assert_eq!(of(lost, 0.0), UNCERTAINTY_RANGE_MM[1]);
            let sure = NodeEvidence {
                seen: 1.0,
                spread: Some(0.0),
                ..node
            };
            assert!((UNCERTAINTY_RANGE_MM[0]..1.0).contains(&of(sure, 1.0)));
        }
    }
}
