//! Sensors of the wall's edge, which sample the image along the model's normals.
//!
//! In go the model, the blurred image and [`SensorSettings`]; out comes a [`SensorReading`] for
//! every sensor ([`read`]).
//!
//! 1. Every triangle carries [`PER_TRIANGLE`] sensors at the centroids of its congruent parts.
//!    All sensors of a triangle stand for the same area, so sums over sensors do not depend on
//!    the number of nodes.
//! 2. A sensor samples the image along the normal, `reach` millimetres to both sides, and
//!    maximises a direction-weighted gradient: score(t) = max(0, -df/dn) · exp(-t²/2(reach/2)²).
//! 3. The maximum decides *which* edge is meant, and its value relative to the other sensors'
//!    is the weight. *Which point* of the edge is the target depends on [`SensorKind`].
//! 4. Sensors whose half width (ridge to edge) differs from the median get less weight.
//!
//! A perfusion defect has no edge: its sensors have hardly any weight, and the model's stiffness
//! continues the wall. An organ that touches the heart has edges of its own farther out, which
//! the Gaussian attenuates. Where it blurs into the wall (the right ventricle's insertion, the
//! liver) the wall looks thicker than elsewhere, which step 4 recognises.

mod profile;
mod settings;

pub use settings::{BlindSector, EdgeShift, SensorKind, SensorSettings};

use crate::base::geometry::Vec3;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::field::Field;
use crate::mesh::TriMesh;
use profile::{Profile, ProfileEdge};
pub(super) use settings::WallSide;

/// Sensors on each triangle: the centroids of its nine congruent parts.
pub const PER_TRIANGLE: usize = 9;

/// Factor of the reach of sensors on the rim: the basal extent of the wall differs more between
/// patients than its radius does.
const RIM_REACH: f64 = 1.75;

/// Reading of one sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorReading {
    /// Place of the sensor, mm.
    pub place: Vec3,
    /// Outward unit normal there.
    pub normal: Vec3,
    /// Distance to the edge along the normal, mm; outward positive.
    pub offset: f64,
    /// 0..=1; 0 where there is no edge.
    pub weight: f64,
    /// Share of the model's area; the shares sum to 1.
    pub share: f64,
}

/// Barycentric coordinates of the sensors.
pub fn barycentric() -> [[f64; 3]; PER_TRIANGLE] {
    let mut out = [[0.0; 3]; PER_TRIANGLE];
    let mut next = 0;
    // The small triangles of a threefold subdivision: six upright ones, three inverted ones.
    for a in 0..3 {
        for b in 0..(3 - a) {
            out[next] = centroid(a, b, 1);
            next += 1;
        }
    }
    for a in 0..2 {
        for b in 0..(2 - a) {
            out[next] = centroid(a, b, 2);
            next += 1;
        }
    }
    out
}

fn centroid(a: usize, b: usize, shift: usize) -> [f64; 3] {
    let u = (a as f64 + shift as f64 / 3.0) / 3.0;
    let v = (b as f64 + shift as f64 / 3.0) / 3.0;
    [1.0 - u - v, u, v]
}

/// Which of its sensors each triangle has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Density {
    /// All of them.
    #[default]
    Full,
    /// A third, whose mean place is the triangle's centre: enough for a model that is far off.
    Third,
}

impl Density {
    /// The barycentric coordinates, of those of `all` sensors ([`barycentric`]), of the ones that are read.
    pub fn sensors(self, all: &[[f64; 3]; PER_TRIANGLE]) -> &[[f64; 3]] {
        match self {
            Self::Full => all,
            Self::Third => &all[2 * PER_TRIANGLE / 3..],
        }
    }
}

/// Exponent from a sensor's score, relative to that of strong sensors, to its weight: the scatter
/// of edges grows faster than their slope falls. 1.5 instead of 1 raises the Jaccard index of
/// hearts without apical uptake by 0.04 and does not change the simulated cohort's mean.
const WEIGHT_EXPONENT: f64 = 1.5;

/// Triangles that are read between two checks of the cancel token.
const TRIANGLES_PER_CHECK: usize = 64;

/// Reads all sensors of `mesh` in `field`: [`PER_TRIANGLE`] for each triangle, in the order of the
/// triangles.
///
/// # Errors
/// [`Cancelled`].
pub fn read(
    mesh: &TriMesh,
    field: &Field,
    settings: &SensorSettings,
    monitor: &Monitor,
) -> Result<Vec<SensorReading>, Cancelled> {
    read_some(mesh, field, settings, Density::Full, monitor)
}

/// As [`read`], the sensors of this `density`.
///
/// # Errors
/// [`Cancelled`].
pub fn read_some(
    mesh: &TriMesh,
    field: &Field,
    settings: &SensorSettings,
    density: Density,
    monitor: &Monitor,
) -> Result<Vec<SensorReading>, Cancelled> {
    read_sensors(mesh, field, settings, density, &mut Vec::new(), monitor)
}

/// As [`read`], but sensors less than [`SAME_PLACE_MM`] from where they were read into `known` keep the edge that they
/// saw there. The settings must be the same each time; an empty list knows nothing.
///
/// # Errors
/// [`Cancelled`].
pub fn read_again(
    mesh: &TriMesh,
    field: &Field,
    settings: &SensorSettings,
    known: &mut Vec<KnownEdge>,
    monitor: &Monitor,
) -> Result<Vec<SensorReading>, Cancelled> {
    read_sensors(mesh, field, settings, Density::Full, known, monitor)
}

/// Distance from the place where a sensor was read within which it sees the same edge, mm: a fortieth of a usual voxel.
const SAME_PLACE_MM: f64 = 0.1;

/// The edge that a sensor saw, and where the sensor was.
#[derive(Debug, Clone, Copy)]
pub struct KnownEdge {
    place: Vec3,
    normal: Vec3,
    side: WallSide,
    shift: f64,
    edge: ProfileEdge,
}

impl KnownEdge {
    /// The edge as a sensor at `place` nearby sees it.
    fn seen_from(&self, place: &Vec3) -> ProfileEdge {
        ProfileEdge {
            offset: self.edge.offset - (place - self.place).dot(&self.normal),
            ..self.edge
        }
    }
}

fn read_sensors(
    mesh: &TriMesh,
    field: &Field,
    settings: &SensorSettings,
    density: Density,
    known: &mut Vec<KnownEdge>,
    monitor: &Monitor,
) -> Result<Vec<SensorReading>, Cancelled> {
    let normals = mesh.vertex_normals();
    let all = barycentric();
    let weights = density.sensors(&all);
    let total = mesh.area() * 2.0 * weights.len() as f64;
    let mut profile = Profile::new(settings);
    let mut rim = Profile::new(&SensorSettings {
        reach: settings.reach * RIM_REACH,
        ..*settings
    });
    let mut readings = Vec::with_capacity(mesh.triangles.len() * weights.len());
    let mut widths = Vec::with_capacity(readings.capacity());
    let mut read = |place: Vec3, normal: Vec3| {
        let (side, shift) = settings.shift.at(&place, &normal);
        let line = match side {
            WallSide::Rim => &mut rim,
            WallSide::Inner | WallSide::Outer => &mut profile,
        };
        KnownEdge {
            edge: line.edge(field, &place, &normal),
            place,
            normal,
            side,
            shift,
        }
    };
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        if t % TRIANGLES_PER_CHECK == 0 {
            monitor.check()?;
        }
        let share = mesh.area_normal(t).norm() / total;
        let corners = mesh.corners(t);
        let sides = triangle.map(|v| normals[v as usize]);
        for w in weights {
            let place = corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2];
            let index = readings.len();
            let is_near =
                |known: &KnownEdge| (place - known.place).norm_squared() < SAME_PLACE_MM.powi(2);
            if !known.get(index).is_some_and(is_near) {
                let normal = (sides[0] * w[0] + sides[1] * w[1] + sides[2] * w[2])
                    .try_normalize(0.0)
                    .unwrap_or_else(Vec3::zeros);
                let seen = read(place, normal);
                if index < known.len() {
                    known[index] = seen;
                } else {
                    known.push(seen);
                }
            }
            let seen = known[index];
            let mut edge = seen.seen_from(&place);
            if settings.blind.is_some_and(|sector| sector.holds(&place)) {
                edge.score = 0.0;
            }
            widths.push((seen.side, edge.half_width));
            readings.push(SensorReading {
                place,
                normal: seen.normal,
                offset: edge.offset + seen.shift,
                weight: edge.score,
                share,
            });
        }
    }
    weigh(&mut readings);
    for side in [WallSide::Inner, WallSide::Outer, WallSide::Rim] {
        weigh_by_width(&mut readings, &widths, side);
    }
    Ok(readings)
}

/// Replaces scores by weights.
fn weigh(readings: &mut [SensorReading]) {
    let mut scores: Vec<f64> = readings.iter().map(|r| r.weight).collect();
    scores.sort_by(f64::total_cmp);
    let strong = scores[scores.len() * 9 / 10];
    for r in readings {
        r.weight = if strong > 0.0 {
            (r.weight / strong).min(1.0).powf(WEIGHT_EXPONENT)
        } else {
            0.0
        };
    }
}

/// Sensors whose half width differs from the median by this much, mm, have about half the weight.
/// The standard deviation over clear edges of simulated scans is 1.0 mm.
const ODD_WIDTH: f64 = 1.5;
/// Shift of the rim's edge for each millimetre of half width: the ridge before the rim lies where
/// the wall ends less the blur, so a wide fall ends farther out than its half-way point.
const RIM_WIDTH: f64 = 0.3;

/// Compares the half widths of the edges on one side of the wall with their median.
fn weigh_by_width(
    readings: &mut [SensorReading],
    widths: &[(WallSide, Option<f64>)],
    side: WallSide,
) {
    let own = |w: &(WallSide, Option<f64>)| w.1.filter(|_| w.0 == side);
    let mut clear: Vec<f64> = widths
        .iter()
        .zip(&*readings)
        .filter(|(_, r)| r.weight > 0.25)
        .filter_map(|(w, _)| own(w))
        .collect();
    clear.sort_by(f64::total_cmp);
    let Some(usual) = clear.get(clear.len() / 2) else {
        return;
    };
    for (w, r) in widths.iter().zip(readings) {
        let Some(more) = own(w).map(|width| width - usual) else {
            continue;
        };
        match side {
            WallSide::Rim => r.offset += RIM_WIDTH * more.clamp(-4.0, 4.0),
            WallSide::Inner | WallSide::Outer => {
                let odd = (more / ODD_WIDTH).powi(2);
                r.weight /= 1.0 + odd + odd * odd / 16.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::image::grid::Volume;

    /// Of edges alike in all but width, one much wider than usual hardly counts, however narrow or wide
    /// the usual ones are; the rim's edge is moved instead.
    #[test]
    fn an_edge_of_unusual_width_counts_little() {
        let reading = SensorReading {
            place: Vec3::zeros(),
            normal: Vec3::z(),
            offset: 0.0,
            weight: 1.0,
            share: 1.0,
        };
        for usual in [2.0, 5.0] {
            for side in [WallSide::Inner, WallSide::Outer, WallSide::Rim] {
                let mut readings = vec![reading; 5];
                let mut widths = vec![(side, Some(usual)); 5];
                widths[4].1 = Some(usual + 2.0 * ODD_WIDTH);
                weigh_by_width(&mut readings, &widths, side);
                assert!(
                    readings[..4]
                        .iter()
                        .all(|r| r.weight == 1.0 && r.offset == 0.0)
                );
                let odd = readings[4];
                if side == WallSide::Rim {
                    assert_eq!((odd.weight, odd.offset), (1.0, 2.0 * ODD_WIDTH * RIM_WIDTH));
                } else {
                    assert!(odd.weight < 0.2 && odd.offset == 0.0, "{}", odd.weight);
                }
            }
        }
    }

    /// The centroids of nine congruent parts: the mean of a quadratic over them is that over the triangle but
    /// for the ninth part of its variance.
    #[test]
    fn the_sensors_of_a_triangle_stand_for_equal_parts_of_it() {
        let all = barycentric();
        let mean = |f: fn(&[f64; 3]) -> f64| all.iter().map(f).sum::<f64>() / 9.0;
        for w in &all {
            assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-12 && w.iter().all(|x| *x > 0.1));
        }
        for u in [mean(|w| w[0]), mean(|w| w[1]), mean(|w| w[2])] {
            assert!((u - 1.0 / 3.0).abs() < 1e-12);
        }
        for square in [
            mean(|w| w[0] * w[0]),
            mean(|w| w[1] * w[1]),
            mean(|w| w[2] * w[2]),
        ] {
            assert!((square - (1.0 / 6.0 - 1.0 / 162.0)).abs() < 1e-12);
        }
        assert!((mean(|w| w[1] * w[2]) - (1.0 / 12.0 + 1.0 / 324.0)).abs() < 1e-12);
    }

    fn settings_of_ball() -> SensorSettings {
        SensorSettings {
            kind: SensorKind::Gradient,
            reach: 8.0,
            level: 0.0,
            ceiling: f64::INFINITY,
            shift: EdgeShift {
                inner: 0.0,
                outer: 0.0,
                rim: 0.0,
                axis: [Vec3::zeros(); 2],
            },
            blind: None,
        }
    }

    /// Sensors that hardly move keep their edge, which does not move with them; others are read.
    #[test]
    fn sensors_that_stay_keep_their_edge() {
        let mut mesh = crate::mesh::shapes::icosphere(20.0, 2);
        let frame = VoxelToPatient::centred([60; 3], [1.0; 3], Vec3::zeros()).unwrap();
        let value = |p: &Vec3| 100.0 / (1.0 + ((p.norm() - 22.0) / 1.6).exp());
        let field = Field::new(&Volume::sampled([60; 3], frame, value), None, 0.0);
        let settings = settings_of_ball();
        let silent = Monitor::silent();
        let mut known = Vec::new();
        let first = read_again(&mesh, &field, &settings, &mut known, &silent).unwrap();
        assert_eq!(first, read(&mesh, &field, &settings, &silent).unwrap());
        for p in &mut mesh.vertices {
            *p *= if p.z > 0.0 { 1.004 } else { 1.04 };
        }
        let again = read_again(&mesh, &field, &settings, &mut known, &silent).unwrap();
        let fresh = read(&mesh, &field, &settings, &silent).unwrap();
        let point = |r: &SensorReading| r.place + r.normal * r.offset;
        let (mut kept, mut same) = (0, 0);
        for ((before, again), fresh) in first.iter().zip(&again).zip(&fresh) {
            assert_eq!(again.place, fresh.place);
            assert!((again.offset - fresh.offset).abs() < 0.05);
            kept += usize::from((point(again) - point(before)).norm() < 0.02);
            same += usize::from(again.offset == fresh.offset);
        }
        assert!(
            kept > 0 && same > 0 && same < fresh.len() - 500,
            "{kept} {same}"
        );
    }

    #[test]
    fn a_third_of_the_sensors_has_the_centre_of_all_and_stands_for_the_same_area() {
        let all = barycentric();
        let third = Density::Third.sensors(&all);
        assert_eq!((Density::Full.sensors(&all).len(), third.len()), (9, 3));
        for corner in 0..3 {
            assert!((third.iter().map(|w| w[corner]).sum::<f64>() - 1.0).abs() < 1e-12);
        }
        let mesh = crate::mesh::shapes::icosphere(20.0, 2);
        let frame = VoxelToPatient::centred([30; 3], [2.0; 3], Vec3::zeros()).unwrap();
        let field = Field::new(&Volume::sampled([30; 3], frame, |p| -p.norm()), None, 0.0);
        let settings = settings_of_ball();
        let read = |density| read_some(&mesh, &field, &settings, density, &Monitor::silent());
        let (all, third) = (read(Density::Full).unwrap(), read(Density::Third).unwrap());
        let share = |readings: &[SensorReading]| readings.iter().map(|r| r.share).sum::<f64>();
        assert!((share(&all) - 1.0).abs() < 1e-9 && (share(&third) - 1.0).abs() < 1e-9);
        for (t, own) in third.chunks(3).enumerate() {
            let of_all = &all[PER_TRIANGLE * t + 6..][..3];
            assert!(
                own.iter()
                    .zip(of_all)
                    .all(|(a, b)| (a.place, a.offset) == (b.place, b.offset))
            );
        }
    }

    fn readings(weights: impl Iterator<Item = f64>) -> Vec<SensorReading> {
        weights
            .map(|weight| SensorReading {
                place: Vec3::zeros(),
                normal: Vec3::z(),
                offset: 0.0,
                weight,
                share: 1.0,
            })
            .collect()
    }

    #[test]
    fn weights_are_relative_to_strong_edges() {
        let mut scored = readings((0..20).map(f64::from));
        weigh(&mut scored);
        assert_eq!(
            (scored[0].weight, scored[18].weight, scored[19].weight),
            (0.0, 1.0, 1.0)
        );
        assert!((scored[9].weight - 0.5f64.powf(1.5)).abs() < 1e-12);
        let mut blank = readings([0.0; 8].into_iter());
        weigh(&mut blank);
        assert!(blank.iter().all(|r| r.weight == 0.0));
    }

    /// Ten reading of 4 mm and five of 2 mm that are hardly seen: the usual width is 4.
    #[test]
    fn the_usual_width_is_that_of_clear_edges() {
        let mut seen = readings((0..15).map(|n| if n < 10 { 1.0 } else { 0.2 }));
        let widths: Vec<_> = (0..15)
            .map(|n| (WallSide::Outer, Some(if n < 10 { 4.0 } else { 2.5 })))
            .collect();
        weigh_by_width(&mut seen, &widths, WallSide::Outer);
        assert!(seen[..10].iter().all(|r| r.weight == 1.0));
        // One odd width less: 1 / (1 + 1 + 1/16).
        assert!(
            seen[10..]
                .iter()
                .all(|r| (r.weight - 0.2 / 2.0625).abs() < 1e-9)
        );
        let before = seen.clone();
        weigh_by_width(&mut seen, &widths, WallSide::Inner);
        assert_eq!(seen, before);
    }

    /// A ball whose edge lies 2 mm outside of the model: every sensor says so, and the shares are those of area.
    #[test]
    fn sensors_of_a_ball_see_how_far_its_edge_is() {
        let ball = crate::mesh::shapes::icosphere(30.0, 2);
        let frame = VoxelToPatient::centred([48; 3], [2.0; 3], Vec3::zeros()).unwrap();
        let volume = Volume::sampled([48; 3], frame, |p| {
            100.0 / (1.0 + ((p.norm() - 32.0) / 1.5).exp())
        });
        let field = Field::new(&volume, None, 0.0);
        let settings = SensorSettings {
            kind: SensorKind::Gradient,
            reach: 8.0,
            level: 50.0,
            ceiling: f64::INFINITY,
            shift: EdgeShift {
                inner: 0.0,
                outer: 0.5,
                rim: 0.0,
                axis: [Vec3::zeros(); 2],
            },
            blind: Some(BlindSector {
                centre: Vec3::zeros(),
                axis: Vec3::z(),
                middle: Vec3::x(),
                half_angle: 30.0,
            }),
        };
        let readings = read(&ball, &field, &settings, &Monitor::silent()).unwrap();
        assert_eq!(readings.len(), PER_TRIANGLE * ball.triangles.len());
        assert!((readings.iter().map(|r| r.share).sum::<f64>() - 1.0).abs() < 1e-9);
        let mut blind = 0;
        for (n, r) in readings.iter().enumerate() {
            let t = n / PER_TRIANGLE;
            let exact = ball.area_normal(t).norm() / 2.0 / ball.area() / PER_TRIANGLE as f64;
            assert!((r.share - exact).abs() < 1e-12);
            assert!(
                (r.normal.norm() - 1.0).abs() < 1e-9
                    && r.normal.dot(&r.place) > 0.99 * r.place.norm()
            );
            // The model's facets lie inside of its sphere; the reader's edge is half a millimetre farther out.
            let distance = 32.5 - r.place.norm();
            assert!((r.offset - distance).abs() < 0.5, "{} {distance}", r.offset);
            let across = r.place.x.hypot(r.place.y);
            if r.place.x > across * 0.867 {
                assert_eq!(r.weight, 0.0);
                blind += 1;
            } else if r.place.x < across * 0.865 {
                assert!(r.weight > 0.3, "{}", r.weight);
            }
        }
        assert!(8 * blind > readings.len(), "{blind}");
    }
}
