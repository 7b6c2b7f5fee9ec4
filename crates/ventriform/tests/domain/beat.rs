//! The beat of a heart whose volumes are known: half an ellipsoid that shrinks and thickens, its muscle kept.

use std::f64::consts::PI;
use std::sync::OnceLock;

use rayon::ThreadPoolBuilder;
use ventriform::export::Format;
use ventriform::gated::{GatedError, GatedHeart, GatedOrder, from_files};
use ventriform::geometry::Vec3;
use ventriform::geometry::frame::VoxelToPatient;
use ventriform::grid::Volume;
use ventriform::grid::blur::{Kernel, blur};
use ventriform::mesh::intersections::self_intersections;
use ventriform::parameters::{BeatChoice, FitParameters};
use ventriform::progress::Monitor;
use ventriform::volume::nifti::{self, StoredType};
use ventriform::volume::{ReadLimits, VolumeError, VolumeFile, read_gates};

/// Length of wall basal of the ellipsoid's centre, mm.
const BASE_MM: f64 = 14.0;
/// Width of a point in the gates, mm.
const RESOLUTION_MM: f64 = 13.0;
const SPACING_MM: f64 = 4.5;
const GATES: usize = 8;

/// Semi-axes of the cavity across and along the axis, mm, at a share of the contraction (0 end diastole, 1 end systole).
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

/// One gate: the mean of five moments.
fn gate(index: usize) -> Volume {
    let shape = [40; 3];
    let centre = Vec3::new(20.0, -20.0, 30.0);
    let frame = VoxelToPatient::centred(shape, [SPACING_MM; 3], centre).expect("a grid");
    let axis = Vec3::new(0.64, -0.60, -0.48).normalize();
    const MOMENTS: usize = 5;
    let mut sum = vec![0.0f32; 64_000];
    for moment in 0..MOMENTS {
        let turns = (index as f64 + (moment as f64 + 0.5) / MOMENTS as f64) / GATES as f64;
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
            .for_each(|(sum, v)| *sum += v / MOMENTS as f32);
    }
    let kernel = || Kernel::gaussian(RESOLUTION_MM / 2.3548 / SPACING_MM, 4.0);
    blur(
        &mut sum,
        shape,
        &[kernel(), kernel(), kernel()],
        &Monitor::silent(),
    )
    .expect("nobody cancels");
    Volume {
        shape,
        voxels: sum,
        frame,
        integral: false,
    }
}

fn gates() -> &'static [Volume] {
    static GATES_MADE: OnceLock<Vec<Volume>> = OnceLock::new();
    GATES_MADE.get_or_init(|| (0..GATES).map(gate).collect())
}

/// The beat of gates in separate files.
fn beat_of(gates: &[Volume], choice: BeatChoice) -> Result<GatedHeart, GatedError> {
    let file = |(index, gate): (usize, &Volume)| {
        let bytes = nifti::write(gate, StoredType::Float32, false).expect("floats fit");
        VolumeFile::in_memory(format!("gate{index}.nii"), bytes)
    };
    let files: Vec<VolumeFile> = gates.iter().enumerate().map(file).collect();
    let order = GatedOrder {
        gates: &files,
        auto: true,
        models: Vec::new(),
        parameters: &FitParameters::default(),
        choice,
    };
    from_files(&order, &ReadLimits::default(), &Monitor::silent())
}

fn whole() -> &'static GatedHeart {
    static WHOLE: OnceLock<GatedHeart> = OnceLock::new();
    WHOLE.get_or_init(|| beat_of(gates(), BeatChoice::default()).expect("a beat"))
}

fn codes(heart: &GatedHeart) -> Vec<String> {
    heart
        .report()
        .flags
        .into_iter()
        .map(|flag| flag.code)
        .collect()
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

#[test]
fn gates_that_begin_elsewhere_in_the_cycle_give_the_same_ejection_fraction() {
    let mut rotated = gates().to_vec();
    rotated.rotate_left(3);
    let report = beat_of(&rotated, BeatChoice::default()).unwrap().report();
    let whole = whole().report();
    let [rotated, first] = [&report, &whole].map(|report| report.ef_percent.unwrap());
    assert!((rotated - first).abs() < 0.5, "{rotated} {first}");
    let later = (whole.end_systole_degrees - report.end_systole_degrees).rem_euclid(360.0);
    assert!((later - 135.0).abs() < 6.0, "{later}");
}

/// A quarter of the counts of the last gate is lost, as after irregular beats.
#[test]
fn lost_counts_are_told_and_change_little() {
    let mut lossy = gates().to_vec();
    lossy[7].voxels.iter_mut().for_each(|v| *v *= 0.75);
    let heart = beat_of(&lossy, BeatChoice::default()).unwrap();
    assert!(codes(&heart).contains(&"count_loss".to_owned()));
    let [found, first] = [&heart, whole()].map(|heart| heart.report().ef_percent.unwrap());
    assert!((found - first).abs() < 2.0, "{found} {first}");
}

#[test]
fn gates_that_show_no_beat_have_no_ejection_fraction() {
    let shuffled: Vec<Volume> = [0, 4, 1, 6, 2, 7, 3, 5].map(|n| gates()[n].clone()).into();
    let repeated = vec![gates()[0].clone(); 8];
    for gates in [shuffled, repeated] {
        let heart = beat_of(&gates, BeatChoice::default()).unwrap();
        assert!(codes(&heart).contains(&"no_contraction".to_owned()));
        assert_eq!(heart.report().ef_percent, None);
    }
}

#[test]
fn a_known_mass_is_met() {
    let [inner, outer] = [0.0, 9.0].map(|more| volume_ml(cavity_axes(0.0).map(|a| a + more)));
    let mass_g = 1.05 * (outer - inner);
    let choice = BeatChoice {
        mass_g: Some(mass_g),
        ..BeatChoice::default()
    };
    let report = beat_of(gates(), choice).unwrap().report();
    let found = 1.05 * report.wall_ml;
    assert!((found / mass_g - 1.0).abs() < 0.05, "{found} of {mass_g}");
}

/// Meshes of all gates: the same triangles, closed without meeting themselves, as much muscle as the fit keeps.
#[test]
fn every_gate_has_a_mesh_that_does_not_meet_itself() {
    let heart = whole();
    let meshes = heart.beat.fit.carried(&heart.wall.mesh, &heart.wall.wall);
    assert_eq!(meshes.len(), GATES);
    for mesh in &meshes {
        assert_eq!(mesh.triangles, heart.wall.mesh.triangles);
        assert_eq!(self_intersections(mesh).len(), 0);
        let muscle = mesh.volume() / 1000.0;
        let kept = heart.report().wall_ml;
        assert!((muscle / kept - 1.0).abs() < 0.08, "{muscle} of {kept}");
    }
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
    assert!(
        other
            .to_string()
            .starts_with("gate 4 has 40 x 40 x 40 voxels"),
        "{other}"
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
    let heavy = BeatChoice {
        mass_g: Some(1e4),
        ..BeatChoice::default()
    };
    let heavy = beat_of(gates(), heavy).unwrap_err();
    assert_eq!(heavy.to_string(), "`mass_g` is 10000; it must be 20 to 600");
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
    let mut bytes = nifti::write(&gates()[0], StoredType::Float32, false).expect("floats fit");
    bytes.truncate(352);
    bytes[40..42].copy_from_slice(&4i16.to_le_bytes());
    bytes[48..50].copy_from_slice(&8i16.to_le_bytes());
    bytes[92..96].copy_from_slice(&seconds.to_le_bytes());
    // Millimetres and seconds.
    bytes[123] = 2 | 8;
    for gate in gates() {
        bytes.extend(gate.voxels.iter().flat_map(|v| v.to_le_bytes()));
    }
    bytes
}
