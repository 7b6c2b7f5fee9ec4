//! Constants of the logistic models. Written by `scripts/measure/calibrate.py`: do not edit.
//!
//! In: figures of fits to simulated hearts. Out: for each model of `confidence.rs` the intercept, and
//! of each term the mean and the standard deviation over the calibration set and the weight.

use super::logistic::{Logistic, Term};

/// Size of a cavity, ml, from which that of others is counted.
pub const USUAL_CAVITY_ML: f64 = 55.0;

/// A fit of the apparent wall with a Jaccard index below 0.75.
pub const BAD_FIT_APPARENT: Logistic = Logistic {
    intercept: -2.524,
    terms: &[
        Term::new("active", 0.7538, 0.1554, -1.118),
        Term::new("ln thickness spread / mm", 0.6063, 0.1388, 0.774),
        Term::new("strain", 0.1049, 0.0258, 0.211),
        Term::new("ln unroundness", -2.3805, 0.225, 1.32),
        Term::new("hollowness", 0.5492, 0.1123, 0.082),
    ],
};

/// A fit of the anatomical wall with a Jaccard index below 0.75.
pub const BAD_FIT_ANATOMICAL: Logistic = Logistic {
    intercept: -1.639,
    terms: &[
        Term::new("active", 0.7538, 0.1554, -1.307),
        Term::new("ln thickness spread / mm", 0.6063, 0.1388, 1.008),
        Term::new("strain", 0.1049, 0.0258, 0.678),
        Term::new("ln unroundness", -2.3805, 0.225, 0.632),
        Term::new("hollowness", 0.5492, 0.1123, 0.152),
    ],
};

/// Motion, by the shape of the wall.
pub const MOTION_BY_SHAPE: Logistic = Logistic {
    intercept: -3.36,
    terms: &[
        Term::new("active", 0.7465, 0.153, -1.727),
        Term::new("ln thickness spread / mm", 0.4669, 0.1528, 0.984),
        Term::new("ln cavity / ml", 3.9231, 0.6107, 0.154),
        Term::new("slenderness", 2.3731, 0.188, 0.599),
        Term::new("ln unroundness", -2.4416, 0.2221, 1.009),
        Term::new("offset", 0.0152, 0.0087, 0.278),
        Term::new("dark", 0.0808, 0.1147, -1.688),
        Term::new("beside", 0.055, 0.0624, -1.612),
    ],
};

/// A left ventricle where the model was fitted.
pub const HEART_FITTED: Logistic = Logistic {
    intercept: 1.58,
    terms: &[
        Term::new("hollowness", 0.437, 0.171, 1.66),
        Term::new("agreement", 0.76, 0.203, 2.28),
        Term::new("search", 0.718, 0.364, 1.36),
    ],
};

/// A good fit of the apparent wall, by the fits of several models, without projections.
pub const GOOD_SET_APPARENT: Logistic = Logistic {
    intercept: 0.297,
    terms: &[
        Term::new("mean log odds", 0.0, 1.0, 1.072),
        Term::new("ln cavity / 55 ml", 0.0, 1.0, -0.146),
        Term::new("its square", 0.0, 1.0, 0.126),
    ],
};

/// A good fit of the anatomical wall, likewise.
pub const GOOD_SET_ANATOMICAL: Logistic = Logistic {
    intercept: 0.43,
    terms: &[
        Term::new("mean log odds", 0.0, 1.0, 0.986),
        Term::new("ln cavity / 55 ml", 0.0, 1.0, -0.909),
        Term::new("its square", 0.0, 1.0, -0.157),
    ],
};

/// A good fit of the apparent wall, by the fits of several models and the projections.
pub const GOOD_SET_APPARENT_BY_PROJECTIONS: Logistic = Logistic {
    intercept: -4.506,
    terms: &[
        Term::new("mean log odds", 0.0, 1.0, 0.82),
        Term::new("ln cavity / 55 ml", 0.0, 1.0, -0.478),
        Term::new("its square", 0.0, 1.0, -0.408),
        Term::new("dark", 0.0, 1.0, -4.826),
        Term::new("ln gain", 0.0, 1.0, -1.764),
    ],
};

/// A good fit of the anatomical wall, likewise.
pub const GOOD_SET_ANATOMICAL_BY_PROJECTIONS: Logistic = Logistic {
    intercept: -3.78,
    terms: &[
        Term::new("mean log odds", 0.0, 1.0, 0.82),
        Term::new("ln cavity / 55 ml", 0.0, 1.0, -1.217),
        Term::new("its square", 0.0, 1.0, -0.494),
        Term::new("dark", 0.0, 1.0, -4.167),
        Term::new("ln gain", 0.0, 1.0, -1.386),
    ],
};

/// Motion, by the projections and the shape of the wall.
pub const MOTION_BY_PROJECTIONS: Logistic = Logistic {
    intercept: 6.559,
    terms: &[
        Term::new("ln gain", 0.0, 1.0, 2.55),
        Term::new("log odds by shape", 0.0, 1.0, 0.438),
    ],
};
