//! The judgement of one fit by the fits of several models to the same volume.
//!
//! In go the chosen fit and the fits of the built-in hearts; out comes its judgement with the
//! [`confidence`](super::confidence::of_set) that they give it together, their distance from it, and the
//! [`uncertainty`](super::uncertainty) of each of its nodes.
//!
//! Not guaranteed: that fits which agree are right. All
//! start from one search, and where that is wrong they agree on the wrong place.

use super::confidence;
use super::flag_rules;
use super::uncertainty::{NodeEvidence, WallUncertainty};
use super::{Fit, Judgement};
use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Bvh;
use crate::heart::deform::WallEdge;
use crate::mesh::TriMesh;

/// A fit of a built-in heart, or `None` where it failed.
pub type MemberFit<'a> = Option<&'a Fit>;

/// The judgement of the chosen `fit`, whose wall with this `edge` is shown, by the `members` together. `own` is its
/// index among them, if it is one of them.
pub fn judgement(
    fit: &Fit,
    members: &[MemberFit<'_>],
    own: Option<usize>,
    edge: WallEdge,
) -> Judgement {
    let alone = &fit.judgement;
    let Some(evidence) = &alone.evidence else {
        return alone.clone();
    };
    let others: Vec<&TriMesh> = members
        .iter()
        .enumerate()
        .filter(|(index, _)| Some(*index) != own)
        .filter_map(|(_, member)| apparent((*member)?))
        .collect();
    let chance = |member: &MemberFit<'_>| {
        let evidence = member.and_then(|member| member.judgement.evidence);
        evidence.map_or(0.0, |e| confidence::of_agreement(&e, edge))
    };
    let mut chances: Vec<f64> = members.iter().map(chance).collect();
    if own.is_none() {
        chances.push(confidence::of_agreement(evidence, edge));
    }
    let distances = apparent(fit).map(|mesh| distances(mesh, &others));
    let mut nodes = alone.nodes.clone();
    for (node, distance) in nodes.iter_mut().zip(distances.iter().flatten()) {
        node.spread = Some(*distance);
    }
    let chance = confidence::of_set(&chances, evidence, edge);
    let chance = confidence::in_view_of_search(chance, &fit.model);
    let confidence = flag_rules::limited(chance, &alone.flags);
    Judgement {
        confidence,
        position_confidence: alone.position_confidence,
        evidence: Some(*evidence),
        uncertainty: WallUncertainty::of_model(&fit.model, &nodes, confidence),
        volumes: alone.volumes,
        nodes,
        flags: flag_rules::with_chance(alone.flags.clone(), confidence, evidence),
    }
}

/// The wall as it looks.
fn apparent(fit: &Fit) -> Option<&TriMesh> {
    let surfaces = fit.model.surfaces.as_ref();
    surfaces.map(|s| &s.apparent.mesh)
}

/// The root mean square distance of each node of `mesh` from the surfaces of the others, mm; empty
/// without others.
fn distances(mesh: &TriMesh, others: &[&TriMesh]) -> Vec<f64> {
    let trees: Vec<Bvh> = others
        .iter()
        .map(|other| Bvh::new(&other.vertices, &other.triangles))
        .collect();
    let squared = |p: &Vec3| -> f64 {
        let each = trees.iter().filter_map(|tree| tree.closest(p));
        each.map(|c| c.squared_distance).sum()
    };
    match trees.len() {
        0 => Vec::new(),
        n => (mesh.vertices.iter())
            .map(|p| (squared(p) / n as f64).sqrt())
            .collect(),
    }
}

/// The mean over the nodes of their distance from the other fits, mm; `None` without others.
pub fn spread(nodes: &[NodeEvidence]) -> Option<f64> {
    let spreads: Vec<f64> = nodes.iter().filter_map(|node| node.spread).collect();
    match spreads.len() {
        0 => None,
        n => Some(spreads.iter().sum::<f64>() / n as f64),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn the_distance_of_concentric_spheres_is_the_difference_of_their_radii() {
        let ball = |radius: f64| shapes::icosphere(radius, 4);
        let (mesh, others) = (ball(30.0), [ball(33.0), ball(26.0)]);
        let others: Vec<&TriMesh> = others.iter().collect();
        let expected = (f64::midpoint(9.0, 16.0)).sqrt();
        for distance in distances(&mesh, &others) {
            assert!((distance - expected).abs() < 0.1, "{distance}");
        }
        assert!(distances(&mesh, &[]).is_empty());
    }
}
