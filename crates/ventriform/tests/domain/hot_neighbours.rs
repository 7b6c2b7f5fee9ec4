//! Results of phantoms with a known difficulty: a defect of the base, a right ventricle as bright as the
//! left one.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use ventriform::base::progress::Monitor;
use ventriform::image::grid::agreement::compare;
use ventriform::image::grid::voxelise::Mask;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PerfusionDefect, Phantom, PhantomParameters, phantom};
use ventriform::image::volume::{ReadLimits, VolumeFile};
use ventriform::parameters::{FitParameters, Parameters};
use ventriform::runs::segmentation::{SegmentationOrder, SegmentedVolume, from_files};

fn scan(change: impl FnOnce(&mut PhantomParameters)) -> Phantom {
    let mut parameters = PhantomParameters {
        shape: [64; 3],
        spacing_mm: [4.0; 3],
        ..PhantomParameters::default()
    };
    change(&mut parameters);
    phantom(&parameters, &Monitor::silent()).unwrap()
}

fn segmented(scan: &Phantom, edge: &str) -> SegmentedVolume {
    let bytes = nifti::write(&scan.volume, StoredType::Int16, false).unwrap();
    let parameters = FitParameters::from_pairs([("edge", edge)]).unwrap();
    let files = [VolumeFile::in_memory("scan.nii", bytes)];
    let order = SegmentationOrder::of_built_in_hearts(&files, &parameters);
    from_files(&order, &ReadLimits::default(), &Monitor::silent()).unwrap()
}

fn defects(segments: &[u8], severity: f64) -> Vec<PerfusionDefect> {
    let defect = |segment: &u8| PerfusionDefect {
        segment: *segment,
        severity,
    };
    segments.iter().map(defect).collect()
}

/// Blur takes from the wall's end at the base, and that is no defect.
#[test]
fn the_base_of_an_even_heart_has_no_rim() {
    for seed in [1, 12, 13] {
        let made = segmented(&scan(|p| p.seed = seed), "apparent");
        let map = made.segmentation.polar.as_ref().unwrap();
        assert_eq!(map.extent_percent, 0.0, "seed {seed}");
        let basal = &map.segments[..6];
        let area: f64 = basal.iter().map(|s| s.area).sum();
        let ring = basal
            .iter()
            .map(|s| s.area * s.mean_percent.unwrap())
            .sum::<f64>()
            / area;
        assert!(ring > 93.0, "seed {seed}: {ring}");
    }
}

#[test]
fn a_defect_of_the_base_is_seen_in_its_segment_and_in_no_other() {
    for (seed, segment) in [(1, 1), (2, 3), (3, 4), (4, 5)] {
        let scan = scan(|p| {
            p.seed = seed;
            p.defects = defects(&[segment], 0.8);
        });
        let made = segmented(&scan, "apparent");
        let map = made.segmentation.polar.as_ref().unwrap();
        for found in &map.segments {
            let mean = found.mean_percent.unwrap();
            if found.number == usize::from(segment) {
                assert!(mean < 65.0 && found.extent_percent > 40.0, "{found:?}");
            } else {
                // Blur carries some of it into the segments beside it.
                assert!(mean > 70.0 && found.extent_percent < 20.0, "{found:?}");
            }
        }
        // One basal segment is a 45th to an 18th of the wall (36 phantoms), and two fifths of it or more are dark.
        assert!(
            (0.9..9.0).contains(&map.extent_percent),
            "{}",
            map.extent_percent
        );
    }
}

#[test]
fn a_hot_right_ventricle_is_left_out_or_doubted() {
    let septum = [2, 3, 8, 9];
    for (seed, uptake, infarct) in [
        (1, 1.2, false),
        (2, 1.6, false),
        (1, 0.9, true),
        (3, 1.2, true),
    ] {
        let scan = scan(|p| {
            p.seed = seed;
            p.right_ventricle = uptake;
            if infarct {
                p.defects = defects(&septum, 1.0);
            }
        });
        let made = segmented(&scan, "anatomical");
        let fit = &made.segmentation.fit;
        let truth = Mask {
            shape: scan.truth.shape,
            voxels: scan.truth.voxels.iter().map(|v| *v > 0.5).collect(),
        };
        let spacing = scan.truth.frame.spacing();
        let found = compare(&made.segmentation.mask, &truth, spacing, &Monitor::silent()).unwrap();
        let flagged = !fit.judgement.flags.is_empty() || fit.judgement.confidence < 0.5;
        let least = if infarct { 0.7 } else { 0.8 };
        assert!(
            found.jaccard > least || flagged,
            "{uptake} {infarct}: {:.3}, {:.2}",
            found.jaccard,
            fit.judgement.confidence
        );
    }
}
