//! Charts as inline SVG, coloured by the page's style sheet.
//!
//! [`histogram`] shows counts over bins before and after a change, [`lines`] quantities over a
//! common x, [`bars`] a few values in one unit. The first two share frame, axes and round marks.

use std::fmt::Write;

use maud::{Markup, html};

use super::text::number;
use crate::base::numeric::round_step::round_step;

/// A histogram's counts over equal bins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bins<'a> {
    /// Lower end of the first bin.
    pub lower: f64,
    /// Width of a bin.
    pub width: f64,
    /// Counts drawn as an outline.
    pub before: &'a [usize],
    /// Counts drawn as bars; as many bins.
    pub after: &'a [usize],
}

/// One line of a [`lines`] chart; a point where there is just one.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Its name in the legend.
    pub label: String,
    /// Class of the style sheet that gives it a colour: `red`, `orange`, `blue` or `faint`.
    pub class: &'static str,
    /// Whether it is drawn thin, as a line of secondary interest.
    pub thin: bool,
    /// x and y, by x.
    pub points: Vec<(f64, f64)>,
}

/// A chart's frame: the picture's size, the plotting area in it, and what the axes show.
struct ChartFrame {
    /// Width and height of the picture.
    size: [f64; 2],
    /// Left, top, right and bottom of the plotting area.
    area: [f64; 4],
    x: ChartAxis,
    y: ChartAxis,
    /// Below the x axis.
    x_label: String,
}

/// An axis: the values at both ends, and the values with marks.
struct ChartAxis {
    from: f64,
    to: f64,
    marks: Vec<(f64, String)>,
}

impl ChartAxis {
    /// Round marks from `from` to `to`, `step` apart; the text is followed by `unit`.
    fn with_steps(from: f64, to: f64, step: f64, unit: &str) -> Self {
        let first = (from / step - 1e-9).ceil() as i64;
        let last = (to / step + 1e-3).floor() as i64;
        let mark = |k: i64| {
            let value = k as f64 * step;
            (value, number(value, decimals(step)) + unit)
        };
        Self {
            from,
            to,
            marks: (first..=last).map(mark).collect(),
        }
    }

    fn share(&self, value: f64) -> f64 {
        (value - self.from) / (self.to - self.from)
    }
}

impl ChartFrame {
    fn x(&self, value: f64) -> f64 {
        let [left, _, right, _] = self.area;
        left + (right - left) * self.x.share(value)
    }

    fn y(&self, value: f64) -> f64 {
        let [_, top, _, bottom] = self.area;
        bottom - (bottom - top) * self.y.share(value)
    }

    /// The chart: axes, and `marks` between grid and axis.
    fn svg(&self, name: &str, title: bool, marks: &Markup) -> Markup {
        let [width, height] = self.size;
        let [left, _, right, bottom] = self.area;
        html! {
            svg viewBox=(format_args!("0 0 {width} {height}")) role="img" aria-label=(name) {
                @if title { text.title x=(left) y="18" { (name) } }
                @for (value, text) in &self.y.marks {
                    @let at = self.y(*value);
                    line.grid x1=(left) x2=(right) y1=(one(at)) y2=(one(at)) {}
                    text.tick text-anchor="end" x=(left - 5.0) y=(one(at + 3.5)) { (text) }
                }
                (marks)
                line.axis x1=(left) x2=(right) y1=(bottom) y2=(bottom) {}
                @for (value, text) in &self.x.marks {
                    text.tick text-anchor="middle" x=(one(self.x(*value))) y=(bottom + 14.0) {
                        (text)
                    }
                }
                text.label text-anchor="middle" x=(f64::midpoint(left, right)) y=(bottom + 34.0) {
                    (self.x_label)
                }
            }
        }
    }
}

/// A histogram of `quantity` in per cent of each side's count.
pub fn histogram(bins: &Bins, quantity: &str) -> Markup {
    let (before, after) = (percent(bins.before), percent(bins.after));
    let highest = before.iter().chain(&after).fold(0.0, |m: f64, s| m.max(*s));
    let step = tick_step(highest.max(1.0), 4);
    let full = (highest / step).ceil().max(1.0) * step;
    let frame = ChartFrame {
        size: [340.0, 190.0],
        area: [38.0, 10.0, 324.0, 150.0],
        x: bin_axis(bins),
        y: ChartAxis::with_steps(0.0, full, step, " %"),
        x_label: quantity.to_owned(),
    };
    let edge = |bin: usize| frame.x(bins.lower + bins.width * bin as f64);
    let bottom = frame.y(0.0);
    let mut outline = format!("M{:.1} {bottom:.1}", edge(0));
    for (bin, share) in before.iter().enumerate() {
        // Writing into a String cannot fail.
        let _ = write!(outline, "V{:.1}H{:.1}", frame.y(*share), edge(bin + 1));
    }
    let marks = html! {
        @for (bin, share) in after.iter().enumerate().filter(|(_, share)| **share > 0.0) {
            @let top = frame.y(*share);
            rect.after x=(one(edge(bin) + 0.5)) y=(one(top))
                width=(one(edge(bin + 1) - edge(bin) - 1.0)) height=(one(bottom - top)) {}
        }
        path.before d=(format_args!("{outline}V{bottom:.1}")) {}
    };
    frame.svg(&format!("Histogram of {quantity}"), false, &marks)
}

fn percent(counts: &[usize]) -> Vec<f64> {
    let total: usize = counts.iter().sum();
    let share = |&count: &usize| 100.0 * count as f64 / total.max(1) as f64;
    counts.iter().map(share).collect()
}

/// The axis below bins: few bins of whole numbers are marked at their middles, others at round
/// numbers.
fn bin_axis(bins: &Bins) -> ChartAxis {
    let (lower, width) = (bins.lower, bins.width);
    let count = bins.after.len().max(1);
    let upper = lower + width * count as f64;
    if width == 1.0 && lower.fract() == 0.0 && count <= 12 {
        let mark = |bin: usize| (lower + bin as f64 + 0.5, number(lower + bin as f64, 0));
        return ChartAxis {
            from: lower,
            to: upper,
            marks: (0..count).map(mark).collect(),
        };
    }
    ChartAxis::with_steps(lower, upper, tick_step(upper - lower, 6), "")
}

/// Most marks of the x axis of [`lines`].
const MOST_MARKS: usize = 16;

/// Lines over a common x, marked at every x that has a point, or at every second, third ... of more than
/// [`MOST_MARKS`]; nothing where there is no point.
pub fn lines(title: &str, x_label: &str, series: &[Series]) -> Markup {
    let all: Vec<(f64, f64)> = series.iter().flat_map(|s| s.points.clone()).collect();
    if all.is_empty() {
        return Markup::default();
    }
    let mut places: Vec<f64> = all.iter().map(|point| point.0).collect();
    places.sort_by(f64::total_cmp);
    places.dedup();
    let (from, to) = padded(all.iter().map(|point| point.0));
    let (low, high) = padded(all.iter().map(|point| point.1));
    let step = tick_step(high - low, 5);
    let frame = ChartFrame {
        size: [540.0, 300.0],
        area: [58.0, 34.0, 400.0, 256.0],
        x: ChartAxis {
            from,
            to,
            marks: (places.iter().step_by(places.len().div_ceil(MOST_MARKS)))
                .map(|x| (*x, x.to_string()))
                .collect(),
        },
        y: ChartAxis::with_steps(
            (low / step).floor() * step,
            (high / step).ceil() * step,
            step,
            "",
        ),
        x_label: x_label.to_owned(),
    };
    let [_, top, right, _] = frame.area;
    let marks = html! {
        @for (row, line) in series.iter().enumerate() {
            g class=(line.class) {
                (drawn(line, &frame))
                text.key x=(right + 14.0) y=(top + 10.0 + 19.0 * row as f64) { (line.label) }
            }
        }
    };
    frame.svg(title, true, &marks)
}

fn drawn(line: &Series, frame: &ChartFrame) -> Markup {
    let (width, radius) = if line.thin { (1.0, 2.0) } else { (2.5, 4.0) };
    let places: Vec<[f64; 2]> = line
        .points
        .iter()
        .map(|(x, y)| [frame.x(*x), frame.y(*y)])
        .collect();
    let path: Vec<String> = places
        .iter()
        .map(|[x, y]| format!("{x:.1},{y:.1}"))
        .collect();
    html! {
        polyline points=(path.join(" ")) fill="none" stroke="currentColor" stroke-width=(width) {}
        @for ([x, y], (at, value)) in places.iter().zip(&line.points) {
            circle cx=(one(*x)) cy=(one(*y)) r=(radius) fill="currentColor" {
                title { (line.label) ": " (format_args!("{value:.4}")) " at " (at) }
            }
        }
    }
}

/// Horizontal bars from zero, one for each of `rows`; the last one is accented.
pub fn bars(name: &str, rows: &[(&str, f64)], decimals: usize) -> Markup {
    let row_height = 22.0;
    let (left, right) = (78.0, 268.0);
    let height = row_height * rows.len() as f64 + 4.0;
    let highest = rows.iter().fold(f64::MIN_POSITIVE, |m, (_, x)| m.max(*x));
    html! {
        svg viewBox=(format_args!("0 0 340 {height}")) role="img" aria-label=(name) {
            @for (place, (row, value)) in rows.iter().enumerate() {
                @let top = 2.0 + row_height * place as f64;
                @let length = (right - left) * (value / highest).clamp(0.0, 1.0);
                @let class = if place + 1 == rows.len() { "after" } else { "earlier" };
                text.tick text-anchor="end" x=(left - 7.0) y=(top + 14.0) { (row) }
                rect class=(class) x=(left) y=(top) width=(one(length)) height=(row_height - 5.0)
                    rx="2" {}
                text.value x=(one(left + length + 6.0)) y=(top + 14.0) {
                    (number(*value, decimals))
                }
            }
        }
    }
}

/// A coordinate with one decimal.
fn one(x: f64) -> String {
    format!("{x:.1}")
}

/// The range of some values with a little room at both ends.
fn padded(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
        (l.min(v), h.max(v))
    });
    let room = (0.05 * (high - low)).max(1e-3 * high.abs()).max(1e-6);
    (low - room, high + room)
}

/// A round step that cuts `span` into `most` parts or fewer.
fn tick_step(span: f64, most: usize) -> f64 {
    // A step that misses a round number by rounding alone counts as that number.
    round_step(0.999 * span / most as f64)
}

/// Decimals that a multiple of `step` needs.
fn decimals(step: f64) -> usize {
    (-step.log10().floor()).max(0.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round_and_few() {
        for (span, most, expected) in [
            (1.0, 5, 0.2),
            (37.0, 4, 10.0),
            (100.0, 4, 50.0),
            (0.13, 5, 0.05),
            (7.0, 5, 2.0),
            (300.0, 5, 100.0),
        ] {
            let step = tick_step(span, most);
            assert!((step - expected).abs() < 1e-12 * expected, "{span}");
        }
        assert_eq!((decimals(0.05), decimals(0.2), decimals(10.0)), (2, 1, 0));
    }

    #[test]
    fn a_histogram_of_nothing_is_still_a_picture() {
        let bins = Bins {
            lower: 0.0,
            width: 1.0,
            before: &[0],
            after: &[0],
        };
        let svg = histogram(&bins, "x < y").into_string();
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>"));
        assert!(svg.contains("x &lt; y"));
    }

    #[test]
    fn whole_numbers_are_marked_at_the_middle_of_their_bins() {
        let axis = bin_axis(&Bins {
            lower: 3.0,
            width: 1.0,
            before: &[1, 2],
            after: &[2, 1],
        });
        assert_eq!(axis.marks, [(3.5, "3".to_owned()), (4.5, "4".to_owned())]);
    }

    #[test]
    fn lines_lie_within_the_plot_and_text_is_escaped() {
        let line = Series {
            label: "a < b".into(),
            class: "blue",
            thin: false,
            points: vec![(67.0, 0.6), (150.0, 0.85), (300.0, 0.84)],
        };
        let svg = lines("E_J & more", "points N", &[line]).into_string();
        assert!(svg.contains("a &lt; b") && svg.contains("E_J &amp; more"));
        let path = svg.split("points=\"").nth(1).unwrap();
        for pair in path.split('"').next().unwrap().split(' ') {
            let (x, y) = pair.split_once(',').unwrap();
            let (x, y): (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
            assert!((58.0..=400.0).contains(&x), "{x}");
            assert!((34.0..=256.0).contains(&y), "{y}");
        }
        assert_eq!(lines("nothing", "", &[]).into_string(), "");
    }

    #[test]
    fn one_point_alone_can_be_shown() {
        let line = Series {
            label: "reference".into(),
            class: "red",
            thin: false,
            points: vec![(67.0, 0.0)],
        };
        let svg = lines("one", "points N", &[line]).into_string();
        assert!(svg.contains("<circle"));
    }
}
