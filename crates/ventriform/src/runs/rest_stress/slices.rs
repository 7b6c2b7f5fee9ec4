//! Slices of both scans as readers know them: stress above rest at the same levels.
//!
//! In: two fitted hearts with their images. Out: one picture, six rows of cells of equal scale: short-axis slices from
//! apex to base (septum left, anterior on top), vertical long-axis slices from septum to lateral wall (apex right,
//! anterior on top), and horizontal long-axis slices from inferior to anterior wall (apex on top, septum left). Of each
//! three kinds the row of stress stands above that of rest. A level is a share of that heart's own long axis, or a
//! distance from it; the stress scan is turned as its polar map is. Colours are those of polar maps, in per cent of the
//! reference of that scan's own wall.

use super::hearts::{ComparedHeart, ComparedHearts};
use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::comparison::WhichScan;
use crate::heart::model::wall::anterior;
use crate::heart::polar;
use crate::image::draw::Image;
use crate::image::draw::glyphs::Weight;
use crate::image::draw::vector::{Anchor, VectorShape};
use crate::image::grid::field::Field;
use crate::image::locate::cup::Cup;
use crate::results::report::LongAxis;
use nalgebra::{Rotation3, Unit};

/// Side of a cell, pixels.
const CELL_PX: usize = 88;
/// Size of a pixel: a cell shows 114 mm.
const PIXEL_MM: f64 = 1.3;
/// Width of the labels on the left, pixels.
const LABEL_WIDTH_PX: usize = 84;
/// Black rows between kinds of slices.
const GAP_PX: usize = 10;
/// Slices in a row.
const SLICES_PER_ROW: usize = 8;
/// Shares of the long axis, from the apex, at which the first and the last short-axis slice lie.
const SHORT_ENDS_SHARE: [f64; 2] = [0.06, 0.94];
/// Distance from the long axis of the outermost long-axis slices, as a share of its length.
const LONG_ENDS_SHARE: f64 = 0.28;
/// Height of a label, pixels.
const LABEL_PX: f64 = 13.0;
const INK_RGB: [u8; 3] = [235; 3];

/// The three kinds of slices, in the order of their rows.
#[derive(Clone, Copy)]
enum Kind {
    Short,
    Vertical,
    Horizontal,
}

/// A heart's own directions, LPS: unit vectors, and its long axis.
struct HeartFrame {
    apex: Vec3,
    base: Vec3,
    anterior: Vec3,
    lateral: Vec3,
}

/// The direction from the long axis that lies `turn_degrees` further on the polar map than anterior, from lateral over
/// anterior to septal.
fn anterior_at(axis: &Vec3, superior: &Vec3, turn_degrees: f64) -> Vec3 {
    let turn = Rotation3::from_axis_angle(&Unit::new_normalize(*axis), turn_degrees.to_radians());
    turn * anterior(axis, superior)
}

impl HeartFrame {
    /// The frame of `heart`, turned about its long axis as its polar map is.
    fn new(heart: &ComparedHeart, turn_degrees: f64) -> Option<Self> {
        let model = &heart.segmentation().fit.model;
        let cup: &Cup = model.cup.as_ref()?;
        let orientation = model.patient_orientation.as_ref();
        let superior = orientation.map_or_else(Vec3::z, |orientation| orientation.superior);
        let ends = LongAxis::from_cup(cup);
        let up = anterior_at(&cup.axis, &superior, turn_degrees);
        Some(Self {
            apex: ends.apex.into(),
            base: ends.base.into(),
            lateral: up.cross(&cup.axis),
            anterior: up,
        })
    }

    fn axis(&self) -> Vec3 {
        (self.apex - self.base).normalize()
    }

    fn length_mm(&self) -> f64 {
        (self.apex - self.base).norm()
    }

    /// Middle of a slice, and the directions right and down on the picture.
    fn slice(&self, kind: Kind, number: usize) -> [Vec3; 3] {
        let middle = (self.apex + self.base) / 2.0;
        let across = |direction: Vec3| {
            let share = 2.0 * number as f64 / (SLICES_PER_ROW - 1) as f64 - 1.0;
            middle + direction * (share * LONG_ENDS_SHARE * self.length_mm())
        };
        match kind {
            Kind::Short => {
                let [first, last] = SHORT_ENDS_SHARE;
                let share = number as f64 / (SLICES_PER_ROW - 1) as f64;
                let along = first + (last - first) * share;
                let place = self.apex + (self.base - self.apex) * along;
                [place, self.lateral, -self.anterior]
            }
            Kind::Vertical => [across(self.lateral), self.axis(), -self.anterior],
            Kind::Horizontal => [across(self.anterior), self.lateral, -self.axis()],
        }
    }
}

impl Kind {
    const ALL: [Kind; 3] = [Kind::Short, Kind::Vertical, Kind::Horizontal];

    fn label(self) -> &'static str {
        match self {
            Kind::Short => "SA",
            Kind::Vertical => "VLA",
            Kind::Horizontal => "HLA",
        }
    }
}

/// The picture as a PNG; `None` if a heart has no long axis or no uptake.
///
/// # Errors
/// [`Cancelled`].
pub(super) fn png(
    hearts: &ComparedHearts,
    monitor: &Monitor<'_>,
) -> Result<Option<Vec<u8>>, Cancelled> {
    let scans = [
        (
            WhichScan::Stress,
            &hearts.stress,
            hearts.change.turn.degrees,
        ),
        (WhichScan::Rest, &hearts.rest, 0.0),
    ];
    let width = LABEL_WIDTH_PX + SLICES_PER_ROW * CELL_PX;
    let height = 6 * CELL_PX + 2 * GAP_PX;
    let mut picture = Image::filled(width, height, [0; 3]);
    for (row, (scan, heart, turn)) in scans.into_iter().enumerate() {
        let (Some(frame), Some(map)) = (HeartFrame::new(heart, turn), heart.map()) else {
            return Ok(None);
        };
        if map.reference <= 0.0 {
            return Ok(None);
        }
        let half = Vec3::repeat(frame.length_mm() + CELL_PX as f64 * PIXEL_MM);
        let middle = (frame.apex + frame.base) / 2.0;
        let about = Aabb {
            min: middle - half,
            max: middle + half,
        };
        let field = Field::cut_out(heart.image(), Some(&about), 0.0, monitor)?;
        for (place, kind) in Kind::ALL.into_iter().enumerate() {
            let top = (2 * place + row) * CELL_PX + place * GAP_PX;
            for number in 0..SLICES_PER_ROW {
                monitor.check()?;
                let slice = frame.slice(kind, number);
                let left = LABEL_WIDTH_PX + number * CELL_PX;
                paint(&mut picture, [left, top], slice, &field, map.reference);
            }
            label(&mut picture, top, kind, scan);
        }
    }
    Ok(Some(picture.png()))
}

fn paint(
    picture: &mut Image<3>,
    [left, top]: [usize; 2],
    [middle, right, down]: [Vec3; 3],
    field: &Field,
    reference: f64,
) {
    let half = (CELL_PX - 1) as f64 / 2.0;
    for y in 0..CELL_PX {
        for x in 0..CELL_PX {
            let across = (x as f64 - half) * PIXEL_MM;
            let below = (y as f64 - half) * PIXEL_MM;
            let value = field.at(&(middle + right * across + down * below));
            let colour = polar::colour_of(100.0 * value.max(0.0) / reference);
            picture.pixels[(top + y) * picture.width + left + x] =
                colour.map(|part| (255.0 * part).round() as u8);
        }
    }
}

/// The label of a row: the kind of slice, and below it the scan.
fn label(picture: &mut Image<3>, top: usize, kind: Kind, scan: WhichScan) {
    let centre = top as f64 + CELL_PX as f64 / 2.0;
    for (offset, text) in [
        (-12.0, kind.label().to_owned()),
        (12.0, scan.as_str().to_uppercase()),
    ] {
        let shape = VectorShape::Label {
            at: [LABEL_WIDTH_PX as f64 / 2.0, centre + offset],
            anchor: Anchor::Middle,
            text,
            weight: Weight::Regular,
            size: LABEL_PX,
            ink: INK_RGB,
            rim: None,
        };
        shape.paint(picture);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On the map, septal follows anterior by a quarter turn, and is where lateral is not.
    #[test]
    fn a_quarter_turn_of_the_map_takes_anterior_to_septal() {
        let (axis, superior) = (Vec3::new(0.6, -0.8, 0.0), Vec3::z());
        let up = anterior_at(&axis, &superior, 0.0);
        assert!((up - anterior(&axis, &superior)).norm() < 1e-12);
        let lateral = up.cross(&axis);
        let turned = anterior_at(&axis, &superior, 90.0);
        assert!((turned + lateral).norm() < 1e-12, "{turned}");
    }
}
