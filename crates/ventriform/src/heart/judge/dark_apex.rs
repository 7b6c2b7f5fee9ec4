//! Whether the apex of a fitted wall is dark, all round or in part: the model may end short of it, or has its shape
//! there from the wall about it.
//!
//! In: the fitted wall and its rays, the volume. Out: the uptake of the apical third against the wall's brightest
//! quarter, where every sector of it is dark, or one is darker. [`crate::image::locate`] looks for an apex without uptake
//! before the fit; a wall that closes at the border of an infarct, on the blur of the muscle that is left, shows its
//! own apex half bright.

use std::ops::Range;

use super::field_of_view::mean_of_brightest_quarter;
use super::flags::DarkPart;
use crate::base::geometry::bvh::Aabb;
use crate::heart::model::wall::{RAY_COLUMNS, RAY_ROWS, VentricleWall};
use crate::image::grid::Volume;
use crate::image::grid::field::Field;
use crate::mesh::TriMesh;

/// Rows of the apical third (segments 13 to 17).
const APICAL_ROWS: Range<usize> = 0..RAY_ROWS / 3;
/// Columns of a sector: a sixth of a turn about the axis.
const SECTOR_COLUMNS: usize = RAY_COLUMNS / 6;
/// Share of the brightest wall that no sector of an apex exceeds that is dark all round. Apices that are thin, not
/// infarcted, keep three quarters and more in most sectors.
const DARK_SECTOR_SHARE: f64 = 0.7;
/// Share of the brightest wall below which a sector is dark by itself, at whatever angle it begins. Of simulated
/// hearts, those with one apical segment or two without uptake have a sector of 0.56 and less (12; simulator's seed
/// 11031 and kind "apex" of seed 5001), healthy ones none below 0.73 (6).
const DARK_PART_SHARE: f64 = 0.6;
/// Step along a ray, mm.
const STEP_MM: f64 = 1.0;

/// An apical third that is dark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DarkApex {
    /// Uptake of what is dark, a share of that of the wall's brightest quarter.
    pub uptake: f64,
    /// What is dark.
    pub part: DarkPart,
}

/// The apical third, where it is dark all round or in part.
pub(super) fn dark_apex(mesh: &TriMesh, wall: &VentricleWall, volume: &Volume) -> Option<DarkApex> {
    let field = Field::new(volume, Some(&Aabb::around(&mesh.vertices)), 0.0);
    let largest = |ray: usize| {
        let ray = &wall.rays[ray];
        let [enters, leaves] = ray.wall?;
        let steps = ((leaves - enters) / STEP_MM).ceil().max(1.0) as usize;
        let along = (0..=steps).map(|n| enters + (leaves - enters) * n as f64 / steps as f64);
        Some(
            along
                .map(|distance| field.at(&(ray.start + ray.direction * distance)))
                .fold(f64::MIN, f64::max),
        )
    };
    let uptake: Vec<Option<f64>> = (0..RAY_ROWS * RAY_COLUMNS).map(largest).collect();
    let brightest = mean_of_brightest_quarter(uptake.iter().flatten().copied().collect());
    if brightest.is_nan() || brightest <= 0.0 {
        return None;
    }
    // The mean over some columns from `first` on, past the last one again from the first.
    let share = |first: usize, columns: usize| {
        let places = APICAL_ROWS.flat_map(|row| {
            (first..first + columns).map(move |column| row * RAY_COLUMNS + column % RAY_COLUMNS)
        });
        Some(mean(places.filter_map(|place| uptake[place]))? / brightest)
    };
    let sectors: Vec<f64> = (0..RAY_COLUMNS)
        .step_by(SECTOR_COLUMNS)
        .map(|first| share(first, SECTOR_COLUMNS))
        .collect::<Option<_>>()?;
    if sectors.iter().all(|share| *share < DARK_SECTOR_SHARE) {
        return Some(DarkApex {
            uptake: mean(sectors.into_iter())?,
            part: DarkPart::AllRound,
        });
    }
    let is_dark = |share: &f64| *share < DARK_PART_SHARE;
    let sector_is_dark =
        |first: usize| share(first, SECTOR_COLUMNS).is_some_and(|share| is_dark(&share));
    if !(0..RAY_COLUMNS).any(sector_is_dark) {
        return None;
    }
    let dark: Vec<f64> = (0..RAY_COLUMNS)
        .filter_map(|column| share(column, 1))
        .filter(is_dark)
        .collect();
    Some(DarkApex {
        part: DarkPart::Sector {
            degrees: 360.0 * dark.len() as f64 / RAY_COLUMNS as f64,
        },
        uptake: mean(dark.into_iter())?,
    })
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    (count > 0 && sum > 0.0).then(|| sum / f64::from(count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::base::geometry::bvh::Bvh;
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::base::progress::Monitor;
    use crate::image::locate::cup::Cup;
    use crate::mesh::shapes;

    const LENGTH_MM: f64 = 80.0;

    /// What is dark of the apex of a half ellipsoid, apex at -z, whose wall has the uptake `of` a place.
    fn apex(of: impl Fn(&Vec3) -> f64 + Sync) -> Option<DarkApex> {
        let mesh = shapes::cup(LENGTH_MM, 31.0, 12.0, 32);
        let centre = Vec3::new(0.0, 0.0, -0.5 * LENGTH_MM);
        let cup = Cup {
            centre,
            axis: -Vec3::z(),
            length: LENGTH_MM,
            breadth: 1.0,
        };
        let wall = VentricleWall::new(&mesh, &cup, &Vec3::y(), &Monitor::silent()).unwrap();
        let frame = VoxelToPatient::centred([32, 32, 40], [4.0; 3], centre).unwrap();
        let surface = Bvh::new(&mesh.vertices, &mesh.triangles);
        let value = |p: &Vec3| {
            let off = surface.closest(p).unwrap().squared_distance;
            of(p) * (-off / (2.0 * 8.0_f64.powi(2))).exp()
        };
        let volume = Volume::sampled([32, 32, 40], frame, value);
        dark_apex(&mesh, &wall, &volume)
    }

    #[test]
    fn an_apex_is_dark_all_round_or_in_part() {
        let apical = |p: &Vec3| p.z < -0.55 * LENGTH_MM;
        assert_eq!(apex(|_| 100.0), None);
        assert_eq!(apex(|p| if apical(p) { 85.0 } else { 100.0 }), None);
        // A half that is paler by a sixth is no dark part.
        let paler = |p: &Vec3| if apical(p) && p.x < 0.0 { 85.0 } else { 100.0 };
        assert_eq!(apex(paler), None);
        let dark = apex(|p| if apical(p) { 40.0 } else { 100.0 }).unwrap();
        assert_eq!(dark.part, DarkPart::AllRound);
        assert!((0.3..0.65).contains(&dark.uptake), "{dark:?}");
    }

    /// Half of the apex, or a third, wherever it lies: the flag names about that angle.
    #[test]
    fn a_dark_part_of_the_apex_is_seen_at_every_angle() {
        for half_angle in [60.0_f64, 90.0] {
            for middle in [0.0_f64, 45.0, 100.0, 190.0, 275.0, 330.0] {
                let (sin, cos) = middle.to_radians().sin_cos();
                let dark = |p: &Vec3| {
                    let across = p.x.hypot(p.y);
                    let within = p.x * cos + p.y * sin >= across * half_angle.to_radians().cos();
                    if p.z < -0.5 * LENGTH_MM && within {
                        15.0
                    } else {
                        100.0
                    }
                };
                let found = apex(dark).unwrap();
                let DarkPart::Sector { degrees } = found.part else {
                    panic!("{middle}: {found:?}")
                };
                assert!(
                    (60.0..=2.0 * half_angle + 30.0).contains(&degrees),
                    "{half_angle} {middle}: {found:?}"
                );
                assert!((0.1..0.5).contains(&found.uptake), "{middle}: {found:?}");
            }
        }
    }
}
