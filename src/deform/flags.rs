//! What gives reason to doubt a fit.

use super::{Fit, StopReason};
use crate::geometry::Vec3;
use crate::volume::Volume;

/// One reason for doubt.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Flag {
    /// The heart was not found with certainty.
    #[error("the heart's place is uncertain: confidence {confidence:.2}")]
    UncertainPlace {
        /// 0..=1.
        confidence: f64,
    },
    /// The apical wall does not show.
    #[error(
        "the apical wall takes up {:.0} % of the basal one: how far it reaches is the mean \
         heart's proportion",
        100.0 * uptake
    )]
    DarkApex {
        /// Uptake of the apical wall, basal wall = 1.
        uptake: f64,
    },
    /// The motion did not come to rest.
    #[error("the model did not come to rest: {}", reason.as_str())]
    NotAtRest {
        /// Why it ended.
        reason: StopReason,
    },
    /// The surface pierces itself or has turned triangles.
    #[error("{intersections} pairs of triangles pierce each other, {turned} are turned over")]
    Folded {
        /// Piercing pairs.
        intersections: usize,
        /// Turned triangles.
        turned: usize,
    },
    /// Few sensors see an edge.
    #[error("an edge is seen along {:.0} % of the surface only; the rest is the template's", 100.0 * active)]
    PoorContrast {
        /// Share of area with an edge.
        active: f64,
    },
    /// The volume's border cuts the organ.
    #[error("{share:.0} % of the model's nodes lie at or beyond the volume's border")]
    TouchesBorder {
        /// Per cent of nodes.
        share: f64,
    },
    /// Volume, thickness or strain that no left ventricle has.
    #[error("implausible shape: {what} is {value:.1}; {least} to {most} is plausible")]
    ImplausibleShape {
        /// The measure.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Least plausible value.
        least: f64,
        /// Greatest plausible value.
        most: f64,
    },
    /// The rim is far from a plane, so volumes depend on where one says the base is.
    #[error("the valve plane is unclear: {:.0} % of the basal half has no wall", 100.0 * gaps)]
    ValvePlane {
        /// Share of basal rays without wall.
        gaps: f64,
    },
}

impl Flag {
    /// The flag's name in reports.
    pub fn code(&self) -> &'static str {
        match self {
            Flag::UncertainPlace { .. } => "uncertain_place",
            Flag::DarkApex { .. } => "dark_apex",
            Flag::NotAtRest { .. } => "not_at_rest",
            Flag::Folded { .. } => "folded",
            Flag::PoorContrast { .. } => "poor_contrast",
            Flag::TouchesBorder { .. } => "touches_border",
            Flag::ImplausibleShape { .. } => "implausible_shape",
            Flag::ValvePlane { .. } => "valve_plane",
        }
    }
}

/// Looks for reasons to doubt `fit`.
pub(super) fn raise(fit: &Fit, volume: &Volume, ventricle: bool) -> Vec<Flag> {
    let mut flags = Vec::new();
    if fit.confidence < 0.4 {
        let confidence = fit.confidence;
        flags.push(Flag::UncertainPlace { confidence });
    }
    if let Some(uptake) = fit.localisation.as_ref().and_then(|l| l.dark_apex) {
        flags.push(Flag::DarkApex { uptake });
    }
    if matches!(fit.reason, StopReason::MaxIterations | StopReason::Diverged) {
        flags.push(Flag::NotAtRest { reason: fit.reason });
    }
    if fit.self_intersections + fit.turned_triangles > 0 {
        flags.push(Flag::Folded {
            intersections: fit.self_intersections,
            turned: fit.turned_triangles,
        });
    }
    if fit.active < 0.5 {
        flags.push(Flag::PoorContrast { active: fit.active });
    }
    let outside = fit
        .mesh
        .vertices
        .iter()
        .filter(|p| beyond(volume, p))
        .count();
    if outside > 0 {
        let share = 100.0 * outside as f64 / fit.mesh.vertices.len() as f64;
        flags.push(Flag::TouchesBorder { share });
    }
    if ventricle {
        flags.extend(implausible(fit));
    }
    flags
}

fn beyond(volume: &Volume, p: &Vec3) -> bool {
    let index = volume.frame.to_voxel(p);
    (0..3).any(|a| index[a] <= 0.0 || index[a] >= volume.shape[a] as f64 - 1.0)
}

fn implausible(fit: &Fit) -> Vec<Flag> {
    let Some(wall) = &fit.wall else {
        return Vec::new();
    };
    let length = wall.extent[1] - wall.extent[0];
    let mut flags: Vec<Flag> = [
        ("the wall's volume in ml", fit.wall_ml, 50.0, 400.0),
        ("the cavity's volume in ml", wall.cavity_ml, 5.0, 450.0),
        ("the wall's mean thickness in mm", wall.thickness, 7.0, 28.0),
        ("the length in mm", length, 45.0, 140.0),
        (
            "the strain in per cent",
            100.0 * fit.strain.sqrt(),
            0.0,
            45.0,
        ),
    ]
    .into_iter()
    .filter(|(_, value, least, most)| !(least..=most).contains(&value))
    .map(|(what, value, least, most)| Flag::ImplausibleShape {
        what,
        value,
        least,
        most,
    })
    .collect();
    if wall.gaps > 0.25 {
        flags.push(Flag::ValvePlane { gaps: wall.gaps });
    }
    flags
}
