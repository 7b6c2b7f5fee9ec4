//! The built-in hearts that `auto` fits: four healthy left ventricles.
//!
//! They are models like any other, generated from phantoms without noise and without neighbouring
//! organs, with the apparent edge of a blurred wall like the models of real scans. Making them takes
//! seconds, so they are embedded: `cargo run --release -p ventriform-evaluation --bin built_in >
//! crates/ventriform/src/runs/segmentation/built_in/hearts.json` makes the file again, and a test compares it with the
//! phantoms. The cup of each is embedded as well, because finding it takes as long as a fit.
//!
//! The four shapes were chosen among seven on 143 fits of simulated hearts (the calibrating seeds of
//! [`crate::heart::judge::confidence`]): usual and long are the two between which choosing gains most
//! (mean Jaccard index +0.003 of the apparent and +0.005 of the anatomical wall over the usual one
//! alone, of at most +0.007); small and large add nothing to that choice, but the mean over four
//! hearts tells bad fits better than one fit does.

use super::named_template::NamedTemplate;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::model::{Organ, Template};
use crate::image::locate::cup::Cup;
use crate::image::volume::phantom::{PhantomParameters, phantom};
use crate::image::volume::{ReadLimits, VolumeFile, nifti};
use crate::mesh::TriMesh;
use crate::parameters::ModelParameters;
use crate::results::export::{self, Format, Metadata, read_json};
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::OnceLock;

/// Beginning of the names of built-in hearts in reports.
pub const NAME_PREFIX: &str = "built-in";

/// The hearts, as [`hearts_json`] writes them.
const EMBEDDED_HEARTS: &str = include_str!("hearts.json");

/// Points of each model: within the paper's best range.
pub const HEART_POINTS: usize = 150;

/// The shape of a heart: name; length, width, thickness of the wall and how far it extends beyond the
/// widest place, mm; slant of the base, degrees.
type HeartShape = (&'static str, [f64; 4], f64);

/// The shapes, the usual one first.
const HEART_SHAPES: [HeartShape; 4] = [
    ("usual", [85.0, 65.0, 11.0, 15.0], 15.0),
    ("small", [70.0, 52.0, 12.0, 12.0], 15.0),
    ("large", [100.0, 88.0, 9.0, 15.0], 15.0),
    ("long", [85.0, 65.0, 11.0, 25.0], 0.0),
];

static READ_TEMPLATES: OnceLock<Vec<NamedTemplate>> = OnceLock::new();

#[derive(Deserialize)]
struct Heart {
    name: String,
    mesh: Value,
    /// Centre, axis, length and breadth.
    cup: ([f64; 3], [f64; 3], f64, f64),
}

/// The built-in hearts, ready to be fitted. They are kept for the life of the process.
///
/// # Errors
/// [`Cancelled`].
pub fn templates(monitor: &Monitor<'_>) -> Result<Vec<NamedTemplate>, Cancelled> {
    if let Some(templates) = READ_TEMPLATES.get() {
        return Ok(templates.clone());
    }
    let hearts: Vec<Heart> =
        serde_json::from_str(EMBEDDED_HEARTS).expect("the embedded hearts are what a test reads");
    let read = |heart: Heart| {
        let bytes = heart.mesh.to_string();
        let mesh = read_json::decode(bytes.as_bytes()).expect("likewise");
        let (centre, axis, length, breadth) = heart.cup;
        let cup = Cup {
            centre: centre.into(),
            axis: axis.into(),
            length,
            breadth,
        };
        Ok(NamedTemplate {
            name: format!("{NAME_PREFIX} {}", heart.name),
            template: Template::of_cup(mesh, cup, monitor)?,
            built_in: true,
        })
    };
    let read: Vec<NamedTemplate> = hearts.into_iter().map(read).collect::<Result<_, _>>()?;
    Ok(READ_TEMPLATES.get_or_init(|| read).clone())
}

/// Makes the hearts again, as the file that is embedded. Coordinates are micrometres.
///
/// # Errors
/// [`Cancelled`].
pub fn hearts_json(monitor: &Monitor<'_>) -> Result<String, Cancelled> {
    let mut lines = Vec::new();
    for shape in &HEART_SHAPES {
        let mut mesh = generate(shape, monitor)?;
        for vertex in &mut mesh.vertices {
            *vertex = vertex.map(|x| (1e3 * x).round() / 1e3);
        }
        let metadata = Metadata::new(shape.0);
        let file = export::encode(Format::Json, &mesh, &metadata);
        let file = sound(file, monitor)?;
        let file: Value = sound(serde_json::from_slice(&file), monitor)?;
        let template = Template::new(mesh, Organ::LeftVentricle, monitor);
        let cup = sound(template, monitor)?
            .cup
            .expect("a ventricle has a cup");
        let heart = json!({
            "name": shape.0,
            "cup": (<[f64; 3]>::from(cup.centre), <[f64; 3]>::from(cup.axis), cup.length, cup.breadth),
            "mesh": {"vertices": file["vertices"], "triangles": file["triangles"]},
        });
        lines.push(heart.to_string());
    }
    Ok(format!("[\n{}\n]\n", lines.join(",\n")))
}

fn generate(
    (_, [length_mm, width_mm, wall_mm, base_mm], base_tilt_deg): &HeartShape,
    monitor: &Monitor<'_>,
) -> Result<TriMesh, Cancelled> {
    let parameters = PhantomParameters {
        shape: [64; 3],
        length_mm: *length_mm,
        width_mm: *width_mm,
        wall_mm: *wall_mm,
        base_mm: *base_mm,
        base_tilt_deg: *base_tilt_deg,
        right_ventricle: 0.0,
        liver: 0.0,
        gut: 0.0,
        noise: 0.0,
        pose_spread_deg: 0.0,
        pose_spread_mm: 0.0,
        ..PhantomParameters::default()
    };
    let scan = sound(phantom(&parameters, monitor), monitor)?.volume;
    let bytes = nifti::write(&scan, nifti::StoredType::Float32, false);
    let file = VolumeFile::in_memory("built-in.nii", sound(bytes, monitor)?);
    let points = HEART_POINTS.to_string();
    // The scan has no noise. The rounds are those of the release that the confidence was calibrated with.
    let pairs = [
        ("points", points.as_str()),
        ("denoise", "off"),
        ("relaxation_iterations", "80"),
        ("fit_rounds", "16"),
    ];
    let mut parameters = sound(ModelParameters::from_pairs(pairs), monitor)?;
    parameters.retile.exact_rounds = parameters.retile.relaxation_iterations;
    let limits = ReadLimits::default();
    let model = crate::runs::pipeline::generate(&[file], &parameters, &limits, monitor);
    Ok(sound(model, monitor)?.mesh)
}

/// Only the cancel token depends on the caller, so any other failure is a defect, which the test
/// below would find.
fn sound<T, E: std::fmt::Debug>(
    result: Result<T, E>,
    monitor: &Monitor<'_>,
) -> Result<T, Cancelled> {
    match result {
        Ok(value) => Ok(value),
        Err(error) => {
            monitor.check()?;
            unreachable!("the built-in hearts are the same on every machine: {error:?}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::progress::{CancelToken, Silent};
    use crate::heart::model::{cup_about_middle, wall_parts};

    #[test]
    fn making_them_can_be_cancelled() {
        let cancel = CancelToken::new();
        cancel.cancel();
        let monitor = Monitor::new(&Silent, cancel);
        assert!(hearts_json(&monitor.without_observer()).is_err());
    }

    #[test]
    fn the_built_in_hearts_are_plausible_and_differ() {
        let templates = templates(&Monitor::silent()).unwrap();
        let names: Vec<&str> = templates.iter().map(|t| t.name.as_str()).collect();
        let expected = HEART_SHAPES.map(|shape| format!("{NAME_PREFIX} {}", shape.0));
        assert_eq!(names, expected);
        let mut sizes = Vec::new();
        for NamedTemplate { template, .. } in &templates {
            assert_eq!(template.mesh.vertices.len(), HEART_POINTS);
            let cup = template.cup.unwrap();
            assert!((50.0..120.0).contains(&cup.length), "{cup:?}");
            assert!(!template.struts.is_empty());
            sizes.push(template.mesh.volume() / 1000.0);
        }
        assert!((100.0..260.0).contains(&sizes[0]), "{sizes:?}");
        assert!(sizes[1] < sizes[0] && sizes[0] < sizes[2], "{sizes:?}");
    }

    /// The search from the middle of a model finds the cup that the search of its whole picture finds.
    #[test]
    fn a_search_from_the_middle_finds_the_cup_of_the_whole_picture() {
        let monitor = Monitor::silent();
        for NamedTemplate { name, template, .. } in templates(&monitor).unwrap() {
            let everywhere = template.cup.unwrap();
            let near = cup_about_middle(&template.mesh, &monitor).unwrap();
            let shift = (near.centre - everywhere.centre).norm();
            let turn = near.axis.angle(&everywhere.axis).to_degrees();
            let stretch = (near.length / everywhere.length - 1.0).abs();
            assert!(
                shift < 2.0 && turn < 3.0 && stretch < 0.03,
                "{name}: {shift} {turn} {stretch}"
            );
            let parts = |cup| wall_parts(&template.mesh, cup, &monitor).unwrap().unwrap();
            let (own, whole) = (parts(&near), parts(&everywhere));
            let moved = own.iter().zip(&whole).filter(|(a, b)| a != b).count();
            assert!(
                moved * 20 <= whole.len(),
                "{name}: {moved} of {}",
                whole.len()
            );
        }
    }

    #[test]
    fn the_embedded_hearts_are_those_that_the_command_makes() {
        let monitor = Monitor::silent();
        assert_eq!(hearts_json(&monitor).unwrap(), EMBEDDED_HEARTS);
    }
}
