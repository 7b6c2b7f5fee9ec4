//! Whether the image ends in the wall: at the border of the volume, or at voxels that hold nothing.
//!
//! A scan is blurred, so that no value falls to nothing within one voxel. Where it does beside the wall, the image was
//! cut: by the array, by missing values, or by a constant that stands for them. In: the fitted wall, the volume. Out:
//! the area of such steps near the wall, cm².
//!
//! 1. Voxels that hold nothing: beyond the array, NaN, or in a connected region of one value ([`LEAST_EQUAL_VOXELS`]).
//! 2. A step is the face between such a voxel and another one that is brighter by more than [`STEP_SHARE`] of the
//!    wall's uptake, within [`REACH_MM`] of the wall.
//! 3. An image that was cut and interpolated afterwards, as by a turn of its slices, rises over two voxels: the second
//!    one is brighter by that much, and the third one hardly brighter than the second ([`LEVEL_SHARE`]). The foot of a
//!    blurred wall grows steeper there.
//!
//! Backgrounds of zeros far from the wall make no steps: their neighbours differ little. Plateaus of clipped values
//! make none: their neighbours are darker.

use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::{Aabb, Bvh};
use crate::heart::model::wall::VentricleWall;
use crate::image::grid::Volume;
use crate::mesh::TriMesh;

/// Least number of voxels of one value, connected by faces, that hold nothing.
const LEAST_EQUAL_VOXELS: usize = 50;
/// Step of an image that was cut, as a share of the wall's uptake.
const STEP_SHARE: f64 = 0.4;
/// Most that an image that was interpolated after it was cut rises from the second voxel to the third, as a share of
/// its mean rise from voxel to voxel before. With 0.25 to 0.5, 40 cuts of 8 simulated hearts (seed 5001), resliced
/// obliquely, have 7 cm² of steps and more; of 172 whole scans (seeds 5001 and 8801) the largest has 1.2 cm² with 0.35,
/// 2.7 with 0.5 and 5 with 0.7.
const LEVEL_SHARE: f64 = 0.35;
/// Difference of values that count as one, as a share of the wall's uptake: interpolation rounds a constant.
const EQUAL_SHARE: f64 = 1e-4;
/// Distance from the wall up to which steps count, mm.
const REACH_MM: f64 = 12.0;

/// Values from beyond the end of an image inward, in the order of the voxels.
struct Ramp {
    beyond: f64,
    first: f64,
    /// The second and the third voxel, where there are some.
    inward: Option<[f64; 2]>,
}

impl Ramp {
    /// Whether the image ends here by `least_step` or more: within one voxel, or, where it was interpolated after it
    /// was cut, within two. Blurred walls rise farther beyond the second voxel.
    fn is_step(&self, least_step: f64) -> bool {
        let after_two = |[second, third]: [f64; 2]| {
            let rise = second - self.beyond;
            rise >= least_step && third - second <= LEVEL_SHARE * rise / 2.0
        };
        self.first - self.beyond >= least_step || self.inward.is_some_and(after_two)
    }
}

/// The area of the steps at which the image ends within reach of the wall enclosed by `mesh`, cm².
pub(super) fn cut_area_cm2(mesh: &TriMesh, wall: &VentricleWall, volume: &Volume) -> f64 {
    let uptake = bright_uptake(wall, volume);
    if uptake.is_nan() || uptake <= 0.0 {
        return 0.0;
    }
    let least_step = STEP_SHARE * uptake;
    let part = Part::about(mesh, volume);
    // Both are made for the first step alone: most images have none.
    let (mut empty, mut surface) = (None, None);
    let mut near = |point: &Vec3| {
        let surface = surface.get_or_insert_with(|| Bvh::new(&mesh.vertices, &mesh.triangles));
        let closest = surface.closest(point);
        closest.is_some_and(|closest| closest.squared_distance < REACH_MM * REACH_MM)
    };
    let step = |axis: usize| volume.frame.linear().column(axis).into_owned();
    let mut area_mm2 = 0.0;
    for (index, value) in part.values.iter().enumerate() {
        for (axis, neighbour, way) in part.neighbours(index) {
            let beyond = part.values[neighbour];
            let beyond = if beyond.is_nan() { 0.0 } else { beyond };
            let ramp = Ramp {
                beyond: f64::from(beyond),
                first: f64::from(*value),
                inward: part.inward(index, axis, way),
            };
            // The comparison, which hardly any voxel passes, before the search for regions.
            if !ramp.is_step(least_step) {
                continue;
            }
            let empty = empty.get_or_insert_with(|| part.empty((EQUAL_SHARE * uptake) as f32));
            if !empty[neighbour] || empty[index] {
                continue;
            }
            let mut face = part.place(index);
            face[axis] += way / 2.0;
            if near(&volume.frame.to_patient(&face)) {
                area_mm2 += step((axis + 1) % 3).cross(&step((axis + 2) % 3)).norm();
            }
        }
    }
    area_mm2 / 100.0
}

/// The mean over the brightest quarter of the rays of the value in the middle of the wall.
pub(super) fn bright_uptake(wall: &VentricleWall, volume: &Volume) -> f64 {
    let in_the_middle = wall.rays.iter().filter_map(|ray| {
        let [enters, leaves] = ray.wall?;
        let point = ray.start + ray.direction * f64::midpoint(enters, leaves);
        let index = volume.frame.to_voxel(&point).map(f64::round);
        let inside = (0..3).all(|a| (0.0..volume.shape[a] as f64).contains(&index[a]));
        let [i, j, k] = [0, 1, 2].map(|a| index[a] as usize);
        let value = inside.then(|| volume.voxels[i + volume.shape[0] * (j + volume.shape[1] * k)]);
        value.filter(|value| value.is_finite()).map(f64::from)
    });
    mean_of_brightest_quarter(in_the_middle.collect())
}

/// The mean of the brightest quarter of these values; 0 without any.
pub(super) fn mean_of_brightest_quarter(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let brightest = &values[values.len() * 3 / 4..];
    brightest.iter().sum::<f64>() / brightest.len().max(1) as f64
}

/// The part of a volume about a wall, with a layer of voxels beyond it; NaN beyond the volume.
struct Part {
    first: [i64; 3],
    shape: [usize; 3],
    values: Vec<f32>,
}

impl Part {
    fn about(mesh: &TriMesh, volume: &Volume) -> Self {
        let nodes: Vec<Vec3> = (mesh.vertices.iter())
            .map(|node| volume.frame.to_voxel(node))
            .collect();
        let bounds = Aabb::around(&nodes);
        let spacing = volume.frame.spacing();
        let reach = [0, 1, 2].map(|a| REACH_MM / spacing[a] + 1.0);
        let first = [0, 1, 2].map(|a| ((bounds.min[a] - reach[a]).floor() as i64).max(-1));
        let end = [0, 1, 2].map(|a| {
            let last = (bounds.max[a] + reach[a]).ceil() as i64;
            (last.min(volume.shape[a] as i64) + 1).max(first[a])
        });
        let shape = [0, 1, 2].map(|a| (end[a] - first[a]) as usize);
        let mut values = Vec::with_capacity(shape.iter().product());
        for k in first[2]..end[2] {
            for j in first[1]..end[1] {
                for i in first[0]..end[0] {
                    let inside = [i, j, k].iter().zip(volume.shape).all(|(index, count)| {
                        usize::try_from(*index).is_ok_and(|index| index < count)
                    });
                    values.push(if inside {
                        let [i, j, k] = [i, j, k].map(|index| index as usize);
                        volume.voxels[i + volume.shape[0] * (j + volume.shape[1] * k)]
                    } else {
                        f32::NAN
                    });
                }
            }
        }
        Self {
            first,
            shape,
            values,
        }
    }

    /// The index of a voxel of the part in the volume.
    fn place(&self, index: usize) -> Vec3 {
        let [nx, ny, _] = self.shape;
        let own = [index % nx, index / nx % ny, index / (nx * ny)];
        Vec3::from_fn(|a, _| (self.first[a] + own[a] as i64) as f64)
    }

    /// The voxels that share a face with a voxel: axis, index, and the way along the axis, -1 or 1.
    fn neighbours(&self, index: usize) -> impl Iterator<Item = (usize, usize, f64)> {
        let [nx, ny, _] = self.shape;
        let own = [index % nx, index / nx % ny, index / (nx * ny)];
        let strides = [1, nx, nx * ny];
        let shape = self.shape;
        (0..3).flat_map(move |axis| {
            let before = (own[axis] > 0).then(|| (axis, index - strides[axis], -1.0));
            let after = (own[axis] + 1 < shape[axis]).then(|| (axis, index + strides[axis], 1.0));
            before.into_iter().chain(after)
        })
    }

    /// The second and the third voxel inward of the voxel `index`, the first one, against the `way` along `axis`;
    /// `None` beyond the part or without values.
    fn inward(&self, index: usize, axis: usize, way: f64) -> Option<[f64; 2]> {
        let [nx, ny, _] = self.shape;
        let own = [index % nx, index / nx % ny, index / (nx * ny)][axis];
        let stride = [1, nx, nx * ny][axis];
        let value = |steps: usize| {
            let at = if way > 0.0 {
                (own >= steps).then(|| index - steps * stride)
            } else {
                (own + steps < self.shape[axis]).then(|| index + steps * stride)
            };
            at.map(|at| f64::from(self.values[at]))
                .filter(|value| value.is_finite())
        };
        Some([value(1)?, value(2)?])
    }

    /// Whether each voxel holds nothing: no value, or that of a connected region of values that differ by `same` at
    /// most.
    fn empty(&self, same: f32) -> Vec<bool> {
        let mut empty: Vec<bool> = self.values.iter().map(|value| value.is_nan()).collect();
        let mut seen = empty.clone();
        let mut region = Vec::new();
        // Infinities are equal, though their difference is none.
        let equal = |a: f32, b: f32| a == b || (a - b).abs() <= same;
        for start in 0..self.values.len() {
            if seen[start] {
                continue;
            }
            seen[start] = true;
            region.clear();
            region.push(start);
            let mut next = 0;
            while next < region.len() {
                let index = region[next];
                next += 1;
                for (_, neighbour, _) in self.neighbours(index) {
                    if !seen[neighbour] && equal(self.values[neighbour], self.values[start]) {
                        seen[neighbour] = true;
                        region.push(neighbour);
                    }
                }
            }
            if region.len() >= LEAST_EQUAL_VOXELS {
                for index in &region {
                    empty[*index] = true;
                }
            }
        }
        empty
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::base::progress::Monitor;
    use crate::image::grid::field::Field;
    use crate::image::locate::cup::Cup;
    use crate::mesh::shapes;
    use nalgebra::Rotation3;

    const SPACING_MM: f64 = 4.0;
    const LENGTH_MM: f64 = 80.0;

    /// A half ellipsoid of wall, apex at -z, its blurred image, and its rays.
    fn heart() -> (TriMesh, VentricleWall, Volume) {
        let mesh = shapes::cup(LENGTH_MM, 31.0, 12.0, 32);
        let cup = Cup {
            centre: Vec3::new(0.0, 0.0, -0.5 * LENGTH_MM),
            axis: -Vec3::z(),
            length: LENGTH_MM,
            breadth: 1.0,
        };
        let wall = VentricleWall::new(&mesh, &cup, &Vec3::y(), &Monitor::silent()).unwrap();
        let shape = [32, 32, 40];
        let centre = Vec3::new(0.0, 0.0, -0.5 * LENGTH_MM);
        let frame = VoxelToPatient::centred(shape, [SPACING_MM; 3], centre).unwrap();
        let surface = Bvh::new(&mesh.vertices, &mesh.triangles);
        let value = |p: &Vec3| {
            let off = surface.closest(p).unwrap().point - p;
            100.0 * (-off.norm_squared() / (2.0 * 8.0_f64.powi(2))).exp()
        };
        let volume = Volume::sampled(shape, frame, value);
        (mesh, wall, volume)
    }

    /// `volume`, with `value` where `cut` says so by the position.
    fn cut(volume: &Volume, value: f32, cut: impl Fn(&Vec3) -> bool) -> Volume {
        let mut made = volume.clone();
        let [nx, ny, _] = made.shape;
        for (index, voxel) in made.voxels.iter_mut().enumerate() {
            let place = [index % nx, index / nx % ny, index / (nx * ny)].map(|n| n as f64);
            if cut(&volume.frame.to_patient(&Vec3::from(place))) {
                *voxel = value;
            }
        }
        made
    }

    #[test]
    fn a_whole_heart_is_not_cut() {
        let (mesh, wall, volume) = heart();
        assert_eq!(cut_area_cm2(&mesh, &wall, &volume), 0.0);
        // Zeros far from the wall, as beyond a camera's field, and clipped values.
        let round = cut(&volume, 0.0, |p| p.x.hypot(p.y) > 58.0);
        assert_eq!(cut_area_cm2(&mesh, &wall, &round), 0.0);
        let mut clipped = volume.clone();
        clipped.voxels.iter_mut().for_each(|v| *v = v.min(80.0));
        assert_eq!(cut_area_cm2(&mesh, &wall, &clipped), 0.0);
    }

    /// `volume` with slices turned obliquely, interpolated.
    fn resliced(volume: &Volume, degrees: [f64; 2]) -> Volume {
        let [about_x, about_y] = degrees.map(f64::to_radians);
        let turn = Rotation3::from_axis_angle(&Vec3::x_axis(), about_x)
            * Rotation3::from_axis_angle(&Vec3::y_axis(), about_y);
        let shape = [40; 3];
        let linear = turn.matrix() * SPACING_MM;
        let centre = Vec3::new(0.0, 0.0, -0.5 * LENGTH_MM);
        let origin = centre - linear * Vec3::repeat(19.5);
        let frame = VoxelToPatient::new(linear, origin).unwrap();
        let field = Field::new(volume, None, 0.0);
        Volume::sampled(shape, frame, |p| field.at(p))
    }

    /// Slices that are turned after the cut blur its edge over one or two voxels, and round a constant.
    #[test]
    fn a_cut_keeps_its_area_where_the_image_was_resliced_afterwards() {
        let (mesh, wall, volume) = heart();
        let plane_z = -0.75 * LENGTH_MM;
        for degrees in [[20.0, 0.0], [35.0, 25.0], [30.0, 30.0], [40.0, 35.0]] {
            let whole = resliced(&volume, degrees);
            assert_eq!(cut_area_cm2(&mesh, &wall, &whole), 0.0, "{degrees:?}");
            for value in [0.0, 17.0] {
                let cut = cut(&volume, value, |p| p.z < plane_z);
                let before = cut_area_cm2(&mesh, &wall, &cut);
                let after = cut_area_cm2(&mesh, &wall, &resliced(&cut, degrees));
                assert!(
                    after > 0.7 * before,
                    "{degrees:?} {value}: {after} {before}"
                );
            }
        }
    }

    /// Zeros, another constant, missing values and the end of the array cut alike; the area is about that of the bright
    /// image in the plane of the cut.
    #[test]
    fn a_cut_through_the_wall_has_its_area() {
        let (mesh, wall, volume) = heart();
        let plane_z = -0.75 * LENGTH_MM;
        let areas: Vec<f64> = [0.0, -50.0, f32::NAN]
            .map(|value| cut(&volume, value, |p| p.z < plane_z))
            .iter()
            .map(|cut| cut_area_cm2(&mesh, &wall, cut))
            .collect();
        let mut shorter = volume.clone();
        let kept = (0..volume.shape[2])
            .filter(|k| volume.frame.to_patient(&Vec3::new(0.0, 0.0, *k as f64)).z >= plane_z)
            .count();
        let slice = volume.shape[0] * volume.shape[1];
        let left_out = volume.shape[2] - kept;
        shorter.shape[2] = kept;
        shorter.voxels = volume.voxels[left_out * slice..].to_vec();
        let shift = volume.frame.linear().column(2) * left_out as f64;
        let origin = volume.frame.to_patient(&Vec3::zeros()) + shift;
        shorter.frame = VoxelToPatient::new(*volume.frame.linear(), origin).unwrap();
        let of_array = cut_area_cm2(&mesh, &wall, &shorter);
        assert!((10.0..60.0).contains(&areas[0]), "{areas:?}");
        assert!(areas[1] >= areas[0], "{areas:?}");
        assert_eq!(areas[2], areas[0]);
        assert_eq!(of_array, areas[0]);
    }
}
