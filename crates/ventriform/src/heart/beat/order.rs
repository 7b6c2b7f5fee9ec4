//! Whether gates follow each other as moments of one beat do.
//!
//! Of all orders of the gates about the cycle, that of a beat is one of the smoothest: neighbours differ least. In:
//! the gates about the heart. Out: the share of orders that are at least as smooth as the one given, which is uniform
//! between 0 and 1 where gates are shuffled or show nothing but noise.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;

/// Orders that are tried at random.
const RANDOM_ORDERS: usize = 2000;
const ORDER_SEED: u64 = 1;

/// The share of orders that are as smooth as the given one, itself included; 1 where all gates are equal.
pub(super) fn share_as_smooth(images: &[Vec<f32>], weights: &[f32]) -> f64 {
    let count = images.len();
    let distance = |a: usize, b: usize| -> f64 {
        (images[a].iter().zip(&images[b]).zip(weights))
            .map(|((a, b), w)| f64::from(w * (a - b) * (a - b)))
            .sum()
    };
    let distances: Vec<Vec<f64>> = (0..count)
        .map(|a| (0..count).map(|b| distance(a, b)).collect())
        .collect();
    let length = |order: &[usize]| -> f64 {
        let next = order.iter().cycle().skip(1);
        order.iter().zip(next).map(|(a, b)| distances[*a][*b]).sum()
    };
    let mut order: Vec<usize> = (0..count).collect();
    let given = length(&order);
    let mut random = Pcg64Mcg::seed_from_u64(ORDER_SEED);
    let as_smooth = (0..RANDOM_ORDERS)
        .filter(|_| {
            order[1..].shuffle(&mut random);
            // Rounding does not tell equal orders apart.
            length(&order) <= given * (1.0 + 1e-9)
        })
        .count();
    (as_smooth + 1) as f64 / (RANDOM_ORDERS + 1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eight gates of a bar that moves to and fro.
    fn beat() -> Vec<Vec<f32>> {
        (0..8)
            .map(|gate| {
                let middle = 20.0 + 6.0 * (std::f32::consts::TAU * gate as f32 / 8.0).cos();
                (0..40)
                    .map(|x| (-(x as f32 - middle).powi(2) / 18.0).exp())
                    .collect()
            })
            .collect()
    }

    #[test]
    fn the_order_of_a_beat_is_among_the_smoothest_wherever_it_begins() {
        let mut gates = beat();
        let weights = vec![1.0; 40];
        for _ in 0..8 {
            assert!(share_as_smooth(&gates, &weights) < 0.02);
            gates.rotate_left(3);
        }
    }

    #[test]
    fn shuffled_and_repeated_gates_are_no_beat() {
        let gates = beat();
        let weights = vec![1.0; 40];
        let shuffled: Vec<_> = [0, 4, 1, 6, 2, 7, 3, 5].map(|n| gates[n].clone()).into();
        assert!(share_as_smooth(&shuffled, &weights) > 0.2);
        assert_eq!(share_as_smooth(&vec![gates[0].clone(); 8], &weights), 1.0);
    }
}
