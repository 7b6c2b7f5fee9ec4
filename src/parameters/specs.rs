//! The table of a model's parameters.

use super::table::number;
use super::{Kind, ParameterSpec};
use crate::optimise::{FitnessForm, Gain};
use crate::retile::{Geodesics, Method};
use crate::surface::{IsoLevel, Isolate, TopologyMode};
use serde_json::{Value, json};

/// Every parameter of a model, in the order in which the stages use them.
pub const SPECS: &[ParameterSpec] = &[
    ParameterSpec {
        name: "points",
        kind: Kind::Integer {
            min: 12,
            max: 50_000,
        },
        default: "150",
        summary: "Number of points of the model",
        read: |d, v| {
            d.retile.points = v.usize();
            Ok(())
        },
        write: |p| json!(p.retile.points),
    },
    ParameterSpec {
        name: "seed",
        kind: Kind::Integer {
            min: 0,
            max: u64::MAX,
        },
        default: "1",
        summary: "Seed of the random numbers; the same seed gives the same bytes",
        read: |d, v| {
            d.retile.seed = v.u64();
            Ok(())
        },
        write: |p| json!(p.retile.seed),
    },
    ParameterSpec {
        name: "starts",
        kind: Kind::Integer { min: 1, max: 16 },
        default: "",
        summary: "How many models are made, each from another seed, of which the best is kept \
                  (default for refined: 200 points in all, 1 to 4 models; 1 for paper)",
        read: |d, v| {
            d.starts = Some(v.usize());
            Ok(())
        },
        write: |p| json!(p.starts),
    },
    ParameterSpec {
        name: "frame",
        kind: Kind::Integer {
            min: 0,
            max: 1_000_000,
        },
        default: "",
        summary: "Which frame of a 4-D volume, counted from 0",
        read: |d, v| {
            d.frame = Some(v.usize());
            Ok(())
        },
        write: |p| json!(p.frame),
    },
    ParameterSpec {
        name: "iso",
        kind: Kind::Text {
            pattern: r"^(auto|[0-9.]+%|absolute:[-+0-9.eE]+)$",
            example: "auto, 50% (of the ventricle's maximum) or absolute:0.47",
        },
        default: "auto",
        summary: "Where the surface lies: auto, a share of the ventricle's maximum (50%), or an \
                  intensity (absolute:0.47)",
        read: |d, v| {
            d.surface.iso = parse_iso(v.text())?;
            Ok(())
        },
        write: |p| {
            json!(match p.surface.iso {
                IsoLevel::Auto => "auto".to_owned(),
                IsoLevel::Fraction(f) => format!("{}%", f * 100.0),
                IsoLevel::Absolute(x) => format!("absolute:{x}"),
            })
        },
    },
    ParameterSpec {
        name: "isolate",
        kind: Kind::Choice(&["auto", "none", "largest"]),
        default: "",
        summary: "Which part is the object: auto (the left ventricle, or the label map's \
                  label), none (all above the iso-value) or the largest component",
        read: |d, v| {
            let isolate = match v.text() {
                "none" => Isolate::None,
                "largest" => Isolate::Largest,
                _ => Isolate::Auto,
            };
            d.set_isolate("isolate", isolate);
            Ok(())
        },
        write: |p| match p.surface.isolate {
            Isolate::Auto => json!("auto"),
            Isolate::None => json!("none"),
            Isolate::Largest => json!("largest"),
            _ => Value::Null,
        },
    },
    ParameterSpec {
        name: "box",
        kind: Kind::Integers { count: 6 },
        default: "",
        summary: "Look for the object inside this box of voxels only: i0,j0,k0,i1,j1,k1, \
                  counted from 0, both corners included",
        read: |d, v| {
            let list = v.indices()?;
            let (first, last) = ([list[0], list[1], list[2]], [list[3], list[4], list[5]]);
            if (0..3).any(|axis| first[axis] > last[axis]) {
                return Err("the first corner lies beyond the last one".into());
            }
            d.set_isolate("box", Isolate::Box(first, last));
            Ok(())
        },
        write: |p| match p.surface.isolate {
            Isolate::Box([a, b, c], [d, e, f]) => json!([a, b, c, d, e, f]),
            _ => Value::Null,
        },
    },
    ParameterSpec {
        name: "seed_point",
        kind: Kind::Integers { count: 3 },
        default: "",
        summary: "Voxel i,j,k (counted from 0) that belongs to the object",
        read: |d, v| {
            let list = v.indices()?;
            d.set_isolate("seed_point", Isolate::Seed([list[0], list[1], list[2]]));
            Ok(())
        },
        write: |p| match p.surface.isolate {
            Isolate::Seed(voxel) => json!(voxel),
            _ => Value::Null,
        },
    },
    ParameterSpec {
        name: "label",
        kind: Kind::Integers { count: 1 },
        default: "",
        summary: "Value of the object's voxels in a label map",
        read: |d, v| {
            d.set_isolate("label", Isolate::Label(v.integers()[0]));
            Ok(())
        },
        write: |p| match p.surface.isolate {
            Isolate::Label(label) => json!(label),
            _ => Value::Null,
        },
    },
    ParameterSpec {
        name: "topology",
        kind: Kind::Choice(&["genus0", "keep"]),
        default: "genus0",
        summary: "genus0 removes handles, cavities and further components; keep leaves them",
        read: |d, v| {
            d.surface.topology = match v.text() {
                "keep" => TopologyMode::Keep,
                _ => TopologyMode::Genus0,
            };
            Ok(())
        },
        write: |p| {
            json!(match p.surface.topology {
                TopologyMode::Genus0 => "genus0",
                TopologyMode::Keep => "keep",
            })
        },
    },
    number!(
        "mask_smoothing",
        surface.mask_smoothing,
        0.0..=3.0,
        "0.8",
        "Gaussian sigma in voxels that smooths label maps before surfacing"
    ),
    ParameterSpec {
        name: "method",
        kind: Kind::Choice(&["paper", "refined"]),
        default: "refined",
        summary: "paper: repulsion and mutual tessellation on the surface; refined: centroidal \
                  points, their dual and a least-squares fit",
        read: |d, v| {
            d.retile.method = match v.text() {
                "paper" => Method::Paper,
                _ => Method::Refined,
            };
            Ok(())
        },
        write: |p| {
            json!(match p.retile.method {
                Method::Paper => "paper",
                Method::Refined => "refined",
            })
        },
    },
    ParameterSpec {
        name: "adaptive",
        kind: Kind::Number { min: 0.0, max: 1.0 },
        default: "",
        summary: "Denser points where the surface bends: spacing falls as curvature^-adaptive; \
                  0 is even (default 0.25 for refined, 0 for paper)",
        read: |d, v| {
            d.adaptive = Some(v.f64());
            Ok(())
        },
        write: |p| json!(p.retile.adaptive),
    },
    number!(
        "adaptive_from",
        retile.adaptive_from,
        0.0..=100.0,
        "0.8",
        "Rise of the surface over one edge of even spacing, in percent of its size, from \
         which on `adaptive` acts; 0 adapts everywhere"
    ),
    ParameterSpec {
        name: "repulsion_iterations",
        kind: Kind::Integer { min: 0, max: 1000 },
        default: "40",
        summary: "Rounds of geodesic repulsion",
        read: |d, v| {
            d.retile.repulsion_iterations = v.usize();
            Ok(())
        },
        write: |p| json!(p.retile.repulsion_iterations),
    },
    number!(
        "repulsion_strength",
        retile.repulsion_strength,
        0.001..=1.0,
        "0.15",
        "Share of an overlap that one round of repulsion moves"
    ),
    ParameterSpec {
        name: "geodesics",
        kind: Kind::Choice(&["approximate", "exact"]),
        default: "approximate",
        summary: "Distances along the surface that repulsion goes by (method paper): exact ones \
                  take many times longer and are for validation",
        read: |d, v| {
            d.retile.geodesics = match v.text() {
                "exact" => Geodesics::Exact,
                _ => Geodesics::Approximate,
            };
            Ok(())
        },
        write: |p| {
            json!(match p.retile.geodesics {
                Geodesics::Approximate => "approximate",
                Geodesics::Exact => "exact",
            })
        },
    },
    ParameterSpec {
        name: "relaxation_iterations",
        kind: Kind::Integer { min: 0, max: 1000 },
        default: "80",
        summary: "Most rounds of centroidal relaxation (method refined)",
        read: |d, v| {
            d.retile.relaxation_iterations = v.usize();
            Ok(())
        },
        write: |p| json!(p.retile.relaxation_iterations),
    },
    ParameterSpec {
        name: "fit_rounds",
        kind: Kind::Integer { min: 0, max: 200 },
        default: "",
        summary: "Rounds of the least-squares fit; 0 leaves the points on the surface (default \
                  16 for refined, 0 for paper)",
        read: |d, v| {
            d.fit_rounds = Some(v.usize());
            Ok(())
        },
        write: |p| json!(p.optimise.fit.rounds),
    },
    number!(
        "fit_shape_weight",
        optimise.fit.shape_weight,
        0.0001..=10.0,
        "0.06",
        "Weight of triangle shape against squared distance in the fit"
    ),
    number!(
        "fit_worst_weight",
        optimise.fit.worst_weight,
        0.0..=100.0,
        "3",
        "How much more a misshapen triangle counts in the fit"
    ),
    number!(
        "fit_free_size",
        optimise.fit.free_size,
        0.0..=1.0,
        "1",
        "How far the fit lets triangles choose their own size"
    ),
    number!(
        "fit_peak_weight",
        optimise.fit.peak_weight,
        0.0..=10.0,
        "0.02",
        "How much more a distant sample counts in the fit: lowers the largest distance"
    ),
    number!(
        "fit_bend_weight",
        optimise.fit.bend_weight,
        0.0..=10.0,
        "0.07",
        "Weight of an even bend in the fit, for triangles as small as a voxel: lowers the largest \
         distance and the angles between neighbours"
    ),
    number!(
        "fit_momentum",
        optimise.fit.momentum,
        0.0..=0.9,
        "0.6",
        "Share of its last step that a vertex repeats in a round of the fit"
    ),
    number!(
        "fit_midpoint_weight",
        optimise.fit.midpoint_weight,
        0.0..=10.0,
        "1",
        "Weight of the model's own edge midpoints in the fit"
    ),
    number!(
        "fit_damping",
        optimise.fit.damping,
        0.000001..=1.0,
        "0.0005",
        "Weight of staying put in a round of the fit"
    ),
    ParameterSpec {
        name: "fit_samples",
        kind: Kind::Integer { min: 4, max: 200 },
        default: "16",
        summary: "Samples of the surface for each of the model's triangles in the fit",
        read: |d, v| {
            d.optimise.fit.samples_per_triangle = v.usize();
            Ok(())
        },
        write: |p| json!(p.optimise.fit.samples_per_triangle),
    },
    ParameterSpec {
        name: "fit_glide",
        kind: Kind::Integer { min: 0, max: 4 },
        default: "3",
        summary: "How many flips the fit looks ahead to let irregular vertices cancel",
        read: |d, v| {
            d.optimise.fit.glide = v.usize();
            Ok(())
        },
        write: |p| json!(p.optimise.fit.glide),
    },
    ParameterSpec {
        name: "fitness",
        kind: Kind::Choice(&["raw", "normalised", "robust"]),
        default: "normalised",
        summary: "Form of the fitness that drives the flips: the paper's raw reciprocals, each term \
                  between 0 and 1, or reciprocals floored at 1 degree and 0.01 mm",
        read: |d, v| {
            d.optimise.fitness = match v.text() {
                "raw" => FitnessForm::Raw,
                "robust" => FitnessForm::Robust,
                _ => FitnessForm::Normalised,
            };
            Ok(())
        },
        write: |p| {
            json!(match p.optimise.fitness {
                FitnessForm::Raw => "raw",
                FitnessForm::Normalised => "normalised",
                FitnessForm::Robust => "robust",
            })
        },
    },
    number!(
        "w1",
        optimise.weights[0],
        0.0..=1000.0,
        "1",
        "Weight of smoothness between an edge's two triangles"
    ),
    number!(
        "w2",
        optimise.weights[1],
        0.0..=1000.0,
        "1",
        "Weight of smoothness to the neighbouring triangles"
    ),
    number!(
        "w3",
        optimise.weights[2],
        0.0..=1000.0,
        "1",
        "Weight of the triangles' aspect ratio"
    ),
    number!(
        "w4",
        optimise.weights[3],
        0.0..=1000.0,
        "1",
        "Weight of the distance to the original surface"
    ),
    ParameterSpec {
        name: "gain",
        kind: Kind::Choice(&["local", "total"]),
        default: "total",
        summary: "What a flip must raise: the pair's own fitness (the paper) or the mesh's",
        read: |d, v| {
            d.optimise.gain = match v.text() {
                "local" => Gain::Local,
                _ => Gain::Total,
            };
            Ok(())
        },
        write: |p| {
            json!(match p.optimise.gain {
                Gain::Local => "local",
                Gain::Total => "total",
            })
        },
    },
    number!(
        "guard",
        optimise.guard,
        0.0..=1.0,
        "0.9",
        "Radius ratio 2r/R below which a flip may not make a triangle, unless it \
         replaces one as bad; 0 lets slivers pass"
    ),
];

fn parse_iso(text: &str) -> Result<IsoLevel, String> {
    let finite = |t: &str| t.parse::<f64>().ok().filter(|x| x.is_finite());
    if text == "auto" {
        return Ok(IsoLevel::Auto);
    }
    if let Some(value) = text.strip_prefix("absolute:").and_then(finite) {
        return Ok(IsoLevel::Absolute(value));
    }
    match text.strip_suffix('%').and_then(finite) {
        Some(percent) if percent > 0.0 && percent < 100.0 => {
            Ok(IsoLevel::Fraction(percent / 100.0))
        }
        Some(percent) => Err(format!("{percent} % does not lie between 0 % and 100 %")),
        None => Err(format!("`{text}` is none of the three forms")),
    }
}
