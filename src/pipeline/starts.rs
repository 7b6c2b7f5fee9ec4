//! Several models of one surface, of which the best is kept.
//!
//! Relaxation, fit and flips end in the arrangement next to where the random points began.
//! Arrangements of few points differ most in worth, and cost least.
//!
//! 1. [`tile`]: the surface re-tiled from each start, every one with a seed of its own;
//! 2. [`best`]: each is optimised and measured as one alone would be. Kept is the model with the
//!    least product of mean distance, largest distance and 1 - mean 2r/R. A product needs no
//!    weights and no units: what is a tenth worse in one must be a tenth better in another.
//!
//! Guaranteed: the first start is what the seed gives alone, so no model is worse by that product
//! for having had more starts; the seed that is kept gives the same model alone. Not guaranteed:
//! that the model is better by each figure, or by fitness.

use crate::optimise::{self, OptimiseError, Optimised, Reference};
use crate::parameters::ModelParameters;
use crate::progress::{Monitor, Stage};
use crate::report::{self, MeasureParameters, Measures, Start};
use crate::retile::{self, RetileError, RetileParameters, Tiled};
use crate::surface::Surface;

/// From one start's seed to the next one's: a prime, far from the steps in which people count, and
/// so small that the sums stay readable and are exact as the doubles that most JSON readers make.
const NEXT_SEED: u64 = 1_000_003;

/// The best of the models.
#[derive(Debug, Clone)]
pub struct Best {
    /// What it was made of.
    pub tiled: Tiled,
    /// The model.
    pub optimised: Optimised,
    /// Its measures.
    pub measures: Measures,
    /// Figures of all models, in order.
    pub starts: Vec<Start>,
}

/// Re-tiles the surface from each start. Where one has to warn of the surface, there are no more:
/// they would find the same, and take long to.
///
/// # Errors
/// Those of the first start; a later one that fails is left out, and is the last.
pub fn tile(
    surface: &Surface,
    parameters: &ModelParameters,
    monitor: &Monitor,
) -> Result<Vec<Tiled>, RetileError> {
    let mut tiled = Vec::with_capacity(parameters.starts);
    for start in 0..parameters.starts {
        let seed = (parameters.retile.seed).wrapping_add(NEXT_SEED.wrapping_mul(start as u64));
        let own = RetileParameters {
            seed,
            ..parameters.retile.clone()
        };
        let made = match retile::retile(surface, &own, &monitor.piece(start, parameters.starts)) {
            Ok(made) => made,
            Err(RetileError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(error) if start == 0 => return Err(error),
            Err(_) => break,
        };
        let warned = !made.facts.warnings.is_empty();
        tiled.push(made);
        if warned {
            break;
        }
    }
    Ok(tiled)
}

/// Optimises and measures what [`tile`] made, at least one, and keeps the best; `ended` hears of
/// each stage's end.
///
/// # Errors
/// Those of the optimisation.
pub fn best(
    mut tiled: Vec<Tiled>,
    reference: &Reference,
    parameters: &ModelParameters,
    monitor: &Monitor,
    mut ended: impl FnMut(Stage),
) -> Result<Best, OptimiseError> {
    let mut optimised = each(&tiled, monitor, |tiled, monitor| {
        optimise::optimise(tiled, reference, &parameters.optimise, monitor)
    })?;
    ended(Stage::Optimise);
    let mut measures = each(&optimised, monitor, |optimised, monitor| {
        let figures = MeasureParameters::default();
        report::measure(&optimised.mesh, reference, &figures, monitor)
    })?;
    ended(Stage::Report);
    let starts = (tiled.iter().zip(&measures))
        .map(|(tiled, measures)| Start::new(tiled, measures))
        .collect();
    let kept = least_bad(&measures);
    Ok(Best {
        tiled: tiled.swap_remove(kept),
        optimised: optimised.swap_remove(kept),
        measures: measures.swap_remove(kept),
        starts,
    })
}

/// `work` done for each, each of them a piece of the stage.
fn each<T, U, E>(
    starts: &[T],
    monitor: &Monitor,
    work: impl Fn(&T, &Monitor) -> Result<U, E>,
) -> Result<Vec<U>, E> {
    (0..)
        .zip(starts)
        .map(|(start, it)| work(it, &monitor.piece(start, starts.len())))
        .collect()
}

/// The first of the best models that do not pierce themselves.
fn least_bad(measures: &[Measures]) -> usize {
    let pierced = |m: &Measures| m.mesh.self_intersections > 0;
    let badness = |m: &Measures| {
        m.distance.mean_mm * m.distance.hausdorff_mm * (1.0 - m.shape.radius_ratio.mean)
    };
    (0..measures.len())
        .min_by(|&a, &b| {
            let [a, b] = [a, b].map(|k| &measures[k]);
            (pierced(a).cmp(&pierced(b))).then(badness(a).total_cmp(&badness(b)))
        })
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    fn parameters(points: &str, starts: &str) -> ModelParameters {
        let pairs = [("points", points), ("starts", starts), ("seed", "7")];
        ModelParameters::from_pairs(pairs).unwrap()
    }

    fn made(surface: &Surface, parameters: &ModelParameters) -> Best {
        let monitor = Monitor::silent();
        let tiled = tile(surface, parameters, &monitor).unwrap();
        let reference = Reference::new(surface);
        best(tiled, &reference, parameters, &monitor, |_| {}).unwrap()
    }

    fn badness(start: &Start) -> f64 {
        start.distance_mean_mm * start.hausdorff_mm * (1.0 - start.radius_ratio_mean)
    }

    #[test]
    fn the_best_of_all_is_kept_and_its_seed_gives_it_alone() {
        let surface = Surface::exact(shapes::cup(80.0, 32.0, 10.0, 60), 2.0);
        let several = made(&surface, &parameters("40", "5"));
        assert_eq!(several.starts.len(), 5);
        let kept = several.tiled.facts.seed;
        let least = (several.starts.iter())
            .min_by(|a, b| badness(a).total_cmp(&badness(b)))
            .unwrap();
        assert_eq!(least.seed, kept);
        let mut one = parameters("40", "1");
        let first = made(&surface, &one);
        assert_eq!(first.starts[0], several.starts[0]);
        assert!(badness(least) < badness(&first.starts[0]));
        one.retile.seed = kept;
        let alone = made(&surface, &one);
        assert_eq!(alone.optimised.mesh, several.optimised.mesh);
    }

    #[test]
    fn the_first_start_says_why_there_is_no_model() {
        let surface = Surface::exact(shapes::torus(30.0, 1.0, 90, 12), 1.0);
        let refused = tile(&surface, &parameters("12", "3"), &Monitor::silent());
        assert!(
            matches!(refused, Err(RetileError::TooFewPoints { needed, .. }) if needed > 12),
            "{refused:?}"
        );
    }
}
