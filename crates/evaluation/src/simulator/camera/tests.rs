use super::*;
use crate::simulator::draw::{Profile, patient};
use crate::simulator::parameters::{BodyMotion, Parameters};

const BINS: usize = 128;
const BIN_MM: f64 = 2.0;

/// A case whose camera has one view from the front, near to a body of 200 mm.
fn from_the_front() -> Parameters {
    let profile = Profile {
        matrix: BINS,
        spacing_mm: BIN_MM,
        ..Profile::default()
    };
    let mut p = patient("test", 3, "test", &profile);
    p.body.female = false;
    (p.body.half_width_mm, p.body.half_depth_mm) = (100.0, 100.0);
    p.body.offset_mm = [0.0, 0.0];
    p.acquisition.views = 1;
    p.acquisition.arc_deg = [90.0, 90.0];
    p.acquisition.gap_mm = 30.0;
    p.acquisition.orbit = Orbit::Contoured;
    p
}

fn camera(p: &Parameters) -> Camera {
    Camera::new(&p.acquisition, &p.body, BIN_MM)
}

/// An image of a point, at indices.
fn point(camera: &Camera, at: [usize; 3]) -> Grid {
    let mut image = Grid::zeros(camera.place().shape);
    let index = image.index(at);
    image.values[index] = 1.0;
    image
}

/// Full width at half maximum of a row, in its steps.
fn width(row: &[f32]) -> f64 {
    let top = row.iter().copied().fold(0.0, f32::max);
    let at = row.iter().position(|v| *v == top).expect("a maximum");
    let crossing = |step: isize| {
        let mut k = at as isize;
        while row[(k + step) as usize] > top / 2.0 {
            k += step;
        }
        let [inside, outside] = [row[k as usize], row[(k + step) as usize]].map(f64::from);
        (k - at as isize).abs() as f64 + (inside - f64::from(top) / 2.0) / (inside - outside)
    };
    crossing(1) + crossing(-1)
}

#[test]
fn a_point_is_as_wide_as_its_distance_says() {
    let p = from_the_front();
    let camera = camera(&p);
    let c = &p.acquisition.collimator;
    for y in [40, 128, 200] {
        let image = point(&camera, [128, y, 128]);
        let rays = camera.project(&image, None);
        let depth = camera.views[0].radius_mm - camera.place().at([0, y, 0]).y;
        let geometric = c.hole_mm * (1.0 + (depth + c.back_mm) / c.leff_mm);
        let known = geometric.hypot(c.intrinsic_fwhm_mm);
        let along = rays.primary.column(0, 64).to_vec();
        let across: Vec<f32> = (0..BINS).map(|u| rays.primary.at([0, u, 64])).collect();
        for row in [along, across] {
            let found = BIN_MM * width(&row);
            assert!(
                (found / known - 1.0).abs() < 0.05,
                "{depth}: {found} {known}"
            );
        }
    }
}

#[test]
fn projections_keep_every_count() {
    let mut p = from_the_front();
    (p.acquisition.views, p.acquisition.arc_deg) = (5, [45.0, 225.0]);
    let camera = camera(&p);
    let middle = 127.5;
    let ball = Grid::from_fn(camera.place().shape, |at| {
        let off: f64 = at.map(|i| (i as f64 - middle).powi(2)).iter().sum();
        f32::from(u8::from(off < 900.0))
    });
    let rays = camera.project(&ball, None);
    for view in 0..5 {
        let sum: f64 = (0..BINS)
            .map(|u| {
                rays.primary
                    .column(view, u)
                    .iter()
                    .map(|v| f64::from(*v))
                    .sum::<f64>()
            })
            .sum();
        assert!((sum / ball.sum() - 1.0).abs() < 0.005, "{view} {sum}");
    }
}

#[test]
fn a_slab_lets_through_what_its_depth_says() {
    let p = from_the_front();
    let camera = camera(&p);
    let place = camera.place();
    let slab = Grid::from_fn(place.shape, |at| {
        if place.at(at).y.abs() < 60.0 {
            0.015
        } else {
            0.0
        }
    });
    for y in [75, 128, 180] {
        let image = point(&camera, [128, y, 128]);
        let sum = camera.project(&image, Some(&slab)).primary.sum();
        let depth = 60.0 - place.at([0, y, 0]).y;
        let known = (-0.015 * depth).exp();
        assert!((sum / known - 1.0).abs() < 0.01, "{depth}: {sum} {known}");
    }
}

#[test]
fn counts_are_as_many_as_stated_and_scatter_has_its_share() {
    let mut p = from_the_front();
    p.acquisition.total_counts_m = 0.3;
    let camera = camera(&p);
    let place = camera.place();
    let water = Grid::from_fn(place.shape, |at| {
        if place.at(at).norm() < 90.0 {
            0.015
        } else {
            0.0
        }
    });
    let image = Grid::from_fn(place.shape, |at| {
        if place.at(at).norm() < 30.0 { 1.0 } else { 0.0 }
    });
    let rays = camera.project(&image, Some(&water));
    let exposure = Exposure {
        seed: 4,
        gate: 0,
        share: 0.5,
        side_window: true,
    };
    let made = count(&rays, &camera.views, &p.acquisition, BIN_MM, &exposure);
    assert!((made.expected.sum() / 150_000.0 - 1.0).abs() < 1e-3);
    assert!((made.counts.sum() - 150_000.0).abs() < 5.0 * 150_000.0_f64.sqrt());
    let scattered = made.scatter.expect("a side window").sum();
    // The field of view holds nearly all of the spread scatter.
    let share = scattered / (150_000.0 - scattered);
    let stated = p.acquisition.scatter_to_primary;
    assert!((0.6..1.05).contains(&(share / stated)), "{share} {stated}");
}

#[test]
fn motion_shifts_the_views_after_it() {
    let mut p = from_the_front();
    (p.acquisition.views, p.acquisition.total_counts_m) = (4, 1.0);
    let motion = BodyMotion {
        from_view_fraction: 0.5,
        dz_mm: 10.0,
        ..BodyMotion::default()
    };
    p.acquisition.body_motion = Some(motion);
    let camera = camera(&p);
    let image = point(&camera, [128, 128, 128]);
    let exposure = Exposure {
        seed: 4,
        gate: 0,
        share: 1.0,
        side_window: false,
    };
    let made = count(
        &camera.project(&image, None),
        &camera.views,
        &p.acquisition,
        BIN_MM,
        &exposure,
    );
    let middle = |view: usize| {
        let row = made.expected.column(view, 64);
        let sum: f32 = row.iter().sum();
        row.iter()
            .enumerate()
            .map(|(z, v)| z as f32 * v)
            .sum::<f32>()
            / sum
    };
    assert!((middle(1) - middle(0)).abs() < 1e-3);
    assert!((middle(2) - middle(0) - 5.0).abs() < 0.01);
    assert!((middle(3) - middle(0) - 5.0).abs() < 0.01);
    let bounce = BodyMotion {
        bounce_fraction: 0.25,
        drift_mm: 6.0,
        ..motion
    };
    let at = [0, 1, 2, 3].map(|view| bounce.at(view, 4));
    assert_eq!(at, [0.0, 2.0, 14.0, 6.0]);
}
