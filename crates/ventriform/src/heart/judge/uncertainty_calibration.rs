//! Constants of the uncertainty of nodes. Written by `scripts/measure/calibrate_walls.py`: do not edit.
//!
//! In: nodes of fits to simulated hearts, and their distances from the walls. Out: the logarithm of the distance within
//! which 68 % of the nodes lie, mm.

use super::node_terms::NodeTerms;

/// Distance from an expert's mask.
pub const APPARENT_TERMS: NodeTerms = NodeTerms {
    constant: 1.515,
    seen: -1.017,
    ln_spread: 0.482,
    log_odds: -0.112,
    way: -0.046,
    way_squared: 1.002,
};

/// Distance from the true wall.
pub const ANATOMICAL_TERMS: NodeTerms = NodeTerms {
    constant: 1.448,
    seen: -1.19,
    ln_spread: 0.641,
    log_odds: -0.124,
    way: 0.151,
    way_squared: 1.292,
};

/// The distance that stands for that from other fits where there are none: its median, mm.
pub const MEDIAN_SPREAD_MM: f64 = 0.8;
