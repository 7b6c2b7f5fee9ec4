//! Kinds of single scans: what each draws, in the range of usual patients and beyond it.
//!
//! The first fourteen are those that the judgement was calibrated with. The others are what real departments have:
//! gut far hotter than the heart, other filters, slow movement, slices across the long axis, other cameras, few counts.

use super::draw::{Profile, TERRITORIES, patient};
use super::parameters::{BodyMotion, Collimator, Cut, Defect, Filter, Method, Orbit, Parameters};
use super::random::{Draws, Stream};

/// A kind of scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Usual.
    In,
    /// A step of 6 to 26 mm towards the head.
    Motion,
    /// A hot, thick right ventricle.
    Rv,
    /// A dark segment at the base.
    Basal,
    /// A dark apex.
    Apex,
    /// One or two whole territories dark.
    Infarct,
    /// Large and weak.
    Large,
    /// Small.
    Small,
    /// 0.5 to 2 million counts.
    Noise,
    /// Gut beside the heart up to three times as hot.
    Gut,
    /// Liver beside the heart.
    Liver,
    /// Voxels of 6.8 mm.
    Coarse,
    /// An axis that points elsewhere.
    Turned,
    /// No uptake in the heart.
    None,
    /// Gut up to 20 times as hot as the heart, blurred by up to 12 mm more.
    HotGut,
    /// Sharp and smooth filters, Hann too.
    Filter,
    /// A slow drift, or a step and back.
    Drift,
    /// Slices across the long axis.
    Cut,
    /// Another collimator, orbit, arc and voxel.
    Camera,
    /// 1 to 3.5 million counts.
    Few,
    /// Without defects.
    Healthy,
    /// Half of the apex dark.
    HalfApex,
    /// One segment of the apex dark, with its tip or without.
    OneApex,
    /// The apex and a territory dark.
    ApexPlus,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Kind; 24] = [
        Kind::In,
        Kind::Motion,
        Kind::Rv,
        Kind::Basal,
        Kind::Apex,
        Kind::Infarct,
        Kind::Large,
        Kind::Small,
        Kind::Noise,
        Kind::Gut,
        Kind::Liver,
        Kind::Coarse,
        Kind::Turned,
        Kind::None,
        Kind::HotGut,
        Kind::Filter,
        Kind::Drift,
        Kind::Cut,
        Kind::Camera,
        Kind::Few,
        Kind::Healthy,
        Kind::HalfApex,
        Kind::OneApex,
        Kind::ApexPlus,
    ];

    /// The kinds that the judgement was calibrated with.
    pub const USUAL: usize = 14;

    /// Its name on the command line and in params.json.
    pub fn name(self) -> &'static str {
        match self {
            Kind::In => "in",
            Kind::Motion => "motion",
            Kind::Rv => "rv",
            Kind::Basal => "basal",
            Kind::Apex => "apex",
            Kind::Infarct => "infarct",
            Kind::Large => "large",
            Kind::Small => "small",
            Kind::Noise => "noise",
            Kind::Gut => "gut",
            Kind::Liver => "liver",
            Kind::Coarse => "coarse",
            Kind::Turned => "turned",
            Kind::None => "none",
            Kind::HotGut => "hotgut",
            Kind::Filter => "filter",
            Kind::Drift => "drift",
            Kind::Cut => "cut",
            Kind::Camera => "camera",
            Kind::Few => "few",
            Kind::Healthy => "healthy",
            Kind::HalfApex => "halfapex",
            Kind::OneApex => "oneapex",
            Kind::ApexPlus => "apexplus",
        }
    }

    /// The kind of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// The grid of cases.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampling {
    /// 128 voxels of 3.3, 4.0 or 4.8 mm along an axis.
    Fine,
    /// 64 voxels of 6.0, 6.4 or 6.8 mm.
    Coarse,
}

/// The parameters of a case of a kind.
pub fn draw(kind: Kind, case: &str, seed: u64, sampling: Sampling) -> Parameters {
    let mut draws = Draws::new(seed, Stream::Kind);
    let d = &mut draws;
    let profile = profile(kind, d, sampling);
    let mut p = patient(case, seed, kind.name(), &profile);
    alter(kind, d, &mut p);
    p
}

/// What a kind states before a patient is drawn.
fn profile(kind: Kind, d: &mut Draws, sampling: Sampling) -> Profile {
    let fine = sampling == Sampling::Fine;
    let defects = d.index(if kind == Kind::In { 4 } else { 2 });
    let spacings = if fine {
        [3.3, 4.0, 4.8]
    } else {
        [6.0, 6.4, 6.8]
    };
    let method = if d.chance(0.25) {
        Method::Fbp
    } else {
        Method::Osem
    };
    let usual = Profile {
        defects,
        edv_ml: d.uniform(55.0, 180.0),
        spacing_mm: *d.pick(&spacings),
        matrix: if fine { 128 } else { 64 },
        counts_m: d.uniform(4.0, 13.0),
        method,
        attenuation_corrected: method == Method::Osem && d.chance(0.4),
        liver_adjacent: d.chance(0.35),
        gut_near: d.chance(0.3),
        ..Profile::default()
    };
    match kind {
        Kind::Motion => {
            let motion = BodyMotion {
                from_view_fraction: d.uniform(0.3, 0.7),
                dz_mm: d.uniform(6.0, 26.0),
                ..BodyMotion::default()
            };
            Profile {
                motion: Some(motion),
                ..usual
            }
        }
        Kind::Large => Profile {
            edv_ml: d.uniform(220.0, 420.0),
            ef: Some(d.uniform(0.12, 0.3)),
            ..usual
        },
        Kind::Small => Profile {
            edv_ml: d.uniform(22.0, 45.0),
            ef: Some(d.uniform(0.75, 0.88)),
            h0: Some(d.uniform(10.0, 13.0)),
            ..usual
        },
        Kind::Noise => Profile {
            counts_m: d.uniform(0.5, 2.0),
            ..usual
        },
        Kind::Healthy => Profile {
            defects: 0,
            ..usual
        },
        Kind::Few => Profile {
            counts_m: d.uniform(1.0, 3.5),
            ..usual
        },
        Kind::Coarse => Profile {
            matrix: 64,
            spacing_mm: 6.8,
            ..usual
        },
        Kind::Turned => {
            let direction = [d.uniform(-60.0, 90.0), d.uniform(-10.0, 75.0)];
            Profile {
                direction: Some(direction),
                ..usual
            }
        }
        Kind::Gut | Kind::HotGut => Profile {
            gut_near: true,
            ..usual
        },
        Kind::Liver => Profile {
            liver_adjacent: true,
            ..usual
        },
        Kind::Drift => {
            let motion = if d.chance(0.5) {
                BodyMotion {
                    drift_mm: d.uniform(-18.0, 18.0),
                    ..BodyMotion::default()
                }
            } else {
                BodyMotion {
                    from_view_fraction: d.uniform(0.2, 0.6),
                    dz_mm: d.uniform(5.0, 20.0),
                    bounce_fraction: d.uniform(0.1, 0.3),
                    ..BodyMotion::default()
                }
            };
            Profile {
                motion: Some(motion),
                ..usual
            }
        }
        Kind::Camera => Profile {
            matrix: 64,
            spacing_mm: *d.pick(&[5.0, 6.0, 6.4, 7.2, 8.0]),
            ..usual
        },
        _ => usual,
    }
}

/// What a kind changes of a drawn patient.
fn alter(kind: Kind, d: &mut Draws, p: &mut Parameters) {
    match kind {
        Kind::Rv => {
            p.heart.rv_uptake = d.uniform(0.8, 1.5);
            p.heart.rv_wall_mm = d.uniform(5.0, 9.0);
            p.heart.defects = Vec::new();
            if d.chance(0.6) {
                let count = d.index(5);
                let septum = &d.shuffled(&[2, 3, 8, 9, 14])[..count];
                p.heart.defects = vec![Defect::scar(septum, 0.9, 0.4, 0.2)];
            }
        }
        Kind::Basal => {
            let segment = 1 + d.index(6);
            p.heart.defects = vec![Defect::scar(&[segment], d.uniform(0.6, 1.0), 0.4, 0.2)];
        }
        Kind::Apex => {
            let small = d.chance(0.5);
            let segments: &[usize] = if small {
                &[13, 14, 17]
            } else {
                &[13, 14, 15, 16, 17]
            };
            p.heart.defects = vec![Defect::scar(segments, d.uniform(0.8, 1.0), 0.7, 0.2)];
        }
        Kind::HalfApex => {
            let halves: [&[usize]; 4] =
                [&[13, 14, 17], &[14, 15, 17], &[15, 16, 17], &[13, 16, 17]];
            let half = *d.pick(&halves);
            p.heart.defects = vec![Defect::scar(half, d.uniform(0.85, 1.0), 0.7, 0.2)];
        }
        Kind::OneApex => {
            let mut segments = vec![13 + d.index(4)];
            if d.chance(0.5) {
                segments.push(17);
            }
            p.heart.defects = vec![Defect::scar(&segments, d.uniform(0.85, 1.0), 0.7, 0.2)];
        }
        Kind::ApexPlus => {
            let territory = d.pick(&TERRITORIES).whole;
            let beside = territory.iter().copied().filter(|segment| *segment < 13);
            let segments: Vec<usize> = (13..=17).chain(beside).collect();
            p.heart.defects = vec![Defect::scar(&segments, d.uniform(0.85, 1.0), 0.6, 0.25)];
        }
        Kind::Infarct => {
            let count = 1 + d.index(2);
            let territories = d.shuffled(&TERRITORIES);
            p.heart.defects = (territories.iter().take(count))
                .map(|t| Defect::scar(t.whole, d.uniform(0.7, 1.0), 0.6, 0.25))
                .collect();
        }
        Kind::Gut => {
            p.organs.gut = d.uniform(1.0, 3.0);
            p.organs.gut_gap_mm = d.uniform(-4.0, 6.0);
            p.organs.gut_radius_mm = d.uniform(10.0, 16.0);
        }
        Kind::HotGut => {
            p.organs.gut = d.uniform(3.0, 20.0);
            p.organs.gut_gap_mm = d.uniform(0.0, 15.0);
            p.organs.gut_radius_mm = d.uniform(8.0, 16.0);
            p.organs.gut_blur_mm = d.uniform(0.0, 12.0);
        }
        Kind::Liver => {
            p.organs.liver = d.uniform(0.8, 2.0);
            p.organs.liver_gap_mm = d.uniform(0.0, 4.0);
            p.organs.liver_left_extent_mm = d.uniform(70.0, 95.0);
        }
        // A heart on the right side.
        Kind::Turned if p.orientation.azimuth_deg < 0.0 => {
            p.lv_centre_body_mm[0] = -p.lv_centre_body_mm[0];
        }
        Kind::None => {
            let all: Vec<usize> = (1..=17).collect();
            p.heart.defects = vec![Defect::of_uptake(&all, 0.93)];
            p.heart.rv_uptake = 0.05;
        }
        Kind::Filter => {
            p.reconstruction.filter = match d.index(3) {
                0 => Filter::Hann {
                    cut_off_per_cm: d.uniform(0.5, 1.0),
                },
                1 => Filter::Gaussian {
                    fwhm_mm: d.uniform(4.0, 16.0),
                },
                _ => Filter::Butterworth {
                    cut_off_per_cm: d.uniform(0.22, 0.75),
                    order: *d.pick(&[3, 5, 7, 10]),
                },
            };
        }
        Kind::Cut => p.cut = Cut::ShortAxis,
        Kind::Camera => camera(d, p),
        _ => {}
    }
}

/// Another collimator, orbit and arc.
fn camera(d: &mut Draws, p: &mut Parameters) {
    let a = &mut p.acquisition;
    // High resolution, all purpose, medium energy.
    let [hole_mm, leff_mm] = *d.pick(&[[1.11, 23.3], [1.45, 23.5], [1.9, 30.0], [1.5, 34.0]]);
    let intrinsic_fwhm_mm = d.uniform(3.0, 5.5);
    a.collimator = Collimator {
        hole_mm,
        leff_mm,
        back_mm: 6.0,
        intrinsic_fwhm_mm,
    };
    a.orbit = if d.chance(0.5) {
        Orbit::Contoured
    } else {
        Orbit::Circular
    };
    a.gap_mm = d.uniform(15.0, 70.0);
    a.views = *d.pick(&[30, 32, 60, 64]);
    if d.chance(0.3) {
        a.arc_deg = [0.0, 360.0];
        a.views = *d.pick(&[60, 64, 120]);
    }
    p.reconstruction.subsets = match a.views {
        30 | 32 => 4,
        views if views % 8 == 0 => 8,
        _ => 10,
    };
}
