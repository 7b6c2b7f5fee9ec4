//! Our models against the reference model, a surface thinned out by quadric error, at the
//! same number of points and on simulated hearts.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use ventriform::decimate::decimate;
use ventriform::deform::template::{Organ, Template};
use ventriform::deform::voxelise::{Mask, voxelise};
use ventriform::deform::{DeformParameters, fit};
use ventriform::evaluate::masks::compare;
use ventriform::mesh::TriMesh;
use ventriform::optimise::{self, Reference};
use ventriform::parameters::ModelParameters;
use ventriform::progress::Monitor;
use ventriform::volume::Volume;
use ventriform::volume::phantom::{Phantom, PhantomParameters, phantom};
use ventriform::{retile, surface};

fn heart(seed: u64) -> Phantom {
    let parameters = PhantomParameters {
        shape: [64; 3],
        spacing_mm: [4.0; 3],
        length_mm: 80.0 + 4.0 * (seed % 4) as f64,
        width_mm: 62.0 + 3.0 * (seed % 3) as f64,
        seed,
        ..PhantomParameters::default()
    };
    phantom(&parameters, &Monitor::silent()).unwrap()
}

/// Our model and the reference model of `points` points, and how fit they are.
fn models(volume: &Volume, points: usize) -> [(TriMesh, f64); 2] {
    let monitor = Monitor::silent();
    let pairs = [("points", points.to_string())];
    let parameters =
        ModelParameters::from_pairs(pairs.iter().map(|(n, t)| (*n, t.as_str()))).unwrap();
    let surface = surface::extract(volume, &parameters.surface, &monitor).unwrap();
    let reference = Reference::new(&surface);
    let tiled = retile::retile(&surface, &parameters.retile, &monitor).unwrap();
    let ours = optimise::optimise(&tiled, &reference, &parameters.optimise, &monitor).unwrap();
    let thinned = decimate(&surface.mesh, points, &monitor).unwrap();
    [ours.mesh, thinned].map(|mesh| {
        let fitness = optimise::assess(&mesh, &reference, [1.0; 4]).unwrap();
        (mesh, fitness.normalised)
    })
}

/// Mean E_J of a model over patients, against the true wall.
fn agreement(model: TriMesh, patients: &[Phantom]) -> f64 {
    let template = Template::new(model, Organ::LeftVentricle, &Monitor::silent()).unwrap();
    let one = |patient: &Phantom| {
        let volume = &patient.volume;
        let parameters = DeformParameters::default();
        let fit = fit(volume, &template, &parameters, &Monitor::silent()).unwrap();
        let mask = voxelise(&fit.mesh, volume.shape, &volume.frame);
        let truth = Mask {
            shape: volume.shape,
            voxels: patient.truth.voxels.iter().map(|v| *v > 0.5).collect(),
        };
        compare(&mask, &truth, volume.frame.spacing())
            .unwrap()
            .jaccard
    };
    patients.iter().map(one).sum::<f64>() / patients.len() as f64
}

#[test]
fn our_models_are_fitter_and_segment_better_than_the_reference_of_as_many_points() {
    let patients: Vec<Phantom> = (11..15).map(heart).collect();
    let mut gains = Vec::new();
    for points in [67, 110] {
        for template in [1, 2] {
            let [(ours, fitness), (reference, plain)] = models(&heart(template).volume, points);
            assert!(
                fitness > 1.2 * plain,
                "{points} points: fitness {fitness} against {plain}"
            );
            gains.push(agreement(ours, &patients) - agreement(reference, &patients));
        }
    }
    let mean = gains.iter().sum::<f64>() / gains.len() as f64;
    assert!(mean > 0.002, "E_J gained {gains:?}");
}
