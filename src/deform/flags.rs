//! Reasons to doubt a fit, as codes and sentences for the report.

use super::dynamics::StopReason;

/// A reason to doubt a fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Flag {
    /// The confidence of the fit is below 0.4.
    #[error("the heart's place is uncertain: confidence {confidence:.2}")]
    UncertainPlace {
        /// The fit's confidence, 0..=1.
        confidence: f64,
    },
    /// The apical wall is too dark to be seen.
    #[error(
        "the apical wall takes up {:.0} % as much as the basal one: the length of the model is \
         that of a mean heart of this breadth",
        100.0 * uptake
    )]
    DarkApex {
        /// Uptake of the apical wall relative to the basal wall.
        uptake: f64,
    },
    /// The motion did not come to rest.
    #[error("the model did not come to rest: {}", reason.as_str())]
    NotAtRest {
        /// Why the motion ended.
        reason: StopReason,
    },
    /// The surface intersects itself or has inverted triangles.
    #[error("{intersections} pairs of triangles intersect, {turned} triangles are inverted")]
    Folded {
        /// Intersecting pairs.
        intersections: usize,
        /// Inverted triangles.
        turned: usize,
    },
    /// Less than half of the surface sees an edge.
    #[error("an edge is seen along only {:.0} % of the surface; the rest keeps the template's shape", 100.0 * active)]
    PoorContrast {
        /// Share of area with an edge.
        active: f64,
    },
    /// Nodes lie at or beyond the border of the volume.
    #[error("{share:.0} % of the model's nodes lie at or beyond the volume's border")]
    TouchesBorder {
        /// Per cent of nodes.
        share: f64,
    },
    /// A volume, thickness, length or strain outside the plausible range of left ventricles.
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
    /// The rim is far from a plane, so volumes depend on where the base is taken to be.
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
