use super::*;

const COUNT: usize = 64;
const VIEWS: usize = 60;
const SLICES: usize = 4;

fn views() -> Vec<View> {
    (0..VIEWS)
        .map(|view| {
            let angle = (45.0 + 180.0 * (view as f64 + 0.5) / VIEWS as f64).to_radians();
            View {
                cos: angle.cos(),
                sin: angle.sin(),
                radius_mm: 250.0,
            }
        })
        .collect()
}

/// Projections of a disc beside the middle: `of_chord` of the length of each ray within it.
fn projections(centre: [f64; 2], radius: f64, of_chord: impl Fn(f64) -> f64 + Sync) -> Grid {
    let all = views();
    Grid::from_fn([VIEWS, COUNT, SLICES], |[view, u, _]| {
        let view = &all[view];
        let off = u as f64 - 31.5 - (view.cos * centre[1] - view.sin * centre[0]);
        of_chord(2.0 * (radius * radius - off * off).max(0.0).sqrt()) as f32
    })
}

fn how(method: Method, attenuation_corrected: bool) -> Reconstruction {
    Reconstruction {
        method,
        attenuation_corrected,
        scatter_corrected: false,
        mu_map_shift_mm: [0.0; 3],
        subsets: 10,
        iterations: 6,
        filter: Filter::Butterworth {
            cut_off_per_cm: 0.6,
            order: 7,
        },
    }
}

/// Mean over the voxels of a slice within a distance of a point.
fn mean_about(image: &Grid, centre: [f64; 2], radius: f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for x in 0..COUNT {
        for y in 0..COUNT {
            let off = (x as f64 - 31.5 - centre[0]).hypot(y as f64 - 31.5 - centre[1]);
            if off < radius {
                sum += f64::from(image.at([x, y, 1]));
                count += 1.0;
            }
        }
    }
    sum / count
}

#[test]
fn a_disc_comes_back_with_its_value_and_place() {
    let (centre, radius) = ([7.0, -5.0], 12.0);
    let projections = projections(centre, radius, |chord| chord);
    for method in [Method::Fbp, Method::Osem] {
        let image = reconstruct(
            &projections,
            &views(),
            6.4,
            &how(method, false),
            &Knowledge::default(),
        );
        let inside = mean_about(&image, centre, 9.0);
        assert!((inside - 1.0).abs() < 0.03, "{method:?} {inside}");
        let beside = mean_about(&image, [-15.0, 12.0], 5.0);
        assert!(beside < 0.03, "{method:?} {beside}");
        let whole = mean_about(&image, [0.0, 0.0], 31.0) * 31.0 * 31.0 / (radius * radius);
        assert!((whole - 1.0).abs() < 0.05, "{method:?} {whole}");
    }
}

#[test]
fn an_attenuated_disc_is_even_if_the_attenuation_is_known() {
    let (radius, per_voxel) = (22.0, 0.08);
    let projections = projections([0.0, 0.0], radius, |chord| {
        (1.0 - (-per_voxel * chord).exp()) / per_voxel
    });
    // Half a turn sees the front more than the back; a whole turn's mean is the same as of the opposite views.
    let map = Grid::from_fn([COUNT, COUNT, SLICES], |[x, y, _]| {
        let off = (x as f64 - 31.5).hypot(y as f64 - 31.5);
        if off < radius {
            per_voxel as f32 / 6.4
        } else {
            0.0
        }
    });
    let made = |known: &Knowledge, corrected: bool| {
        reconstruct(
            &projections,
            &views(),
            6.4,
            &how(Method::Osem, corrected),
            known,
        )
    };
    let known = Knowledge {
        attenuation: Some(&map),
        scatter: None,
    };
    let corrected = made(&known, true);
    for centre in [[0.0, 0.0], [8.0, 8.0], [-8.0, -8.0]] {
        let value = mean_about(&corrected, centre, 5.0);
        assert!((value - 1.0).abs() < 0.08, "{centre:?} {value}");
    }
    assert!(mean_about(&made(&Knowledge::default(), false), [0.0, 0.0], 5.0) < 0.5);
}

#[test]
fn scatter_that_is_known_is_taken_off() {
    let more = 2.0;
    let projections = projections([0.0, 0.0], 12.0, |chord| chord + more);
    let scatter = Grid {
        shape: projections.shape,
        values: vec![more as f32; projections.values.len()],
    };
    let known = Knowledge {
        attenuation: None,
        scatter: Some(&scatter),
    };
    let image = reconstruct(
        &projections,
        &views(),
        6.4,
        &how(Method::Osem, false),
        &known,
    );
    assert!((mean_about(&image, [0.0, 0.0], 9.0) - 1.0).abs() < 0.04);
}

#[test]
fn filters_leave_the_share_of_a_wave_that_they_state() {
    // Eight waves over 64 voxels of 6.4 mm: 0.195 per cm.
    let wave = |x: usize| (8.0 * 2.0 * PI * x as f64 / COUNT as f64).cos();
    let image = Grid::from_fn([COUNT, COUNT, 8], |[x, _, _]| wave(x) as f32);
    let per_cm = 8.0 / (64.0 * 0.64);
    for (filter, known) in [
        (
            Filter::Butterworth {
                cut_off_per_cm: per_cm,
                order: 5,
            },
            0.5_f64.sqrt(),
        ),
        (
            Filter::Hann {
                cut_off_per_cm: 2.0 * per_cm,
            },
            0.5,
        ),
        // A normal distribution of 10 mm: exp(-2 (pi f sd)^2).
        (
            Filter::Gaussian { fwhm_mm: 10.0 },
            (-2.0 * (PI * per_cm * 1.0 / 2.354_82).powi(2)).exp(),
        ),
    ] {
        let left = filtered(&image, 6.4, &filter);
        let share = f64::from(left.at([0, 20, 3]));
        assert!((share - known).abs() < 1e-3, "{filter:?} {share} {known}");
    }
}

#[test]
fn every_subset_is_taken_once() {
    for subsets in [1, 4, 8, 10] {
        let mut order = subset_order(subsets);
        order.sort_unstable();
        assert_eq!(order, (0..subsets).collect::<Vec<_>>());
    }
}
