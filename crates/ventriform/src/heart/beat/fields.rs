//! The unknowns of a beating wall: fields over the wall, and numbers of the whole heart.
//!
//! A field has a value at every node of a grid over the wall: rows every [`ROW_SPACING_MM`] from the apex to beyond
//! the rim, [`COLUMNS`] columns about the axis, periodic. Between the nodes it is bilinear. All unknowns of a beat are
//! one vector, in the order of [`Layout`].

use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

use crate::heart::model::wall::RayCoordinates;

/// Distance of the rows of a field along the wall, mm.
pub(super) const ROW_SPACING_MM: f64 = 6.0;
/// Columns of a field about the axis.
pub(super) const COLUMNS: usize = 12;
/// Length of the wall model beyond the mean rim, mm: the rim may lie there in some columns.
const BEYOND_RIM_MM: f64 = 18.0;
/// Length over which a column's muscle passes from that of a sphere to that of a cylinder, mm.
const CAP_BLEND_MM: f64 = 6.0;
/// Least distance of the middle of the wall from the start of its ray, mm.
const MIN_MID_WALL_MM: f64 = 4.0;

/// Where each unknown stands in the vector of unknowns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Layout {
    pub rows: usize,
    /// Harmonics of the beat.
    pub harmonics: usize,
    pub gates: usize,
}

impl Layout {
    pub fn new(coordinates: &RayCoordinates, harmonics: usize, gates: usize) -> Self {
        let rows = ((coordinates.rim_arc + BEYOND_RIM_MM) / ROW_SPACING_MM).ceil() as usize + 1;
        Self {
            rows,
            harmonics,
            gates,
        }
    }

    /// Nodes of a field.
    pub fn nodes(&self) -> usize {
        self.rows * COLUMNS
    }

    fn field(&self, index: usize) -> Range<usize> {
        index * self.nodes()..(index + 1) * self.nodes()
    }

    /// Distance of the middle of the wall in the mean of the beat, mm.
    pub fn mid_wall(&self) -> Range<usize> {
        self.field(0)
    }

    /// Thickness where the wall is at its mean distance, mm.
    pub fn thickness(&self) -> Range<usize> {
        self.field(1)
    }

    /// Logarithm of the uptake.
    pub fn uptake(&self) -> Range<usize> {
        self.field(2)
    }

    /// Logarithm of the activity outside of the wall.
    pub fn outside(&self) -> Range<usize> {
        self.field(3)
    }

    /// The motion's harmonic `index`, mm: cosines of 1, 2, ... first, then sines.
    pub fn motion(&self, index: usize) -> Range<usize> {
        self.field(4 + index)
    }

    /// Arc of the rim in every column, mm.
    pub fn rim(&self) -> Range<usize> {
        let start = (4 + 2 * self.harmonics) * self.nodes();
        start..start + COLUMNS
    }

    /// Harmonics of the logarithm of the long axis's stretch, in the order of the motion's.
    pub fn stretch(&self) -> Range<usize> {
        let start = self.rim().end;
        start..start + 2 * self.harmonics
    }

    /// Logarithm of the activity in the cavity.
    pub fn blood(&self) -> usize {
        self.stretch().end
    }

    /// Logarithm of the factor of each gate's counts.
    pub fn gains(&self) -> Range<usize> {
        let start = self.blood() + 1;
        start..start + self.gates
    }

    /// Number of unknowns.
    pub fn len(&self) -> usize {
        self.gains().end
    }
}

/// Cosines and sines of the harmonics 1, 2, ... at `turns` of the beat, each taken in the mean over a gate of
/// `width` turns (0: at the moment itself).
pub(super) fn harmonics(count: usize, turns: f64, width: f64) -> Vec<f64> {
    let of = |k: usize| {
        let half = std::f64::consts::PI * k as f64 * width;
        let mean = if half > 0.0 { half.sin() / half } else { 1.0 };
        let angle = TAU * k as f64 * turns;
        (mean * angle.cos(), mean * angle.sin())
    };
    let (cosines, sines): (Vec<f64>, Vec<f64>) = (1..=count).map(of).unzip();
    [cosines, sines].concat()
}

/// The harmonics of each of `gates`, in the mean over its width.
pub(super) fn gate_harmonics(count: usize, gates: usize) -> Vec<Vec<f64>> {
    let width = 1.0 / gates as f64;
    (0..gates)
        .map(|gate| harmonics(count, (gate as f64 + 0.5) * width, width))
        .collect()
}

/// The wall at one moment of the beat, or in the mean over a gate.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct WallState {
    /// Distance of the middle of the wall at every node, mm.
    pub mid_wall: Vec<f64>,
    /// Thickness at every node, mm.
    pub thickness: Vec<f64>,
    /// The long axis's stretch against the mean of the beat.
    pub stretch: f64,
}

/// How the thickness of each row follows distance and stretch: muscle of a column is kept. A column over the cap is a
/// part of a cone, one basal of it a part of a wedge.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Conservation {
    /// Power of the distance, row by row.
    pub distance: Vec<f64>,
    /// Power of the stretch, row by row.
    pub stretch: Vec<f64>,
}

impl Conservation {
    pub fn new(coordinates: &RayCoordinates, layout: &Layout) -> Self {
        let cap = |row: usize| {
            let beyond = row as f64 * ROW_SPACING_MM - FRAC_PI_2 * coordinates.cap_radius;
            1.0 / (1.0 + (beyond / CAP_BLEND_MM).exp())
        };
        let caps: Vec<f64> = (0..layout.rows).map(cap).collect();
        Self {
            distance: caps.iter().map(|cap| 1.0 + cap).collect(),
            stretch: caps.iter().map(|cap| 1.0 - cap).collect(),
        }
    }

    /// The wall where the harmonics have these values.
    pub fn state(&self, layout: &Layout, unknowns: &[f64], basis: &[f64]) -> WallState {
        let mean = &unknowns[layout.mid_wall()];
        let mut mid_wall = mean.to_vec();
        for (index, share) in basis.iter().enumerate() {
            let motion = &unknowns[layout.motion(index)];
            for (m, a) in mid_wall.iter_mut().zip(motion) {
                *m += share * a;
            }
        }
        let stretch = basis
            .iter()
            .zip(&unknowns[layout.stretch()])
            .map(|(share, l)| share * l)
            .sum::<f64>()
            .exp();
        mid_wall
            .iter_mut()
            .for_each(|m| *m = m.max(MIN_MID_WALL_MM));
        let thickness = (0..layout.nodes())
            .map(|node| {
                let row = node / COLUMNS;
                unknowns[layout.thickness().start + node]
                    * (mean[node] / mid_wall[node]).powf(self.distance[row])
                    * stretch.powf(-self.stretch[row])
            })
            .collect();
        WallState {
            mid_wall,
            thickness,
            stretch,
        }
    }

    /// The gradient by the unknowns, added to `gradient`, of something whose gradient by the state is given.
    pub fn add_gradient(
        &self,
        layout: &Layout,
        unknowns: &[f64],
        basis: &[f64],
        state: &WallState,
        by_state: &StateGradient,
        gradient: &mut [f64],
    ) {
        let mut by_stretch = by_state.stretch * state.stretch;
        for node in 0..layout.nodes() {
            let row = node / COLUMNS;
            let by_thickness = by_state.thickness[node] * state.thickness[node];
            let mean = unknowns[layout.mid_wall().start + node];
            let moved = state.mid_wall[node];
            gradient[layout.thickness().start + node] +=
                by_thickness / unknowns[layout.thickness().start + node];
            gradient[layout.mid_wall().start + node] += self.distance[row] * by_thickness / mean;
            by_stretch -= self.stretch[row] * by_thickness;
            if moved > MIN_MID_WALL_MM {
                let by_distance =
                    by_state.mid_wall[node] - self.distance[row] * by_thickness / moved;
                gradient[layout.mid_wall().start + node] += by_distance;
                for (index, share) in basis.iter().enumerate() {
                    gradient[layout.motion(index).start + node] += share * by_distance;
                }
            }
        }
        for (index, share) in basis.iter().enumerate() {
            gradient[layout.stretch().start + index] += share * by_stretch;
        }
    }
}

/// A gradient by the parts of a [`WallState`].
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StateGradient {
    pub mid_wall: Vec<f64>,
    pub thickness: Vec<f64>,
    pub stretch: f64,
}

impl StateGradient {
    pub fn zero(layout: &Layout) -> Self {
        Self {
            mid_wall: vec![0.0; layout.nodes()],
            thickness: vec![0.0; layout.nodes()],
            stretch: 0.0,
        }
    }
}

/// The four nodes about a point of the wall, and where it lies between them. Every voxel of every gate has its own:
/// small, and in single precision.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nodes {
    row: u16,
    columns: [u8; 2],
    up: f32,
    right: f32,
    /// Whether the point lies between rows, not beyond the last one.
    inside: bool,
}

impl Nodes {
    /// About the point with this arc, mm, and column with a fraction; beyond the last row the value there continues.
    pub fn at(rows: usize, arc: f64, column: f64) -> Self {
        Self::at_voxel(rows, arc as f32, column as f32)
    }

    /// The same in the precision of voxels.
    #[inline]
    pub fn at_voxel(rows: usize, arc: f32, column: f32) -> Self {
        let row = (arc / ROW_SPACING_MM as f32).max(0.0);
        let low = (row as usize).min(rows - 2);
        let left = (column as usize) % COLUMNS;
        Self {
            row: low as u16,
            columns: [left as u8, ((left + 1) % COLUMNS) as u8],
            up: (row - low as f32).min(1.0),
            right: column - column.floor(),
            inside: row <= (rows - 1) as f32,
        }
    }

    #[inline]
    fn columns(&self) -> [usize; 2] {
        self.columns.map(usize::from)
    }

    #[inline]
    fn indices(&self) -> [usize; 4] {
        let [left, right] = self.columns();
        let low = usize::from(self.row) * COLUMNS;
        let high = low + COLUMNS;
        [low + left, low + right, high + left, high + right]
    }

    /// The value of a field.
    #[inline]
    pub fn value(&self, field: &[f64]) -> f64 {
        let shares = self.shares().into_iter();
        shares
            .map(|(node, share)| f64::from(share) * field[node])
            .sum()
    }

    /// The values of four fields that stand side by side at every node.
    #[inline]
    pub fn values(&self, fields: &[[f32; 4]]) -> [f32; 4] {
        let mut values = [0.0; 4];
        for (node, share) in self.shares() {
            for (value, field) in values.iter_mut().zip(fields[node]) {
                *value += share * field;
            }
        }
        values
    }

    /// The changes of four fields by a millimetre of arc.
    #[inline]
    pub fn slopes(&self, fields: &[[f32; 4]]) -> [f32; 4] {
        if !self.inside {
            return [0.0; 4];
        }
        let [a, b, c, d] = self.indices().map(|node| fields[node]);
        [0, 1, 2, 3].map(|n| {
            let (left, right) = (c[n] - a[n], d[n] - b[n]);
            ((1.0 - self.right) * left + self.right * right) / ROW_SPACING_MM as f32
        })
    }

    /// Adds what a change of the values of four fields here adds to the nodes.
    #[inline]
    pub fn add(&self, fields: &mut [[f32; 4]], what: [f32; 4]) {
        for (node, share) in self.shares() {
            for (field, what) in fields[node].iter_mut().zip(what) {
                *field += share * what;
            }
        }
    }

    /// The nodes, and their shares in the value of a field.
    #[inline]
    pub fn shares(&self) -> [(usize, f32); 4] {
        let [a, b, c, d] = self.indices();
        [
            (a, (1.0 - self.up) * (1.0 - self.right)),
            (b, (1.0 - self.up) * self.right),
            (c, self.up * (1.0 - self.right)),
            (d, self.up * self.right),
        ]
    }

    /// The columns on both sides, and their shares in the arc of the rim.
    #[inline]
    pub fn rim_shares(&self) -> [(usize, f32); 2] {
        let [left, right] = self.columns();
        [(left, 1.0 - self.right), (right, self.right)]
    }

    /// The arc of the rim in the point's column, mm.
    #[inline]
    pub fn rim(&self, rim: &[f64]) -> f64 {
        let [left, right] = self.columns().map(|column| rim[column]);
        left + f64::from(self.right) * (right - left)
    }

    /// Adds what a change of the rim's arc here adds to that of the columns.
    #[inline]
    pub fn add_to_rim(&self, rim: &mut [f64], what: f32) {
        for (column, share) in self.rim_shares() {
            rim[column] += f64::from(share * what);
        }
    }
}
