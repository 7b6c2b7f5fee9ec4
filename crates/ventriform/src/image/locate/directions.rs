//! Evenly spread directions, and which of them is nearest to an offset.

use std::sync::LazyLock;

use crate::base::geometry::Vec3;

/// Number of directions.
pub const DIRECTION_COUNT: usize = 96;

/// Evenly spread unit vectors (Fibonacci lattice).
pub fn directions() -> Vec<Vec3> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..DIRECTION_COUNT)
        .map(|n| {
            let z = 1.0 - (2.0 * n as f64 + 1.0) / DIRECTION_COUNT as f64;
            let r = (1.0 - z * z).sqrt();
            let angle = golden * n as f64;
            Vec3::new(r * angle.cos(), r * angle.sin(), z)
        })
        .collect()
}

/// Finds the direction nearest to an offset in constant time, by a cube whose faces are
/// divided into cells.
#[derive(Debug, Clone)]
pub struct Compass {
    cells: Vec<u8>,
}

impl Compass {
    /// Cells along the side of a face: about 5 degrees each, a quarter of the directions'
    /// spacing.
    const CELLS_PER_SIDE: usize = 18;

    /// The compass of [`directions`]. It is made once in the life of the process.
    pub fn of_directions() -> &'static Self {
        static SHARED_COMPASS: LazyLock<Compass> = LazyLock::new(Compass::new);
        &SHARED_COMPASS
    }

    fn new() -> Self {
        let table = directions();
        let side = Self::CELLS_PER_SIDE;
        let cells = (0..6 * side * side)
            .map(|cell| {
                let (face, u, v) = (cell / (side * side), cell / side % side, cell % side);
                let coordinate = |c: usize| (2.0 * c as f64 + 1.0) / side as f64 - 1.0;
                let axis = face / 2;
                let mut offset = Vec3::zeros();
                offset[axis] = if face % 2 == 0 { 1.0 } else { -1.0 };
                offset[(axis + 1) % 3] = coordinate(u);
                offset[(axis + 2) % 3] = coordinate(v);
                let along = |n: &usize| table[*n].dot(&offset);
                let best = (0..DIRECTION_COUNT).max_by(|a, b| along(a).total_cmp(&along(b)));
                best.unwrap_or(0) as u8
            })
            .collect();
        Self { cells }
    }

    /// The number of the direction nearest to `offset` (to within a cell).
    pub fn nearest(&self, offset: &Vec3) -> usize {
        let axis = offset.iamax();
        let height = offset[axis].abs();
        if height == 0.0 {
            return 0;
        }
        let face = 2 * axis + usize::from(offset[axis] < 0.0);
        let cell = |r: usize| {
            let c = (offset[r % 3] / height + 1.0) / 2.0 * Self::CELLS_PER_SIDE as f64;
            (c as usize).min(Self::CELLS_PER_SIDE - 1)
        };
        let at =
            (face * Self::CELLS_PER_SIDE + cell(axis + 1)) * Self::CELLS_PER_SIDE + cell(axis + 2);
        usize::from(self.cells[at])
    }
}
