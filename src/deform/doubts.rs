//! Which flags a fit gets.

use super::dynamics::StopReason;
use super::fit::Fit;
use super::flags::Flag;
use crate::geometry::Vec3;
use crate::grid::Volume;

/// The reasons to doubt `fit`; volume, thickness, length and strain are judged for a ventricle
/// only.
pub(super) fn flags(fit: &Fit, volume: &Volume, ventricle: bool) -> Vec<Flag> {
    let mut flags = Vec::new();
    if fit.confidence < 0.4 {
        let confidence = fit.confidence;
        flags.push(Flag::UncertainPlace { confidence });
    }
    if let Some(uptake) = fit.localisation.as_ref().and_then(|l| l.dark_apex) {
        flags.push(Flag::DarkApex { uptake });
    }
    if matches!(fit.reason, StopReason::MaxIterations | StopReason::Diverged) {
        flags.push(Flag::NotAtRest { reason: fit.reason });
    }
    if fit.self_intersections + fit.turned_triangles > 0 {
        flags.push(Flag::Folded {
            intersections: fit.self_intersections,
            turned: fit.turned_triangles,
        });
    }
    if fit.active < 0.5 {
        flags.push(Flag::PoorContrast { active: fit.active });
    }
    let outside = fit
        .mesh
        .vertices
        .iter()
        .filter(|p| at_border_or_beyond(volume, p))
        .count();
    if outside > 0 {
        let share = 100.0 * outside as f64 / fit.mesh.vertices.len() as f64;
        flags.push(Flag::TouchesBorder { share });
    }
    if ventricle {
        flags.extend(implausible(fit));
    }
    flags
}

fn at_border_or_beyond(volume: &Volume, p: &Vec3) -> bool {
    let index = volume.frame.to_voxel(p);
    (0..3).any(|a| index[a] <= 0.0 || index[a] >= volume.shape[a] as f64 - 1.0)
}

fn implausible(fit: &Fit) -> Vec<Flag> {
    let Some(wall) = &fit.wall else {
        return Vec::new();
    };
    let length = wall.extent[1] - wall.extent[0];
    let mut flags: Vec<Flag> = [
        ("the wall's volume in ml", fit.wall_ml, 50.0, 400.0),
        ("the cavity's volume in ml", wall.cavity_ml, 5.0, 450.0),
        ("the wall's mean thickness in mm", wall.thickness, 7.0, 28.0),
        ("the length in mm", length, 45.0, 140.0),
        (
            "the strain in per cent",
            100.0 * fit.strain.sqrt(),
            0.0,
            45.0,
        ),
    ]
    .into_iter()
    .filter(|(_, value, least, most)| !(least..=most).contains(&value))
    .map(|(what, value, least, most)| Flag::ImplausibleShape {
        what,
        value,
        least,
        most,
    })
    .collect();
    if wall.gaps > 0.25 {
        flags.push(Flag::ValvePlane { gaps: wall.gaps });
    }
    flags
}
