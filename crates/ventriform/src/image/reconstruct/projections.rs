//! The counts of one gate as the camera acquired them, and how it turned.
//!
//! The frame is the patient's, LPS (x to the left, y to the back, z to the head). An angle is that of PS3.3 C.8.4.11
//! and C.8.4.12: Start Angle (0054,0200) is 0 where the detector is at the patient's back, and rises counter-clockwise
//! as seen from the feet: to the left side (90), the front (180), the right side (270). So the detector at angle a lies
//! toward (sin a, cos a) in x and y.
//!
//! A frame shows the patient as seen from the detector, the head on top: columns run toward (-cos a, sin a), rows to
//! the feet. In front of the patient, at 180 degrees, columns run to the patient's left.
//!
//! The axis of rotation is the z axis through the middle of the frames, or beside it by the stated offset. Nothing in
//! the file ties it to the patient: the origin is the middle of the axis.

/// Most voxels of a volume that is reconstructed: 256³. Its spectrum takes 16 bytes a voxel.
const MOST_VOXELS: u64 = 1 << 24;

/// Most voxels of a volume times its views: 128³ voxels and 4096 views, or 256³ and 512.
const MOST_STEPS: u64 = 1 << 33;

/// Widest arc in which there is no view and none opposite, degrees. Images of less are distorted.
const WIDEST_GAP_DEG: f64 = 20.0;

/// Fewest views of an image.
const FEWEST_VIEWS: usize = 8;

/// Fewest columns of a frame.
const FEWEST_COLUMNS: usize = 8;

/// By how much the counts of a view differ from those of the views beside it at least to be told, %. In the real scan at
/// hand and in simulated ones it is 4 at most.
pub const ODD_VIEW_PERCENT: f64 = 12.0;

/// A view whose counts are not those of the views beside it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OddView {
    /// Its number, from 0.
    pub view: usize,
    /// How many more counts it has than the mean of those beside it, %.
    pub percent: f64,
}

/// Where the detector was.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Its angle about the patient, degrees: 0 at the back, 90 at the left side.
    pub angle_deg: f64,
    /// Its number in time, from 0. Views of several detectors at one time have the same.
    pub time: usize,
}

impl View {
    /// The direction of the detector's columns in x and y, which is -cos and sin of its angle.
    pub fn columns(&self) -> [f64; 2] {
        let (sin, cos) = self.angle_deg.to_radians().sin_cos();
        [-cos, sin]
    }
}

/// The numbers of `views` in the order of their angles.
pub fn by_angle(views: &[View]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..views.len()).collect();
    order.sort_by(|a, b| views[*a].angle_deg.total_cmp(&views[*b].angle_deg));
    order
}

/// The projections of one gate.
#[derive(Debug, Clone, PartialEq)]
pub struct Projections {
    /// Counts: view after view, row after row, columns the fastest. None is missing or below 0.
    pub counts: Vec<f32>,
    /// Columns of a frame, along which the camera turns.
    pub columns: usize,
    /// Rows of a frame, from the head to the feet.
    pub rows: usize,
    /// Edge of a pixel, mm.
    pub pixel_mm: f64,
    /// The views, in the order of the camera.
    pub views: Vec<View>,
}

/// Why views are no projections that a volume can be made of.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ProjectionsError {
    /// Too few views or columns.
    #[error(
        "there are {views} views of {columns} columns; a volume needs {FEWEST_VIEWS} and {FEWEST_COLUMNS}"
    )]
    TooFew {
        /// Views.
        views: usize,
        /// Columns of a frame.
        columns: usize,
    },
    /// The views leave out an arc.
    #[error(
        "over an arc of {gap_deg:.0} degrees there is no view and none opposite; views must cover half a turn, \
         {WIDEST_GAP_DEG} degrees apart at most"
    )]
    Gap {
        /// The widest, degrees.
        gap_deg: f64,
    },
    /// The volume would have more voxels than are reconstructed.
    #[error("its volume would have {amount} voxels; the limit is {limit}")]
    Voxels {
        /// Voxels.
        amount: u64,
        /// Most that are reconstructed.
        limit: u64,
    },
    /// The work would take too long.
    #[error("voxels times views are {amount}; the limit is {limit}")]
    Steps {
        /// Voxels times views.
        amount: u64,
        /// Most that are reconstructed.
        limit: u64,
    },
}

impl Projections {
    /// Checks whether a volume can be made of frames of `columns` and `rows` of these views, and that its size is
    /// within the budget. No counts are needed for it.
    ///
    /// # Errors
    /// [`ProjectionsError`].
    pub fn check(columns: usize, rows: usize, views: &[View]) -> Result<(), ProjectionsError> {
        if views.len() < FEWEST_VIEWS || columns < FEWEST_COLUMNS {
            return Err(ProjectionsError::TooFew {
                views: views.len(),
                columns,
            });
        }
        let [wide, high] = [columns as u64, rows as u64];
        let voxels = wide.saturating_mul(wide).saturating_mul(high);
        if voxels > MOST_VOXELS {
            return Err(ProjectionsError::Voxels {
                amount: voxels,
                limit: MOST_VOXELS,
            });
        }
        let steps = voxels.saturating_mul(views.len() as u64);
        if steps > MOST_STEPS {
            return Err(ProjectionsError::Steps {
                amount: steps,
                limit: MOST_STEPS,
            });
        }
        let gap_deg = shares_deg(views)
            .into_iter()
            .map(|(gap, _)| gap)
            .fold(0.0, f64::max);
        if gap_deg > WIDEST_GAP_DEG {
            return Err(ProjectionsError::Gap { gap_deg });
        }
        Ok(())
    }

    /// Voxels of the volume along x, y and z; their edge is that of a pixel, and the middle of the volume the origin.
    pub fn shape(&self) -> [usize; 3] {
        [self.columns, self.columns, self.rows]
    }

    /// The counts of a view, rows from the head to the feet.
    pub fn view(&self, view: usize) -> &[f32] {
        let pixels = self.rows * self.columns;
        &self.counts[view * pixels..(view + 1) * pixels]
    }

    /// The sum of the counts of a view.
    pub fn counts_of(&self, view: usize) -> f64 {
        self.view(view).iter().map(|count| f64::from(*count)).sum()
    }

    /// The view whose counts lie farthest from the mean of the views beside it, if that is more than
    /// [`ODD_VIEW_PERCENT`]. Those at the ends of the arc have no two views beside them.
    pub fn odd_view(&self) -> Option<OddView> {
        let order = by_angle(&self.views);
        let off = order.windows(3).map(|three| {
            let [before, own, after] = [0, 1, 2].map(|n| self.counts_of(three[n]));
            let usual = 0.5 * (before + after);
            OddView {
                view: three[1],
                percent: if usual > 0.0 {
                    100.0 * (own / usual - 1.0)
                } else {
                    0.0
                },
            }
        });
        let farthest = off.max_by(|a, b| a.percent.abs().total_cmp(&b.percent.abs()));
        farthest.filter(|odd| odd.percent.abs() > ODD_VIEW_PERCENT)
    }
}

/// For each view how far it lies from the one before it and from the one after it, as lines through the axis, which
/// have no sides: the gap after it and the share of half a turn that is its own, degrees.
pub(super) fn shares_deg(views: &[View]) -> Vec<(f64, f64)> {
    const HALF_DEG: f64 = 180.0;
    let line = |view: &View| view.angle_deg.rem_euclid(HALF_DEG);
    let mut order: Vec<usize> = (0..views.len()).collect();
    order.sort_by(|a, b| line(&views[*a]).total_cmp(&line(&views[*b])));
    let mut shares = vec![(0.0, 0.0); views.len()];
    for (at, own) in order.iter().enumerate() {
        let next = order[(at + 1) % order.len()];
        let turn = if at + 1 == order.len() { HALF_DEG } else { 0.0 };
        let gap = turn + line(&views[next]) - line(&views[*own]);
        shares[*own].0 = gap;
        shares[*own].1 += 0.5 * gap;
        shares[next].1 += 0.5 * gap;
    }
    shares
}
