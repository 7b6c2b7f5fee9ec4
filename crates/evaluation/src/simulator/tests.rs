//! Whole cases: files, truth and determinism.

use super::draw::{Profile, patient};
use super::gated::GatedOrder;
use super::kinds::{Kind, Sampling};
use super::parameters::{Cut, Parameters};
use super::study::StudyOptions;
use super::{case, gated, healthy, kinds, pairs, study, variants, walls};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::{ReadLimits, VolumeFile, read_gates};
use ventriform::mesh::files::{self, MeshFrame, MeshStatement, MeshUnit};

/// A case on few, large voxels, which takes a second.
fn small(case: &str) -> Parameters {
    let profile = Profile {
        matrix: 32,
        spacing_mm: 12.8,
        attenuation_corrected: true,
        ..Profile::default()
    };
    let mut p = patient(case, 11, "test", &profile);
    p.acquisition.views = 30;
    p.reconstruction.scatter_corrected = true;
    (p.reconstruction.subsets, p.reconstruction.iterations) = (5, 2);
    p
}

fn bytes_of(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).expect("a folder");
    let files = entries.map(|entry| entry.expect("an entry").path());
    let name = |path: &Path| {
        path.file_name()
            .expect("a name")
            .to_string_lossy()
            .into_owned()
    };
    files
        .map(|path| (name(&path), fs::read(&path).expect("a file")))
        .collect()
}

fn on_threads(count: usize, work: impl FnOnce() + Send) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(count)
        .build()
        .expect("threads");
    pool.install(work);
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = StudyOptions {
        gates: 4,
        loss: 0.2,
        height_mm: Some(200.0),
        truth_images: true,
    };
    let parameters = small("same");
    for (name, threads) in [("one", 1), ("three", 3)] {
        let out = folder.path().join(name);
        on_threads(threads, || {
            case::write(&parameters, &out.join("case")).expect("a case");
            study::write(&parameters, &options, &out.join("study")).expect("a study");
        });
    }
    for part in ["case", "study"] {
        let [one, three] =
            ["one", "three"].map(|name| bytes_of(&folder.path().join(name).join(part)));
        assert!(one.len() >= 5);
        assert_eq!(
            one.keys().collect::<Vec<_>>(),
            three.keys().collect::<Vec<_>>()
        );
        for (name, bytes) in &one {
            assert!(*bytes == three[name], "{part}/{name}");
        }
    }
    // Another seed gives other counts.
    let other = Parameters {
        noise_seed: 12,
        ..parameters
    };
    case::write(&other, &folder.path().join("other")).expect("a case");
    let spect = |folder: &Path| fs::read(folder.join("spect.nii.gz")).expect("an image");
    assert!(spect(&folder.path().join("other")) != spect(&folder.path().join("one/case")));
}

#[test]
fn a_case_is_read_by_the_library_and_its_truth_agrees_with_itself() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut parameters = patient("read", 21, "test", &Profile::default());
    for cut in [Cut::Transaxial, Cut::ShortAxis] {
        parameters.cut = cut;
        let result = case::write(&parameters, folder.path()).expect("a case");
        let number = |name: &str| result[name].as_f64().expect("a number");
        let scan = ventriform::open(folder.path().join("spect.nii.gz")).expect("a scan");
        let mask = ventriform::open_mask(folder.path().join("lv_truth.nii.gz")).expect("a mask");
        let agreement = ventriform::measure(mask.clone(), mask.clone()).expect("a comparison");
        assert!((agreement.jaccard - 1.0).abs() < 1e-12);
        drop(scan);
        // A mask of voxels of which half is wall, over a beat, breath and voxel.
        let analytic = number("wall_volume_ml");
        assert!(
            (number("wall_ml") / analytic - 1.0).abs() < 0.12,
            "{cut:?} {analytic}"
        );
        assert!((number("cavity_ml") / number("mean_cavity_ml") - 1.0).abs() < 0.12);
        let stated = MeshStatement {
            unit: Some(MeshUnit::Millimetre),
            frame: Some(MeshFrame::Ras),
        };
        let ply = fs::read(folder.path().join("lv_surface.ply")).expect("a surface");
        let mesh = files::read(&ply, &stated, 1 << 28)
            .expect("a closed surface")
            .mesh;
        let volume = mesh.volume() / 1000.0;
        assert!(
            (volume / analytic - 1.0).abs() < 0.08,
            "{volume} {analytic}"
        );
    }
}

#[test]
fn a_study_is_read_as_gates_and_sums_to_its_counts() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = StudyOptions {
        gates: 8,
        loss: 0.3,
        height_mm: Some(220.0),
        truth_images: true,
    };
    let mut parameters = small("gates");
    parameters.acquisition.total_counts_m = 4.0;
    let result = study::write(&parameters, &options, folder.path()).expect("a study");
    let file = VolumeFile::at(folder.path().join("gated.nii.gz"));
    let reading = read_gates(&[file], true, &ReadLimits::default(), &Monitor::silent());
    assert_eq!(reading.expect("gates").gates.len(), 8);
    let counts: Vec<f64> = result["counts_gates_M"]
        .as_array()
        .expect("numbers")
        .iter()
        .map(|c| c.as_f64().expect("a number"))
        .collect();
    assert!((counts[..7].iter().sum::<f64>() / 3.5 - 1.0).abs() < 0.01);
    assert!((counts[7] / 0.35 - 1.0).abs() < 0.01, "{counts:?}");
    let [voxels, walls] = ["voxel_wall_ml", "wall_ml"].map(|name| {
        let all = result[name].as_array().expect("numbers").iter();
        all.map(|ml| ml.as_f64().expect("a number"))
            .collect::<Vec<_>>()
    });
    for (voxels, wall) in voxels.iter().zip(&walls) {
        assert!((voxels / wall - 1.0).abs() < 0.04, "{voxels} {wall}");
    }
}

#[test]
fn every_kind_is_drawn_and_states_what_it_is() {
    let drawn = |kind: Kind, seed| kinds::draw(kind, "case", seed, Sampling::Fine);
    for kind in Kind::ALL {
        assert_eq!(Kind::from_name(kind.name()), Some(kind));
        assert_eq!(drawn(kind, 1).made, kind.name());
    }
    let all =
        |kind: Kind| (0..40).map(move |seed| kinds::draw(kind, "case", seed, Sampling::Coarse));
    assert!(all(Kind::HotGut).any(|p| p.organs.gut > 15.0));
    assert!(all(Kind::HotGut).all(|p| (3.0..20.0).contains(&p.organs.gut)));
    assert!(all(Kind::Few).all(|p| p.acquisition.total_counts_m <= 3.5));
    assert!(all(Kind::Motion).all(|p| p.acquisition.body_motion.is_some_and(|m| m.dz_mm >= 6.0)));
    assert!(all(Kind::Cut).all(|p| p.cut == Cut::ShortAxis));
    assert!(all(Kind::None).all(|p| p.heart.defects[0].segments.len() == 17));
    let usual: Vec<f64> = all(Kind::In).map(|p| p.heart.h0).collect();
    let mean = usual.iter().sum::<f64>() / usual.len() as f64;
    assert!((mean - 9.6).abs() < 0.6, "{mean}");
}

#[test]
fn walls_reach_from_thin_to_thick_and_other_cases_are_drawn() {
    let thickness: Vec<f64> = (0..200)
        .map(|seed| walls::draw("w", seed).heart.h0)
        .collect();
    let [most, least] = super::truth::largest_and_smallest(&thickness);
    assert!(least < 6.0 && most > 21.0 && least >= 5.0 && most < 22.0);
    for variant in variants::VARIANTS {
        assert_eq!(variants::draw(variant, &variants::HEARTS[0]).made, variant);
    }
    let order = GatedOrder {
        gates: 8,
        matrix: 64,
        heart: Some([18.0, 70.0, 0.7]),
    };
    for kind in gated::KINDS {
        let drawn = gated::draw(kind, "g", 3, &order).expect("a kind");
        assert_eq!(
            [drawn.parameters.heart.h0, drawn.parameters.heart.edv_ml],
            [18.0, 70.0]
        );
        assert_eq!(drawn.options.gates, if kind == "gates16" { 16 } else { 8 });
    }
    assert!(gated::draw("unknown", "g", 3, &order).is_none());
    let protocol = healthy::Protocol::from_name("rest_ac").expect("a protocol");
    let one = healthy::draw("n", 4, true, &protocol, 64, Some(healthy::OneDefect::Basal));
    assert_eq!((one.sex, one.heart.defects.len()), ('F', 1));
    assert!(one.heart.defects[0].segments[0] <= 6);
    assert!(one.reconstruction.attenuation_corrected);
}

#[test]
fn a_pair_differs_by_what_it_states_and_by_nothing_else() {
    let folder = tempfile::tempdir().expect("a folder");
    let pair = |kind: &str, seed: u64| {
        pairs::write(kind, "pair", seed, 0, 64, &folder.path().join(kind)).expect("a pair")
    };
    let same = pair("same", 2);
    assert_eq!(same["reversible_percent"], 0.0);
    let near = |value: &serde_json::Value, known: f64, by: f64| {
        let value = value.as_f64().expect("a number");
        assert!((value - known).abs() < by, "{value} {known}");
    };
    near(&same["tid"], 1.0, 1e-6);
    let weaker = pair("tidred40", 2);
    assert!(weaker["tid"].as_f64() > Some(1.08));
    let muscle = &weaker["muscle_ml"];
    near(&muscle[0], muscle[1].as_f64().expect("a number"), 0.05);
    let taken = &weaker["reversible"]["segments"][0].to_string();
    near(&weaker["reversible"]["segment_reduction"][taken], 0.4, 0.12);
    assert_eq!(weaker["comparable"], true);
}
