//! Minimisation of a smooth function of many variables within bounds: limited-memory BFGS.
//!
//! In: a function that gives its value and gradient, a start, bounds for each variable. Out: the point where a step
//! gains nothing more, or where the caller's test says that enough is known. The steps:
//!
//! 1. The direction is the quasi-Newton one of the last [`MEMORY_STEPS`] steps (Nocedal and Wright, Numerical
//!    Optimization, algorithm 7.4), taken in the variables that are not held by a bound.
//! 2. The length is halved until the value falls by the condition of Armijo; each trial point is projected onto the
//!    bounds.
//!
//! Guaranteed: the value never rises; every point that the function is asked for lies within the bounds; the same
//! function and start give the same points. Not guaranteed: a global minimum.

use std::collections::VecDeque;

/// Steps whose change of gradient is remembered.
const MEMORY_STEPS: usize = 20;
/// Share of the fall that the slope promises which a step must reach.
const ARMIJO_SHARE: f64 = 1e-4;
/// Halvings of a step before the point counts as the minimum.
const MAX_HALVINGS: usize = 20;

/// The lowest point found.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimum {
    /// The variables.
    pub point: Vec<f64>,
    /// The value there.
    pub value: f64,
    /// Steps made.
    pub steps: usize,
}

/// Minimises a function from `start`, within `bounds` (least and greatest value of each variable).
///
/// `solve` multiplies by the inverse of a guess at the second derivatives, symmetric and positive definite: the better
/// the guess, the fewer the steps.
///
/// `function` writes the gradient at a point and returns the value. `done` is asked after every step with the point
/// and the number of steps; an error of either ends the search.
///
/// # Errors
/// Those of `function` and `done`.
pub fn minimise<E>(
    start: Vec<f64>,
    bounds: &[[f64; 2]],
    solve: impl Fn(&mut [f64]),
    mut function: impl FnMut(&[f64], &mut [f64]) -> Result<f64, E>,
    mut done: impl FnMut(&[f64], usize) -> Result<bool, E>,
) -> Result<Minimum, E> {
    let count = start.len();
    let mut point: Vec<f64> = (start.iter().zip(bounds))
        .map(|(x, [low, high])| x.clamp(*low, *high))
        .collect();
    let mut gradient = vec![0.0; count];
    let mut value = function(&point, &mut gradient)?;
    let mut memory: VecDeque<Step> = VecDeque::with_capacity(MEMORY_STEPS);
    let (mut trial, mut trial_gradient) = (vec![0.0; count], vec![0.0; count]);
    let mut steps = 0;
    loop {
        let held = |i: usize| {
            (point[i] <= bounds[i][0] && gradient[i] > 0.0)
                || (point[i] >= bounds[i][1] && gradient[i] < 0.0)
        };
        let free: Vec<f64> = (0..count)
            .map(|i| if held(i) { 0.0 } else { gradient[i] })
            .collect();
        let descend = |memory: &VecDeque<Step>| {
            let mut direction = descent(&free, memory, &solve);
            (0..count)
                .filter(|i| held(*i))
                .for_each(|i| direction[i] = 0.0);
            direction
        };
        let mut direction = descend(&memory);
        if dot(&direction, &free) >= 0.0 {
            memory.clear();
            direction = descend(&memory);
        }
        let mut length = 1.0;
        let mut lower = None;
        for _ in 0..MAX_HALVINGS {
            for i in 0..count {
                trial[i] = (point[i] + length * direction[i]).clamp(bounds[i][0], bounds[i][1]);
            }
            let slope: f64 = (0..count).map(|i| free[i] * (trial[i] - point[i])).sum();
            let found = function(&trial, &mut trial_gradient)?;
            if found <= value + ARMIJO_SHARE * slope && found < value {
                lower = Some(found);
                break;
            }
            length /= 2.0;
        }
        let Some(found) = lower else {
            if memory.is_empty() {
                return Ok(Minimum {
                    point,
                    value,
                    steps,
                });
            }
            memory.clear();
            continue;
        };
        let change = difference(&trial, &point);
        let turn = difference(&trial_gradient, &gradient);
        let curvature = dot(&change, &turn);
        if curvature > 1e-10 * dot(&turn, &turn).max(1e-300) {
            if memory.len() == MEMORY_STEPS {
                memory.pop_front();
            }
            let mut solved = turn.clone();
            solve(&mut solved);
            memory.push_back(Step {
                scale: curvature / dot(&turn, &solved),
                change,
                turn,
                curvature,
            });
        }
        value = found;
        std::mem::swap(&mut point, &mut trial);
        std::mem::swap(&mut gradient, &mut trial_gradient);
        steps += 1;
        if done(&point, steps)? {
            return Ok(Minimum {
                point,
                value,
                steps,
            });
        }
    }
}

/// A step and the change of the gradient over it.
struct Step {
    change: Vec<f64>,
    turn: Vec<f64>,
    curvature: f64,
    /// The guess at the second derivatives over those seen in the step.
    scale: f64,
}

fn descent(gradient: &[f64], memory: &VecDeque<Step>, solve: impl Fn(&mut [f64])) -> Vec<f64> {
    let mut direction: Vec<f64> = gradient.iter().map(|g| -g).collect();
    let mut shares = Vec::with_capacity(memory.len());
    for step in memory.iter().rev() {
        let share = dot(&step.change, &direction) / step.curvature;
        add(&mut direction, -share, &step.turn);
        shares.push(share);
    }
    solve(&mut direction);
    if let Some(last) = memory.back() {
        direction.iter_mut().for_each(|d| *d *= last.scale);
    }
    for (step, share) in memory.iter().zip(shares.into_iter().rev()) {
        let back = dot(&step.turn, &direction) / step.curvature;
        add(&mut direction, share - back, &step.change);
    }
    direction
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add(to: &mut [f64], scale: f64, what: &[f64]) {
    to.iter_mut().zip(what).for_each(|(to, x)| *to += scale * x);
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    /// Rosenbrock's valley in ten variables.
    fn valley(x: &[f64], gradient: &mut [f64]) -> Result<f64, Infallible> {
        gradient.fill(0.0);
        let mut value = 0.0;
        for i in 0..x.len() - 1 {
            let (a, b) = (x[i + 1] - x[i] * x[i], 1.0 - x[i]);
            value += 100.0 * a * a + b * b;
            gradient[i + 1] += 200.0 * a;
            gradient[i] += -400.0 * a * x[i] - 2.0 * b;
        }
        Ok(value)
    }

    /// A guess that makes the first step a small one.
    fn gentle(gradient: &mut [f64]) {
        gradient.iter_mut().for_each(|g| *g *= 1e-3);
    }

    #[test]
    fn the_valley_of_rosenbrock_is_walked_to_its_end() {
        let bounds = vec![[-5.0, 5.0]; 10];
        let start = vec![-1.2; 10];
        let found = minimise(start, &bounds, gentle, valley, |_, steps| Ok(steps >= 500)).unwrap();
        assert!(found.steps < 500, "{}", found.steps);
        for x in found.point {
            assert!((x - 1.0).abs() < 1e-4, "{x}");
        }
    }

    /// With x[0] <= 0.5 the others are those of the valley cut there: compared with a search over the free ones.
    #[test]
    fn bounds_hold_and_the_free_variables_are_at_their_minimum() {
        let mut bounds = vec![[-5.0, 5.0]; 4];
        bounds[0] = [-5.0, 0.5];
        let mut inside = true;
        let found = minimise(
            vec![-1.2; 4],
            &bounds,
            gentle,
            |x, g| {
                inside &= x[0] <= 0.5;
                valley(x, g)
            },
            |_, steps| Ok(steps >= 500),
        )
        .unwrap();
        assert!(inside && (found.point[0] - 0.5).abs() < 1e-9);
        let mut gradient = vec![0.0; 4];
        valley(&found.point, &mut gradient).unwrap();
        assert!(gradient[0] < 0.0);
        assert!(gradient[1..].iter().all(|g| g.abs() < 1e-3), "{gradient:?}");
    }
}
