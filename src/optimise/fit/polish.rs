//! Flips for better shapes and valences.
//!
//! Letting the samples' distances weigh in as well was tried and changed nothing that could
//! be measured: once the vertices are fitted, either diagonal lies about as close to S.

use super::Model;
use crate::geometry::triangle;
use crate::mesh::adjacency::next;
use crate::mesh::intersections::IntersectionIndex;
use crate::optimise::connectivity::Connectivity;
use crate::optimise::{flips, legality};
use crate::progress::{Cancelled, Monitor};

/// Weight of Σ (valence - 6)² against Σ R/(2r). So much that a flip for the valences may cost
/// shape: the following rounds mend the shape, while irregular vertices would stay for good. At
/// N = 1000 1 instead of 0.05 raised the share of valence 6 from 66 to 78 % and the mean 2r/R
/// from .978 to .983.
const VALENCE_WEIGHT: f64 = 1.0;

/// Least radius ratio 2r/R of the triangles that a travelling pair may leave behind: the next
/// rounds even them out.
const LEAST_GLIDING_RATIO: f64 = 0.4;

/// Passes over all edges in one call.
const MOST_PASSES: usize = 4;

/// Keeps the objective finite where a triangle has no area.
const LEAST_RADIUS_RATIO: f64 = 1e-12;

/// Gains below this are rounding.
const LEAST_GAIN: f64 = 1e-9;

/// Flips edges, in order, wherever that lowers Σ R/(2r) + Σ (valence - 6)² and is legal,
/// until a pass finds none. Returns the number of flips.
pub fn flip(model: &mut Model) -> usize {
    let mut index = flips::intersection_index(&model.vertices, &model.connectivity);
    let mut flipped = 0;
    for _ in 0..MOST_PASSES {
        let before = flipped;
        for h in 0..model.connectivity.halfedges() {
            if h < model.connectivity.twin(h)
                && gain(model, h) > LEAST_GAIN
                && model.connectivity.can_flip(h)
                && !legality::pierces(&model.vertices, &model.connectivity, &index, h)
            {
                flip_edge(model, &mut index, h);
                flipped += 1;
            }
        }
        if flipped == before {
            break;
        }
    }
    flipped
}

/// Looks for short chains of flips that lower Σ (valence - 6)² although none of them but the
/// last does: so a pair of irregular vertices travels until it meets another one and both
/// vanish. A chain is one flip and at most `more` further ones; 0 looks for none. Returns the
/// number of flips.
///
/// # Errors
/// [`Cancelled`].
pub fn glide(model: &mut Model, more: usize, monitor: &Monitor) -> Result<usize, Cancelled> {
    if more == 0 {
        return Ok(0);
    }
    let mut index = flips::intersection_index(&model.vertices, &model.connectivity);
    let mut flipped = 0;
    for v in 0..model.vertices.len() as u32 {
        if model.connectivity.valence(v) == 6 {
            continue;
        }
        monitor.check()?;
        for edge in edges_near(&model.connectivity, &[v]) {
            flipped += chain(model, &mut index, edge, more, 0).unwrap_or(0);
        }
    }
    Ok(flipped)
}

/// Flips the edge and as many as `more` near it if that lowers Σ (valence - 6)²; else leaves
/// the mesh as it was. `gained` is what the flips before have lowered it by.
fn chain(
    model: &mut Model,
    index: &mut IntersectionIndex,
    edge: [u32; 2],
    more: usize,
    gained: i32,
) -> Option<usize> {
    let h = model.connectivity.halfedge(edge)?;
    let gained = gained + valence_gain(model, h);
    let quad = model.connectivity.quad(h);
    if gained < 0
        || (gained == 0 && more == 0)
        || !model.connectivity.can_flip(h)
        || legality::replacement(&model.vertices, &quad, 0.0)
            .is_none_or(|new| new.radius_ratios.iter().any(|&r| r < LEAST_GLIDING_RATIO))
        || legality::pierces(&model.vertices, &model.connectivity, index, h)
    {
        return None;
    }
    flip_edge(model, index, h);
    if gained > 0 {
        return Some(1);
    }
    for next in edges_near(&model.connectivity, &[quad.a, quad.b, quad.c, quad.d]) {
        if next == edge || next == [quad.c, quad.d] || next == [quad.d, quad.c] {
            continue;
        }
        if let Some(flips) = chain(model, index, next, more - 1, gained) {
            return Some(flips + 1);
        }
    }
    let back = model.connectivity.halfedge([quad.c, quad.d])?;
    flip_edge(model, index, back);
    None
}

fn flip_edge(model: &mut Model, index: &mut IntersectionIndex, h: u32) {
    let pair = [h / 3, model.connectivity.twin(h) / 3];
    model.connectivity.flip(h);
    legality::reindex(&model.vertices, &model.connectivity, index, pair);
}

/// The edges at and across from `vertices`, as pairs of vertices: half-edges change their
/// numbers in a flip.
fn edges_near(connectivity: &Connectivity, vertices: &[u32]) -> Vec<[u32; 2]> {
    let mut edges = Vec::new();
    for &v in vertices {
        for h in connectivity.around(v) {
            for side in [h, next(h)] {
                let (p, q) = (connectivity.origin(side), connectivity.target(side));
                edges.push([p.min(q), p.max(q)]);
            }
        }
    }
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// By how much flipping `h` would lower Σ (valence - 6)².
fn valence_gain(model: &Model, h: u32) -> i32 {
    let quad = model.connectivity.quad(h);
    [(quad.a, -1), (quad.b, -1), (quad.c, 1), (quad.d, 1)]
        .into_iter()
        .map(|(v, change)| {
            let now = model.connectivity.valence(v) as i32 - 6;
            now.pow(2) - (now + change).pow(2)
        })
        .sum()
}

/// By how much flipping `h` would lower the objective; minus infinity if geometry forbids it.
fn gain(model: &Model, h: u32) -> f64 {
    let quad = model.connectivity.quad(h);
    let valences = f64::from(valence_gain(model, h));
    let shape = |t: [u32; 3]| {
        let [a, b, c] = t.map(|v| model.vertices[v as usize]);
        1.0 / triangle::radius_ratio(&a, &b, &c).max(LEAST_RADIUS_RATIO)
    };
    let now = shape([quad.a, quad.b, quad.c]) + shape([quad.b, quad.a, quad.d]);
    // No pair has a sum below 2: that settles most edges.
    if now - 2.0 + VALENCE_WEIGHT * valences <= 0.0 {
        return f64::NEG_INFINITY;
    }
    let [first, second] = quad.flipped();
    let gain = now - shape(first) - shape(second) + VALENCE_WEIGHT * valences;
    if legality::replacement(&model.vertices, &quad, 0.0).is_some() {
        gain
    } else {
        f64::NEG_INFINITY
    }
}
