//! What the hearts of several scans have in common.
//!
//! In: fits of one model to the scans of one patient, each with its motion from the first scan. Out: the [`CommonHeart`]
//! in the frame of the first scan, and in that of every other one ([`CommonHeart::in_scan`]): where a fit starts.
//!
//! The wall's nodes are the means of the registered nodes; long axis and cup are carried along; the base is the middle of
//! the rim; the muscle is the geometric mean of those of the anatomical walls.

use super::registration::RigidMotion;
use crate::base::geometry::Vec3;
use crate::heart::deform::FittedModel;
use crate::heart::deform::base_plane::rim_heights;
use crate::heart::model::wall;
use crate::image::locate::cup::Cup;
use crate::mesh::TriMesh;
use crate::mesh::intersections::self_intersections;

/// The heart of several scans.
#[derive(Debug, Clone)]
pub struct CommonHeart {
    /// The wall as it looks, LPS mm.
    pub mesh: TriMesh,
    /// Its long axis.
    pub cup: Cup,
    /// The patient's superior direction, a unit vector.
    pub superior: Vec3,
    /// The middle of the rim on the long axis, LPS mm; `None` without a rim in every direction.
    pub base: Option<Vec3>,
    /// Volume of the muscle, ml.
    pub muscle_ml: f64,
}

impl CommonHeart {
    /// That of `hearts`, each with its motion from the first one's scan; `None` unless all are ventricles with one model's
    /// nodes.
    pub fn of(hearts: &[(&FittedModel, RigidMotion)]) -> Option<Self> {
        let (first, _) = *hearts.first()?;
        let own = first.apparent_mesh();
        let walls: Vec<(&TriMesh, f64, RigidMotion)> = (hearts.iter())
            .map(|(model, motion)| {
                let muscle_ml = model.surfaces.as_ref()?.anatomical.wall_ml;
                let mesh = model.apparent_mesh();
                let same = mesh.vertices.len() == own.vertices.len();
                same.then(|| (mesh, muscle_ml, motion.inverse()))
            })
            .collect::<Option<_>>()?;
        let count = walls.len() as f64;
        let mean = |node: usize| {
            let back = walls
                .iter()
                .map(|(mesh, _, back)| back.point(&mesh.vertices[node]));
            back.sum::<Vec3>() / count
        };
        let mut mesh = own.clone();
        mesh.vertices = (0..own.vertices.len()).map(mean).collect();
        if !self_intersections(&mesh).is_empty() {
            mesh = own.clone();
        }
        let cup = wall::carried(first.cup.as_ref()?, own, &mesh);
        let superior = first.patient_orientation?.superior;
        let base = rim_heights(&mesh, &cup, &superior)
            .map(|rim| cup.centre + cup.axis * (rim.iter().sum::<f64>() / rim.len() as f64));
        let logs: f64 = walls.iter().map(|(_, muscle_ml, _)| muscle_ml.ln()).sum();
        Some(Self {
            mesh,
            cup,
            superior,
            base,
            muscle_ml: (logs / count).exp(),
        })
    }

    /// The same in the scan to which `motion` takes the first one.
    pub fn in_scan(&self, motion: &RigidMotion) -> Self {
        let mut mesh = self.mesh.clone();
        for p in &mut mesh.vertices {
            *p = motion.point(p);
        }
        Self {
            mesh,
            cup: Cup {
                centre: motion.point(&self.cup.centre),
                axis: motion.direction(&self.cup.axis),
                ..self.cup
            },
            superior: motion.direction(&self.superior),
            base: self.base.map(|base| motion.point(&base)),
            muscle_ml: self.muscle_ml,
        }
    }
}
