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

use crate::geometry::Vec3;
use crate::grid::field::Field;
use crate::mesh::TriMesh;
use crate::progress::{Cancelled, Monitor};
use profile::Profile;
use settings::WallSide;

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
    let normals = mesh.vertex_normals();
    let weights = barycentric();
    let total = mesh.area() * 2.0 * PER_TRIANGLE as f64;
    let mut profile = Profile::new(settings);
    let mut rim = Profile::new(&SensorSettings {
        reach: settings.reach * RIM_REACH,
        ..*settings
    });
    let mut readings = Vec::with_capacity(mesh.triangles.len() * PER_TRIANGLE);
    let mut widths = Vec::with_capacity(readings.capacity());
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        if t % TRIANGLES_PER_CHECK == 0 {
            monitor.check()?;
        }
        let share = mesh.area_normal(t).norm() / total;
        let corners = mesh.corners(t);
        let sides = triangle.map(|v| normals[v as usize]);
        for w in &weights {
            let place = corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2];
            let normal = (sides[0] * w[0] + sides[1] * w[1] + sides[2] * w[2])
                .try_normalize(0.0)
                .unwrap_or_else(Vec3::zeros);
            let (side, shift) = settings.shift.at(&place, &normal);
            let line = match side {
                WallSide::Rim => &mut rim,
                WallSide::Inner | WallSide::Outer => &mut profile,
            };
            let mut edge = line.edge(field, &place, &normal);
            if settings.blind.is_some_and(|sector| sector.holds(&place)) {
                edge.score = 0.0;
            }
            widths.push((side, edge.half_width));
            readings.push(SensorReading {
                place,
                normal,
                offset: edge.offset + shift,
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
    use crate::geometry::frame::VoxelToPatient;
    use crate::grid::Volume;

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
