//! Connected components of labels, by runs.
//!
//! A run is a stretch of equal labels in a row. Runs of neighbouring rows that overlap are
//! united (union-find), so the cost follows the number of runs, not of voxels. The object is
//! 6-connected and its background 26-connected, as in the table of Marching Cubes.

use crate::base::numeric::disjoint_sets::{set_numbers, singletons, unite};
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::labels::Labels;

/// A stretch of voxels of one row, border included in the coordinates.
#[derive(Debug, Clone, Copy)]
struct Run {
    row: usize,
    start: usize,
    end: usize,
}

/// The components of the inside or the outside.
#[derive(Debug, Clone)]
pub struct Components {
    runs: Vec<Run>,
    component: Vec<usize>,
    /// Number of voxels of every component, numbered by their first voxel in array order.
    pub sizes: Vec<usize>,
}

impl Components {
    /// The 6-connected components of the inside.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn of_inside(labels: &Labels, monitor: &Monitor) -> Result<Self, Cancelled> {
        Self::build(labels, true, monitor)
    }

    /// The 26-connected components of the outside, border layer included: number 0 is the
    /// surroundings, all others are cavities.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn of_outside(labels: &Labels, monitor: &Monitor) -> Result<Self, Cancelled> {
        Self::build(labels, false, monitor)
    }

    fn build(labels: &Labels, inside: bool, monitor: &Monitor) -> Result<Self, Cancelled> {
        let [rows, planes] = labels.rows();
        let width = labels.extent[0] + 2;
        let mut runs: Vec<Run> = Vec::new();
        let mut first = Vec::with_capacity(rows * planes + 1);
        for k in 0..planes {
            monitor.check()?;
            for j in 0..rows {
                first.push(runs.len());
                push_runs(labels.row(j, k), width, inside, j + rows * k, &mut runs);
            }
        }
        first.push(runs.len());
        let mut parent = singletons(runs.len());
        let reach = usize::from(!inside);
        for k in 0..planes {
            monitor.check()?;
            for j in 0..rows {
                let here = j + rows * k;
                let mut earlier = [None; 4];
                earlier[0] = (j > 0).then(|| here - 1);
                earlier[1] = (k > 0).then(|| here - rows);
                if !inside && k > 0 {
                    earlier[2] = (j > 0).then(|| here - rows - 1);
                    earlier[3] = (j + 1 < rows).then(|| here - rows + 1);
                }
                for other in earlier.into_iter().flatten() {
                    let pair = [first[here]..first[here + 1], first[other]..first[other + 1]];
                    unite_overlapping(&runs, pair, reach, &mut parent);
                }
            }
        }
        let component: Vec<usize> = (set_numbers(&mut parent).into_iter())
            .map(|label| label as usize)
            .collect();
        monitor.check()?;
        let mut sizes = vec![0; component.iter().max().map_or(0, |c| c + 1)];
        for (run, &c) in runs.iter().zip(&component) {
            sizes[c] += run.end - run.start;
        }
        Ok(Self {
            runs,
            component,
            sizes,
        })
    }

    /// The component of the most voxels; of equals the first in array order.
    pub fn largest(&self) -> Option<usize> {
        (0..self.sizes.len()).rev().max_by_key(|&c| self.sizes[c])
    }

    /// The component of every voxel, in array order.
    pub fn of_voxels(&self) -> impl Iterator<Item = usize> + '_ {
        (self.runs.iter().zip(&self.component))
            .flat_map(|(run, &component)| std::iter::repeat_n(component, run.end - run.start))
    }

    /// The component that holds voxel `p` of the box.
    pub fn containing(&self, labels: &Labels, p: [usize; 3]) -> Option<usize> {
        let row = (p[1] + 1) + labels.rows()[0] * (p[2] + 1);
        let begin = self.runs.partition_point(|r| r.row < row);
        let end = self.runs.partition_point(|r| r.row <= row);
        (begin..end)
            .find(|&r| (self.runs[r].start..self.runs[r].end).contains(&(p[0] + 1)))
            .map(|r| self.component[r])
    }

    /// Sets the voxels of every chosen component to `inside`.
    ///
    /// # Errors
    /// [`Cancelled`], with some of the voxels set.
    pub fn paint(
        &self,
        labels: &mut Labels,
        inside: bool,
        choose: impl Fn(usize) -> bool,
        monitor: &Monitor,
    ) -> Result<(), Cancelled> {
        let rows = labels.rows()[0];
        for (run, &component) in self.runs.iter().zip(&self.component) {
            monitor.check()?;
            if choose(component) {
                for i in run.start..run.end {
                    labels.set([i - 1, run.row % rows - 1, run.row / rows - 1], inside);
                }
            }
        }
        Ok(())
    }
}

fn push_runs(row: &[u64], width: usize, inside: bool, index: usize, runs: &mut Vec<Run>) {
    let flip = if inside { 0 } else { u64::MAX };
    // The first bit at or after `from` that is (not) of the searched kind.
    let find = |from: usize, wanted: bool| {
        let mut w = from / 64;
        let mut mask = u64::MAX << (from % 64);
        while w < row.len() {
            let word = (row[w] ^ flip ^ if wanted { 0 } else { u64::MAX }) & mask;
            if word != 0 {
                return (64 * w + word.trailing_zeros() as usize).min(width);
            }
            mask = u64::MAX;
            w += 1;
        }
        width
    };
    let mut start = find(0, true);
    while start < width {
        let end = find(start, false);
        runs.push(Run {
            row: index,
            start,
            end,
        });
        start = if end < width { find(end, true) } else { width };
    }
}

fn unite_overlapping(
    runs: &[Run],
    [here, there]: [std::ops::Range<usize>; 2],
    reach: usize,
    parent: &mut [u32],
) {
    let (mut a, mut b) = (here.start, there.start);
    while a < here.end && b < there.end {
        if runs[a].start < runs[b].end + reach && runs[b].start < runs[a].end + reach {
            unite(parent, a as u32, b as u32);
        }
        if runs[a].end < runs[b].end {
            a += 1;
        } else {
            b += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::base::geometry::random::{Purpose, stream};
    use crate::image::grid::components::*;
    use rand::RngExt;

    /// Flood fill, voxel by voxel: the oracle.
    fn flood(labels: &Labels, inside: bool) -> Vec<usize> {
        let size = labels.extent.map(|e| e as i64 + 2);
        let is = |p: [i64; 3]| {
            let border = (0..3).any(|r| p[r] < 1 || p[r] > size[r] - 2);
            let label = !border && labels.get(p.map(|x| (x - 1) as usize));
            (0..3).all(|r| p[r] >= 0 && p[r] < size[r]) && label == inside
        };
        let mut seen = std::collections::BTreeSet::new();
        let mut sizes = Vec::new();
        for k in 0..size[2] {
            for j in 0..size[1] {
                for i in 0..size[0] {
                    let mut stack = vec![[i, j, k]];
                    let mut size = 0;
                    while let Some(p) = stack.pop() {
                        if !is(p) || !seen.insert(p) {
                            continue;
                        }
                        size += 1;
                        for n in 0..27i64 {
                            let d = [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1];
                            let steps: i64 = d.iter().map(|x| x.abs()).sum();
                            if !inside || steps == 1 {
                                stack.push([0, 1, 2].map(|r| p[r] + d[r]));
                            }
                        }
                    }
                    if size > 0 {
                        sizes.push(size);
                    }
                }
            }
        }
        sizes
    }

    #[test]
    fn runs_and_flood_fill_find_the_same_components() {
        let mut random = stream(7, Purpose::PhantomNoise);
        for round in 0..60 {
            let extent = [[70, 4, 3], [7, 6, 5]][usize::from(round % 5 > 0)];
            let density = 0.2 + 0.1 * f64::from(round % 7);
            let mut labels = Labels::empty([0; 3], extent);
            for n in 0..extent.iter().product::<usize>() {
                let p = [
                    n % extent[0],
                    n / extent[0] % extent[1],
                    n / extent[0] / extent[1],
                ];
                labels.set(p, random.random_bool(density));
            }
            let monitor = Monitor::silent();
            let inside = Components::of_inside(&labels, &monitor).unwrap();
            let outside = Components::of_outside(&labels, &monitor).unwrap();
            assert_eq!(inside.sizes, flood(&labels, true));
            assert_eq!(outside.sizes, flood(&labels, false));
            if let Some(c) = inside.largest() {
                let mut one = labels.clone();
                inside
                    .paint(&mut one, false, |other| other != c, &monitor)
                    .unwrap();
                assert_eq!(one.count(), inside.sizes[c]);
                let p = one.voxels().next().unwrap();
                assert_eq!(inside.containing(&labels, p), Some(c));
            }
            for (p, c) in labels.voxels().zip(inside.of_voxels()) {
                assert_eq!(inside.containing(&labels, p), Some(c));
            }
        }
    }
}
