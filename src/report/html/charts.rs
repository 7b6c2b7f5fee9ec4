//! Histograms and bars as inline SVG, coloured by the page's style sheet.

use std::fmt::Write;

use super::text::{escape, number};
use crate::report::summary::Histogram;

const WIDTH: f64 = 340.0;
const HEIGHT: f64 = 190.0;
/// Left, top, right and bottom of the plotting area inside of the picture.
const PLOT: [f64; 4] = [38.0, 10.0, 324.0, 150.0];

/// A histogram of `quantity`: the re-tiled mesh as a line, the optimised one as bars, both
/// in percent of their counts.
pub fn histogram(histogram: &Histogram, quantity: &str) -> String {
    let [left, top, right, bottom] = PLOT;
    let bins = histogram.optimised.len().max(1);
    let shares = |counts: &[usize]| -> Vec<f64> {
        let total: usize = counts.iter().sum();
        let percent = |&c: &usize| 100.0 * c as f64 / total.max(1) as f64;
        counts.iter().map(percent).collect()
    };
    let (retiled, optimised) = (shares(&histogram.retiled), shares(&histogram.optimised));
    let highest = retiled
        .iter()
        .chain(&optimised)
        .fold(0.0, |m: f64, s| m.max(*s));
    let step = tick_step(highest.max(1.0), 4);
    let full = (highest / step).ceil().max(1.0) * step;
    let x = |bin: usize| left + (right - left) * bin as f64 / bins as f64;
    let y = |share: f64| bottom - (bottom - top) * share / full;

    let mut svg = String::new();
    open(&mut svg, HEIGHT, &format!("Histogram of {quantity}"));
    let mut level = 0.0;
    while level <= full * 1.001 {
        let at = y(level);
        push(
            &mut svg,
            format_args!(
                r#"<line class="grid" x1="{left}" x2="{right}" y1="{at:.1}" y2="{at:.1}"/><text class="tick" text-anchor="end" x="{:.1}" y="{:.1}">{level} %</text>"#,
                left - 5.0,
                at + 3.5
            ),
        );
        level += step;
    }
    for (bin, &share) in optimised.iter().enumerate() {
        if share > 0.0 {
            push(
                &mut svg,
                format_args!(
                    r#"<rect class="after" x="{:.1}" y="{:.1}" width="{:.1}" height="{:.1}"/>"#,
                    x(bin) + 0.5,
                    y(share),
                    x(bin + 1) - x(bin) - 1.0,
                    bottom - y(share)
                ),
            );
        }
    }
    let mut outline = format!("M{:.1} {bottom:.1}", x(0));
    for (bin, &share) in retiled.iter().enumerate() {
        push(
            &mut outline,
            format_args!("V{:.1}H{:.1}", y(share), x(bin + 1)),
        );
    }
    push(
        &mut svg,
        format_args!(
            r#"<path class="before" d="{outline}V{bottom:.1}"/><line class="axis" x1="{left}" x2="{right}" y1="{bottom}" y2="{bottom}"/>"#
        ),
    );
    ticks(&mut svg, histogram, bins);
    push(
        &mut svg,
        format_args!(
            r#"<text class="label" text-anchor="middle" x="{:.1}" y="{:.1}">{}</text></svg>"#,
            f64::midpoint(left, right),
            HEIGHT - 6.0,
            escape(quantity)
        ),
    );
    svg
}

/// Marks below the axis: whole numbers under the middle of their bins, round numbers else.
fn ticks(svg: &mut String, histogram: &Histogram, bins: usize) {
    let [left, _, right, bottom] = PLOT;
    let (width, lower) = (histogram.width, histogram.lower);
    let discrete = width == 1.0 && lower.fract() == 0.0 && bins <= 12;
    let span = width * bins as f64;
    let step = if discrete { 1.0 } else { tick_step(span, 6) };
    let shift = if discrete { 0.5 } else { 0.0 };
    let mut value = (lower / step - 1e-9).ceil() * step;
    while value <= lower + span * 1.000_001 - shift {
        let at = left + (right - left) * (value + shift - lower) / span;
        push(
            svg,
            format_args!(
                r#"<text class="tick" text-anchor="middle" x="{at:.1}" y="{:.1}">{}</text>"#,
                bottom + 14.0,
                number(value, digits(step))
            ),
        );
        value += step;
    }
}

/// A round step that cuts `span` into at most `most` parts.
fn tick_step(span: f64, most: usize) -> f64 {
    let raw = span / most as f64;
    let power = 10f64.powf(raw.log10().floor());
    let factor = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|f| f * power >= raw * 0.999);
    factor.unwrap_or(10.0) * power
}

/// Decimals that a multiple of `step` needs.
fn digits(step: f64) -> usize {
    (-step.log10().floor()).max(0.0) as usize
}

/// Horizontal bars, one for each stage, drawn from zero.
pub fn bars(name: &str, stages: &[(&str, f64)], decimals: usize) -> String {
    let row = 22.0;
    let (left, right) = (78.0, 268.0);
    let height = row * stages.len() as f64 + 4.0;
    let highest = stages.iter().fold(f64::MIN_POSITIVE, |m, (_, x)| m.max(*x));
    let mut svg = String::new();
    open(&mut svg, height, name);
    for (i, (stage, value)) in stages.iter().enumerate() {
        let y = 2.0 + row * i as f64;
        let length = (right - left) * (value / highest).clamp(0.0, 1.0);
        let class = if i + 1 == stages.len() {
            "after"
        } else {
            "earlier"
        };
        push(
            &mut svg,
            format_args!(
                r#"<text class="tick" text-anchor="end" x="{:.1}" y="{:.1}">{stage}</text><rect class="{class}" x="{left}" y="{y:.1}" width="{length:.1}" height="{:.1}" rx="2"/><text class="value" x="{:.1}" y="{:.1}">{}</text>"#,
                left - 7.0,
                y + 14.0,
                row - 5.0,
                left + length + 6.0,
                y + 14.0,
                number(*value, decimals)
            ),
        );
    }
    svg.push_str("</svg>");
    svg
}

fn open(svg: &mut String, height: f64, label: &str) {
    push(
        svg,
        format_args!(
            r#"<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{}">"#,
            escape(label)
        ),
    );
}

fn push(text: &mut String, arguments: std::fmt::Arguments) {
    // Writing into a String cannot fail.
    let _ = text.write_fmt(arguments);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round_and_few() {
        for (span, most, expected) in [(1.0, 5, 0.2), (37.0, 4, 10.0), (100.0, 4, 50.0)] {
            assert!((tick_step(span, most) - expected).abs() < 1e-12);
        }
        assert_eq!((digits(0.05), digits(0.2), digits(10.0)), (2, 1, 0));
    }

    #[test]
    fn a_histogram_of_nothing_is_still_a_picture() {
        let svg = histogram(&Histogram::continuous(&[], &[]), "x < y");
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>"));
        assert!(svg.contains("x &lt; y"));
    }
}
