//! Motion during the scan, from projections of the image.
//!
//! In go the image and the fitted wall; out comes [`Views`]: whether the wall lies higher or lower in some of
//! the camera's views than in the others. No sinogram is needed.
//!
//! By the projection-slice theorem the frequencies of a projection of the image at an angle are, but for the
//! lowest, those that the camera measured at that angle. A patient who moves along the bed after a part of
//! the views leaves an image whose projections up to one angle show the heart in one place, and those
//! beyond it in another one. A camera with two heads at a right angle measures a quarter turn with each of
//! them, so that the angles after the motion are two runs, a quarter turn apart. The extent along the bed of an
//! object at rest is the same at all angles.
//!
//! 1. Image and wall (with the image's uptake, blurred) are projected about the fitted heart at
//!    [`PROJECTION_ANGLES`] angles over half a turn, and the low frequencies across the bed are taken out.
//! 2. For each angle and each shift along the bed: the correlation of the two where the wall projects.
//! 3. All angles with one shift, and two sets of angles with a shift each, as one head and as two heads divide
//!    the half-turn: the gain in mean correlation of the second over the first, as a share of what the first
//!    leaves, is [`Views::gain`].
//!
//! Where nothing tells the bed's direction, several about the heart's long axis are tried.
//!
//! Not guaranteed: that motion across the bed or a slow creep is noticed. None was tried. A displacement below 10 mm
//! may hide in the noise.

use std::f64::consts::{PI, TAU};

use nalgebra::Matrix3;

use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::Volume;
use crate::image::grid::blur::{Kernel, blur};
use crate::image::grid::field::Field;
use crate::image::grid::voxelise::voxelise;
use crate::image::locate::cup::perpendicular;
use crate::mesh::TriMesh;

/// Projections over half a turn.
const PROJECTION_ANGLES: usize = 36;
/// Distance of the samples, mm.
const SAMPLE_STEP_MM: f64 = 4.0;
/// Samples on either side of the centre.
const HALF_SIDE_SAMPLES: usize = 18;
/// Samples along each axis.
const SIDE_SAMPLES: usize = 2 * HALF_SIDE_SAMPLES + 1;
/// Radius about the heart within which the image is projected, mm, and the width over which it fades out.
const PROJECTED_RADIUS_MM: [f64; 2] = [75.0, 20.0];
/// Blur of the image, of the wall, and of the uptake within the wall, sigma in mm.
const IMAGE_BLUR_MM: f64 = 3.0;
const WALL_BLUR_MM: f64 = 5.83;
const UPTAKE_BLUR_MM: f64 = 10.0;
/// Multiple of the wall's uptake at which the image is clipped: hot gut would outweigh the wall in every projection.
const CEILING_SHARE: f64 = 1.6;
/// Across the bed, structures wider than the first (sigma in mm) are left out, those narrower than the second
/// are blurred.
const BAND_SIGMA_MM: [f64; 2] = [9.55, 1.59];
/// Share of the greatest value of a view above which the wall projects there.
const SEEN_SHARE: f64 = 0.05;
/// Greatest shift along the bed, steps.
const MAX_SHIFT_STEPS: usize = 8;
/// Shifts tried: multiples of half a step.
const SHIFT_COUNT: usize = 4 * MAX_SHIFT_STEPS + 1;
/// Least number of angles in a set.
const MIN_SET_ANGLES: usize = 6;

/// Cosine of the angle between the long axis (base to apex) and the patient's superior direction in usual hearts.
const USUAL_AXIS_COSINE: f64 = -0.44;
/// Directions of the bed that are tried, all round the long axis, where nothing tells it.
const BED_DIRECTIONS: usize = 8;
/// By how much the best of so many directions gains by chance. Of six scans at rest (three of the simulator's, three
/// reconstructions of a real one) it gains 0.03 to 0.07, of four with a step of 6 to 26 mm 0.17 to 0.35.
const CHANCE_GAIN: f64 = 0.05;

/// Figures of the fitted wall in the projections of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Views {
    /// Mean correlation of image and wall in the projections, with one shift for all, -1..=1.
    pub agreement: f64,
    /// By how much two places of the wall in two sets of views explain the image better than one does, as
    /// a share of what one leaves unexplained, 0..=1.
    pub gain: f64,
    /// Distance of the two places along the bed, mm.
    pub displacement: f64,
    /// Share of the half-turn in which the wall lies in the second place, 0..=0.5.
    pub share: f64,
}

/// One value for each place along the bed (fastest), across it, and angle.
type Projections = Vec<f32>;

impl Views {
    /// The figures of the wall enclosed by `mesh`, with this typical `uptake`, in `volume`, of a patient whose bed runs
    /// along `superior` (unit vector); `None` where the wall projects to nothing.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub(super) fn new(
        mesh: &TriMesh,
        superior: &Vec3,
        volume: &Volume,
        uptake: f64,
        monitor: &Monitor,
    ) -> Result<Option<Self>, Cancelled> {
        let Some(frame) = frame_about(mesh, superior) else {
            return Ok(None);
        };
        let image = sampled(volume, &frame, CEILING_SHARE * uptake, monitor)?;
        let wall = wall_like(&image, mesh, &frame, monitor)?;
        let [image, shown] = [project(&image), project(&wall)];
        let seen = where_seen(&shown, monitor)?;
        let image = band(image, monitor)?;
        let wall = band(shown, monitor)?;
        monitor.check()?;
        let correlations: Vec<[f64; SHIFT_COUNT]> = (0..PROJECTION_ANGLES)
            .map(|angle| {
                let of = |all: &[f32]| {
                    all[angle * SIDE_SAMPLES * SIDE_SAMPLES..][..SIDE_SAMPLES * SIDE_SAMPLES]
                        .to_vec()
                };
                refined(&correlations(&of(&image), &of(&wall), &of(&seen)))
            })
            .collect();
        Ok(two_places(&correlations))
    }

    /// The same of a patient of whom nothing but the direction of the heart's long `axis` (base to apex, unit vector)
    /// in the volume is known, which tells the bed's but for a turn about that axis: [`BED_DIRECTIONS`] are tried.
    /// Neither the volume's grid nor its frame plays a part.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub(super) fn about_axis(
        mesh: &TriMesh,
        axis: &Vec3,
        volume: &Volume,
        uptake: f64,
        monitor: &Monitor,
    ) -> Result<Option<Self>, Cancelled> {
        let (e1, e2) = perpendicular(axis);
        let sine = (1.0 - USUAL_AXIS_COSINE * USUAL_AXIS_COSINE).sqrt();
        let mut found = Vec::with_capacity(BED_DIRECTIONS);
        for n in 0..BED_DIRECTIONS {
            let (sin, cos) = (TAU * n as f64 / BED_DIRECTIONS as f64).sin_cos();
            let superior = axis * USUAL_AXIS_COSINE + (e1 * cos + e2 * sin) * sine;
            found.extend(Self::new(mesh, &superior, volume, uptake, monitor)?);
        }
        Ok(Self::of_one_bed(found))
    }

    /// The figures by those of several directions, of which one may be the bed's. Motion shows from that one and its
    /// neighbours alone: what the greatest gain has beyond [`CHANCE_GAIN`] counts. A heart at rest gains little along
    /// the bed: where that is less, the lower quartile counts.
    fn of_one_bed(mut found: Vec<Self>) -> Option<Self> {
        found.sort_by(|a, b| a.gain.total_cmp(&b.gain));
        let greatest = *found.last()?;
        let agreement = found.iter().map(|views| views.agreement).sum::<f64>();
        let at_rest = found[found.len() / 4].gain;
        Some(Self {
            agreement: agreement / found.len() as f64,
            gain: at_rest.max(greatest.gain - CHANCE_GAIN),
            ..greatest
        })
    }
}

/// The grid about `mesh`, whose first axis is `superior`.
fn frame_about(mesh: &TriMesh, superior: &Vec3) -> Option<VoxelToPatient> {
    let across = superior.cross(&if superior.x.abs() < 0.7 {
        Vec3::x()
    } else {
        Vec3::y()
    });
    let across = across.try_normalize(1e-6)?;
    let axes = [*superior, across, superior.cross(&across)];
    let centre = mesh.vertices.iter().sum::<Vec3>() / mesh.vertices.len().max(1) as f64;
    let corner = centre - axes.iter().sum::<Vec3>() * (HALF_SIDE_SAMPLES as f64 * SAMPLE_STEP_MM);
    VoxelToPatient::new(Matrix3::from_columns(&axes) * SAMPLE_STEP_MM, corner).ok()
}

/// The image on the grid, clipped at `ceiling` and blurred, fading out with the distance from its first axis; 0 beyond the volume.
fn sampled(
    volume: &Volume,
    frame: &VoxelToPatient,
    ceiling: f64,
    monitor: &Monitor,
) -> Result<Vec<f32>, Cancelled> {
    let last = (SIDE_SAMPLES - 1) as f64;
    let corners: Vec<Vec3> = (0..8)
        .map(|n| {
            let at = |axis: usize| if n >> axis & 1 == 0 { 0.0 } else { last };
            frame.to_patient(&Vec3::new(at(0), at(1), at(2)))
        })
        .collect();
    let mut region = Aabb::around(&corners);
    region.min -= Vec3::repeat(3.0 * IMAGE_BLUR_MM);
    region.max += Vec3::repeat(3.0 * IMAGE_BLUR_MM);
    let field = Field::cut_out(volume, Some(&region), 0.0, monitor)?;
    let mut field = field.clipped(ceiling);
    field.blur(IMAGE_BLUR_MM, monitor)?;
    let inside = |p: &Vec3| {
        let index = volume.frame.to_voxel(p);
        (0..3).all(|a| (0.0..=volume.shape[a] as f64 - 1.0).contains(&index[a]))
    };
    let mut values = vec![0.0; SIDE_SAMPLES * SIDE_SAMPLES * SIDE_SAMPLES];
    for (n, row) in values.chunks_exact_mut(SIDE_SAMPLES).enumerate() {
        let fade = fade(n % SIDE_SAMPLES, n / SIDE_SAMPLES);
        if fade == 0.0 {
            continue;
        }
        for (i, value) in row.iter_mut().enumerate() {
            let index = Vec3::new(
                i as f64,
                (n % SIDE_SAMPLES) as f64,
                (n / SIDE_SAMPLES) as f64,
            );
            let p = frame.to_patient(&index);
            if inside(&p) {
                *value = (fade * field.at(&p)) as f32;
            }
        }
    }
    Ok(values)
}

/// 1 about the first axis, 0 beyond [`PROJECTED_RADIUS_MM`].
fn fade(j: usize, k: usize) -> f64 {
    let [x, y] = [j, k].map(|n| (n as f64 - HALF_SIDE_SAMPLES as f64) * SAMPLE_STEP_MM);
    let t = ((PROJECTED_RADIUS_MM[0] - x.hypot(y)) / PROJECTED_RADIUS_MM[1]).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The wall that `mesh` encloses, with the uptake of the image smoothed within it, blurred.
fn wall_like(
    image: &[f32],
    mesh: &TriMesh,
    frame: &VoxelToPatient,
    monitor: &Monitor,
) -> Result<Vec<f32>, Cancelled> {
    let shape = [SIDE_SAMPLES; 3];
    let mask = voxelise(mesh, shape, frame, monitor)?.voxels;
    let blurred = |mut values: Vec<f32>, sigma: f64| {
        let kernel = || Kernel::gaussian(sigma / SAMPLE_STEP_MM, 3.0);
        blur(&mut values, shape, &[kernel(), kernel(), kernel()], monitor)?;
        Ok(values)
    };
    let inside: Vec<f32> = mask.iter().map(|m| f32::from(u8::from(*m))).collect();
    let of_image = inside.iter().zip(image).map(|(m, v)| m * v).collect();
    let sums = blurred(of_image, UPTAKE_BLUR_MM)?;
    let weights = blurred(inside.clone(), UPTAKE_BLUR_MM)?;
    let wall = inside
        .iter()
        .zip(sums.iter().zip(&weights))
        .map(|(m, (sum, weight))| m * sum / weight.max(1e-3));
    blurred(wall.collect(), WALL_BLUR_MM)
}

/// The sums along lines across the first axis, at [`PROJECTION_ANGLES`] angles.
fn project(values: &[f32]) -> Projections {
    let mut views = vec![0.0; PROJECTION_ANGLES * SIDE_SAMPLES * SIDE_SAMPLES];
    for (angle, view) in views
        .chunks_exact_mut(SIDE_SAMPLES * SIDE_SAMPLES)
        .enumerate()
    {
        let (sin, cos) = (PI * angle as f64 / PROJECTION_ANGLES as f64).sin_cos();
        for (n, row) in values.chunks_exact(SIDE_SAMPLES).enumerate() {
            let [x, y] =
                [n % SIDE_SAMPLES, n / SIDE_SAMPLES].map(|n| n as f64 - HALF_SIDE_SAMPLES as f64);
            let at = x * cos + y * sin + HALF_SIDE_SAMPLES as f64;
            if at < 0.0
                || at >= (SIDE_SAMPLES - 1) as f64
                || fade(n % SIDE_SAMPLES, n / SIDE_SAMPLES) == 0.0
            {
                continue;
            }
            let bin = at as usize;
            let part = (at - bin as f64) as f32;
            let (near, far) =
                view[bin * SIDE_SAMPLES..][..2 * SIDE_SAMPLES].split_at_mut(SIDE_SAMPLES);
            for ((near, far), value) in near.iter_mut().zip(far).zip(row) {
                *near += (1.0 - part) * value;
                *far += part * value;
            }
        }
    }
    views
}

/// The projections without what is wide or narrow across the bed.
fn band(mut views: Projections, monitor: &Monitor) -> Result<Projections, Cancelled> {
    let shape = [SIDE_SAMPLES, SIDE_SAMPLES, PROJECTION_ANGLES];
    let [wide, narrow] = BAND_SIGMA_MM.map(|sigma| {
        let across = Kernel::gaussian(sigma / SAMPLE_STEP_MM, 4.0);
        [Kernel::identity(), across, Kernel::identity()]
    });
    let mut low = views.clone();
    blur(&mut low, shape, &wide, monitor)?;
    views.iter_mut().zip(&low).for_each(|(v, low)| *v -= low);
    blur(&mut views, shape, &narrow, monitor)?;
    Ok(views)
}

/// 1 where the wall projects, 0 elsewhere.
fn where_seen(views: &Projections, monitor: &Monitor) -> Result<Projections, Cancelled> {
    let mut seen = views.clone();
    let kernels = [
        Kernel::gaussian(2.0, 4.0),
        Kernel::gaussian(2.0, 4.0),
        Kernel::identity(),
    ];
    blur(
        &mut seen,
        [SIDE_SAMPLES, SIDE_SAMPLES, PROJECTION_ANGLES],
        &kernels,
        monitor,
    )?;
    for view in seen.chunks_exact_mut(SIDE_SAMPLES * SIDE_SAMPLES) {
        let greatest = view.iter().fold(0f32, |a, b| a.max(*b));
        let limit = SEEN_SHARE as f32 * greatest;
        view.iter_mut()
            .for_each(|v| *v = f32::from(u8::from(*v > limit)));
    }
    Ok(seen)
}

/// The correlations of one view of the image with the wall, moved along the bed by whole steps.
fn correlations(image: &[f32], wall: &[f32], seen: &[f32]) -> [f64; 2 * MAX_SHIFT_STEPS + 1] {
    std::array::from_fn(|n| {
        let shift = n as isize - MAX_SHIFT_STEPS as isize;
        let overlap = SIDE_SAMPLES - shift.unsigned_abs();
        let (of_image, of_wall) = (shift.max(0) as usize, (-shift).max(0) as usize);
        let [mut both, mut first, mut second] = [0f64; 3];
        for row in 0..SIDE_SAMPLES {
            let image = &image[row * SIDE_SAMPLES + of_image..][..overlap];
            let wall = &wall[row * SIDE_SAMPLES + of_wall..][..overlap];
            let seen = &seen[row * SIDE_SAMPLES + of_wall..][..overlap];
            let [mut b, mut f, mut s] = [0f32; 3];
            for ((p, q), w) in image.iter().zip(wall).zip(seen) {
                b += w * p * q;
                f += w * p * p;
                s += w * q * q;
            }
            both += f64::from(b);
            first += f64::from(f);
            second += f64::from(s);
        }
        let scale = (first * second).sqrt();
        if scale > 0.0 { both / scale } else { 0.0 }
    })
}

/// The same with shifts by half a step between (Catmull and Rom).
fn refined(coarse: &[f64; 2 * MAX_SHIFT_STEPS + 1]) -> [f64; SHIFT_COUNT] {
    let last = coarse.len() as isize - 1;
    let at = |n: isize| coarse[n.clamp(0, last) as usize];
    std::array::from_fn(|n| {
        let left = n as isize / 2;
        match n % 2 {
            0 => at(left),
            _ => (9.0 * (at(left) + at(left + 1)) - at(left - 1) - at(left + 2)) / 16.0,
        }
    })
}

/// The best split of the angles into two sets, each with its own shift: as one head divides them, and as two do.
fn two_places(correlations: &[[f64; SHIFT_COUNT]]) -> Option<Views> {
    let count = correlations.len();
    let mut sums = vec![[0.0; SHIFT_COUNT]];
    for n in 0..2 * count {
        let next = std::array::from_fn(|s| sums[n][s] + correlations[n % count][s]);
        sums.push(next);
    }
    let all = sums[count];
    let (one, _) = greatest(&all);
    let [mut gain, mut displacement, mut share] = [0.0; 3];
    let quarter = count / 2;
    let one_head =
        (MIN_SET_ANGLES..=quarter).flat_map(|length| (0..count).map(move |at| (1, length, at)));
    let two_heads = (MIN_SET_ANGLES / 2..=quarter / 2)
        .flat_map(|length| (0..quarter).map(move |at| (2, length, at)));
    for (heads, length, first) in one_head.chain(two_heads) {
        let run: [f64; SHIFT_COUNT] = std::array::from_fn(|s| {
            let of = |first: usize| sums[first + length][s] - sums[first][s];
            (0..heads).map(|head| of(first + head * quarter)).sum()
        });
        let rest: [f64; SHIFT_COUNT] = std::array::from_fn(|s| all[s] - run[s]);
        let ((a, at), (b, other)) = (greatest(&run), greatest(&rest));
        let better = (a + b - one) / count as f64;
        if better > gain {
            gain = better;
            displacement = at.abs_diff(other) as f64 * 0.5 * SAMPLE_STEP_MM;
            share = (heads * length) as f64 / count as f64;
        }
    }
    let agreement = one / count as f64;
    let seen = agreement > 0.0 && agreement.is_finite();
    seen.then_some(Views {
        agreement,
        gain: gain / (1.0 - agreement).max(1e-3),
        displacement,
        share,
    })
}

/// The greatest value and its place, the first of equals.
fn greatest(values: &[f64; SHIFT_COUNT]) -> (f64, usize) {
    let start = (f64::NEG_INFINITY, 0);
    let better =
        |best: (f64, usize), (n, v): (usize, &f64)| if *v > best.0 { (*v, n) } else { best };
    values.iter().enumerate().fold(start, better)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use nalgebra::Rotation3;

    /// The correlations of a wall that lies `shift` mm off at each angle.
    fn peaks(shift: impl Fn(usize) -> f64) -> Vec<[f64; SHIFT_COUNT]> {
        (0..PROJECTION_ANGLES)
            .map(|angle| {
                std::array::from_fn(|s| {
                    let at = (s as f64 - (SHIFT_COUNT / 2) as f64) * 0.5 * SAMPLE_STEP_MM;
                    (-(at - shift(angle)).powi(2) / 200.0).exp()
                })
            })
            .collect()
    }

    /// A wave across the bed is weakened by the Fourier transforms of both Gaussians, waves along the other axes by
    /// none: what does not change across the bed vanishes.
    #[test]
    fn waves_across_the_bed_pass_as_the_band_lets_them() {
        for length in [32.0, 48.0, 64.0] {
            let wave = |i: usize| {
                (TAU * SAMPLE_STEP_MM * (i as f64 - HALF_SIDE_SAMPLES as f64) / length).cos()
            };
            let views: Projections = (0..SIDE_SAMPLES * SIDE_SAMPLES * PROJECTION_ANGLES)
                .map(|n| wave(n / SIDE_SAMPLES % SIDE_SAMPLES) as f32)
                .collect();
            let passed = band(views, &Monitor::silent()).unwrap();
            let left = |sigma: f64| (-(TAU * sigma / length).powi(2) / 2.0).exp();
            let expected = (1.0 - left(BAND_SIGMA_MM[0])) * left(BAND_SIGMA_MM[1]);
            let centre =
                f64::from(passed[(5 * SIDE_SAMPLES + HALF_SIDE_SAMPLES) * SIDE_SAMPLES + 11]);
            assert!((centre - expected).abs() < 0.03, "{centre} {expected}");
        }
        let along = (0..SIDE_SAMPLES * SIDE_SAMPLES * PROJECTION_ANGLES)
            .map(|n| (n % SIDE_SAMPLES) as f32)
            .collect();
        let passed = band(along, &Monitor::silent()).unwrap();
        assert!(passed[(5 * SIDE_SAMPLES + HALF_SIDE_SAMPLES) * SIDE_SAMPLES + 11].abs() < 1e-4);
    }

    #[test]
    fn two_sets_of_views_tell_how_far_the_heart_moved() {
        let moved = |angle: usize| if (5..20).contains(&angle) { 12.0 } else { -4.0 };
        let views = two_places(&peaks(moved)).unwrap();
        assert_eq!(views.displacement, 16.0);
        assert!((views.share - 15.0 / 36.0).abs() < 1e-12 && views.gain > 0.9);
        let two_heads = |angle: usize| if angle % 18 >= 11 { 12.0 } else { -4.0 };
        let views = two_places(&peaks(two_heads)).unwrap();
        assert_eq!(views.displacement, 16.0);
        assert!((views.share - 14.0 / 36.0).abs() < 1e-12 && views.gain > 0.9);
        let still = two_places(&peaks(|_| 4.0)).unwrap();
        assert_eq!((still.gain, still.displacement), (0.0, 0.0));
    }

    /// Motion along one of the directions counts but for what chance brings; none does where all gain alike.
    #[test]
    fn of_many_directions_only_an_outstanding_one_tells_of_motion() {
        let of = |gains: &[f64]| {
            let views = |gain: &f64| Views {
                agreement: 0.8,
                gain: *gain,
                displacement: 100.0 * gain,
                share: 0.3,
            };
            Views::of_one_bed(gains.iter().map(views).collect())
        };
        assert_eq!(of(&[]), None);
        let still = of(&[0.01, 0.05, 0.02, 0.01, 0.0, 0.03, 0.01, 0.04]).unwrap();
        assert_eq!(still.gain, 0.01);
        let moved = of(&[0.01, 0.05, 0.02, 0.01, 0.0, 0.3, 0.01, 0.04]).unwrap();
        assert!((moved.gain - (0.3 - CHANCE_GAIN)).abs() < 1e-12);
        assert_eq!(moved.displacement, 30.0);
        assert!((moved.agreement - 0.8).abs() < 1e-12);
    }

    /// The same shell on grids turned against each other has the same figures: only the axis counts.
    #[test]
    fn the_grid_does_not_matter_where_the_bed_is_unknown() {
        let axis = Vec3::new(0.6, -0.6, -0.5).normalize();
        let ball = shapes::icosphere(34.0, 3);
        let bright = |p: &Vec3| {
            let wall = ((p.norm() - 28.0) / 7.0).powi(2);
            (-wall).exp() * (1.2 - 0.004 * p.dot(&axis))
        };
        let found = [0.0, 0.4, 1.1].map(|angle| {
            let turn = Rotation3::from_axis_angle(&Vec3::x_axis(), angle);
            let linear: Matrix3<f64> = turn.matrix() * 4.0;
            let corner = linear * Vec3::repeat(-23.5);
            let frame = VoxelToPatient::new(linear, corner).unwrap();
            let volume = Volume::sampled([48; 3], frame, bright);
            Views::about_axis(&ball, &axis, &volume, 1.0, &Monitor::silent())
                .unwrap()
                .unwrap()
        });
        for other in &found[1..] {
            assert!((other.gain - found[0].gain).abs() < 0.01, "{found:?}");
            assert!(
                (other.agreement - found[0].agreement).abs() < 0.01,
                "{found:?}"
            );
        }
    }

    #[test]
    fn a_shell_in_its_own_image_agrees_and_is_at_rest() {
        let frame = VoxelToPatient::centred([48; 3], [4.0; 3], Vec3::zeros());
        let ball = shapes::icosphere(34.0, 3);
        let ramp = |p: &Vec3| 1.0 / (1.0 + ((p.norm() - 34.0) / 2.0).exp());
        let volume = Volume::sampled([48; 3], frame.unwrap(), ramp);
        let views = Views::new(&ball, &Vec3::z(), &volume, 1.0, &Monitor::silent()).unwrap();
        let views = views.unwrap();
        assert!(views.agreement > 0.95 && views.gain < 0.02, "{views:?}");
    }

    /// The weights of Catmull and Rom are exact for cubic polynomials.
    #[test]
    fn shifts_by_half_a_step_follow_a_cubic() {
        let cubic = |x: f64| 0.3 + x * (0.2 - x * (0.05 + 0.01 * x));
        let coarse = std::array::from_fn(|n| cubic(n as f64 - MAX_SHIFT_STEPS as f64));
        let fine = refined(&coarse);
        for (n, value) in fine.iter().enumerate() {
            let exact = cubic(0.5 * n as f64 - MAX_SHIFT_STEPS as f64);
            let end = n == 1 || n == SHIFT_COUNT - 2;
            assert!(end || (value - exact).abs() < 1e-12, "{n}: {value} {exact}");
        }
        // At the ends the first and the last value continue.
        let [a, b, c] = [coarse[0], coarse[1], coarse[2]];
        assert!((fine[1] - (9.0 * (a + b) - a - c) / 16.0).abs() < 1e-12);
    }

    fn noise(seed: usize) -> Vec<f32> {
        let of = |n: usize| (n * n % 8191) as f32 * 0.37 + (seed * n) as f32 * 1.3;
        (0..SIDE_SAMPLES * SIDE_SAMPLES)
            .map(|n| of(n).sin())
            .collect()
    }

    #[test]
    fn correlations_are_those_of_the_wall_moved_by_steps() {
        let (image, wall) = (noise(1), noise(2));
        let seen: Vec<f32> = (0..SIDE_SAMPLES * SIDE_SAMPLES)
            .map(|n| f32::from(u8::from(n % 3 > 0)))
            .collect();
        let found = correlations(&image, &wall, &seen);
        for (n, found) in found.iter().enumerate() {
            let shift = n as i64 - MAX_SHIFT_STEPS as i64;
            let [mut both, mut first, mut second] = [0.0; 3];
            for row in 0..SIDE_SAMPLES {
                for at in 0..SIDE_SAMPLES as i64 {
                    if !(0..SIDE_SAMPLES as i64).contains(&(at + shift)) {
                        continue;
                    }
                    let of =
                        |all: &[f32], at: i64| f64::from(all[row * SIDE_SAMPLES + at as usize]);
                    let (p, q, w) = (of(&image, at + shift), of(&wall, at), of(&seen, at));
                    both += w * p * q;
                    first += w * p * p;
                    second += w * q * q;
                }
            }
            let exact = both / (first * second).sqrt();
            assert!((found - exact).abs() < 1e-4, "{n}: {found} {exact}");
        }
        assert_eq!(
            correlations(&image, &wall, &[0.0; SIDE_SAMPLES * SIDE_SAMPLES]),
            [0.0; 2 * MAX_SHIFT_STEPS + 1]
        );
    }

    /// The limit of a view is its own, wherever in it the wall lies.
    #[test]
    fn a_wall_is_seen_in_each_view_against_the_brightest_there() {
        let at = |along: usize, across: usize| across * SIDE_SAMPLES + along;
        let (bright, dim) = (at(9, 9), at(27, 27));
        let mut views = vec![0.0; PROJECTION_ANGLES * SIDE_SAMPLES * SIDE_SAMPLES];
        for (angle, view) in views
            .chunks_exact_mut(SIDE_SAMPLES * SIDE_SAMPLES)
            .enumerate()
        {
            view[dim] = 1.0;
            view[bright] = if angle % 2 == 0 { 0.5 } else { 50.0 };
        }
        let seen = where_seen(&views, &Monitor::silent()).unwrap();
        for (angle, view) in seen.chunks_exact(SIDE_SAMPLES * SIDE_SAMPLES).enumerate() {
            let even = f32::from(u8::from(angle % 2 == 0));
            assert_eq!((view[bright], view[dim]), (1.0, even), "{angle}");
            assert_eq!(view[at(27, 9)], 0.0);
        }
    }

    /// A row of samples along the bed projects to its distance from the axis in the direction of each angle.
    #[test]
    fn a_line_along_the_bed_projects_to_its_place_at_each_angle() {
        let (x, y) = (7, -5);
        let row = (HALF_SIDE_SAMPLES as i64 + x) as usize
            + SIDE_SAMPLES * (HALF_SIDE_SAMPLES as i64 + y) as usize;
        let mut values = vec![0f32; SIDE_SAMPLES * SIDE_SAMPLES * SIDE_SAMPLES];
        for (n, v) in values[row * SIDE_SAMPLES..][..SIDE_SAMPLES]
            .iter_mut()
            .enumerate()
        {
            *v = 1.0 + n as f32;
        }
        let views = project(&values);
        for (angle, view) in views.chunks_exact(SIDE_SAMPLES * SIDE_SAMPLES).enumerate() {
            let turn = PI * angle as f64 / PROJECTION_ANGLES as f64;
            let place = x as f64 * turn.cos() + y as f64 * turn.sin();
            for along in [0, 20] {
                let at = |bin: usize| f64::from(view[bin * SIDE_SAMPLES + along]);
                let sum: f64 = (0..SIDE_SAMPLES).map(at).sum();
                let mean = (0..SIDE_SAMPLES)
                    .map(|b| at(b) * (b as f64 - HALF_SIDE_SAMPLES as f64))
                    .sum::<f64>()
                    / sum;
                assert!((sum - (1 + along) as f64).abs() < 1e-3, "{sum}");
                assert!((mean - place).abs() < 1e-4, "{angle}: {mean} {place}");
            }
        }
    }

    #[test]
    fn the_image_fades_out_across_the_bed() {
        assert_eq!(fade(HALF_SIDE_SAMPLES, HALF_SIDE_SAMPLES), 1.0);
        assert_eq!(fade(HALF_SIDE_SAMPLES + 13, HALF_SIDE_SAMPLES), 1.0);
        assert_eq!(
            (
                fade(HALF_SIDE_SAMPLES + 18, HALF_SIDE_SAMPLES + 6),
                fade(0, 0)
            ),
            (0.0, 0.0)
        );
        // Half-way through the fade; the same all round.
        let at =
            |steps: f64| (PROJECTED_RADIUS_MM[0] - steps * SAMPLE_STEP_MM) / PROJECTED_RADIUS_MM[1];
        let t = at(16.0);
        assert!(
            (fade(HALF_SIDE_SAMPLES, HALF_SIDE_SAMPLES - 16) - t * t * (3.0 - 2.0 * t)).abs()
                < 1e-12
        );
        let t = at(12f64.hypot(12.0));
        assert!(
            (fade(HALF_SIDE_SAMPLES + 12, HALF_SIDE_SAMPLES - 12) - t * t * (3.0 - 2.0 * t)).abs()
                < 1e-12
        );
    }

    #[test]
    fn the_grid_lies_about_the_heart_and_along_the_bed() {
        let mut ball = shapes::icosphere(30.0, 2);
        let centre = Vec3::new(12.0, -40.0, 7.0);
        ball.vertices.iter_mut().for_each(|p| *p += centre);
        for superior in [Vec3::z(), Vec3::x(), Vec3::new(0.6, 0.0, 0.8)] {
            let frame = frame_about(&ball, &superior).unwrap();
            let at = |i: f64, j: f64, k: f64| frame.to_patient(&Vec3::new(i, j, k));
            let half = HALF_SIDE_SAMPLES as f64;
            assert!((at(half, half, half) - centre).norm() < 1e-6);
            let along = at(half + 1.0, half, half) - centre;
            assert!((along - superior * SAMPLE_STEP_MM).norm() < 1e-6);
            for spacing in frame.spacing().iter() {
                assert!((spacing - SAMPLE_STEP_MM).abs() < 1e-9);
            }
        }
    }

    /// Brute force over every division of the half-turn, for correlations without any order.
    #[test]
    fn the_division_found_is_the_best_of_all() {
        let correlations: Vec<[f64; SHIFT_COUNT]> = (0..PROJECTION_ANGLES)
            .map(|a| {
                std::array::from_fn(|s| 0.3 + 0.2 * ((a * a * 7 + s * s * a + 3 * s) as f64).sin())
            })
            .collect();
        let best_of = |angles: &[usize]| {
            let sum = |s: usize| angles.iter().map(|a| correlations[*a][s]).sum::<f64>();
            (0..SHIFT_COUNT).map(sum).fold(f64::MIN, f64::max)
        };
        let all: Vec<usize> = (0..PROJECTION_ANGLES).collect();
        let one = best_of(&all) / PROJECTION_ANGLES as f64;
        let mut most = 0.0;
        let mut consider = |inside: &dyn Fn(usize) -> bool| {
            let (run, rest): (Vec<usize>, Vec<usize>) =
                all.iter().copied().partition(|a| inside(*a));
            let gain = (best_of(&run) + best_of(&rest)) / PROJECTION_ANGLES as f64 - one;
            if gain > most {
                most = gain;
            }
        };
        for first in 0..PROJECTION_ANGLES {
            for length in MIN_SET_ANGLES..=PROJECTION_ANGLES / 2 {
                consider(&|a| (a + PROJECTION_ANGLES - first) % PROJECTION_ANGLES < length);
            }
            for length in MIN_SET_ANGLES / 2..=PROJECTION_ANGLES / 4 {
                consider(&|a| (a + PROJECTION_ANGLES - first) % (PROJECTION_ANGLES / 2) < length);
            }
        }
        let views = two_places(&correlations).unwrap();
        assert!((views.agreement - one).abs() < 1e-9);
        assert!((views.gain - most / (1.0 - one)).abs() < 1e-9);
    }
}
