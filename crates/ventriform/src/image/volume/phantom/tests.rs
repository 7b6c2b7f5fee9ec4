use super::*;
use crate::base::geometry::Vec3;

fn small() -> PhantomParameters {
    PhantomParameters {
        shape: [48, 48, 48],
        spacing_mm: [4.5; 3],
        ..PhantomParameters::default()
    }
}

fn make(parameters: &PhantomParameters) -> Phantom {
    phantom(parameters, &Monitor::silent()).unwrap()
}

/// Volume of the wall by integrating its definition: outer minus inner half ellipsoid plus the
/// cylinders' parts between equator and base (a slanted base cuts off as much as it adds).
fn wall_ml(p: &PhantomParameters) -> f64 {
    let shell = |wide: f64, long: f64| {
        let h = p.base_mm;
        let below = 2.0 / 3.0 * long;
        let above = h - h.powi(3) / (3.0 * long * long);
        std::f64::consts::PI * wide * wide * (below + above)
    };
    let (wide, long) = (p.width_mm / 2.0, p.length_mm - p.base_mm);
    (shell(wide, long) - shell(wide - p.wall_mm, long - p.wall_mm)) / 1000.0
}

#[test]
fn the_truth_has_the_volume_of_the_formula() {
    let p = PhantomParameters {
        base_tilt_deg: 0.0,
        ..small()
    };
    for seed in 1..4 {
        let truth = make(&PhantomParameters { seed, ..p.clone() }).truth;
        let voxels = truth.voxels.iter().filter(|&&v| v == 1.0).count();
        let ml = voxels as f64 * truth.frame.voxel_volume() / 1000.0;
        assert!(
            (ml / wall_ml(&p) - 1.0).abs() < 0.02,
            "{ml} {}",
            wall_ml(&p)
        );
    }
}

#[test]
fn the_wall_lies_where_the_pose_says() {
    let made = make(&small());
    let pose = made.pose;
    let p = &made.parameters;
    let at = |point: Vec3| {
        let v = made
            .truth
            .frame
            .to_voxel(&point)
            .map(|x| x.round() as usize);
        made.truth.at(v.x, v.y, v.z)
    };
    assert_eq!(at(pose.apex - 0.5 * p.wall_mm * pose.axis), 1.0);
    let middle = (pose.apex + pose.base) / 2.0;
    assert_eq!(at(middle), 0.0);
    let equator = pose.base + p.base_mm * pose.axis;
    for side in [pose.anterior, -pose.anterior, pose.septal, -pose.septal] {
        assert_eq!(at(equator + (p.width_mm - p.wall_mm) / 2.0 * side), 1.0);
        assert!(side.dot(&pose.axis).abs() < 1e-9);
    }
    assert!(pose.anterior.z > 0.0, "the anterior wall is up");
    assert!(pose.septal.x < 0.0, "the septum is on the patient's right");
}

#[test]
fn a_defect_darkens_its_segment_and_no_other() {
    let quiet = PhantomParameters {
        noise: 0.0,
        fwhm_mm: 0.0,
        post_filter_mm: 0.0,
        ..small()
    };
    let healthy = make(&quiet);
    let defect = PerfusionDefect {
        segment: 10,
        severity: 1.0,
    };
    let ill = make(&PhantomParameters {
        defects: vec![defect],
        ..quiet
    });
    assert_eq!(healthy.truth.voxels, ill.truth.voxels);
    let pose = ill.pose;
    let mut darker = 0;
    for (n, (a, b)) in healthy
        .volume
        .voxels
        .iter()
        .zip(&ill.volume.voxels)
        .enumerate()
    {
        if a != b {
            darker += 1;
            assert!(b < a);
            let index = Vec3::new((n % 48) as f64, (n / 48 % 48) as f64, (n / 48 / 48) as f64);
            let from = ill.volume.frame.to_patient(&index) - pose.base;
            // Segment 10 is the inferior part of the middle third.
            assert!(from.dot(&pose.anterior) < 0.0);
            let along = from.dot(&pose.axis) / ill.parameters.length_mm;
            assert!((0.15..0.6).contains(&along), "{along}");
        }
    }
    assert!(darker > 50);
}

#[test]
fn noise_has_the_asked_for_spread_and_no_bias() {
    let p = PhantomParameters {
        noise: 0.1,
        background: 1.0,
        liver: 1.0,
        gut: 1.0,
        ..small()
    };
    let noisy = make(&p).volume;
    let clean = make(&PhantomParameters { noise: 0.0, ..p }).volume;
    // The voxels of uniform uptake 1, well inside.
    let pairs = noisy.voxels.iter().zip(&clean.voxels);
    let ratios: Vec<f64> = pairs
        .filter(|(_, c)| (*c - 1000.0).abs() < 1.0)
        .map(|(n, c)| f64::from(n / c))
        .collect();
    let n = ratios.len() as f64;
    assert!(n > 1000.0);
    let mean = ratios.iter().sum::<f64>() / n;
    let sd = (ratios.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / n).sqrt();
    assert!((mean - 1.0).abs() < 0.02, "{mean}");
    assert!((sd / 0.1 - 1.0).abs() < 0.1, "{sd}");
}

#[test]
fn threads_change_nothing_and_seeds_do() {
    let p = small();
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let five = rayon::ThreadPoolBuilder::new()
        .num_threads(5)
        .build()
        .unwrap();
    let a = one.install(|| make(&p));
    let b = five.install(|| make(&p));
    assert_eq!(a.volume.voxels, b.volume.voxels);
    let c = make(&PhantomParameters { seed: 2, ..p });
    assert_ne!(a.volume.voxels, c.volume.voxels);
    assert_ne!(a.pose, c.pose);
}

#[test]
fn what_is_out_of_range_is_named() {
    let p = small();
    let field = |p: PhantomParameters| match phantom(&p, &Monitor::silent()) {
        Err(PhantomError::OutOfRange { field, .. }) => field,
        other => panic!("{other:?}"),
    };
    assert_eq!(
        field(PhantomParameters {
            noise: f64::NAN,
            ..p.clone()
        }),
        "noise"
    );
    assert_eq!(
        field(PhantomParameters {
            wall_mm: 40.0,
            ..p.clone()
        }),
        "wall_mm"
    );
    assert_eq!(
        field(PhantomParameters {
            shape: [8, 64, 64],
            ..p.clone()
        }),
        "shape"
    );
    let none = PerfusionDefect {
        segment: 18,
        severity: 0.5,
    };
    let p = PhantomParameters {
        defects: vec![none],
        ..p
    };
    assert_eq!(field(p), "defects.segment");
    let narrow = PhantomParameters {
        spacing_mm: [2.0; 3],
        ..small()
    };
    assert!(matches!(
        phantom(&narrow, &Monitor::silent()),
        Err(PhantomError::TooSmall { .. })
    ));
}

/// A patient who does not move, without noise and blur.
fn still() -> PhantomParameters {
    PhantomParameters {
        shape: [48; 3],
        spacing_mm: [4.0; 3],
        noise: 0.0,
        fwhm_mm: 0.0,
        post_filter_mm: 0.0,
        ..PhantomParameters::default()
    }
}

/// The sums of a volume of 48 x 48 x 48 voxels along its rays, for each slice over the bins of a row at this angle from
/// i to j. Rows along i and j have each voxel in one bin.
fn projected(p: &Phantom, degrees: f64) -> Vec<f64> {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let mut sums = vec![0.0; 48 * 80];
    for (n, v) in p.volume.voxels.iter().enumerate() {
        let [i, j] = [n % 48, n / 48 % 48].map(|n| n as f64 - 23.5);
        let at = i * cos + j * sin + 40.5;
        let place = n / (48 * 48) * 80 + at as usize;
        sums[place] += (1.0 - at.fract()) * f64::from(*v);
        sums[place + 1] += at.fract() * f64::from(*v);
    }
    sums
}

/// The sum of the squared differences.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

#[test]
fn views_before_and_after_the_motion_show_the_heart_in_either_place() {
    let moved = |share| PhantomParameters {
        motion_mm: 12.0,
        motion_share: share,
        ..still()
    };
    let make = |p: &PhantomParameters| phantom(p, &Monitor::silent()).unwrap();
    let (first, half, last) = (make(&still()), make(&moved(0.5)), make(&moved(1.0)));
    assert_eq!(first.truth.voxels, half.truth.voxels);
    assert_eq!(first.volume.voxels, make(&moved(0.0)).volume.voxels);
    let slices = 3 * 48 * 48;
    let end = first.volume.voxels.len();
    assert_eq!(
        last.volume.voxels[slices..],
        first.volume.voxels[..end - slices]
    );
    // Half-way through the first half of the views the rows run along i, half-way through the second along j.
    for (degrees, [shown, hidden]) in [(0.0, [&first, &last]), (90.0, [&last, &first])] {
        let half = projected(&half, degrees);
        let [right, wrong] = [shown, hidden].map(|p| apart(&half, &projected(p, degrees)));
        // Interpolation between the bins smooths what has no blur.
        assert!(right < 0.2 * wrong, "{degrees}: {right} {wrong}");
    }
}

#[test]
fn two_heads_see_either_place_in_two_runs_of_views() {
    let make = |heads, share| {
        let moved = PhantomParameters {
            motion_mm: 12.0,
            motion_share: share,
            heads,
            ..still()
        };
        phantom(&moved, &Monitor::silent()).unwrap()
    };
    let [first, half, last] = [0.0, 0.5, 1.0].map(|share| make(2, share));
    assert_eq!(first.volume.voxels, make(1, 0.0).volume.voxels);
    assert_eq!(last.volume.voxels, make(1, 1.0).volume.voxels);
    // The heads start at 135 and 225 degrees. An eighth of a turn later the patient moves: rows at 157 and 247
    // degrees are from before it, those at 202 and 292 from after it.
    for (degrees, [shown, hidden]) in [
        (157.5, [&first, &last]),
        (202.5, [&last, &first]),
        (247.5, [&first, &last]),
        (292.5, [&last, &first]),
    ] {
        let half = projected(&half, degrees);
        let [right, wrong] = [shown, hidden].map(|p| apart(&half, &projected(p, degrees)));
        assert!(right < 0.25 * wrong, "{degrees}: {right} {wrong}");
    }
}
