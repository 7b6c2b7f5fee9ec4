//! Fit and flips, and flips alone, of re-tiled models of a ventricle-shaped cup.

use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use ventriform::base::progress::Monitor;
use ventriform::mesh::shapes;
use ventriform::surface::from_mesh;
use ventriform::surface::optimise::{
    LeastSquaresParameters, OptimiseParameters, Reference, optimise,
};
use ventriform::surface::retile::{RetileParameters, retile};

fn bench(criterion: &mut Criterion) {
    let monitor = Monitor::silent();
    // About as many triangles as Marching Cubes gives for a 128³ volume with 2 mm voxels.
    let surface = from_mesh(shapes::cup(75.0, 32.0, 11.0, 110), 2.0).expect("a closed cup");
    let reference = Reference::new(&surface);
    let fitted = OptimiseParameters::default();
    let flipped = OptimiseParameters {
        fit: LeastSquaresParameters {
            rounds: 0,
            ..LeastSquaresParameters::default()
        },
        ..OptimiseParameters::default()
    };
    let mut group = criterion.benchmark_group("optimise");
    group.sample_size(10);
    for points in [67, 150, 300, 1000] {
        let parameters = RetileParameters {
            points,
            ..RetileParameters::default()
        };
        let tiled = retile(&surface, &parameters, &monitor).expect("enough points");
        for (name, parameters) in [("fit_and_flips", &fitted), ("flips", &flipped)] {
            group.bench_function(BenchmarkId::new(name, points), |b| {
                b.iter_batched(
                    || &tiled,
                    |tiled| optimise(tiled, &reference, parameters, &monitor),
                    BatchSize::SmallInput,
                );
            });
        }
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
