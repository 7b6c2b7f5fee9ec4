//! Figures of a ventricle that follow from what it was made of: volumes, uptake, motion, thickening and phase.
//!
//! "Fine" figures come from single phases of the beat, those of gates from means over a gate's phases. Figures of
//! segments are means by the area of the inner surface at end diastole. Thickness is across the wall, material point
//! by material point; motion is along the normal at end diastole, inward, without the shift of the outer surface's
//! middle. Late segments thicken less between the heart's own end diastole and end systole than by themselves.

use super::anatomy::Vec3;
use super::anatomy::material::{self, Map, RINGS, SPOKES, metric};
use super::anatomy::ventricle::{Phase, Ventricle};
use super::curve::PeriodicCurve;
use super::files::merge;
use serde_json::{Map as Object, Value, json};
use std::f64::consts::TAU;
use std::ops::Range;

/// Loss of uptake from which wall counts as abnormal, and over which its deficit grows to the whole.
const ABNORMAL_LOSS: f64 = 0.15;
const WHOLE_DEFICIT_AFTER: f64 = 0.55;
/// Contraction below which a segment is dyskinetic, akinetic, hypokinetic.
const STATES: [(f64, &str); 3] = [
    (-0.05, "dyskinetic"),
    (0.25, "akinetic"),
    (0.7, "hypokinetic"),
];
/// Least contraction, and least amplitude over the median one, of points that have a phase.
const LEAST_CONTRACTION: f64 = 0.4;
const LEAST_AMPLITUDE: f64 = 0.3;
/// Share of the wall within the bandwidth of the phase.
const BANDWIDTH_SHARE: f64 = 0.95;
const SEPTUM: [usize; 5] = [2, 3, 8, 9, 14];
const LATERAL: [usize; 5] = [5, 6, 11, 12, 16];
/// Times at which the volume curve is looked at.
const CURVE_TIMES: usize = 960;

/// The largest and the smallest of numbers.
pub fn largest_and_smallest(values: &[f64]) -> [f64; 2] {
    let largest = values.iter().copied().fold(f64::MIN, f64::max);
    [largest, values.iter().copied().fold(f64::MAX, f64::min)]
}

/// Mean uptake of the muscle of each AHA segment, by name.
pub fn segment_uptake(ventricle: &Ventricle) -> Value {
    let volume = Map::from_index(|at| {
        if !ventricle.is_wall(at) {
            return 0.0;
        }
        let mu = material::mu(at);
        let lambdas = [ventricle.outer.0[at], ventricle.inner.0[at]];
        let [outer, inner] = lambdas.map(|lambda| material::column(lambda, mu));
        (outer - inner) * mu.sin()
    });
    by_name(&of_segments(ventricle, &ventricle.uptake, &volume))
}

/// How much uptake defects take: shares of the wall, in per cent, and of each segment.
pub fn perfusion(ventricle: &Ventricle) -> Value {
    let areas = ventricle.areas();
    let loss = loss(ventricle);
    let percent =
        |of: &dyn Fn(f64) -> f64| 100.0 * Map(loss.0.iter().map(|l| of(*l)).collect()).mean(&areas);
    json!({
        "extent_percent": percent(&|l| f64::from(u8::from(l > ABNORMAL_LOSS))),
        "mean_deficit_percent": percent(&|l| l),
        "deficit_percent": percent(&|l| ((l - ABNORMAL_LOSS) / WHOLE_DEFICIT_AFTER).clamp(0.0, 1.0)),
        "segment_deficit": by_name(&of_segments(ventricle, &loss, &areas)),
    })
}

/// The share of the uptake that defects take from each point.
pub fn loss(ventricle: &Ventricle) -> Map {
    Map::from_index(|at| 1.0 - ventricle.uptake.0[at] / ventricle.healthy_uptake.0[at].max(1e-6))
}

/// The means of a map over the AHA segments.
pub fn of_segments(ventricle: &Ventricle, values: &Map, weights: &Map) -> [f64; 17] {
    let (mut sums, mut totals) = ([0.0; 17], [0.0; 17]);
    for (at, segment) in ventricle.segment.iter().enumerate() {
        sums[segment - 1] += values.0[at] * weights.0[at];
        totals[segment - 1] += weights.0[at];
    }
    std::array::from_fn(|k| sums[k] / totals[k].max(1e-9))
}

/// Numbers of segments by their names.
pub fn by_name(values: &[f64; 17]) -> Value {
    let named = values
        .iter()
        .enumerate()
        .map(|(k, v)| ((k + 1).to_string(), json!(v)));
    Value::Object(named.collect::<Object<_, _>>())
}

/// Thickness over the wall and the beat, mm.
pub fn mean_thickness_mm(ventricle: &Ventricle) -> f64 {
    let areas = ventricle.areas();
    let each =
        (0..ventricle.phases.len()).map(|p| points(ventricle, p..p + 1).thickness.mean(&areas));
    each.sum::<f64>() / ventricle.phases.len() as f64
}

/// The surfaces of some phases, averaged material point by material point.
struct Points {
    inner: Vec<Vec3>,
    outer: Vec<Vec3>,
    thickness: Map,
}

fn points(ventricle: &Ventricle, phases: Range<usize>) -> Points {
    let count = phases.len() as f64;
    let mut mean = Points {
        inner: vec![Vec3::zeros(); RINGS * SPOKES],
        outer: vec![Vec3::zeros(); RINGS * SPOKES],
        thickness: Map::filled(0.0),
    };
    for phase in &ventricle.phases[phases] {
        let [inner, outer] = [&phase.inner, &phase.outer].map(|lambda| surface(phase, lambda));
        let middle: Vec<Vec3> = inner
            .iter()
            .zip(&outer)
            .map(|(a, b)| (a + b) / 2.0)
            .collect();
        let thickness = thickness(phase, &middle);
        for at in 0..RINGS * SPOKES {
            mean.inner[at] += inner[at] / count;
            mean.outer[at] += outer[at] / count;
            mean.thickness.0[at] += thickness.0[at] / count;
        }
    }
    mean
}

/// Points of a surface, mm along lateral, anterior and apex.
fn surface(phase: &Phase, lambda: &Map) -> Vec<Vec3> {
    let point = |(at, lambda): (usize, &f64)| {
        let (mu, theta) = (material::mu(at), material::theta(at));
        let across = phase.focal_mm * lambda.sinh() * mu.sin();
        let along = phase.focal_mm * lambda.cosh() * mu.cos() + phase.shift_mm;
        Vec3::new(across * theta.cos(), across * theta.sin(), along)
    };
    lambda.0.iter().enumerate().map(point).collect()
}

/// Thickness across the wall, mm: along the coordinate line, by the cosine to the middle surface's normal.
fn thickness(phase: &Phase, middle: &[Vec3]) -> Map {
    let normals = normals(middle);
    let mut cosine = Map::from_index(|at| {
        let (mu, theta) = (material::mu(at), material::theta(at));
        let lambda = f64::midpoint(phase.inner.0[at], phase.outer.0[at]);
        let [r, z] = [lambda.cosh() * mu.sin(), lambda.sinh() * mu.cos()];
        let line = Vec3::new(r * theta.cos(), r * theta.sin(), z).normalize();
        normals[at].dot(&line).abs()
    });
    // Normals at the pole are those of its neighbours.
    let near = cosine.ring_mean(2);
    cosine.0[..2 * SPOKES].fill(near);
    Map::from_index(|at| {
        let [inner, outer] = [phase.inner.0[at], phase.outer.0[at]];
        let mm = phase.focal_mm * metric(f64::midpoint(inner, outer), material::mu(at));
        (outer - inner) * mm * cosine.0[at]
    })
}

/// Outward unit normals of a surface.
fn normals(points: &[Vec3]) -> Vec<Vec3> {
    let at = |ring: usize, spoke: usize| points[ring * SPOKES + spoke];
    let raw: Vec<Vec3> = (0..RINGS * SPOKES)
        .map(|k| {
            let (ring, spoke) = (k / SPOKES, k % SPOKES);
            let along = at((ring + 1).min(RINGS - 1), spoke) - at(ring.saturating_sub(1), spoke);
            let around = at(ring, (spoke + 1) % SPOKES) - at(ring, (spoke + SPOKES - 1) % SPOKES);
            along
                .cross(&around)
                .try_normalize(1e-12)
                .unwrap_or_else(Vec3::zeros)
        })
        .collect();
    let height = points.iter().map(|p| p.z).sum::<f64>() / points.len() as f64;
    let outward: f64 = raw
        .iter()
        .zip(points)
        .map(|(n, p)| n.dot(&(p - height * Vec3::z())))
        .sum();
    raw.iter().map(|n| n * outward.signum()).collect()
}

/// What changes from some phases to others, by segment.
struct Change {
    thickening_percent: [f64; 17],
    motion_mm: [f64; 17],
    unshifted_mm: [f64; 17],
    thickness_mm: [f64; 17],
    shift: Vec3,
}

fn change(ventricle: &Ventricle, from: Range<usize>, to: Range<usize>, areas: &Map) -> Change {
    let (before, after) = (points(ventricle, from), points(ventricle, to));
    let normals = normals(&before.inner);
    let total: f64 = areas.0.iter().sum();
    let moved = (before.outer.iter().zip(&after.outer)).map(|(a, b)| b - a);
    let shift: Vec3 = moved
        .zip(&areas.0)
        .map(|(v, area)| v * (area / total))
        .sum();
    let inward = |without: Vec3| {
        Map::from_index(|at| -(after.inner[at] - before.inner[at] - without).dot(&normals[at]))
    };
    let thickening =
        Map::from_index(|at| 100.0 * (after.thickness.0[at] / before.thickness.0[at] - 1.0));
    let mean = |map: &Map| of_segments(ventricle, map, areas);
    Change {
        thickening_percent: mean(&thickening),
        motion_mm: mean(&inward(shift)),
        unshifted_mm: mean(&inward(Vec3::zeros())),
        thickness_mm: mean(&before.thickness),
        shift,
    }
}

/// The phase of the first harmonic of the thickness, point by point.
struct Phases {
    /// cos and sin of the phase of each point.
    turns: Vec<[f64; 2]>,
    degrees: Vec<f64>,
    /// 0 of points that do not move.
    weights: Map,
}

impl Phases {
    fn new(ventricle: &Ventricle, thickness: &[Map], areas: &Map) -> Self {
        let count = thickness.len() as f64;
        let harmonic = |at: usize| {
            let each = thickness.iter().enumerate().map(|(phase, map)| {
                let angle = TAU * (phase as f64 + 0.5) / count;
                [map.0[at] * angle.cos(), map.0[at] * angle.sin()]
            });
            each.fold([0.0, 0.0], |[a, b], [c, d]| {
                [a + 2.0 * c / count, b + 2.0 * d / count]
            })
        };
        let waves: Vec<[f64; 2]> = (0..RINGS * SPOKES).map(harmonic).collect();
        let size = |at: usize| waves[at][0].hypot(waves[at][1]);
        let mut sizes: Vec<f64> = (0..waves.len())
            .filter(|at| areas.0[*at] > 1e-9)
            .map(size)
            .collect();
        sizes.sort_by(f64::total_cmp);
        let least = LEAST_AMPLITUDE * sizes[sizes.len() / 2];
        let weights = Map::from_index(|at| {
            let moves = size(at) > least && ventricle.contraction.0[at] > LEAST_CONTRACTION;
            if moves { areas.0[at] * size(at) } else { 0.0 }
        });
        let degrees: Vec<f64> = waves
            .iter()
            .map(|[a, b]| b.atan2(*a).to_degrees())
            .collect();
        let turns = degrees
            .iter()
            .map(|d| [d.to_radians().cos(), d.to_radians().sin()])
            .collect();
        Self {
            turns,
            degrees,
            weights,
        }
    }

    /// The mean of the points that `wanted` has, degrees; `None` if none of them moves.
    fn mean(&self, wanted: impl Fn(usize) -> bool) -> Option<f64> {
        let (mut sum, mut total) = ([0.0, 0.0], 0.0);
        for at in (0..self.turns.len()).filter(|at| wanted(*at)) {
            let weight = self.weights.0[at];
            sum = [0, 1].map(|i| sum[i] + weight * self.turns[at][i]);
            total += weight;
        }
        (total > 0.0).then(|| sum[1].atan2(sum[0]).to_degrees())
    }

    fn figures(&self, ventricle: &Ventricle) -> Value {
        let mean = self.mean(|_| true).unwrap_or(0.0);
        let mut off: Vec<[f64; 2]> = (self.degrees.iter().zip(&self.weights.0))
            .filter(|(_, weight)| **weight > 0.0)
            .map(|(degrees, weight)| [half_turn(degrees - mean), *weight])
            .collect();
        let total: f64 = off.iter().map(|[_, w]| w).sum();
        let variance = off.iter().map(|[d, w]| w * d * d).sum::<f64>() / total;
        off.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let wall = |segments: [usize; 5]| {
            self.mean(|at| segments.contains(&ventricle.segment[at]))
                .unwrap_or(0.0)
        };
        json!({
            "mean_degrees": mean.rem_euclid(360.0),
            "sd_degrees": variance.sqrt(),
            "bandwidth_degrees": bandwidth(&off, total),
            "septum_minus_lateral_degrees": half_turn(wall(SEPTUM) - wall(LATERAL)),
        })
    }
}

/// The narrowest range that holds most of the weight, of pairs of a value and a weight, rising.
fn bandwidth(sorted: &[[f64; 2]], total: f64) -> f64 {
    let mut narrowest = 360.0_f64;
    let (mut end, mut held) = (0, 0.0);
    for start in 0..sorted.len() {
        while end < sorted.len() && held < BANDWIDTH_SHARE * total {
            held += sorted[end][1];
            end += 1;
        }
        if held < BANDWIDTH_SHARE * total {
            break;
        }
        narrowest = narrowest.min(sorted[end - 1][0] - sorted[start][0]);
        held -= sorted[start][1];
    }
    narrowest
}

/// An angle in -180 to 180.
fn half_turn(degrees: f64) -> f64 {
    (degrees + 180.0).rem_euclid(360.0) - 180.0
}

/// Every figure of a beat in so many gates.
pub fn beat(ventricle: &Ventricle, gates: usize) -> Value {
    let (cavity, walls) = (ventricle.cavity_ml(), ventricle.wall_ml());
    let per_gate = cavity.len() / gates;
    let of_gates = |values: &[f64]| -> Vec<f64> {
        let each = values.chunks_exact(per_gate);
        each.map(|gate| gate.iter().sum::<f64>() / per_gate as f64)
            .collect()
    };
    let (gate_cavity, gate_walls) = (of_gates(&cavity), of_gates(&walls));
    let [edv, esv] = largest_and_smallest(&cavity);
    let [gate_edv, gate_esv] = largest_and_smallest(&gate_cavity);
    let [ed_gate, es_gate] = [gate_edv, gate_esv].map(|ml| position(&gate_cavity, ml));
    let mut truth = json!({
        "edv_ml": edv,
        "esv_ml": esv,
        "sv_ml": edv - esv,
        "ef": 1.0 - esv / edv,
        "gates": gates,
        "gate_edv_ml": gate_edv,
        "gate_esv_ml": gate_esv,
        "gate_ef": 1.0 - gate_esv / gate_edv,
        "end_diastole_gate": ed_gate,
        "end_systole_gate": es_gate,
        "cavity_ml": gate_cavity,
        "wall_ml": gate_walls,
        "phases": cavity.len(),
        "phases_cavity_ml": cavity,
        "phases_wall_ml": walls,
        "mean_cavity_ml": cavity.iter().sum::<f64>() / cavity.len() as f64,
        "wall_thickness_mean_mm": mean_thickness_mm(ventricle),
        "aha17_uptake": segment_uptake(ventricle),
        "perfusion": perfusion(ventricle),
    });
    merge(&mut truth, rates(ventricle, &cavity, edv));
    let gate = |gate: usize| gate * per_gate..(gate + 1) * per_gate;
    let [ed, es] = [edv, esv].map(|ml| position(&cavity, ml));
    let ends = [ed..ed + 1, es..es + 1];
    merge(
        &mut truth,
        segments(ventricle, ends, [gate(ed_gate), gate(es_gate)]),
    );
    truth
}

fn position(values: &[f64], wanted: f64) -> usize {
    values.iter().position(|v| *v == wanted).unwrap_or(0)
}

/// End systole and the rates of the volume curve.
fn rates(ventricle: &Ventricle, cavity: &[f64], edv: f64) -> Value {
    let count = cavity.len() as f64;
    let points: Vec<[f64; 2]> = (cavity.iter().enumerate())
        .map(|(phase, ml)| [(phase as f64 + 0.5) / count, *ml])
        .collect();
    let curve = PeriodicCurve::new(&points);
    let seconds = ventricle.heart.beat.curve.rr_ms / 1000.0;
    let samples: Vec<(f64, f64, f64)> = (0..CURVE_TIMES)
        .map(|k| {
            let time = k as f64 / CURVE_TIMES as f64;
            let (value, slope) = curve.at(time);
            (time, value, slope / seconds / edv)
        })
        .collect();
    let least = |key: &dyn Fn(&(f64, f64, f64)) -> f64| {
        let best = samples.iter().min_by(|a, b| key(a).total_cmp(&key(b)));
        best.copied().unwrap_or_default()
    };
    let (end_systole, _, _) = least(&|s| s.1);
    let (_, _, ejection) = least(&|s| s.2);
    let (filled, _, filling) = least(&|s| -s.2);
    json!({
        "end_systole_cycle": end_systole,
        "peak_ejection_edv_per_s": -ejection,
        "peak_filling_edv_per_s": filling,
        "time_to_peak_filling_ms": (filled - end_systole).rem_euclid(1.0) * seconds * 1000.0,
    })
}

/// Figures of the 17 segments, and of the phase.
fn segments(ventricle: &Ventricle, fine: [Range<usize>; 2], gated: [Range<usize>; 2]) -> Value {
    let areas = ventricle.areas();
    let [from, to] = fine;
    let own = change(ventricle, from, to, &areas);
    let [from, to] = gated;
    let by_gates = change(ventricle, from, to, &areas);
    let thickness: Vec<Map> = (0..ventricle.phases.len())
        .map(|phase| points(ventricle, phase..phase + 1).thickness)
        .collect();
    let through: Vec<[f64; 17]> = thickness
        .iter()
        .map(|map| of_segments(ventricle, map, &areas))
        .collect();
    let phases = Phases::new(ventricle, &thickness, &areas);
    let contraction = of_segments(ventricle, &ventricle.contraction, &areas);
    let delay = of_segments(ventricle, &ventricle.delay, &areas);
    let uptake = segment_uptake(ventricle);
    let total: f64 = areas.0.iter().sum();
    let mut still = Vec::new();
    let all: Vec<Value> = (0..17)
        .map(|k| {
            let state = STATES.iter().find(|(limit, _)| contraction[k] < *limit);
            let state = state.map_or("normal", |(_, name)| name);
            if contraction[k] < STATES[1].0 {
                still.push(k + 1);
            }
            let of_segment = |at: usize| ventricle.segment[at] == k + 1;
            let area: f64 = (0..RINGS * SPOKES)
                .filter(|at| of_segment(*at))
                .map(|at| areas.0[at])
                .sum();
            let beat: Vec<f64> = through.iter().map(|mm| mm[k]).collect();
            let [most, least] = largest_and_smallest(&beat);
            json!({
                "segment": k + 1,
                "wall_percent": 100.0 * area / total,
                "thickness_ed_mm": own.thickness_mm[k],
                "contraction": contraction[k],
                "state": state,
                "thickening_percent": own.thickening_percent[k],
                "thickening_gates_percent": by_gates.thickening_percent[k],
                "thickening_own_percent": 100.0 * (most / least - 1.0),
                "motion_mm": own.motion_mm[k],
                "motion_gates_mm": by_gates.motion_mm[k],
                "motion_unshifted_mm": own.unshifted_mm[k],
                "delay_degrees": delay[k],
                "phase_degrees": phases.mean(of_segment).map(|d| d.rem_euclid(360.0)),
                "uptake": uptake[(k + 1).to_string()],
            })
        })
        .collect();
    json!({
        "heart_shift_mm": [own.shift.x, own.shift.y, own.shift.z],
        "segments": all,
        "akinetic": still,
        "phase": phases.figures(ventricle),
    })
}
