//! The position of an apex that does not show.
//!
//! In: the cup that agrees best with the picture. Out: if the apical wall takes up next to nothing,
//! the cup placed by the basal wall alone; otherwise nothing.
//!
//! This serves large infarctions of the apex. A cup that is correlated as a whole avoids the dark
//! wall: it moves up to 20 mm towards the base, turns by up to 45 degrees until its apex lies on the wall
//! that is left, and becomes short and wide. But no coronary artery supplies the whole
//! circumference at the base. The ring of wall that is left there, and its end, give the axis. Its
//! radius gives the length by the proportions of the mean heart; the simulated hearts differ from
//! them by 8 % of the length. The image holds no other evidence of the length.

use std::f64::consts::TAU;

use super::cup::{APEX_SHARE, Cup, PIVOT_SHARE, Pattern, WALL_PROFILE, perpendicular};
use super::cup_search::{CUP_COORDINATES, CupSearch};
use crate::base::geometry::Vec3;
use crate::image::grid::field::Field;

/// Share of the basal wall's uptake below which the apical wall does not show. Infarctions of the
/// whole apex: 0.20 to 0.40; one of 70 % severity: 0.48; other simulated hearts: 0.6 and more.
const DARK_APEX_SHARE: f64 = 0.42;
/// Breadth of cups whose length is not seen: the mean of those found in simulated hearts.
const USUAL_BREADTH: f64 = 1.08;

/// A ventricle whose apical wall takes up next to nothing.
pub struct DarkApex {
    /// The cup as placed by the basal wall.
    pub cup: Cup,
    /// Mean value of the basal wall's middle.
    pub wall: f64,
    /// Uptake of the apical wall against the basal one.
    pub uptake: f64,
}

/// Places `cup` again by its basal half alone; `None` where the apex shows.
pub fn by_base(search: &CupSearch, cup: &Cup) -> Option<DarkApex> {
    let search = CupSearch {
        pattern: Pattern::basal(),
        // All but the breadth: radius and length keep their proportion.
        coordinates: CUP_COORDINATES - 1,
        ..*search
    };
    let basal = search.climb(&search.score(in_proportion(cup)));
    let uptake = apex_uptake(&basal.cup, search.field);
    (uptake < DARK_APEX_SHARE).then_some(DarkApex {
        cup: basal.cup,
        wall: basal.wall,
        uptake,
    })
}

/// The cup of the same base and radius that is as long as hearts of this radius are.
fn in_proportion(cup: &Cup) -> Cup {
    let length = cup.length * cup.breadth / USUAL_BREADTH;
    Cup {
        centre: cup.base() + cup.axis * (PIVOT_SHARE * length),
        length,
        breadth: USUAL_BREADTH,
        ..*cup
    }
}

/// Uptake of the apical wall (segments 13 to 17) against that of the brighter half of the
/// basal rings: the median of the ridges on rays from the cavity through it. Ridges nearer or
/// farther than the cup's own wall count as well. The median ignores an organ that touches the
/// heart in one place.
fn apex_uptake(cup: &Cup, field: &Field) -> f64 {
    let (e1, e2) = perpendicular(&cup.axis);
    let place = |along: f64, across: Vec3| {
        cup.axis * ((along - PIVOT_SHARE) * cup.length) + across * (cup.length * cup.breadth)
    };
    let ring = |&(along, radius, count): &(f64, f64, usize)| -> Vec<Vec3> {
        let angles = (0..count).map(|n| TAU * n as f64 / count as f64);
        angles
            .map(|a| place(along, (e1 * a.cos() + e2 * a.sin()) * radius))
            .collect()
    };
    let ridge = |p: Vec3| {
        let far = (12..=24).map(|n| field.at(&(cup.centre + p * (0.05 * f64::from(n)))));
        far.fold(f64::NEG_INFINITY, f64::max)
    };
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let tip = place(APEX_SHARE, Vec3::zeros());
    let apical = WALL_PROFILE[4..]
        .iter()
        .flat_map(ring)
        .chain([tip])
        .map(ridge);
    let mut apical: Vec<f64> = apical.collect();
    apical.sort_by(f64::total_cmp);
    let basal = WALL_PROFILE[..3].iter().flat_map(ring);
    let mut basal: Vec<f64> = basal.map(|p| field.at(&(cup.centre + p))).collect();
    basal.sort_by(f64::total_cmp);
    apical[apical.len() / 2] / mean(&basal[basal.len() / 2..])
}
