//! From voxels to the surface: Marching Cubes alone, and all of `extract`.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::image::grid::labels::Labels;
use ventriform::image::volume::Volume;
use ventriform::surface::marching_cubes::{Samples, marching_cubes};
use ventriform::surface::{SurfaceParameters, extract};

/// A blurred wall, open at the base, in a dim background: `n`³ voxels that span 256 mm.
fn phantom(n: usize) -> Volume {
    let spacing = 256.0 / n as f64;
    let shape = [n; 3];
    let frame = VoxelToPatient::centred(shape, [spacing; 3], Vec3::zeros())
        .expect("a positive spacing makes a frame");
    let mut voxels = Vec::with_capacity(n * n * n);
    for k in 0..n {
        for j in 0..n {
            for i in 0..n {
                let p = frame.to_patient(&Vec3::new(i as f64, j as f64, k as f64));
                let q = Vec3::new(p.x, p.y, p.z * 0.75);
                let open = ((p.z - 22.0) / 4.0).max(0.0);
                let wall = (-((q.norm() - 26.0) / 6.0).powi(2) - open * open).exp();
                // A ripple instead of noise, so that every machine gets the same volume.
                let ripple = 0.02 * ((i * 7 + j * 13 + k * 29) as f64).sin();
                voxels.push((0.1 + 0.9 * wall + ripple) as f32);
            }
        }
    }
    Volume {
        shape,
        voxels,
        frame,
        integral: false,
    }
}

fn surface(c: &mut Criterion) {
    for n in [64, 128, 256] {
        let volume = phantom(n);
        let iso = 0.5;
        let samples = Samples {
            values: &volume.voxels,
            shape: volume.shape,
            beyond: -1.0,
        };
        c.bench_function(&format!("marching cubes {n}^3"), |b| {
            b.iter(|| {
                let values = black_box(&volume.voxels);
                let labels = Labels::threshold(values, volume.shape, [0; 3], volume.shape, iso);
                marching_cubes(&labels, &samples, iso, &volume.frame, &Monitor::silent())
            });
        });
        let parameters = SurfaceParameters::default();
        c.bench_function(&format!("extract {n}^3"), |b| {
            b.iter(|| extract(black_box(&volume), &parameters, &Monitor::silent()));
        });
    }
}

criterion_group!(benches, surface);
criterion_main!(benches);
