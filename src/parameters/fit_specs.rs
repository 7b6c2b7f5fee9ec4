//! The table of a fit's parameters.

use super::fit::FitParameters;
use super::table::number;
use super::{Kind, ParameterSpec};
use crate::deform::WallEdge;
use crate::deform::sensors::SensorKind;
use crate::geometry::Vec3;
use crate::locate::patient_orientation::Superior;
use crate::model::Organ;
use serde_json::{Value, json};

/// Every parameter of a fit, in the order in which the stages use them.
pub const FIT_SPECS: &[ParameterSpec<FitParameters>] = &[
    ParameterSpec {
        name: "model",
        kind: Kind::Stored {
            prefixes: &["mdl_", "tpl_", "seg_"],
            word: FitParameters::AUTO,
        },
        default: FitParameters::AUTO,
        summary: "Id of the model to fit (a template, a model or an earlier segmentation), or auto: \
                  every template of the organ is tried and the best fit taken; without templates \
                  a built-in ventricle is fitted. Also understood as template",
        read: |d, v| {
            d.model = v.text().into();
            Ok(())
        },
        write: |p| json!(p.model),
    },
    ParameterSpec {
        name: "expert",
        kind: Kind::Stored {
            prefixes: &["vol_"],
            word: "",
        },
        default: "",
        summary: "Id of a volume with an expert's mask (above 0.5) to measure against",
        read: |d, v| {
            d.expert = Some(v.text().into());
            Ok(())
        },
        write: |p| json!(p.expert),
    },
    ParameterSpec {
        name: "frame",
        kind: Kind::Integer {
            min: 0,
            max: 1_000_000,
        },
        default: "",
        summary: "Which frame of a 4-D volume, counted from 0",
        read: |d, v| {
            d.frame = Some(v.usize());
            Ok(())
        },
        write: |p| json!(p.frame),
    },
    ParameterSpec {
        name: "organ",
        kind: Kind::Choice(&["left_ventricle", "liver", "kidney", "generic"]),
        default: "left_ventricle",
        summary: "What the model shows; all but the left ventricle start at the largest bright \
                  body and have no polar map",
        read: |d, v| {
            d.organ = Organ::parse(v.text()).unwrap_or(Organ::LeftVentricle);
            Ok(())
        },
        write: |p| json!(p.organ.as_str()),
    },
    ParameterSpec {
        name: "center",
        kind: Kind::Numbers { count: 3 },
        default: "",
        summary: "A point in the cavity, x,y,z in LPS millimetres: the search keeps within 25 mm \
                  of it and believes it; else the organ is searched",
        read: |d, v| {
            d.place.centre = Some(point(v.numbers()));
            Ok(())
        },
        write: |p| json!(p.place.centre.map(|c| [c.x, c.y, c.z])),
    },
    ParameterSpec {
        name: "seed_point",
        kind: Kind::Integers { count: 3 },
        default: "",
        summary: "Voxel i,j,k (counted from 0) in the cavity; use this or center",
        read: |d, v| {
            let list = v.indices()?;
            d.place.seed_point = Some([list[0], list[1], list[2]]);
            Ok(())
        },
        write: |p| json!(p.place.seed_point),
    },
    ParameterSpec {
        name: "axis",
        kind: Kind::Numbers { count: 3 },
        default: "",
        summary: "Direction from base to apex, x,y,z in LPS, of any length: the search keeps within \
                  35 degrees of it",
        read: |d, v| {
            let axis = point(v.numbers());
            if !(axis.norm() > 1e-6 && axis.norm().is_finite()) {
                return Err("a direction needs a length".into());
            }
            d.place.axis = Some(axis);
            Ok(())
        },
        write: |p| json!(p.place.axis.map(|a| [a.x, a.y, a.z])),
    },
    ParameterSpec {
        name: "box",
        kind: Kind::Integers { count: 6 },
        default: "",
        summary: "The organ's centre lies in this box of voxels: i0,j0,k0,i1,j1,k1, counted from \
                  0, both corners included",
        read: |d, v| {
            let list = v.indices()?;
            let ends = [[list[0], list[1], list[2]], [list[3], list[4], list[5]]];
            if (0..3).any(|axis| ends[0][axis] > ends[1][axis]) {
                return Err("the first corner lies beyond the last one".into());
            }
            d.place.region = Some(ends);
            Ok(())
        },
        write: |p| match p.place.region {
            Some([[a, b, c], [d, e, f]]) => json!([a, b, c, d, e, f]),
            None => Value::Null,
        },
    },
    number!(
        "roll",
        deform.roll,
        -360.0..=360.0,
        "0",
        "Turn of the model about the long axis beyond the least turn that brings the axes \
         together, degrees"
    ),
    ParameterSpec {
        name: "superior",
        kind: Kind::Choice(&["body", "frame"]),
        default: "body",
        summary: "Which way is up in the patient, from where the polar map's segments are counted: \
                  as the body's outline shows (where enough of it is in view), or as the \
                  volume's frame says",
        read: |d, v| {
            d.deform.superior = match v.text() {
                "frame" => Superior::Frame,
                _ => Superior::Body,
            };
            Ok(())
        },
        write: |p| {
            json!(match p.deform.superior {
                Superior::Body => "body",
                Superior::Frame => "frame",
            })
        },
    },
    ParameterSpec {
        name: "sensor",
        kind: Kind::Choice(&["half_maximum", "gradient", "unsigned", "level"]),
        default: "half_maximum",
        summary: "What the sensors look for: the point half-way down the steepest fall outward, \
                  that fall's steepest point, the steepest change whichever way, or the crossing \
                  of half the organ's uptake",
        read: |d, v| {
            d.deform.sensor = match v.text() {
                "unsigned" => SensorKind::Unsigned,
                "level" => SensorKind::Level,
                "gradient" => SensorKind::Gradient,
                _ => SensorKind::HalfMaximum,
            };
            Ok(())
        },
        write: |p| {
            json!(match p.deform.sensor {
                SensorKind::HalfMaximum => "half_maximum",
                SensorKind::Gradient => "gradient",
                SensorKind::Unsigned => "unsigned",
                SensorKind::Level => "level",
            })
        },
    },
    number!(
        "blur",
        deform.blur,
        0.0..=10.0,
        "3",
        "Gaussian sigma that smooths the image before the sensors read it, millimetres"
    ),
    number!(
        "reach",
        deform.reach,
        2.0..=30.0,
        "10",
        "How far the sensors look at first, millimetres to either side"
    ),
    number!(
        "last_reach",
        deform.motion.last_reach,
        1.0..=30.0,
        "6",
        "How far the sensors look at the end, millimetres to either side"
    ),
    number!(
        "narrowing",
        deform.motion.narrowing,
        0.1..=0.99,
        "0.85",
        "Factor of the sensors' reach from step to step"
    ),
    ParameterSpec {
        name: "margin",
        kind: Kind::Number {
            min: -5.0,
            max: 5.0,
        },
        default: "",
        summary: "How far outside the edge found the edge is drawn, millimetres (default 2.5 for \
                  DICOM NM, whose readers draw wide: measured on one expert's mask; else 0)",
        read: |d, v| {
            d.margin = Some(v.f64());
            Ok(())
        },
        write: |p| json!(p.margin),
    },
    ParameterSpec {
        name: "edge",
        kind: Kind::Choice(&["apparent", "anatomical"]),
        default: "apparent",
        summary: "Which edge of a ventricle's wall is wanted: the one seen in the blurred image, or \
                  the wall's own, with blur's share of the thickness taken off",
        read: |d, v| {
            d.deform.edge = match v.text() {
                "anatomical" => WallEdge::Anatomical,
                _ => WallEdge::Apparent,
            };
            Ok(())
        },
        write: |p| {
            json!(match p.deform.edge {
                WallEdge::Apparent => "apparent",
                WallEdge::Anatomical => "anatomical",
            })
        },
    },
    number!(
        "resolution",
        deform.resolution,
        0.0..=30.0,
        "11.5",
        "The image's resolution for edge=anatomical: full width of a point at half its maximum, \
         motion and filters included, millimetres"
    ),
    number!(
        "spring_stiffness",
        deform.stiffness.spring,
        0.0..=1e6,
        "2.5",
        "How hard edges keep their length, square millimetres"
    ),
    number!(
        "torsion_stiffness",
        deform.stiffness.torsion,
        0.0..=1e6,
        "7.5",
        "How hard each node keeps its place among its neighbours, square millimetres"
    ),
    number!(
        "body_stiffness",
        deform.stiffness.body,
        0.0..=1e6,
        "6",
        "How hard the model keeps its shape as a whole, square millimetres"
    ),
    number!(
        "thickness_stiffness",
        deform.stiffness.thickness,
        0.0..=1e6,
        "0.02",
        "How hard the wall keeps its thickness"
    ),
    number!(
        "mass",
        deform.motion.mass,
        1e-6..=1e6,
        "0.1",
        "Mass of the whole model against a sensor force of 1 per millimetre"
    ),
    number!(
        "damping",
        deform.motion.damping,
        0.0..=1e6,
        "1",
        "Damping of the motion, per time step"
    ),
    number!(
        "time_step",
        deform.motion.time_step,
        1e-3..=1e3,
        "1",
        "Length of one step of the motion"
    ),
    number!(
        "tolerance",
        deform.motion.tolerance,
        1e-6..=1.0,
        "0.04",
        "Largest move of a node that counts as rest, millimetres"
    ),
    ParameterSpec {
        name: "max_iterations",
        kind: Kind::Integer {
            min: 1,
            max: 10_000,
        },
        default: "100",
        summary: "Most steps of the motion",
        read: |d, v| {
            d.deform.motion.max_iterations = v.usize();
            Ok(())
        },
        write: |p| json!(p.deform.motion.max_iterations),
    },
    number!(
        "polar_threshold",
        polar.threshold,
        0.0..=1.0,
        "0.65",
        "Share of the wall's own reference uptake below which it counts as a defect"
    ),
    number!(
        "polar_extension",
        polar.extension,
        0.0..=10.0,
        "3",
        "How far the polar map's samples go beyond the wall on both sides, millimetres"
    ),
    number!(
        "polar_blur",
        polar.blur,
        0.0..=10.0,
        "4.5",
        "Gaussian blur of the image before the polar map is sampled, sigma in millimetres"
    ),
];

fn point(list: &[f64]) -> Vec3 {
    Vec3::new(list[0], list[1], list[2])
}
