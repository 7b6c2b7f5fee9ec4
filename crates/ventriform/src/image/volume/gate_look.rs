//! Whether volumes that are taken for gates look like gates of one heart beat, and which of them are none.
//!
//! In: a file of several volumes, and what calls them gates ([`CalledBy`]). Out: the volumes that are left out, and,
//! unless the header or the caller calls them gates, why they are none. Steps, on means over blocks of about
//! [`BLOCK_MM`], each volume scaled to equal counts:
//!
//! 1. A volume that is the sum or the mean of the others, or has far more counts than a gate, is no gate. One that
//!    repeats another voxel by voxel tells nothing of its own.
//! 2. Each of the others must show the heart where the rest do (the correlation with their mean), have counts like
//!    them, and not fall into groups: distances between the groups that are beyond all distances within them. A heart
//!    that beats passes through all shapes between its extremes; scans at rest and under stress, or with and without
//!    attenuation correction, do not.
//! 3. What nothing but its number calls gates is summed only if it shows a heart that beats
//!    ([`beat_evidence`](super::beat_evidence)), or if all volumes are equal, whose sum is any of them.
//!
//! Guaranteed: volumes that their header calls gates are never refused here. Not guaranteed: that volumes are moments
//! of one beat; a fit tells ([`crate::heart::beat`]).
//!
//! The bounds are those of `scripts/measure/gate_look.py`, which measures simulated beats, hearts of several people and
//! reconstructions of scans.

use super::beat_evidence::{Blocks, Course};
use super::gate_names::NamesSay;
use super::left_out::LeftOut;
use super::open::OpenVolume;
use super::{Volume, VolumeError};
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::gates::GATE_COUNTS;

/// Edge of a block, mm.
const BLOCK_MM: f64 = 18.0;
/// Most blocks along an axis.
const MOST_BLOCKS: usize = 24;
/// The same of the blocks in which a beat is looked for.
const FINE_BLOCK_MM: f64 = 9.0;
const MOST_FINE_BLOCKS: usize = 80;
/// Gates into which studies are usually divided.
const USUAL_GATES: [usize; 7] = [8, 10, 12, 16, 20, 24, 32];
/// Counts, as a multiple of those of a usual gate, beyond which a volume is more than a gate.
const MOST_COUNTS: f64 = 1.5;
/// Share of its counts whose loss makes a volume unlike a gate.
const COUNT_LOSS_SHARE: f64 = 0.3;
/// Share of the volumes that may lack so many counts.
const LOSING_SHARE: f64 = 0.25;
/// Share of the volumes that may repeat others.
const REPEATING_SHARE: f64 = 0.25;
/// Squared distance from the mean of the others, as a share of the usual one of a gate, below which a volume is their
/// mean.
const MEAN_DISTANCE: f64 = 0.005;
/// The same for the first or the last volume, where only without it their number is usual.
const MEAN_DISTANCE_AT_END: f64 = 0.25;
/// Least correlation of a gate with the mean of the others.
const LEAST_CORRELATION: f64 = 0.85;
/// Squared distance between groups, as a multiple of the largest within one, from which on volumes are no beat.
const GROUPS_APART: f64 = 2.0;
/// Least squared distance of noisy volumes, as a share of the usual step.
const NOISE_STEP: f64 = 0.03;
/// Squared distance, as a share of the squared contrast of the image, up to which groups are of equal images: 2 % of
/// it.
const ALIKE_DISTANCE: f64 = 3e-4;
/// The same up to which images are equal but for their scale and the rounding of their values: 1 %.
const EQUAL_DISTANCE: f64 = 1e-4;

/// What calls the volumes of a file gates.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum CalledBy {
    /// Their header or the caller.
    Header,
    /// The names of their files, or a time that fits a beat.
    Word,
    /// Nothing but their number.
    Number,
    /// Nothing, and the names of their files have this word for something else.
    Others(&'static str),
}

/// What was seen in the volumes of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct GateLook {
    pub left_out: LeftOut,
    /// What was left out, and why.
    pub warnings: Vec<String>,
    /// Why the volumes are no gates of one beat.
    pub refusal: Option<String>,
}

/// What calls the volumes of `file` gates.
pub(super) fn called_by(file: &dyn OpenVolume) -> CalledBy {
    if !file.assumes_gates() {
        return CalledBy::Header;
    }
    let timing = file.gate_timings().into_iter().next().unwrap_or_default();
    match file.names_say() {
        NamesSay::Others(word) => CalledBy::Others(word),
        NamesSay::Gates => CalledBy::Word,
        NamesSay::Nothing if timing.rr_of(file.header().frames).is_some() => CalledBy::Word,
        NamesSay::Nothing => CalledBy::Number,
    }
}

/// Looks at the volumes of `file`, which are taken for gates.
///
/// # Errors
/// [`VolumeError`] if a volume cannot be decoded.
pub(super) fn look(
    file: &mut dyn OpenVolume,
    called: &CalledBy,
    monitor: &Monitor,
) -> Result<GateLook, VolumeError> {
    let frames = file.header().frames;
    let timing = file.gate_timings().into_iter().next().unwrap_or_default();
    let stated = *called == CalledBy::Header;
    if !stated && frames < *GATE_COUNTS.start() {
        return Ok(refused(format!(
            "nothing in the file calls the {frames} volumes gates, and they are fewer than the {} of a beat",
            GATE_COUNTS.start()
        )));
    }
    if let CalledBy::Others(word) = called {
        return Ok(refused(format!(
            "the names of the files say that they are something else (\"{word}\")"
        )));
    }
    // Several R-R intervals are compared by their counts elsewhere.
    let several = timing.gates_of_interval(frames) < frames;
    if several || !GATE_COUNTS.contains(&frames) {
        return Ok(GateLook::default());
    }
    let fine = *called == CalledBy::Number;
    let images = Images::new(file, fine, monitor)?;
    Ok(images.judged(stated, monitor)?)
}

/// Looks at the volumes of files that were read one by one, which the caller calls gates.
///
/// # Errors
/// [`Cancelled`].
pub(super) fn look_at(volumes: &[&Volume], monitor: &Monitor) -> Result<GateLook, Cancelled> {
    let alike = volumes
        .iter()
        .all(|volume| volume.shape == volumes[0].shape);
    if !alike || !GATE_COUNTS.contains(&volumes.len()) {
        return Ok(GateLook::default());
    }
    let grid = Grid {
        shape: volumes[0].shape,
        spacing_mm: volumes[0].frame.spacing(),
    };
    let mut images = Images::empty(grid, volumes.len(), false);
    for volume in volumes {
        monitor.check()?;
        images.add(|take| {
            take(0, &volume.voxels);
            Ok::<(), Cancelled>(())
        })?;
    }
    images.judged(true, monitor)
}

fn refused(why: String) -> GateLook {
    GateLook {
        refusal: Some(why),
        ..GateLook::default()
    }
}

/// The volumes of a file in finer blocks.
struct Fine {
    raster: Raster,
    /// For each volume its blocks, scaled to a sum of 1.
    blocks: Vec<Vec<f32>>,
    /// Size of a block.
    spacing_mm: [f64; 3],
}

/// Voxels along each axis and their size.
#[derive(Clone, Copy)]
struct Grid {
    shape: [usize; 3],
    spacing_mm: [f64; 3],
}

/// How voxels of a volume make up blocks.
struct Raster {
    /// Voxels of a volume along each axis.
    shape: [usize; 3],
    /// Voxels of a block.
    edges: [usize; 3],
    /// Blocks.
    along: [usize; 3],
}

impl Raster {
    /// Blocks of about `block_mm`, at most `most` along an axis.
    fn new(grid: Grid, block_mm: f64, most: usize) -> Self {
        let Grid { shape, spacing_mm } = grid;
        let edge = |axis: usize| {
            let edge = (block_mm / spacing_mm[axis]).round();
            let least = shape[axis].div_ceil(most);
            (edge.clamp(1.0, shape[axis] as f64) as usize).max(least)
        };
        let edges = [0, 1, 2].map(edge);
        Self {
            shape,
            edges,
            along: [0, 1, 2].map(|axis| shape[axis].div_ceil(edges[axis])),
        }
    }

    fn empty(&self) -> Vec<f64> {
        vec![0.0; self.along.iter().product()]
    }

    /// Adds voxels of one row from number `at` of the volume on to the `sums` of the blocks.
    fn add(&self, sums: &mut [f64], at: usize, row: &[f32]) {
        let (i, line) = (at % self.shape[0], at / self.shape[0]);
        let (j, k) = (line % self.shape[1], line / self.shape[1]);
        let [ei, ej, ek] = self.edges;
        let begin = ((k / ek) * self.along[1] + j / ej) * self.along[0];
        for (offset, value) in row.iter().enumerate() {
            if value.is_finite() {
                sums[begin + (i + offset) / ei] += f64::from(*value);
            }
        }
    }
}

/// The volumes of a file, coarsely.
struct Images {
    raster: Raster,
    /// For each volume the means of its blocks, scaled to a sum of 1.
    blocks: Vec<Vec<f32>>,
    /// The same in finer blocks, if a beat is looked for.
    fine: Option<Fine>,
    /// The sum of each volume's voxels.
    counts: Vec<f64>,
    /// A hash over the voxels of each volume.
    hashes: Vec<u64>,
}

impl Images {
    /// The volumes of `file`, in finer blocks too if `fine`.
    fn new(file: &mut dyn OpenVolume, fine: bool, monitor: &Monitor) -> Result<Self, VolumeError> {
        let header = file.header();
        let frames = header.frames;
        let grid = Grid {
            shape: header.shape,
            spacing_mm: header.placement.frame.spacing(),
        };
        let mut images = Self::empty(grid, frames, fine);
        for frame in 0..frames {
            let part = monitor.part(frame, frames);
            images.add(|take| file.stream_coarse(frame, take, &part))?;
        }
        Ok(images)
    }

    /// No volumes yet of so many on that grid.
    fn empty(grid: Grid, frames: usize, fine: bool) -> Self {
        Self {
            raster: Raster::new(grid, BLOCK_MM, MOST_BLOCKS),
            blocks: Vec::with_capacity(frames),
            fine: fine.then(|| {
                let raster = Raster::new(grid, FINE_BLOCK_MM, MOST_FINE_BLOCKS);
                let edge_mm = |axis: usize| grid.spacing_mm[axis] * raster.edges[axis] as f64;
                Fine {
                    spacing_mm: [0, 1, 2].map(edge_mm),
                    blocks: Vec::with_capacity(frames),
                    raster,
                }
            }),
            counts: Vec::with_capacity(frames),
            hashes: Vec::with_capacity(frames),
        }
    }

    /// Adds the next volume, whose voxels `stream` gives in portions, each with the number of its first voxel.
    fn add<E>(
        &mut self,
        stream: impl FnOnce(&mut dyn FnMut(usize, &[f32])) -> Result<(), E>,
    ) -> Result<(), E> {
        let raster = &self.raster;
        let finer = self.fine.as_ref().map(|fine| &fine.raster);
        let mut sums = raster.empty();
        let mut fine_sums = finer.map(Raster::empty).unwrap_or_default();
        let mut hash = 0_u64;
        let mut take = |first: usize, voxels: &[f32]| {
            let (mut at, mut rest) = (first, voxels);
            while !rest.is_empty() {
                let row = raster.shape[0] - at % raster.shape[0];
                let (part, next) = rest.split_at(row.min(rest.len()));
                for (offset, value) in part.iter().enumerate() {
                    hash = hash.wrapping_add(mixed((at + offset) as u64, value.to_bits()));
                }
                raster.add(&mut sums, at, part);
                if let Some(finer) = finer {
                    finer.add(&mut fine_sums, at, part);
                }
                (at, rest) = (at + part.len(), next);
            }
        };
        stream(&mut take)?;
        let counts: f64 = sums.iter().sum();
        let scaled = |sums: &[f64]| sums.iter().map(|sum| (sum / counts) as f32).collect();
        self.blocks.push(scaled(&sums));
        if let Some(fine) = &mut self.fine {
            fine.blocks.push(scaled(&fine_sums));
        }
        self.counts.push(counts);
        self.hashes.push(hash);
        Ok(())
    }

    /// The usual counts of a gate: the median of the upper half, since gates at the end of a beat lose counts.
    fn usual_counts(&self) -> f64 {
        let mut sorted = self.counts.clone();
        sorted.sort_by(f64::total_cmp);
        let upper = &sorted[sorted.len() / 2..];
        f64::midpoint(upper[(upper.len() - 1) / 2], upper[upper.len() / 2])
    }

    fn judged(&self, stated: bool, monitor: &Monitor) -> Result<GateLook, Cancelled> {
        let mut look = GateLook::default();
        let usual = self.usual_counts();
        // Values about 0 are no counts, and have no scale to compare them by.
        if !(usual > 0.0) || self.counts.iter().any(|counts| !(*counts > 0.0)) {
            if self.fine.is_some() {
                look.refusal = Some(
                    "nothing in the file calls them gates, and their values are about 0, which counts are not".into(),
                );
            }
            return Ok(look);
        }
        self.leave_out_sums(usual, &mut look);
        self.leave_out_repeats(&mut look);
        self.leave_out_rich(usual, &mut look);
        if !stated {
            look.refusal = self.refusal(usual, &look);
        }
        if look.refusal.is_none() {
            look.refusal = self.no_beat(&look, monitor)?;
        }
        Ok(look)
    }

    /// Why volumes that nothing calls gates are none, although nothing speaks against it: they show no heart that
    /// beats.
    fn no_beat(&self, look: &GateLook, monitor: &Monitor) -> Result<Option<String>, Cancelled> {
        let kept = self.kept(look);
        let Some(fine) = &self.fine else {
            return Ok(None);
        };
        if mean_apart(&self.distances(&kept)) <= EQUAL_DISTANCE {
            return Ok(None);
        }
        let blocks = Blocks {
            volumes: kept.iter().map(|n| &*fine.blocks[*n]).collect(),
            shape: fine.raster.along,
            spacing_mm: fine.spacing_mm,
        };
        let course = Course::from_blocks(&blocks, monitor)?;
        Ok(match course {
            Some(course) if course.is_beat() => None,
            Some(course) => Some(format!(
                "nothing in the file calls them gates, and in their order they show no heart that beats: {}",
                course.text()
            )),
            None => Some(
                "nothing in the file calls them gates, and they show no heart that beats".into(),
            ),
        })
    }

    fn all(&self) -> std::ops::Range<usize> {
        0..self.counts.len()
    }

    fn kept(&self, look: &GateLook) -> Vec<usize> {
        self.all().filter(|n| !look.left_out.has(*n)).collect()
    }

    /// The mean of the blocks of `volumes` without `but`.
    fn mean(&self, volumes: &[usize], but: Option<usize>) -> Vec<f64> {
        let mut mean = vec![0.0; self.blocks[0].len()];
        let others = volumes.iter().filter(|n| Some(**n) != but);
        let mut count = 0.0;
        for n in others {
            count += 1.0;
            for (mean, block) in mean.iter_mut().zip(&self.blocks[*n]) {
                *mean += f64::from(*block);
            }
        }
        mean.iter_mut().for_each(|mean| *mean /= count);
        mean
    }

    /// Leaves out volumes that are the sum or the mean of the others.
    fn leave_out_sums(&self, usual: f64, look: &mut GateLook) {
        loop {
            let kept = self.kept(look);
            if kept.len() <= *GATE_COUNTS.start() {
                return;
            }
            let from_others = |n: &usize| {
                let mean = self.mean(&kept, Some(*n));
                let pairs = mean.iter().zip(&self.blocks[*n]);
                pairs.map(|(a, b)| (a - f64::from(*b)).powi(2)).sum::<f64>()
            };
            let distances: Vec<f64> = kept.iter().map(from_others).collect();
            let mut sorted = distances.clone();
            sorted.sort_by(f64::total_cmp);
            let median = sorted[sorted.len() / 2];
            let odd = USUAL_GATES.contains(&(kept.len() - 1)) && !USUAL_GATES.contains(&kept.len());
            let is_mean = |at: &usize| {
                let at_end = *at == 0 || at + 1 == kept.len();
                let bound = match odd && at_end {
                    true => MEAN_DISTANCE_AT_END,
                    false => MEAN_DISTANCE,
                };
                distances[*at] < bound * median
            };
            let all = (0..kept.len()).filter(is_mean);
            let Some(at) = all.min_by(|a, b| distances[*a].total_cmp(&distances[*b])) else {
                return;
            };
            let frame = kept[at];
            let what = match self.counts[frame] > MOST_COUNTS * usual {
                true => "sum",
                false => "mean",
            };
            look.left_out.extra.push(frame);
            look.warnings.push(format!(
                "Volume {frame} (counted from 0) is the {what} of the others and no gate: it was left out."
            ));
        }
    }

    /// Leaves out volumes that repeat others voxel by voxel, where they are few.
    fn leave_out_repeats(&self, look: &mut GateLook) {
        let kept = self.kept(look);
        let first_of = |at: usize| {
            let mut before = kept[..at].iter();
            before.find(|n| self.hashes[**n] == self.hashes[kept[at]])
        };
        let mut repeats: Vec<(usize, usize)> = (0..kept.len())
            .filter_map(|at| Some((kept[at], *first_of(at)?)))
            .collect();
        let rest = kept.len() - repeats.len();
        // Many equal volumes are no mistake of one, but a heart that stands still.
        let few = repeats.len() as f64 <= REPEATING_SHARE * kept.len() as f64;
        if repeats.is_empty() || !few || rest < *GATE_COUNTS.start() {
            return;
        }
        let odd = USUAL_GATES.contains(&rest) && !USUAL_GATES.contains(&kept.len());
        let ends_the_file = |frame: usize| odd && Some(&frame) == kept.last();
        // A motion to and fro without noise shows the same twice.
        if !is_noisy(&self.distances(&kept)) {
            repeats.retain(|(frame, _)| ends_the_file(*frame));
        }
        for (frame, first) in repeats {
            match ends_the_file(frame) {
                true => look.left_out.extra.push(frame),
                false => look.left_out.lost.push(frame),
            }
            look.warnings.push(format!(
                "Volume {frame} (counted from 0) repeats volume {first}: it was left out."
            ));
        }
    }

    /// Leaves out volumes that have far more counts than a gate.
    fn leave_out_rich(&self, usual: f64, look: &mut GateLook) {
        for frame in self.kept(look) {
            let times = self.counts[frame] / usual;
            if times <= MOST_COUNTS || self.kept(look).len() <= *GATE_COUNTS.start() {
                continue;
            }
            let number = self.kept(look).len();
            let odd = USUAL_GATES.contains(&(number - 1)) && !USUAL_GATES.contains(&number);
            match odd {
                true => look.left_out.extra.push(frame),
                false => look.left_out.lost.push(frame),
            }
            look.warnings.push(format!(
                "Volume {frame} (counted from 0) has {times:.1} times the counts of a gate: it was left out."
            ));
        }
    }

    /// Why the volumes that are left are no gates of one beat.
    fn refusal(&self, usual: f64, look: &GateLook) -> Option<String> {
        let kept = self.kept(look);
        let loses = |n: &&usize| self.counts[**n] < (1.0 - COUNT_LOSS_SHARE) * usual;
        let losing = kept.iter().filter(loses).count();
        if losing as f64 > LOSING_SHARE * kept.len() as f64 {
            return Some(format!(
                "nothing in the file calls them gates, and {losing} of them have less than {:.0} % of the counts of \
                 the others",
                100.0 * (1.0 - COUNT_LOSS_SHARE)
            ));
        }
        let alike = kept.iter().map(|n| {
            let mean = self.mean(&kept, Some(*n));
            (*n, correlation(&mean, &self.blocks[*n]))
        });
        let worst = alike.min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((frame, r)) = worst.filter(|(_, r)| !(*r >= LEAST_CORRELATION)) {
            return Some(format!(
                "nothing in the file calls them gates, and volume {frame} shows another heart, or one at another \
                 place, than the others (its correlation with them is {r:.2}, and that of gates {LEAST_CORRELATION} or \
                 more)"
            ));
        }
        let distances = self.distances(&kept);
        if let Some(groups) = groups(&distances) {
            let list = |group: &Vec<usize>| {
                let names: Vec<String> = group.iter().map(|at| kept[*at].to_string()).collect();
                names.join(", ")
            };
            let groups: Vec<String> = groups.iter().map(list).collect();
            return Some(format!(
                "nothing in the file calls them gates, and they fall into groups (volumes {}), as scans at rest and \
                 under stress do, which differ more than moments of one beat",
                groups.join("; ")
            ));
        }
        None
    }

    /// Squared distances between the volumes, as shares of the squared deviation of their mean.
    fn distances(&self, volumes: &[usize]) -> Vec<Vec<f64>> {
        let mean = self.mean(volumes, None);
        let middle = mean.iter().sum::<f64>() / mean.len() as f64;
        let scale: f64 = mean.iter().map(|value| (value - middle).powi(2)).sum();
        let between = |a: &usize, b: &usize| {
            let pairs = self.blocks[*a].iter().zip(&self.blocks[*b]);
            let sum: f64 = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum();
            sum / scale.max(f64::MIN_POSITIVE)
        };
        let row = |a: &usize| volumes.iter().map(|b| between(a, b)).collect();
        volumes.iter().map(row).collect()
    }
}

/// Bits of a place and a value, mixed so that sums of many tell images apart.
fn mixed(at: u64, bits: u32) -> u64 {
    let mut x = (at << 32) ^ at.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ u64::from(bits);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The correlation of two images; 1 where one has no contrast.
fn correlation(a: &[f64], b: &[f32]) -> f64 {
    let count = a.len() as f64;
    let mean_a = a.iter().sum::<f64>() / count;
    let mean_b = b.iter().map(|b| f64::from(*b)).sum::<f64>() / count;
    let [mut both, mut of_a, mut of_b] = [0.0; 3];
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (a - mean_a, f64::from(*b) - mean_b);
        both += a * b;
        of_a += a * a;
        of_b += b * b;
    }
    if of_a * of_b > 0.0 {
        both / (of_a * of_b).sqrt()
    } else {
        1.0
    }
}

/// The groups into which volumes with these squared distances fall, each of two or more; `None` if they fall into none.
fn groups(distances: &[Vec<f64>]) -> Option<Vec<Vec<usize>>> {
    let count = distances.len();
    let links = spanning_tree(distances);
    (1..count / 2).find_map(|cuts| {
        let (cut, rest) = links.split_at(cuts);
        let mut group: Vec<usize> = (0..count).collect();
        for (_, a, b) in rest {
            let (from, to) = (group[*b], group[*a]);
            group
                .iter_mut()
                .filter(|own| **own == from)
                .for_each(|own| *own = to);
        }
        let mut names = group.clone();
        names.sort_unstable();
        names.dedup();
        let members = |name: &usize| (0..count).filter(|n| group[*n] == *name).collect();
        let all: Vec<Vec<usize>> = names.iter().map(members).collect();
        let ends = |name: &usize| {
            let next = |n: &usize| group[(n + 1) % count];
            let leaves = (0..count).filter(|n| group[*n] == *name && next(n) != *name);
            leaves.count()
        };
        // A motion to and fro passes each shape twice, so that its volumes make pairs: more than two groups must be one
        // stretch each.
        let stretches = cuts == 1 || names.iter().all(|name| ends(name) == 1);
        let within = all.iter().flat_map(|group| {
            let pairs = group
                .iter()
                .flat_map(|a| group.iter().map(move |b| (*a, *b)));
            pairs.map(|(a, b)| distances[a][b])
        });
        let within = within.fold(0.0, f64::max);
        let between = cut.last().map_or(0.0, |(distance, ..)| *distance);
        let apart = between > ALIKE_DISTANCE && between >= GROUPS_APART * within;
        (apart && stretches && all.iter().all(|group| group.len() > 1)).then_some(all)
    })
}

/// The links of the shortest tree through all points, the longest first.
fn spanning_tree(distances: &[Vec<f64>]) -> Vec<(f64, usize, usize)> {
    let count = distances.len();
    let mut nearest: Vec<(f64, usize)> = distances[0].iter().map(|d| (*d, 0)).collect();
    let mut outside: Vec<usize> = (1..count).collect();
    let mut links = Vec::with_capacity(count);
    while let Some(at) =
        (0..outside.len()).min_by(|a, b| nearest[outside[*a]].0.total_cmp(&nearest[outside[*b]].0))
    {
        let next = outside.swap_remove(at);
        let (distance, from) = nearest[next];
        links.push((distance, from, next));
        for other in &outside {
            if distances[next][*other] < nearest[*other].0 {
                nearest[*other] = (distances[next][*other], next);
            }
        }
    }
    links.sort_by(|a, b| b.0.total_cmp(&a.0));
    links
}

/// Whether volumes differ by more than motion: the two that differ least, and are not equal, by a fair part of the
/// usual step.
fn is_noisy(distances: &[Vec<f64>]) -> bool {
    let count = distances.len();
    let apart = distances.iter().flatten().filter(|d| **d > 0.0);
    let least = apart.fold(f64::INFINITY, |least, d| least.min(*d));
    let mut steps: Vec<f64> = (0..count).map(|n| distances[n][(n + 1) % count]).collect();
    steps.sort_by(f64::total_cmp);
    least > NOISE_STEP * steps[count / 2]
}

/// The mean distance of two.
fn mean_apart(distances: &[Vec<f64>]) -> f64 {
    let count = distances.len();
    distances.iter().flatten().sum::<f64>() / (count * (count - 1)) as f64
}

#[cfg(test)]
mod tests {
    use super::super::{GatedReading, HeldGates, Reading};
    use super::super::{ReadLimits, ReadOptions, Volume, VolumeFile, hold_gates, read, read_gates};
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::image::grid::Affine;
    use std::f64::consts::TAU;

    const EDGE: usize = 28;
    const VOXEL_MM: f64 = 6.0;

    /// A heart as the image shows it, with activity about it.
    #[derive(Clone, Copy)]
    struct Heart {
        centre: Vec3,
        /// Radius of the middle of the wall, mm.
        radius_mm: f64,
        /// Uptake of the inferior part.
        inferior: f64,
    }

    const USUAL: Heart = Heart {
        centre: Vec3::new(100.0, 80.0, 85.0),
        radius_mm: 30.0,
        inferior: 1.0,
    };

    impl Heart {
        fn image(self) -> Volume {
            let value = |at: usize| {
                let index = [at % EDGE, at / EDGE % EDGE, at / EDGE / EDGE];
                let p = Vec3::from(index.map(|n| VOXEL_MM * n as f64));
                let apart = (p - self.centre).norm() - self.radius_mm;
                let uptake = if p.z < self.centre.z - 8.0 {
                    self.inferior
                } else {
                    1.0
                };
                let wall = 900.0 * uptake * (-(apart / 9.0).powi(2)).exp();
                let body = 60.0 * f64::from(u8::from((p - Vec3::repeat(84.0)).norm() < 75.0));
                (wall + body) as f32
            };
            let affine = Affine::Lps([
                [VOXEL_MM, 0.0, 0.0, 0.0],
                [0.0, VOXEL_MM, 0.0, 0.0],
                [0.0, 0.0, VOXEL_MM, 0.0],
                [0.0, 0.0, 0.0, 1.0],
            ]);
            let voxels = (0..EDGE.pow(3)).map(value).collect();
            Volume::from_array(voxels, [EDGE; 3], affine).unwrap()
        }
    }

    /// The gates of a beat, of equal counts, with `noise` as a share of the square root of the counts.
    fn beat(gates: usize, noise: f64) -> Vec<Volume> {
        let mut state = 7_u64;
        let mut draw = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f64 / f64::from(1 << 23) - 1.0
        };
        let gate = |n: usize| {
            // Systole is shorter than diastole.
            let turn = (n as f64 + 0.5) / gates as f64;
            let moved = 0.5 - 0.5 * (TAU * turn.powf(0.8)).cos();
            let mut image = Heart {
                radius_mm: 30.0 - 7.0 * moved,
                ..USUAL
            }
            .image();
            let counts = image.counts();
            image.voxels.iter_mut().for_each(|v| {
                let mean = f64::from(*v) * 1.5e6 / counts;
                *v = (mean + noise * mean.sqrt() * draw()).max(0.0).round() as f32;
            });
            image
        };
        (0..gates).map(gate).collect()
    }

    fn combined(volumes: &[Volume], share: f32) -> Volume {
        let mut sum = volumes[0].clone();
        for (at, value) in sum.voxels.iter_mut().enumerate() {
            *value = (share * volumes.iter().map(|v| v.voxels[at]).sum::<f32>()).round();
        }
        sum
    }

    fn scaled(volume: &Volume, by: f32) -> Volume {
        let voxels = volume.voxels.iter().map(|v| v * by).collect();
        Volume {
            voxels,
            ..volume.clone()
        }
    }

    fn file(volumes: &[Volume]) -> [VolumeFile; 1] {
        [VolumeFile::of_arrays("the array", volumes.to_vec())]
    }

    fn summed(volumes: &[Volume]) -> Result<Reading, VolumeError> {
        let (options, limits) = (ReadOptions::default(), ReadLimits::default());
        read(&file(volumes), &options, &limits, &Monitor::silent())
    }

    fn gates(volumes: &[Volume]) -> GatedReading {
        let (limits, quiet) = (ReadLimits::default(), Monitor::silent());
        read_gates(&file(volumes), false, &limits, &quiet).unwrap()
    }

    #[track_caller]
    fn refusal(volumes: &[Volume]) -> String {
        let Err(error) = summed(volumes) else {
            panic!("the volumes were summed");
        };
        assert!(matches!(error, VolumeError::FrameNeeded { .. }), "{error}");
        let (limits, quiet) = (ReadLimits::default(), Monitor::silent());
        let held = hold_gates(&file(volumes), false, &limits, &quiet);
        assert_eq!(held.unwrap(), HeldGates::NotGated);
        let one = ReadOptions { frame: Some(1) };
        let alone = read(&file(volumes), &one, &limits, &quiet).unwrap();
        assert_eq!(alone.volume.voxels, volumes[1].voxels);
        error.to_string()
    }

    #[test]
    fn a_beat_is_summed_whatever_its_gates_noise_and_losses() {
        for (count, noise) in [
            (6, 0.0),
            (8, 0.0),
            (8, 1.0),
            (8, 12.0),
            (16, 0.0),
            (16, 3.0),
            (32, 1.0),
        ] {
            let mut all = beat(count, noise);
            let last = count - 1;
            all[last] = scaled(&all[last], 0.6);
            let reading = summed(&all).unwrap_or_else(|error| panic!("{count} {noise}: {error}"));
            let sum: f32 = all.iter().map(|gate| gate.voxels[9000]).sum();
            assert!((reading.volume.voxels[9000] - sum).abs() <= 1e-3 * sum);
            assert_eq!(reading.facts.gates.unwrap().number, count);
        }
    }

    /// A heart that stands still is the same in the sum of all its gates.
    #[test]
    fn equal_gates_are_summed() {
        let still = USUAL.image();
        for all in [
            vec![still.clone(); 8],
            vec![[still.clone(), scaled(&still, 0.9)]; 4].concat(),
        ] {
            let reading = summed(&all).unwrap();
            assert_eq!(
                (reading.facts.frames, reading.facts.gates.unwrap().number),
                (8, 8)
            );
        }
    }

    #[test]
    fn a_volume_that_is_no_gate_is_left_out_and_named() {
        for noise in [0.0, 1.0, 6.0] {
            let all = beat(8, noise);
            let alone = summed(&all).unwrap().volume.voxels;
            for (what, share) in [("sum", 1.0), ("mean", 0.125)] {
                let extra = combined(&all, share);
                for at in [0, 8, 4] {
                    let mut with = all.clone();
                    with.insert(at, extra.clone());
                    let reading = summed(&with).unwrap();
                    assert_eq!(
                        reading.volume.voxels, alone,
                        "{what} at {at}, noise {noise}"
                    );
                    let warnings = reading.facts.warnings.join(" ");
                    let told = format!("Volume {at} (counted from 0) is the {what} of the others");
                    assert!(warnings.contains(&told), "{warnings}");
                    assert_eq!(reading.facts.gates.unwrap().number, 8);
                    let beat = gates(&with);
                    let frames: Vec<usize> = (0..9).filter(|n| *n != at).collect();
                    assert_eq!(
                        (beat.gates.len(), beat.frames, beat.lost.len()),
                        (8, frames, 0)
                    );
                    assert!(beat.facts.warnings.join(" ").contains(&told));
                }
            }
        }
    }

    #[test]
    fn a_gate_that_repeats_another_or_has_too_many_counts_tells_nothing() {
        let all = beat(8, 12.0);
        let alone = summed(&all).unwrap().volume.voxels;
        // A ninth that closes the cycle is none.
        let closed = [&all[..], &all[..1]].concat();
        assert_eq!(summed(&closed).unwrap().volume.voxels, alone);
        assert_eq!(gates(&closed).gates.len(), 8);
        // A gate in the place of another is one that is missing.
        let mut repeated = all.clone();
        repeated[3] = all[2].clone();
        let mut rich = all.clone();
        rich[3] = scaled(&all[3], 2.0);
        let seven: Vec<Volume> = (all.iter().enumerate())
            .filter(|(n, _)| *n != 3)
            .map(|(_, gate)| gate.clone())
            .collect();
        let sum = combined(&seven, 1.0).voxels;
        for (volumes, told) in [
            (repeated, "Volume 3 (counted from 0) repeats volume 2"),
            (rich, "2.0 times the counts"),
        ] {
            let reading = summed(&volumes).unwrap();
            assert_eq!(reading.volume.voxels, sum);
            let warnings = reading.facts.warnings.join(" ");
            assert!(warnings.contains(told), "{warnings}");
            let beat = gates(&volumes);
            assert_eq!((beat.gates.len(), &beat.lost[..]), (8, &[3][..]));
        }
    }

    #[test]
    fn volumes_that_are_no_gates_need_a_frame() {
        let people: Vec<Volume> = (0..8)
            .map(|n| {
                let turn = TAU * f64::from(n) / 8.0;
                let centre = USUAL.centre + 28.0 * Vec3::new(turn.cos(), turn.sin(), 0.3);
                Heart {
                    centre,
                    radius_mm: 24.0 + f64::from(n % 3) * 2.0,
                    ..USUAL
                }
                .image()
            })
            .collect();
        let told = refusal(&people);
        assert!(told.contains("shows another heart"), "{told}");
        // One stranger among gates.
        let mut stranger = beat(8, 1.0);
        stranger[5] = people[0].clone();
        assert!(refusal(&stranger).contains("volume 5 shows another heart"));
        // Scans at rest and under stress, three or four reconstructions each, one after the other and in turn.
        let of = |inferior: f64, n: usize| {
            let made = Heart {
                inferior,
                radius_mm: 30.0 + 0.2 * n as f64,
                ..USUAL
            };
            made.image()
        };
        let scans = |many: usize| -> Vec<Volume> {
            let [stress, rest] = [0.4, 1.0].map(|inferior| (0..many).map(move |n| of(inferior, n)));
            stress.chain(rest).collect()
        };
        for many in [3, 4] {
            let told = refusal(&scans(many));
            let first: Vec<String> = (0..many).map(|n| n.to_string()).collect();
            assert!(
                told.contains(&format!("groups (volumes {};", first.join(", "))),
                "{told}"
            );
        }
        let four = scans(4);
        let turns: Vec<Volume> = [0, 4, 1, 5, 2, 6, 3, 7].map(|n| four[n].clone()).into();
        assert!(refusal(&turns).contains("groups (volumes 0, 2, 4, 6; 1, 3, 5, 7)"));
        // The uptake of a dynamic study.
        let still = USUAL.image();
        let dynamic = [0.1, 0.4, 0.8, 1.0, 1.0, 0.95].map(|share| scaled(&still, share));
        assert!(refusal(&dynamic).contains("less than 70 % of the counts"));
        for few in 2..6 {
            let told = refusal(&beat(few, 1.0));
            assert!(told.contains(&format!("the {few} volumes gates")), "{told}");
        }
    }
}
