//! Scores by which exchanged axes are told (`heart/judge/exchanged_axes.rs`), of scans as they are, cut out, and with two
//! axes exchanged.
//!
//! ```sh
//! cargo run --release --package ventriform-evaluation --bin exchanged_axes -- SEED FOLDER...
//! ```
//!
//! Every FOLDER holds spect.nii.gz and lv_truth.nii.gz. Prints a row for each scan: as it is, with sides and length
//! exchanged in RAS+ order, with depth and length exchanged in LPS+ order, and three cut-outs with random margins about
//! the heart. An exchange changes the order of the array and keeps its affine.

use anyhow::{Context, Result};
use rand::RngExt;
use std::path::Path;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::geometry::random::{Purpose, stream};
use ventriform::base::progress::Monitor;
use ventriform::heart::judge::exchanged_axes::scores;
use ventriform::image::volume::{self, ReadLimits, ReadOptions, Volume, VolumeFile};

/// Cut-outs of each scan.
const CUT_OUTS: usize = 3;
/// Margins of a cut-out about the heart's centre, mm.
const MARGINS_MM: [f64; 2] = [65.0, 160.0];

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let seed = arguments.next().context("missing argument SEED")?.parse()?;
    println!("scan,kind,sides_ends,sides_side,depth_ends,depth_side");
    let mut random = stream(seed, Purpose::PhantomNoise);
    for folder in arguments {
        let folder = Path::new(&folder);
        let (scan, truth) = (
            read(&folder.join("spect.nii.gz"))?,
            read(&folder.join("lv_truth.nii.gz"))?,
        );
        let heart = Heart::new(&scan, &truth);
        let name = folder.display();
        let line = |kind: &str, volume: &Volume, centre: &Vec3| {
            if let Some([sides, depth]) = scores(volume, centre, heart.uptake) {
                println!(
                    "{name},{kind},{:.4},{:.4},{:.4},{:.4}",
                    sides.ends, sides.side, depth.ends, depth.side
                );
            }
        };
        line("whole", &scan, &heart.centre);
        for (kind, signs, order) in [
            ("sides", [-1.0, -1.0, 1.0], [2, 1, 0]),
            ("depth", [1.0, 1.0, 1.0], [0, 2, 1]),
        ] {
            let stored = stored_along(&scan, signs);
            let index = stored.frame.to_voxel(&heart.centre);
            let other = reordered(&stored, order);
            let moved = Vec3::from(order.map(|axis: usize| index[axis]));
            line(kind, &other, &stored.frame.to_patient(&moved));
        }
        for _ in 0..CUT_OUTS {
            let index = scan.frame.to_voxel(&heart.centre);
            let spacing = scan.frame.spacing();
            let mut margin =
                |axis: usize| random.random_range(MARGINS_MM[0]..MARGINS_MM[1]) / spacing[axis];
            let first = [0, 1, 2].map(|a| (index[a] - margin(a)).max(0.0) as usize);
            let end = [0, 1, 2].map(|a| ((index[a] + margin(a)) as usize + 1).min(scan.shape[a]));
            line("cut-out", &cut_out(&scan, first, end), &heart.centre);
        }
    }
    Ok(())
}

fn read(path: &Path) -> Result<Volume> {
    let files = [VolumeFile::at(path)];
    let reading = volume::read(
        &files,
        &ReadOptions::default(),
        &ReadLimits::default(),
        &Monitor::silent(),
    )?;
    Ok(reading.volume)
}

struct Heart {
    centre: Vec3,
    uptake: f64,
}

impl Heart {
    /// By the true wall: its centroid, and the mean of its brightest quarter.
    fn new(scan: &Volume, truth: &Volume) -> Self {
        let [nx, ny, _] = scan.shape;
        let wall: Vec<usize> = (0..scan.voxels.len())
            .filter(|v| truth.voxels[*v] > 0.5)
            .collect();
        let place = |v: usize| {
            let index = [v % nx, v / nx % ny, v / (nx * ny)].map(|n| n as f64);
            scan.frame.to_patient(&Vec3::from(index))
        };
        let mut values: Vec<f64> = wall.iter().map(|v| f64::from(scan.voxels[*v])).collect();
        values.sort_by(f64::total_cmp);
        let brightest = &values[values.len() * 3 / 4..];
        Self {
            centre: wall.iter().map(|v| place(*v)).sum::<Vec3>() / wall.len() as f64,
            uptake: brightest.iter().sum::<f64>() / brightest.len() as f64,
        }
    }
}

/// The same image in the same place, with axes that run along these directions (LPS) as far as they are the frame's.
fn stored_along(volume: &Volume, signs: [f64; 3]) -> Volume {
    let shape = volume.shape;
    let linear = volume.frame.linear();
    let backward = [0, 1, 2].map(|a| linear[(a, a)] * signs[a] < 0.0);
    let from = |index: [usize; 3]| {
        [0, 1, 2].map(|a| {
            if backward[a] {
                shape[a] - 1 - index[a]
            } else {
                index[a]
            }
        })
    };
    let origin = volume
        .frame
        .to_patient(&Vec3::from(from([0; 3]).map(|n| n as f64)));
    let mut turned = *linear;
    for (a, backward) in backward.into_iter().enumerate() {
        if backward {
            turned.column_mut(a).neg_mut();
        }
    }
    Volume {
        voxels: voxels_at(shape, |index| at(volume, from(index))),
        frame: VoxelToPatient::new(turned, origin).expect("a turned frame spans three dimensions"),
        ..volume.clone()
    }
}

/// The array with its axes in another order, with the same affine.
fn reordered(volume: &Volume, order: [usize; 3]) -> Volume {
    let shape = order.map(|axis| volume.shape[axis]);
    let from = |index: [usize; 3]| {
        let mut from = [0; 3];
        for (axis, n) in order.into_iter().zip(index) {
            from[axis] = n;
        }
        from
    };
    Volume {
        voxels: voxels_at(shape, |index| at(volume, from(index))),
        shape,
        ..volume.clone()
    }
}

fn cut_out(volume: &Volume, first: [usize; 3], end: [usize; 3]) -> Volume {
    let shape = [0, 1, 2].map(|a| end[a] - first[a]);
    let origin = volume
        .frame
        .to_patient(&Vec3::from(first.map(|n| n as f64)));
    let from = |index: [usize; 3]| [0, 1, 2].map(|a| first[a] + index[a]);
    Volume {
        voxels: voxels_at(shape, |index| at(volume, from(index))),
        shape,
        frame: VoxelToPatient::new(*volume.frame.linear(), origin)
            .expect("a shifted frame spans three dimensions"),
        ..volume.clone()
    }
}

fn at(volume: &Volume, [i, j, k]: [usize; 3]) -> f32 {
    volume.voxels[i + volume.shape[0] * (j + volume.shape[1] * k)]
}

fn voxels_at([nx, ny, nz]: [usize; 3], value: impl Fn([usize; 3]) -> f32) -> Vec<f32> {
    let numbers = 0..nx * ny * nz;
    numbers
        .map(|n| value([n % nx, n / nx % ny, n / (nx * ny)]))
        .collect()
}
