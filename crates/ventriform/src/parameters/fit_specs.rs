//! The table of the parameters of a fit.

use super::reconstruction::reconstruction_rows;
use super::table::{choice, integer, joined, number, optional, titled};
use super::{
    FitParameters, Kind, MASS_G, MaskGrid, ParameterError, ParameterSpec, Parameters, groups,
};
use crate::base::geometry::Vec3;
use crate::heart::deform::sensors::SensorKind;
use crate::heart::deform::through::MOST_THROUGH_POINTS;
use crate::heart::deform::{Orbit, ThroughPoint, WallEdge};
use crate::heart::model::Organ;
use crate::heart::normals::{Sex, yes_or_no};
use crate::heart::polar::Projection;
use crate::image::locate::patient_orientation::Superior;
use crate::image::reconstruct::{Filter, Method};
use crate::image::volume::given_mask::MaskLabel;
use crate::mesh::files::{MeshFrame, MeshUnit};
use serde_json::{Value, json};

impl Parameters for FitParameters {
    type Draft = Self;

    const PARAMETER_SPECS: &'static [ParameterSpec<Self>] = FIT_SPECS;

    const NAME_ALIASES: &'static [(&'static str, &'static str)] =
        &[("template", "model"), ("centre", "center")];

    fn finish(parameters: Self) -> Result<Self, ParameterError> {
        Self::settle(parameters)
    }
}

/// Points of one side of the wall: name, title, field of all points, whether it is the outer side, summary.
macro_rules! through_points {
    ($name:literal, $title:literal, $($field:ident).+, $outer:literal, $summary:literal) => {
        ParameterSpec {
            name: $name,
            title: $title,
            group: groups::PLACE,
            unit: "mm",
            kind: Kind::Points {
                most: MOST_THROUGH_POINTS,
            },
            default: "",
            summary: $summary,
            read: |d, v| {
                d.$($field).+.retain(|point| point.outer != $outer);
                let points = v.numbers().chunks_exact(3).map(|place| ThroughPoint {
                    outer: $outer,
                    place: point(place),
                });
                d.$($field).+.extend(points);
                Ok(())
            },
            write: |p| {
                let own = p.$($field).+.iter().filter(|point| point.outer == $outer);
                let numbers: Vec<f64> = own.flat_map(|point| <[f64; 3]>::from(point.place)).collect();
                match numbers.is_empty() {
                    true => Value::Null,
                    false => json!(numbers),
                }
            },
        }
    };
}
pub(super) use through_points;

/// A name of the scan's kind, as a table of healthy people has it.
macro_rules! scan_name {
    ($name:literal, $field:ident, $example:literal, $summary:literal) => {
        ParameterSpec {
            name: $name,
            title: "",
            group: groups::LIMITS_GROUP,
            unit: "",
            kind: Kind::Text {
                pattern: NAME_PATTERN,
                example: $example,
            },
            default: "",
            summary: $summary,
            read: |d, v| {
                d.scan.$field = Some(scan_name(v.text())?);
                Ok(())
            },
            write: |p| json!(p.scan.$field),
        }
    };
}

/// Every parameter of a fit, in the order in which the stages use them; those of projections last.
pub const FIT_SPECS: &[ParameterSpec<FitParameters>] =
    &joined::<_, { OF_FIT.len() + OF_PROJECTIONS.len() + 1 }>(
        &joined::<_, { OF_FIT.len() + OF_PROJECTIONS.len() }>(OF_FIT, &OF_PROJECTIONS),
        &[CORRECT_MOTION],
    );

/// How slices are made of projections.
const OF_PROJECTIONS: [ParameterSpec<FitParameters>; 9] =
    reconstruction_rows!(groups::PROJECTIONS, reconstruction.);

const CORRECT_MOTION: ParameterSpec<FitParameters> = ParameterSpec {
    name: "correct_motion",
    title: "",
    group: groups::PROJECTIONS,
    unit: "",
    kind: Kind::Switch,
    default: "false",
    summary: "Whether views of projections in which the heart lies elsewhere are shifted back, and slices and fit are \
              made again. Reports state the motion and both results",
    read: |d, v| {
        d.correct_motion = v.switch();
        Ok(())
    },
    write: |p| json!(p.correct_motion),
};

const OF_FIT: &[ParameterSpec<FitParameters>] = &[
    ParameterSpec {
        name: "model",
        title: "Model to fit",
        group: groups::MAIN,
        unit: "",
        kind: Kind::Stored {
            prefixes: &["mdl_", "tpl_", "seg_"],
            word: FitParameters::AUTO_MODEL,
            more: FitParameters::MOST_NAMED,
        },
        default: FitParameters::AUTO_MODEL,
        summary: "Id of the model to fit (a template, a model or an earlier segmentation), or auto: \
                  fits the built-in hearts, the templates flagged `library` and the models named after \
                  it (auto,tpl_12,mdl_34), and keeps the fit with the greatest confidence. Alternative \
                  name: template",
        read: |d, v| {
            d.model = v.text().into();
            Ok(())
        },
        write: |p| json!(p.model),
    },
    ParameterSpec {
        name: "kept_model",
        title: "Model kept",
        group: groups::PLACE,
        unit: "",
        kind: Kind::Text {
            pattern: "^[^\\x00-\\x1f]{1,200}$",
            example: "built-in usual",
        },
        default: "",
        summary: "Name (as in a report) of the fitted model to keep: a \
                  correction by the position, the axis or the base then keeps its heart. Default: the one with the \
                  greatest confidence",
        read: |d, v| {
            let name = v.text();
            if name.is_empty() || name.len() > 200 {
                return Err("a name has 1 to 200 bytes".into());
            }
            d.kept_model = Some(name.into());
            Ok(())
        },
        write: |p| json!(p.kept_model),
    },
    ParameterSpec {
        name: "expert",
        title: "Expert's mask",
        group: groups::MAIN,
        unit: "",
        kind: Kind::Stored {
            prefixes: &["vol_"],
            word: "",
            more: 0,
        },
        default: "",
        summary: "Id of a volume with an expert's mask to compare with: a mask, a label map, a DICOM \
                  Segmentation, probabilities of which those above 0.5 count, or a closed mesh (STL, PLY, OBJ, \
                  VTK, VTP, glTF)",
        read: |d, v| {
            d.expert = Some(v.text().into());
            Ok(())
        },
        write: |p| json!(p.expert),
    },
    ParameterSpec {
        name: "label",
        title: "",
        group: groups::EXPERT_MASK,
        unit: "",
        kind: Kind::Text {
            pattern: r"^.{1,64}$",
            example: "2, or the name of a DICOM segment",
        },
        default: "",
        summary: "Structure of the expert's mask, if the file has several: the number of \
                  a label or segment, or the name or code of a segment. Default: the only one; of \
                  segments, the one coded as myocardium",
        read: |d, v| {
            let Ok(label) = v.text().parse();
            if v.text().trim().is_empty() {
                Err("a label has a number or a name".into())
            } else {
                d.mask.label = Some(label);
                Ok(())
            }
        },
        write: |p| match &p.mask.label {
            None => Value::Null,
            Some(MaskLabel::Number(number)) => json!(number.to_string()),
            Some(MaskLabel::Name(name)) => json!(name),
        },
    },
    ParameterSpec {
        name: "resample",
        title: "",
        group: groups::EXPERT_MASK,
        unit: "",
        kind: Kind::Switch,
        default: "false",
        summary: "Whether an expert's mask on another grid of voxels is resampled by the nearest voxel; \
                  without it, such a mask is refused",
        read: |d, v| {
            d.mask.resample = v.switch();
            Ok(())
        },
        write: |p| {
            if p.mask.resample {
                json!(true)
            } else {
                Value::Null
            }
        },
    },
    ParameterSpec {
        name: "mesh_unit",
        title: "",
        group: groups::EXPERT_MASK,
        unit: "",
        kind: Kind::Choice(&["mm", "cm", "m"]),
        default: "",
        summary: "Unit of an expert's mask that is a mesh. Default: what its file states; otherwise mm (of glTF m), \
                  if the size is that of an organ",
        read: |d, v| {
            d.mask.mesh.unit = MeshUnit::named(v.text());
            Ok(())
        },
        write: |p| json!(p.mask.mesh.unit.map(MeshUnit::as_str)),
    },
    ParameterSpec {
        name: "mesh_frame",
        title: "",
        group: groups::EXPERT_MASK,
        unit: "",
        kind: Kind::Choice(&["lps", "ras"]),
        default: "",
        summary: "Frame of an expert's mask that is a mesh: lps (DICOM, x to the left, y to posterior) or ras \
                  (NIfTI, x to the right, y to anterior). Default: what its file states (SPACE=LPS, SPACE=RAS); \
                  otherwise lps",
        read: |d, v| {
            d.mask.mesh.frame = MeshFrame::named(v.text());
            Ok(())
        },
        write: |p| json!(p.mask.mesh.frame.map(MeshFrame::as_str)),
    },
    ParameterSpec {
        name: "reader",
        title: "Drawn as by",
        group: groups::MAIN,
        unit: "",
        kind: Kind::Stored {
            prefixes: &["rdr_"],
            word: "",
            more: 0,
        },
        default: "",
        summary: "Id of a reader's profile to draw the wall by: moves the endocardium, the epicardium and \
                  the rim by the distances that `ventriform calibrate` learnt from that reader's masks. \
                  Its edge must be that of `edge`. Default: the wall as it was fitted",
        read: |d, v| {
            d.reader = Some(v.text().into());
            Ok(())
        },
        write: |p| json!(p.reader),
    },
    ParameterSpec {
        name: "normals",
        title: "Normal limits",
        group: groups::MAIN,
        unit: "",
        kind: Kind::Stored {
            prefixes: &["nrm_"],
            word: "",
            more: 0,
        },
        default: "",
        summary: "Id of normal limits to compare the wall's uptake with",
        read: |d, v| {
            d.normals = Some(v.text().into());
            Ok(())
        },
        write: |p| json!(p.normals),
    },
    ParameterSpec {
        name: "sex",
        title: "",
        group: groups::LIMITS_GROUP,
        unit: "",
        kind: Kind::Choice(&["F", "M"]),
        default: "",
        summary: "The patient's sex, which chooses the group of the normal limits. Default: that of a DICOM header",
        read: |d, v| {
            d.scan.sex = Sex::parse(v.text());
            Ok(())
        },
        write: |p| json!(p.scan.sex.map(Sex::as_str)),
    },
    scan_name!(
        "protocol",
        protocol,
        "rest",
        "The scan's protocol, as the normal limits name it. Default: the only one that they have"
    ),
    scan_name!(
        "tracer",
        tracer,
        "Tc-99m tetrofosmin",
        "The scan's tracer, as the normal limits name it. Default: the one that a DICOM header's text names, or the \
         only one that they have"
    ),
    ParameterSpec {
        name: "attenuation_corrected",
        title: "",
        group: groups::LIMITS_GROUP,
        unit: "",
        kind: Kind::Choice(&["yes", "no"]),
        default: "",
        summary: "Whether the scan's attenuation was corrected, which chooses the group of the normal limits. Default: \
                  what a DICOM header says",
        read: |d, v| {
            d.scan.attenuation_corrected = Some(v.text() == "yes");
            Ok(())
        },
        write: |p| json!(p.scan.attenuation_corrected.map(yes_or_no)),
    },
    optional!(
        Integer usize,
        "frame",
        frame => frame,
        0..=1_000_000,
        groups::MAIN,
        "",
        "Frame of a 4-D volume or gate, counted from 0 (0 is the first); without it, the gates of a \
         heart beat are summed"
    ),
    choice!(
        "organ",
        organ,
        "left_ventricle",
        groups::PLACE,
        "Organ that the model shows. All but the left ventricle are searched for as the largest \
         bright region and have no polar map",
        "left_ventricle" => Organ::LeftVentricle,
        "liver" => Organ::Liver,
        "kidney" => Organ::Kidney,
        "generic" => Organ::Generic,
    ),
    ParameterSpec {
        name: "center",
        title: "Centre",
        group: groups::PLACE,
        unit: "mm",
        kind: Kind::Numbers { count: 3 },
        default: "",
        summary: "A point in the cavity, x,y,z in LPS millimetres: the search stays within 25 mm of \
                  it and does not question it. Default: the organ is searched for in the whole \
                  volume",
        read: |d, v| {
            d.position.centre = Some(point(v.numbers()));
            Ok(())
        },
        write: |p| json!(p.position.centre.map(|c| [c.x, c.y, c.z])),
    },
    ParameterSpec {
        name: "seed_point",
        title: "",
        group: groups::PLACE,
        unit: "",
        kind: Kind::Integers { count: 3 },
        default: "",
        summary: "Voxel i,j,k (counted from 0) in the cavity; use this or center",
        read: |d, v| {
            let list = v.indices()?;
            d.position.seed_point = Some([list[0], list[1], list[2]]);
            Ok(())
        },
        write: |p| json!(p.position.seed_point),
    },
    ParameterSpec {
        name: "axis",
        title: "",
        group: groups::PLACE,
        unit: "",
        kind: Kind::Numbers { count: 3 },
        default: "",
        summary: "Direction from base to apex, x,y,z in LPS, of any length: the search stays within \
                  35 degrees of it",
        read: |d, v| {
            d.position.axis = Some(direction(v.numbers())?);
            Ok(())
        },
        write: |p| json!(p.position.axis.map(|a| [a.x, a.y, a.z])),
    },
    ParameterSpec {
        name: "box",
        title: "",
        group: groups::PLACE,
        unit: "",
        kind: Kind::Integers { count: 6 },
        default: "",
        summary: "Box of voxels that contains the centre of the organ: i0,j0,k0,i1,j1,k1, counted \
                  from 0, both corners included",
        read: |d, v| {
            d.position.region = Some(v.corners()?);
            Ok(())
        },
        write: |p| match p.position.region {
            Some([[a, b, c], [d, e, f]]) => json!([a, b, c, d, e, f]),
            None => Value::Null,
        },
    },
    number!(
        "roll",
        deform.roll,
        -360.0..=360.0,
        "0",
        groups::PLACE,
        "°",
        "Rotation of the model about the long axis, in degrees, in addition to the smallest \
         rotation that aligns the axes"
    ),
    ParameterSpec {
        name: "superior",
        title: "",
        group: groups::PLACE,
        unit: "",
        kind: Kind::Direction(&["body", "frame"]),
        default: "body",
        summary: "Which direction is superior in the patient, from which the segments of the polar map \
                  are counted: body (from the outline of the body, if enough of it is in view, else as \
                  the volume's frame states), frame (as the frame states) or the direction itself, \
                  x,y,z in the LPS frame of the volume",
        read: |d, v| {
            d.deform.superior = match v.direction() {
                Some(list) => Superior::Stated(direction(list)?),
                None if v.text() == "frame" => Superior::Frame,
                None => Superior::Body,
            };
            Ok(())
        },
        write: |p| match p.deform.superior {
            // What the file does not say is no parameter.
            Superior::Body | Superior::Untold => json!("body"),
            Superior::Frame => json!("frame"),
            Superior::Stated(up) => json!([up.x, up.y, up.z]),
        },
    },
    ParameterSpec {
        name: "anterior",
        title: "",
        group: groups::PLACE,
        unit: "",
        kind: Kind::Numbers { count: 3 },
        default: "",
        summary: "Direction from the long axis to the anterior wall, x,y,z in the LPS frame of the volume: \
                  where segments are counted from if no superior direction is stated, as in short-axis \
                  slices (there, often 0,-1,0: the top of the picture)",
        read: |d, v| {
            d.deform.anterior = Some(direction(v.numbers())?);
            Ok(())
        },
        write: |p| json!(p.deform.anterior.map(|a| [a.x, a.y, a.z])),
    },
    ParameterSpec {
        name: "segments_from",
        title: "",
        group: groups::PLACE,
        unit: "",
        kind: Kind::Numbers { count: 3 },
        default: "",
        summary: "Direction from the long axis to the wall that segments are counted from as the anterior one, x,y,z \
                  in the LPS frame of the volume, once the fit is done: heart and wall stay, names of places change. \
                  Default: the anterior wall by `superior` or `anterior`, which the fit starts from",
        read: |d, v| {
            d.segments_from = Some(direction(v.numbers())?);
            Ok(())
        },
        write: |p| json!(p.segments_from.map(|a| [a.x, a.y, a.z])),
    },
    ParameterSpec {
        name: "base",
        title: "Base plane",
        group: groups::PLACE,
        unit: "mm",
        kind: Kind::Numbers { count: 3 },
        default: "",
        summary: "A point of the ventricle's base, x,y,z in LPS millimetres: the rim of the wall is put there \
                  (moved by at most 20 mm towards the apex or 40 mm away from it). Default: where image and \
                  anatomy put it",
        read: |d, v| {
            d.deform.base = Some(point(v.numbers()));
            Ok(())
        },
        write: |p| json!(p.deform.base.map(|b| [b.x, b.y, b.z])),
    },
    through_points!(
        "inner_through",
        "Inner surface through",
        deform.through,
        false,
        "Points that the wall's inner surface, as it looks in the image, passes through: x,y,z in LPS millimetres, one \
         point after the other. About each, the image's own edge is not followed"
    ),
    through_points!(
        "outer_through",
        "Outer surface through",
        deform.through,
        true,
        "Points that the wall's outer surface passes through, likewise"
    ),
    choice!(
        "sensor",
        deform.sensor,
        "half_maximum",
        groups::EDGE,
        "What the sensors detect: half_maximum (the point half-way down the steepest outward fall), \
         gradient (the steepest point of that fall), unsigned (the steepest change in either \
         direction) or level (the crossing of half of the organ's uptake)",
        "half_maximum" => SensorKind::HalfMaximum,
        "gradient" => SensorKind::Gradient,
        "unsigned" => SensorKind::Unsigned,
        "level" => SensorKind::Level,
    ),
    number!(
        "blur",
        deform.blur,
        0.0..=10.0,
        "3",
        groups::EDGE,
        "mm",
        "Sigma of the Gaussian that smooths the image for the sensors, millimetres"
    ),
    number!(
        "reach",
        deform.reach,
        2.0..=30.0,
        "10",
        groups::EDGE,
        "mm",
        "Initial search range of the sensors, millimetres to either side"
    ),
    number!(
        "last_reach",
        deform.motion.last_reach,
        1.0..=30.0,
        "6",
        groups::EDGE,
        "mm",
        "Final search range of the sensors, millimetres to either side"
    ),
    number!(
        "narrowing",
        deform.motion.narrowing,
        0.1..=0.99,
        "0.85",
        groups::EDGE,
        "",
        "Factor by which the search range shrinks from step to step"
    ),
    number!(
        "margin",
        deform.margin,
        -5.0..=5.0,
        "0",
        groups::EDGE,
        "mm",
        "How far outside the detected edge the contour is drawn, millimetres"
    ),
    titled(
        "Wall shown",
        choice!(
            "edge",
            deform.edge,
            "apparent",
            groups::MAIN,
            "Wall of a ventricle that mask, mesh and measures show: apparent (as the blurred image shows it) \
             or anatomical (the wall itself, without the thickness that blur adds). The report \
             has the volumes of both",
            "apparent" => WallEdge::Apparent,
            "anatomical" => WallEdge::Anatomical,
        ),
    ),
    ParameterSpec {
        name: "mass_g",
        title: "Mass of the muscle",
        group: groups::MAIN,
        unit: "g",
        kind: Kind::Number {
            min: *MASS_G.start(),
            max: *MASS_G.end(),
        },
        default: "",
        summary: "Mass of the left ventricle's muscle, g, where it is known, as by magnetic resonance: the image hardly \
                  tells how thick a wall is. Default: by the wall's width, with the interval that it leaves",
        read: |d, v| {
            d.mass_g = Some(v.f64());
            Ok(())
        },
        write: |p| json!(p.mass_g),
    },
    titled(
        "Grid of the masks",
        choice!(
            "mask_grid",
            mask_grid,
            "scan",
            groups::IMAGE,
            "Grid of the masks and labels that are written: scan (the scan's own) or orthogonal (of a scan whose \
             axes are not at right angles, as of a tilted gantry, a grid at right angles that covers it; \
             NIfTI's qform and ITK know no other)",
            "scan" => MaskGrid::Scan,
            "orthogonal" => MaskGrid::Orthogonal,
        ),
    ),
    optional!(
        Number f64,
        "resolution",
        deform.resolution => deform.resolution,
        0.0..=30.0,
        groups::IMAGE,
        "mm",
        "Resolution of the image, if it is known: full width at half maximum of a point, including \
         motion and filters, millimetres (ventriform resolution learns it from scans of a protocol). It tells how \
         much of a wall's thickness is blur. Default: by the image's noise, less certain"
    ),
    choice!(
        "orbit",
        deform.orbit,
        "auto",
        groups::IMAGE,
        "Arc of the camera's rotation, degrees: 180, 360, or none (a stationary camera: motion does not \
         show in the image and is not flagged). auto: as a DICOM header says (Scan \
         Arc (0018,1143); PET: none); where it does not, motion is flagged only from a chance of one half on",
        "auto" => Orbit::Auto,
        "none" => Orbit::None,
        "180" => Orbit::Half,
        "360" => Orbit::Full,
    ),
    number!(
        "spring_stiffness",
        deform.stiffness.spring,
        0.0..=1e6,
        "2.5",
        groups::SPRINGS,
        "mm²",
        "Stiffness that keeps the length of edges, square millimetres"
    ),
    number!(
        "torsion_stiffness",
        deform.stiffness.torsion,
        0.0..=1e6,
        "7.5",
        groups::SPRINGS,
        "mm²",
        "Stiffness that keeps each node's position among its neighbours, square millimetres"
    ),
    number!(
        "body_stiffness",
        deform.stiffness.body,
        0.0..=1e6,
        "6",
        groups::SPRINGS,
        "mm²",
        "Stiffness that keeps the shape of the whole model, square millimetres"
    ),
    number!(
        "thickness_stiffness",
        deform.stiffness.thickness,
        0.0..=1e6,
        "0.02",
        groups::SPRINGS,
        "",
        "Stiffness that keeps the thickness of the wall"
    ),
    number!(
        "mass",
        deform.motion.mass,
        1e-6..=1e6,
        "0.1",
        groups::SPRINGS,
        "",
        "Mass of the whole model relative to a sensor force of 1 per millimetre"
    ),
    number!(
        "damping",
        deform.motion.damping,
        0.0..=1e6,
        "1",
        groups::SPRINGS,
        "",
        "Damping of the motion per time step"
    ),
    number!(
        "time_step",
        deform.motion.time_step,
        1e-3..=1e3,
        "1",
        groups::SPRINGS,
        "",
        "Length of one time step of the motion"
    ),
    number!(
        "tolerance",
        deform.motion.tolerance,
        1e-6..=1.0,
        "0.04",
        groups::SPRINGS,
        "mm",
        "Largest displacement of a node per step at which the model counts as at rest, millimetres"
    ),
    integer!(
        "max_iterations",
        deform.motion.max_iterations,
        1..=10_000,
        "100",
        groups::SPRINGS,
        "",
        "Maximum number of time steps"
    ),
    number!(
        "polar_threshold",
        polar.threshold,
        0.0..=1.0,
        "0.6",
        groups::POLAR_MAP,
        "",
        "Share of the wall's reference uptake below which a sample counts as a defect"
    ),
    number!(
        "polar_extension",
        polar.extension,
        0.0..=10.0,
        "3",
        groups::POLAR_MAP,
        "mm",
        "How far the samples of the polar map extend beyond the wall on both sides, millimetres"
    ),
    number!(
        "polar_blur",
        polar.blur,
        0.0..=10.0,
        "3",
        groups::POLAR_MAP,
        "mm",
        "Sigma of the Gaussian that smooths the image for the polar map, millimetres"
    ),
    choice!(
        "polar_projection",
        polar.projection,
        "standard",
        groups::POLAR_MAP,
        "How wide the levels of the polar map are drawn: standard (rings of equal width) or area (each \
         level has the share of the map that it has of the wall)",
        "standard" => Projection::Standard,
        "area" => Projection::Area,
    ),
];

/// The form of the names of protocols and tracers.
pub(super) const NAME_PATTERN: &str = "^[^\\x00-\\x1f]{1,200}$";

/// A protocol's or a tracer's name.
pub(super) fn scan_name(text: &str) -> Result<String, String> {
    let name = text.trim();
    if name.is_empty() || name.len() > 200 || name.chars().any(char::is_control) {
        return Err("a name has 1 to 200 bytes that are printable".into());
    }
    Ok(name.to_owned())
}

pub(super) fn direction(list: &[f64]) -> Result<Vec3, String> {
    let direction = point(list);
    match direction.norm() {
        length if length > 1e-6 && length.is_finite() => Ok(direction),
        _ => Err("a direction must have a length above 0".into()),
    }
}

pub(super) fn point(list: &[f64]) -> Vec3 {
    Vec3::new(list[0], list[1], list[2])
}
