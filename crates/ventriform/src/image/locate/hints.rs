//! The caller's hints at the position of the ventricle.

use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;

/// Places nearer to each other than this are the same one, mm.
pub const DISTINCT_DISTANCE_MM: f64 = 25.0;

/// The caller's hints at the position of the ventricle; every hint is optional.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Hints {
    /// A point in the cavity, LPS mm: the search keeps within 25 mm of it.
    pub centre: Option<Vec3>,
    /// Base to apex, LPS, any length: the search keeps within 35 degrees of it.
    pub axis: Option<Vec3>,
    /// The cavity's centre must lie in this box, LPS mm.
    pub region: Option<Aabb>,
    /// A usual heart was looked for in vain: only walls that infarcts leave are candidates, and very large ones.
    pub infarcted: bool,
}

impl Hints {
    /// Whether the cavity's centre may lie at `p`, LPS mm.
    pub fn admit(&self, p: &Vec3) -> bool {
        let near = self
            .centre
            .is_none_or(|centre| (p - centre).norm() <= DISTINCT_DISTANCE_MM);
        let inside = self
            .region
            .as_ref()
            .is_none_or(|region| region.squared_distance(p) == 0.0);
        near && inside
    }
}
