//! The report of a segmentation, as JSON.

use serde_json::{Value, json};

use super::segment::{AppliedReader, Segmentation};
use crate::deform::FittedModel;
use crate::geometry::Vec3;
use crate::grid::agreement::Agreement;
use crate::judge::{Evidence, Judgement, confidence, consensus};
use crate::model::wall::VentricleWall;
use crate::numeric::order;
use crate::polar;

fn round(x: f64) -> f64 {
    (1e4 * x).round() / 1e4
}

fn point(p: &Vec3) -> [f64; 3] {
    [p.x, p.y, p.z].map(round)
}

/// The figures of a segmentation as JSON. Lengths are mm (LPS), volumes ml.
pub fn report_json(segmentation: &Segmentation) -> Value {
    let (fit, judgement) = (&segmentation.fit.model, &segmentation.fit.judgement);
    let flags: Vec<Value> = judgement
        .flags
        .iter()
        .map(|f| json!({"code": f.code(), "reason": f.to_string()}))
        .collect();
    let candidates: Vec<Value> = segmentation
        .candidates
        .iter()
        .map(|c| {
            json!({
                "template": c.name,
                "confidence": round(c.confidence),
                "merit": round(c.merit),
                "active": round(c.active),
                "strain": round(c.strain),
                "residual_mm": round(c.residual),
            })
        })
        .collect();
    let refused: Vec<Value> = segmentation
        .refused
        .iter()
        .map(|r| json!({"template": r.name, "reason": r.reason}))
        .collect();
    json!({
        "template": segmentation.candidates[segmentation.chosen].name,
        "choice": choice(segmentation),
        "candidates": candidates,
        "refused": refused,
        "localisation": fit.localisation.as_ref().map(|l| json!({
            "centre": point(&l.cup.centre),
            "axis": point(&l.cup.axis),
            "length_mm": round(l.cup.length),
            "correlation": round(l.correlation),
            "runner_up": l.runner_up.map(round),
            "hollowness": round(l.hollowness),
            "confidence": round(l.confidence),
        })),
        "posture": fit.patient_orientation.as_ref().map(|p| json!({
            "superior": point(&p.superior),
            "source": p.source.as_str(),
            "tilt_degrees": round(p.tilt()),
            "confidence": round(p.confidence),
        })),
        "fit": fit_json(fit, judgement),
        "evidence": judgement.evidence.as_ref().map(|e| evidence(e, consensus::spread(&judgement.nodes))),
        "volumes_ml": volumes(fit),
        "mass_g": fit.surfaces.as_ref().map(|s| round(MYOCARDIUM * s.anatomical.wall_ml)),
        "wall_thickness_mm": fit.wall.as_ref().map(|w| round(w.thickness)),
        "thickness_mm": fit.surfaces.as_ref().map(|s| json!({
            "apparent": thickness(&s.apparent.wall),
            "anatomical": thickness(&s.anatomical.wall),
        })),
        "uncertainty_mm": judgement.uncertainty.as_ref().map(|u| json!({
            "apparent": uncertainty(&u.apparent),
            "anatomical": uncertainty(&u.anatomical),
        })),
        "resolution_mm": segmentation.resolution.map(|r| json!({
            "value": round(r.value),
            "source": if r.given { "given" } else { "estimated" },
        })),
        "reader": segmentation.reader.as_ref().map(reader),
        "measures": segmentation.agreement.as_ref().map(agreement_json),
        "polar": segmentation.polar.as_ref().map(summary),
        "flags": flags,
        "mask_rule": "a voxel belongs to the mask if its centre lies inside the surface",
    })
}

/// The reader's profile by which the wall was drawn.
fn reader(applied: &AppliedReader) -> Value {
    let profile = &applied.reader.profile;
    let offsets = profile.offsets();
    json!({
        "name": applied.reader.name,
        "sha256": profile.sha256(),
        "edge": profile.edge.as_str(),
        "masks": profile.masks(),
        "offsets_mm": {
            "endocardium": offsets.endocardium,
            "epicardium": offsets.epicardium,
            "rim": offsets.rim,
        },
        "share_applied": round(applied.share),
    })
}

/// Density of the myocardium, g/ml.
const MYOCARDIUM: f64 = 1.05;

/// The volumes of the wall that is shown and, of a ventricle, those of both walls.
fn volumes(fit: &FittedModel) -> Value {
    let mut volumes = json!({
        "wall": round(fit.wall_ml),
        "cavity": fit.wall.as_ref().map(|w| round(w.cavity_ml)),
    });
    if let Some(surfaces) = &fit.surfaces {
        let both = [
            ("apparent", &surfaces.apparent),
            ("anatomical", &surfaces.anatomical),
        ];
        for (name, surface) in both {
            volumes[name] = json!({
                "wall": round(surface.wall_ml),
                "cavity": round(surface.wall.cavity_ml),
            });
        }
    }
    volumes
}

/// Mean thickness of a wall and its standard deviation over the wall, mm.
fn thickness(wall: &VentricleWall) -> Value {
    json!({"mean": round(wall.thickness), "spread": round(wall.thickness_spread)})
}

/// Median, 95th percentile and greatest uncertainty of the nodes of a wall, mm.
fn uncertainty(nodes: &[f64]) -> Value {
    let mut sorted = nodes.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.last() {
        Some(most) => json!({
            "median": round(order::quantile(&sorted, 0.5)),
            "percentile_95": round(order::quantile(&sorted, 0.95)),
            "greatest": round(*most),
        }),
        None => Value::Null,
    }
}

/// How the motion went, and the fitted model's pose.
fn fit_json(fit: &FittedModel, judgement: &Judgement) -> Value {
    let displacements: Vec<f64> = fit.displacements.iter().map(|d| round(d.norm())).collect();
    json!({
        "reason": fit.reason.as_str(),
        "confidence": round(judgement.confidence),
        "iterations": fit.iterations,
        "runs": fit.runs,
        "residual_mm": round(fit.residual),
        "active_sensors": round(fit.active),
        "strain": round(fit.strain.sqrt()),
        "energy": fit.energy.iter().map(|e| round(*e)).collect::<Vec<_>>(),
        "self_intersections": fit.self_intersections,
        "turned_triangles": fit.turned_triangles,
        "long_axis": fit.cup.map(|c| json!({
            "base": point(&c.base()),
            "apex": point(&c.apex()),
        })),
        "scale": round(fit.scale),
        "rotation": rows(fit),
        "displacement_mm": displacements,
    })
}

/// The figures behind confidence and flags.
fn evidence(e: &Evidence, spread: Option<f64>) -> Value {
    json!({
        "active_sensors": round(e.active),
        "residual_mm": round(e.residual),
        "strain": round(e.strain),
        "hollowness": round(e.hollowness),
        "cavity_ml": round(e.cavity_ml),
        "thickness_spread_mm": round(e.thickness_spread),
        "unroundness": round(e.unroundness),
        "offset": round(e.offset),
        "slenderness": round(e.slenderness),
        "septal_bulge": round(e.septal_bulge),
        "dark": round(e.dark),
        "beside": round(e.beside),
        "agreement_of_views": e.views.map(|v| round(v.agreement)),
        "gain_of_two_places": e.views.map(|v| round(v.gain)),
        "displacement_mm": e.views.map(|v| round(v.displacement)),
        "displaced_share": e.views.map(|v| round(v.share)),
        "chance_of_motion": round(confidence::of_motion(e)),
        "template_spread_mm": spread.map(round),
    })
}

/// Why this template was chosen, in a sentence.
fn choice(segmentation: &Segmentation) -> String {
    let chosen = &segmentation.candidates[segmentation.chosen];
    let others = segmentation.candidates.iter().enumerate();
    let next = others
        .filter(|(place, _)| *place != segmentation.chosen)
        .map(|(_, candidate)| candidate)
        .max_by(|a, b| a.confidence.total_cmp(&b.confidence));
    match next {
        None => format!("{} was the only model fitted", chosen.name),
        Some(next) => format!(
            "{} has the greatest confidence by its own figures, {:.2} (next {}: {:.2}): edges seen \
             along {:.0} % of its surface, {:.1} mm off in the mean",
            chosen.name,
            chosen.confidence,
            next.name,
            next.confidence,
            100.0 * chosen.active,
            chosen.residual,
        ),
    }
}

fn rows(fit: &FittedModel) -> Vec<[f64; 3]> {
    let m = fit.rotation.matrix();
    (0..3)
        .map(|r| [0, 1, 2].map(|c| round(m[(r, c)])))
        .collect()
}

/// The polar map without its pixels, which are in polar.json.
fn summary(map: &polar::PolarMap) -> Value {
    let mut value = polar::json(map);
    if let Some(object) = value.as_object_mut() {
        for pixels in ["values_percent", "segment_of", "level_ends", "rings"] {
            object.remove(pixels);
        }
    }
    value
}

/// The measures of two masks as JSON; distances are `null` where a mask is empty.
pub fn agreement_json(agreement: &Agreement) -> Value {
    let c = agreement.contours;
    let [volume, expert] = agreement.volumes_ml;
    json!({
        "jaccard": agreement.jaccard,
        "contour_distance_voxels": c.map(|c| c.mean_voxels),
        "contour_distance_mm": c.map(|c| c.mean_mm),
        "dice": agreement.dice,
        "hausdorff_mm": c.map(|c| c.hausdorff_mm),
        "hausdorff95_mm": c.map(|c| c.hausdorff95_mm),
        "volume_ml": round(volume),
        "expert_volume_ml": round(expert),
        "volume_difference_ml": round(volume - expert),
        "volume_difference_percent":
            (expert > 0.0).then(|| round(100.0 * (volume / expert - 1.0))),
    })
}
