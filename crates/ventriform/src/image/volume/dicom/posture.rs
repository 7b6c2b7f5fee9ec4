//! How slices lie in the patient, by attributes other than Image Orientation (Patient).
//!
//! In: the attributes of a data set. Out: the directions that rows and columns have where no Image Orientation
//! (Patient) states them, and what contradicts them where one does.
//!
//! - Patient Orientation (0020,0020) names the directions of rows and columns by letters.
//! - Patient Position (0018,5100), the Patient Orientation Modifier Code (0054,0412) and the Patient Gantry
//!   Relationship Code (0054,0414) say how the patient lay in the scanner, whose rows run to the right of somebody who
//!   looks from the foot of the table, and whose columns run down (PS3.3 C.7.3.1.1.2).
//! - View Code (0054,0220) of the detector names the kind of slices, Slice Progression Direction (0054,0500) the wall
//!   of the heart at which they begin (PS3.3 C.8.4.15). The latter is for slices across or along the heart only, and
//!   stands for their View Code where there is none.
//!
//! Without Image Orientation (Patient), letters decide, then a coronal or sagittal view, then the patient's position;
//! two attributes that contradict each other about that position are an error. With it, they are warnings.
//!
//! Not told by any attribute: which side of short-axis slices the septum lies on where their directions are not the
//! patient's.

use crate::base::geometry::Vec3;
use ventriform_dicom::read::ReadError;
use ventriform_dicom::read::attributes::{
    Attribute, Attributes, DETECTOR_VIEW, DETECTOR_VIEW_MEANING, GANTRY, GANTRY_MEANING,
    PATIENT_LETTERS, PATIENT_POSITION, POSTURE, POSTURE_MEANING, PROGRESSION, VIEW, VIEW_MEANING,
    clip,
};

/// Greatest angle between the directions of slices and the patient's axes at which they are the patient's, degrees.
const MAX_PLAIN_ANGLE_DEG: f64 = 1.0;
/// Usual direction of the heart from base to apex, LPS.
const USUAL_AXIS: Vec3 = Vec3::new(0.64, -0.60, -0.48);
/// Usual direction across the long axis to the anterior wall, LPS.
const USUAL_ANTERIOR: Vec3 = Vec3::new(0.35, -0.33, 0.88);
/// Usual direction to the lateral wall, LPS.
const USUAL_LATERAL: Vec3 = Vec3::new(0.69, 0.73, 0.0);
/// Least cosine between the slices' direction and a usual one of the heart at which the end where they begin is told.
const LEAST_COSINE: f64 = 0.35;

/// Directions of rows and columns that no Image Orientation (Patient) states.
pub(super) struct Assumed {
    /// Direction cosines of a row and of a column.
    pub cosines: [f64; 6],
    /// What they were taken from, for people to read.
    pub warning: String,
}

/// A statement, with the attribute that makes it.
struct Said<T> {
    what: T,
    attribute: &'static str,
    value: String,
}

impl<T> Said<T> {
    fn cited(&self) -> String {
        format!("{} is {}", self.attribute, clip(&self.value))
    }
}

/// What the patient lies on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lying {
    Back,
    Front,
    Left,
    Right,
}

/// The end of the patient that goes into the scanner first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum First {
    Head,
    Feet,
}

/// The kind of slices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum View {
    /// Across an axis of the patient: 0 sagittal, 1 coronal, 2 axial.
    Across(usize),
    /// Across the heart or along it, or oblique: the directions are not those of the patient.
    Oblique,
}

/// Codes (SNOMED CT, SNOMED RT) and words of Code Meanings, in small letters without spaces and hyphens. The first that
/// fits counts.
type Codes<T> = [(T, [&'static str; 2], &'static str)];

const LYING: &Codes<Option<Lying>> = &[
    (None, ["34026001", "F-10316"], "semiprone"),
    (Some(Lying::Front), ["1240000", "F-10310"], "prone"),
    (Some(Lying::Back), ["40199007", "F-10340"], "supine"),
    (
        Some(Lying::Right),
        ["102535000", "F-10317"],
        "rightlateraldecubitus",
    ),
    (
        Some(Lying::Left),
        ["102536004", "F-10319"],
        "leftlateraldecubitus",
    ),
];

const FIRST: &Codes<First> = &[
    (First::Head, ["102540008", "F-10470"], "headfirst"),
    (First::Feet, ["102541007", "F-10480"], "feetfirst"),
];

const VIEWS: &Codes<View> = &[
    (View::Oblique, ["103340004", "G-A186"], "shortaxis"),
    (View::Oblique, ["131185001", "G-A18A"], "verticallongaxis"),
    (View::Oblique, ["131186000", "G-A18B"], "horizontallongaxis"),
    (View::Oblique, ["399089007", "R-10516"], "obliqueaxial"),
    (View::Across(1), ["81654009", "G-A138"], "coronal"),
    (View::Across(0), ["30730003", "G-A145"], "sagittal"),
    (View::Across(2), ["62824007", "G-A117"], "transverse"),
    (View::Across(2), ["24422004", "G-A147"], "axial"),
    (View::Across(2), ["24422004", "R-11300"], "transaxial"),
];

/// Directions of rows and columns in slices across an axis of the patient, as they are shown: the front or the head on
/// top.
const SHOWN: [[f64; 6]; 3] = [
    [0.0, 1.0, 0.0, 0.0, 0.0, -1.0],
    [1.0, 0.0, 0.0, 0.0, 0.0, -1.0],
    [1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
];

const ACROSS_NAMES: [&str; 3] = ["sagittal", "coronal", "axial"];

/// The coded statement of `value`, or of its `meaning`.
fn coded<T: Copy>(
    a: &Attributes,
    codes: &Codes<T>,
    (value, meaning): (Attribute, Attribute),
    name: &'static str,
) -> Option<Said<T>> {
    let (code, words) = (a.text(value), a.prose(meaning));
    let plain: String = words.as_deref().unwrap_or_default().to_lowercase();
    let plain: String = plain.chars().filter(|c| c.is_alphanumeric()).collect();
    let by_code = |(_, known, _): &&(T, [&str; 2], &str)| {
        code.as_deref().is_some_and(|code| known.contains(&code))
    };
    let by_words = |(_, _, word): &&(T, [&str; 2], &str)| plain.contains(word);
    let found = codes
        .iter()
        .find(by_code)
        .or_else(|| codes.iter().find(by_words))?;
    Some(Said {
        what: found.0,
        attribute: name,
        value: words.or(code)?,
    })
}

/// What Patient Position (0018,5100) says, as far as it is one of the eight on the back, front or side.
fn position(a: &Attributes) -> Option<Said<(First, Lying)>> {
    let value = a.text(PATIENT_POSITION)?;
    let upper = value.to_uppercase();
    let (first, rest) = match (upper.strip_prefix("HF"), upper.strip_prefix("FF")) {
        (Some(rest), _) => (First::Head, rest),
        (_, Some(rest)) => (First::Feet, rest),
        _ => return None,
    };
    let lying = match rest {
        "S" => Lying::Back,
        "P" => Lying::Front,
        "DL" => Lying::Left,
        "DR" => Lying::Right,
        _ => return None,
    };
    Some(Said {
        what: (first, lying),
        attribute: PATIENT_POSITION.name,
        value,
    })
}

/// What the patient lay on and which end went first, with what was cited for it.
struct Position {
    first: First,
    lying: Lying,
    cited: Vec<String>,
    contradictions: Vec<String>,
}

impl Position {
    fn from_attributes(a: &Attributes) -> Self {
        let position = position(a);
        let modifier = coded(
            a,
            LYING,
            (POSTURE, POSTURE_MEANING),
            "Patient Orientation Modifier Code Sequence (0054,0412)",
        );
        let modifier = modifier.and_then(|said| {
            Some(Said {
                what: said.what?,
                attribute: said.attribute,
                value: said.value,
            })
        });
        let gantry = coded(
            a,
            FIRST,
            (GANTRY, GANTRY_MEANING),
            "Patient Gantry Relationship Code Sequence (0054,0414)",
        );
        let mut contradictions = Vec::new();
        if let (Some(position), Some(modifier)) = (&position, &modifier)
            && position.what.1 != modifier.what
        {
            contradictions.push(format!("{}, but {}", position.cited(), modifier.cited()));
        }
        if let (Some(position), Some(gantry)) = (&position, &gantry)
            && position.what.0 != gantry.what
        {
            contradictions.push(format!("{}, but {}", position.cited(), gantry.cited()));
        }
        let cited = match &position {
            Some(position) => vec![position.cited()],
            None => [
                modifier.as_ref().map(Said::cited),
                gantry.as_ref().map(Said::cited),
            ]
            .into_iter()
            .flatten()
            .collect(),
        };
        let (first, lying) = match (&position, &gantry, &modifier) {
            (Some(position), ..) => position.what,
            (None, gantry, modifier) => (
                gantry.as_ref().map_or(First::Head, |said| said.what),
                modifier.as_ref().map_or(Lying::Back, |said| said.what),
            ),
        };
        Self {
            first,
            lying,
            cited,
            contradictions,
        }
    }

    /// Directions of a row and of a column of slices that lie as the scanner does.
    fn cosines(&self) -> [f64; 6] {
        // What lies below: columns run there.
        let down = match self.lying {
            Lying::Back => Vec3::y(),
            Lying::Front => -Vec3::y(),
            Lying::Left => Vec3::x(),
            Lying::Right => -Vec3::x(),
        };
        // Into the scanner.
        let inward = match self.first {
            First::Head => Vec3::z(),
            First::Feet => -Vec3::z(),
        };
        let right = down.cross(&inward);
        // No negative zeros.
        [right.x, right.y, right.z, down.x, down.y, down.z].map(|c| c + 0.0)
    }
}

/// The directions that the letters of Patient Orientation (0020,0020) name, each with all letters but the first left
/// out.
fn letters(a: &Attributes) -> Option<(Said<[Vec3; 2]>, bool)> {
    let texts = a.texts(PATIENT_LETTERS);
    let [row, column] = texts.as_slice() else {
        return None;
    };
    let direction = |text: &String| match text.chars().next()?.to_ascii_uppercase() {
        'L' => Some(Vec3::x()),
        'R' => Some(-Vec3::x()),
        'P' => Some(Vec3::y()),
        'A' => Some(-Vec3::y()),
        'H' => Some(Vec3::z()),
        'F' => Some(-Vec3::z()),
        _ => None,
    };
    let (x, y) = (direction(row)?, direction(column)?);
    let said = Said {
        what: [x, y],
        attribute: PATIENT_LETTERS.name,
        value: texts.join("\\"),
    };
    let exact = texts.iter().all(|text| text.len() == 1);
    (x.dot(&y) == 0.0).then_some((said, exact))
}

/// What Slice Progression Direction (0054,0500) says: the usual direction in which the slices follow each other, LPS.
fn progression(a: &Attributes) -> Option<Said<Vec3>> {
    let value = a.text(PROGRESSION)?;
    let what = match value.to_uppercase().as_str() {
        "BASE_TO_APEX" => USUAL_AXIS,
        "APEX_TO_BASE" => -USUAL_AXIS,
        "INF_TO_ANT" => USUAL_ANTERIOR,
        "ANT_TO_INF" => -USUAL_ANTERIOR,
        "SEPTUM_TO_WALL" => USUAL_LATERAL,
        "WALL_TO_SEPTUM" => -USUAL_LATERAL,
        _ => return None,
    };
    Some(Said {
        what,
        attribute: PROGRESSION.name,
        value,
    })
}

/// The kind of slices by the View Code of the detector or of the image, or by how they progress through the heart.
fn view(a: &Attributes) -> Option<Said<View>> {
    const NAME: &str = "View Code Sequence (0054,0220)";
    coded(a, VIEWS, (DETECTOR_VIEW, DETECTOR_VIEW_MEANING), NAME)
        .or_else(|| coded(a, VIEWS, (VIEW, VIEW_MEANING), NAME))
        .or_else(|| {
            let said = progression(a)?;
            Some(Said {
                what: View::Oblique,
                attribute: said.attribute,
                value: said.value,
            })
        })
}

/// What says that the patient lay on something else than the back.
pub(super) fn not_supine(a: &Attributes) -> Option<String> {
    let position = Position::from_attributes(a);
    (position.lying != Lying::Back).then(|| position.cited.join(", "))
}

/// The directions of rows and columns of a file without Image Orientation (Patient).
///
/// # Errors
/// [`ReadError::Field`] if two attributes contradict each other on how the patient lay.
pub(super) fn assumed(a: &Attributes) -> Result<Assumed, ReadError> {
    const WITHOUT: &str = "The file has no Image Orientation (Patient)";
    let of = |[x, y]: [Vec3; 2]| [x.x, x.y, x.z, y.x, y.y, y.z];
    if let Some((said, true)) = letters(a) {
        return Ok(Assumed {
            cosines: of(said.what),
            warning: format!("{WITHOUT}: rows and columns run as {} says.", said.cited()),
        });
    }
    let view = view(a);
    if let Some(said) = &view
        && let View::Across(axis @ (0 | 1)) = said.what
    {
        return Ok(Assumed {
            cosines: SHOWN[axis],
            warning: format!(
                "{WITHOUT}, and {}: {} slices with the patient's head on top are assumed.",
                said.cited(),
                ACROSS_NAMES[axis]
            ),
        });
    }
    let position = Position::from_attributes(a);
    if let Some(reason) = position.contradictions.first() {
        return Err(a.wrong(
            "Image Orientation (Patient) (0020,0037)",
            "missing",
            format!(
                "without it the patient's position tells how the slices lie, and {reason}; send the file with Image \
                 Orientation (Patient), or with one of both removed"
            ),
        ));
    }
    let mut warning = if position.cited.is_empty() {
        format!("{WITHOUT}: axial slices of a supine patient are assumed.")
    } else {
        format!(
            "{WITHOUT}: axial slices are placed as the patient lay in the scanner ({}).",
            position.cited.join(", ")
        )
    };
    if let Some(said) = view.filter(|said| said.what == View::Oblique) {
        warning.push_str(&format!(
            " But {}: nothing says how slices across or along the heart lie in the patient. {}",
            said.cited(),
            sides(a)
        ));
    }
    Ok(Assumed {
        cosines: position.cosines(),
        warning,
    })
}

/// How to look at slices whose directions are not the patient's.
fn sides(a: &Attributes) -> String {
    let end = progression(a).map_or_else(
        || "Neither says Slice Progression Direction (0054,0500) at which end of the heart they begin.".to_owned(),
        |said| format!("{}.", said.cited()),
    );
    format!(
        "{end} Septum and lateral wall are exchanged in the result where the first of short-axis slices is that of the \
         apex and the pictures show the septum on the right of the anterior wall on top, or where the first is that of \
         the base and they show it on the left: send such slices with their true Image Orientation (Patient) and Image \
         Position (Patient), or transaxial slices."
    )
}

/// What contradicts the stated directions `x` of rows and `y` of columns, and that of the slices' order, `step`; for
/// people to read.
pub(super) fn contradictions(a: &Attributes, [x, y]: [Vec3; 2], step: Vec3) -> Vec<String> {
    const STATED: &str = "Image Orientation (Patient) (0020,0037)";
    let cosines: Vec<String> = x
        .iter()
        .chain(y.iter())
        .map(|c| format!("{}", (c * 1e4).round() / 1e4 + 0.0))
        .collect();
    let cosines = cosines.join("\\");
    let mut found: Vec<String> = Position::from_attributes(a)
        .contradictions
        .into_iter()
        .map(|reason| format!("{reason}. {STATED}, {cosines}, decides how the slices lie."))
        .collect();
    if let Some((said, _)) = letters(a) {
        let along = [x, y]
            .iter()
            .zip(&said.what)
            .all(|(stated, letter)| stated.dot(letter) > 0.0);
        if !along {
            found.push(format!(
                "{}, but {STATED} is {cosines}, which points elsewhere. The latter is used.",
                said.cited()
            ));
        }
    }
    let normal = x.cross(&y);
    let plain = [x, y]
        .iter()
        .all(|d| d.amax() > MAX_PLAIN_ANGLE_DEG.to_radians().cos());
    let Some(said) = view(a) else {
        return found;
    };
    match said.what {
        View::Across(axis) if normal.iamax() != axis => found.push(format!(
            "{}, but {STATED} is {cosines}: {} slices. The latter is used.",
            said.cited(),
            ACROSS_NAMES[normal.iamax()]
        )),
        View::Oblique if plain => found.push(format!(
            "{}, but {STATED} is {cosines}: {} slices, which those across or along a heart are not. {}",
            said.cited(),
            ACROSS_NAMES[normal.iamax()],
            sides(a)
        )),
        _ => {}
    }
    if !plain
        && let Some(said) = progression(a)
        && step.norm() > 0.0
    {
        let cosine = step.normalize().dot(&said.what.normalize());
        if cosine < -LEAST_COSINE {
            found.push(format!(
                "{}, but by Image Position (Patient), Spacing Between Slices and {STATED}, {cosines}, the slices run \
                 the other way through a heart that points to the left, to the front and down: compare apex and base \
                 of the result with the image.",
                said.cited()
            ));
        }
    }
    found
}
