//! Fits a model to a patient: a spring-mass model with torsion and sensors.
//!
//! After Dornheim, Tönnies and Dixon (MICCAI 2005). A volume and a [`Template`] go in; out
//! comes the model in the patient's place and shape, on the same nodes and triangles, with
//! everything needed to judge whether to believe it.
//!
//! 1. [`localisation`] finds the ventricle in the volume, with nobody's help: once for all
//!    templates ([`Place`]).
//! 2. [`template::Pose`] puts the template there: centre, axis, roll, lengths, in a patient
//!    who may lie askew in the frame ([`crate::locate::patient_orientation`]).
//! 3. [`align`] moves, turns, stretches and thickens it as a whole.
//! 4. [`dynamics`] lets it move under [`elastic`] forces and [`sensors`] until it rests.
//! 5. Folds and self-intersections are looked for; if there are any, 4 is repeated with a
//!    stiffer model.
//!
//! Which edge? The half-way point between the wall's ridge and the trough beside it, which
//! does not depend on uptake: a wall of half the uptake has its edge in the same place.
//! [`DeformParameters::margin`] moves it for readers who draw wider. Blur makes this wall
//! look thicker than it is; with [`Edge::Anatomical`], [`blur_correction`] takes the blur's share off
//! and 4 is repeated with the edges moved into the wall by that much.
//!
//! Where the apex takes up nothing, the model keeps the length of its pose as far as its
//! stiffness lets it; [`Flag::DarkApex`] says that the image did not tell it.
//!
//! Guaranteed: same volume, template and parameters give the same bytes; connectivity is the
//! template's; a result is never invented where no heart was found. Not guaranteed: freedom
//! from self-intersection ([`Fit::self_intersections`] counts them, [`Flag::Folded`] says so).

pub mod align;
pub mod blur_correction;
pub mod dynamics;
pub mod elastic;
pub mod flags;
mod profile;
pub mod sensors;
pub mod template;
pub mod wall;

use crate::geometry::Vec3;
use crate::geometry::bvh::Aabb;
use crate::grid::field::Field;
use crate::locate::body::Blob;
use crate::locate::cup::Cup;
use crate::locate::localisation::{Hints, Localisation, LocaliseError, NotAHeart};
use crate::locate::patient_orientation::{Posture, Superior};
use crate::locate::{body, localisation};
use crate::mesh::TriMesh;
use crate::mesh::intersections::self_intersections;
use crate::progress::{Cancelled, Monitor, Stage};
use crate::volume::Volume;
use dynamics::{Motion, Moved, StopReason};
use elastic::{Elastic, Stiffness};
pub use flags::Flag;
use sensors::{Look, SensorKind, Shift};
use template::{Organ, Pose, Template};
use wall::Wall;

/// Parameters of [`fit`].
#[derive(Debug, Clone, PartialEq)]
pub struct DeformParameters {
    /// What is known of the organ's place. Default: nothing.
    pub hints: Hints,
    /// Turn of the template about the long axis beyond the least turn that brings the axes
    /// together, degrees. Default 0: patients lie in the scanner as they lie in the frame.
    pub roll: f64,
    /// What says which way is up in the patient: so the model is put into it, and from there
    /// the wall's columns and segments are counted. Ventricles only. Default
    /// [`Superior::Body`].
    pub superior: Superior,
    /// Whether the model is aligned as a whole (step 3) before it moves. Default true; without,
    /// as in models that are placed by hand, the rest state is the posed template.
    pub align: bool,
    /// Stiffness of the model.
    pub stiffness: Stiffness,
    /// What the sensors look for. Default [`SensorKind::HalfMaximum`].
    pub sensor: SensorKind,
    /// Reach of the sensors at first, mm, 2..=30. Default 10.
    pub reach: f64,
    /// Gaussian blur of the image, sigma in mm, 0..=10. Default 3.
    pub blur: f64,
    /// How far outside the found edge the reader's edge lies, mm, -5..=5. Default 0.
    pub margin: f64,
    /// Which edge of a ventricle the model comes to rest on. Default [`Edge::Apparent`].
    pub edge: Edge,
    /// The image's resolution (full width of a point at half its maximum), mm, 0..=30, for
    /// [`Edge::Anatomical`]. Default 11.5, the mean over the simulated scans, motion and
    /// filter included.
    pub resolution: f64,
    /// How the model moves.
    pub motion: Motion,
}

impl Default for DeformParameters {
    fn default() -> Self {
        Self {
            hints: Hints::default(),
            roll: 0.0,
            superior: Superior::Body,
            align: true,
            stiffness: Stiffness::default(),
            sensor: SensorKind::HalfMaximum,
            reach: 10.0,
            blur: 3.0,
            margin: 0.0,
            edge: Edge::Apparent,
            resolution: 11.5,
            motion: Motion::default(),
        }
    }
}

/// Which edge of the wall is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Edge {
    /// The one that is seen in the blurred image.
    Apparent,
    /// The one that the wall itself has: blur's share of the thickness is taken off.
    Anatomical,
}

/// Where the wall's apparent edge lies against the one that the sensors find, mm outward on
/// the inner surface, the outer surface and the rim: measured on simulated scans whose
/// apparent edge is known. The half-way point moves outward by the blur that is added before
/// the sensors look, the steepest slope towards the centre of curvature. A change by 0.2 mm
/// of any of them costs less than 0.002 of Jaccard.
fn edge_shift(sensor: SensorKind) -> [f64; 3] {
    match sensor {
        SensorKind::HalfMaximum => [-1.7, -0.7, -0.75],
        SensorKind::Gradient | SensorKind::Unsigned | SensorKind::Level => [-0.6, 0.25, 0.25],
    }
}

/// No heart is believed in whose fitted model sees less of an edge than this share of its
/// area, farther away from it than this (mm). Hearts, 100 % defects over seven segments
/// included: 0.63 and 1.15 at worst; noise: 0.51 and 1.6 at best.
const EDGELESS: (f64, f64) = (0.57, 1.3);

/// Times that a folded model is fitted again, each time twice as stiff.
const RETRIES: usize = 3;

impl DeformParameters {
    /// Checks every number.
    ///
    /// # Errors
    /// [`DeformError::Parameter`] names the first one that cannot be used.
    pub fn validate(&self) -> Result<(), DeformError> {
        let (k, m) = (&self.stiffness, &self.motion);
        let checks = [
            ("roll", self.roll, -360.0, 360.0),
            ("stiffness.spring", k.spring, 0.0, 1e6),
            ("stiffness.torsion", k.torsion, 0.0, 1e6),
            ("stiffness.body", k.body, 0.0, 1e6),
            ("stiffness.thickness", k.thickness, 0.0, 1e6),
            ("stiffness.support", k.support, 0.0, 1e6),
            ("stiffness.support_radius", k.support_radius, 0.0, 1e3),
            ("reach", self.reach, 2.0, 30.0),
            ("blur", self.blur, 0.0, 10.0),
            ("margin", self.margin, -5.0, 5.0),
            ("resolution", self.resolution, 0.0, 30.0),
            ("motion.mass", m.mass, 1e-6, 1e6),
            ("motion.damping", m.damping, 0.0, 1e6),
            ("motion.time_step", m.time_step, 1e-3, 1e3),
            ("motion.last_reach", m.last_reach, 1.0, 30.0),
            ("motion.narrowing", m.narrowing, 0.1, 0.99),
            ("motion.tolerance", m.tolerance, 1e-6, 1.0),
            ("motion.max_iterations", m.max_iterations as f64, 1.0, 1e4),
        ];
        for (field, value, least, most) in checks {
            if !(least..=most).contains(&value) {
                return Err(DeformError::Parameter {
                    field,
                    value,
                    least,
                    most,
                });
            }
        }
        let hints = self.hints.centre.iter().chain(&self.hints.axis);
        let region = self.hints.region.iter().flat_map(|r| [&r.min, &r.max]);
        if !hints.chain(region).all(|p| p.iter().all(|x| x.is_finite())) {
            return Err(DeformError::HintNotFinite);
        }
        if self.hints.axis.is_some_and(|a| !(a.norm() > 1e-6)) {
            return Err(DeformError::HintNotFinite);
        }
        Ok(())
    }
}

/// Why there is no fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DeformError {
    /// A parameter is out of range or not a number.
    #[error("{field} is {value}; it must lie within {least}..={most}")]
    Parameter {
        /// The parameter's name.
        field: &'static str,
        /// What was given.
        value: f64,
        /// Least value allowed.
        least: f64,
        /// Greatest value allowed.
        most: f64,
    },
    /// Support springs were asked for, and the model has too many nodes for them.
    #[error("support springs are for models of at most {limit} nodes; this one has {nodes}")]
    TooManyNodes {
        /// Nodes of the model.
        nodes: usize,
        /// Most nodes that a model with support springs may have.
        limit: usize,
    },
    /// The place is another organ's than the template.
    #[error("the template shows another organ than the one that was searched")]
    OtherOrgan,
    /// A hinted centre, axis or region is not finite, or the axis has no length.
    #[error("the hinted centre, axis or region must be finite, and the axis not zero")]
    HintNotFinite,
    /// The organ was not found.
    #[error(transparent)]
    Localise(#[from] LocaliseError),
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// A fitted model.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The model in the patient, LPS mm; nodes and triangles are the template's.
    pub mesh: TriMesh,
    /// Movement of every node from the posed template, mm.
    pub displacements: Vec<Vec3>,
    /// Where the ventricle was found; `None` for other organs.
    pub localisation: Option<Localisation>,
    /// The long axis of the fitted model; `None` for other organs.
    pub cup: Option<Cup>,
    /// Isotropic scale of the pose against the template.
    pub scale: f64,
    /// Rotation of the pose against the template.
    pub rotation: nalgebra::Rotation3<f64>,
    /// 0 (a guess) to 1: the localisation's, lowered where few sensors see an edge.
    pub confidence: f64,
    /// Why the motion ended.
    pub reason: StopReason,
    /// Steps made in the last run.
    pub iterations: usize,
    /// Runs: 1, or more where the model had folded.
    pub runs: usize,
    /// Energy after each step of the last run, mm².
    pub energy: Vec<f64>,
    /// Weighted rms distance from the model to the edges that its sensors see, mm.
    pub residual: f64,
    /// Share of the model's area whose sensors see an edge (weight above 0.25), 0..=1.
    pub active: f64,
    /// Mean squared strain of the model against its aligned start.
    pub strain: f64,
    /// Pairs of triangles that pierce each other.
    pub self_intersections: usize,
    /// Triangles whose normal turned by more than 90 degrees against the aligned start.
    pub turned_triangles: usize,
    /// Wall volume, ml (enclosed by the model).
    pub wall_ml: f64,
    /// Which way is up in the patient; ventricles only.
    pub posture: Option<Posture>,
    /// The wall seen from the long axis; ventricles only.
    pub wall: Option<Wall>,
    /// What gives reason to doubt.
    pub flags: Vec<Flag>,
}

impl Fit {
    /// Whether the model found a wall, where nobody said that there is one.
    fn believe(&self, hints: &Hints) -> Result<(), LocaliseError> {
        let (active, residual) = (self.active, self.residual);
        match &self.localisation {
            Some(found)
                if hints.centre.is_none() && active < EDGELESS.0 && !(residual < EDGELESS.1) =>
            {
                Err(LocaliseError::NoHeart {
                    centre: found.cup.centre.into(),
                    correlation: found.correlation,
                    reason: NotAHeart::Edgeless { active, residual },
                })
            }
            _ => Ok(()),
        }
    }

    /// A figure to rank templates by: share of area with edges, less strain and misfit, and,
    /// where the apex does not show, less the change of its reach. A model that shrinks to what
    /// is seen has edges on more of its area, but nothing in the image asks it to.
    pub fn merit(&self) -> f64 {
        self.active
            - 0.5 * self.unasked_reach().abs()
            - 0.5 * self.strain.sqrt()
            - 0.05 * self.residual
            - 0.02 * self.flags.len() as f64
    }

    /// Logarithm of the apex's distance from the base plane that was found, against that of the
    /// posed template; 0 where the apex shows.
    fn unasked_reach(&self) -> f64 {
        let Some(found) = self.localisation.as_ref().filter(|l| l.dark_apex.is_some()) else {
            return 0.0;
        };
        let (base, axis) = (found.cup.base(), found.cup.axis);
        let along = |p: Vec3| (p - base).dot(&axis);
        let nodes = self.mesh.vertices.iter().zip(&self.displacements);
        let (now, posed) = nodes.fold((0f64, 0f64), |(now, posed), (p, moved)| {
            (now.max(along(*p)), posed.max(along(p - moved)))
        });
        (now / posed).ln()
    }
}

/// Fits `template` to the organ in `volume`.
///
/// # Errors
/// [`DeformError`].
pub fn fit(
    volume: &Volume,
    template: &Template,
    parameters: &DeformParameters,
    monitor: &Monitor,
) -> Result<Fit, DeformError> {
    supports_fit(template, &parameters.stiffness)?;
    let place = Place::find(volume, template, parameters, monitor)?;
    fit_at(&place, volume, template, parameters, monitor)
}

/// Fits `template` to the organ at its `place` in `volume`, which [`Place::find`] found there
/// by the same parameters for this template or another one of the same organ.
///
/// # Errors
/// [`DeformError`].
pub fn fit_at(
    place: &Place,
    volume: &Volume,
    template: &Template,
    parameters: &DeformParameters,
    monitor: &Monitor,
) -> Result<Fit, DeformError> {
    parameters.validate()?;
    supports_fit(template, &parameters.stiffness)?;
    monitor.report(Stage::Align, 0.0)?;
    let start = Start::new(place, volume, template, parameters, monitor)?;
    // From afar the ridge and the trough beside a slope may be another structure's: the model
    // is aligned by slopes.
    let far = match parameters.sensor {
        SensorKind::HalfMaximum => SensorKind::Gradient,
        kind => kind,
    };
    let aligned = if parameters.align {
        align::align(
            &start.posed,
            &start.axis,
            &start.field,
            &start.look(parameters, far, 0.0),
            parameters.motion.last_reach,
            monitor,
        )?
    } else {
        start.posed.clone()
    };
    monitor.report(Stage::Deform, 0.0)?;
    let attempt = Attempt::best(&aligned, template, &start, parameters, 0.0, monitor)?;
    let fit = attempt.into_fit(volume, template, &start, &aligned, monitor)?;
    fit.believe(&parameters.hints)?;
    let fit = match (&fit.cup, parameters.edge) {
        (Some(cup), Edge::Anatomical) => {
            monitor.report(Stage::Deform, 0.5)?;
            let apparent = blur_correction::thickness(&fit.mesh, cup);
            let excess = blur_correction::excess(apparent, parameters.resolution);
            let thin = -0.5 * excess;
            Attempt::best(&aligned, template, &start, parameters, thin, monitor)?
                .into_fit(volume, template, &start, &aligned, monitor)?
        }
        _ => fit,
    };
    monitor.report(Stage::Deform, 1.0)?;
    Ok(fit)
}

/// Most nodes of a model with support springs: their number grows with the square.
const MAX_SUPPORTED_NODES: usize = 1000;

fn supports_fit(template: &Template, stiffness: &Stiffness) -> Result<(), DeformError> {
    let (nodes, limit) = (template.mesh.vertices.len(), MAX_SUPPORTED_NODES);
    if stiffness.support > 0.0 && nodes > limit {
        return Err(DeformError::TooManyNodes { nodes, limit });
    }
    Ok(())
}

/// Where an organ lies in a volume: the same for all templates of the organ.
#[derive(Debug, Clone)]
pub enum Place {
    /// A left ventricle.
    Ventricle {
        /// Where it was found.
        found: Localisation,
        /// How the patient lies in the frame.
        posture: Posture,
    },
    /// Any other organ.
    Body {
        /// The bright body.
        blob: Blob,
        /// The one label of a map of several that is meant, as a mask.
        mask: Option<Volume>,
    },
}

impl Place {
    /// Looks in `volume` for the organ of `template`.
    ///
    /// # Errors
    /// [`DeformError`].
    pub fn find(
        volume: &Volume,
        template: &Template,
        parameters: &DeformParameters,
        monitor: &Monitor,
    ) -> Result<Self, DeformError> {
        parameters.validate()?;
        monitor.report(Stage::Localise, 0.0)?;
        let place = match template.cup {
            Some(_) => {
                let found = localisation::localise(volume, &parameters.hints, monitor)?;
                let posture = match parameters.superior {
                    Superior::Body => Posture::of_body(volume, &found.cup.centre, monitor)?,
                    Superior::Frame => Posture::FRAME,
                };
                Place::Ventricle { found, posture }
            }
            None => {
                let mask = body::one_label(volume, &parameters.hints, monitor)?;
                let picture = mask.as_ref().unwrap_or(volume);
                let blob = body::find(picture, &parameters.hints, monitor)?;
                Place::Body { blob, mask }
            }
        };
        monitor.report(Stage::Localise, 1.0)?;
        Ok(place)
    }

    fn posture(&self) -> Posture {
        match self {
            Place::Ventricle { posture, .. } => *posture,
            Place::Body { .. } => Posture::FRAME,
        }
    }

    fn picture(&self) -> Option<&Volume> {
        match self {
            Place::Ventricle { .. } => None,
            Place::Body { mask, .. } => mask.as_ref(),
        }
    }
}

/// The template put in its place, and the image to fit it to.
struct Start {
    localisation: Option<Localisation>,
    posture: Posture,
    pose: Pose,
    posed: TriMesh,
    axis: Vec3,
    /// Ends of the line that the inner surface faces.
    cavity_axis: [Vec3; 2],
    /// Typical value of the organ.
    uptake: f64,
    field: Field,
}

impl Start {
    fn new(
        place: &Place,
        volume: &Volume,
        template: &Template,
        parameters: &DeformParameters,
        monitor: &Monitor,
    ) -> Result<Self, DeformError> {
        let (localisation, pose, axis, cavity_axis, uptake) = match (place, &template.cup) {
            (Place::Ventricle { found, posture }, Some(from)) => {
                let to = found.cup;
                let roll = parameters.roll.to_radians();
                let pose = Pose::between(from, &to, &posture.turn(), roll);
                let inner_end = to.base() + to.axis * (0.6 * to.length);
                let ends = [to.base(), inner_end];
                (Some(found.clone()), pose, to.axis, ends, found.wall)
            }
            (Place::Body { blob, .. }, None) => {
                let pose = blob.pose(&template.mesh);
                (None, pose, Vec3::z(), [blob.centre; 2], blob.uptake)
            }
            _ => return Err(DeformError::OtherOrgan),
        };
        let mut posed = template.mesh.clone();
        posed.vertices.iter_mut().for_each(|p| *p = pose.apply(p));
        let mut region = Aabb::of(&posed.vertices);
        let border = Vec3::repeat(parameters.reach + 4.0 * parameters.blur + 15.0);
        region.min -= border;
        region.max += border;
        let picture = place.picture().unwrap_or(volume);
        let field = Field::cut_out(picture, Some(&region), parameters.blur, monitor)?;
        Ok(Self {
            localisation,
            posture: place.posture(),
            pose,
            posed,
            axis,
            cavity_axis,
            uptake,
            field,
        })
    }

    /// How sensors of `kind` look; `thicken` moves the inner and the outer edge outward, mm.
    fn look(&self, parameters: &DeformParameters, kind: SensorKind, thicken: f64) -> Look {
        let [inner, outer, rim] = match self.localisation {
            Some(_) => edge_shift(kind),
            None => [0.0; 3],
        };
        Look {
            kind,
            reach: parameters.reach,
            level: 0.5 * self.uptake,
            // Hot neighbours are cut off: their slopes would drown those of the wall.
            ceiling: 1.6 * self.uptake,
            shift: Shift {
                inner: inner + parameters.margin + thicken,
                outer: outer + parameters.margin + thicken,
                rim: rim + parameters.margin,
                axis: self.cavity_axis,
            },
        }
    }
}

/// One run of the motion and what is wrong with it.
struct Attempt {
    moved: Moved,
    strain: f64,
    intersections: usize,
    turned: usize,
    runs: usize,
}

impl Attempt {
    /// Runs until nothing is folded, each time stiffer, and keeps the least folded run.
    fn best(
        aligned: &TriMesh,
        template: &Template,
        start: &Start,
        parameters: &DeformParameters,
        thicken: f64,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let look = start.look(parameters, parameters.sensor, thicken);
        let near = Look {
            reach: (0.8 * look.reach).max(parameters.motion.last_reach),
            ..look
        };
        let mut best: Option<Self> = None;
        for run in 1..=1 + RETRIES {
            let stiffness = parameters.stiffness.times(4f64.powi(run as i32 - 1));
            let body = Elastic::new(aligned, &template.struts, stiffness);
            let moved = dynamics::run(
                aligned,
                &body,
                &start.field,
                &near,
                &parameters.motion,
                monitor,
            )?;
            let attempt = Self {
                strain: body.strain(&moved.mesh.vertices),
                intersections: self_intersections(&moved.mesh).len(),
                turned: turned(aligned, &moved.mesh),
                moved,
                runs: run,
            };
            let faults = attempt.faults();
            let better = best.as_ref().is_none_or(|b| faults < b.faults());
            if better {
                best = Some(attempt);
            }
            if let Some(best) = &mut best {
                best.runs = run;
            }
            if faults == 0 {
                break;
            }
        }
        Ok(best.expect("the loop runs at least once and takes its first attempt"))
    }

    fn faults(&self) -> usize {
        self.intersections + self.turned
    }

    fn into_fit(
        self,
        volume: &Volume,
        template: &Template,
        start: &Start,
        aligned: &TriMesh,
        monitor: &Monitor,
    ) -> Result<Fit, Cancelled> {
        let mesh = self.moved.mesh;
        let readings = &self.moved.readings;
        let seen: f64 = readings.iter().map(|r| r.share * r.weight).sum();
        let misfit: f64 = readings
            .iter()
            .map(|r| r.share * r.weight * r.offset * r.offset)
            .sum();
        let active = readings
            .iter()
            .filter(|r| r.weight > 0.25)
            .map(|r| r.share)
            .sum::<f64>();
        let cup = template
            .cup
            .map(|cup| wall::carried(&cup, &template.mesh, &mesh));
        let wall = cup
            .map(|cup| Wall::new(&mesh, &cup, &start.posture.superior, monitor))
            .transpose()?;
        let posed = &start.posed.vertices;
        let mut fit = Fit {
            displacements: mesh
                .vertices
                .iter()
                .zip(posed)
                .map(|(p, q)| p - q)
                .collect(),
            cup,
            scale: start.pose.scale(),
            rotation: *start.pose.rotation(),
            confidence: start.localisation.as_ref().map_or(0.5, |l| l.confidence)
                * (active / 0.5).min(1.0),
            localisation: start.localisation.clone(),
            reason: self.moved.reason,
            iterations: self.moved.iterations,
            runs: self.runs,
            energy: self.moved.energy,
            residual: if seen > 0.0 {
                (misfit / seen).sqrt()
            } else {
                f64::INFINITY
            },
            active,
            strain: self.strain,
            self_intersections: self.intersections,
            turned_triangles: turned(aligned, &mesh),
            wall_ml: mesh.volume() / 1000.0,
            posture: cup.map(|_| start.posture),
            wall,
            mesh,
            flags: Vec::new(),
        };
        fit.flags = flags::raise(&fit, volume, template.organ == Organ::LeftVentricle);
        Ok(fit)
    }
}

/// Triangles of `now` that look away from where they looked `before`.
fn turned(before: &TriMesh, now: &TriMesh) -> usize {
    (0..now.triangles.len())
        .filter(|t| before.area_normal(*t).dot(&now.area_normal(*t)) <= 0.0)
        .count()
}
