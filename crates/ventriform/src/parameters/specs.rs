//! The table of the parameters of a model.

use super::model::ModelDraft;
use super::table::{choice, integer, number, optional, optional_choice, titled};
use super::{Kind, ModelParameters, ParameterError, ParameterSpec, Parameters, groups};
use crate::surface::optimise::{FitnessForm, Gain};
use crate::surface::retile::{Geodesics, Method};
use crate::surface::{Denoise, IsoLevel, Isolate, TopologyMode};
use serde_json::{Value, json};

impl Parameters for ModelParameters {
    type Draft = ModelDraft;

    const PARAMETER_SPECS: &'static [ParameterSpec<Self>] = MODEL_SPECS;

    fn finish(draft: ModelDraft) -> Result<Self, ParameterError> {
        Self::settle(draft)
    }
}

/// Every parameter of a model, in the order in which the stages use them.
pub const MODEL_SPECS: &[ParameterSpec<ModelParameters>] = &[
    integer!(
        "points",
        retile.points,
        12..=50_000,
        "150",
        groups::MAIN,
        "",
        "Number of points of the model"
    ),
    ParameterSpec {
        name: "seed",
        title: "",
        group: groups::REPEATS,
        unit: "",
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
    optional!(
        Integer usize,
        "starts",
        starts => starts,
        1..=16,
        groups::REPEATS,
        "",
        "Number of models to make, each from another seed; the best is kept (default for refined: \
         200 points in all, 1 to 4 models; for paper: 1)"
    ),
    optional!(
        Integer usize,
        "frame",
        frame => frame,
        0..=1_000_000,
        groups::REPEATS,
        "",
        "Frame of a 4-D volume or gate, counted from 0 (0 is the first); without it, the gates of a \
         heart beat are summed"
    ),
    ParameterSpec {
        name: "iso",
        title: "Iso-value",
        group: groups::MAIN,
        unit: "",
        kind: Kind::Text {
            pattern: r"^(auto|[0-9.]+%|(absolute|below):[-+0-9.eE]+)$",
            example: "auto, 50% (of the ventricle's maximum), absolute:0.47 or below:0",
        },
        default: "auto",
        summary: "Iso-value of the surface: auto, a percentage of the ventricle's maximum (50%), an \
                  intensity (absolute:0.47), or an intensity below which the object lies (below:0, for \
                  signed distances and objects darker than their surroundings)",
        read: |d, v| {
            d.surface.iso = parse_iso(v.text())?;
            Ok(())
        },
        write: |p| {
            json!(match p.surface.iso {
                IsoLevel::Auto => "auto".to_owned(),
                IsoLevel::Fraction(f) => format!("{}%", f * 100.0),
                IsoLevel::Absolute(x) => format!("absolute:{x}"),
                IsoLevel::Below(x) => format!("below:{x}"),
            })
        },
    },
    ParameterSpec {
        name: "isolate",
        title: "",
        group: groups::OBJECT,
        unit: "",
        kind: Kind::Choice(&["auto", "none", "largest"]),
        default: "",
        summary: "Which part of the volume is the object: auto (the left ventricle, or the label of \
                  a label map), none (everything above the iso-value) or largest (the largest \
                  component)",
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
        title: "",
        group: groups::OBJECT,
        unit: "",
        kind: Kind::Integers { count: 6 },
        default: "",
        summary: "Search for the object only inside this box of voxels: i0,j0,k0,i1,j1,k1, counted \
                  from 0, both corners included",
        read: |d, v| {
            let [first, last] = v.corners()?;
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
        title: "",
        group: groups::OBJECT,
        unit: "",
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
        title: "",
        group: groups::OBJECT,
        unit: "",
        kind: Kind::Integers { count: 1 },
        default: "",
        summary: "Label of the object in a label map; 0 and negative ones too",
        read: |d, v| {
            d.set_isolate("label", Isolate::Label(v.integers()[0]));
            Ok(())
        },
        write: |p| match p.surface.isolate {
            Isolate::Label(label) => json!(label),
            _ => Value::Null,
        },
    },
    choice!(
        "topology",
        surface.topology,
        "genus0",
        groups::OBJECT,
        "genus0 removes handles, enclosed cavities and all but one component; keep leaves them",
        "genus0" => TopologyMode::Genus0,
        "keep" => TopologyMode::Keep,
    ),
    number!(
        "mask_smoothing",
        surface.mask_smoothing,
        0.0..=3.0,
        "0.8",
        groups::OBJECT,
        "voxels",
        "Sigma of the Gaussian that smooths label maps before the surface is extracted, in voxels (edges of \
         a cube of a voxel's volume): the same length along every axis"
    ),
    optional_choice!(
        "denoise",
        denoise => surface.denoise,
        groups::OBJECT,
        "auto measures the noise of the scan and takes that much off its surface; off leaves the \
         surface at the iso-value of the voxels (default for refined: auto, for paper: off)",
        "auto" => Denoise::Auto,
        "off" => Denoise::Off,
    ),
    choice!(
        "method",
        retile.method,
        "refined",
        groups::MAIN,
        "paper: repulsion and mutual tessellation on the surface; refined: centroidal points, their \
         dual triangulation and a least-squares fit",
        "paper" => Method::Paper,
        "refined" => Method::Refined,
    ),
    optional!(
        Number f64,
        "adaptive",
        adaptive => retile.adaptive,
        0.0..=1.0,
        groups::POINTS,
        "",
        "Higher density of points where the surface is curved: the spacing is proportional to \
         curvature^-adaptive; 0 is uniform (default for refined: 0.25, for paper: 0)"
    ),
    number!(
        "adaptive_from",
        retile.adaptive_from,
        0.0..=100.0,
        "0.8",
        groups::POINTS,
        "%",
        "Smallest height of the surface over one edge of uniform spacing, in percent of the \
         surface's size, at which `adaptive` takes effect; 0 adapts everywhere"
    ),
    integer!(
        "repulsion_iterations",
        retile.repulsion_iterations,
        0..=1000,
        "40",
        groups::POINTS,
        "",
        "Rounds of geodesic repulsion (method paper)"
    ),
    number!(
        "repulsion_strength",
        retile.repulsion_strength,
        0.001..=1.0,
        "0.15",
        groups::POINTS,
        "",
        "Share of an overlap by which one round of repulsion moves a point"
    ),
    integer!(
        "repeats",
        retile.repeats,
        0..=100,
        "8",
        groups::POINTS,
        "",
        "Most repetitions of repulsion and tessellation, each from the points of the mesh before (method \
         paper); fewer if the triangles' shape no longer improves"
    ),
    choice!(
        "geodesics",
        retile.geodesics,
        "approximate",
        groups::POINTS,
        "Geodesic distances that the repulsion uses (method paper): exact ones take many times \
         longer and are meant for validation",
        "approximate" => Geodesics::Approximate,
        "exact" => Geodesics::Exact,
    ),
    integer!(
        "relaxation_iterations",
        retile.relaxation_iterations,
        0..=1000,
        "50",
        groups::POINTS,
        "",
        "Maximum number of rounds of centroidal relaxation (method refined)"
    ),
    optional!(
        Integer usize,
        "fit_rounds",
        fit_rounds => optimise.fit.rounds,
        0..=200,
        groups::FIT,
        "",
        "Rounds of the least-squares fit; 0 leaves the points on the surface (default for refined: \
         10, from 600 points on 8; for paper: 0)"
    ),
    number!(
        "fit_shape_weight",
        optimise.fit.shape_weight,
        0.0001..=10.0,
        "0.06",
        groups::FIT,
        "",
        "Weight of the triangles' shape relative to the squared distance in the fit"
    ),
    number!(
        "fit_worst_weight",
        optimise.fit.worst_weight,
        0.0..=100.0,
        "3",
        groups::FIT,
        "",
        "Additional weight of badly shaped triangles in the fit"
    ),
    number!(
        "fit_free_size",
        optimise.fit.free_size,
        0.0..=1.0,
        "1",
        groups::FIT,
        "",
        "Target size of triangles in the fit: 0 pulls them all to one size, 1 keeps the size that each has"
    ),
    number!(
        "fit_peak_weight",
        optimise.fit.peak_weight,
        0.0..=10.0,
        "0.02",
        groups::FIT,
        "",
        "Additional weight of distant samples in the fit; lowers the largest distance"
    ),
    number!(
        "fit_bend_weight",
        optimise.fit.bend_weight,
        0.0..=10.0,
        "0.07",
        groups::FIT,
        "",
        "Weight of even dihedral angles in the fit, for triangles as small as a voxel; lowers the \
         largest distance and the dihedral angles"
    ),
    number!(
        "fit_momentum",
        optimise.fit.momentum,
        0.0..=0.9,
        "0.6",
        groups::FIT,
        "",
        "Share of its previous step that a vertex repeats in each round of the fit"
    ),
    number!(
        "fit_midpoint_weight",
        optimise.fit.midpoint_weight,
        0.0..=10.0,
        "1",
        groups::FIT,
        "",
        "Weight of the distances from the model's edge midpoints and triangle centres to the surface in \
         the fit"
    ),
    number!(
        "fit_damping",
        optimise.fit.damping,
        0.000001..=1.0,
        "0.0005",
        groups::FIT,
        "",
        "Weight that holds vertices in place in each round of the fit"
    ),
    integer!(
        "fit_samples",
        optimise.fit.samples_per_triangle,
        4..=200,
        "16",
        groups::FIT,
        "",
        "Samples of the surface per triangle of the model in the fit; fewer, at least 6, where the surface's own \
         triangles are larger"
    ),
    integer!(
        "fit_glide",
        optimise.fit.glide,
        0..=4,
        "3",
        groups::FIT,
        "",
        "Number of flips that the fit looks ahead to let irregular vertices cancel"
    ),
    optional_choice!(
        "fitness",
        fitness => optimise.fitness,
        groups::TRIANGLES,
        "Form of the fitness that the flips raise: raw (the paper's reciprocals), normalised (each \
         term between 0 and 1), or robust (reciprocals with a floor of 1 degree and 0.01 mm) \
         (default for refined: normalised, for paper: raw)",
        "raw" => FitnessForm::Raw,
        "normalised" => FitnessForm::Normalised,
        "robust" => FitnessForm::Robust,
    ),
    titled(
        "Weight 1",
        number!(
            "w1",
            optimise.weights[0],
            0.0..=1000.0,
            "1",
            groups::TRIANGLES,
            "",
            "Weight of the smoothness between the two triangles of an edge"
        ),
    ),
    titled(
        "Weight 2",
        number!(
            "w2",
            optimise.weights[1],
            0.0..=1000.0,
            "1",
            groups::TRIANGLES,
            "",
            "Weight of the smoothness toward the neighbouring triangles"
        ),
    ),
    titled(
        "Weight 3",
        number!(
            "w3",
            optimise.weights[2],
            0.0..=1000.0,
            "1",
            groups::TRIANGLES,
            "",
            "Weight of the aspect ratio of the triangles"
        ),
    ),
    titled(
        "Weight 4",
        number!(
            "w4",
            optimise.weights[3],
            0.0..=1000.0,
            "1",
            groups::TRIANGLES,
            "",
            "Weight of the distance to the original surface"
        ),
    ),
    optional_choice!(
        "gain",
        gain => optimise.gain,
        groups::TRIANGLES,
        "What a flip must raise: local (the fitness of the pair of triangles, as in the paper) or \
         total (the fitness of the mesh) (default for refined: total, for paper: local)",
        "local" => Gain::Local,
        "total" => Gain::Total,
    ),
    optional!(
        Number f64,
        "guard",
        guard => optimise.guard,
        0.0..=1.0,
        groups::TRIANGLES,
        "",
        "Radius ratio 2r/R below which a flip must not create a triangle, unless it replaces one \
         that is as bad; 0 allows slivers (default for refined: 0.9, for paper: 0)"
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
    if let Some(value) = text.strip_prefix("below:").and_then(finite) {
        return Ok(IsoLevel::Below(value));
    }
    match text.strip_suffix('%').and_then(finite) {
        Some(percent) if percent > 0.0 && percent < 100.0 => {
            Ok(IsoLevel::Fraction(percent / 100.0))
        }
        Some(percent) => Err(format!("{percent} % is not between 0 % and 100 %")),
        None => Err(format!("`{text}` has none of the four forms")),
    }
}
