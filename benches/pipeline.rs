//! The pipeline: reading a compressed scan, and going from its voxels to the measured model.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::{
    self, PhantomParameters, ReadLimits, ReadOptions, VolumeFile, phantom,
};
use ventriform::parameters::ModelParameters;
use ventriform::runs::pipeline;

fn bench(criterion: &mut Criterion) {
    let monitor = Monitor::silent();
    let scan = PhantomParameters {
        spacing_mm: [2.0; 3],
        ..PhantomParameters::default()
    };
    let made = phantom(&scan, &monitor).expect("valid parameters");
    let mut group = criterion.benchmark_group("pipeline");
    group.sample_size(10);
    let (options, limits) = (ReadOptions::default(), ReadLimits::default());
    for (name, stored) in [
        ("int16", StoredType::Int16),
        ("float32", StoredType::Float32),
    ] {
        let packed = nifti::write(&made.volume, stored, true).expect("a small volume");
        let files = [VolumeFile::in_memory("scan.nii.gz", packed)];
        group.bench_function(BenchmarkId::new("read .nii.gz", name), |b| {
            b.iter(|| volume::read(black_box(&files), &options, &limits, &monitor));
        });
    }
    let bytes = nifti::write(&made.volume, StoredType::Float32, false).expect("a small volume");
    let file = VolumeFile::in_memory("scan.nii", bytes);
    let reading = volume::read(&[file], &options, &limits, &monitor).expect("what was written");
    for points in [150, 1000] {
        let mut parameters = ModelParameters::default();
        parameters.retile.points = points;
        group.bench_function(BenchmarkId::new("volume to model", points), |b| {
            b.iter(|| pipeline::from_reading(black_box(&reading), &parameters, 0.0, &monitor));
        });
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
