//! A model of an organ: a closed surface with what is known of it before and after a fit.
//!
//! - [`organ`]: which organ it shows;
//! - [`template`]: a model made ready to be fitted: checked, with its long axis and the node
//!   pairs across its wall ([`struts`]);
//! - [`pose`]: how a template is placed in a patient as a whole;
//! - [`wall`]: a ventricle's wall seen from its long axis: thickness, cavity, and the rays that
//!   a polar map samples; [`fn@wall_parts`]: which of its triangles are endocardium, epicardium, base.
//!
//! Lengths are millimetres, positions LPS.

pub mod organ;
pub mod pose;
pub mod struts;
pub mod template;
pub mod wall;
mod wall_parts;

pub use organ::Organ;
pub use template::{Template, TemplateError, cup_about_middle};
pub use wall_parts::wall_parts;

use crate::mesh::TriMesh;

/// Density of muscle, g/ml (Vinnakota and Bassingthwaighte, Am J Physiol 2004, have 1.053).
pub const MYOCARDIAL_DENSITY_G_PER_ML: f64 = 1.05;

/// The share of the mesh's area that belongs to each vertex (a third of its triangles'). The
/// shares sum to 1.
pub fn area_shares(mesh: &TriMesh) -> Vec<f64> {
    let mut shares = vec![0.0; mesh.vertices.len()];
    let total = mesh.area() * 6.0;
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let share = mesh.area_normal(t).norm() / total;
        for v in triangle {
            shares[*v as usize] += share;
        }
    }
    shares
}
