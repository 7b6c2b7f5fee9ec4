//! How projections are reconstructed.

use std::fmt;
use std::ops::RangeInclusive;

/// Iterations over all subsets.
pub const ITERATIONS: RangeInclusive<usize> = 1..=100;
/// Subsets of the views.
pub const SUBSETS: RangeInclusive<usize> = 1..=64;
/// Cut-off frequencies of the Butterworth filter, cycles per cm.
pub const CUT_OFF_PER_CM: RangeInclusive<f64> = 0.05..=5.0;
/// Orders of the Butterworth filter.
pub const FILTER_ORDER: RangeInclusive<usize> = 1..=20;
/// Widths of the Gaussian filter at half of its maximum, mm.
pub const FWHM_MM: RangeInclusive<f64> = 1.0..=50.0;
/// Distances of the axis of rotation from the middle of the frames, mm.
pub const AXIS_OFFSET_MM: RangeInclusive<f64> = -50.0..=50.0;

/// How an image is made of projections.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Ordered subsets expectation maximisation.
    #[default]
    Osem,
    /// Filtered back projection.
    Fbp,
}

/// What keeps noise out of the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Filter {
    /// A share of 1 / sqrt(1 + (f / cut-off)^(2 order)) of each frequency f.
    #[default]
    Butterworth,
    /// A normal distribution.
    Gaussian,
    /// No filter; of filtered back projection the ramp alone.
    None,
}

/// Everything that determines a volume, apart from the projections.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reconstruction {
    /// How the image is made. Default: [`Method::Osem`].
    pub method: Method,
    /// Iterations of OSEM over all subsets, within [`ITERATIONS`]. Default 3.
    pub iterations: usize,
    /// Subsets of OSEM, within [`SUBSETS`]: the greatest number up to it that divides the number of views, unless that
    /// is less than half of it. Default 10.
    pub subsets: usize,
    /// The filter. Default: [`Filter::Butterworth`].
    pub filter: Filter,
    /// The frequency of which the Butterworth filter leaves 1 / sqrt(2), cycles per cm, within [`CUT_OFF_PER_CM`].
    /// Default 0.5.
    pub cut_off_per_cm: f64,
    /// The order of the Butterworth filter, within [`FILTER_ORDER`]. Default 5.
    pub filter_order: usize,
    /// The width of the Gaussian filter at half of its maximum, mm, within [`FWHM_MM`]. Default 10.
    pub fwhm_mm: f64,
    /// How far the axis of rotation lies from the middle of the frames towards higher columns, mm, within
    /// [`AXIS_OFFSET_MM`]. Default 0.
    pub axis_offset_mm: f64,
    /// The energy window that is reconstructed, from 1. Default: that with the photopeak of the radionuclide.
    pub energy_window: Option<usize>,
}

impl Default for Reconstruction {
    fn default() -> Self {
        Self {
            method: Method::default(),
            iterations: 3,
            subsets: 10,
            filter: Filter::default(),
            cut_off_per_cm: 0.5,
            filter_order: 5,
            fwhm_mm: 10.0,
            axis_offset_mm: 0.0,
            energy_window: None,
        }
    }
}

impl Reconstruction {
    /// What of this determines a judgement of volumes by coarse blocks, quickly: filtered back projection without a
    /// filter beside the ramp.
    pub(crate) fn coarse(&self) -> Self {
        Self {
            method: Method::Fbp,
            filter: Filter::None,
            ..*self
        }
    }

    /// The subsets into which so many views are dealt.
    pub fn subsets_of(&self, views: usize) -> usize {
        let most = self.subsets.clamp(1, views.max(1));
        let divides = |n: &usize| views.is_multiple_of(*n);
        let even = (1..=most).rev().find(divides).unwrap_or(1);
        if 2 * even >= most { even } else { most }
    }

    /// The share of `per_cm` cycles that the filter leaves.
    pub fn gain(&self, per_cm: f64) -> f64 {
        match self.filter {
            Filter::None => 1.0,
            Filter::Butterworth => {
                let times = (per_cm / self.cut_off_per_cm).powi(2 * self.filter_order as i32);
                1.0 / (1.0 + times).sqrt()
            }
            Filter::Gaussian => {
                let deviation_cm = self.fwhm_mm / 10.0 / (8.0 * std::f64::consts::LN_2).sqrt();
                (-2.0 * (std::f64::consts::PI * per_cm * deviation_cm).powi(2)).exp()
            }
        }
    }

    /// The method in a few words, of so many views, such as `OSEM 3 x 10`.
    pub fn method_text(&self, views: usize) -> String {
        match self.method {
            Method::Osem => format!("OSEM {} x {}", self.iterations, self.subsets_of(views)),
            Method::Fbp => "FBP".into(),
        }
    }

    /// The filter in a few words, such as `Butterworth 0.5 per cm, order 5`.
    pub fn filter_text(&self) -> String {
        match self.filter {
            Filter::Butterworth => format!(
                "Butterworth {} per cm, order {}",
                self.cut_off_per_cm, self.filter_order
            ),
            Filter::Gaussian => format!("Gaussian {} mm", self.fwhm_mm),
            Filter::None => "no filter".into(),
        }
    }
}

/// The method and the filter, without the number of views.
impl fmt::Display for Reconstruction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let method = match self.method {
            Method::Osem => format!("OSEM {} x {}", self.iterations, self.subsets),
            Method::Fbp => "FBP".into(),
        };
        write!(f, "{method}, {}", self.filter_text())
    }
}
