//! Whether a mesh is as large as an organ.
//!
//! A ventricle is 60 to 130 mm long, that of an infant 25 mm, a liver 250 mm. The unit of a mesh whose greatest extent
//! lies outside [`MIN_EXTENT_MM`] to [`MAX_EXTENT_MM`] must be stated, so that metres or centimetres are never read as
//! millimetres.

use super::statement::MeshUnit;
use crate::base::geometry::bvh::Aabb;
use crate::mesh::TriMesh;

/// Smallest extent of an organ, mm. That of 25 cm in centimetres is above the one of 19 cm read as centimetres.
const MIN_EXTENT_MM: f64 = 20.0;
/// Greatest extent of an organ, mm.
const MAX_EXTENT_MM: f64 = 500.0;

/// An extent that is not that of an organ.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the mesh is {extent} {} across; an organ is {MIN_EXTENT_MM} to {MAX_EXTENT_MM} mm \
    across{}", unit.as_str(), self.guess())]
pub struct UnlikelySize {
    /// Greatest extent along an axis, in `unit`.
    pub extent: f64,
    /// The unit that was assumed.
    pub unit: MeshUnit,
    /// The unit in which that would be an organ, if there is one.
    pub likely: Option<MeshUnit>,
}

impl UnlikelySize {
    /// By what the coordinates have to be multiplied to be millimetres, if the unit is the likely one.
    pub fn factor(&self) -> Option<f64> {
        self.likely.map(MeshUnit::in_millimetres)
    }

    fn guess(&self) -> String {
        match (self.likely, self.factor()) {
            (Some(MeshUnit::Millimetre), _) => "; as millimetres it would be".into(),
            (Some(unit), Some(factor)) => {
                format!("; as {} it would be, by the factor {factor}", unit.as_str())
            }
            _ => String::new(),
        }
    }
}

/// Why the size of `mesh` (mm), whose unit was assumed to be `unit`, is not that of an organ.
pub(super) fn unlikely(mesh: &TriMesh, unit: MeshUnit) -> Option<UnlikelySize> {
    let bounds = Aabb::around(&mesh.vertices);
    let extent = (bounds.max - bounds.min).amax() / unit.in_millimetres();
    let organ = |unit: MeshUnit| {
        let millimetres = extent * unit.in_millimetres();
        (MIN_EXTENT_MM..=MAX_EXTENT_MM).contains(&millimetres)
    };
    // Three digits are enough for people.
    let rounded = format!("{extent:.2e}").parse().unwrap_or(extent);
    (!organ(unit)).then(|| UnlikelySize {
        extent: rounded,
        unit,
        likely: MeshUnit::ALL.into_iter().find(|unit| organ(*unit)),
    })
}
