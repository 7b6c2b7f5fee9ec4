//! Step three: flips that end self-intersections, where removal had to allow any.

use super::hole::Demand;
use super::patchwork::Patchwork;
use super::removal::Flip;
use crate::progress::{Cancelled, Monitor};

/// Rounds over the triangles that still meet others.
const MOST_ROUNDS: usize = 16;

/// Flips edges of triangles that pierce others wherever both new triangles pierce nothing.
/// Returns whether nothing pierces anything any more.
pub(super) fn end_self_intersections(
    mesh: &mut Patchwork,
    monitor: &Monitor,
) -> Result<bool, Cancelled> {
    for _ in 0..MOST_ROUNDS {
        let offending: Vec<u32> = mesh.live_ids().filter(|&t| mesh.is_pierced(t)).collect();
        if offending.is_empty() {
            return Ok(true);
        }
        let mut flipped = false;
        for t in offending {
            monitor.check()?;
            let [a, b, c] = mesh.triangle(t);
            let flip = mesh
                .is_pierced(t)
                .then(|| {
                    [(a, b), (b, c), (c, a)]
                        .into_iter()
                        .filter_map(|(v, w)| Flip::new(mesh, v, w, Demand::Embedded))
                        .find(|flip| !flip.pierces(mesh))
                })
                .flatten();
            if let Some(flip) = flip {
                mesh.replace(&flip.old, &flip.new);
                flipped = true;
            }
        }
        if !flipped {
            break;
        }
    }
    Ok(false)
}
