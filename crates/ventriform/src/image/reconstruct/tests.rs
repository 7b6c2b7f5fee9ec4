//! Projections of bodies that are known in closed form, and what must come out of them.

use super::*;
use crate::base::progress::{CancelToken, Observer, Stage};
use std::sync::atomic::{AtomicUsize, Ordering};

const COLUMNS: usize = 64;
const ROWS: usize = 20;
const PIXEL_MM: f64 = 6.4;

/// A ball of uniform uptake: its centre (x, y, z), LPS mm, and its radius.
#[derive(Clone, Copy)]
struct Ball {
    centre: [f64; 3],
    radius_mm: f64,
}

/// Points of a pixel along each side at which a ray's length in a body is averaged.
const FINE: usize = 4;

impl Ball {
    /// The counts of a pixel: the mean length, in pixels, of its rays within the ball. The detector is at `angle_deg`
    /// as PS3.3 C.8.4.11 has it, written here by its words: 0 at the back, 90 at the left, columns as seen from
    /// outside.
    fn seen(&self, angle_deg: f64, column: usize, row: usize) -> f32 {
        let angle = angle_deg.to_radians();
        let [x, y, z] = self.centre;
        // To the right of somebody who looks from the detector to the patient, the head on top.
        let across_mm = -angle.cos() * x + angle.sin() * y;
        let mut sum = 0.0;
        for fine in 0..FINE * FINE {
            let step = |n: usize| (n as f64 + 0.5) / FINE as f64 - 0.5;
            let column = column as f64 + step(fine % FINE) - 0.5 * (COLUMNS as f64 - 1.0);
            let row = row as f64 + step(fine / FINE) - 0.5 * (ROWS as f64 - 1.0);
            let off2 = (column * PIXEL_MM - across_mm).powi(2) + (-row * PIXEL_MM - z).powi(2);
            sum += 2.0 * (self.radius_mm.powi(2) - off2).max(0.0).sqrt() / PIXEL_MM;
        }
        (sum / (FINE * FINE) as f64) as f32
    }

    fn projections(&self, angles_deg: &[f64]) -> Projections {
        let mut counts = Vec::new();
        for angle in angles_deg {
            for row in 0..ROWS {
                counts.extend((0..COLUMNS).map(|column| self.seen(*angle, column, row)));
            }
        }
        Projections {
            counts,
            columns: COLUMNS,
            rows: ROWS,
            pixel_mm: PIXEL_MM,
            views: (angles_deg.iter().enumerate())
                .map(|(time, a)| View {
                    angle_deg: *a,
                    time,
                })
                .collect(),
        }
    }
}

/// `views` angles from `start` on, rising or falling over `arc`.
fn turn(start: f64, arc: f64, views: usize) -> Vec<f64> {
    (0..views)
        .map(|view| start + arc * view as f64 / views as f64)
        .collect()
}

/// Where a voxel is, LPS mm, and its value.
fn voxels(image: &[f32]) -> impl Iterator<Item = ([f64; 3], f64)> {
    let place = |at: usize, count: usize| (at as f64 - 0.5 * (count as f64 - 1.0)) * PIXEL_MM;
    image.iter().enumerate().map(move |(at, value)| {
        let (x, y, z) = (
            at % COLUMNS,
            at / COLUMNS % COLUMNS,
            at / (COLUMNS * COLUMNS),
        );
        let at = [place(x, COLUMNS), place(y, COLUMNS), place(z, ROWS)];
        (at, f64::from(*value))
    })
}

fn mean_about(image: &[f32], centre: [f64; 3], radius_mm: f64) -> f64 {
    let near = voxels(image).filter(|(at, _)| {
        let off2: f64 = at.iter().zip(centre).map(|(a, b)| (a - b).powi(2)).sum();
        off2 < radius_mm * radius_mm
    });
    let (sum, count) = near.fold((0.0, 0.0), |(sum, count), (_, value)| {
        (sum + value, count + 1.0)
    });
    sum / count
}

/// The centre of the values above half of the greatest.
fn centre_of(image: &[f32]) -> [f64; 3] {
    let half = 0.5 * f64::from(image.iter().copied().fold(0.0, f32::max));
    let mut sums = [0.0; 4];
    for (at, value) in voxels(image).filter(|(_, value)| *value > half) {
        (0..3).for_each(|axis| sums[axis] += value * at[axis]);
        sums[3] += value;
    }
    [0, 1, 2].map(|axis| sums[axis] / sums[3])
}

fn image(projections: &Projections, how: &Reconstruction) -> Vec<f32> {
    reconstruct(projections, how, &Monitor::silent()).unwrap()
}

fn fbp() -> Reconstruction {
    Reconstruction {
        method: Method::Fbp,
        ..Reconstruction::default()
    }
}

const BIG: Ball = Ball {
    centre: [-40.0, 25.0, 8.0],
    radius_mm: 50.0,
};

#[test]
fn a_ball_comes_back_with_its_value_and_its_place() {
    let small = Ball {
        centre: [60.0, -35.0, -20.0],
        radius_mm: 15.0,
    };
    let turns = [
        turn(225.0, -180.0, 30),
        turn(225.0, 180.0, 60),
        turn(0.0, 360.0, 60),
        turn(-17.0, -360.0, 64),
        // Two detectors at a right angle, each over a quarter of a turn.
        [turn(315.0, -90.0, 32), turn(225.0, -90.0, 32)].concat(),
    ];
    for angles in turns {
        for how in [Reconstruction::default(), fbp()] {
            let shown = format!("{how} from {} on {}", angles[0], angles.len());
            let found = image(&BIG.projections(&angles), &how);
            let inside = mean_about(&found, BIG.centre, 25.0);
            assert!((inside - 1.0).abs() < 0.03, "{inside} {shown}");
            let beside = mean_about(&found, [90.0, -60.0, 0.0], 30.0);
            assert!(beside < 0.03, "{beside} {shown}");
            let place = centre_of(&image(&small.projections(&angles), &how));
            for axis in 0..3 {
                let off = (place[axis] - small.centre[axis]).abs();
                assert!(off < 1.5, "{place:?} {shown}");
            }
        }
    }
}

#[test]
fn counts_are_conserved_and_both_methods_agree() {
    let projections = BIG.projections(&turn(225.0, -180.0, 60));
    let total: f32 = projections.counts.iter().sum();
    let expected = f64::from(total) / 60.0;
    let unfiltered = Reconstruction {
        filter: Filter::None,
        ..Reconstruction::default()
    };
    let sum = |how: &Reconstruction| {
        image(&projections, how)
            .iter()
            .map(|v| f64::from(*v))
            .sum::<f64>()
    };
    let share = sum(&unfiltered) / expected;
    assert!((share - 1.0).abs() < 0.01, "{share}");
    // The filter swings below 0 beside sharp edges, where it is cut.
    let share = sum(&Reconstruction::default()) / expected;
    assert!((0.99..1.05).contains(&share), "{share}");
    let [osem, fbp] = [Reconstruction::default(), fbp()].map(|how| image(&projections, &how));
    let pairs = || {
        osem.iter()
            .zip(&fbp)
            .map(|(a, b)| (f64::from(*a), f64::from(*b)))
    };
    let apart: f64 = pairs().map(|(a, b)| (a - b).powi(2)).sum();
    let size: f64 = pairs().map(|(a, _)| a * a).sum();
    assert!((apart / size).sqrt() < 0.08, "{}", (apart / size).sqrt());
}

#[test]
fn the_expected_counts_of_the_image_approach_those_measured() {
    let angles = turn(225.0, -180.0, 30);
    let projections = BIG.projections(&angles);
    let camera = Camera::new(&projections, 0.0);
    let off = |iterations: usize| {
        let how = Reconstruction {
            iterations,
            // All views at once: every iteration is likelier than the one before it, until only the grid is left.
            subsets: 1,
            filter: Filter::None,
            ..Reconstruction::default()
        };
        let image = image(&projections, &how);
        // Row 9 of the frames is slice 10.
        let plane = COLUMNS * COLUMNS;
        let slice: Vec<camera::Lanes> = image[10 * plane..11 * plane]
            .iter()
            .map(|v| [*v; camera::LANES])
            .collect();
        let mut sums = vec![[0.0; camera::LANES]; COLUMNS];
        let mut apart = 0.0;
        for view in 0..angles.len() {
            camera.project(view, &slice, &mut sums);
            let row = &projections.view(view)[9 * COLUMNS..10 * COLUMNS];
            apart += sums
                .iter()
                .zip(row)
                .map(|(sum, count)| (sum[0] - count).powi(2))
                .sum::<f32>();
        }
        apart
    };
    let [few, more, many] = [5, 20, 60].map(off);
    assert!(more < 0.1 * few && many < more, "{few} {more} {many}");
}

#[test]
fn an_axis_beside_the_middle_is_made_up_for() {
    let ball = Ball {
        centre: [20.0, 10.0, 0.0],
        radius_mm: 20.0,
    };
    let mut moved = ball.projections(&turn(0.0, 360.0, 60));
    // Two columns further on.
    for row in moved.counts.chunks_exact_mut(COLUMNS) {
        row.rotate_right(2);
    }
    let how = Reconstruction {
        axis_offset_mm: 2.0 * PIXEL_MM,
        ..Reconstruction::default()
    };
    let right = centre_of(&image(&moved, &how));
    assert!(
        (0..3).all(|axis| (right[axis] - ball.centre[axis]).abs() < 1.0),
        "{right:?}"
    );
    let inside = mean_about(&image(&moved, &how), ball.centre, 8.0);
    let without = mean_about(&image(&moved, &Reconstruction::default()), ball.centre, 8.0);
    assert!(
        inside > 0.85 && without < 0.8 * inside,
        "{inside} {without}"
    );
}

#[test]
fn filters_leave_the_share_of_a_wave_that_they_state() {
    // Eight waves over 64 voxels of 6.4 mm.
    let per_cm = 8.0 / (64.0 * 0.64);
    let wave = |x: usize| (8.0 * std::f64::consts::TAU * x as f64 / 64.0).cos() as f32;
    let voxels: Vec<f32> = (0..64 * 64 * 6).map(|at| wave(at % 64)).collect();
    for (how, known) in [
        (
            Reconstruction {
                cut_off_per_cm: per_cm,
                ..Reconstruction::default()
            },
            0.5_f64.sqrt(),
        ),
        (
            Reconstruction {
                filter: Filter::Gaussian,
                fwhm_mm: 10.0,
                ..Reconstruction::default()
            },
            // exp(-2 (pi f sd)^2), sd in cm.
            (-2.0 * (std::f64::consts::PI * per_cm / 2.354_82).powi(2)).exp(),
        ),
    ] {
        let left = filter::smoothed(voxels.clone(), [64, 64, 6], 6.4, &how);
        let share = f64::from(left[64 * 64 * 3 + 64 * 20]);
        assert!((share - known).abs() < 1e-3, "{how} {share} {known}");
    }
}

#[test]
fn the_bytes_are_the_same_on_any_number_of_threads() {
    let projections = BIG.projections(&turn(225.0, -180.0, 30));
    for how in [Reconstruction::default(), fbp()] {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| image(&projections, &how))
        };
        let bits = |image: Vec<f32>| image.into_iter().map(f32::to_bits).collect::<Vec<_>>();
        assert_eq!(bits(on(1)), bits(on(3)));
    }
}

/// Cancels at the third report.
struct Impatient {
    token: CancelToken,
    reports: AtomicUsize,
}

impl Observer for Impatient {
    fn progress(&self, _: Stage, _: f64) {
        if self.reports.fetch_add(1, Ordering::Relaxed) == 2 {
            self.token.cancel();
        }
    }
}

#[test]
fn cancelling_ends_it_soon() {
    let projections = BIG.projections(&turn(225.0, -180.0, 60));
    let observer = Impatient {
        token: CancelToken::new(),
        reports: AtomicUsize::new(0),
    };
    let monitor = Monitor::new(&observer, observer.token.clone());
    let ended = reconstruct(&projections, &Reconstruction::default(), &monitor);
    assert_eq!(ended, Err(Cancelled));
    // Two packs of slices at most were on their way.
    assert!(observer.reports.load(Ordering::Relaxed) < 6);
}

#[test]
fn no_counts_make_an_empty_image() {
    let mut projections = BIG.projections(&turn(0.0, 360.0, 16));
    projections.counts.fill(0.0);
    for how in [Reconstruction::default(), fbp()] {
        assert!(image(&projections, &how).iter().all(|v| *v == 0.0));
    }
}

#[test]
fn what_no_volume_can_be_made_of_is_refused_before_any_work() {
    let views = |angles: Vec<f64>| -> Vec<View> {
        let views = angles.into_iter().enumerate();
        views
            .map(|(time, angle_deg)| View { angle_deg, time })
            .collect()
    };
    let half = views(turn(225.0, -180.0, 60));
    assert_eq!(Projections::check(64, 64, &half), Ok(()));
    assert!(matches!(
        Projections::check(64, 64, &views(turn(0.0, 90.0, 30))),
        Err(ProjectionsError::Gap { gap_deg }) if (gap_deg - 93.0).abs() < 1e-9
    ));
    assert!(matches!(
        Projections::check(64, 64, &half[..4]),
        Err(ProjectionsError::TooFew { views: 4, .. })
    ));
    assert!(matches!(
        Projections::check(1024, 1024, &half),
        Err(ProjectionsError::Voxels {
            amount: 1_073_741_824,
            ..
        })
    ));
    let many = views(turn(0.0, 360.0, 1024));
    assert!(matches!(
        Projections::check(256, 256, &many),
        Err(ProjectionsError::Steps { .. })
    ));
}

#[test]
fn subsets_divide_the_views_where_they_can() {
    let how = Reconstruction::default();
    for (views, subsets) in [
        (30, 10),
        (60, 10),
        (64, 8),
        (32, 8),
        (59, 10),
        (8, 8),
        (72, 9),
    ] {
        assert_eq!(how.subsets_of(views), subsets, "{views}");
    }
}

/// Two balls, the smaller one brighter: a heart and what lies below it.
fn heart_and_gut(angles_deg: &[f64]) -> (Projections, Vec<f32>) {
    let heart = Ball {
        centre: [30.0, -25.0, 12.0],
        radius_mm: 32.0,
    };
    let gut = Ball {
        centre: [-20.0, 10.0, -38.0],
        radius_mm: 24.0,
    };
    let mut all = heart.projections(angles_deg);
    let below = gut.projections(angles_deg).counts;
    let seen = all.counts.iter_mut().zip(below);
    seen.for_each(|(count, below)| *count = 200.0 * *count + 500.0 * below);
    let empty = vec![0.0; COLUMNS * COLUMNS * ROWS];
    let share = voxels(&empty).map(|(at, _)| {
        let off2: f64 = at
            .iter()
            .zip(heart.centre)
            .map(|(a, b)| (a - b).powi(2))
            .sum();
        if off2 < 38.0 * 38.0 { 1.0 } else { 0.0 }
    });
    let share = share.collect();
    (all, share)
}

#[test]
fn views_are_found_where_they_were_shifted_to() {
    let (still, heart) = heart_and_gut(&turn(225.0, -180.0, 60));
    let shift = |view: usize| motion::ViewShift {
        along_mm: if view >= 24 { -10.0 } else { 0.0 },
        across_mm: if (30..40).contains(&view) { 7.0 } else { 0.0 },
    };
    let known: Vec<motion::ViewShift> = (0..60).map(shift).collect();
    let back: Vec<motion::ViewShift> = (known.iter())
        .map(|shift| motion::ViewShift {
            along_mm: -shift.along_mm,
            across_mm: -shift.across_mm,
        })
        .collect();
    let moved = motion::shifted_back(&still, &back);
    let monitor = Monitor::silent();
    let shifts = |projections: &Projections| {
        let measured = motion::view_shifts(projections, 0.0, &heart, &monitor).unwrap();
        measured.iter().map(|own| own.shift).collect::<Vec<_>>()
    };
    let (found, at_rest) = (shifts(&moved), shifts(&still));
    let mut known = known;
    motion::without_place(&moved.views, &mut known);
    for (view, ((found, rest), known)) in found.iter().zip(&at_rest).zip(&known).enumerate() {
        assert!(
            (found.along_mm - known.along_mm).abs() < 1.0,
            "{view}: {found:?} {known:?}"
        );
        assert!(
            (found.across_mm - known.across_mm).abs() < 1.5,
            "{view}: {found:?} {known:?}"
        );
        assert!(
            rest.along_mm.abs() < 0.7 && rest.across_mm.abs() < 0.9,
            "{view}: {rest:?}"
        );
    }
}

#[test]
fn shifts_have_the_same_bytes_on_any_number_of_threads() {
    let (projections, heart) = heart_and_gut(&turn(0.0, 360.0, 32));
    let shifts = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap()
            .install(|| motion::view_shifts(&projections, 0.0, &heart, &Monitor::silent()).unwrap())
    };
    assert_eq!(shifts(1), shifts(3));
}

#[test]
fn a_view_of_other_counts_is_told() {
    let mut projections = BIG.projections(&turn(225.0, -180.0, 60));
    assert_eq!(projections.odd_view(), None);
    let pixels = COLUMNS * ROWS;
    projections.counts[17 * pixels..18 * pixels]
        .iter_mut()
        .for_each(|count| *count *= 0.7);
    let odd = projections.odd_view().expect("one view");
    assert_eq!(odd.view, 17);
    assert!((odd.percent + 30.0).abs() < 1.0, "{}", odd.percent);
}
