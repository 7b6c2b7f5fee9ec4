//! Where the signal of a ventricle's wall ends beyond its rim.
//!
//! In: a fitted wall, the heights of its rim and the image. Out: for each direction about the axis, how far basal of
//! the rim the image falls to half of the wall's own signal ([`SignalEnds`]).
//!
//! The signal of a direction at a height is the greatest value across the wall, from [`BORDER_MM`] inside of its inner
//! surface to as far outside of its outer one, both as they are in the basal part of the wall. Two ends are measured,
//! because each fails elsewhere: half of the whole heart's signal tells a septum that has run out from one that is
//! seen, half way from the direction's own signal to what lies basal of it is not deceived by a direction that is faint
//! as a whole or lies before a bright neighbour.

use super::rim_frame::{RIM_DIRECTIONS, RimFrame};
use crate::base::numeric::order;
use crate::heart::model::wall::{RAY_COLUMNS, VentricleWall};
use crate::image::grid::field::Field;

/// Distances of the profile from the rim, mm towards the base: 1 mm apart.
const PROFILE_MM: [i32; 2] = [-22, 25];
/// Where the wall's signal is measured.
const WALL_MM: [i32; 2] = [-22, -6];
/// Where what lies basal of the wall is measured.
const BEYOND_MM: [i32; 2] = [8, 25];
/// Range of the ends.
const END_RANGE_MM: [i32; 2] = [-14, 20];
/// Part of the wall, mm apical of the rim, whose surfaces the profile follows.
const BASAL_WALL_MM: [f64; 2] = [4.0, 22.0];
/// Width beside the wall, mm.
const BORDER_MM: f64 = 2.0;
/// Samples across the wall.
const SAMPLES_ACROSS: usize = 13;
/// The whole heart's signal is this quantile of its directions' signals.
const SIGNAL_QUANTILE: f64 = 0.75;
/// Rays that are steeper than this against the axis (cosine) belong to the apex.
const STEEPEST_RAY: f64 = 0.3;

const COLUMNS_PER_DIRECTION: usize = RAY_COLUMNS / RIM_DIRECTIONS;
const _: () = assert!(COLUMNS_PER_DIRECTION * RIM_DIRECTIONS == RAY_COLUMNS);

/// Ends of the wall's signal in every direction, mm basal of the rim.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalEnds {
    /// At half of the whole heart's signal.
    pub of_heart: [f64; RIM_DIRECTIONS],
    /// Half way from the direction's own signal to the least value basal of the rim.
    pub of_direction: [f64; RIM_DIRECTIONS],
}

impl SignalEnds {
    /// The ends in the image `field` of a `wall` whose rim has these heights in `frame`. `None` where the wall has no
    /// signal, or a direction no ray that meets it.
    pub(super) fn new(
        frame: &RimFrame,
        rim: &[f64],
        wall: &VentricleWall,
        field: &Field,
    ) -> Option<Self> {
        let profiles = (0..RIM_DIRECTIONS)
            .map(|direction| {
                let surfaces = basal_surfaces(frame, direction, rim[direction], wall)?;
                Some(profile(frame, direction, rim[direction], surfaces, field))
            })
            .collect::<Option<Vec<_>>>()?;
        let signals: Vec<f64> = profiles
            .iter()
            .map(|p| part(p, WALL_MM).fold(f64::MIN, f64::max))
            .collect();
        let mut sorted = signals.clone();
        sorted.sort_by(f64::total_cmp);
        let heart = order::quantile(&sorted, SIGNAL_QUANTILE);
        if !(heart > 0.0 && heart.is_finite()) {
            return None;
        }
        let of_direction = |direction: usize| {
            let profile = &profiles[direction];
            let beyond = part(profile, BEYOND_MM).fold(f64::MAX, f64::min);
            end(profile, f64::midpoint(beyond, signals[direction]))
        };
        Some(Self {
            of_heart: std::array::from_fn(|direction| end(&profiles[direction], 0.5 * heart)),
            of_direction: std::array::from_fn(of_direction),
        })
    }
}

/// Distances of the inner and the outer surface from the axis in a direction, mm: medians over the basal part of the
/// wall, or over all of it where that has none.
fn basal_surfaces(
    frame: &RimFrame,
    direction: usize,
    rim: f64,
    wall: &VentricleWall,
) -> Option<[f64; 2]> {
    let first = direction * COLUMNS_PER_DIRECTION;
    let met: Vec<(f64, [f64; 2])> = wall
        .rays
        .chunks_exact(RAY_COLUMNS)
        .flat_map(|row| &row[first..first + COLUMNS_PER_DIRECTION])
        .filter_map(|ray| {
            let surfaces = ray.wall?;
            let steepness = ray.direction.dot(&frame.axis);
            let middle = f64::midpoint(surfaces[0], surfaces[1]);
            let height = frame.along(&ray.start) + steepness * middle - rim;
            (steepness.abs() <= STEEPEST_RAY).then_some((height, surfaces))
        })
        .collect();
    let [least, greatest] = BASAL_WALL_MM;
    let basal = |height: f64| height > least && height < greatest;
    let any_basal = met.iter().filter(|(height, _)| basal(*height)).count() >= 2;
    let median = |surface: usize| {
        let mut of: Vec<f64> = met
            .iter()
            .filter(|(height, _)| !any_basal || basal(*height))
            .map(|(_, surfaces)| surfaces[surface])
            .collect();
        of.sort_by(f64::total_cmp);
        (!of.is_empty()).then(|| order::quantile(&of, 0.5))
    };
    Some([median(0)?, median(1)?])
}

/// The greatest value across the wall at every distance of [`PROFILE_MM`].
fn profile(
    frame: &RimFrame,
    direction: usize,
    rim: f64,
    [inner, outer]: [f64; 2],
    field: &Field,
) -> Vec<f64> {
    let outward = frame.outward(direction);
    let width = outer - inner + 2.0 * BORDER_MM;
    let step = width / (SAMPLES_ACROSS - 1) as f64;
    (PROFILE_MM[0]..=PROFILE_MM[1])
        .map(|basal| {
            let on_axis = frame.centre + frame.axis * (rim - f64::from(basal));
            (0..SAMPLES_ACROSS)
                .map(|n| field.at(&(on_axis + outward * (inner - BORDER_MM + step * n as f64))))
                .fold(f64::MIN, f64::max)
        })
        .collect()
}

/// The values of a profile from one distance to another, both included.
fn part(profile: &[f64], [from, to]: [i32; 2]) -> impl Iterator<Item = f64> + '_ {
    let index = |distance: i32| (distance - PROFILE_MM[0]) as usize;
    profile[index(from)..=index(to)].iter().copied()
}

/// The distance at which a profile first falls below `level`, from the least of [`END_RANGE_MM`] on; the greatest
/// where it does not.
fn end(profile: &[f64], level: f64) -> f64 {
    let [least, greatest] = END_RANGE_MM.map(f64::from);
    let mut last: Option<f64> = None;
    for (n, value) in part(profile, END_RANGE_MM).enumerate() {
        if value < level {
            let back = last.map_or(0.0, |last| (level - value) / (last - value));
            return least + n as f64 - back;
        }
        last = Some(value);
    }
    greatest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::base::progress::Monitor;
    use crate::heart::deform::rim_frame::rim_angle;
    use crate::heart::model::wall::{HalfPlane, rim_height};
    use crate::image::grid::Volume;
    use crate::image::locate::cup::Cup;
    use crate::mesh::shapes;

    /// The ends of a wall whose signal in each direction is `signal(angle)` and falls linearly over 16 mm to `beyond`,
    /// half way at `end(angle)` mm basal of a flat rim.
    fn ends(
        signal: impl Fn(f64) -> f64,
        end: impl Fn(f64) -> f64,
        beyond: f64,
    ) -> Option<SignalEnds> {
        let cup = Cup {
            centre: Vec3::zeros(),
            axis: -Vec3::z(),
            length: 70.0,
            breadth: 1.0,
        };
        let mesh = shapes::cup(70.0, 31.0, 12.0, 48);
        let frame = RimFrame::new(&cup, &Vec3::y());
        let rim: Vec<f64> = (0..RIM_DIRECTIONS)
            .map(|direction| {
                let outward = frame.outward(direction);
                let plane = HalfPlane {
                    axis: cup.axis,
                    outward,
                    aside: cup.axis.cross(&outward),
                };
                rim_height(&mesh, &cup.centre, &plane).unwrap()
            })
            .collect();
        let wall = VentricleWall::new(&mesh, &cup, &Vec3::y(), &Monitor::silent()).unwrap();
        let (lateral, anterior) = (frame.outward(0), frame.outward(RIM_DIRECTIONS / 4));
        let first = rim_angle(0);
        let at = |p: &Vec3| {
            // Two directions across the axis, a quarter turn less half a step apart.
            let apart = rim_angle(RIM_DIRECTIONS / 4) - first;
            let x = p.dot(&lateral);
            let y = (p.dot(&anterior) - x * apart.cos()) / apart.sin();
            let angle = y.atan2(x) + first;
            let past = rim[0] - frame.along(p) - end(angle);
            let share = (0.5 - past / 16.0).clamp(0.0, 1.0);
            beyond + (signal(angle) - beyond) * share
        };
        let centre = cup.axis * rim[0];
        let grid = VoxelToPatient::centred([48, 48, 48], [2.5; 3], centre).unwrap();
        let field = Field::new(&Volume::sampled([48; 3], grid, at), None, 0.0);
        SignalEnds::new(&frame, &rim, &wall, &field)
    }

    #[test]
    fn the_ends_of_a_bright_wall_are_where_its_signal_is_half() {
        for shift in [-3.0, 0.0, 4.5] {
            let end = |angle: f64| shift + 2.0 * angle.cos();
            let found = ends(|_| 5.0, end, 0.0).unwrap();
            for direction in 0..RIM_DIRECTIONS {
                let wanted = end(rim_angle(direction));
                for end in [found.of_heart[direction], found.of_direction[direction]] {
                    assert!((end - wanted).abs() < 0.7, "{direction}: {end} {wanted}");
                }
            }
        }
    }

    /// Above a background the direction's own end stays; that at half of the heart's signal lies farther basal.
    #[test]
    fn a_background_does_not_move_the_directions_own_end() {
        let found = ends(|_| 5.0, |_| 1.0, 1.5).unwrap();
        for direction in 0..RIM_DIRECTIONS {
            assert!((found.of_direction[direction] - 1.0).abs() < 0.5);
            assert!(found.of_heart[direction] > 2.5);
        }
    }

    /// A third of the wall has 0.7 of the uptake: half of the heart's signal lies farther apical there, its own end
    /// where it is.
    #[test]
    fn a_faint_direction_has_its_own_end() {
        let faint = |angle: f64| angle.cos() > 0.5;
        let signal = |angle: f64| if faint(angle) { 3.5 } else { 5.0 };
        let found = ends(signal, |_| 2.0, 0.0).unwrap();
        for direction in 0..RIM_DIRECTIONS {
            let angle = rim_angle(direction);
            if (angle.cos() - 0.5).abs() < 0.3 {
                continue;
            }
            assert!((found.of_direction[direction] - 2.0).abs() < 0.7);
            let wanted = if faint(angle) {
                2.0 - 16.0 * (2.5 / 3.5 - 0.5)
            } else {
                2.0
            };
            let end = found.of_heart[direction];
            assert!((end - wanted).abs() < 0.8, "{direction}: {end} {wanted}");
        }
    }

    #[test]
    fn a_wall_without_signal_has_no_ends() {
        assert_eq!(ends(|_| 0.0, |_| 0.0, 0.0), None);
    }

    #[test]
    fn ends_stay_in_their_range() {
        let profile = |value: f64| vec![value; (PROFILE_MM[1] - PROFILE_MM[0] + 1) as usize];
        assert_eq!(end(&profile(1.0), 2.0), f64::from(END_RANGE_MM[0]));
        assert_eq!(end(&profile(1.0), 0.5), f64::from(END_RANGE_MM[1]));
        // Falls by 1 for each mm from 0 at the rim.
        let falling: Vec<f64> = (PROFILE_MM[0]..=PROFILE_MM[1])
            .map(|d| -f64::from(d))
            .collect();
        for level in [-7.3, 0.0, 4.5] {
            assert!((end(&falling, level) + level).abs() < 1e-12, "{level}");
        }
    }
}
