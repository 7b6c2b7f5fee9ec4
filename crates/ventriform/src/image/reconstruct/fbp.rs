//! Filtered back projection: the ramp and the filter on every view, and each view spread over the image.
//!
//! The ramp is that of a band-limited signal, from its values in space (Kak and Slaney 1988, eq. 3.61), so that the
//! image's mean is right. By the theorem of slices, a filter on the views is the same filter on the image.

use super::camera::{Camera, LANES, Lanes, in_packs};
use super::filter::{Axis, frequency_per_cm, multiplied};
use super::parameters::Reconstruction;
use super::projections::{Projections, shares_deg};
use crate::base::progress::{Cancelled, Monitor, Stage};
use rayon::prelude::*;
use std::f64::consts::PI;

/// The image; parts of it may be below 0.
pub(super) fn image(
    camera: &Camera,
    projections: &Projections,
    how: &Reconstruction,
    monitor: &Monitor,
) -> Result<Vec<f32>, Cancelled> {
    let views = projections.views.len();
    // Zeros beside a frame keep one side out of the other's way.
    let across = Axis::padded(projections.columns, 2 * projections.columns);
    let ramp = ramp(across.length());
    let filtered: Vec<Result<Vec<f32>, Cancelled>> = (0..views)
        .into_par_iter()
        .map(|view| {
            monitor.check()?;
            Ok(ramped(projections, view, across, &ramp, how))
        })
        .collect();
    let filtered: Vec<Vec<f32>> = filtered.into_iter().collect::<Result<_, _>>()?;
    monitor.report(Stage::Read, 0.5)?;
    // The integral over half a turn; views that are opposite share it.
    let shares: Vec<f32> = (shares_deg(&projections.views).iter())
        .map(|(_, share)| share.to_radians() as f32)
        .collect();
    in_packs(projections, |start, rows| {
        let mut image = vec![[0.0; LANES]; camera.count * camera.count];
        for (view, (frame, share)) in filtered.iter().zip(&shares).enumerate() {
            let columns: Vec<Lanes> = camera.pack(frame, start, rows);
            camera.spread(view, &columns, *share, &mut image);
            monitor.check()?;
        }
        for (at, lanes) in image.iter_mut().enumerate() {
            if !camera.sees(at) {
                *lanes = [0.0; LANES];
            }
        }
        Ok(image)
    })
}

/// The frame of a view with the ramp's and the filter's share of each frequency.
fn ramped(
    projections: &Projections,
    view: usize,
    across: Axis,
    ramp: &[f64],
    how: &Reconstruction,
) -> Vec<f32> {
    let along = Axis::mirrored(projections.rows);
    let pixel_cm = projections.pixel_mm / 10.0;
    let gain = |[u, z, _]: [usize; 3]| {
        let across_per_cm = frequency_per_cm(u, across.length(), pixel_cm);
        let along_per_cm = frequency_per_cm(z, along.length(), pixel_cm);
        ramp[u] * how.gain(across_per_cm.hypot(along_per_cm))
    };
    let frame = projections.view(view).to_vec();
    multiplied(frame, [across, along, Axis::padded(1, 1)], gain)
}

/// The spectrum of the ramp for lines of `count` pixels, per pixel.
fn ramp(count: usize) -> Vec<f64> {
    let value = |n: usize| {
        let off = n.min(count - n);
        match off {
            0 => 0.25,
            off if off % 2 == 1 => -1.0 / (PI * off as f64).powi(2),
            _ => 0.0,
        }
    };
    // The line is even: its spectrum is a sum of cosines.
    let line: Vec<f64> = (0..count).map(value).collect();
    let cosines: Vec<f64> = (0..count)
        .map(|k| (2.0 * PI * k as f64 / count as f64).cos())
        .collect();
    (0..count)
        .map(|u| {
            let terms = line.iter().enumerate();
            terms.map(|(n, value)| value * cosines[u * n % count]).sum()
        })
        .collect()
}
