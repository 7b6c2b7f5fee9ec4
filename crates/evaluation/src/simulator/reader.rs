//! Masks of the wall: the true one, how it looks in a blurred image, and what a reader draws.
//!
//! A reader's border lies off by a smooth random distance. Drawn on the anatomy it starts at the true wall, drawn on
//! the image at its local half maximum.

use super::anatomy::Place;
use super::grid::Grid;
use super::parameters::Observer;
use super::random::{Draws, Stream};
use rayon::prelude::*;

/// Radius in which the local maximum is looked for, mm.
const NEIGHBOURHOOD_MM: f64 = 12.0;
/// Share of the local maximum at the apparent edge.
const LOCAL_LEVEL: f32 = 0.5;
/// Least share of the largest value at the apparent edge.
const LEAST_LEVEL: f32 = 0.25;
/// Points for a voxel, along an axis, on which distances are measured.
const FINER: usize = 3;

/// Masks on the voxels of an image, 0 and 1.
pub struct Masks {
    /// Voxels of which at least half is wall.
    pub truth: Grid,
    /// Voxels of which at least half is cavity, and not wall.
    pub cavity: Grid,
    /// The wall as it looks in the image of the wall alone.
    pub apparent: Grid,
    /// What a reader draws who knows the anatomy.
    pub expert: Grid,
    /// What a reader draws on the image.
    pub expert_on_image: Grid,
}

/// The masks of a wall. `wall` and `cavity` are shares of the voxels, `alone` the image of the wall alone.
pub fn masks(
    [wall, cavity]: &[Grid; 2],
    alone: &Grid,
    place: &Place,
    observer: &Observer,
    seed: u64,
) -> Masks {
    let voxel = place.step_mm;
    let half = |grid: &Grid| mask(grid, |v| v >= 0.5);
    let whole = half(wall);
    let mut cavity = half(cavity);
    for (cavity, wall) in cavity.values.iter_mut().zip(&whole.values) {
        *cavity *= 1.0 - wall;
    }
    let deviation = deviation(place.shape, voxel, observer, seed);
    let drawn = |level: &Grid| {
        let distance = signed_distance(level, voxel);
        let values = distance
            .values
            .iter()
            .zip(&deviation.values)
            .map(|(d, e)| d + e);
        let moved = Grid {
            shape: distance.shape,
            values: values.collect(),
        };
        largest_part(&mask(&moved, |v| v > 0.0))
    };
    let level = apparent_level(alone, voxel);
    let shifted = Grid {
        shape: wall.shape,
        values: wall.values.iter().map(|v| v - 0.5).collect(),
    };
    Masks {
        truth: largest_part(&whole),
        cavity,
        apparent: largest_part(&mask(&level, |v| v >= 0.0)),
        expert: drawn(&shifted),
        expert_on_image: drawn(&level),
    }
}

fn mask(grid: &Grid, inside: impl Fn(f32) -> bool) -> Grid {
    let values = grid
        .values
        .iter()
        .map(|v| f32::from(u8::from(inside(*v))))
        .collect();
    Grid {
        shape: grid.shape,
        values,
    }
}

/// How far a reader's border lies outside, mm.
fn deviation(shape: [usize; 3], voxel: f64, observer: &Observer, seed: u64) -> Grid {
    let mut draws = Draws::new(seed, Stream::Reader);
    let count = shape.iter().product();
    let values = (0..count).map(|_| draws.normal(0.0, 1.0) as f32).collect();
    let mut noise = Grid { shape, values };
    noise.blur([observer.corr_mm / voxel; 3]);
    let squares: f64 = noise.values.iter().map(|v| f64::from(*v).powi(2)).sum();
    let scale = observer.sd_mm / (squares / count as f64).sqrt();
    for value in &mut noise.values {
        *value = (scale * f64::from(*value) + observer.bias_mm) as f32;
    }
    noise
}

/// 0 or more inside of the apparent edge.
fn apparent_level(image: &Grid, voxel: f64) -> Grid {
    let reach = (NEIGHBOURHOOD_MM / voxel).ceil() as isize;
    let within = |v: [isize; 3]| {
        v.iter().map(|d| (*d as f64 * voxel).powi(2)).sum::<f64>() <= NEIGHBOURHOOD_MM.powi(2)
    };
    // The chord along z at each distance across.
    let mut chords = Vec::new();
    for x in -reach..=reach {
        for y in -reach..=reach {
            if let Some(half) = (0..=reach).rev().find(|z| within([x, y, *z])) {
                chords.push([x, y, half]);
            }
        }
    }
    let top = image.max();
    let [nx, ny, nz] = image.shape;
    Grid::from_fn(image.shape, |[x, y, z]| {
        let value = image.at([x, y, z]);
        if value < LEAST_LEVEL * top {
            return value / top - LEAST_LEVEL;
        }
        let near = chords.iter().filter_map(|[dx, dy, half]| {
            let x = usize::try_from(x as isize + dx).ok().filter(|x| *x < nx)?;
            let y = usize::try_from(y as isize + dy).ok().filter(|y| *y < ny)?;
            let (half, z) = (*half as usize, z);
            let column = &image.column(x, y)[z.saturating_sub(half)..(z + half + 1).min(nz)];
            column.iter().copied().reduce(f32::max)
        });
        let local = near.fold(0.0, f32::max);
        (value / local - LOCAL_LEVEL).min(value / top - LEAST_LEVEL)
    })
}

/// Distance of each voxel to where `level` is 0, mm, positive inside.
fn signed_distance(level: &Grid, voxel: f64) -> Grid {
    let [low, shape] = box_about(level);
    let part = level.part(low, shape);
    let fine = shape.map(|n| n * FINER);
    let at = |i: usize| (i as f64 + 0.5) / FINER as f64 - 0.5;
    let inside: Vec<bool> = {
        let values = Grid::from_fn(fine, |p| part.between(p.map(at)));
        values.values.iter().map(|v| *v >= 0.0).collect()
    };
    let to_outside = squared_distances(fine, |i| !inside[i]);
    let to_inside = squared_distances(fine, |i| inside[i]);
    let mut signed = Grid {
        shape: fine,
        values: (to_outside.iter().zip(&to_inside))
            .map(|(o, i)| o.sqrt() - i.sqrt())
            .collect(),
    };
    signed.blur([1.0; 3]);
    let far = -20.0;
    let mut distance = Grid::zeros(level.shape);
    distance.values.fill(far);
    let middle = FINER / 2;
    let scale = (voxel / FINER as f64) as f32;
    let coarse = Grid::from_fn(shape, |p| scale * signed.at(p.map(|i| i * FINER + middle)));
    distance.put(low, &coarse);
    distance
}

/// First voxel and size of the box about what is inside, with room for a reader's errors.
fn box_about(level: &Grid) -> [[usize; 3]; 2] {
    const ROOM: usize = 6;
    let [nx, ny, nz] = level.shape;
    let (mut low, mut high) = ([nx, ny, nz], [0; 3]);
    for (at, value) in level.values.iter().enumerate() {
        if *value >= 0.0 {
            let place = [at / (ny * nz), at / nz % ny, at % nz];
            for i in 0..3 {
                low[i] = low[i].min(place[i]);
                high[i] = high[i].max(place[i]);
            }
        }
    }
    let low = low.map(|l| l.saturating_sub(ROOM));
    let shape = [0, 1, 2].map(|i| {
        (high[i] + ROOM + 1)
            .min(level.shape[i])
            .saturating_sub(low[i])
    });
    [low, shape.map(|n| n.max(1))]
}

/// Squared distance of each place to the nearest that is wanted, in steps (Felzenszwalb and Huttenlocher 2012).
fn squared_distances(shape: [usize; 3], wanted: impl Fn(usize) -> bool) -> Vec<f32> {
    const FAR: f32 = 1e12;
    let count: usize = shape.iter().product();
    let mut values: Vec<f32> = (0..count)
        .map(|i| if wanted(i) { 0.0 } else { FAR })
        .collect();
    for axis in 0..3 {
        let inner: usize = shape[axis + 1..].iter().product();
        let length = shape[axis];
        values.par_chunks_mut(length * inner).for_each(|block| {
            let mut line = vec![0.0; length];
            for offset in 0..inner {
                for k in 0..length {
                    line[k] = block[k * inner + offset];
                }
                for (k, value) in lower_envelope(&line).into_iter().enumerate() {
                    block[k * inner + offset] = value;
                }
            }
        });
    }
    values
}

/// At each place the least of the parabolas over all places.
fn lower_envelope(heights: &[f32]) -> Vec<f32> {
    let meet = |p: usize, q: usize| {
        let [p2, q2] = [p * p, q * q].map(|n| n as f32);
        (heights[q] + q2 - heights[p] - p2) / (2.0 * (q as f32 - p as f32))
    };
    let (mut tops, mut from) = (vec![0_usize], vec![f32::NEG_INFINITY]);
    for q in 1..heights.len() {
        while let (Some(p), Some(start)) = (tops.last(), from.last()) {
            if meet(*p, q) > *start {
                break;
            }
            tops.pop();
            from.pop();
        }
        from.push(tops.last().map_or(f32::NEG_INFINITY, |p| meet(*p, q)));
        tops.push(q);
    }
    let mut k = 0;
    (0..heights.len())
        .map(|at| {
            while k + 1 < tops.len() && from[k + 1] < at as f32 {
                k += 1;
            }
            let off = at as f32 - tops[k] as f32;
            off * off + heights[tops[k]]
        })
        .collect()
}

/// The largest part of a mask whose voxels touch by faces.
fn largest_part(mask: &Grid) -> Grid {
    let [_, ny, nz] = mask.shape;
    let mut part = vec![0_u32; mask.values.len()];
    let mut sizes = vec![0_usize];
    let mut open = Vec::new();
    for start in 0..part.len() {
        if mask.values[start] == 0.0 || part[start] != 0 {
            continue;
        }
        let name = sizes.len() as u32;
        sizes.push(0);
        part[start] = name;
        open.push(start);
        while let Some(at) = open.pop() {
            sizes[name as usize] += 1;
            let place = [at / (ny * nz), at / nz % ny, at % nz];
            for (axis, step) in [(0, ny * nz), (1, nz), (2, 1)] {
                let below = (place[axis] > 0).then(|| at - step);
                let above = (place[axis] + 1 < mask.shape[axis]).then(|| at + step);
                for next in below.into_iter().chain(above) {
                    if mask.values[next] != 0.0 && part[next] == 0 {
                        part[next] = name;
                        open.push(next);
                    }
                }
            }
        }
    }
    let largest = (1..sizes.len())
        .max_by_key(|name| sizes[*name])
        .unwrap_or(0) as u32;
    let values = part
        .iter()
        .map(|p| f32::from(u8::from(*p != 0 && *p == largest)))
        .collect();
    Grid {
        shape: mask.shape,
        values,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulator::anatomy::Vec3;

    fn ball(count: usize, radius: f64) -> Grid {
        let middle = 0.5 * (count - 1) as f64;
        Grid::from_fn([count; 3], |at| {
            let off: f64 = at.map(|i| (i as f64 - middle).powi(2)).iter().sum();
            (radius - off.sqrt()) as f32
        })
    }

    #[test]
    fn distances_are_those_of_brute_force() {
        let shape = [9, 7, 8];
        let wanted = |i: usize| i % 53 == 11 || i == 500;
        let found = squared_distances(shape, wanted);
        let place = |i: usize| [i / 56, i / 8 % 7, i % 8];
        for at in 0..found.len() {
            let all = (0..found.len()).filter(|i| wanted(*i)).map(|i| {
                let (a, b) = (place(at), place(i));
                (0..3)
                    .map(|k| (a[k] as f32 - b[k] as f32).powi(2))
                    .sum::<f32>()
            });
            assert_eq!(found[at], all.fold(f32::MAX, f32::min), "{at}");
        }
    }

    #[test]
    fn the_signed_distance_of_a_ball_is_that_to_its_surface() {
        let level = ball(30, 9.0);
        let distance = signed_distance(&level, 2.0);
        for place in [[15, 15, 7], [15, 22, 15], [15, 15, 11], [4, 15, 15]] {
            let known = 2.0 * level.at(place);
            assert!((distance.at(place) - known).abs() < 0.8, "{place:?}");
        }
    }

    #[test]
    fn a_reader_without_errors_draws_the_true_wall() {
        let wall = Grid::from_fn([30; 3], |at| (0.5 + ball(30, 9.0).at(at)).clamp(0.0, 1.0));
        let place = Place {
            origin: Vec3::zeros(),
            step_mm: 4.0,
            shape: [30; 3],
        };
        let exact = Observer {
            sd_mm: 0.0,
            corr_mm: 10.0,
            bias_mm: 0.0,
        };
        let made = masks(
            &[wall.clone(), Grid::zeros([30; 3])],
            &wall,
            &place,
            &exact,
            1,
        );
        let apart = |a: &Grid, b: &Grid| {
            let pairs = a.values.iter().zip(&b.values);
            pairs.filter(|(a, b)| a != b).count() as f64 / a.sum()
        };
        assert!(apart(&made.truth, &made.expert) < 0.05);
        assert!(made.truth.sum() > 2500.0);
    }

    #[test]
    fn the_largest_part_is_kept_alone() {
        let mask = Grid::from_fn([10; 3], |[x, y, z]| {
            f32::from(u8::from(
                (x < 4 && y < 4 && z < 4) || (x > 6 && y > 6 && z > 6),
            ))
        });
        assert_eq!(largest_part(&mask).sum(), 64.0);
    }
}
