//! Re-tiling a ventricle-shaped cup by both methods, for different numbers of points.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use ventriform::base::progress::Monitor;
use ventriform::mesh::shapes;
use ventriform::surface::from_mesh;
use ventriform::surface::retile::{Method, RetileParameters, retile};

fn bench(criterion: &mut Criterion) {
    let monitor = Monitor::silent();
    // About as many triangles as Marching Cubes gives for a 128³ volume with 2 mm voxels.
    let surface = from_mesh(shapes::cup(75.0, 32.0, 11.0, 110), 2.0).expect("a closed cup");
    let mut group = criterion.benchmark_group("retile");
    group.sample_size(10);
    for (name, method, counts) in [
        ("refined", Method::Refined, &[67, 150, 1000, 5000][..]),
        ("paper", Method::Paper, &[67, 150][..]),
    ] {
        for &points in counts {
            let parameters = RetileParameters {
                points,
                method,
                ..RetileParameters::default()
            };
            group.bench_function(BenchmarkId::new(name, points), |b| {
                b.iter(|| retile(black_box(&surface), &parameters, &monitor));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
