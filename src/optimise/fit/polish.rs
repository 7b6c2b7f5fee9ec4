//! Flips for better shapes and valences.
//!
//! Letting the samples' distances weigh in as well was tried and changed nothing that could
//! be measured: once the vertices are fitted, either diagonal lies about as close to S.

use super::Model;
use crate::geometry::triangle;
use crate::optimise::{flips, legality};

/// Weight of Σ (valence - 6)² against Σ R/(2r). So much that a flip for the valences may cost
/// shape: the following rounds mend the shape, while irregular vertices would stay for good. At
/// N = 1000 1 instead of 0.05 raised the share of valence 6 from 66 to 78 % and the mean 2r/R
/// from .978 to .983.
const VALENCE_WEIGHT: f64 = 1.0;

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
                let pair = [h / 3, model.connectivity.twin(h) / 3];
                model.connectivity.flip(h);
                legality::reindex(&model.vertices, &model.connectivity, &mut index, pair);
                flipped += 1;
            }
        }
        if flipped == before {
            break;
        }
    }
    flipped
}

/// By how much flipping `h` would lower the objective; minus infinity if geometry forbids it.
fn gain(model: &Model, h: u32) -> f64 {
    let quad = model.connectivity.quad(h);
    let excess = |v: u32, change: f64| {
        let now = f64::from(model.connectivity.valence(v)) - 6.0;
        now.powi(2) - (now + change).powi(2)
    };
    let valences =
        excess(quad.a, -1.0) + excess(quad.b, -1.0) + excess(quad.c, 1.0) + excess(quad.d, 1.0);
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
