//! Makes several models of one surface and keeps the best.
//!
//! Relaxation, fit and flips converge to an arrangement close to the random starting points.
//! Arrangements of few points differ most in quality and take the least time to compute.
//!
//! 1. [`tile`] re-tiles the surface from each start, every one with its own seed.
//! 2. [`best`] optimises and measures each result and keeps the model with the smallest product of
//!    mean distance, largest distance and 1 - mean 2r/R. A product needs neither weights nor units:
//!    a figure that is a tenth worse must be balanced by another that is a tenth better.
//!
//! Guaranteed: the first start uses the given seed itself, so more starts never make the model worse
//! by that product; the seed of the model that is kept gives the same model with one start.
//! Not guaranteed: that the model is better by every single figure, or by fitness.

use crate::base::progress::{Monitor, Stage};
use crate::parameters::ModelParameters;
use crate::results::report::{self, MeasureParameters, Measures, StartSummary};
use crate::surface::Surface;
use crate::surface::optimise::{self, OptimiseError, Optimised, Reference};
use crate::surface::retile::{self, RetileError, RetileParameters, Tiled};

/// Difference between the seeds of consecutive starts: a prime, so that starts do not share seeds with
/// runs that count up, and small enough for the seeds to be exact as JSON numbers.
const NEXT_SEED: u64 = 1_000_003;

/// The model that is kept.
#[derive(Debug, Clone)]
pub struct BestStart {
    /// The re-tiled mesh before optimisation.
    pub tiled: Tiled,
    /// The optimised model.
    pub optimised: Optimised,
    /// Its measures.
    pub measures: Measures,
    /// Figures of the models of all starts, in order.
    pub starts: Vec<StartSummary>,
}

/// Re-tiles the surface from each start. Stops after the first result with a warning about the
/// surface: further starts would take long and find the same.
///
/// # Errors
/// The error of the first start. If a later one fails, it is left out and no further ones are made.
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
        let made = match retile::retile(surface, &own, &monitor.part(start, parameters.starts)) {
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

/// Optimises and measures the results of [`tile`], of which there must be at least one, and returns
/// the best. `ended` is called at the end of each stage.
///
/// # Errors
/// [`OptimiseError`] of the first start that cannot be optimised.
pub fn best(
    mut tiled: Vec<Tiled>,
    reference: &Reference,
    parameters: &ModelParameters,
    monitor: &Monitor,
    mut ended: impl FnMut(Stage),
) -> Result<BestStart, OptimiseError> {
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
        .map(|(tiled, measures)| StartSummary::new(tiled, measures))
        .collect();
    let kept = least_bad(&measures);
    Ok(BestStart {
        tiled: tiled.swap_remove(kept),
        optimised: optimised.swap_remove(kept),
        measures: measures.swap_remove(kept),
        starts,
    })
}

/// Applies `work` to every item, each of which counts as an equal part of the stage's progress.
fn each<T, U, E>(
    starts: &[T],
    monitor: &Monitor,
    work: impl Fn(&T, &Monitor) -> Result<U, E>,
) -> Result<Vec<U>, E> {
    (0..)
        .zip(starts)
        .map(|(start, it)| work(it, &monitor.part(start, starts.len())))
        .collect()
}

/// Index of the best model; models without self-intersections come first, and of equals the first.
fn least_bad(measures: &[Measures]) -> usize {
    let intersecting = |m: &Measures| m.mesh.self_intersections > 0;
    let badness = |m: &Measures| {
        m.distance.mean_mm * m.distance.hausdorff_mm * (1.0 - m.shape.radius_ratio.mean)
    };
    (0..measures.len())
        .min_by(|&a, &b| {
            let [a, b] = [a, b].map(|k| &measures[k]);
            (intersecting(a).cmp(&intersecting(b))).then(badness(a).total_cmp(&badness(b)))
        })
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    fn parameters(points: &str, starts: &str) -> ModelParameters {
        let pairs = [("points", points), ("starts", starts), ("seed", "8")];
        ModelParameters::from_pairs(pairs).unwrap()
    }

    fn made(surface: &Surface, parameters: &ModelParameters) -> BestStart {
        let monitor = Monitor::silent();
        let tiled = tile(surface, parameters, &monitor).unwrap();
        let reference = Reference::new(surface);
        best(tiled, &reference, parameters, &monitor, |_| {}).unwrap()
    }

    fn badness(start: &StartSummary) -> f64 {
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
