//! The figures of all scans as one SVG: a small chart a figure, scans by their numbers in the order of their dates.
//!
//! Points are the figures; whiskers are the 95 % interval of the change against the first scan, about the first scan's
//! figure. A whisker that leaves the dashed line of the first figure is a change.

use crate::image::draw::text::number;
use crate::results::figures::serial::SCAN_FIGURES;
use crate::results::figures::{Figure, readable};
use crate::results::report::SerialReport;
use maud::{Markup, html};
use serde_json::Value;

/// Charts beside each other, and their size.
const COLUMNS: usize = 3;
const CHART_PX: [f64; 2] = [260.0, 150.0];
/// Left, top, right and bottom of the plotting area of a chart.
const PLOT_AREA_PX: [f64; 4] = [44.0, 26.0, 246.0, 122.0];
const INK_COLOUR: &str = "#1d2733";
const LINE_COLOUR: &str = "#b3202a";
const GRID_COLOUR: &str = "#d5dbe1";
/// Share of the range that is left free above and below.
const ROOM_SHARE: f64 = 0.12;

/// A figure of one scan.
struct Point {
    scan: usize,
    value: f64,
    /// Ends of the whisker; the first scan has none.
    whisker: Option<[f64; 2]>,
}

/// The picture; `None` if no figure is in two scans.
pub(super) fn picture(report: &SerialReport) -> Option<String> {
    let scans: Vec<Value> = report.scans.iter().map(readable).collect();
    let charts: Vec<(&Figure, Vec<Point>)> = (SCAN_FIGURES.iter())
        .map(|row| (row, points(report, &scans, row)))
        .filter(|(_, points)| points.len() > 1)
        .collect();
    if charts.is_empty() {
        return None;
    }
    let rows = charts.len().div_ceil(COLUMNS);
    let [width, height] = [COLUMNS as f64 * CHART_PX[0], rows as f64 * CHART_PX[1]];
    let markup = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox=(format_args!("0 0 {width} {height}")) width=(width) height=(height)
            role="img" font-family="sans-serif" font-size="11" fill=(INK_COLOUR) {
            title { "Figures of " (report.scans.len()) " scans" }
            rect width=(width) height=(height) fill="#ffffff" {}
            @for (place, (row, points)) in charts.iter().enumerate() {
                @let left = CHART_PX[0] * (place % COLUMNS) as f64;
                @let top = CHART_PX[1] * (place / COLUMNS) as f64;
                g transform=(format_args!("translate({left} {top})")) { (chart(report, row, points)) }
            }
        }
    };
    Some(format!("{}\n", markup.into_string()))
}

/// The figure of every scan that has it.
fn points(report: &SerialReport, scans: &[Value], row: &Figure) -> Vec<Point> {
    let values = scans.iter().enumerate();
    let values: Vec<(usize, f64)> = values
        .filter_map(|(place, scan)| Some((place + 1, row.value(scan)?)))
        .collect();
    let first = values.first().map_or(0.0, |(_, value)| *value);
    let point = |(scan, value)| Point {
        scan,
        value,
        whisker: (report.change(row.place, 1, scan)).map(|own| own.interval.map(|end| first + end)),
    };
    values.into_iter().map(point).collect()
}

fn chart(report: &SerialReport, row: &Figure, points: &[Point]) -> Markup {
    let ends = points.iter().flat_map(|point| {
        let [low, high] = point.whisker.unwrap_or([point.value; 2]);
        [low, high, point.value]
    });
    let [low, high] = ends.fold([f64::MAX, f64::MIN], |[low, high], end| {
        [low.min(end), high.max(end)]
    });
    let room = ROOM_SHARE * (high - low).max(1.0);
    let (low, high) = (low - room, high + room);
    let [left, top, right, bottom] = PLOT_AREA_PX;
    let last = report.scans.len() as f64;
    let x = |scan: usize| left + (right - left) * (scan as f64 - 0.5) / last;
    let y = |value: f64| bottom - (bottom - top) * (value - low) / (high - low);
    let line: Vec<String> = (points.iter())
        .map(|point| format!("{:.1},{:.1}", x(point.scan), y(point.value)))
        .collect();
    let first = points.first().map_or(low, |point| point.value);
    html! {
        text x=(left) y="15" font-weight="600" { (row.column()) }
        line x1=(left) x2=(right) y1=(bottom) y2=(bottom) stroke=(GRID_COLOUR) {}
        line x1=(left) x2=(right) y1=(tenth(y(first))) y2=(tenth(y(first))) stroke=(GRID_COLOUR) stroke-dasharray="4 3" {}
        @for value in [low + room, high - room] {
            text x=(left - 6.0) y=(tenth(y(value) + 4.0)) text-anchor="end" { (number(value, row.digits)) }
        }
        @for point in points {
            @if let Some([from, to]) = point.whisker {
                line x1=(tenth(x(point.scan))) x2=(tenth(x(point.scan))) y1=(tenth(y(from))) y2=(tenth(y(to)))
                    stroke=(INK_COLOUR) opacity="0.5" {}
            }
        }
        polyline points=(line.join(" ")) fill="none" stroke=(LINE_COLOUR) stroke-width="2" {}
        @for point in points {
            circle cx=(tenth(x(point.scan))) cy=(tenth(y(point.value))) r="3.5" fill=(LINE_COLOUR) {
                title { "Scan " (point.scan) ": " (row.written(point.value)) " " (row.unit.symbol) }
            }
        }
        @for point in points {
            text x=(tenth(x(point.scan))) y=(bottom + 16.0) text-anchor="middle" { (point.scan) }
        }
    }
}

fn tenth(x: f64) -> f64 {
    (10.0 * x).round() / 10.0
}
