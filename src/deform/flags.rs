//! What gives reason to doubt a fit.

use super::dynamics::StopReason;

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
