//! One model fitted to one patient: what is kept of the fit.
//!
//! All numbers are [`rounded`], so that a result is the same whether it was just computed or
//! read from a record.

use super::models::CohortModel;
use super::rows::{Agreed, FitOutcome};
use super::table::rounded;
use crate::base::geometry::Vec3;
use crate::heart::judge::Fit;
use crate::image::grid::agreement::Agreement;
use crate::image::locate::cup::Cup;
use crate::image::locate::patient_orientation::PatientOrientation;
use crate::mesh::TriMesh;
use crate::runs::segmentation::slices::Cut;
use std::collections::BTreeMap;

/// The result of one fit, or why there is none.
#[derive(Debug, Clone, PartialEq)]
pub struct CohortFit {
    /// Figures of the fit, or why there are none.
    pub outcome: FitOutcome,
    /// Agreement with [`Gold::ALL`](super::rows::Gold::ALL).
    pub agreed: [Option<Agreed>; 2],
    /// Figures of the fit itself, by name.
    pub figures: BTreeMap<String, f64>,
    /// The long axis; `None` without a fit.
    pub cup: Option<Cup>,
    /// The patient's superior direction, LPS, a unit vector up to rounding.
    pub superior: Vec3,
    /// The fitted nodes, LPS mm; empty without a fit.
    pub vertices: Vec<Vec3>,
}

impl CohortFit {
    /// A result without a fit.
    pub fn without_fit(outcome: FitOutcome) -> Self {
        Self {
            outcome,
            agreed: [None; 2],
            figures: BTreeMap::new(),
            cup: None,
            superior: PatientOrientation::FRAME.superior,
            vertices: Vec::new(),
        }
    }

    /// The figures of `fit`, and its agreement with each gold standard.
    pub fn new(fit: &Fit, agreements: [Option<Agreement>; 2]) -> Self {
        let Fit { model, judgement } = fit;
        let agreed = agreements.map(|agreement| {
            let a = agreement?;
            Some(Agreed {
                jaccard: rounded(a.jaccard),
                contour_voxels: a.contours.map(|c| rounded(c.mean_voxels)),
                contour_mm: a.contours.map(|c| rounded(c.mean_mm)),
                dice: rounded(a.dice),
                hausdorff95_mm: a.contours.map(|c| rounded(c.hausdorff95_mm)),
            })
        });
        let mut figures = BTreeMap::from([
            ("confidence", judgement.confidence),
            ("merit", fit.merit()),
            ("iterations", model.iterations as f64),
            ("self_intersections", model.self_intersections as f64),
            ("wall_ml", model.wall_ml),
            ("flags", judgement.flags.len() as f64),
        ]);
        if let Some(wall) = &model.wall {
            figures.insert("cavity_ml", wall.cavity_ml);
        }
        let figures = figures
            .into_iter()
            .filter(|(_, value)| value.is_finite())
            .map(|(name, value)| (name.to_owned(), rounded(value)))
            .collect();
        Self {
            outcome: FitOutcome::Fitted(model.reason.as_str().to_owned()),
            agreed,
            figures,
            cup: model.cup.map(|c| Cup {
                centre: c.centre.map(rounded),
                axis: c.axis.map(rounded),
                length: rounded(c.length),
                breadth: rounded(c.breadth),
            }),
            superior: model
                .patient_orientation
                .unwrap_or(PatientOrientation::FRAME)
                .superior
                .map(rounded),
            vertices: model.mesh.vertices.iter().map(|v| v.map(rounded)).collect(),
        }
    }

    /// The fitted mesh.
    pub fn mesh(&self, model: &CohortModel) -> TriMesh {
        TriMesh {
            vertices: self.vertices.clone(),
            triangles: model.ready.mesh.triangles.clone(),
        }
    }

    /// Where to cut the slices that show the fit; `None` without a fit.
    pub fn cut(&self) -> Option<Cut> {
        Some(Cut::heart(self.cup.as_ref()?, &self.superior))
    }
}
