//! A fitted model and its judgement.

use super::{Flag, Judgement};
use crate::heart::deform::{FittedModel, WallEdge};

/// A fitted model and how likely it is right.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The model in the patient.
    pub model: FittedModel,
    /// Its confidence, with the reasons.
    pub judgement: Judgement,
}

impl Fit {
    /// Standard deviation of each node's distance from the wall with this `edge`, mm; ventricles only.
    pub fn uncertainty(&self, edge: WallEdge) -> Option<&[f64]> {
        let uncertainty = self.judgement.uncertainty.as_ref();
        uncertainty.map(|uncertainty| uncertainty.at_edge(edge))
    }

    /// A figure to rank templates by: the share of area with edges, less strain, misfit and
    /// flags of the fit, and, where the apex does not show, less the change of the model's length. Without
    /// the last term a model that shrinks to the visible part of the wall would rank higher,
    /// because more of its area sees an edge.
    pub fn merit(&self) -> f64 {
        let model = &self.model;
        model.active
            - 0.5 * model.change_of_length().abs()
            - 0.5 * model.strain.sqrt()
            - 0.05 * model.residual
            - 0.02 * self.flags_of_fit() as f64
    }

    /// The number of flags but those of what the image lacks or the heart is: a model that ends short of a dark apex or of
    /// a cut does not see it, and is no better for that.
    fn flags_of_fit(&self) -> usize {
        let of_image = |flag: &&Flag| {
            matches!(
                flag,
                Flag::DarkApex { .. }
                    | Flag::FieldOfView { .. }
                    | Flag::ThickWall(_)
                    | Flag::ThicknessAssumed(_)
            )
        };
        let flags = &self.judgement.flags;
        flags.len() - flags.iter().filter(of_image).count()
    }
}
