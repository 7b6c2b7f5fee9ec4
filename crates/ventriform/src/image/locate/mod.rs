//! The search for the heart: where it is, which way it points, and how sure that is.
//!
//! In: a volume and [`Hints`]. Out: a [`Heart`]. Surface models and segmentations both start from
//! it, so both show the same heart. [`find`] decides once which of the bright structures that is:
//!
//! 1. Rays propose ([`rays`]): they are quick, and measure the wall's distance in all
//!    directions, but know neither the axis nor the shape of a ventricle.
//! 2. A cup checks the best proposal ([`cup_search`]): where rays and cup agree, that is the
//!    heart.
//! 3. In any other case cups are tried all over the volume, and the best one decides.
//!    If it is not clear, they are tried again with values clipped at ever lower ceilings: beside gut many times as hot
//!    as the heart, a heart is too dark to be a candidate, and the blur of the gut raises its wall on one side. The
//!    ceiling at which a clear cup scores highest decides.
//!    If none is clear though a hint says where the heart is, cups with a dark arc, as infarcts of one or two
//!    territories leave them, are tried as well ([`cup_search::infarcted`]): a whole cup is drawn to whatever is closed
//!    on all sides beside such a heart. Without a hint they also fit beside hearts: there they are tried when all else
//!    was refused ([`Hints::infarcted`]), with very large ones, and the fit decides.
//! 4. Where no cup will do either, the heart is doubtful: [`Heart::localisation`] is an error, and
//!    [`Heart::cavity`] is the best proposal of the rays, whatever its score.
//!
//! Other figures of the heart are computed when asked for: the cavity with the
//! distances of its wall, or the cup with its length, where cups decided its margin over the best structure elsewhere,
//! and, where the apex does not show ([`apex`]), its place by the base.
//!
//! All pictures are block means ([`crate::image::grid::blocks`]), in which values that are not finite
//! count as 0. Their sizes differ: rays need the wall resolved (4 mm), connected parts and cups
//! need organs without noise (7 mm, 6.5 mm and a blur).
//!
//! Of 172 simulated scans with a heart (19 patients, 114 distorted copies of them, 39 further hearts
//! with infarcts, motion, hot gut, liver or right ventricle), rays and cups alone chose another
//! structure in one: rays took the gut, with a doubtful score. In one, with an infarct of two
//! territories, neither is sure. In 22 scans without a heart rays score 0.37 at most. Cups refuse 10
//! of these; in the others they correlate by 0.61 to 0.69 with a confidence of 0.28 at most.
//!
//! Not guaranteed: that a doubtful heart is the right one.
//!
//! - [`body`]: one bright body, for organs that are no ventricle;
//! - [`patient_orientation`]: which way is up in the patient.

mod apex;
pub mod body;
mod cavity_candidates;
mod component_tree;
pub mod cup;
mod cup_search;
pub mod directions;
mod error;
mod grey_blocks;
mod hints;
mod hot_voxels;
pub mod localisation;
mod not_a_heart;
pub mod patient_orientation;
pub mod rays;
pub mod short_axis;

use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::Volume;

use cup_search::CupSearch;
pub use error::LocateError;
pub use hints::Hints;
pub use hot_voxels::Outshone;
use localisation::{Cups, Localisation};
pub use not_a_heart::NotAHeart;
use rays::{Cavity, RaySearch, UNCERTAIN_SCORE};

/// The centres that rays and cups find in one heart lie nearer to each other than this, mm.
/// Rays find the middle of the cavity as far as it is closed, cups a point on the axis nearer to
/// the base: 5 to 17 mm apart in simulated and clinical hearts.
const SAME_HEART: f64 = 30.0;
/// Correlation from which on the cup at a proposal settles the matter.
const CLEAR_CORRELATION: f64 = 0.75;
/// Ceilings of the values, shares of the brightest, below which cups are tried where none is clear: hearts whose wall
/// has from a twentieth of the brightest on. Each is as far below the next as keeps the wall within 0.4 to 1 of one.
const CEILING_SHARES: [f64; 3] = [0.4, 0.16, 0.064];
/// Distance that the picture for a cup reaches from its proposal, mm: a large heart and the blur.
const SURROUNDINGS_MM: f64 = 90.0;

/// The heart that [`find`] decided on.
pub struct Heart<'v> {
    volume: &'v Volume,
    hints: Hints,
    rays: RaySearch<'v>,
    decision: Decision,
}

/// The evidence that decided.
enum Decision {
    /// Rays and the cup at their proposal agree.
    Rays(Cavity, Box<Cups>),
    /// The best of the cups in the whole volume, LPS mm; none where all are doubtful.
    Cups(Box<Cups>, Option<Vec3>),
}

/// Decides where the left ventricle is in `volume`.
///
/// # Errors
/// [`LocateError::Blank`], [`LocateError::HotVoxels`], [`LocateError::NoCandidate`], [`LocateError::HintOutside`] and
/// [`LocateError::Cancelled`]. A doubtful heart is no error here.
pub fn find<'v>(
    volume: &'v Volume,
    hints: &Hints,
    monitor: &Monitor,
) -> Result<Heart<'v>, LocateError> {
    hot_voxels::check(volume)?;
    let rays = RaySearch::new(volume, monitor)?;
    let decision = if hints.infarcted {
        by_cups(Cups::everywhere(volume, hints, monitor)?.infarcted(monitor)?)?
    } else {
        usual(volume, hints, &rays, monitor)?
    };
    Ok(Heart {
        volume,
        hints: hints.clone(),
        rays,
        decision,
    })
}

/// The decision by rays and cups, and by what is tried where these are not sure.
///
/// # Errors
/// As [`find`].
fn usual(
    volume: &Volume,
    hints: &Hints,
    rays: &RaySearch<'_>,
    monitor: &Monitor,
) -> Result<Decision, LocateError> {
    let proposal = rays.best(|centre| hints.admit(&to_patient(volume, centre)));
    let proposal = proposal.filter(|c| c.score >= UNCERTAIN_SCORE);
    let clear = match &proposal {
        Some(cavity) => clear_cup(volume, hints, cavity, monitor)?,
        None => None,
    };
    if let (Some(cavity), Some(cup)) = (proposal, clear) {
        return Ok(Decision::Rays(cavity, Box::new(cup)));
    }
    let mut cups = Cups::everywhere(volume, hints, monitor)?;
    if cups.clear_score().is_none() {
        match below_hot_organs(volume, cups.brightest(), hints, monitor)? {
            Some(clear) => cups = clear,
            None if hints.centre.is_some() => cups.add_infarcted(monitor)?,
            None => {}
        }
    }
    by_cups(cups)
}

/// The decision by the best of `cups`.
///
/// # Errors
/// [`LocateError::Cancelled`].
fn by_cups(cups: Cups) -> Result<Decision, LocateError> {
    let place = match cups.best(|_| true) {
        Ok(best) => Some(best.cup.centre),
        Err(LocateError::NoHeart { .. }) => None,
        Err(error) => return Err(error),
    };
    Ok(Decision::Cups(Box::new(cups), place))
}

/// The cups of `volume` below the ceiling at which the best one is clear and scores highest; `None` where none is
/// clear. `brightest` is the greatest value of the picture that cups are compared with.
fn below_hot_organs(
    volume: &Volume,
    brightest: f64,
    hints: &Hints,
    monitor: &Monitor,
) -> Result<Option<Cups>, LocateError> {
    let mut best: Option<(f64, Cups)> = None;
    for share in CEILING_SHARES {
        let clipped = volume.clipped((share * brightest) as f32);
        let cups = match Cups::everywhere(&clipped, hints, monitor) {
            // Every value is above the ceiling.
            Err(LocateError::Blank) => continue,
            cups => cups?,
        };
        if let Some(score) = cups.clear_score()
            && best.as_ref().is_none_or(|(other, _)| score > *other)
        {
            best = Some((score, cups));
        }
    }
    Ok(best.map(|(_, cups)| cups))
}

/// The cup that fits best about `cavity`, if it shows a ventricle there.
fn clear_cup(
    volume: &Volume,
    hints: &Hints,
    cavity: &Cavity,
    monitor: &Monitor,
) -> Result<Option<Cups>, Cancelled> {
    let centre = to_patient(volume, &cavity.centre);
    let region = Aabb {
        min: centre - Vec3::repeat(SURROUNDINGS_MM),
        max: centre + Vec3::repeat(SURROUNDINGS_MM),
    };
    let field = cup_search::picture(volume, Some(&region), monitor)?;
    let found = CupSearch::new(&field, hints).around(centre);
    let open = found.cup.lid(&field, found.wall) <= not_a_heart::MAX_LID_SHARE;
    let near = (found.cup.centre - centre).norm() < SAME_HEART;
    let is_clear =
        near && open && found.refusal().is_none() && found.correlation >= CLEAR_CORRELATION;
    Ok(is_clear.then(|| Cups::one(field, hints, found)))
}

impl Heart<'_> {
    /// The cavity with the distances of its wall; `None` where rays meet no wall there.
    ///
    /// Look at its score: it is below [`rays::PLAUSIBLE_SCORE`] where the heart is doubtful and the
    /// rays see none either.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn cavity(&self, monitor: &Monitor) -> Result<Option<Cavity>, Cancelled> {
        let place = match &self.decision {
            Decision::Rays(cavity, _) => return Ok(Some(cavity.clone())),
            Decision::Cups(_, place) => place,
        };
        let within = |reach: f64| {
            move |centre: &Vec3| {
                let p = to_patient(self.volume, centre);
                place.map_or_else(|| self.hints.admit(&p), |q| (p - q).norm() < reach)
            }
        };
        let best = self.rays.best(within(SAME_HEART));
        if best.as_ref().is_some_and(|b| b.score >= UNCERTAIN_SCORE) {
            return Ok(best);
        }
        // A wall that is nowhere brighter than where it meets the liver is never a part by itself.
        let starts = within(SAME_HEART + rays::MAX_CENTRE_SHIFT_MM);
        let scanned = self.rays.lattice(starts, within(SAME_HEART), monitor)?;
        let better = scanned.as_ref().map(|s| s.score) > best.as_ref().map(|b| b.score);
        Ok(if better { scanned } else { best })
    }

    /// The cup with its length, and how sure it is.
    ///
    /// # Errors
    /// [`LocateError::NoHeart`] where something speaks against every candidate and no hinted
    /// centre overrules that.
    pub fn localisation(&self) -> Result<Localisation, LocateError> {
        let (Decision::Rays(_, cups) | Decision::Cups(cups, _)) = &self.decision;
        let best = cups.best(|_| true);
        Ok(cups.localisation(best.map_err(|error| error.about(self.volume))?))
    }
}

/// LPS mm of a point in millimetres along the array's axes from voxel (0, 0, 0).
fn to_patient(volume: &Volume, p: &Vec3) -> Vec3 {
    let spacing = volume.frame.spacing();
    volume
        .frame
        .to_patient(&Vec3::from_fn(|r, _| p[r] / spacing[r]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::volume::phantom::{PerfusionDefect, PhantomParameters, phantom};

    fn scan(parameters: &PhantomParameters) -> Volume {
        phantom(parameters, &Monitor::silent()).unwrap().volume
    }

    fn small() -> PhantomParameters {
        PhantomParameters {
            shape: [64; 3],
            spacing_mm: [5.0; 3],
            ..PhantomParameters::default()
        }
    }

    /// The centres of cavity and cup, LPS mm.
    fn centres(volume: &Volume, hints: &Hints) -> (Vec3, Vec3) {
        let monitor = Monitor::silent();
        let heart = find(volume, hints, &monitor).unwrap();
        let cavity = heart.cavity(&monitor).unwrap().unwrap();
        let cup = heart.localisation().unwrap().cup;
        (to_patient(volume, &cavity.centre), cup.centre)
    }

    #[test]
    fn cavity_and_cup_are_those_of_one_heart() {
        for volume in [
            scan(&small()),
            scan(&PhantomParameters {
                right_ventricle: 0.9,
                ..small()
            }),
        ] {
            let (cavity, cup) = centres(&volume, &Hints::default());
            assert!((cavity - cup).norm() < SAME_HEART, "{cavity} {cup}");
        }
    }

    #[test]
    fn a_hint_picks_the_same_of_two_hearts_for_cavity_and_cup() {
        // The same scan twice, side by side along k.
        let mut volume = scan(&small());
        let alone = centres(&volume, &Hints::default()).1;
        volume.voxels.extend_from_within(..);
        volume.shape[2] *= 2;
        let apart = volume.frame.to_patient(&Vec3::new(0.0, 0.0, 64.0))
            - volume.frame.to_patient(&Vec3::zeros());
        for place in [alone, alone + apart] {
            let around = Aabb {
                min: place - Vec3::repeat(40.0),
                max: place + Vec3::repeat(40.0),
            };
            let by_centre = Hints {
                centre: Some(place),
                ..Hints::default()
            };
            let by_region = Hints {
                region: Some(around),
                ..Hints::default()
            };
            for hints in [by_centre, by_region] {
                let (cavity, cup) = centres(&volume, &hints);
                assert!((cup - place).norm() < 5.0, "{cup} {place}");
                assert!((cavity - cup).norm() < SAME_HEART, "{cavity} {cup}");
            }
        }
    }

    /// Two of the three territories take up next to nothing, and a hint lies 10 mm off the cavity's centre. The cup
    /// lies by what is left of the wall, with its centre in the cavity, and its place is not taken for certain.
    #[test]
    fn a_hint_finds_a_heart_of_which_one_territory_is_left() {
        let territories: [&[u8]; 3] = [
            &[1, 2, 7, 8, 13, 14, 17],
            &[3, 4, 9, 10, 15],
            &[5, 6, 11, 12, 16],
        ];
        let whole = centres(&scan(&small()), &Hints::default()).1;
        for (left, side) in territories.iter().zip([Vec3::x(), Vec3::y(), Vec3::z()]) {
            let dark = territories.iter().filter(|t| *t != left);
            let defect = |segment: &u8| PerfusionDefect {
                segment: *segment,
                severity: 0.95,
            };
            let infarcted = scan(&PhantomParameters {
                defects: dark.flat_map(|t| t.iter().map(defect)).collect(),
                ..small()
            });
            let monitor = Monitor::silent();
            let hints = Hints {
                centre: Some(whole + side * 10.0),
                ..Hints::default()
            };
            let heart = find(&infarcted, &hints, &monitor).unwrap();
            let found = heart.localisation().unwrap();
            let off = (found.cup.centre - whole).norm();
            let cavity = 0.5 * small().width_mm - small().wall_mm;
            assert!(off < cavity, "{left:?}: {off:.1} mm");
            assert!(
                found.infarcted && found.confidence <= 0.5,
                "{left:?}: {found:?}"
            );
        }
    }

    /// `volume` with a loop of gut below `heart`, `times` as bright as the phantom's wall.
    fn beside_gut(mut volume: Volume, heart: &Vec3, times: f64) -> Volume {
        let [nx, ny, _] = volume.shape;
        let middle = heart - Vec3::new(20.0, 0.0, 105.0);
        for v in 0..volume.voxels.len() {
            let index = [v % nx, v / nx % ny, v / (nx * ny)].map(|i| i as f64);
            let p = volume.frame.to_patient(&Vec3::from(index)) - middle;
            let off = (p.x.hypot(p.y) - 45.0).hypot(p.z);
            let share = (-0.5 * (off / 9.0).powi(2)).exp();
            volume.voxels[v] += (times * small().wall_value * share) as f32;
        }
        volume
    }

    #[test]
    fn a_heart_beside_gut_twenty_times_as_hot_is_found_and_none_is_found_without_one() {
        let usual = scan(&small());
        let alone = centres(&usual, &Hints::default()).1;
        let monitor = Monitor::silent();
        for times in [5.0, 12.0, 20.0] {
            let beside = beside_gut(usual.clone(), &alone, times);
            let heart = find(&beside, &Hints::default(), &monitor).unwrap();
            let found = heart.localisation().unwrap().cup.centre;
            assert!((found - alone).norm() < 6.0, "{times}: {found} {alone}");
            let dark = |segment| PerfusionDefect {
                segment,
                severity: 1.0,
            };
            let erased = scan(&PhantomParameters {
                defects: (1..=17).map(dark).collect(),
                right_ventricle: 0.0,
                ..small()
            });
            let erased = beside_gut(erased, &alone, times);
            let heart = find(&erased, &Hints::default(), &monitor).unwrap();
            assert!(heart.localisation().is_err(), "{times}");
        }
    }

    #[test]
    fn missing_values_are_dark_for_rays_and_cups() {
        let dark = scan(&small());
        let border = |v: usize| [v % 64, v / 64 % 64, v / (64 * 64)].contains(&0);
        let with = |value: f32| {
            let mut volume = dark.clone();
            for v in (0..volume.voxels.len()).filter(|v| border(*v)) {
                volume.voxels[v] = value;
            }
            centres(&volume, &Hints::default())
        };
        let zero = with(0.0);
        assert_eq!(with(f32::NAN), zero);
        assert_eq!(with(f32::INFINITY), zero);
    }

    #[test]
    fn a_blank_volume_and_hints_outside_are_errors() {
        let monitor = Monitor::silent();
        let mut volume = scan(&small());
        let outside = Hints {
            region: Some(Aabb {
                min: Vec3::repeat(2e5),
                max: Vec3::repeat(3e5),
            }),
            ..Hints::default()
        };
        let found = find(&volume, &outside, &monitor).err();
        assert_eq!(found, Some(LocateError::HintOutside));
        volume.voxels.fill(3.0);
        let found = find(&volume, &Hints::default(), &monitor).err();
        assert_eq!(found, Some(LocateError::Blank));
    }
}
