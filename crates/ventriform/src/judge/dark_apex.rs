//! Whether the apex of a fitted wall is dark all round, so that the model may end short of it.
//!
//! In: the fitted wall and its rays, the volume. Out: the uptake of the apical third against the wall's brightest quarter,
//! where every sector of it is dark. [`crate::locate`] looks for an apex without uptake before the fit; a wall that closes
//! at the border of an infarct, on the blur of the muscle that is left, shows its own apex half bright.

use std::ops::Range;

use super::field_of_view::mean_of_brightest_quarter;
use crate::geometry::bvh::Aabb;
use crate::grid::Volume;
use crate::grid::field::Field;
use crate::mesh::TriMesh;
use crate::model::wall::{RAY_COLUMNS, RAY_ROWS, VentricleWall};

/// Rows of the apical third (segments 13 to 17).
const APICAL_ROWS: Range<usize> = 0..RAY_ROWS / 3;
/// Sectors about the axis.
const SECTOR_COUNT: usize = 6;
/// Share of the brightest wall that no sector of a dark apex exceeds. Apices that are thin, not infarcted, keep three
/// quarters and more in most sectors.
const DARK_SECTOR_SHARE: f64 = 0.7;
/// Step along a ray, mm.
const STEP_MM: f64 = 1.0;

/// The uptake of the apical third, a share of that of the wall's brightest quarter, if all sectors of it are dark.
pub(super) fn dark_apex_uptake(
    mesh: &TriMesh,
    wall: &VentricleWall,
    volume: &Volume,
) -> Option<f64> {
    let field = Field::new(volume, Some(&Aabb::of(&mesh.vertices)), 0.0);
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
    let width = RAY_COLUMNS / SECTOR_COUNT;
    let sectors = (0..SECTOR_COUNT).map(|sector| {
        let places = APICAL_ROWS.flat_map(|row| {
            (0..width).map(move |column| row * RAY_COLUMNS + sector * width + column)
        });
        mean(places.filter_map(|place| uptake[place]))
    });
    let shares: Vec<f64> = sectors
        .map(|uptake| Some(uptake? / brightest))
        .collect::<Option<_>>()?;
    let dark = shares.iter().all(|share| *share < DARK_SECTOR_SHARE);
    if dark { mean(shares.into_iter()) } else { None }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    (count > 0 && sum > 0.0).then(|| sum / f64::from(count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec3;
    use crate::geometry::bvh::Bvh;
    use crate::geometry::frame::VoxelToPatient;
    use crate::locate::cup::Cup;
    use crate::mesh::shapes;
    use crate::progress::Monitor;

    const LENGTH_MM: f64 = 80.0;

    /// The uptake of the apex of a half ellipsoid, apex at -z, whose wall has the uptake `of` a place.
    fn apex(of: impl Fn(&Vec3) -> f64 + Sync) -> Option<f64> {
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
        dark_apex_uptake(&mesh, &wall, &volume)
    }

    #[test]
    fn only_an_apex_that_is_dark_all_round_is_dark() {
        let apical = |p: &Vec3| p.z < -0.55 * LENGTH_MM;
        assert_eq!(apex(|_| 100.0), None);
        assert_eq!(apex(|p| if apical(p) { 85.0 } else { 100.0 }), None);
        let one_side = |p: &Vec3| if apical(p) && p.x < 0.0 { 20.0 } else { 100.0 };
        assert_eq!(apex(one_side), None);
        let dark = apex(|p| if apical(p) { 40.0 } else { 100.0 }).unwrap();
        assert!((0.3..0.65).contains(&dark), "{dark}");
    }
}
