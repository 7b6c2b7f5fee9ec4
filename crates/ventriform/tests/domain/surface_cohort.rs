//! The ventricle must be found in every simulated patient of `../shared/data` and its region
//! must be the heart's wall, not the liver. Skipped, saying so, where the data are absent.

// A test states its expectations by panicking, its helpers too.
#![allow(clippy::unwrap_used)]

use crate::shared_data::shared_data;
use std::io::Read;
use std::path::Path;

use nalgebra::Matrix4;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::image::locate;
use ventriform::image::volume::Volume;
use ventriform::mesh::topology;
use ventriform::surface::{SurfaceParameters, extract, region};

/// Just enough NIfTI-1 for the cohort: little endian, sform, int16, uint8 or float32.
fn read(path: &Path) -> Volume {
    let mut bytes = Vec::new();
    flate2::read::MultiGzDecoder::new(std::fs::File::open(path).unwrap())
        .read_to_end(&mut bytes)
        .unwrap();
    let i16_at = |at: usize| i16::from_le_bytes([bytes[at], bytes[at + 1]]);
    let f32_at = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let shape = [42, 44, 46].map(|at| i16_at(at) as usize);
    let n: usize = shape.iter().product();
    let data = &bytes[f32_at(108) as usize..];
    let (slope, intercept) = (f32_at(112), f32_at(116));
    let scale = |v: f32| {
        if slope == 0.0 || slope.is_nan() {
            v
        } else {
            v * slope + intercept
        }
    };
    let voxels = match i16_at(70) {
        2 => data[..n].iter().map(|&v| scale(f32::from(v))).collect(),
        4 => data[..2 * n]
            .chunks(2)
            .map(|b| scale(f32::from(i16::from_le_bytes([b[0], b[1]]))))
            .collect(),
        16 => data[..4 * n]
            .chunks(4)
            .map(|b| scale(f32::from_le_bytes(b.try_into().unwrap())))
            .collect(),
        other => panic!("data type {other}"),
    };
    let mut ras = Matrix4::identity();
    for r in 0..3 {
        for c in 0..4 {
            ras[(r, c)] = f64::from(f32_at(280 + 16 * r + 4 * c));
        }
    }
    Volume {
        shape,
        voxels,
        frame: VoxelToPatient::from_ras(&ras).unwrap(),
        integral: false,
    }
}

/// The region's voxels as (Dice with the truth, share of the visible truth found, share of
/// the region more than 12 mm from the truth).
fn compare(volume: &Volume, inside: &[bool], truth: &Volume, iso: f32) -> [f64; 3] {
    let count = |f: &dyn Fn(usize) -> bool| (0..inside.len()).filter(|&n| f(n)).count() as f64;
    let wall = |n: usize| truth.voxels[n] > 0.0;
    let both = count(&|n| inside[n] && wall(n));
    let visible = count(&|n| wall(n) && volume.voxels[n] >= iso);
    let all = count(&|n| inside[n]);
    let reach = (12.0 / truth.frame.spacing()[0]).round() as i64;
    let [nx, ny, nz] = truth.shape.map(|n| n as i64);
    let far = count(&|n| {
        let n = n as i64;
        let p = [n % nx, n / nx % ny, n / (nx * ny)];
        inside[n as usize]
            && !(-reach..=reach).any(|c| {
                (-reach..=reach).any(|b| {
                    (-reach..=reach).any(|a| {
                        let q = [p[0] + a, p[1] + b, p[2] + c];
                        a * a + b * b + c * c <= reach * reach
                            && (0..3).all(|r| q[r] >= 0 && q[r] < [nx, ny, nz][r])
                            && wall((q[0] + nx * (q[1] + ny * q[2])) as usize)
                    })
                })
            })
    });
    [2.0 * both / (all + count(&wall)), both / visible, far / all]
}

#[test]
fn every_patients_ventricle_is_found() {
    let Some(cohort) = shared_data("cohort") else {
        return;
    };
    let cases = std::fs::read_dir(cohort).unwrap();
    let mut cases: Vec<_> = cases
        .map(|e| e.unwrap().path())
        .filter(|p| p.join("spect.nii.gz").exists())
        .collect();
    cases.sort();
    let mut lost = Vec::new();
    for case in cases {
        let volume = read(&case.join("spect.nii.gz"));
        let truth = read(&case.join("lv_truth.nii.gz"));
        let surface = extract(&volume, &SurfaceParameters::default(), &Monitor::silent()).unwrap();
        assert_eq!(
            topology::check(&surface.mesh).unwrap().euler_characteristic,
            2
        );
        let iso = surface.facts.iso_value as f32;
        let heart = locate::find(&volume, &locate::Hints::default(), &Monitor::silent()).unwrap();
        let found = heart.cavity(&Monitor::silent()).unwrap().unwrap();
        let region = region::WallShell::new(&volume, &found, &Monitor::silent())
            .unwrap()
            .region(iso, &Monitor::silent())
            .unwrap()
            .unwrap();
        let mut inside = vec![false; volume.voxels.len()];
        for p in region.labels.voxels() {
            let [i, j, k] = [0, 1, 2].map(|r| p[r] + region.labels.origin[r]);
            inside[i + volume.shape[0] * (j + volume.shape[1] * k)] = true;
        }
        let [dice, recall, far] = compare(&volume, &inside, &truth, iso);
        let name = case.file_name().unwrap().to_string_lossy().into_owned();
        println!(
            "{name}: score {:.2} dice {dice:.2} visible {recall:.2} far {far:.3} {:.0} ml cut {} {:?}",
            found.score,
            surface.facts.region_ml,
            surface.facts.neighbour_voxels_cut,
            surface.facts.warnings
        );
        if recall < 0.8 || far > 0.05 {
            lost.push(name);
        }
    }
    assert!(lost.is_empty(), "lost: {lost:?}");
}
