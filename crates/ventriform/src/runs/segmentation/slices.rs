//! Three slices through a fitted organ with the contours of the fit and the expert's mask.
//!
//! A ventricle ([`Cut::heart`]) is shown as in cardiology, from left to right: a short-axis slice
//! through the middle of the cavity (anterior on top, septum left), a horizontal long-axis slice
//! (apex on top, septum left), a vertical long-axis slice (base left, anterior on top). Any other
//! organ ([`Cut::body`]) is shown as in radiology: axial (anterior on top), coronal, sagittal
//! (anterior left), with the patient's right on the left.
//!
//! A slice is a plane of the patient, sampled in equal steps: the scan by trilinear interpolation,
//! the fitted mesh by the rule that masks are made by, the expert's mask at the nearest voxel.
//! Grey runs from 0 to the greatest value within the fit.

use nalgebra::Matrix3;

use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::deform::FittedModel;
use crate::heart::model::wall::anterior;
use crate::image::draw::Image;
use crate::image::grid::field::Field;
use crate::image::grid::voxelise::{Mask, voxelise};
use crate::image::locate::cup::Cup;
use crate::image::volume::Volume;
use crate::mesh::TriMesh;

/// Millimetres per pixel of a ventricle.
pub const PIXEL_MM: f64 = 0.6;
/// Pixels along both sides of a slice: 132 mm of a ventricle.
pub const SLICE_SIDE_PX: usize = 220;
/// Largest share of a slice's side that an organ takes.
const ORGAN_SHARE: f64 = 0.8;
/// Black columns between the slices.
const SLICE_GAP_PX: usize = 4;

/// The fit's contour.
pub const FIT_COLOUR: [u8; 3] = [255, 150, 0];
/// The expert's contour.
pub const EXPERT_COLOUR: [u8; 3] = [0, 210, 255];

/// The three slices of one patient as a PNG file, `cut` as it says, with the contour of `fit` and,
/// where it is given, of `expert` (a mask on the volume's grid).
///
/// # Errors
/// [`Cancelled`].
pub fn png(
    volume: &Volume,
    fit: &TriMesh,
    cut: &Cut,
    expert: Option<&Mask>,
    monitor: &Monitor,
) -> Result<Vec<u8>, Cancelled> {
    let mut slices = Vec::with_capacity(3);
    for plane in &cut.planes {
        slices.push(slice(plane, volume, fit, expert, monitor)?);
    }
    Ok(Image::side_by_side(&slices, SLICE_GAP_PX).png())
}

/// The planes of the slices: for each the places of its pixels, index (column, row, 0) to patient.
#[derive(Debug, Clone)]
pub struct Cut {
    planes: [VoxelToPatient; 3],
}

impl Cut {
    /// Through the organ that `fit` shows.
    pub fn from_fit(fit: &FittedModel) -> Self {
        match (&fit.cup, &fit.patient_orientation) {
            (Some(cup), Some(orientation)) => Self::heart(cup, &orientation.superior),
            _ => Self::body(&fit.mesh),
        }
    }

    /// Through a ventricle, in a patient whose `superior` direction (unit vector) is given.
    pub fn heart(cup: &Cup, superior: &Vec3) -> Self {
        let up = anterior(&cup.axis, superior);
        let lateral = up.cross(&cup.axis);
        let sides = [(lateral, -up), (lateral, -cup.axis), (cup.axis, -up)];
        Self::through(&cup.centre, sides, PIXEL_MM)
    }

    /// Through the middle of any organ.
    pub fn body(mesh: &TriMesh) -> Self {
        let bounds = Aabb::around(&mesh.vertices);
        let longest = (bounds.max - bounds.min).amax();
        let (x, y, z) = (Vec3::x(), Vec3::y(), Vec3::z());
        let step = (longest / (ORGAN_SHARE * SLICE_SIDE_PX as f64)).max(0.1);
        let middle = (bounds.min + bounds.max) / 2.0;
        Self::through(&middle, [(x, y), (x, -z), (y, -z)], step)
    }

    /// Slices about `middle`; of each the directions right and down on the picture.
    fn through(middle: &Vec3, sides: [(Vec3, Vec3); 3], step: f64) -> Self {
        let planes = sides.map(|(right, down)| {
            let half = (SLICE_SIDE_PX - 1) as f64 / 2.0;
            let origin = middle - (right + down) * (half * step);
            let linear = Matrix3::from_columns(&[right, down, right.cross(&down)]) * step;
            let frame = VoxelToPatient::new(linear, origin);
            frame.expect("three unit vectors at right angles span the space")
        });
        Self { planes }
    }
}

fn slice(
    frame: &VoxelToPatient,
    volume: &Volume,
    fit: &TriMesh,
    expert: Option<&Mask>,
    monitor: &Monitor,
) -> Result<Image<3>, Cancelled> {
    let place = |pixel: usize| {
        let (column, row) = (pixel % SLICE_SIDE_PX, pixel / SLICE_SIDE_PX);
        frame.to_patient(&Vec3::new(column as f64, row as f64, 0.0))
    };
    let corners = [
        0,
        SLICE_SIDE_PX - 1,
        SLICE_SIDE_PX * (SLICE_SIDE_PX - 1),
        SLICE_SIDE_PX * SLICE_SIDE_PX - 1,
    ]
    .map(place);
    let region = Aabb::around(&corners);
    let field = Field::cut_out(volume, Some(&region), 0.0, monitor)?;
    let values: Vec<f64> = (0..SLICE_SIDE_PX * SLICE_SIDE_PX)
        .map(|p| field.at(&place(p)))
        .collect();

    let inside = voxelise(fit, [SLICE_SIDE_PX, SLICE_SIDE_PX, 1], frame, monitor)?.voxels;
    let white = (0..SLICE_SIDE_PX * SLICE_SIDE_PX)
        .filter(|p| inside[*p])
        .map(|p| values[p])
        .fold(0.0, f64::max);
    let grey = |v: &f64| [(255.0 * v / white.max(f64::MIN_POSITIVE)).clamp(0.0, 255.0) as u8; 3];
    let mut picture = Image {
        width: SLICE_SIDE_PX,
        height: SLICE_SIDE_PX,
        pixels: values.iter().map(grey).collect(),
    };
    if let Some(expert) = expert {
        let drawn: Vec<bool> = (0..SLICE_SIDE_PX * SLICE_SIDE_PX)
            .map(|p| at_nearest(expert, &volume.frame.to_voxel(&place(p))))
            .collect();
        outline(&mut picture.pixels, &drawn, EXPERT_COLOUR);
    }
    outline(&mut picture.pixels, &inside, FIT_COLOUR);
    Ok(picture)
}

fn at_nearest(mask: &Mask, index: &Vec3) -> bool {
    let mut voxel = [0; 3];
    for axis in 0..3 {
        let nearest = index[axis].round();
        if !(nearest >= 0.0 && nearest < mask.shape[axis] as f64) {
            return false;
        }
        voxel[axis] = nearest as usize;
    }
    mask.voxels[voxel[0] + mask.shape[0] * (voxel[1] + mask.shape[1] * voxel[2])]
}

/// Colours the pixels of `inside` that have one of their four neighbours outside.
fn outline(pixels: &mut [[u8; 3]], inside: &[bool], colour: [u8; 3]) {
    let at = |column: usize, row: usize| {
        // Steps beyond the left and upper border wrap to numbers that are out of range.
        column < SLICE_SIDE_PX && row < SLICE_SIDE_PX && inside[row * SLICE_SIDE_PX + column]
    };
    for row in 0..SLICE_SIDE_PX {
        for column in 0..SLICE_SIDE_PX {
            let surrounded = at(column.wrapping_sub(1), row)
                && at(column + 1, row)
                && at(column, row.wrapping_sub(1))
                && at(column, row + 1);
            if at(column, row) && !surrounded {
                pixels[row * SLICE_SIDE_PX + column] = colour;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::image::draw::image::tests::decoded;
    use crate::mesh::shapes;
    use crate::runs::segmentation::slices::*;

    #[test]
    fn the_cup_opens_downward_in_the_horizontal_slice() {
        // Apex at -z; the cup's own axis therefore points down.
        let mesh = shapes::cup(60.0, 30.0, 10.0, 32);
        let frame = VoxelToPatient::centred([40; 3], [4.0; 3], Vec3::new(0.0, 0.0, -30.0)).unwrap();
        let wall = voxelise(&mesh, [40; 3], &frame, &Monitor::silent()).unwrap();
        let volume = Volume {
            shape: [40; 3],
            voxels: wall
                .voxels
                .iter()
                .map(|v| f32::from(u8::from(*v)))
                .collect(),
            frame,
            integral: true,
        };
        let cup = Cup {
            centre: Vec3::new(0.0, 0.0, -30.0),
            axis: -Vec3::z(),
            length: 60.0,
            breadth: 1.0,
        };
        let cut = Cut::heart(&cup, &Vec3::z());
        let bytes = png(&volume, &mesh, &cut, Some(&wall), &Monitor::silent()).unwrap();
        let (width, height, pixels) = decoded(&bytes);
        assert_eq!(
            (width, height),
            (3 * SLICE_SIDE_PX + 2 * SLICE_GAP_PX, SLICE_SIDE_PX)
        );
        // Grey values on the axis, apical and basal of the centre: wall and nothing.
        let at = |column: usize, row: usize| pixels[3 * (row * width + column)];
        let middle = SLICE_SIDE_PX + SLICE_GAP_PX + SLICE_SIDE_PX / 2;
        let millimetres = |mm: f64| (SLICE_SIDE_PX as f64 / 2.0 + mm / PIXEL_MM) as usize;
        assert!(at(middle, millimetres(-25.0)) > 150, "the apex is on top");
        assert!(
            at(middle, millimetres(25.0)) < 100,
            "the base is open below"
        );
        let count = |colour: [u8; 3]| pixels.chunks(3).filter(|p| **p == colour).count();
        assert!(count(FIT_COLOUR) > 500 && count(EXPERT_COLOUR) > 100);
    }
}
