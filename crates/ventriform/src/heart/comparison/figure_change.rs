//! The change of a figure between two scans of one heart: its interval, and whether there was one.
//!
//! In: the figure in both scans, and the noise of the pair. Out: the [`FigureChange`]. The standard deviation of a
//! change that is none grows with the noise ([`ChangeError`]); volumes and masses change by a share, all others by a
//! difference.
//!
//! - `yes`: the 95 % interval excludes that nothing changed: one figure of twenty that did not change says so.
//! - `no`: that interval excludes a change that matters ([`ChangingFigure::matters`]).
//! - `cannot tell`: neither.

use super::answers::Verdict;

/// Standard deviations from the mean to the ends of a 95 % interval.
const HALF_WIDTH_SDS: f64 = 1.96;
/// Standard deviations beyond that in which nine of ten draws lie on one side.
const FOUND_SDS: f64 = 1.282;

/// The standard deviation of a change that is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChangeError {
    /// Without noise; of a share that of its logarithm.
    pub least: f64,
    /// More for each point of the pair's noise, added in squares.
    pub per_point: f64,
}

impl ChangeError {
    /// The deviation in a pair with this noise, points.
    pub fn of_noise(self, noise_points: f64) -> f64 {
        self.least.hypot(self.per_point * noise_points)
    }
}

/// A figure that scans have, and how its change is judged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChangingFigure {
    /// Its place in the report of a scan.
    pub place: &'static str,
    /// Whether it changes by a share of itself: volumes and masses.
    pub by_share: bool,
    /// The least change that matters: of a share in per cent, otherwise in the figure's unit.
    pub matters: f64,
    /// The error of its change.
    pub error: ChangeError,
}

/// A figure that changes by a share of itself.
pub(in crate::heart) const fn by_share(
    place: &'static str,
    matters: f64,
    error: ChangeError,
) -> ChangingFigure {
    ChangingFigure {
        by_share: true,
        ..by_difference(place, matters, error)
    }
}

/// A figure that changes by a difference.
pub(in crate::heart) const fn by_difference(
    place: &'static str,
    matters: f64,
    error: ChangeError,
) -> ChangingFigure {
    ChangingFigure {
        place,
        by_share: false,
        matters,
        error,
    }
}

/// A change from one scan to another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FigureChange {
    /// The later figure less the earlier one.
    pub change: f64,
    /// Its 95 % interval.
    pub interval: [f64; 2],
    /// Whether there was a change.
    pub verdict: Verdict,
    /// The least change that would be told in nine of ten such pairs.
    pub least: f64,
}

impl ChangingFigure {
    /// The change of the figure between two scans with this noise, points.
    pub fn change(&self, earlier: f64, later: f64, noise_points: f64) -> FigureChange {
        self.within([earlier, later], noise_points, HALF_WIDTH_SDS)
    }

    /// That change with an interval of so many standard deviations to either side.
    pub(super) fn within(&self, [earlier, later]: [f64; 2], noise: f64, sds: f64) -> FigureChange {
        let deviation = self.error.of_noise(noise);
        let told = (sds + FOUND_SDS) * deviation;
        let change = later - earlier;
        if !self.by_share || earlier <= 0.0 || later <= 0.0 {
            let ends = [-1.0, 1.0].map(|side| change + side * sds * deviation);
            return FigureChange::judged(change, ends, self.matters, told);
        }
        let share = (later / earlier).ln();
        let ends = [-1.0, 1.0].map(|side| earlier * ((share + side * sds * deviation).exp() - 1.0));
        let matters = earlier * self.matters / 100.0;
        FigureChange::judged(change, ends, matters, earlier * told.exp_m1())
    }
}

impl FigureChange {
    /// A change by `change`, points, with this deviation, of a figure of which `matters` points matter.
    pub fn of_deviation(change: f64, deviation: f64, matters: f64) -> Self {
        let ends = [-1.0, 1.0].map(|side| change + side * HALF_WIDTH_SDS * deviation);
        Self::judged(
            change,
            ends,
            matters,
            (HALF_WIDTH_SDS + FOUND_SDS) * deviation,
        )
    }

    /// The difference of two figures that have 90 % intervals of their own, of which `matters` matters: the distances
    /// to the ends are added in squares (Zou and Donner, Stat Med 2008).
    pub fn of_intervals(
        [earlier, later]: [f64; 2],
        [before, after]: [[f64; 2]; 2],
        matters: f64,
    ) -> Self {
        const WIDER: f64 = HALF_WIDTH_SDS / 1.645;
        let down = (later - after[0]).hypot(before[1] - earlier);
        let up = (after[1] - later).hypot(earlier - before[0]);
        let change = later - earlier;
        let ends = [change - WIDER * down, change + WIDER * up];
        let told = f64::midpoint(down, up) * (HALF_WIDTH_SDS + FOUND_SDS) / 1.645;
        Self::judged(change, ends, matters, told)
    }

    fn judged(change: f64, interval: [f64; 2], matters: f64, least: f64) -> Self {
        let [low, high] = interval;
        let verdict = if low > 0.0 || high < 0.0 {
            Verdict::Yes
        } else if -matters < low && high < matters {
            Verdict::No
        } else {
            Verdict::CannotTell
        };
        Self {
            change,
            interval,
            verdict,
            least,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EF: ChangingFigure = by_difference(
        "ef_percent",
        5.0,
        ChangeError {
            least: 1.0,
            per_point: 0.2,
        },
    );

    #[test]
    fn a_change_beyond_the_noise_is_told_and_one_within_it_is_not() {
        assert_eq!(EF.change(60.0, 50.0, 5.0).verdict, Verdict::Yes);
        assert_eq!(EF.change(60.0, 59.0, 5.0).verdict, Verdict::No);
        assert_eq!(EF.change(60.0, 57.5, 5.0).verdict, Verdict::CannotTell);
        // With more noise, nothing is denied.
        assert_eq!(EF.change(60.0, 60.0, 20.0).verdict, Verdict::CannotTell);
    }

    /// Nine of ten draws about the least change are told, and about one of twenty draws of no change.
    #[test]
    fn the_least_change_is_told_nine_times_in_ten() {
        let deviation = EF.error.of_noise(5.0);
        let told = |change: f64| {
            let draws = (0..2000).map(|n| (f64::from(n) + 0.5) / 2000.0);
            let draws = draws.map(|share| change + deviation * normal_quantile(share));
            let told = draws.filter(|draw| {
                FigureChange::of_deviation(*draw, deviation, 5.0).verdict == Verdict::Yes
            });
            told.count() as f64 / 2000.0
        };
        let least = EF.change(60.0, 60.0, 5.0).least;
        assert!((told(least) - 0.9).abs() < 0.01, "{}", told(least));
        assert!((told(0.0) - 0.05).abs() < 0.005, "{}", told(0.0));
    }

    /// By bisection of the distribution, which Simpson's rule integrates.
    fn normal_quantile(share: f64) -> f64 {
        let below = |x: f64| {
            let steps = 200;
            let h = x / f64::from(steps);
            let density = |x: f64| (-x * x / 2.0).exp() / (2.0 * std::f64::consts::PI).sqrt();
            let sum: f64 = (0..=steps)
                .map(|n| {
                    let weight = if n == 0 || n == steps {
                        1.0
                    } else if n % 2 == 1 {
                        4.0
                    } else {
                        2.0
                    };
                    weight * density(h * f64::from(n))
                })
                .sum();
            0.5 + sum * h / 3.0
        };
        let (mut low, mut high) = (-6.0, 6.0);
        for _ in 0..40 {
            let middle = f64::midpoint(low, high);
            if below(middle) < share {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }

    /// A volume that doubles and one that halves are equally far from none.
    #[test]
    fn volumes_change_by_a_share() {
        let edv = by_share(
            "edv_ml",
            15.0,
            ChangeError {
                least: 0.1,
                per_point: 0.0,
            },
        );
        for (earlier, later) in [(100.0, 121.0), (121.0, 100.0)] {
            let change = edv.change(earlier, later, 5.0);
            assert_eq!(change.verdict, Verdict::CannotTell);
            assert!(change.interval[0] < change.change && change.change < change.interval[1]);
            assert!(change.interval[0] > -earlier);
        }
        assert_eq!(edv.change(100.0, 122.0, 5.0).verdict, Verdict::Yes);
        assert_eq!(edv.change(122.0, 100.0, 5.0).verdict, Verdict::Yes);
        assert!(edv.change(0.0, 100.0, 5.0).change.is_finite());
    }

    #[test]
    fn intervals_of_both_scans_make_that_of_the_change() {
        let change = FigureChange::of_intervals([10.0, 14.0], [[7.0, 13.0], [10.0, 18.0]], 5.0);
        assert_eq!(change.change, 4.0);
        let half = 1.96 / 1.645 * 5.0;
        assert!((change.interval[0] - (4.0 - half)).abs() < 1e-9);
        assert!((change.interval[1] - (4.0 + half)).abs() < 1e-9);
        assert_eq!(change.verdict, Verdict::CannotTell);
    }
}
