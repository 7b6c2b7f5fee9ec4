//! The volume curve and the phase histogram as SVG.

use crate::results::report::BeatReport;
use maud::{Markup, html};

/// Width and height of a picture.
const SIZE_PX: [f64; 2] = [560.0, 320.0];
/// Left, top, right and bottom of the plotting area.
const PLOT_AREA_PX: [f64; 4] = [56.0, 18.0, 544.0, 272.0];
const INK_COLOUR: &str = "#1d2733";
const CURVE_COLOUR: &str = "#b3202a";
const GRID_COLOUR: &str = "#d5dbe1";

/// The volume curve with the gates and marks at end diastole and end systole.
pub(super) fn curve(report: &BeatReport) -> String {
    let volumes = report.curve.iter().map(|point| point.cavity_ml);
    let largest = volumes.fold(1.0, f64::max);
    let step = crate::base::numeric::round_step::round_step(largest / 4.0);
    let top = (largest / step).ceil() * step;
    let x = |degrees: f64| PLOT_AREA_PX[0] + (PLOT_AREA_PX[2] - PLOT_AREA_PX[0]) * degrees / 360.0;
    let y = |ml: f64| PLOT_AREA_PX[3] - (PLOT_AREA_PX[3] - PLOT_AREA_PX[1]) * ml / top;
    let first = report.curve.first();
    let closed = first.map(|point| (360.0, point.cavity_ml));
    let points: Vec<String> = (report.curve.iter())
        .map(|point| (point.degrees, point.cavity_ml))
        .chain(closed)
        .map(|(degrees, ml)| format!("{:.1},{:.1}", x(degrees), y(ml)))
        .collect();
    let width = 360.0 / report.gates.len() as f64;
    let marks = [
        ("ED", report.end_diastole_degrees, report.edv_ml),
        ("ES", report.end_systole_degrees, report.esv_ml),
    ];
    let levels = (0..=(top / step).round() as usize).map(|n| n as f64 * step);
    let title = match report.ef_percent {
        Some(ef) => format!(
            "Volume of the cavity over the beat: EDV {:.0} ml, ESV {:.0} ml, EF {ef:.0} %",
            report.edv_ml, report.esv_ml
        ),
        None => "Volume of the cavity over the gates: they show no beat".to_owned(),
    };
    let content = html! {
        @for ml in levels {
            line x1=(PLOT_AREA_PX[0]) x2=(PLOT_AREA_PX[2]) y1=(tenth(y(ml))) y2=(tenth(y(ml))) stroke=(GRID_COLOUR) {}
            text x=(PLOT_AREA_PX[0] - 8.0) y=(tenth(y(ml) + 4.0)) text-anchor="end" { (ml) }
        }
        @for gate in &report.gates {
            @let from = width * (gate.gate - 1) as f64;
            line x1=(tenth(x(from) + 3.0)) x2=(tenth(x(from + width) - 3.0))
                y1=(tenth(y(gate.cavity_ml))) y2=(tenth(y(gate.cavity_ml)))
                stroke=(INK_COLOUR) stroke-width="2" opacity="0.55" {
                title { "Gate " (gate.gate) ": " (format_args!("{:.1} ml", gate.cavity_ml)) }
            }
            text x=(tenth(x(from + width / 2.0))) y=(PLOT_AREA_PX[3] + 16.0) text-anchor="middle" { (gate.gate) }
        }
        polyline points=(points.join(" ")) fill="none" stroke=(CURVE_COLOUR) stroke-width="2.5" {}
        @for (name, degrees, ml) in marks {
            circle cx=(tenth(x(degrees))) cy=(tenth(y(ml))) r="4.5" fill=(CURVE_COLOUR) {}
            text x=(tenth(x(degrees).clamp(PLOT_AREA_PX[0] + 14.0, PLOT_AREA_PX[2] - 14.0))) y=(tenth(y(ml) - 9.0)) text-anchor="middle" font-weight="600" { (name) }
        }
        text x=(f64::midpoint(PLOT_AREA_PX[0], PLOT_AREA_PX[2])) y=(SIZE_PX[1] - 10.0) text-anchor="middle" { "gate" }
        text x="14" y=(PLOT_AREA_PX[1] - 4.0) { "ml" }
    };
    picture(&title, &content)
}

/// The histogram of the wall's phases.
pub(super) fn phase(report: &BeatReport) -> String {
    let phase = &report.phase;
    let highest = phase.histogram.iter().copied().fold(0.01, f64::max);
    let step = crate::base::numeric::round_step::round_step(100.0 * highest / 4.0);
    let top = (100.0 * highest / step).ceil() * step;
    let x = |degrees: f64| PLOT_AREA_PX[0] + (PLOT_AREA_PX[2] - PLOT_AREA_PX[0]) * degrees / 360.0;
    let y = |percent: f64| PLOT_AREA_PX[3] - (PLOT_AREA_PX[3] - PLOT_AREA_PX[1]) * percent / top;
    let levels = (0..=(top / step).round() as usize).map(|n| n as f64 * step);
    let title = format!(
        "Phases of the wall: mean {:.0}, deviation {:.0}, bandwidth {:.0} degrees{}",
        phase.mean_degrees,
        phase.sd_degrees,
        phase.bandwidth_degrees,
        if phase.reliable { "" } else { "; unreliable" }
    );
    let content = html! {
        @for percent in levels {
            line x1=(PLOT_AREA_PX[0]) x2=(PLOT_AREA_PX[2]) y1=(tenth(y(percent))) y2=(tenth(y(percent))) stroke=(GRID_COLOUR) {}
            text x=(PLOT_AREA_PX[0] - 8.0) y=(tenth(y(percent) + 4.0)) text-anchor="end" { (percent) }
        }
        @for (bin, share) in phase.histogram.iter().enumerate().filter(|(_, share)| **share > 0.0) {
            @let from = phase.bin_degrees * bin as f64;
            @let height = PLOT_AREA_PX[3] - y(100.0 * share);
            rect x=(tenth(x(from))) y=(tenth(y(100.0 * share))) fill=(CURVE_COLOUR)
                width=(tenth(x(phase.bin_degrees) - x(0.0) - 1.0)) height=(tenth(height)) {}
        }
        @for degrees in [0, 90, 180, 270, 360] {
            text x=(tenth(x(f64::from(degrees)))) y=(PLOT_AREA_PX[3] + 16.0) text-anchor="middle" { (degrees) }
        }
        text x=(f64::midpoint(PLOT_AREA_PX[0], PLOT_AREA_PX[2])) y=(SIZE_PX[1] - 10.0) text-anchor="middle" { "degrees \
            of the cycle" }
        text x="14" y=(PLOT_AREA_PX[1] - 4.0) { "% of the wall" }
    };
    picture(&title, &content)
}

fn picture(title: &str, content: &Markup) -> String {
    let [width, height] = SIZE_PX;
    let markup = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox=(format_args!("0 0 {width} {height}"))
            width=(width) height=(height) role="img" font-family="sans-serif" font-size="12" fill=(INK_COLOUR) {
            title { (title) }
            rect width=(width) height=(height) fill="#ffffff" {}
            (content)
        }
    };
    format!("{}\n", markup.into_string())
}

fn tenth(x: f64) -> f64 {
    (10.0 * x).round() / 10.0
}
