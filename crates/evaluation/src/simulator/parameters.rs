//! Everything that a case is made of, as `params.json` states it.

use serde::Serialize;
use serde_json::Value;

/// The parameters of one case. Positions are RAS millimetres: x to the right, y anterior, z superior.
#[derive(Debug, Clone, Serialize)]
pub struct Parameters {
    /// The name of the case's folder.
    pub case: String,
    /// The seed of its anatomy.
    pub seed: u64,
    /// The seed of its counts.
    pub noise_seed: u64,
    /// Its kind.
    pub made: String,
    /// Edge of a voxel, and of a detector's bin.
    pub spacing_mm: f64,
    /// `M` or `F`.
    pub sex: char,
    /// The protocol of cases for normal limits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub protocol: Option<String>,
    /// `stress` or `rest`, of a pair's scans.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub role: Option<String>,
    /// Where the long axis points.
    pub orientation: Orientation,
    /// The trunk.
    pub body: Body,
    /// Middle of the ventricle, from the middle of the trunk.
    pub lv_centre_body_mm: [f64; 3],
    /// z of the image's middle in the patient.
    pub table_z_mm: f64,
    /// Both ventricles.
    pub heart: Heart,
    /// Uptake and place of everything else.
    pub organs: Organs,
    /// Movement by breathing.
    pub breathing: Breathing,
    /// How it was scanned.
    pub acquisition: Acquisition,
    /// How the image was made.
    pub reconstruction: Reconstruction,
    /// The reader who drew the masks.
    pub observer: Observer,
    /// The image's largest value.
    pub value_max: f64,
    /// How the image is cut.
    pub cut: Cut,
    /// What follows from all of it.
    pub result: Value,
}

/// Where the long axis points, from base to apex.
#[derive(Debug, Clone, Serialize)]
pub struct Orientation {
    /// To the left from straight ahead.
    pub azimuth_deg: f64,
    /// Downward.
    pub inferior_tilt_deg: f64,
    /// About the axis.
    pub roll_deg: f64,
}

/// The trunk: (|x| / half width)^exponent + (|y| / half depth)^exponent < 1.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct Body {
    pub female: bool,
    pub half_width_mm: f64,
    pub half_depth_mm: f64,
    pub exponent: f64,
    /// The rib cage over the trunk.
    pub rib_scale: f64,
    /// Middle of the trunk in the camera.
    pub offset_mm: [f64; 2],
}

/// Both ventricles. Uptake is in that of healthy muscle.
#[derive(Debug, Clone, Serialize)]
pub struct Heart {
    /// Cavity at end diastole, ml.
    pub edv_ml: f64,
    /// Ejection fraction, 0 to 1.
    pub ef: f64,
    /// Half width over half length of the cavity, as tanh of lambda.
    pub ratio: f64,
    /// Thickness of the wall at end diastole, mm, before what follows.
    pub h0: f64,
    /// mu of the base, degrees.
    pub mu_base: f64,
    /// How far the base lies nearer to the apex at the membranous septum, degrees of mu.
    pub memb_dip: f64,
    /// Where that is, degrees of theta.
    pub memb_theta: f64,
    /// How wide, degrees of theta.
    pub memb_width: f64,
    /// Waves of the base: amplitude (degrees of mu) and phase (rad) of the first, second ... harmonic.
    pub base_modes: Vec<[f64; 2]>,
    /// Waves of the wall around the axis, mm and rad.
    pub modes_theta: Vec<[f64; 2]>,
    /// Waves of the wall along the axis, mm and rad, from the second harmonic on.
    pub modes_mu: Vec<[f64; 2]>,
    /// How far the septum is flattened, mm.
    pub septal_flat: f64,
    /// Share of the thickness that the apex lacks.
    pub apex_thin: f64,
    /// Share of the thickness that the septum lacks.
    pub sept_thin: f64,
    /// Share of the thickness that the lateral wall has more, and the septum less.
    pub lat_thick: f64,
    /// Waves of the thickness around the axis, share and rad.
    pub thick_modes: Vec<[f64; 2]>,
    /// Share of the thickness that the base lacks.
    pub base_taper: f64,
    /// Shortening of the focal length at an ejection fraction of 0.6 or more.
    pub shorten: f64,
    /// Waves of the uptake: amplitude, harmonics of mu and theta, phase (rad).
    pub uptake_modes: Vec<[f64; 4]>,
    /// Share of the uptake that the base lacks.
    pub basal_drop: f64,
    /// Seed of the borders of defects.
    pub field_seed: u64,
    /// Segments with less uptake.
    pub defects: Vec<Defect>,
    /// The long axis's bend to lateral and anterior at the apex, mm.
    pub bend: [f64; 2],
    /// Twist of the apex at end systole, degrees.
    pub twist_deg: f64,
    /// Uptake of the right ventricle.
    pub rv_uptake: f64,
    /// Thickness of its wall, mm.
    pub rv_wall_mm: f64,
    /// Uptake of blood.
    pub blood: f64,
    /// Whether there are papillary muscles in the cavity.
    pub papillaries: bool,
    /// How it moves.
    pub beat: Beat,
}

/// Segments with less uptake.
#[derive(Debug, Clone, Serialize)]
pub struct Defect {
    /// LAD, LCX, RCA, or none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub territory: Option<&'static str>,
    /// AHA segments.
    pub segments: Vec<usize>,
    /// Share of the uptake that is missing. Below 0: more uptake.
    pub severity: f64,
    /// Moved around the axis, degrees.
    pub shift_theta: f64,
    /// Moved towards the base, degrees.
    pub shift_mu: f64,
    /// Share of the motion that is missing.
    pub akinesia: f64,
    /// Share of the thickness that is missing.
    pub thinning: f64,
}

impl Defect {
    /// A defect that takes nothing but uptake.
    pub fn of_uptake(segments: &[usize], severity: f64) -> Self {
        Self {
            territory: None,
            segments: segments.to_vec(),
            severity,
            shift_theta: 0.0,
            shift_mu: 0.0,
            akinesia: 0.0,
            thinning: 0.0,
        }
    }

    /// A scar, which moves less and is thinner.
    pub fn scar(segments: &[usize], severity: f64, akinesia: f64, thinning: f64) -> Self {
        Self {
            akinesia,
            thinning,
            ..Self::of_uptake(segments, severity)
        }
    }
}

/// How a ventricle moves.
#[derive(Debug, Clone, Serialize)]
pub struct Beat {
    /// When.
    pub curve: BeatCurve,
    /// Segments that move less, not at all or outward.
    pub regions: Vec<WeakRegion>,
    /// Segments that move late.
    pub delays: Vec<LateRegion>,
    /// Start of the first gate, in cycles from the R wave.
    pub offset: f64,
}

/// The way from end diastole to end systole over a cycle.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct BeatCurve {
    pub heart_rate: f64,
    pub rr_ms: f64,
    /// In cycles from the R wave.
    pub end_systole: f64,
    /// Time in cycles, and the way: 0 at end diastole, 1 at end systole.
    pub knots: Vec<[f64; 2]>,
}

/// Segments that move less.
#[derive(Debug, Clone, Serialize)]
pub struct WeakRegion {
    /// Its name.
    pub area: String,
    /// AHA segments.
    pub segments: Vec<usize>,
    /// 1 moves as the rest, 0 keeps its thickness, below 0 moves outward.
    pub contraction: f64,
}

/// Segments that move late.
#[derive(Debug, Clone, Serialize)]
pub struct LateRegion {
    /// Its name.
    pub wall: String,
    /// AHA segments.
    pub segments: Vec<usize>,
    /// How late, degrees of the cycle.
    pub degrees: f64,
}

/// Uptake and place of everything but the heart. Uptake is in that of healthy muscle.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct Organs {
    pub soft: f64,
    pub fat: f64,
    pub lung: f64,
    pub spine: f64,
    pub liver: f64,
    /// From the lowest muscle to the liver's left lobe.
    pub liver_gap_mm: f64,
    /// How far the liver reaches to the left.
    pub liver_left_extent_mm: f64,
    pub gut: f64,
    /// From the lowest muscle to the gut.
    pub gut_gap_mm: f64,
    pub gut_radius_mm: f64,
    /// Blur of the gut by its own movement, full width at half maximum.
    pub gut_blur_mm: f64,
    pub stomach_wall: f64,
    pub stomach_content: f64,
    pub spleen: f64,
    pub kidney: f64,
    /// 0: none.
    pub gallbladder: f64,
}

/// Movement from head to foot by breathing, from end to end.
#[derive(Debug, Clone, Serialize)]
#[allow(missing_docs)]
pub struct Breathing {
    pub liver_mm: f64,
    pub heart_mm: f64,
}

/// How a scan was made.
#[derive(Debug, Clone, Serialize)]
pub struct Acquisition {
    /// Views.
    pub views: usize,
    /// First and last angle of the arc; 45 is right anterior oblique.
    pub arc_deg: [f64; 2],
    /// Bins of the detector, and voxels, along an axis.
    pub matrix: usize,
    /// The detector's way around the patient.
    pub orbit: Orbit,
    /// From the body to the detector.
    pub gap_mm: f64,
    /// What limits the resolution.
    pub collimator: Collimator,
    /// Millions of counts.
    #[serde(rename = "total_counts_M")]
    pub total_counts_m: f64,
    /// Scattered over unscattered counts.
    pub scatter_to_primary: f64,
    /// The patient's movement.
    pub body_motion: Option<BodyMotion>,
}

/// The detector's way around the patient.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Orbit {
    /// Near to the body in every view.
    Contoured,
    /// As far in every view as in the farthest.
    Circular,
}

/// A collimator with parallel holes: its width at a distance is hole (1 + (distance + back) / length).
#[derive(Debug, Clone, Copy, Serialize)]
#[allow(missing_docs)]
pub struct Collimator {
    pub hole_mm: f64,
    /// Length of the holes, without what gamma rays pass through.
    pub leff_mm: f64,
    /// From the collimator to the middle of the crystal.
    pub back_mm: f64,
    /// Full width at half maximum of the crystal.
    pub intrinsic_fwhm_mm: f64,
}

/// The patient's movement, towards the head and across the table.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct BodyMotion {
    /// When a step begins, as a share of the views.
    pub from_view_fraction: f64,
    /// The step.
    pub dz_mm: f64,
    /// A slow drift, over all views.
    pub drift_mm: f64,
    /// Share of the views after which the patient is back; 0 stays away.
    pub bounce_fraction: f64,
    /// The step across the table: to the left and to the back.
    pub across_mm: [f64; 2],
}

impl BodyMotion {
    /// How far towards the head the patient lies from the first place in a view.
    pub fn at(&self, view: usize, views: usize) -> f64 {
        let share = view as f64 / (views.max(2) - 1) as f64;
        let step = if self.is_away(view, views) {
            self.dz_mm
        } else {
            0.0
        };
        self.drift_mm * share + step
    }

    /// How far to the left and to the back.
    pub fn across(&self, view: usize, views: usize) -> [f64; 2] {
        if self.is_away(view, views) {
            self.across_mm
        } else {
            [0.0; 2]
        }
    }

    fn is_away(&self, view: usize, views: usize) -> bool {
        let since = view as f64 / views as f64 - self.from_view_fraction;
        since >= 0.0 && (self.bounce_fraction == 0.0 || since < self.bounce_fraction)
    }
}

/// How an image is made of projections.
#[derive(Debug, Clone, Serialize)]
pub struct Reconstruction {
    /// The method.
    pub method: Method,
    /// Whether the method knows the attenuation.
    pub attenuation_corrected: bool,
    /// Whether it knows the scatter.
    pub scatter_corrected: bool,
    /// How far the map of attenuation lies off.
    pub mu_map_shift_mm: [f64; 3],
    /// Subsets of OSEM.
    pub subsets: usize,
    /// Iterations of OSEM.
    pub iterations: usize,
    /// The filter: of projections before FBP, of the image after OSEM.
    pub filter: Filter,
}

/// A method of reconstruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Method {
    /// Ordered subsets expectation maximisation (Hudson and Larkin 1994).
    #[serde(rename = "OSEM")]
    Osem,
    /// Filtered back projection.
    #[serde(rename = "FBP")]
    Fbp,
}

/// A low-pass filter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "name", rename_all = "snake_case")]
pub enum Filter {
    /// 1 / sqrt(1 + (f / cut-off)^(2 order)).
    Butterworth {
        /// Frequency at which half of the power is left.
        cut_off_per_cm: f64,
        /// Steepness.
        order: u32,
    },
    /// (1 + cos(pi f / cut-off)) / 2 below the cut-off, 0 above it.
    Hann {
        /// Frequency from which nothing is left.
        cut_off_per_cm: f64,
    },
    /// A normal distribution.
    Gaussian {
        /// Full width at half maximum.
        fwhm_mm: f64,
    },
}

impl Filter {
    /// The share of a frequency (per cm) that is left.
    pub fn gain(&self, per_cm: f64) -> f64 {
        match *self {
            Filter::Butterworth {
                cut_off_per_cm,
                order,
            } => 1.0 / (1.0 + (per_cm / cut_off_per_cm).powi(2 * order as i32)).sqrt(),
            Filter::Hann { cut_off_per_cm } if per_cm < cut_off_per_cm => {
                0.5 * (1.0 + (std::f64::consts::PI * per_cm / cut_off_per_cm).cos())
            }
            Filter::Hann { .. } => 0.0,
            Filter::Gaussian { fwhm_mm } => {
                let sd_cm = fwhm_mm / super::grid::FWHM_PER_SD / 10.0;
                (-2.0 * (std::f64::consts::PI * per_cm * sd_cm).powi(2)).exp()
            }
        }
    }
}

/// How a reader's borders differ from the true ones.
#[derive(Debug, Clone, Copy, Serialize)]
#[allow(missing_docs)]
pub struct Observer {
    pub sd_mm: f64,
    /// Distance over which differences are alike.
    pub corr_mm: f64,
    pub bias_mm: f64,
}

/// How an image is cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cut {
    /// Slices across the patient.
    Transaxial,
    /// Slices across the long axis.
    ShortAxis,
}
