//! The image along one sensor's normal, and the edge on it.

use super::settings::{SensorKind, SensorSettings};
use crate::base::geometry::Vec3;
use crate::image::grid::field::Field;

/// Distance of the samples along a profile, mm.
const SAMPLE_STEP_MM: f64 = 1.0;
/// Half the distance between the samples of a difference quotient, in steps.
const SLOPE_HALF_STEPS: usize = 2;
/// Farthest distance of the ridge and the trough from an edge, in steps.
const MAX_FLANK_STEPS: isize = 14;
/// Farthest distance of the half-way point from the steepest slope, in steps: a farther one belongs
/// to another structure.
const MAX_HALFWAY_STEPS: f64 = 2.0;

/// The edge on a profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfileEdge {
    /// Where it lies, mm along the normal.
    pub offset: f64,
    /// Slope (image units per mm) times nearness; 0 where there is none.
    pub score: f64,
    /// From the ridge to the half-way point, mm; for [`SensorKind::HalfMaximum`] only.
    pub half_width: Option<f64>,
}

/// A profile, with buffers for its samples.
pub struct Profile {
    settings: SensorSettings,
    half: usize,
    /// [`SensorSettings::nearness`] at each slope.
    nearness: Vec<f64>,
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl Profile {
    /// A profile for sensors with these settings.
    pub fn new(settings: &SensorSettings) -> Self {
        let half = (settings.reach / SAMPLE_STEP_MM).ceil().max(1.0) as usize;
        Self {
            settings: *settings,
            half,
            nearness: (0..=2 * half)
                .map(|s| settings.nearness((s as f64 - half as f64) * SAMPLE_STEP_MM))
                .collect(),
            values: Vec::new(),
            slopes: Vec::new(),
        }
    }

    /// The edge near `place`, along `normal`.
    pub fn edge(&mut self, field: &Field, place: &Vec3, normal: &Vec3) -> ProfileEdge {
        let reach = self.half + SLOPE_HALF_STEPS;
        let start = field.to_index(place);
        let step = field.step(normal) * SAMPLE_STEP_MM;
        self.values.clear();
        self.values.extend((0..=2 * reach).map(|s| {
            let t = s as f64 - reach as f64;
            field
                .at_index(&(start + step * t))
                .min(self.settings.ceiling)
        }));
        if self.settings.kind == SensorKind::Level {
            return self.crossing(reach);
        }
        self.slopes.clear();
        self.slopes.extend((0..=2 * self.half).map(|s| {
            let slope = (self.values[s] - self.values[s + 2 * SLOPE_HALF_STEPS])
                / (2.0 * SLOPE_HALF_STEPS as f64 * SAMPLE_STEP_MM);
            match self.settings.kind {
                SensorKind::Unsigned => slope.abs(),
                _ => slope.max(0.0),
            }
        }));
        let score = |s: usize| self.slopes[s] * self.nearness[s];
        let mut best = 0;
        for s in 1..self.slopes.len() {
            if score(s) > score(best) {
                best = s;
            }
        }
        let seen = score(best);
        // The Gaussian selects the peak but also shifts it towards the sensor: climb on the
        // unweighted slope.
        let top = climb(&self.slopes, best);
        let steepest = top as f64 - self.half as f64;
        let half_way = (self.settings.kind == SensorKind::HalfMaximum && seen > 0.0).then(|| {
            // Most of these samples were taken above.
            let middle = (top + SLOPE_HALF_STEPS) as isize;
            let value = |s: isize| match usize::try_from(middle + s) {
                Ok(known) if known < self.values.len() => self.values[known],
                _ => {
                    let index = start + step * (steepest + s as f64);
                    field.at_index(&index).min(self.settings.ceiling)
                }
            };
            half_way(value)
        });
        let (beyond, half_width) = match half_way {
            Some((beyond, width)) => (beyond, Some(width * SAMPLE_STEP_MM)),
            None => (parabola(&self.slopes, top), None),
        };
        ProfileEdge {
            offset: (steepest + beyond) * SAMPLE_STEP_MM,
            score: seen,
            half_width,
        }
    }

    /// The nearest point where the image falls through the level outward.
    fn crossing(&self, reach: usize) -> ProfileEdge {
        let level = self.settings.level;
        let mut best: Option<(f64, f64)> = None;
        for (s, pair) in self.values.windows(2).enumerate() {
            if pair[0] >= level && pair[1] < level {
                let t = s as f64 - reach as f64 + (pair[0] - level) / (pair[0] - pair[1]);
                if best.is_none_or(|b| t.abs() < b.0.abs()) {
                    best = Some((t, pair[0] - pair[1]));
                }
            }
        }
        let (t, slope) = best.unwrap_or((0.0, 0.0));
        ProfileEdge {
            offset: t * SAMPLE_STEP_MM,
            score: slope / SAMPLE_STEP_MM * self.settings.nearness(t * SAMPLE_STEP_MM),
            half_width: None,
        }
    }
}

/// Steps from the steepest fall (0) to where `value` passes half-way from the ridge before it
/// to the trough behind it, at most [`MAX_HALFWAY_STEPS`] either way, and from the ridge to there.
fn half_way(value: impl Fn(isize) -> f64) -> (f64, f64) {
    let ridge = turning(&value, -1);
    let trough = turning(&value, 1);
    let level = 0.5 * (ridge.1 + trough.1);
    let towards = if value(0) > level { 1 } else { -1 };
    let sign = towards as f64;
    let mut last = value(0);
    let mut crossing = 0.0;
    for s in 0..MAX_FLANK_STEPS {
        let next = value((s + 1) * towards);
        if (next - level) * sign <= 0.0 {
            // `last` lies strictly on the other side, or s is 0 and the level is here.
            let share = (last - level) / (last - next);
            crossing = sign * (s as f64 + if share.is_finite() { share } else { 0.0 });
            break;
        }
        last = next;
    }
    (
        crossing.clamp(-MAX_HALFWAY_STEPS, MAX_HALFWAY_STEPS),
        crossing + ridge.0,
    )
}

/// The end of the fall on a profile, backward (`towards` = -1) to the ridge or forward (1) to the
/// trough: steps from 0 and value.
fn turning(value: impl Fn(isize) -> f64, towards: isize) -> (f64, f64) {
    let (mut s, mut last) = (0, value(0));
    while s < MAX_FLANK_STEPS {
        let next = value((s + 1) * towards);
        if (next - last) * towards as f64 >= 0.0 {
            break;
        }
        (s, last) = (s + 1, next);
    }
    (s as f64, last)
}

/// The local maximum above `start`.
fn climb(values: &[f64], start: usize) -> usize {
    let mut top = start;
    loop {
        let right = (top + 1).min(values.len() - 1);
        let left = top.saturating_sub(1);
        let next = if values[right] > values[left] {
            right
        } else {
            left
        };
        if values[next] > values[top] {
            top = next;
        } else {
            return top;
        }
    }
}

/// The maximum of the parabola through a sample and its neighbours, in steps from the sample,
/// -0.5..=0.5.
fn parabola(scores: &[f64], best: usize) -> f64 {
    if best == 0 || best + 1 == scores.len() {
        return 0.0;
    }
    let (a, b, c) = (scores[best - 1], scores[best], scores[best + 1]);
    let second = a - 2.0 * b + c;
    if second < 0.0 {
        (0.5 * (a - c) / second).clamp(-0.5, 0.5)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::image::grid::Volume;

    #[test]
    fn half_way_down_a_ramp_is_its_middle() {
        // A plateau of 9, a fall of 1.5 a step from -3 to 3, a plateau of 0; seen from the
        // steepest slope half a step off the middle.
        let value = |s: isize| (4.5 - 1.5 * (s as f64 - 0.5)).clamp(0.0, 9.0);
        let (crossing, width) = half_way(value);
        assert!((crossing - 0.5).abs() < 1e-12, "{crossing}");
        assert!((width - 3.5).abs() < 0.51, "{width}");
    }

    #[test]
    fn a_profile_without_end_stays_near() {
        let (crossing, width) = half_way(|s| -(s * s * s) as f64);
        assert!(crossing.abs() <= MAX_HALFWAY_STEPS && width.is_finite());
        assert_eq!(half_way(|_| 1.0), (0.0, 0.0));
    }

    fn settings(kind: SensorKind) -> SensorSettings {
        SensorSettings {
            kind,
            reach: 10.0,
            level: 30.0,
            ceiling: f64::INFINITY,
            shift: crate::heart::deform::sensors::EdgeShift {
                inner: 0.0,
                outer: 0.0,
                rim: 0.0,
                axis: [Vec3::zeros(); 2],
            },
            blind: None,
        }
    }

    /// The image of `value`, a function of the way along x, mm.
    fn image(value: impl Fn(f64) -> f64) -> Field {
        let frame = VoxelToPatient::centred([121, 5, 5], [0.5, 4.0, 4.0], Vec3::zeros());
        let volume = Volume::sampled([121, 5, 5], frame.unwrap(), |p| value(p.x));
        Field::new(&volume, None, 0.0)
    }

    /// A fall from 100 to 0 at `edge`, steepest (100 / 4 `width` per mm) there.
    fn fall(edge: f64, width: f64) -> impl Fn(f64) -> f64 {
        move |x| 100.0 / (1.0 + ((x - edge) / width).exp())
    }

    #[test]
    fn every_kind_of_sensor_finds_its_point_of_an_edge() {
        for distance in [-5.0, -2.3, 0.0, 0.4, 3.5, 6.0] {
            let place = Vec3::new(-4.0, 0.0, 0.0);
            let falling = image(fall(place.x + distance, 1.6));
            let mirrored = fall(place.x + distance, 1.6);
            let rising = image(|x| mirrored(-x));
            let of = |kind, field: &Field, place: Vec3, normal: Vec3| {
                Profile::new(&settings(kind)).edge(field, &place, &normal)
            };
            for kind in [
                SensorKind::Gradient,
                SensorKind::HalfMaximum,
                SensorKind::Unsigned,
            ] {
                let edge = of(kind, &falling, place, Vec3::x());
                assert!(
                    (edge.offset - distance).abs() < 0.1,
                    "{kind:?} {distance}: {edge:?}"
                );
                // Over four steps the slope is a little less than at the edge itself.
                let near = (-distance * distance / 50.0).exp();
                let share = edge.score / (100.0 / 6.4 * near);
                assert!((0.8..1.25).contains(&share), "{share}");
                assert_eq!(edge.half_width.is_some(), kind == SensorKind::HalfMaximum);
                let back = of(kind, &rising, -place, -Vec3::x());
                assert!((back.offset - edge.offset).abs() < 0.1);
            }
            // 30 % lies ln(7/3) widths behind the middle.
            let level = of(SensorKind::Level, &falling, place, Vec3::x());
            let exact = distance + 1.6 * (7f64 / 3.0).ln();
            assert!((level.offset - exact).abs() < 0.1, "{level:?} {exact}");
            let steepness = 0.3 * 0.7 * 100.0 / 1.6 * (-exact * exact / 50.0).exp();
            assert!(
                (level.score / steepness - 1.0).abs() < 0.15,
                "{level:?} {steepness}"
            );
            // A rise is an edge to the unsigned sensor alone.
            let rise = |kind| of(kind, &falling, place, -Vec3::x()).score;
            assert!(rise(SensorKind::Unsigned) > 5.0);
            assert!(rise(SensorKind::Gradient) < 1e-6 && rise(SensorKind::Level) == 0.0);
        }
    }

    #[test]
    fn the_nearest_fall_through_the_level_counts() {
        let twice = |x: f64| fall(-3.0, 0.7)(x) + fall(5.0, 0.7)(x) - fall(1.0, 0.7)(x);
        let of = |x: f64| {
            let place = Vec3::new(x, 0.0, 0.0);
            let mut profile = Profile::new(&settings(SensorKind::Level));
            x + profile.edge(&image(twice), &place, &Vec3::x()).offset
        };
        let behind = 0.7 * (7f64 / 3.0).ln();
        assert!((of(0.0) - (behind - 3.0)).abs() < 0.2, "{}", of(0.0));
        assert!((of(2.5) - (behind + 5.0)).abs() < 0.2, "{}", of(2.5));
    }

    #[test]
    fn a_plateau_at_the_level_ends_where_it_falls() {
        let steps = |x: f64| [60.0, 30.0, 0.0][usize::from(x >= 0.0) + usize::from(x >= 6.0)];
        let mut profile = Profile::new(&settings(SensorKind::Level));
        let edge = profile.edge(&image(steps), &Vec3::zeros(), &Vec3::x());
        assert!((5.0..6.5).contains(&edge.offset), "{edge:?}");
    }

    /// The half-way point lies between ridge and trough, not at the steepest slope: here the outer part of the
    /// fall is longer and flatter.
    #[test]
    fn half_way_lies_between_ridge_and_trough() {
        let uneven = |x: f64| match x {
            x if x < 0.0 => 100.0,
            x if x < 4.0 => 100.0 - 15.0 * x,
            x => (40.0 - 5.0 * (x - 4.0)).max(0.0),
        };
        let place = Vec3::new(1.0, 0.0, 0.0);
        let half = Profile::new(&settings(SensorKind::HalfMaximum)).edge(
            &image(uneven),
            &place,
            &Vec3::x(),
        );
        // 50 is passed at 10/3; the ridge lies at 0.
        assert!(
            (place.x + half.offset - 10.0 / 3.0).abs() < 0.05,
            "{half:?}"
        );
        assert!(
            (half.half_width.unwrap() - 10.0 / 3.0).abs() < 0.05,
            "{half:?}"
        );
        // Clipped at 60 the ridge lies lower, and at 8/3.
        let clipped = SensorSettings {
            ceiling: 60.0,
            ..settings(SensorKind::HalfMaximum)
        };
        let clipped = Profile::new(&clipped).edge(&image(uneven), &place, &Vec3::x());
        assert!((place.x + clipped.offset - 6.0).abs() < 0.4, "{clipped:?}");
    }

    #[test]
    fn a_parabola_has_its_maximum_where_it_is() {
        for top in [-0.4, 0.0, 0.3] {
            let scores: Vec<f64> = (0..5)
                .map(|n| 9.0 - (n as f64 - 2.0 - top).powi(2) * 1.7)
                .collect();
            assert!((parabola(&scores, 2) - top).abs() < 1e-12);
        }
        assert_eq!(parabola(&[0.0, 1.0, 3.0], 1), 0.0);
        assert_eq!(
            (parabola(&[3.0, 1.0], 0), parabola(&[1.0, 3.0], 1)),
            (0.0, 0.0)
        );
        // At most half a step: farther on another sample would be the greatest.
        assert_eq!(parabola(&[0.0, 4.0, 7.0], 1), 0.5);
    }

    #[test]
    fn a_fall_ends_where_it_turns() {
        let wave = |s: isize| (0.4 * (s as f64 + 2.0)).cos();
        // It falls from -2 to about 5.85.
        assert_eq!(turning(wave, -1), (2.0, 1.0));
        assert_eq!(turning(wave, 1), (6.0, wave(6)));
        assert_eq!(turning(|s| -(s as f64), 1), (14.0, -14.0));
        let hills = [1.0, 2.0, 5.0, 3.0, 4.0, 9.0];
        let tops: Vec<usize> = (0..6).map(|n| climb(&hills, n)).collect();
        assert_eq!(tops, [2, 2, 2, 2, 5, 5]);
        assert_eq!(climb(&[3.0, 2.0, 5.0], 1), 2);
    }
}
