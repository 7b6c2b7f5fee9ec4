//! Hearts whose walls are 5 to 22 mm thick at end diastole: even, in the septum, at the apex.
//!
//! Thick walls go with small cavities and high ejection fractions, thin ones with large cavities, but not always. Every
//! reconstruction takes part, so that nothing learnt on them can tell a wall by its filter.

use super::draw::{Profile, patient};
use super::parameters::{Filter, Method, Parameters};
use super::random::{Draws, Stream};

/// Thickness of the walls, mm.
const WALL_MM: [f64; 2] = [5.0, 22.0];

/// A drawn wall: its thickness (mm), end-diastolic volume (ml) and ejection fraction.
pub fn heart(d: &mut Draws) -> [f64; 3] {
    let wall_mm = d.uniform(WALL_MM[0], WALL_MM[1]);
    let thick = (wall_mm - 10.0) / 10.0;
    let edv_ml = d.normal_within(112.0 - 30.0 * thick, 30.0, [45.0, 240.0]);
    [
        wall_mm,
        edv_ml,
        d.normal_within(0.60 + 0.06 * thick, 0.08, [0.22, 0.80]),
    ]
}

/// The parameters of a scan.
pub fn draw(case: &str, seed: u64) -> Parameters {
    let mut draws = Draws::new(seed, Stream::Kind);
    let d = &mut draws;
    let [wall_mm, edv_ml, ef] = heart(d);
    let shape = *d.pick(&["concentric", "concentric", "concentric", "septum", "apex"]);
    let butterworth = |d: &mut Draws, low: f64, high: f64| Filter::Butterworth {
        cut_off_per_cm: d.uniform(low, high),
        order: 7,
    };
    let (method, attenuation_corrected, filter) = match d.index(3) {
        0 => (Method::Osem, false, butterworth(d, 0.40, 0.60)),
        1 => (
            Method::Osem,
            true,
            Filter::Gaussian {
                fwhm_mm: d.uniform(6.0, 10.0),
            },
        ),
        _ => (Method::Fbp, false, butterworth(d, 0.36, 0.52)),
    };
    let profile = Profile {
        defects: d.index(2),
        edv_ml,
        ef: Some(ef),
        h0: Some(wall_mm),
        spacing_mm: *d.pick(&[6.0, 6.4, 6.8]),
        counts_m: d.uniform(2.0, 10.0),
        method,
        attenuation_corrected,
        liver_adjacent: d.chance(0.2),
        gut_near: d.chance(0.2),
        ..Profile::default()
    };
    let mut p = patient(
        case,
        seed,
        &format!("walls {shape} {wall_mm:.1} mm"),
        &profile,
    );
    p.reconstruction.filter = filter;
    match shape {
        "septum" => (p.heart.sept_thin, p.heart.lat_thick) = (-0.6, -0.05),
        "apex" => p.heart.apex_thin = -0.5,
        _ => {}
    }
    p
}
