//! The beat of a heart whose volumes are known: half an ellipsoid that shrinks and thickens, its muscle kept.

use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::sync::OnceLock;

use dicom_core::value::DataSetSequence;
use dicom_core::{DataElement, PrimitiveValue, VR};
use dicom_dictionary_std::{tags, uids};
use dicom_object::{DefaultDicomObject, FileMetaTableBuilder, InMemDicomObject, from_reader};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::ThreadPoolBuilder;
use serde_json::json;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::heart::beat::BeatFlag;
use ventriform::heart::beat::phase::behind;
use ventriform::image::grid::Volume;
use ventriform::image::grid::blur::{Kernel, blur};
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::{Provenance, ReadLimits, VolumeError, VolumeFile, read_gates};
use ventriform::mesh::intersections::self_intersections;
use ventriform::parameters::{BeatChoice, FitParameters};
use ventriform::results::export::Format;
use ventriform::results::export::dicom::{DicomBeat, Moment, Structure};
use ventriform::results::report::{BeatReport, SegmentMotionReport};
use ventriform::runs::gated::{GatedError, GatedHeart, GatedOrder, beat_figures, from_files};

/// Length of wall basal of the ellipsoid's centre, mm.
const BASE_MM: f64 = 14.0;
/// Width of a point in the gates, mm.
const RESOLUTION_MM: f64 = 13.0;
const SPACING_MM: f64 = 4.5;
const GATE_COUNT: usize = 8;

/// Semi-axes of the cavity across and along the axis, mm, at a share of the contraction (0 end diastole, 1 end
/// systole).
fn cavity_axes(contraction: f64) -> [f64; 2] {
    [24.0 - 7.5 * contraction, 50.0 - 4.0 * contraction]
}

/// Volume of half an ellipsoid and of the part basal of its centre, ml.
fn volume_ml([across, along]: [f64; 2]) -> f64 {
    let basal = BASE_MM - BASE_MM.powi(3) / (3.0 * along * along);
    PI * across * across * (2.0 / 3.0 * along + basal) / 1000.0
}

/// The wall's thickness that keeps the muscle of a wall of 9 mm at end diastole.
fn thickness_mm(contraction: f64) -> f64 {
    let muscle = |contraction: f64, thickness: f64| {
        let inner = cavity_axes(contraction);
        volume_ml(inner.map(|axis| axis + thickness)) - volume_ml(inner)
    };
    let wanted = muscle(0.0, 9.0);
    let (mut low, mut high) = (1.0, 30.0);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if muscle(contraction, middle) < wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// The contraction at a turn of the beat: end systole at three eighths; filling takes longer than ejection.
fn contraction(turns: f64) -> f64 {
    let turns = turns.rem_euclid(1.0);
    let way = if turns < 0.375 {
        turns / 0.375
    } else {
        (1.0 - turns) / 0.625
    };
    (1.0 - (PI * way).cos()) / 2.0
}

/// Blurs voxels of [`SPACING_MM`] by a Gaussian of this full width at half maximum.
fn blur_by(width_mm: f64, voxels: &mut Vec<f32>, shape: [usize; 3]) {
    let kernel = || Kernel::gaussian(width_mm / 2.3548 / SPACING_MM, 4.0);
    let kernels = [kernel(), kernel(), kernel()];
    blur(voxels, shape, &kernels, &Monitor::silent()).expect("nobody cancels");
}

/// One gate: the mean of five moments.
fn gate(index: usize) -> Volume {
    let shape = [40; 3];
    let centre = Vec3::new(20.0, -20.0, 30.0);
    let frame = VoxelToPatient::centred(shape, [SPACING_MM; 3], centre).expect("a grid");
    let axis = Vec3::new(0.64, -0.60, -0.48).normalize();
    const MOMENTS_PER_GATE: usize = 5;
    let mut sum = vec![0.0f32; 64_000];
    for moment in 0..MOMENTS_PER_GATE {
        let turns =
            (index as f64 + (moment as f64 + 0.5) / MOMENTS_PER_GATE as f64) / GATE_COUNT as f64;
        let share = contraction(turns);
        let [across, along] = cavity_axes(share);
        let thickness = thickness_mm(share);
        let activity = |p: &Vec3| {
            let from = p - centre;
            let s = from.dot(&axis);
            let rho = (from - axis * s).norm();
            let inside = |a: f64, b: f64| {
                // Half a voxel of ramp: distance from the surface by its gradient.
                let f = (rho / a).powi(2) + (s / b).powi(2);
                let slope = 2.0 * ((rho / (a * a)).powi(2) + (s / (b * b)).powi(2)).sqrt();
                ((1.0 - f) / slope.max(1e-6) / SPACING_MM + 0.5).clamp(0.0, 1.0)
            };
            let apical = ((s + BASE_MM) / SPACING_MM + 0.5).clamp(0.0, 1.0);
            let (inner, outer) = (
                inside(across, along),
                inside(across + thickness, along + thickness),
            );
            100.0 * (apical * (outer - inner).max(0.0))
                + 12.0 * inner * apical
                + 10.0 * (1.0 - outer)
        };
        let scene = Volume::sampled(shape, frame.clone(), activity);
        sum.iter_mut()
            .zip(scene.voxels)
            .for_each(|(sum, v)| *sum += v / MOMENTS_PER_GATE as f32);
    }
    blur_by(RESOLUTION_MM, &mut sum, shape);
    Volume {
        shape,
        voxels: sum,
        frame,
        integral: false,
    }
}

fn gates() -> &'static [Volume] {
    static GATES_MADE: OnceLock<Vec<Volume>> = OnceLock::new();
    GATES_MADE.get_or_init(|| (0..GATE_COUNT).map(gate).collect())
}

/// The beat of gates in separate files.
fn beat_of(gates: &[Volume], choice: BeatChoice) -> Result<GatedHeart, GatedError> {
    beat_by(gates, choice, &FitParameters::default())
}

/// The beat of a heart whose muscle weighs so much, g.
fn beat_of_mass(gates: &[Volume], mass_g: f64) -> Result<GatedHeart, GatedError> {
    let parameters = FitParameters {
        mass_g: Some(mass_g),
        ..FitParameters::default()
    };
    beat_by(gates, BeatChoice::default(), &parameters)
}

fn beat_by(
    gates: &[Volume],
    choice: BeatChoice,
    parameters: &FitParameters,
) -> Result<GatedHeart, GatedError> {
    let file = |(index, gate): (usize, &Volume)| {
        let bytes = nifti::write(gate, StoredType::Float32, false).expect("floats fit");
        VolumeFile::in_memory(format!("gate{index}.nii"), bytes)
    };
    let files: Vec<VolumeFile> = gates.iter().enumerate().map(file).collect();
    let order = GatedOrder {
        gates: &files,
        auto: true,
        models: Vec::new(),
        normals: None,
        parameters,
        choice,
    };
    from_files(&order, &ReadLimits::default(), &Monitor::silent())
}

fn whole() -> &'static GatedHeart {
    static WHOLE_BEAT: OnceLock<GatedHeart> = OnceLock::new();
    WHOLE_BEAT.get_or_init(|| beat_of(gates(), BeatChoice::default()).expect("a beat"))
}

fn codes(heart: &GatedHeart) -> Vec<String> {
    heart
        .report()
        .flags
        .into_iter()
        .map(|flag| flag.code)
        .collect()
}

/// Gut that lies beside the wall in half of the gates is told; the same gut in all of them does not move.
#[test]
fn activity_beside_the_wall_that_changes_is_flagged() {
    let flagged = |heart: &GatedHeart| codes(heart).contains(&"activity_beside_wall".to_owned());
    assert!(!flagged(whole()));
    let moment = whole().beat.fit.moment(0.0);
    // A place 14 mm outside of the middle of the wall.
    let ray = moment.outer.len() / 2;
    let way = (moment.outer[ray] - moment.inner[ray]).normalize();
    let place = moment.outer[ray] + way * 14.0;
    let hottest = (gates()[0].voxels.iter().copied()).fold(0.0, f32::max);
    let with_gut = |is_there: fn(usize) -> bool| {
        let gate = |(index, gate): (usize, &Volume)| {
            let mut gate = gate.clone();
            let [nx, ny, _] = gate.shape;
            for n in (0..gate.voxels.len()).filter(|_| is_there(index)) {
                let voxel = [n % nx, n / nx % ny, n / (nx * ny)].map(|i| i as f64);
                let away = (gate.frame.to_patient(&Vec3::from(voxel)) - place).norm();
                let blob = (-0.5 * ((away - 6.0).max(0.0) / 5.5).powi(2)).exp();
                gate.voxels[n] += 1.2 * hottest * blob as f32;
            }
            gate
        };
        let gates: Vec<Volume> = gates().iter().enumerate().map(gate).collect();
        beat_of(&gates, BeatChoice::default()).expect("a beat")
    };
    assert!(flagged(&with_gut(|gate| gate >= GATE_COUNT / 2)));
    assert!(!flagged(&with_gut(|_| true)));
}

#[test]
fn volumes_and_ejection_fraction_are_those_of_the_heart() {
    let report = whole().report();
    let [edv, esv] = [0.0, 1.0].map(|share| volume_ml(cavity_axes(share)));
    let ef = 100.0 * (1.0 - esv / edv);
    let found = report.ef_percent.unwrap();
    assert!((found - ef).abs() < 5.0, "EF {found} of {ef}");
    for (name, found, wanted) in [("EDV", report.edv_ml, edv), ("ESV", report.esv_ml, esv)] {
        assert!(
            (found / wanted - 1.0).abs() < 0.15,
            "{name} {found} of {wanted}"
        );
    }
    assert!(
        [1, 8].contains(&report.end_diastole_gate),
        "{}",
        report.end_diastole_gate
    );
    assert!(
        [3, 4].contains(&report.end_systole_gate),
        "{}",
        report.end_systole_gate
    );
    assert!(
        (report.end_systole_degrees - 135.0).abs() < 15.0,
        "{}",
        report.end_systole_degrees
    );
    // A gate is a mean over its width: the extremes of the gates lie inside those of the curve.
    assert!(report.ef_of_gates_percent.unwrap() < found);
}

#[test]
fn the_muscle_is_kept_over_the_beat() {
    let report = whole().report();
    assert!(
        report.wall_swing_percent < 3.0,
        "{}",
        report.wall_swing_percent
    );
}

/// Every part of the wall contracts at once and about equally.
#[test]
fn an_even_contraction_is_even_and_in_phase() {
    let report = whole().report();
    assert!(report.phase.reliable);
    assert!(report.phase.sd_degrees < 8.0, "{}", report.phase.sd_degrees);
    let [thin, thick] = [0.0, 1.0].map(thickness_mm);
    let wanted = 100.0 * (thick / thin - 1.0);
    let all = report
        .segments
        .iter()
        .map(|segment| segment.thickening_percent);
    let mean = all.sum::<f64>() / report.segments.len() as f64;
    assert!((mean - wanted).abs() < 0.3 * wanted, "{mean} of {wanted}");
    assert_eq!(report.segments.len(), 17);
}

/// The gates with noise of this deviation in every voxel, independent in every gate, blurred by 8 mm.
fn noisy(deviation: f64, seed: u64) -> Vec<Volume> {
    const NOISE_MM: f64 = 8.0;
    let noisy = |(index, gate): (usize, &Volume)| {
        let mut random = Pcg64Mcg::seed_from_u64(100 * seed + index as u64);
        let mut normal = || {
            let [radius, turns] = [(); 2].map(|()| random.random_range(f64::MIN_POSITIVE..1.0));
            ((-2.0 * radius.ln()).sqrt() * (2.0 * PI * turns).cos()) as f32
        };
        let mut noise: Vec<f32> = gate.voxels.iter().map(|_| normal()).collect();
        blur_by(NOISE_MM, &mut noise, gate.shape);
        let square = noise.iter().map(|n| n * n).sum::<f32>() / noise.len() as f32;
        let scale = deviation as f32 / square.sqrt();
        Volume {
            voxels: (gate.voxels.iter().zip(noise))
                .map(|(v, n)| v + scale * n)
                .collect(),
            ..gate.clone()
        }
    };
    gates().iter().enumerate().map(noisy).collect()
}

/// Scatter of the segments' phases by noise of this deviation, root mean square over three studies, and what the
/// reports tell of it, degrees.
fn phase_errors(deviation: f64) -> [f64; 2] {
    let clean = whole().report().segments;
    let (mut squares, mut told, mut count) = (0.0, 0.0, 0.0);
    for seed in 0..3 {
        let report = beat_of(&noisy(deviation, seed), BeatChoice::default())
            .expect("a beat")
            .report();
        told += report.phase.noise_degrees.powi(2) / 3.0;
        let error = |(noisy, clean): (&SegmentMotionReport, &SegmentMotionReport)| {
            Some(behind(noisy.phase_degrees?, clean.phase_degrees?))
        };
        let errors: Vec<f64> = report
            .segments
            .iter()
            .zip(&clean)
            .filter_map(error)
            .collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        squares += errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>();
        count += errors.len() as f64;
    }
    [(squares / count).sqrt(), told.sqrt()]
}

#[test]
fn the_scatter_of_phases_by_noise_is_told() {
    let clean = whole().report().phase.noise_degrees;
    let [few, told_few] = phase_errors(8.0);
    let [more, told_more] = phase_errors(16.0);
    assert!(clean < 0.5 * told_few, "{clean}, {told_few}");
    for (error, told) in [(few, told_few), (more, told_more)] {
        // The whole wall's noise is told, that of segments is measured.
        assert!((0.5..1.5).contains(&(error / told)), "{error}, {told}");
    }
}

#[test]
fn phases_that_are_noise_are_not_reliable() {
    let heart = beat_of(&noisy(40.0, 7), BeatChoice::default()).expect("a beat");
    let report = heart.report();
    assert!(
        report.phase.noise_degrees > 10.0,
        "{}",
        report.phase.noise_degrees
    );
    assert!(!report.phase.reliable);
    assert!(codes(&heart).contains(&"phase_unreliable".to_owned()));
}

/// Blur lets a part of the thickening through; both opinions find it.
#[test]
fn counts_give_a_second_opinion_on_thickening() {
    let report = whole().report();
    let [thin, thick] = [0.0, 1.0].map(thickness_mm);
    let truth = 100.0 * (thick / thin - 1.0);
    let counts = report.segments.iter().map(|segment| {
        let counts = segment.thickening_counts_percent;
        counts.expect("a wall with counts")
    });
    let mean = counts.sum::<f64>() / report.segments.len() as f64;
    assert!((0.3..1.0).contains(&(mean / truth)), "{mean} of {truth}");
}

/// The moments of the curve fall on others by a rotation of eight gates only where they divide evenly, so EF may differ
/// by the curve's grid.
#[test]
fn gates_that_begin_elsewhere_in_the_cycle_give_the_same_figures() {
    let whole = whole().report();
    for turn in [3, 6] {
        let mut rotated = gates().to_vec();
        rotated.rotate_left(turn);
        let report = beat_of(&rotated, BeatChoice::default()).unwrap().report();
        let [found, first] = [&report, &whole].map(|report| report.ef_percent.unwrap());
        assert!((found - first).abs() < 0.05, "{found} {first}");
        let later = (whole.end_systole_degrees - report.end_systole_degrees).rem_euclid(360.0);
        assert!((later - 45.0 * turn as f64).abs() < 0.5, "{later}");
        for (found, first) in report
            .gates
            .iter()
            .zip(whole.gates.iter().cycle().skip(turn))
        {
            let apart = (found.cavity_ml - first.cavity_ml).abs();
            assert!(apart < 0.05, "{} {}", found.cavity_ml, first.cavity_ml);
        }
        for (found, first) in report.segments.iter().zip(&whole.segments) {
            let apart = (found.motion_mm - first.motion_mm).abs();
            assert!(apart < 0.05, "{} {}", found.motion_mm, first.motion_mm);
        }
    }
}

/// A quarter of the counts of the last gate is lost, as after irregular beats: its factor says so, no flag does.
#[test]
fn lost_counts_are_made_up_by_the_factor_and_change_little() {
    let mut lossy = gates().to_vec();
    lossy[7].voxels.iter_mut().for_each(|v| *v *= 0.75);
    let heart = beat_of(&lossy, BeatChoice::default()).unwrap();
    assert!(!codes(&heart).contains(&"count_loss".to_owned()));
    let [lossy, usual] = [&heart, whole()].map(|heart| heart.report().gates[7].counts_factor);
    assert!((lossy * 0.75 / usual - 1.0).abs() < 0.02, "{lossy} {usual}");
    let [found, first] = [&heart, whole()].map(|heart| heart.report().ef_percent.unwrap());
    assert!((found - first).abs() < 2.0, "{found} {first}");
}

#[test]
fn gates_that_show_no_beat_have_no_ejection_fraction() {
    let shuffled: Vec<Volume> = [0, 4, 1, 6, 2, 7, 3, 5].map(|n| gates()[n].clone()).into();
    let repeated = vec![gates()[0].clone(); 8];
    for gates in [shuffled, repeated] {
        let choice = BeatChoice {
            rr_ms: Some(850.0),
            ..BeatChoice::default()
        };
        let heart = beat_of(&gates, choice).unwrap();
        assert!(codes(&heart).contains(&"no_contraction".to_owned()));
        let report = heart.report();
        let none = (report.ef_percent, report.sv_ml, report.rates.as_ref());
        assert_eq!(none, (None, None, None));
        assert!(report.no_rates.unwrap().contains("no beat"));
        let intervals = (report.edv_interval_ml, report.esv_interval_ml);
        assert_eq!(intervals, (None, None));
        assert!(!report.phase.reliable);
        // Normal limits are not built of it, nor compared with it.
        let figures = beat_figures(&heart.segmentation, &heart.beat);
        let names: Vec<&str> = figures.iter().map(|own| own.figure).collect();
        assert_eq!(names, ["cavity_ml", "wall_ml"]);
    }
}

/// Gates that are all their mean do not move, whatever their noise.
#[test]
fn a_flat_study_has_no_ejection_fraction() {
    let count = gates()[0].voxels.len();
    let mean: Vec<f32> = (0..count)
        .map(|at| gates().iter().map(|gate| gate.voxels[at]).sum::<f32>() / GATE_COUNT as f32)
        .collect();
    for noise in [0.0, 3.0] {
        let mut state = 1u32;
        let mut draw = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        let mut gate = |_| Volume {
            voxels: mean.iter().map(|v| v + noise * draw()).collect(),
            ..gates()[0].clone()
        };
        let flat: Vec<Volume> = (0..GATE_COUNT).map(&mut gate).collect();
        let heart = beat_of(&flat, BeatChoice::default()).unwrap();
        assert!(
            codes(&heart).contains(&"no_contraction".to_owned()),
            "noise {noise}"
        );
        assert_eq!(heart.report().ef_percent, None, "noise {noise}");
    }
}

/// A gate that has twice its counts is named, and not all the others.
#[test]
fn too_many_counts_are_told_of_the_gate_that_has_them() {
    let mut faulty = gates().to_vec();
    faulty[7].voxels.iter_mut().for_each(|v| *v *= 2.0);
    let heart = beat_of(&faulty, BeatChoice::default()).unwrap();
    let told: Vec<&BeatFlag> = (heart.beat.flags.iter())
        .filter(|flag| ["count_gain", "count_loss"].contains(&flag.code()))
        .collect();
    let [BeatFlag::CountGain { gains }] = told[..] else {
        panic!("{told:?}");
    };
    assert_eq!(gains.len(), 1);
    assert!(
        gains[0].0 == 8 && (gains[0].1 - 1.0).abs() < 0.1,
        "{gains:?}"
    );
    let [found, first] = [&heart, whole()].map(|heart| heart.report().ef_percent.unwrap());
    assert!((found - first).abs() < 2.0, "{found} {first}");
}

/// No heart of this size has 400 g of muscle: the wall that was fitted says so.
#[test]
fn a_mass_that_the_wall_cannot_have_is_told() {
    let usual_g = whole().report().mass_g;
    for (mass_g, told) in [(400.0, true), (usual_g, false)] {
        let heart = beat_of_mass(gates(), mass_g).unwrap();
        let found = codes(&heart).contains(&"mass_not_met".to_owned());
        assert_eq!(found, told, "{mass_g}: {}", heart.report().mass_g);
    }
}

/// More than three tenths of a gate's counts are gone: it is left out of the curve, and told.
#[test]
fn a_gate_with_few_counts_is_left_out_of_the_curve() {
    let mut lossy = gates().to_vec();
    lossy[7].voxels.iter_mut().for_each(|v| *v *= 0.6);
    let report = beat_of(&lossy, BeatChoice::default()).unwrap().report();
    let told = report
        .flags
        .iter()
        .find(|flag| flag.code == "count_loss")
        .unwrap();
    assert!(told.reason.contains("gate 8 40 %") && told.reason.contains("left out"));
    let [found, first] = [&report, &whole().report()].map(|report| report.ef_percent.unwrap());
    assert!((found - first).abs() < 3.0, "{found} {first}");
}

/// The gates, each voxel as `change` makes it of its value, its place and the turns of the cycle.
fn changed(change: impl Fn(f32, &Vec3, f64) -> f32) -> Vec<Volume> {
    let changed = |(index, gate): (usize, &Volume)| {
        let turns = (index as f64 + 0.5) / GATE_COUNT as f64;
        let [columns, rows, _] = gate.shape;
        let place = |at: usize| {
            let index = [at % columns, at / columns % rows, at / columns / rows];
            gate.frame.to_patient(&Vec3::from(index.map(|n| n as f64)))
        };
        let voxels = gate.voxels.iter().enumerate();
        Volume {
            voxels: voxels
                .map(|(at, v)| change(*v, &place(at), turns))
                .collect(),
            ..gate.clone()
        }
    };
    gates().iter().enumerate().map(changed).collect()
}

/// Where the apex takes up nothing, it shows no motion: told, and the ejection fraction is less certain.
#[test]
fn a_dark_apex_is_told_and_widens_the_interval() {
    let apex = Vec3::new(20.0, -20.0, 30.0) + 54.0 * Vec3::new(0.64, -0.60, -0.48).normalize();
    let dark = changed(|v, place, _| {
        let share = (-((place - apex).norm() / 22.0).powi(4)).exp();
        v * (1.0 - share as f32) + 5.0 * share as f32
    });
    let heart = beat_of(&dark, BeatChoice::default()).unwrap();
    let raised = codes(&heart);
    assert!(raised.contains(&"dark_wall".to_owned()), "{raised:?}");
    let [report, first] = [heart.report(), whole().report()];
    let width = |report: &BeatReport| {
        let [low, high] = report.ef_interval_percent.unwrap();
        high - low
    };
    assert!(
        width(&report) > width(&first),
        "{} {}",
        width(&report),
        width(&first)
    );
    let [found, first] = [report, first].map(|report| report.ef_percent.unwrap());
    assert!((found - first).abs() < 6.0, "{found} {first}");
}

/// Gut beside the inferior wall, as bright as the wall, which moves against the beat.
#[test]
fn gut_that_moves_beside_the_wall_changes_little() {
    let beside = Vec3::new(28.0, -26.0, -24.0);
    let hot = changed(|v, place, turns| {
        let middle = beside + Vec3::new(0.0, 0.0, 6.0 * (2.0 * PI * turns).cos());
        v + 60.0 * (-(place - middle).norm_squared() / (2.0 * 9.0 * 9.0)).exp() as f32
    });
    let report = beat_of(&hot, BeatChoice::default()).unwrap().report();
    let [found, first] = [&report, &whole().report()].map(|report| report.ef_percent.unwrap());
    assert!((found - first).abs() < 5.0, "{found} {first}");
}

/// The apex lies outside of the volume.
#[test]
fn a_heart_that_leaves_the_field_is_told() {
    let cut = |gate: &Volume| {
        let [columns, rows, slices] = gate.shape;
        let first = 14;
        let origin = gate.frame.to_patient(&Vec3::new(0.0, 0.0, first as f64));
        Volume {
            shape: [columns, rows, slices - first],
            voxels: gate.voxels[columns * rows * first..].to_vec(),
            frame: VoxelToPatient::new(*gate.frame.linear(), origin).unwrap(),
            integral: false,
        }
    };
    let cut: Vec<Volume> = gates().iter().map(cut).collect();
    let raised = codes(&beat_of(&cut, BeatChoice::default()).unwrap());
    assert!(raised.contains(&"leaves_field".to_owned()), "{raised:?}");
}

#[test]
fn a_known_mass_is_met() {
    let [inner, outer] = [0.0, 9.0].map(|more| volume_ml(cavity_axes(0.0).map(|a| a + more)));
    let mass_g = 1.05 * (outer - inner);
    let report = beat_of_mass(gates(), mass_g).unwrap().report();
    let found = 1.05 * report.wall_ml;
    assert!((found / mass_g - 1.0).abs() < 0.05, "{found} of {mass_g}");
}

/// Meshes of all gates: the same triangles, closed without meeting themselves, as much muscle as the fit keeps. Sides
/// are named by the direction to the head, which views of the beat need; with no body about the heart, it is the
/// frame's.
#[test]
fn the_report_says_which_way_is_up() {
    let posture = whole().report().posture.unwrap();
    assert_eq!(posture.superior, [0.0, 0.0, 1.0]);
    assert_eq!(posture.source, "frame");
}

#[test]
fn every_gate_has_a_mesh_that_does_not_meet_itself() {
    let heart = whole();
    let meshes = heart.beat.fit.carried(&heart.wall.mesh, &heart.wall.wall);
    assert_eq!(meshes.len(), GATE_COUNT);
    for mesh in &meshes {
        assert_eq!(mesh.triangles, heart.wall.mesh.triangles);
        assert_eq!(self_intersections(mesh).len(), 0);
        let muscle = mesh.volume() / 1000.0;
        let kept = heart.report().wall_ml;
        assert!((muscle / kept - 1.0).abs() < 0.08, "{muscle} of {kept}");
    }
}

/// The page shows the figures of the report, and names nobody without a scan.
#[test]
fn the_page_has_figures_pictures_and_flags() {
    let heart = whole();
    let files = heart.files(&[], &Monitor::silent()).unwrap();
    let page = heart.page(&files, None);
    assert_eq!(page.name, "report.html");
    let page = String::from_utf8(page.bytes).unwrap();
    let report = heart.report();
    let [low, high] = report.ef_interval_percent.unwrap();
    for text in [
        format!("<b>{:.0} <small>%</small></b>", report.ef_percent.unwrap()),
        format!("Ejection fraction; 90 %: {low:.0} to {high:.0}"),
        format!("<b>{:.0} <small>ml</small></b>", report.edv_ml),
        "8 gates".to_owned(),
        format!("No rates: {}.", report.no_rates.clone().unwrap()),
        "The wall at end systole".to_owned(),
        report.segments[6].name.clone(),
    ] {
        assert!(page.contains(&text), "{text}");
    }
    assert_eq!(page.matches("data:image/svg+xml").count(), 8);
    assert!(!page.contains("Patient"));
    let named = Provenance {
        patient_name: Some("Doe^Jane".into()),
        ..Provenance::default()
    };
    let named = String::from_utf8(heart.page(&files, Some(&named)).bytes).unwrap();
    assert!(named.contains("Doe, Jane"));
    let still = beat_of(&vec![gates()[0].clone(); 8], BeatChoice::default()).unwrap();
    let still = String::from_utf8(still.page(&[], None).bytes).unwrap();
    assert!(
        still.contains("there is no ejection fraction")
            && still.contains("no: The gates are moments")
    );
    assert!(!still.contains("data:image/svg+xml"));
}

#[test]
fn one_thread_and_four_give_the_same_bytes() {
    let made = |threads: usize| {
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let heart = beat_of(gates(), BeatChoice::default()).unwrap();
            let files = heart.files(&[Format::Stl], &Monitor::silent()).unwrap();
            files
                .into_iter()
                .map(|file| (file.name, file.bytes))
                .collect::<Vec<_>>()
        })
    };
    let (one, four) = (made(1), made(4));
    assert!(one == four);
    let names: Vec<&str> = one.iter().map(|(name, _)| name.as_str()).collect();
    for name in [
        "beat.json",
        "mesh_ed.stl",
        "mesh_es.stl",
        "mesh_gate08.stl",
        "mesh.glb",
        "polar_es.json",
        "polar_phase.svg",
        "labels_gate01.nii.gz",
    ] {
        assert!(names.contains(&name), "{names:?}");
    }
}

#[test]
fn what_is_no_gated_study_is_refused_by_what_it_is() {
    let few = beat_of(&gates()[..5], BeatChoice::default()).unwrap_err();
    assert_eq!(
        few.to_string(),
        "the study has 5 gates; a beat needs 6 to 32"
    );
    let mut other = gates().to_vec();
    other[3].frame = VoxelToPatient::centred([40; 3], [4.0; 3], Vec3::zeros()).unwrap();
    let other = beat_of(&other, BeatChoice::default()).unwrap_err();
    let elsewhere = other.to_string();
    assert!(
        elsewhere.starts_with("gate 4 lies elsewhere"),
        "{elsewhere}"
    );
    let mut smaller = gates().to_vec();
    let frame = gates()[0].frame.clone();
    smaller[6] = Volume::sampled([40, 40, 39], frame, |_| 1.0);
    let smaller = beat_of(&smaller, BeatChoice::default()).unwrap_err();
    let text = smaller.to_string();
    assert!(
        text.starts_with("gate 7 has 40 x 40 x 39 voxels where gate 1 has 40 x 40 x 40"),
        "{text}"
    );
    let mut empty = gates().to_vec();
    empty[2].voxels.fill(0.0);
    let empty = beat_of(&empty, BeatChoice::default()).unwrap_err();
    assert!(
        empty.to_string().starts_with("gate 3 holds no counts"),
        "{empty}"
    );
    let one = beat_of(&gates()[..1], BeatChoice::default()).unwrap_err();
    assert!(
        matches!(one, GatedError::Volume(VolumeError::NotGated { .. })),
        "{one}"
    );
    let heavy = beat_of_mass(gates(), 1e4).unwrap_err();
    assert_eq!(
        heavy.to_string(),
        "`mass_g`: 10000 is no mass of a left ventricle"
    );
    let slow = BeatChoice {
        rr_ms: Some(1e5),
        ..BeatChoice::default()
    };
    let slow = beat_of(gates(), slow).unwrap_err();
    assert_eq!(
        slow.to_string(),
        "`rr_ms` is 100000; it must be 300 to 2500"
    );
}

/// Shells and folders sort `gate10` before `gate2`.
#[test]
fn files_of_gates_are_read_in_the_order_of_their_numbers() {
    let named = |index: usize, name: String| {
        let bytes = nifti::write(&gates()[index], StoredType::Float32, true).unwrap();
        VolumeFile::in_memory(name, bytes)
    };
    let read = |files: &[VolumeFile]| {
        read_gates(files, false, &ReadLimits::default(), &Monitor::silent()).unwrap()
    };
    let mut files: Vec<_> = (0..GATE_COUNT)
        .map(|index| named(index, format!("gate{}.nii.gz", index + 5)))
        .collect();
    files.sort_by(|a, b| a.name().cmp(b.name()));
    assert_eq!(files[0].name(), "gate10.nii.gz");
    let numbered = read(&files);
    let warnings = numbered.facts.warnings.join(" ");
    assert!(
        warnings.contains("8 files of one volume each")
            && warnings.contains("numbers in their names")
    );
    assert_eq!(numbered.facts.gates.unwrap().number, GATE_COUNT);
    let files: Vec<_> = "hbdfgcae"
        .chars()
        .zip(0..)
        .map(|(name, index)| named(index, format!("{name}.nii.gz")))
        .collect();
    for reading in [numbered, read(&files)] {
        for (read, made) in reading.gates.iter().zip(gates()) {
            assert_eq!(read.voxels, made.voxels);
        }
    }
    // All together are within the limits of one file.
    let limits = ReadLimits {
        unpacked_bytes: 1_000_000,
        ..ReadLimits::default()
    };
    let large = read_gates(&files, false, &limits, &Monitor::silent());
    let Err(large) = large else {
        panic!("a study beyond the limit was read");
    };
    assert!(matches!(large, VolumeError::TooLarge { .. }), "{large}");
}

/// Volumes of a file whose header says that they are no gates are taken for gates only where the caller says so.
#[test]
fn a_file_that_denies_its_gates_needs_the_callers_word() {
    let made = four_dimensional(60.0);
    let files = [VolumeFile::in_memory("dynamic.nii", made)];
    let read = |gated| read_gates(&files, gated, &ReadLimits::default(), &Monitor::silent());
    let refused = read(false).unwrap_err();
    assert!(
        matches!(
            refused,
            VolumeError::FrameNeeded {
                frames: 8,
                why: Some(_)
            }
        ),
        "{refused}"
    );
    let gates_read = read(true).unwrap().gates;
    for (read, made) in gates_read.iter().zip(gates()) {
        assert_eq!(read.voxels, made.voxels);
    }
    let one = [VolumeFile::in_memory("beat.nii", four_dimensional(0.1))];
    assert_eq!(
        read_gates(&one, false, &ReadLimits::default(), &Monitor::silent())
            .unwrap()
            .gates
            .len(),
        8
    );
    // Together more voxels than a volume may have.
    let limits = ReadLimits {
        voxels: 100_000,
        ..ReadLimits::default()
    };
    let large = read_gates(&one, false, &limits, &Monitor::silent()).unwrap_err();
    assert!(
        matches!(large, VolumeError::TooLarge { asked: 512_000, .. }),
        "{large}"
    );
}

/// The gates as one NIfTI-1 file whose volumes are `seconds` apart.
fn four_dimensional(seconds: f32) -> Vec<u8> {
    four_dimensional_of(gates(), seconds)
}

fn four_dimensional_of(gates: &[Volume], seconds: f32) -> Vec<u8> {
    let mut bytes = nifti::write(&gates[0], StoredType::Float32, false).expect("floats fit");
    bytes.truncate(352);
    bytes[40..42].copy_from_slice(&4i16.to_le_bytes());
    bytes[48..50].copy_from_slice(&8i16.to_le_bytes());
    bytes[92..96].copy_from_slice(&seconds.to_le_bytes());
    // Millimetres and seconds.
    bytes[123] = 2 | 8;
    for gate in gates {
        bytes.extend(gate.voxels.iter().flat_map(|v| v.to_le_bytes()));
    }
    bytes
}

/// Slope of the stored numbers, which no binary number is.
const STORED_SLOPE: f32 = 0.0613;

/// The gates as whole numbers times [`STORED_SLOPE`], and these numbers.
fn quantised() -> (Vec<Volume>, Vec<u16>) {
    let numbers = |gate: &Volume| -> Vec<u16> {
        let stored = gate
            .voxels
            .iter()
            .map(|v| (v / STORED_SLOPE).round() as u16);
        stored.collect()
    };
    let stored: Vec<Vec<u16>> = gates().iter().map(numbers).collect();
    let rescaled = |(gate, stored): (&Volume, &Vec<u16>)| Volume {
        voxels: (stored.iter())
            .map(|n| (f64::from(*n) * f64::from(STORED_SLOPE)) as f32)
            .collect(),
        ..gate.clone()
    };
    let volumes = gates().iter().zip(&stored).map(rescaled).collect();
    (volumes, stored.concat())
}

/// The gates as one gated Nuclear Medicine image of which a fifth or more of the beats was rejected.
fn nuclear(stored: &[u16], rejected: u16) -> Vec<u8> {
    let gate = &gates()[0];
    let slices = gate.shape[2];
    let frames = GATE_COUNT * slices;
    let text = |tag, vr, text: &str| DataElement::new(tag, vr, PrimitiveValue::from(text));
    let shorts =
        |tag, numbers: Vec<u16>| DataElement::new(tag, VR::US, PrimitiveValue::U16(numbers.into()));
    let items = |tag, item: InMemDicomObject| {
        DataElement::new(tag, VR::SQ, DataSetSequence::from(vec![item]))
    };
    let origin = gate.frame.to_patient(&Vec3::zeros());
    let detector = InMemDicomObject::from_element_iter([
        text(
            tags::IMAGE_POSITION_PATIENT,
            VR::DS,
            &format!("{}\\{}\\{}", origin.x, origin.y, origin.z),
        ),
        text(tags::IMAGE_ORIENTATION_PATIENT, VR::DS, "1\\0\\0\\0\\1\\0"),
    ]);
    let beats = InMemDicomObject::from_element_iter([
        text(tags::NOMINAL_INTERVAL, VR::IS, "850"),
        text(tags::INTERVALS_ACQUIRED, VR::IS, "100"),
        text(tags::INTERVALS_REJECTED, VR::IS, &rejected.to_string()),
    ]);
    let gating =
        InMemDicomObject::from_element_iter([items(tags::DATA_INFORMATION_SEQUENCE, beats)]);
    let pointers = vec![
        tags::RR_INTERVAL_VECTOR,
        tags::TIME_SLOT_VECTOR,
        tags::SLICE_VECTOR,
    ];
    let number = |n: usize| n as u16 + 1;
    InMemDicomObject::from_element_iter([
        text(
            tags::SOP_CLASS_UID,
            VR::UI,
            uids::NUCLEAR_MEDICINE_IMAGE_STORAGE,
        ),
        text(tags::SOP_INSTANCE_UID, VR::UI, "1.2.3.4.5"),
        text(tags::STUDY_INSTANCE_UID, VR::UI, "1.2.3"),
        text(tags::SERIES_INSTANCE_UID, VR::UI, "1.2.3.4"),
        text(tags::FRAME_OF_REFERENCE_UID, VR::UI, "1.2.3.9"),
        text(tags::PATIENT_ID, VR::LO, "P1"),
        text(tags::MODALITY, VR::CS, "NM"),
        text(
            tags::IMAGE_TYPE,
            VR::CS,
            "DERIVED\\PRIMARY\\RECON GATED TOMO\\EMISSION",
        ),
        shorts(tags::ROWS, vec![gate.shape[1] as u16]),
        shorts(tags::COLUMNS, vec![gate.shape[0] as u16]),
        text(tags::NUMBER_OF_FRAMES, VR::IS, &frames.to_string()),
        shorts(tags::SAMPLES_PER_PIXEL, vec![1]),
        text(tags::PHOTOMETRIC_INTERPRETATION, VR::CS, "MONOCHROME2"),
        shorts(tags::BITS_ALLOCATED, vec![16]),
        shorts(tags::BITS_STORED, vec![16]),
        shorts(tags::HIGH_BIT, vec![15]),
        shorts(tags::PIXEL_REPRESENTATION, vec![0]),
        text(
            tags::PIXEL_SPACING,
            VR::DS,
            &format!("{SPACING_MM}\\{SPACING_MM}"),
        ),
        text(
            tags::SPACING_BETWEEN_SLICES,
            VR::DS,
            &SPACING_MM.to_string(),
        ),
        text(tags::RESCALE_SLOPE, VR::DS, &STORED_SLOPE.to_string()),
        text(tags::RESCALE_INTERCEPT, VR::DS, "0"),
        DataElement::new(
            tags::FRAME_INCREMENT_POINTER,
            VR::AT,
            PrimitiveValue::Tags(pointers.into()),
        ),
        shorts(tags::RR_INTERVAL_VECTOR, vec![1; frames]),
        shorts(
            tags::TIME_SLOT_VECTOR,
            (0..frames).map(|n| number(n / slices)).collect(),
        ),
        shorts(
            tags::SLICE_VECTOR,
            (0..frames).map(|n| number(n % slices)).collect(),
        ),
        items(tags::DETECTOR_INFORMATION_SEQUENCE, detector),
        items(tags::GATED_INFORMATION_SEQUENCE, gating),
        DataElement::new(tags::PIXEL_DATA, VR::OW, PrimitiveValue::U16(stored.into())),
    ])
    .with_meta(FileMetaTableBuilder::new().transfer_syntax(uids::EXPLICIT_VR_LITTLE_ENDIAN))
    .map(|object| {
        let mut bytes = Vec::new();
        object.write_all(&mut bytes).expect("memory has room");
        bytes
    })
    .expect("a class and an instance")
}

/// The beat of one file.
fn beat_of_file(name: &str, bytes: Vec<u8>) -> GatedHeart {
    let order = GatedOrder {
        gates: &[VolumeFile::in_memory(name, bytes)],
        auto: true,
        models: Vec::new(),
        normals: None,
        parameters: &FitParameters::default(),
        choice: BeatChoice {
            rr_ms: Some(850.0),
            ..BeatChoice::default()
        },
    };
    from_files(&order, &ReadLimits::default(), &Monitor::silent()).expect("a beat")
}

fn from_nuclear() -> &'static GatedHeart {
    static FROM_NUCLEAR: OnceLock<GatedHeart> = OnceLock::new();
    FROM_NUCLEAR.get_or_init(|| beat_of_file("nm.dcm", nuclear(&quantised().1, 60)))
}

/// The same numbers as gated DICOM and as 4-D NIfTI: the same files, but for what the files say of themselves.
#[test]
fn dicom_and_nifti_give_the_same_beat() {
    let nifti = beat_of_file("beat.nii", four_dimensional_of(&quantised().0, 0.1));
    let hearts = [from_nuclear(), &nifti];
    let [mut dicom, nifti] = hearts.map(GatedHeart::report);
    // What the file says of itself and of the beats.
    dicom.input = nifti.input.clone();
    dicom.timing = nifti.timing.clone();
    dicom.warnings.clone_from(&nifti.warnings);
    dicom.flags.retain(|flag| flag.code != "beats_rejected");
    dicom.impression.clone_from(&nifti.impression);
    assert_eq!(
        serde_json::to_string(&dicom).unwrap(),
        serde_json::to_string(&nifti).unwrap()
    );
    let [dicom, nifti] =
        hearts.map(|heart| heart.files(&[Format::Obj], &Monitor::silent()).unwrap());
    let alike = ["svg", "csv", "json"];
    let mut compared = 0;
    for (dicom, nifti) in dicom.iter().zip(&nifti) {
        assert_eq!(dicom.name, nifti.name);
        let kind = dicom.name.rsplit('.').next().unwrap();
        if alike.contains(&kind) && dicom.name != "beat.json" {
            assert!(dicom.bytes == nifti.bytes, "{}", dicom.name);
            compared += 1;
        }
    }
    assert_eq!(compared, 16);
}

#[test]
fn many_rejected_beats_are_told() {
    assert!(codes(from_nuclear()).contains(&"beats_rejected".to_owned()));
    let timing = from_nuclear().report().timing;
    assert_eq!(timing.beats_rejected, Some(60.0));
    let few = nuclear(&quantised().1, 10);
    let files = [VolumeFile::in_memory("nm.dcm", few)];
    let read = read_gates(&files, false, &ReadLimits::default(), &Monitor::silent()).unwrap();
    assert_eq!(
        read.timing.rejected_share().and_then(BeatFlag::of_rejected),
        None
    );
}

/// Segmentations of both ends refer to the frames of their own gates, and the report has the figures of the beat.
#[test]
fn a_beat_is_written_as_dicom() {
    let heart = from_nuclear();
    let report = heart.report();
    let made = Moment {
        date: "20260101".into(),
        time: "120000".into(),
    };
    let scans = heart.scans(heart.reading.provenance().unwrap(), &made);
    let files = heart.dicom_files(&scans).unwrap();
    let names: Vec<&str> = files.iter().map(|file| file.name.as_str()).collect();
    let objects = ["mask_ed.dcm", "mask_es.dcm", "measurements.dcm"];
    assert_eq!(names[..3], objects);
    assert_eq!(names[3..], ["fhir.json"]);
    let again = heart.dicom_files(&scans).unwrap();
    for (file, again) in files.iter().zip(&again) {
        assert!(file.bytes == again.bytes, "{}", file.name);
    }
    let read: Vec<DefaultDicomObject> = (files.iter().take(objects.len()))
        .map(|file| from_reader(&file.bytes[..]).unwrap())
        .collect();
    let slices = gates()[0].shape[2];
    for (object, gate) in read
        .iter()
        .zip([report.end_diastole_gate, report.end_systole_gate])
    {
        let mut named = BTreeSet::new();
        every_item(object, &mut |item| {
            if let Ok(frame) = item.element(tags::REFERENCED_FRAME_NUMBER) {
                named.insert(frame.to_int::<usize>().unwrap());
            }
        });
        let own: BTreeSet<usize> = (slices * (gate - 1) + 1..=slices * gate).collect();
        assert_eq!(named, own);
    }
    let uid = |object: &DefaultDicomObject| {
        let uid = object.element(tags::SERIES_INSTANCE_UID).unwrap();
        uid.to_str().unwrap().into_owned()
    };
    let series: BTreeSet<String> = read.iter().map(uid).collect();
    assert_eq!(series.len(), 3);
    // The report names its images; where they are not DICOM, there is no list of them, not an empty one.
    let evidence = tags::CURRENT_REQUESTED_PROCEDURE_EVIDENCE_SEQUENCE;
    assert!(read[2].element(evidence).is_ok());
    let stated = Provenance {
        patient_id: Some("P1".into()),
        study_uid: Some("1.2.3".into()),
        ..Provenance::default()
    };
    let unnamed = whole().dicom_files(&whole().scans(&stated, &made)).unwrap();
    let unnamed = from_reader(&unnamed[2].bytes[..]).unwrap();
    assert!(unnamed.element(evidence).is_err());
    let mut figures: Vec<(String, f64)> = Vec::new();
    every_item(&read[2], &mut |item| {
        let Ok(value) = item.element(tags::MEASURED_VALUE_SEQUENCE) else {
            return;
        };
        let value = &value.items().unwrap()[0];
        let number = value.element(tags::NUMERIC_VALUE).unwrap();
        let name = item.element(tags::CONCEPT_NAME_CODE_SEQUENCE).unwrap();
        let code = name.items().unwrap()[0].element(tags::CODE_VALUE).unwrap();
        figures.push((
            code.to_str().unwrap().into_owned(),
            number.to_float64().unwrap(),
        ));
    });
    let of = |code: &str| -> Vec<f64> {
        let own = figures.iter().filter(|(found, _)| found == code);
        own.map(|(_, number)| *number).collect()
    };
    assert_eq!(of("8821-1"), [report.edv_ml]);
    assert_eq!(of("8823-7"), [report.esv_ml]);
    // How far the true value may lie below and above EDV, ESV and EF.
    let ef = (
        report.ef_percent.unwrap(),
        report.ef_interval_percent.unwrap(),
    );
    let figures_with_ranges = [
        (report.edv_ml, report.edv_interval_ml.unwrap()),
        (report.esv_ml, report.esv_interval_ml.unwrap()),
        ef,
    ];
    for (code, below) in [("371885007", true), ("371886008", false)] {
        let wanted = figures_with_ranges.map(|(value, [low, high])| match below {
            true => value - low,
            false => high - value,
        });
        let found = of(code);
        assert_eq!(found.len(), 3);
        for (found, wanted) in found.iter().zip(wanted) {
            assert!((found - wanted).abs() < 1e-6, "{code}: {found} of {wanted}");
        }
    }
    assert_eq!(of("90096001"), [report.sv_ml.unwrap()]);
    assert_eq!(of("70822001"), [report.ef_percent.unwrap()]);
    assert_eq!(of("122447"), [report.mass_g]);
    // Eight gates have no rates.
    assert!(of("122616").is_empty() && of("122618").is_empty());
    assert_eq!(of("PHASE-SD"), [report.phase.sd_degrees]);
    let segments = &report.segments;
    let thickening: Vec<f64> = segments.iter().map(|s| s.thickening_percent).collect();
    assert_eq!(of("59092-7"), thickening);
    let motion: Vec<f64> = segments.iter().map(|s| s.motion_mm).collect();
    assert_eq!(of("60797005"), motion);
}

/// The structured report of a beat beside normal limits has their figures and names the limits.
#[test]
fn a_beat_beside_normal_limits_is_written_as_dicom() {
    let heart = from_nuclear();
    let made = Moment {
        date: "20260101".into(),
        time: "120000".into(),
    };
    let scans = heart.scans(heart.reading.provenance().unwrap(), &made);
    let of = |report: &BeatReport| -> Vec<u8> {
        let text = serde_json::to_string(report).unwrap();
        let structure = Structure::from_organ("left_ventricle");
        let beat = DicomBeat::new(structure, &scans, report, &text);
        beat.measurements().unwrap()
    };
    let mut report = heart.report();
    let sha256 = "ab".repeat(32);
    let normals = json!({"sha256": sha256, "simulated": true, "people": "simulated, not patients", "sex": "M",
        "protocol": "rest", "tracer": "Tc-99m", "attenuation_corrected": false, "cases": 15,
        "program_version": "0.1.0"});
    let segment = json!({"segment": 10, "name": "x", "z": -3.0, "score": 2, "extent_percent": 50.0,
        "deficit_percent": 20.0, "compared_percent": 100.0});
    let perfusion = json!({"normals": normals, "note": "TPD-like", "z_limit": 2.5, "deficit_percent": 6.0,
        "extent_percent": 11.0, "severity": 3.0, "summed_score": 2, "summed_percent": 3.0, "segments": [segment],
        "territories": [], "figures": [], "flags": []});
    let without = of(&report);
    report.perfusion = Some(serde_json::from_value(perfusion).unwrap());
    let with = of(&report);
    let has = |bytes: &[u8], text: &str| bytes.windows(text.len()).any(|w| w == text.as_bytes());
    for said in [
        "427751006",
        "DEFICIT",
        "SRS",
        "SCORE",
        "simulated, not patients",
        &sha256,
    ] {
        assert!(has(&with, said) && !has(&without, said), "{said}");
    }
}

/// Calls `visit` with the data set and every item in it.
fn every_item(set: &InMemDicomObject, visit: &mut dyn FnMut(&InMemDicomObject)) {
    visit(set);
    for item in set.iter().filter_map(|element| element.items()).flatten() {
        every_item(item, visit);
    }
}
