//! The gates of one study: checked, and scaled to equal counts.
//!
//! In: one volume for each gate, in their order, all on one grid. Out: the gates with the factor that brings each to
//! the mean counts of a gate, and their sum, of which the first fit is made. An irregular beat takes counts from the
//! last gates; without the factor the wall looks thinner there, and EF rises by 7 points where a quarter is lost.

use super::error::BeatError;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::Volume;
use crate::image::grid::gates::{GATE_COUNTS, SAME_PLACE_MM};

/// Share of its counts whose loss leaves a gate out of the curve, and is told. Less is usual where beats differ in
/// length, and made up by the gate's factor: a quarter changes EF by 1.4 points at most (docs/log/beat.md).
pub const COUNT_LOSS_LEFT_OUT_SHARE: f64 = 0.30;

/// The gates of one study.
#[derive(Debug, Clone)]
pub struct GatedStudy {
    /// The gates, as they were read.
    pub gates: Vec<Volume>,
    /// The sum of the gates, each scaled by its factor.
    pub sum: Volume,
    /// The factor that brings each gate to the usual counts of a gate.
    pub factors: Vec<f64>,
    /// Share of the usual counts that each gate lacks; negative where it has more.
    pub losses: Vec<f64>,
    /// Gates that tell nothing of the beat, counted from 0.
    lost: Vec<usize>,
}

impl GatedStudy {
    /// The study of these gates, of which those in `lost`, counted from 0, tell nothing of the beat: neither the sum
    /// nor the curve has them.
    ///
    /// # Errors
    /// [`BeatError`]: fewer gates than 6 or more than 32, gates on different grids, a gate without counts.
    pub fn new(gates: Vec<Volume>, lost: &[usize], monitor: &Monitor) -> Result<Self, BeatError> {
        if !GATE_COUNTS.contains(&gates.len()) {
            return Err(BeatError::GateCount {
                found: gates.len(),
                least: *GATE_COUNTS.start(),
                most: *GATE_COUNTS.end(),
            });
        }
        let first = &gates[0];
        for (index, gate) in gates.iter().enumerate() {
            let apart = first.frame.greatest_distance(&gate.frame, gate.shape);
            if gate.shape != first.shape || apart > SAME_PLACE_MM {
                return Err(BeatError::OtherGrid {
                    gate: index + 1,
                    found: gate.shape,
                    first: first.shape,
                });
            }
        }
        let counts: Vec<f64> = gates.iter().map(Volume::counts).collect();
        if let Some(empty) = counts.iter().position(|counts| *counts <= 0.0) {
            return Err(BeatError::EmptyGate { gate: empty + 1 });
        }
        // The upper half of the gates lost nothing: the mean would be drawn down by those that did. Its median is not
        // drawn up by a gate that has too many.
        let mut sorted = counts.clone();
        sorted.sort_by(f64::total_cmp);
        let upper = &sorted[sorted.len() / 2..];
        let usual = f64::midpoint(upper[(upper.len() - 1) / 2], upper[upper.len() / 2]);
        let factors: Vec<f64> = counts.iter().map(|counts| usual / counts).collect();
        // In f64, where the order of the gates does not show after rounding to f32.
        let mut voxels = vec![0.0_f64; first.voxels.len()];
        let told = |(index, _): &(usize, _)| !lost.contains(index);
        for (_, (gate, factor)) in gates.iter().zip(&factors).enumerate().filter(told) {
            monitor.check().map_err(|Cancelled| BeatError::Cancelled)?;
            for (sum, value) in voxels.iter_mut().zip(&gate.voxels) {
                *sum += factor * f64::from(*value);
            }
        }
        let sum = Volume {
            shape: first.shape,
            voxels: voxels.into_iter().map(|value| value as f32).collect(),
            frame: first.frame.clone(),
            integral: false,
        };
        Ok(Self {
            losses: counts.iter().map(|counts| 1.0 - counts / usual).collect(),
            gates,
            sum,
            factors,
            lost: lost.to_vec(),
        })
    }

    /// Whether each gate has counts enough to tell something of the curve.
    pub fn counted(&self) -> Vec<bool> {
        let told = |(gate, loss): (usize, &f64)| {
            *loss <= COUNT_LOSS_LEFT_OUT_SHARE && !self.lost.contains(&gate)
        };
        self.losses.iter().enumerate().map(told).collect()
    }
}
