//! A filter as a share of each frequency of an image.
//!
//! The spectrum is that of the image continued beyond its ends: in a slice by nothing, as there is nothing outside of
//! the disc that the camera sees, and along the axis by its mirror image, so that the ends do not run into one another.

use super::parameters::{Filter, Reconstruction};
use nalgebra::Complex;
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

type Wave = Complex<f32>;

/// How an axis of an image is continued for its spectrum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Axis {
    /// By zeros.
    Padded {
        /// Values.
        count: usize,
        /// Values with the zeros.
        length: usize,
    },
    /// By its mirror image.
    Mirrored {
        /// Values, half of the length.
        count: usize,
    },
}

impl Axis {
    pub(super) fn padded(count: usize, length: usize) -> Self {
        Self::Padded { count, length }
    }

    pub(super) fn mirrored(count: usize) -> Self {
        Self::Mirrored { count }
    }

    fn count(self) -> usize {
        match self {
            Self::Padded { count, .. } | Self::Mirrored { count } => count,
        }
    }

    /// Values with those beyond the ends.
    pub(super) fn length(self) -> usize {
        match self {
            Self::Padded { length, .. } => length,
            Self::Mirrored { count } => 2 * count,
        }
    }

    /// The value that stands at place `at`; `None` for 0.
    fn source(self, at: usize) -> Option<usize> {
        match self {
            Self::Padded { count, .. } => (at < count).then_some(at),
            Self::Mirrored { count } if at < count => Some(at),
            Self::Mirrored { count } => Some(2 * count - 1 - at),
        }
    }
}

/// The frequency of place `at` of a spectrum of `length`, cycles per cm.
pub(super) fn frequency_per_cm(at: usize, length: usize, step_cm: f64) -> f64 {
    at.min(length - at) as f64 / (length as f64 * step_cm)
}

/// The image, x the fastest, with the filter's share of each frequency.
pub(super) fn smoothed(
    image: Vec<f32>,
    [nx, ny, nz]: [usize; 3],
    voxel_mm: f64,
    how: &Reconstruction,
) -> Vec<f32> {
    if how.filter == Filter::None {
        return image;
    }
    let axes = [
        Axis::padded(nx, nx),
        Axis::padded(ny, ny),
        Axis::mirrored(nz),
    ];
    let voxel_cm = voxel_mm / 10.0;
    multiplied(image, axes, |at| {
        let per_cm =
            [0, 1, 2].map(|axis| frequency_per_cm(at[axis], axes[axis].length(), voxel_cm));
        how.gain(per_cm.iter().map(|f| f * f).sum::<f64>().sqrt())
    })
}

/// `values` with `gain` of each place of their spectrum.
pub(super) fn multiplied(
    values: Vec<f32>,
    axes: [Axis; 3],
    gain: impl Fn([usize; 3]) -> f64 + Sync,
) -> Vec<f32> {
    let [lx, ly, lz] = axes.map(Axis::length);
    let (nx, ny) = (axes[0].count(), axes[1].count());
    let value = |x: usize, y: usize, z: usize| {
        let at = (axes[0].source(x)?, axes[1].source(y)?, axes[2].source(z)?);
        values.get((at.2 * ny + at.1) * nx + at.0).copied()
    };
    let mut waves = vec![Wave::new(0.0, 0.0); lx * ly * lz];
    for (line, row) in waves.chunks_exact_mut(lx).enumerate() {
        for (x, wave) in row.iter_mut().enumerate() {
            wave.re = value(x, line % ly, line / ly).unwrap_or(0.0);
        }
    }
    let mut planner = FftPlanner::new();
    let scale = 1.0 / waves.len() as f64;
    let forward = [lx, ly, lz].map(|length| planner.plan_fft_forward(length));
    let inverse = [lx, ly, lz].map(|length| planner.plan_fft_inverse(length));
    transform(&mut waves, [lx, ly, lz], &forward);
    waves
        .par_chunks_mut(lx)
        .enumerate()
        .for_each(|(line, row)| {
            for (x, wave) in row.iter_mut().enumerate() {
                *wave *= (scale * gain([x, line % ly, line / ly])) as f32;
            }
        });
    transform(&mut waves, [lx, ly, lz], &inverse);
    let mut values = values;
    for (line, row) in values.chunks_exact_mut(nx).enumerate() {
        let at = (line / ny * ly + line % ny) * lx;
        for (value, wave) in row.iter_mut().zip(&waves[at..]) {
            *value = wave.re;
        }
    }
    values
}

/// Transforms the lines along every axis. Each line is worked on for itself.
fn transform(waves: &mut [Wave], [lx, ly, lz]: [usize; 3], along: &[Arc<dyn Fft<f32>>; 3]) {
    waves
        .par_chunks_mut(lx)
        .for_each(|line| along[0].process(line));
    if ly > 1 {
        waves.par_chunks_mut(lx * ly).for_each(|plane| {
            columns(plane, lx, ly, &*along[1]);
        });
    }
    if lz > 1 {
        // Planes of x and z, one for each y, are put together, transformed and put back.
        let mut turned = vec![Wave::new(0.0, 0.0); waves.len()];
        turned
            .par_chunks_mut(lx * lz)
            .enumerate()
            .for_each(|(y, plane)| {
                for (z, row) in plane.chunks_exact_mut(lx).enumerate() {
                    let at = (z * ly + y) * lx;
                    row.copy_from_slice(&waves[at..at + lx]);
                }
                columns(plane, lx, lz, &*along[2]);
            });
        waves
            .par_chunks_mut(lx)
            .enumerate()
            .for_each(|(line, row)| {
                let at = (line % ly * lz + line / ly) * lx;
                row.copy_from_slice(&turned[at..at + lx]);
            });
    }
}

/// Transforms the columns of a plane of rows of `width`.
fn columns(plane: &mut [Wave], width: usize, height: usize, fft: &dyn Fft<f32>) {
    let mut line = vec![Wave::new(0.0, 0.0); height];
    for x in 0..width {
        for (y, wave) in line.iter_mut().enumerate() {
            *wave = plane[y * width + x];
        }
        fft.process(&mut line);
        for (y, wave) in line.iter().enumerate() {
            plane[y * width + x] = *wave;
        }
    }
}
