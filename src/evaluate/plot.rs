//! Lines over the number of points as inline SVG.

use std::fmt::Write;

/// A line, or a single point where there is just one.
#[derive(Debug, Clone)]
pub struct Series {
    /// What the legend calls it.
    pub label: String,
    /// CSS colour.
    pub colour: &'static str,
    /// Thin lines stand back behind the others.
    pub thin: bool,
    /// x and y, by x.
    pub points: Vec<(f64, f64)>,
}

const WIDTH: f64 = 540.0;
const HEIGHT: f64 = 300.0;
/// Left, top, right and bottom of the plotting area.
const AREA: [f64; 4] = [58.0, 34.0, 400.0, 256.0];

/// The plot of `series` under `title`; an empty text where there is nothing to show.
pub fn plot(title: &str, series: &[Series]) -> String {
    let all: Vec<(f64, f64)> = series.iter().flat_map(|s| s.points.clone()).collect();
    if all.is_empty() {
        return String::new();
    }
    let [left, top, right, bottom] = AREA;
    let (x0, x1) = padded(all.iter().map(|p| p.0));
    let (low, high) = padded(all.iter().map(|p| p.1));
    let step = tick_step(high - low, 5);
    let (y0, y1) = ((low / step).floor() * step, (high / step).ceil() * step);
    let x = |v: f64| left + (right - left) * (v - x0) / (x1 - x0);
    let y = |v: f64| bottom - (bottom - top) * (v - y0) / (y1 - y0);

    let mut svg = format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" role=\"img\" \
         aria-label=\"{title}\"><text class=\"title\" x=\"{left}\" y=\"18\">{title}</text>",
        title = escape(title)
    );
    let mut level = y0;
    while level <= y1 + 0.001 * step {
        let _ = write!(
            svg,
            "<line class=\"grid\" x1=\"{left}\" x2=\"{right}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>\
             <text class=\"tick\" text-anchor=\"end\" x=\"{:.1}\" y=\"{:.1}\">{level:.*}</text>",
            left - 6.0,
            y(level) + 4.0,
            decimals(step),
            at = y(level)
        );
        level += step;
    }
    let mut places: Vec<f64> = all.iter().map(|p| p.0).collect();
    places.sort_by(f64::total_cmp);
    places.dedup();
    for place in places {
        let _ = write!(
            svg,
            "<text class=\"tick\" text-anchor=\"middle\" x=\"{:.1}\" y=\"{:.1}\">{place}</text>",
            x(place),
            bottom + 16.0
        );
    }
    let _ = write!(
        svg,
        "<text class=\"tick\" text-anchor=\"middle\" x=\"{:.1}\" y=\"{:.1}\">points N</text>",
        f64::midpoint(left, right),
        bottom + 34.0
    );
    for (row, line) in series.iter().enumerate() {
        draw(&mut svg, line, &x, &y);
        let _ = write!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"{}\">{}</text>",
            right + 14.0,
            top + 10.0 + 19.0 * row as f64,
            line.colour,
            escape(&line.label)
        );
    }
    svg.push_str("</svg>\n");
    svg
}

fn draw(svg: &mut String, line: &Series, x: &impl Fn(f64) -> f64, y: &impl Fn(f64) -> f64) {
    let (width, radius) = if line.thin { (1.0, 2.0) } else { (2.5, 4.0) };
    let path: Vec<String> = line
        .points
        .iter()
        .map(|p| format!("{:.1},{:.1}", x(p.0), y(p.1)))
        .collect();
    let _ = write!(
        svg,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\"/>",
        path.join(" "),
        line.colour
    );
    for p in &line.points {
        let _ = write!(
            svg,
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius}\" fill=\"{}\"><title>{}: {} at {}\
             </title></circle>",
            x(p.0),
            y(p.1),
            line.colour,
            escape(&line.label),
            format_args!("{:.4}", p.1),
            p.0
        );
    }
}

/// The range of some values with a little room at both ends.
fn padded(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
        (l.min(v), h.max(v))
    });
    let room = (0.05 * (high - low)).max(1e-3 * high.abs()).max(1e-6);
    (low - room, high + room)
}

/// A round step that cuts `span` into at most `most` parts.
fn tick_step(span: f64, most: usize) -> f64 {
    let raw = span / most as f64;
    let power = 10f64.powf(raw.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|f| f * power >= raw);
    factor.unwrap_or(10.0) * power
}

fn decimals(step: f64) -> usize {
    (-step.log10().floor()).max(0.0) as usize
}

/// Text for HTML and SVG.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_lie_within_the_plot_and_text_is_escaped() {
        let line = Series {
            label: "a < b".into(),
            colour: "#123456",
            thin: false,
            points: vec![(67.0, 0.6), (150.0, 0.85), (300.0, 0.84)],
        };
        let svg = plot("E_J & more", &[line]);
        assert!(svg.contains("a &lt; b") && svg.contains("E_J &amp; more"));
        let path = svg.split("points=\"").nth(1).unwrap();
        for pair in path.split('"').next().unwrap().split(' ') {
            let (x, y) = pair.split_once(',').unwrap();
            let (x, y): (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
            assert!((AREA[0]..=AREA[2]).contains(&x), "{x}");
            assert!((AREA[1]..=AREA[3]).contains(&y), "{y}");
        }
        assert_eq!(plot("nothing", &[]), "");
    }

    #[test]
    fn one_point_alone_can_be_shown() {
        let line = Series {
            label: "reference".into(),
            colour: "red",
            thin: false,
            points: vec![(67.0, 0.0)],
        };
        assert!(plot("one", &[line]).contains("<circle"));
    }

    #[test]
    fn steps_are_round() {
        for (span, step) in [(1.0, 0.2), (0.13, 0.05), (7.0, 2.0), (300.0, 100.0)] {
            assert!((tick_step(span, 5) - step).abs() < 1e-12 * step, "{span}");
        }
        assert_eq!((decimals(0.05), decimals(0.2), decimals(10.0)), (2, 1, 0));
    }
}
