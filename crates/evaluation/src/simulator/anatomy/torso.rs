//! The trunk around the heart: uptake and attenuation of lungs, liver, gut and the rest.
//!
//! In: [`Parameters`] and where the heart lies. Out: images of uptake and attenuation without the heart ([`Torso`]).
//! Organs are ellipsoids below the diaphragm; the gut is a loop of tube below the heart. What moves with breathing is
//! blurred from head to foot.

use super::{Place, Vec3, breathing};
use crate::simulator::grid::{Beyond, FWHM_PER_SD, Grid};
use crate::simulator::parameters::{Body, Organs, Parameters};
use crate::simulator::random::{Draws, Stream};
use std::f64::consts::PI;

/// Attenuation of soft tissue at 140 keV, per mm.
pub const SOFT_PER_MM: f32 = 0.0152;
const TRUNK_PER_MM: f32 = 0.0150;
const CHEST_WALL_PER_MM: f32 = 0.0146;
const BREAST_PER_MM: f32 = 0.0142;
const LUNG_PER_MM: f32 = 0.0045;
const SPINE_PER_MM: f32 = 0.0195;
/// Points of the gut's loop.
const GUT_POINTS: usize = 60;
/// Share of the stomach's radius, squared, from which its wall begins.
const STOMACH_WALL: f64 = 0.72;

/// Where the heart lies, in the trunk's frame.
#[derive(Debug, Clone, Copy)]
pub struct HeartSite {
    /// Middle of the base.
    pub base: Vec3,
    /// Middle of the long axis.
    pub middle: Vec3,
    /// To the apex.
    pub apex: Vec3,
    /// To the lateral wall.
    pub lateral: Vec3,
    /// The wall's lowest point.
    pub lowest: Vec3,
}

/// Images of the trunk.
#[derive(Debug, Clone)]
pub struct Torso {
    /// Uptake.
    pub uptake: Grid,
    /// Attenuation, per mm.
    pub attenuation: Grid,
}

/// An ellipsoid along the axes.
#[derive(Debug, Clone, Copy)]
struct Ellipsoid {
    centre: [f64; 3],
    half_axes: [f64; 3],
}

impl Ellipsoid {
    fn new(centre: [f64; 3], half_axes: [f64; 3]) -> Self {
        Self { centre, half_axes }
    }

    fn about(centre: &Vec3, half_axes: [f64; 3]) -> Self {
        Self::new([centre.x, centre.y, centre.z], half_axes)
    }

    /// Squared radius: below 1 inside.
    fn radius2(&self, at: &[f64; 3]) -> f64 {
        (0..3)
            .map(|i| ((at[i] - self.centre[i]) / self.half_axes[i]).powi(2))
            .sum()
    }

    fn holds(&self, at: &[f64; 3]) -> bool {
        self.radius2(at) < 1.0
    }
}

/// One dome of the diaphragm: a height, and where it is highest.
#[derive(Debug, Clone, Copy)]
struct Dome {
    top: f64,
    x: f64,
    y: f64,
}

/// Fall of a dome at the trunk's border, mm.
const DOME_FALL_MM: f64 = 62.0;

/// The shapes of a trunk.
struct Shapes<'a> {
    body: &'a Body,
    organs: &'a Organs,
    blood: f64,
    domes: [Dome; 3],
    liver: [Ellipsoid; 4],
    stomach: Ellipsoid,
    spleen: Ellipsoid,
    kidneys: [Ellipsoid; 2],
    gallbladder: Ellipsoid,
    great_vessels: [Ellipsoid; 3],
    mediastinum: [Ellipsoid; 2],
    breasts: [Ellipsoid; 2],
    gut: Vec<[f64; 3]>,
}

/// What is at a point.
#[derive(Debug, Clone, Copy, Default)]
struct Tissue {
    uptake: f64,
    per_mm: f32,
    /// What an organ that breathes adds.
    breathing: f64,
    /// What the gut adds.
    gut: f64,
}

impl Torso {
    /// The trunk at a place.
    pub fn new(parameters: &Parameters, site: &HeartSite, place: &Place) -> Self {
        let shapes = &Shapes::new(parameters, site);
        let [cx, cy] = parameters.body.offset_mm;
        let [uptake, attenuation, mut breathing, mut gut] =
            Grid::from_columns(place.shape, |x, y| {
                let at = place.at([x, y, 0]) - Vec3::new(cx, cy, 0.0);
                let column = shapes.column(at.x, at.y)?;
                Some(move |z: usize| {
                    let tissue = column.at(shapes, at.z + place.step_mm * z as f64);
                    let numbers = [
                        tissue.uptake,
                        f64::from(tissue.per_mm),
                        tissue.breathing,
                        tissue.gut,
                    ];
                    numbers.map(|n| n as f32)
                })
            });
        let kernel = breathing::kernel(parameters.breathing.liver_mm, place.step_mm);
        if parameters.organs.gut_blur_mm > 0.0 {
            gut.blur([parameters.organs.gut_blur_mm / FWHM_PER_SD / place.step_mm; 3]);
        }
        for (breathing, gut) in breathing.values.iter_mut().zip(&gut.values) {
            *breathing += gut;
        }
        breathing.convolve(2, &kernel, Beyond::Border);
        let mut torso = Self {
            uptake,
            attenuation,
        };
        for (uptake, organ) in torso.uptake.values.iter_mut().zip(&breathing.values) {
            *uptake = (*uptake + organ).max(0.0);
        }
        torso
    }
}

impl<'a> Shapes<'a> {
    fn new(parameters: &'a Parameters, site: &HeartSite) -> Self {
        let (body, organs) = (&parameters.body, &parameters.organs);
        let [w, d] = [body.half_width_mm, body.half_depth_mm];
        let heart = parameters.lv_centre_body_mm;
        let mut draws = Draws::new(parameters.seed, Stream::Organs);
        let low = site.lowest.z;
        let left_top = low - organs.liver_gap_mm;
        let right_top = low + draws.uniform(5.0, 25.0);
        let reach = organs.liver_left_extent_mm;
        let dome = |top: f64, x: f64, y: f64| Dome { top, x, y };
        let base = site.base;
        Self {
            body,
            organs,
            blood: parameters.heart.blood,
            domes: [
                dome(right_top, 0.45 * w, 0.0),
                dome(low + 2.0, -0.52 * w, -0.25 * d),
                dome(low - 2.0, heart[0], heart[1]),
            ],
            liver: [
                // Right lobe, left lobe, what joins them, the lower tip.
                Ellipsoid::new(
                    [0.45 * w, -0.02 * d, right_top - 85.0],
                    [0.44 * w, 0.8 * d, 83.0],
                ),
                Ellipsoid::new(
                    [0.5 * (0.35 * w - reach), 0.33 * d, left_top - 33.0],
                    [0.5 * (0.35 * w + reach), 0.45 * d, 31.0],
                ),
                Ellipsoid::new(
                    [0.25 * w, 0.2 * d, right_top - 60.0],
                    [0.33 * w, 0.55 * d, 52.0],
                ),
                Ellipsoid::new([0.5 * w, 0.0, right_top - 125.0], [0.3 * w, 0.55 * d, 70.0]),
            ],
            stomach: Ellipsoid::new([-0.42 * w, 0.0, low - 52.0], [0.24 * w, 0.36 * d, 40.0]),
            spleen: Ellipsoid::new([-0.66 * w, -0.48 * d, low - 42.0], [26.0, 40.0, 48.0]),
            kidneys: [
                Ellipsoid::new([0.36 * w, -0.48 * d, low - 150.0], [28.0, 25.0, 55.0]),
                Ellipsoid::new([-0.36 * w, -0.48 * d, low - 138.0], [28.0, 25.0, 55.0]),
            ],
            gallbladder: Ellipsoid::new(
                [0.25 * w, 0.42 * d, right_top - 110.0],
                [13.0, 13.0, 24.0],
            ),
            great_vessels: [
                Ellipsoid::about(&(base - 26.0 * site.apex), [34.0, 26.0, 26.0]),
                Ellipsoid::about(
                    &(base - 16.0 * site.apex - 38.0 * site.lateral),
                    [27.0, 27.0, 30.0],
                ),
                Ellipsoid::about(&(base + Vec3::new(12.0, 6.0, 40.0)), [17.0, 17.0, 50.0]),
            ],
            mediastinum: [
                Ellipsoid::about(&site.middle, [62.0, 52.0, 56.0]),
                Ellipsoid::about(
                    &(base - 15.0 * site.apex + Vec3::new(22.0, 0.0, 8.0)),
                    [62.0, 50.0, 62.0],
                ),
            ],
            breasts: [-0.48, 0.48].map(|side| {
                Ellipsoid::new(
                    [side * w, 0.8 * d, heart[2] - 10.0],
                    [0.33 * w, 0.42 * d, 62.0],
                )
            }),
            gut: gut(organs, site, &mut draws),
        }
    }

    /// What is the same along z at (x, y); `None` outside of the trunk.
    fn column(&self, x: f64, y: f64) -> Option<Column> {
        let body = self.body;
        let radius = |scale: f64| {
            (x.abs() / (body.half_width_mm * scale)).powf(body.exponent)
                + (y.abs() / (body.half_depth_mm * scale)).powf(body.exponent)
        };
        let in_trunk = radius(1.0) < 1.0;
        if !in_trunk && (!body.female || y <= 0.0) {
            return None;
        }
        let [w, d] = [body.half_width_mm, body.half_depth_mm];
        let height = |dome: &Dome| {
            dome.top - DOME_FALL_MM * (((x - dome.x) / w).powi(2) + ((y - dome.y) / d).powi(2))
        };
        let spine = (x / 19.0).powi(2) + ((y + 0.66 * d) / 21.0).powi(2);
        Some(Column {
            x,
            y,
            in_trunk,
            in_ribs: radius(body.rib_scale) < 1.0,
            in_spine: spine < 1.0,
            in_midline: x.abs() < 30.0 + 12.0 * (y / d).powi(2),
            diaphragm: self.domes.iter().map(height).fold(f64::MIN, f64::max),
        })
    }

    /// Uptake of the organ at a point below the diaphragm, 0 of none, and whether it is the gut.
    fn organ(&self, at: &[f64; 3], diaphragm: f64) -> (f64, bool) {
        let organs = self.organs;
        let mut uptake = 0.0;
        if at[2] < diaphragm - 2.0 && self.liver.iter().any(|part| part.holds(at)) {
            uptake = organs.liver;
        }
        let stomach = self.stomach.radius2(at);
        if stomach < 1.0 && uptake == 0.0 {
            let in_wall = stomach > STOMACH_WALL;
            uptake = if in_wall {
                organs.stomach_wall
            } else {
                organs.stomach_content
            };
        }
        if uptake == 0.0 && self.spleen.holds(at) {
            uptake = organs.spleen;
        }
        if self.kidneys.iter().any(|kidney| kidney.holds(at)) {
            uptake = organs.kidney;
        }
        if organs.gallbladder > 0.0 && self.gallbladder.holds(at) {
            uptake = organs.gallbladder;
        }
        let radius = organs.gut_radius_mm;
        let near = |p: &[f64; 3]| {
            let off = [0, 1, 2].map(|i| at[i] - p[i]);
            off[2].abs() < radius && off.iter().map(|d| d * d).sum::<f64>() < radius * radius
        };
        if organs.gut > 0.0 && self.gut.iter().any(near) {
            return (organs.gut, true);
        }
        (uptake, false)
    }
}

/// What is the same along z.
#[derive(Debug, Clone, Copy)]
struct Column {
    x: f64,
    y: f64,
    in_trunk: bool,
    in_ribs: bool,
    in_spine: bool,
    in_midline: bool,
    diaphragm: f64,
}

impl Column {
    fn at(&self, shapes: &Shapes, z: f64) -> Tissue {
        let (organs, at) = (shapes.organs, [self.x, self.y, z]);
        if !self.in_trunk {
            let in_breast = shapes.breasts.iter().any(|breast| breast.holds(&at));
            return if in_breast {
                Tissue {
                    uptake: organs.fat,
                    per_mm: BREAST_PER_MM,
                    ..Tissue::default()
                }
            } else {
                Tissue::default()
            };
        }
        let mut tissue = Tissue {
            uptake: organs.soft,
            per_mm: TRUNK_PER_MM,
            ..Tissue::default()
        };
        let mut organ = (0.0, false);
        if !self.in_ribs {
            tissue.uptake = f64::midpoint(organs.soft, organs.fat);
            tissue.per_mm = CHEST_WALL_PER_MM;
        } else if z > self.diaphragm {
            if !self.in_midline && !shapes.mediastinum.iter().any(|part| part.holds(&at)) {
                tissue.uptake = organs.lung;
                tissue.per_mm = LUNG_PER_MM;
            }
        } else {
            organ = shapes.organ(&at, self.diaphragm);
        }
        if self.in_ribs && shapes.great_vessels.iter().any(|vessel| vessel.holds(&at)) {
            tissue.uptake = shapes.blood;
            tissue.per_mm = SOFT_PER_MM;
        }
        if self.in_spine {
            tissue.uptake = organs.spine;
            tissue.per_mm = SPINE_PER_MM;
        } else if organ.0 > 0.0 {
            let more = organ.0 - tissue.uptake;
            *(if organ.1 {
                &mut tissue.gut
            } else {
                &mut tissue.breathing
            }) = more;
            tissue.per_mm = SOFT_PER_MM;
        }
        tissue
    }
}

/// The middle line of the gut's loop.
fn gut(organs: &Organs, site: &HeartSite, draws: &mut Draws) -> Vec<[f64; 3]> {
    let (low, radius) = (site.lowest, organs.gut_radius_mm);
    let [dx, dy] = [draws.normal(-4.0, 6.0), draws.normal(6.0, 6.0)];
    (0..GUT_POINTS)
        .map(|n| {
            let t = n as f64 / (GUT_POINTS - 1) as f64;
            let sag = 28.0 * (2.0 * t - 1.0).abs().powf(1.5) + 6.0 * (3.0 * PI * t).sin().powi(2);
            [
                low.x + 38.0 * (PI * (1.15 * t - 0.1)).cos() + dx,
                low.y + dy + 26.0 * (PI * 1.15 * t).sin() - 8.0,
                low.z - organs.gut_gap_mm - radius - sag,
            ]
        })
        .collect()
}
