//! Draws the parameters of a patient, a camera and a reconstruction.
//!
//! In: a [`Profile`] and a seed. Out: [`Parameters`]. What a profile leaves open has the spread of usual patients:
//! walls of 9.6 mm (deviation 0.8), ejection fractions about 64 %, LEHR collimators, half a turn in 60 or 64 views.

use super::parameters::{
    Acquisition, Beat, BeatCurve, Body, BodyMotion, Breathing, Collimator, Cut, Defect, Filter,
    Heart, Method, Observer, Orbit, Organs, Orientation, Parameters, Reconstruction,
};
use super::random::{Draws, Stream};
use serde_json::Value;
use std::f64::consts::TAU;

/// Half of the detector's field, mm, less its border: a body must fit.
const FIELD_BORDER_MM: f64 = 12.0;
/// Millions of counts below which filters are stronger.
const FEW_COUNTS_M: f64 = 7.5;
/// Severity from which a defect can be a scar.
const SCAR_SEVERITY: f64 = 0.7;
/// Greatest sum of severities over the 17 segments.
const MAX_DEFICIT: f64 = 0.33;

/// The groups of segments that defects of a territory have.
pub const TERRITORIES: [Territory; 3] = [
    Territory {
        name: "LAD",
        defects: &[
            &[13, 14, 17],
            &[7, 13, 17],
            &[7, 8, 13, 14, 17],
            &[1, 2, 7, 8, 13, 14, 17],
            &[13, 14, 15, 16, 17],
            &[8, 14],
            &[7],
        ],
        whole: &[1, 2, 7, 8, 13, 14, 17],
        reversible: &[&[7, 8, 13, 14, 17], &[1, 2, 7, 8, 13, 14], &[7, 13, 14, 17]],
    },
    Territory {
        name: "LCX",
        defects: &[
            &[5, 11],
            &[6, 12, 16],
            &[5, 6, 11, 12, 16],
            &[12],
            &[11, 12],
            &[5],
        ],
        whole: &[5, 6, 11, 12, 16],
        reversible: &[&[5, 6, 11, 12, 16], &[5, 11, 12], &[6, 12, 16]],
    },
    Territory {
        name: "RCA",
        defects: &[
            &[4, 10],
            &[3, 4, 9, 10, 15],
            &[4, 10, 15],
            &[10],
            &[3, 9],
            &[4],
        ],
        whole: &[3, 4, 9, 10, 15],
        reversible: &[&[3, 4, 9, 10, 15], &[4, 10, 15]],
    },
];

/// What a coronary artery feeds.
#[derive(Debug, Clone, Copy)]
pub struct Territory {
    /// LAD, LCX or RCA.
    pub name: &'static str,
    /// Groups of segments that one defect takes.
    pub defects: &'static [&'static [usize]],
    /// All of its segments.
    pub whole: &'static [usize],
    /// Groups that are reversible in pairs.
    pub reversible: &'static [&'static [usize]],
}

/// What a kind of case states; the rest is drawn.
#[derive(Debug, Clone)]
#[allow(missing_docs)]
pub struct Profile {
    pub defects: usize,
    pub edv_ml: f64,
    pub ef: Option<f64>,
    /// Thickness of the wall, mm.
    pub h0: Option<f64>,
    pub spacing_mm: f64,
    pub matrix: usize,
    /// Millions of counts.
    pub counts_m: f64,
    pub method: Method,
    pub attenuation_corrected: bool,
    pub liver_adjacent: bool,
    pub gut_near: bool,
    /// Of the long axis about the usual direction, degrees.
    pub orientation_sd: f64,
    /// Azimuth and tilt of the long axis, degrees.
    pub direction: Option<[f64; 2]>,
    pub motion: Option<BodyMotion>,
}

impl Default for Profile {
    fn default() -> Self {
        Self {
            defects: 0,
            edv_ml: 110.0,
            ef: None,
            h0: None,
            spacing_mm: 6.4,
            matrix: 64,
            counts_m: 8.0,
            method: Method::Osem,
            attenuation_corrected: false,
            liver_adjacent: false,
            gut_near: false,
            orientation_sd: 9.0,
            direction: None,
            motion: None,
        }
    }
}

/// The parameters of a case.
pub fn patient(case: &str, seed: u64, made: &str, profile: &Profile) -> Parameters {
    let mut draws = Draws::new(seed, Stream::Patient);
    let d = &mut draws;
    let orientation = orientation(d, profile);
    let female = d.chance(0.4);
    let body = body(d, female, profile);
    let lv_centre_body_mm = [
        -0.30 * body.half_width_mm + d.normal(0.0, 5.0),
        0.17 * body.half_depth_mm + d.normal(0.0, 4.0),
        d.uniform(-15.0, 25.0),
    ];
    let table_z_mm = d.uniform(-150.0, 50.0);
    let heart = heart(d, profile);
    let organs = organs(d, profile);
    let liver_mm = d.uniform(8.0, 18.0);
    let breathing = Breathing {
        liver_mm,
        heart_mm: liver_mm * d.uniform(0.4, 0.65),
    };
    let acquisition = acquisition(d, profile);
    let reconstruction = reconstruction(d, profile, acquisition.views);
    let observer = Observer {
        sd_mm: d.uniform(0.8, 1.5),
        corr_mm: d.uniform(9.0, 14.0),
        bias_mm: d.normal_within(0.0, 0.4, [-0.8, 0.8]),
    };
    Parameters {
        case: case.into(),
        seed,
        noise_seed: seed,
        made: made.into(),
        spacing_mm: profile.spacing_mm,
        sex: if female { 'F' } else { 'M' },
        protocol: None,
        role: None,
        orientation,
        body,
        lv_centre_body_mm,
        table_z_mm,
        heart,
        organs,
        breathing,
        acquisition,
        reconstruction,
        observer,
        value_max: d.uniform(300.0, 3000.0).floor(),
        cut: Cut::Transaxial,
        result: Value::Null,
    }
}

/// Widest half width of a body that the camera holds, mm.
pub fn widest_mm(profile: &Profile) -> f64 {
    profile.matrix as f64 * profile.spacing_mm / 2.0 - FIELD_BORDER_MM
}

fn orientation(d: &mut Draws, profile: &Profile) -> Orientation {
    let sd = profile.orientation_sd;
    let azimuth = d.normal_within(47.0, sd, [27.0, 67.0]);
    let tilt = d.normal_within(27.0, sd, [7.0, 47.0]);
    let roll_deg = d.normal_within(0.0, 6.0, [-15.0, 15.0]);
    let [azimuth_deg, inferior_tilt_deg] = profile.direction.unwrap_or([azimuth, tilt]);
    Orientation {
        azimuth_deg,
        inferior_tilt_deg,
        roll_deg,
    }
}

fn body(d: &mut Draws, female: bool, profile: &Profile) -> Body {
    let scale = d.normal_within(1.0, 0.07, [0.88, 1.18]);
    let width = 165.0 * scale * d.uniform(0.97, 1.05);
    let depth = 112.0 * scale * d.uniform(0.94, 1.08);
    Body {
        female,
        half_width_mm: width.min(widest_mm(profile)),
        half_depth_mm: depth,
        exponent: d.uniform(2.1, 2.5),
        rib_scale: d.uniform(0.82, 0.89),
        offset_mm: [d.normal(0.0, 6.0), d.normal(0.0, 5.0)],
    }
}

fn heart(d: &mut Draws, profile: &Profile) -> Heart {
    let size = ((profile.edv_ml - 110.0) / 70.0).clamp(-1.0, 1.0);
    let (large, small) = (size.max(0.0), (-size).max(0.0));
    let usual_ef = 0.64 - 0.10 * large - 0.05 * profile.defects as f64 + 0.03 * small;
    let ef = d.normal_within(usual_ef, 0.05, [0.25, 0.75]);
    let wave = |d: &mut Draws, sd: f64| [d.normal(0.0, sd), d.uniform(0.0, TAU)];
    let waves = |d: &mut Draws, sds: &[f64]| sds.iter().map(|sd| wave(d, *sd)).collect();
    let h0 = d.normal_within(9.6 - 0.8 * size, 0.8, [7.2, 13.0]);
    Heart {
        edv_ml: profile.edv_ml,
        ef: profile.ef.unwrap_or(ef),
        ratio: d.normal_within(0.45 + 0.05 * large, 0.025, [0.38, 0.60]),
        h0: profile.h0.unwrap_or(h0),
        mu_base: d.uniform(110.0, 120.0),
        memb_dip: d.uniform(10.0, 22.0),
        memb_theta: d.uniform(150.0, 190.0),
        memb_width: d.uniform(38.0, 60.0),
        base_modes: waves(d, &[1.5; 3]),
        modes_theta: waves(d, &[0.8, 2.0, 1.1, 0.5]),
        modes_mu: waves(d, &[1.2, 0.8]),
        septal_flat: d.normal_within(1.4, 0.9, [0.0, 3.5]),
        apex_thin: d.uniform(0.25, 0.45),
        sept_thin: d.normal(0.03, 0.04),
        lat_thick: d.normal(0.0, 0.04),
        thick_modes: waves(d, &[0.04; 3]),
        base_taper: d.uniform(0.15, 0.35),
        shorten: d.uniform(0.08, 0.12),
        uptake_modes: [(1, 0), (2, 0), (0, 1), (1, 1), (0, 2), (0, 3)]
            .map(|(i, j)| {
                [
                    d.normal(0.0, 0.035),
                    f64::from(i),
                    f64::from(j),
                    d.uniform(0.0, TAU),
                ]
            })
            .to_vec(),
        basal_drop: d.uniform(0.05, 0.2),
        field_seed: d.whole(),
        defects: defects(d, profile.defects),
        bend: [d.normal(0.0, 3.0), d.normal(-1.0, 3.0)],
        twist_deg: d.uniform(6.0, 14.0),
        rv_uptake: d.uniform(0.40, 0.70),
        rv_wall_mm: d.uniform(3.5, 5.0),
        blood: d.uniform(0.05, 0.15),
        papillaries: true,
        beat: Beat {
            curve: beat_curve(d),
            regions: Vec::new(),
            delays: Vec::new(),
            offset: 0.0,
        },
    }
}

/// Defects in as many territories, together no larger than usual.
fn defects(d: &mut Draws, count: usize) -> Vec<Defect> {
    loop {
        let territories = d.shuffled(&TERRITORIES);
        let drawn: Vec<Defect> = (territories.iter().take(count))
            .map(|territory| {
                let segments = d.pick(territory.defects);
                let severity = d.uniform(0.2, 1.0);
                let scar = severity > SCAR_SEVERITY && d.chance(0.6);
                Defect {
                    territory: Some(territory.name),
                    segments: segments.to_vec(),
                    severity,
                    shift_theta: d.normal(0.0, 10.0),
                    shift_mu: d.normal(0.0, 5.0),
                    akinesia: if scar {
                        d.uniform(0.4, 0.75)
                    } else {
                        d.uniform(0.0, 0.25)
                    },
                    thinning: if scar { d.uniform(0.10, 0.30) } else { 0.0 },
                }
            })
            .collect();
        let deficit: f64 = drawn
            .iter()
            .map(|x| x.severity * x.segments.len() as f64)
            .sum();
        if deficit / 17.0 <= MAX_DEFICIT {
            return drawn;
        }
    }
}

/// When a ventricle empties and fills: faster hearts reach end systole later in their cycle.
pub fn beat_curve(d: &mut Draws) -> BeatCurve {
    let heart_rate = d.uniform(52.0, 98.0);
    let end_systole = match heart_rate {
        rate if rate > 84.0 => d.uniform(0.36, 0.45),
        rate if rate < 62.0 => d.uniform(0.28, 0.38),
        _ => d.uniform(0.30, 0.43),
    };
    let start = d.uniform(0.01, 0.05);
    // What the atria fill, and what flows between early filling and them.
    let [atrial, slow] = [d.uniform(0.05, 0.35), d.uniform(0.02, 0.12)];
    let half = d.uniform(0.36, 0.52);
    let ejection = |share: f64| start + (end_systole - start) * share;
    let relaxed = end_systole + d.uniform(0.03, 0.08);
    let filled = relaxed + d.uniform(0.14, 0.24);
    let kick = d.uniform(0.80, 0.90).max(filled + 0.04);
    let knots = vec![
        [0.0, 0.0],
        [start, 0.012],
        [ejection(half), 0.5],
        [ejection(half + d.uniform(0.20, 0.30)), 0.85],
        [end_systole, 1.0],
        [relaxed, d.uniform(0.94, 0.985)],
        [
            relaxed + (filled - relaxed) * d.uniform(0.45, 0.6),
            atrial + slow + (1.0 - atrial - slow) * d.uniform(0.30, 0.42),
        ],
        [filled, atrial + slow],
        [kick, atrial],
        [kick + (1.0 - kick) * d.uniform(0.65, 0.98), 0.002],
    ];
    BeatCurve {
        heart_rate,
        rr_ms: 60_000.0 / heart_rate,
        end_systole,
        knots,
    }
}

fn organs(d: &mut Draws, profile: &Profile) -> Organs {
    let (adjacent, near) = (profile.liver_adjacent, profile.gut_near);
    let mut of = |yes: bool, there: [f64; 2], else_: [f64; 2]| {
        let [low, high] = if yes { there } else { else_ };
        d.uniform(low, high)
    };
    let liver = of(adjacent, [0.55, 0.9], [0.3, 0.7]);
    let liver_gap_mm = of(adjacent, [2.0, 6.0], [12.0, 25.0]);
    let liver_left_extent_mm = of(adjacent, [55.0, 85.0], [5.0, 40.0]);
    let gut = of(near, [0.7, 1.2], [0.15, 0.6]);
    let gut_gap_mm = of(near, [3.0, 9.0], [18.0, 40.0]);
    Organs {
        soft: d.uniform(0.04, 0.09),
        fat: d.uniform(0.03, 0.06),
        lung: d.uniform(0.03, 0.06),
        spine: d.uniform(0.08, 0.14),
        liver,
        liver_gap_mm,
        liver_left_extent_mm,
        gut,
        gut_gap_mm,
        gut_radius_mm: d.uniform(9.0, 15.0),
        gut_blur_mm: 0.0,
        stomach_wall: d.uniform(0.1, 0.35),
        stomach_content: d.uniform(0.03, 0.15),
        spleen: d.uniform(0.25, 0.6),
        kidney: d.uniform(0.4, 0.8),
        gallbladder: if d.chance(0.35) {
            d.uniform(0.8, 1.8)
        } else {
            0.0
        },
    }
}

fn acquisition(d: &mut Draws, profile: &Profile) -> Acquisition {
    Acquisition {
        views: *d.pick(&[60, 64]),
        arc_deg: [45.0, 225.0],
        matrix: profile.matrix,
        orbit: if d.chance(0.6) {
            Orbit::Contoured
        } else {
            Orbit::Circular
        },
        gap_mm: d.uniform(20.0, 40.0),
        collimator: Collimator {
            hole_mm: 1.11,
            leff_mm: 23.3,
            back_mm: 6.0,
            intrinsic_fwhm_mm: d.uniform(3.4, 4.0),
        },
        total_counts_m: profile.counts_m,
        scatter_to_primary: d.uniform(0.25, 0.42),
        body_motion: profile.motion,
    }
}

fn reconstruction(d: &mut Draws, profile: &Profile, views: usize) -> Reconstruction {
    let few = profile.counts_m < FEW_COUNTS_M;
    let scatter_corrected = profile.attenuation_corrected && d.chance(0.5);
    let iterations = 4 + d.index(5);
    let butterworth = d.chance(0.6) || profile.method == Method::Fbp;
    let [low, high] = if few { [8.0, 10.0] } else { [6.5, 9.0] };
    let fwhm_mm = d.uniform(low, high);
    let [low, high] = if few { [0.40, 0.50] } else { [0.45, 0.60] };
    let cut_off_per_cm = d.uniform(low, high);
    let order = *d.pick(&[5, 7, 10]);
    Reconstruction {
        method: profile.method,
        attenuation_corrected: profile.attenuation_corrected,
        scatter_corrected,
        mu_map_shift_mm: [0.0; 3],
        subsets: if views == 64 { 8 } else { 10 },
        iterations,
        filter: if butterworth {
            Filter::Butterworth {
                cut_off_per_cm,
                order,
            }
        } else {
            Filter::Gaussian { fwhm_mm }
        },
    }
}
