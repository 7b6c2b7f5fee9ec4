//! Which way is up in the patient: stated by the caller, or the body's long axis, read off its outline.
//!
//! Segments are counted from the patient's superior direction. The volume's frame defines one, but
//! a patient may lie askew in it, and an image may have been rotated. A torso is nearly a cylinder:
//! its skin runs along the long axis, and the end of the camera's field of view cuts it across.
//!
//! In: a volume and a point in the heart. Out: a [`PatientOrientation`].
//!
//! 1. A coarse picture of the whole volume, blurred. The body is what is connected with the
//!    heart's surroundings above a share of their median, its holes (lungs, blood) filled.
//! 2. The normals u of its outline: gradients of the blurred mask, weighted by their squares.
//! 3. The direction d with the least mean of sin²(2φ), φ the angle between u and d. It is 0
//!    for skin along d and for cuts across it, 8/15 for normals in all directions alike.
//!    With c = u·d it is 4 (c² - c⁴), so the second and fourth moments of u give it for all d
//!    at once (a structure tensor of fourth order).
//! 4. A weak pull to the frame's superior direction decides where the outline is ambiguous.
//!
//! Over 19 simulated scans the answer is within 2 degrees of the frame's. With the image rotated by
//! 15 and 30 degrees about x, y and z, it follows within 3.1 degrees (median 0.5). The frame's
//! superior direction is taken if less than [`LEAST_BODY`] of the body is in view, if its outline
//! is no cylinder's ([`MAX_DISORDER`]), or if the answer is more than [`MAX_TILT_DEG`] degrees away. Not
//! detected: a rotation by more than that, and a patient lying head down in a frame that says
//! otherwise.
//!
//! A frame is not believed where the slices are cut across the heart ([`short_axis`](super::short_axis))
//! although the frame says that they are cut across the patient: then nothing tells the roll about the
//! long axis, and the source is [`OrientationSource::Unknown`].

use nalgebra::{Rotation3, SMatrix, Vector6};

use super::cup::{Cup, perpendicular};
use super::short_axis::ShortAxisSlices;
use crate::base::geometry::Vec3;
use crate::base::geometry::rotation::least_rotation;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::components::Components;
use crate::image::grid::field::Field;
use crate::image::grid::labels::Labels;
use crate::image::grid::volume::Volume;

/// Voxels of the coarse picture, mm.
const COARSE_VOXEL_MM: f64 = 8.0;
/// Blur of the picture before and of the mask after the cut, mm.
const OUTLINE_BLUR_MM: f64 = 8.0;
/// Radius of the heart's surroundings, mm.
const SURROUNDINGS_MM: f64 = 80.0;
/// The body's border as a share of the surroundings' median.
const BODY_BORDER_SHARE: f64 = 0.3;
/// Least volume of body in view, litres. Simulated scans show 13 to 30 l, less where a side is
/// cut off. Fields of view of 28 x 28 x 20 cm show 7 to 9 l of real patients, rounded off by the
/// reconstruction's circle: answers there were up to 18 degrees off the frame's.
pub const LEAST_BODY: f64 = 10.0;
/// Greatest mean of sin²(2φ) over that of normals in all directions alike. Simulated scans:
/// 0.05 to 0.62 (the latter with the streaks of filtered backprojection); hearts without a torso
/// and rounded fields of view: 0.74 to 0.9.
pub const MAX_DISORDER: f64 = 0.72;
/// Greatest angle between the answer and the frame's superior, degrees.
pub const MAX_TILT_DEG: f64 = 45.0;
/// Pull to the frame's superior, in the measure of the mean of sin²(2φ).
const FRAME_PULL: f64 = 0.05;

/// The source of the superior direction that segments are counted from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Superior {
    /// The outline of the body where it is seen, else the volume's frame.
    Body,
    /// The volume's frame.
    Frame,
    /// The caller: a direction in the LPS frame of the volume, of any length.
    Stated(Vec3),
    /// Nothing: neither the file nor the caller says how the volume's axes lie in the patient.
    Untold,
}

/// The source of a patient's orientation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum OrientationSource {
    /// A superior direction stated by the caller.
    StatedSuperior,
    /// A direction to the anterior wall stated by the caller.
    StatedAnterior,
    /// The outline of the body.
    Body,
    /// The volume's frame.
    #[default]
    Frame,
    /// Nothing: where segments are counted from is a convention.
    Unknown,
}

impl OrientationSource {
    /// The source's name in reports.
    pub fn as_str(self) -> &'static str {
        match self {
            OrientationSource::StatedSuperior => "superior",
            OrientationSource::StatedAnterior => "anterior",
            OrientationSource::Body => "body",
            OrientationSource::Frame => "frame",
            OrientationSource::Unknown => "unknown",
        }
    }

    /// Whether the caller stated it.
    pub fn is_stated(self) -> bool {
        matches!(
            self,
            OrientationSource::StatedSuperior | OrientationSource::StatedAnterior
        )
    }
}

/// The patient's superior direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatientOrientation {
    /// Unit vector, LPS. If the source is a stated direction to the anterior wall, the part of that
    /// across the long axis; if it is unknown, a direction across the long axis.
    pub superior: Vec3,
    /// Its source.
    pub source: OrientationSource,
    /// 0 (taken from the frame, or unknown) to 1 (stated, or the outline is a cylinder's).
    pub confidence: f64,
}

/// Least sine of the angle between a stated direction and the long axis that tells the roll about it.
const LEAST_SINE: f64 = 0.2;

impl PatientOrientation {
    /// The superior direction of the frame.
    pub const FRAME: Self = Self {
        superior: Vec3::new(0.0, 0.0, 1.0),
        source: OrientationSource::Frame,
        confidence: 0.0,
    };

    /// The orientation that the caller states of a heart with this long `axis` (unit vector), if any: the superior
    /// direction, or where that runs along the axis, the direction to the anterior wall. Unknown if
    /// everything stated runs along the axis.
    pub fn stated(superior: Superior, anterior: Option<Vec3>, axis: &Vec3) -> Option<Self> {
        let superior = match superior {
            Superior::Stated(direction) => Some(direction.normalize()),
            Superior::Body | Superior::Frame | Superior::Untold => None,
        };
        let anterior = anterior.map(|direction| direction.normalize());
        let tells = |d: &Vec3| d.cross(axis).norm() > LEAST_SINE;
        let of = |superior, source| Self {
            superior,
            source,
            confidence: 1.0,
        };
        if let Some(direction) = superior.filter(tells) {
            return Some(of(direction, OrientationSource::StatedSuperior));
        }
        if let Some(direction) = anterior.filter(tells) {
            let across = (direction - axis * axis.dot(&direction)).normalize();
            return Some(of(across, OrientationSource::StatedAnterior));
        }
        (superior.is_some() || anterior.is_some()).then(|| Self::unknown(axis))
    }

    /// Nothing tells the roll about this long `axis`. The wall is counted from the frame's anterior
    /// direction, the top of an axial slice, or if that runs along the axis, from its superior one.
    pub fn unknown(axis: &Vec3) -> Self {
        let tops = [-Vec3::y(), Vec3::z()];
        let across = tops.map(|top| top - axis * axis.dot(&top));
        let top = across.into_iter().find(|top| top.norm() > 0.5);
        Self {
            superior: top.map_or(Vec3::z(), |top| top.normalize()),
            source: OrientationSource::Unknown,
            confidence: 0.0,
        }
    }

    /// The orientation without anything stated: by the body in `volume` about the heart's cavity at
    /// `heart` if `superior` allows it, else by the frame.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn observed(
        volume: &Volume,
        cup: &Cup,
        superior: Superior,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        if superior == Superior::Frame {
            return Ok(Self::FRAME);
        }
        if superior == Superior::Untold {
            return Ok(Self::unknown(&cup.axis));
        }
        let body = Self::of_body(volume, &cup.centre, monitor)?;
        let across_heart = ShortAxisSlices::new(&volume.frame, &cup.axis);
        let believed = body.source == OrientationSource::Body
            || across_heart.is_none_or(|slices| !slices.frame_is_plain);
        Ok(if believed {
            body
        } else {
            Self::unknown(&cup.axis)
        })
    }

    /// Angle to the frame's superior, degrees.
    pub fn tilt(&self) -> f64 {
        self.superior.z.clamp(-1.0, 1.0).acos().to_degrees()
    }

    /// The least turn from the frame's superior direction to the patient's; none where that is unknown.
    pub fn turn(&self) -> Rotation3<f64> {
        if self.source == OrientationSource::Unknown {
            return Rotation3::identity();
        }
        // None for opposite directions only, which are beyond the cone.
        least_rotation(&Vec3::z(), &self.superior).unwrap_or_else(Rotation3::identity)
    }

    /// Reads the body's outline in `volume`; `heart` is a point in the cavity, LPS mm.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn of_body(volume: &Volume, heart: &Vec3, monitor: &Monitor) -> Result<Self, Cancelled> {
        let mut field = Field::coarse(volume, None, COARSE_VOXEL_MM, monitor)?;
        monitor.check()?;
        field.blur(OUTLINE_BLUR_MM, monitor)?;
        let Some(body) = Torso::around(&field, heart, monitor)? else {
            return Ok(Self::FRAME);
        };
        monitor.check()?;
        let mut mask = field.with_values(body.mask);
        mask.blur(OUTLINE_BLUR_MM, monitor)?;
        let outline = Outline::from_mask(&mask);
        let superior = outline.axis();
        let disorder = outline.disorder(&superior);
        let within = superior.z > MAX_TILT_DEG.to_radians().cos();
        // NaN (no outline in view) is not below the limit.
        let seen = body.litres >= LEAST_BODY && within && disorder < MAX_DISORDER;
        Ok(if seen {
            Self {
                superior,
                source: OrientationSource::Body,
                confidence: 1.0 - disorder,
            }
        } else {
            Self::FRAME
        })
    }
}

/// The voxels of the body, 1, among others, 0.
struct Torso {
    mask: Vec<f32>,
    litres: f64,
}

impl Torso {
    fn around(field: &Field, heart: &Vec3, monitor: &Monitor) -> Result<Option<Self>, Cancelled> {
        let shape = field.shape();
        let [nx, ny, _] = shape;
        let index = |v: usize| [v % nx, v / nx % ny, v / (nx * ny)];
        let near = |v: &usize| {
            let p = field.to_patient(&Vec3::from(index(*v).map(|x| x as f64)));
            (p - heart).norm_squared() < SURROUNDINGS_MM * SURROUNDINGS_MM
        };
        let near: Vec<usize> = (0..field.values().len()).filter(near).collect();
        let mut values: Vec<f32> = near.iter().map(|v| field.values()[*v]).collect();
        let middle = values.len() / 2;
        if values.is_empty() {
            return Ok(None);
        }
        let (_, median, _) = values.select_nth_unstable_by(middle, f32::total_cmp);
        let level = BODY_BORDER_SHARE as f32 * *median;
        if !(level > 0.0) {
            return Ok(None);
        }
        let mut labels = Labels::threshold(field.values(), shape, [0; 3], shape, level);
        let parts = Components::of_inside(&labels, monitor)?;
        let brightest = near
            .iter()
            .max_by(|a, b| field.values()[**a].total_cmp(&field.values()[**b]));
        let Some(own) = brightest.and_then(|v| parts.containing(&labels, index(*v))) else {
            return Ok(None);
        };
        parts.paint(&mut labels, false, |part| part != own, monitor)?;
        // Number 0 is the air around.
        let outside = Components::of_outside(&labels, monitor)?;
        outside.paint(&mut labels, true, |part| part != 0, monitor)?;
        let mut mask = vec![0.0; field.values().len()];
        for [i, j, k] in labels.voxels() {
            mask[i + nx * (j + ny * k)] = 1.0;
        }
        let voxel = field.spacing().iter().product::<f64>();
        Ok(Some(Self {
            mask,
            litres: labels.count() as f64 * voxel / 1e6,
        }))
    }
}

/// The six products of a vector's components, so that (u·d)² is a scalar product.
fn squares(u: &Vec3) -> Vector6<f64> {
    let mixed = Vec3::new(u.x * u.y, u.x * u.z, u.y * u.z) * std::f64::consts::SQRT_2;
    Vector6::new(u.x * u.x, u.y * u.y, u.z * u.z, mixed.x, mixed.y, mixed.z)
}

/// Second and fourth moments of the outline's unit normals.
struct Outline {
    second: Vector6<f64>,
    fourth: SMatrix<f64, 6, 6>,
}

impl Outline {
    /// Of the blurred mask, without the volume's border: what lies beyond it is unknown.
    fn from_mask(mask: &Field) -> Self {
        let [nx, ny, nz] = mask.shape();
        let f = mask.values();
        let [x, y, z] = [0, 1, 2].map(|a| mask.step(&Vec3::ith(a, 1.0)));
        let mut outline = Self {
            second: Vector6::zeros(),
            fourth: SMatrix::zeros(),
        };
        let mut weights = 0.0;
        for k in 1..nz.saturating_sub(1) {
            for j in 1..ny.saturating_sub(1) {
                for i in 1..nx.saturating_sub(1) {
                    let v = i + nx * (j + ny * k);
                    let slope = |stride: usize| f64::from(f[v + stride] - f[v - stride]);
                    let slopes = Vec3::new(slope(1), slope(nx), slope(nx * ny));
                    // By the chain rule: index per mm along each axis of the patient.
                    let normal = Vec3::new(slopes.dot(&x), slopes.dot(&y), slopes.dot(&z));
                    let weight = normal.norm_squared();
                    if weight > 0.0 {
                        let products = squares(&normal) / weight;
                        outline.second += products * weight;
                        outline.fourth += products * products.transpose() * weight;
                        weights += weight;
                    }
                }
            }
        }
        outline.second /= weights;
        outline.fourth /= weights;
        outline
    }

    /// Mean of sin²(2φ) about `d` over that of normals in all directions alike.
    fn disorder(&self, d: &Vec3) -> f64 {
        let d = squares(d);
        4.0 * (self.second.dot(&d) - (self.fourth * d).dot(&d)) / (8.0 / 15.0)
    }

    /// The direction of least disorder within [`MAX_TILT_DEG`] and a little more, with the pull.
    fn axis(&self) -> Vec3 {
        let cost = |d: &Vec3| self.disorder(d) * (8.0 / 15.0) + FRAME_PULL * (1.0 - d.z * d.z);
        let mut best = Vec3::z();
        let mut least = cost(&best);
        // A grid of 3 degrees, then smaller steps about its best.
        let reach = (MAX_TILT_DEG / 3.0) as i32 + 1;
        for a in -reach..=reach {
            for b in -reach..=reach {
                let lean = Vec3::new(f64::from(a), f64::from(b), 0.0) * 3f64.to_radians();
                let Some(direction) = lean.try_normalize(1e-9) else {
                    continue;
                };
                let (sin, cos) = lean.norm().sin_cos();
                let d = direction * sin + Vec3::z() * cos;
                if lean.norm() <= f64::from(reach) * 3f64.to_radians() && cost(&d) < least {
                    (best, least) = (d, cost(&d));
                }
            }
        }
        let mut step = 2f64.to_radians();
        while step > 1e-3 {
            let (e1, e2) = perpendicular(&best);
            let trials = [e1, -e1, e2, -e2].map(|e| (best + e * step).normalize());
            match trials.iter().find(|d| cost(d) < least) {
                Some(d) => (best, least) = (*d, cost(d)),
                None => step /= 2.0,
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::image::locate::patient_orientation::*;

    /// A torso with lungs, liver and heart, cut off above and below, that is turned by `turn`;
    /// seen in a cube with edges of `edge` mm.
    fn torso(turn: &Rotation3<f64>, edge: f64) -> Volume {
        const SPACING_MM: f64 = 6.0;
        let n = (edge / SPACING_MM) as usize;
        let shape = [n; 3];
        let frame = VoxelToPatient::centred(shape, [SPACING_MM; 3], Vec3::zeros()).unwrap();
        let ball = |p: &Vec3, at: [f64; 3], radius: f64| (p - Vec3::from(at)).norm() < radius;
        Volume::sampled(shape, frame, |p| {
            let p = turn.inverse() * p;
            let inside = (p.x / 170.0).powi(2) + (p.y / 115.0).powi(2) < 1.0;
            match (inside, p.z.abs() < 150.0) {
                (true, true) if ball(&p, HEART_CENTRE_MM, 35.0) => 10.0,
                (true, true) if ball(&p, [-80.0, 0.0, -60.0], 70.0) => 6.0,
                (true, true) if p.z > -20.0 && ball(&p, [-85.0, 0.0, 60.0], 80.0) => 0.4,
                (true, true) if p.z > 20.0 && ball(&p, [90.0, 20.0, 80.0], 70.0) => 0.4,
                (true, true) => 1.0,
                _ => 0.0,
            }
        })
    }

    const HEART_CENTRE_MM: [f64; 3] = [40.0, -30.0, -20.0];

    fn seen(volume: &Volume, turn: &Rotation3<f64>) -> PatientOrientation {
        let heart = turn * Vec3::from(HEART_CENTRE_MM);
        PatientOrientation::of_body(volume, &heart, &Monitor::silent()).unwrap()
    }

    #[test]
    fn a_tilted_torso_is_seen_as_tilted() {
        for lean in [
            [0.0, 0.0, 0.0],
            [30.0, 0.0, 0.0],
            [-30.0, 0.0, 0.0],
            [0.0, 30.0, 0.0],
            [0.0, -15.0, 0.0],
            [20.0, 20.0, 5.0],
            [0.0, 0.0, 30.0],
            [-18.0, 16.0, 14.0],
        ] {
            let turn = Rotation3::from_scaled_axis(Vec3::from(lean.map(f64::to_radians)));
            let orientation = seen(&torso(&turn, 480.0), &turn);
            assert_eq!(orientation.source, OrientationSource::Body, "{lean:?}");
            let up = turn * Vec3::z();
            let off = orientation.superior.angle(&up).to_degrees();
            assert!(off < 3.0, "{lean:?}: off by {off}");
            assert!((orientation.turn() * Vec3::z() - orientation.superior).norm() < 1e-9);
        }
    }

    #[test]
    fn what_is_stated_decides_as_far_as_it_tells_the_roll() {
        let axis = Vec3::new(0.6, 0.0, -0.8);
        let stated = |superior: Option<Vec3>, anterior| {
            let superior = superior.map_or(Superior::Body, Superior::Stated);
            PatientOrientation::stated(superior, anterior, &axis)
        };
        assert_eq!(stated(None, None), None);
        let up = stated(Some(Vec3::z() * 3.0), Some(Vec3::y())).unwrap();
        assert_eq!(up.superior, Vec3::z());
        assert_eq!(up.source, OrientationSource::StatedSuperior);
        // A superior direction along the axis says nothing about the roll.
        let front = stated(Some(-axis), Some(Vec3::new(0.6, -5.0, -0.8))).unwrap();
        assert!((front.superior + Vec3::y()).norm() < 1e-12);
        assert_eq!(front.source, OrientationSource::StatedAnterior);
        for nothing in [stated(Some(axis * 9.0), None), stated(None, Some(-axis))] {
            let nothing = nothing.unwrap();
            assert_eq!(nothing.source, OrientationSource::Unknown);
            assert!(nothing.superior.dot(&axis).abs() < 1e-12);
            assert_eq!(nothing.turn(), Rotation3::identity());
        }
    }

    #[test]
    fn the_frame_decides_where_too_little_of_the_body_is_in_view() {
        let turn = Rotation3::from_scaled_axis(Vec3::new(0.4, 0.0, 0.0));
        assert_eq!(seen(&torso(&turn, 180.0), &turn), PatientOrientation::FRAME);
        let mut nothing = torso(&turn, 180.0);
        nothing.voxels.fill(0.0);
        assert_eq!(seen(&nothing, &turn), PatientOrientation::FRAME);
        nothing.voxels.fill(f32::NAN);
        assert_eq!(seen(&nothing, &turn), PatientOrientation::FRAME);
        nothing.voxels.fill(1.0);
        assert_eq!(seen(&nothing, &turn), PatientOrientation::FRAME);
        // A heart in the dark.
        let volume = torso(&turn, 480.0);
        let heart = turn * Vec3::from(HEART_CENTRE_MM);
        let mut alone = volume.clone();
        alone
            .voxels
            .iter_mut()
            .for_each(|v| *v *= f32::from(u8::from(*v == 10.0)));
        let far =
            PatientOrientation::of_body(&alone, &(heart + Vec3::repeat(1e6)), &Monitor::silent());
        assert_eq!(far.unwrap(), PatientOrientation::FRAME);
        assert_eq!(seen(&alone, &turn), PatientOrientation::FRAME);
    }
}
