//! Ways in which real scans differ from the usual cases, one at a time, on two hearts.
//!
//! The same seeds in every variant, so that nothing else differs. Of `inf_att` and `breast` the lost uptake is an
//! artefact of attenuation, not of perfusion. With `resp` less than half of a voxel may be wall.

use super::draw::{Profile, patient};
use super::parameters::{BodyMotion, Defect, Filter, Method, Parameters};
use std::f64::consts::PI;

/// The two hearts: name, seed, end-diastolic volume (ml), ejection fraction, female.
pub const HEARTS: [(&str, u64, f64, f64, bool); 2] = [
    ("A", 915_001, 118.0, 0.62, false),
    ("B", 915_002, 92.0, 0.67, true),
];

/// The variants.
pub const VARIANTS: [&str; 39] = [
    "base",
    "resp",
    "inf_att",
    "breast",
    "bowel",
    "bowel_mild",
    "stomach",
    "liver",
    "rvh",
    "dshape",
    "lbbb",
    "apthin",
    "aphcm",
    "ash",
    "lvh",
    "small",
    "aneurysm",
    "dilated",
    "tl201",
    "arc360",
    "lowcontrast",
    "acshift",
    "ac",
    "fbpliver",
    "vox9",
    "horizontal",
    "vertical",
    "smooth",
    "threevessel",
    "lcxrv",
    "septinf",
    "hotspot",
    "motion6",
    "step04",
    "step07",
    "step10",
    "step13",
    "creep08",
    "creep16",
];

/// The parameters of a variant of a heart.
pub fn draw(variant: &str, heart: &(&str, u64, f64, f64, bool)) -> Parameters {
    let (name, seed, edv_ml, ef, female) = *heart;
    let usual = Profile {
        edv_ml,
        ef: Some(ef),
        ..Profile::default()
    };
    let mut p = patient(
        &format!("{variant}_{name}"),
        seed,
        variant,
        &profile(variant, usual),
    );
    p.body.female = female;
    p.sex = if female { 'F' } else { 'M' };
    p.reconstruction.filter = Filter::Butterworth {
        cut_off_per_cm: 0.48,
        order: 7,
    };
    change_heart(variant, &mut p);
    change_rest(variant, &mut p);
    p
}

fn profile(variant: &str, usual: Profile) -> Profile {
    let step = |dz_mm: f64| {
        Some(BodyMotion {
            from_view_fraction: 0.5,
            dz_mm,
            ..BodyMotion::default()
        })
    };
    let drift = |drift_mm: f64| {
        Some(BodyMotion {
            drift_mm,
            ..BodyMotion::default()
        })
    };
    let heart = |edv_ml: f64, ef: f64, h0: f64| Profile {
        edv_ml,
        ef: Some(ef),
        h0: Some(h0),
        ..usual.clone()
    };
    match variant {
        "lvh" => heart(72.0, 0.70, 16.0),
        "small" => heart(36.0, 0.78, 8.6),
        "aneurysm" => Profile {
            edv_ml: 400.0,
            ef: Some(0.14),
            ..usual
        },
        "dilated" => heart(330.0, 0.18, 7.5),
        "tl201" => Profile {
            counts_m: 0.9,
            ..usual
        },
        "ac" | "acshift" => Profile {
            attenuation_corrected: true,
            ..usual
        },
        "fbpliver" => Profile {
            method: Method::Fbp,
            ..usual
        },
        "vox9" => Profile {
            spacing_mm: 9.0,
            ..usual
        },
        "horizontal" => Profile {
            direction: Some([82.0, 4.0]),
            ..usual
        },
        "vertical" => Profile {
            direction: Some([28.0, 66.0]),
            ..usual
        },
        "motion6" | "step07" => Profile {
            motion: step(7.0),
            ..usual
        },
        "step04" => Profile {
            motion: step(4.0),
            ..usual
        },
        "step10" => Profile {
            motion: step(10.0),
            ..usual
        },
        "step13" => Profile {
            motion: step(13.0),
            ..usual
        },
        "creep08" => Profile {
            motion: drift(-8.0),
            ..usual
        },
        "creep16" => Profile {
            motion: drift(-16.0),
            ..usual
        },
        _ => usual,
    }
}

fn change_heart(variant: &str, p: &mut Parameters) {
    let heart = &mut p.heart;
    let scar = Defect::scar;
    let right = |uptake: f64, wall_mm: f64| (uptake, wall_mm);
    match variant {
        "inf_att" => {
            heart.defects = vec![Defect::of_uptake(&[3, 4, 5, 9, 10, 11, 15], 0.30)];
        }
        "breast" => heart.defects = vec![Defect::of_uptake(&[1, 6, 7, 12, 13], 0.30)],
        "rvh" => (heart.rv_uptake, heart.rv_wall_mm) = right(1.05, 8.5),
        "dshape" => {
            (heart.rv_uptake, heart.rv_wall_mm) = right(0.95, 8.0);
            heart.septal_flat = 11.0;
        }
        "lbbb" => heart.defects = vec![scar(&[2, 3, 8, 9, 14], 0.38, 0.6, 0.15)],
        "apthin" => heart.apex_thin = 0.78,
        "aphcm" => {
            heart.defects = vec![Defect::of_uptake(&[13, 14, 15, 16, 17], -0.75)];
            heart.apex_thin = -0.6;
        }
        "ash" => (heart.h0, heart.sept_thin, heart.lat_thick) = (11.0, -0.75, -0.05),
        "aneurysm" => {
            heart.defects = vec![scar(&[7, 8, 13, 14, 15, 16, 17], 0.92, 1.0, 0.45)];
            heart.modes_mu = vec![[9.0, PI], [3.0, PI]];
        }
        "tl201" => (heart.blood, heart.rv_uptake) = (0.22, 0.6),
        "lowcontrast" => heart.blood = 0.38,
        "threevessel" => {
            heart.blood = 0.2;
            heart.defects = vec![
                scar(&[1, 7, 13, 17, 8, 14], 0.55, 0.3, 0.1),
                scar(&[5, 11, 6, 12, 16], 0.5, 0.3, 0.1),
                scar(&[3, 4, 9, 10, 15], 0.55, 0.3, 0.1),
            ];
        }
        "lcxrv" => {
            (heart.rv_uptake, heart.rv_wall_mm) = right(1.0, 7.0);
            heart.defects = vec![scar(&[5, 6, 11, 12, 16], 0.9, 0.7, 0.3)];
        }
        "septinf" => {
            heart.defects = vec![scar(&[2, 3, 4, 8, 9, 10, 14, 15], 0.92, 0.8, 0.35)];
        }
        "hotspot" => heart.defects = vec![Defect::of_uptake(&[12], -1.1)],
        _ => {}
    }
}

fn change_rest(variant: &str, p: &mut Parameters) {
    let organs = &mut p.organs;
    let mut liver = |uptake: f64, gap_mm: f64, extent_mm: f64| {
        (
            organs.liver,
            organs.liver_gap_mm,
            organs.liver_left_extent_mm,
        ) = (uptake, gap_mm, extent_mm);
    };
    match variant {
        "liver" => liver(1.7, 0.0, 92.0),
        "fbpliver" => liver(1.5, 2.0, 85.0),
        "bowel" => {
            (organs.gut, organs.gut_gap_mm, organs.gut_radius_mm) = (2.6, -2.0, 15.0);
        }
        "bowel_mild" => {
            (organs.gut, organs.gut_gap_mm, organs.gut_radius_mm) = (1.2, -3.0, 13.0);
        }
        "stomach" => (organs.stomach_wall, organs.spleen) = (1.4, 0.9),
        "lowcontrast" => (organs.lung, organs.soft) = (0.2, 0.18),
        "resp" => (p.breathing.liver_mm, p.breathing.heart_mm) = (34.0, 22.0),
        "small" | "breast" => p.body.female = true,
        "tl201" => {
            organs.lung = 0.16;
            p.acquisition.scatter_to_primary = 0.55;
            p.acquisition.collimator.intrinsic_fwhm_mm = 5.5;
            p.reconstruction.filter = Filter::Butterworth {
                cut_off_per_cm: 0.38,
                order: 7,
            };
        }
        "arc360" => {
            p.acquisition.arc_deg = [0.0, 360.0];
            p.acquisition.orbit = super::parameters::Orbit::Circular;
            p.acquisition.views = 60;
            p.reconstruction.subsets = 10;
        }
        "acshift" => p.reconstruction.mu_map_shift_mm = [14.0, 8.0, 14.0],
        "smooth" => p.reconstruction.filter = Filter::Gaussian { fwhm_mm: 16.0 },
        _ => {}
    }
}
