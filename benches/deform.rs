//! Fits a 150-point model to a 128³ volume, on one core.
//!
//! The same run also generates such a model from such a volume. The ratio of the two times hardly
//! depends on the machine; the times do.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use ventriform::base::progress::Monitor;
use ventriform::heart::deform::DeformParameters;
use ventriform::heart::fit::fit;
use ventriform::heart::model::{Organ, Template};
use ventriform::image::grid::voxelise::voxelise;
use ventriform::image::locate;
use ventriform::image::volume::Volume;
use ventriform::image::volume::phantom::{PhantomParameters, phantom};
use ventriform::parameters::ModelParameters;
use ventriform::surface;
use ventriform::surface::optimise;
use ventriform::surface::retile;

fn benchmarks(criterion: &mut Criterion) {
    // One thread, so that the times compare work and not the number of cores.
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()
        .expect("nothing has used the pool yet");
    let monitor = Monitor::silent();
    let patient = |seed| {
        let parameters = PhantomParameters {
            shape: [128; 3],
            seed,
            ..PhantomParameters::default()
        };
        phantom(&parameters, &monitor).expect("a phantom of the default kind")
    };
    let healthy = patient(1);
    let volume = patient(2).volume;
    let parameters = ModelParameters::from_pairs([("points", "150")]).expect("a known name");
    let mut group = criterion.benchmark_group("deform");
    group.sample_size(10);
    let generate = |volume: &Volume| {
        let surface = surface::extract(volume, &parameters.surface, &monitor)
            .expect("the phantom has a surface");
        let tiled =
            retile::retile(&surface, &parameters.retile, &monitor).expect("150 points suit it");
        let reference = optimise::Reference::new(&surface);
        optimise::optimise(&tiled, &reference, &parameters.optimise, &monitor)
            .expect("a re-tiled surface can be optimised")
            .mesh
    };
    let template = Template::new(generate(&healthy.volume), Organ::LeftVentricle, &monitor)
        .expect("the phantom is a ventricle");
    let settings = DeformParameters::default();
    group.bench_function("generate 150 points 128³", |b| {
        b.iter(|| generate(black_box(&volume)));
    });
    group.bench_function("localise 128³", |b| {
        b.iter(|| {
            let heart = locate::find(black_box(&volume), &settings.hints, &monitor);
            heart.and_then(|heart| heart.localisation())
        });
    });
    group.bench_function("fit 150 points 128³", |b| {
        b.iter(|| fit(black_box(&volume), &template, &settings, &monitor));
    });
    let fitted = fit(&volume, &template, &settings, &monitor).expect("the phantom has a heart");
    group.bench_function("voxelise 128³", |b| {
        b.iter(|| {
            voxelise(
                black_box(&fitted.model.mesh),
                volume.shape,
                &volume.frame,
                &monitor,
            )
        });
    });
    group.finish();
}

criterion_group!(benches, benchmarks);
criterion_main!(benches);
