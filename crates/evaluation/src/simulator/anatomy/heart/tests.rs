use super::*;
use crate::simulator::draw::{Profile, patient};
use crate::simulator::parameters::{Heart, Orientation};
use crate::simulator::truth;

/// A ventricle with an even wall and no waves.
fn plain(wall_mm: f64, edv_ml: f64, ef: f64) -> Heart {
    let profile = Profile {
        h0: Some(wall_mm),
        edv_ml,
        ef: Some(ef),
        ..Profile::default()
    };
    let drawn = patient("plain", 5, "plain", &profile).heart;
    Heart {
        memb_dip: 0.0,
        base_modes: Vec::new(),
        modes_theta: Vec::new(),
        modes_mu: Vec::new(),
        septal_flat: 0.0,
        apex_thin: 0.0,
        sept_thin: 0.0,
        lat_thick: 0.0,
        thick_modes: Vec::new(),
        base_taper: 0.0,
        bend: [0.0, 0.0],
        twist_deg: 0.0,
        papillaries: false,
        ..drawn
    }
}

fn placed(heart: &Heart, phases: usize) -> PlacedHeart {
    let orientation = Orientation {
        azimuth_deg: 47.0,
        inferior_tilt_deg: 27.0,
        roll_deg: 0.0,
    };
    let directions = Directions::new(&orientation);
    PlacedHeart::new(
        Ventricle::new(heart, phases),
        directions,
        &Vec3::zeros(),
        0.0,
    )
}

/// The phases with the largest and the smallest cavity.
fn ends(heart: &PlacedHeart) -> [usize; 2] {
    let cavity = heart.ventricle.cavity_ml();
    truth::largest_and_smallest(&cavity)
        .map(|ml| cavity.iter().position(|c| *c == ml).expect("one of them"))
}

#[test]
fn the_images_have_the_volumes_of_the_shape() {
    for (wall_mm, edv_ml, ef) in [(7.0, 160.0, 0.45), (10.0, 110.0, 0.62), (16.0, 70.0, 0.7)] {
        let heart = placed(&plain(wall_mm, edv_ml, ef), 24);
        let (cavity, wall) = (heart.ventricle.cavity_ml(), heart.ventricle.wall_ml());
        for phase in ends(&heart) {
            let images = heart.images(&Place::cube(120, 1.5), phase..phase + 1);
            let ml = |grid: &Grid| grid.sum() * 1.5_f64.powi(3) / 1000.0;
            let [found_cavity, found_wall] = [ml(&images.cavity), ml(&images.wall)];
            assert!(
                (found_cavity / cavity[phase] - 1.0).abs() < 0.02,
                "{wall_mm} {found_cavity}"
            );
            // The rounded rim takes a little of the wall.
            assert!(
                (found_wall / wall[phase] - 1.0).abs() < 0.04,
                "{wall_mm} {found_wall}"
            );
        }
    }
}

#[test]
fn a_wall_is_as_thick_in_the_image_as_it_was_stated() {
    for wall_mm in [5.0, 10.0, 16.0, 22.0] {
        let heart = placed(&plain(wall_mm, 110.0, 0.6), 48);
        let [phase, _] = ends(&heart);
        let place = Place::cube(160, 1.0);
        let wall = heart.images(&place, phase..phase + 1).wall;
        // A ray across the axis through the widest part, where the wall is parallel to the axis.
        let shape = &heart.ventricle.phases[phase];
        let centre = heart.on_axis(shape.shift_mm);
        for degrees in [0.0_f64, 100.0, 190.0, 280.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let out = heart.directions.lateral * cos + heart.directions.anterior * sin;
            let step = 0.25;
            let across = (0..320).map(|k| {
                let at = centre + out * (f64::from(k) * step);
                step * f64::from(wall.between(place.indices(&at)))
            });
            let thickness: f64 = across.sum();
            assert!(
                (thickness - wall_mm).abs() < 0.06 * wall_mm,
                "{wall_mm}: {thickness}"
            );
        }
    }
}

#[test]
fn the_muscle_keeps_its_volume_through_the_beat_and_the_cavity_its_ejection_fraction() {
    for (wall_mm, edv_ml, ef) in [(6.0, 230.0, 0.25), (10.0, 110.0, 0.62), (14.0, 45.0, 0.8)] {
        let ventricle = Ventricle::new(&plain(wall_mm, edv_ml, ef), 48);
        let wall = ventricle.wall_ml();
        let [most, least] = truth::largest_and_smallest(&wall);
        assert!((most - least) / most < 1e-3, "{most} {least}");
        let [edv, esv] = truth::largest_and_smallest(&ventricle.cavity_ml());
        assert!((1.0 - esv / edv - ef).abs() < 1e-3, "{ef}");
        assert!((edv / edv_ml - 1.0).abs() < 0.02, "{edv}");
        assert!((wall[0] / ventricle.muscle_ml() - 1.0).abs() < 1e-3);
    }
}

#[test]
fn segments_without_contraction_keep_their_thickness_and_late_ones_are_late() {
    use crate::simulator::parameters::{LateRegion, WeakRegion};
    let mut heart = plain(10.0, 130.0, 0.45);
    let segments = vec![5, 6, 11, 12, 16];
    heart.beat.regions = vec![WeakRegion {
        area: "LCX".into(),
        segments: segments.clone(),
        contraction: 0.0,
    }];
    let truth = truth::beat(&Ventricle::new(&heart, 48), 8);
    let of = |segment: usize, name: &str| {
        truth["segments"][segment - 1][name]
            .as_f64()
            .expect("a number")
    };
    assert!(
        of(12, "thickening_percent").abs() < 4.0,
        "{}",
        of(12, "thickening_percent")
    );
    assert!(of(8, "thickening_percent") > 15.0);
    assert!(of(12, "motion_mm") < 0.4 * of(8, "motion_mm"));
    assert_eq!(truth["akinetic"], serde_json::json!(segments));

    let mut heart = plain(10.0, 130.0, 0.6);
    let septum = vec![2, 3, 8, 9, 14];
    heart.beat.delays = vec![LateRegion {
        wall: "septum".into(),
        segments: septum,
        degrees: 45.0,
    }];
    let truth = truth::beat(&Ventricle::new(&heart, 48), 8);
    let late = truth["phase"]["septum_minus_lateral_degrees"]
        .as_f64()
        .expect("a number");
    assert!((late - 40.0).abs() < 10.0, "{late}");
}

#[test]
fn uptake_is_missing_where_the_defect_is() {
    let mut heart = plain(10.0, 110.0, 0.6);
    heart.defects = vec![crate::simulator::parameters::Defect::of_uptake(
        &[8, 9],
        0.7,
    )];
    let ventricle = Ventricle::new(&heart, 1);
    let loss = truth::of_segments(&ventricle, &truth::loss(&ventricle), &ventricle.areas());
    for (k, loss) in loss.iter().enumerate() {
        match k + 1 {
            8 | 9 => assert!(*loss > 0.5, "{loss}"),
            5 | 6 | 11 | 12 | 16 => assert!(*loss < 0.01),
            _ => assert!(*loss < 0.2),
        }
    }
}
