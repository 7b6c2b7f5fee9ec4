//! Warnings about a fit, as codes and sentences for the report.

use super::evidence::Evidence;
use super::exchanged_axes::{AxisPair, Score};
use super::values::{Background, HotVoxels, Saturation};
use crate::heart::deform::dynamics::StopReason;
use crate::heart::deform::wall_thickness::WallThickness;

/// A warning about a fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Flag {
    /// The confidence of the place is below 0.6.
    #[error("the heart's place is uncertain: confidence {confidence:.2}")]
    UncertainPlace {
        /// The place's confidence, 0..=1.
        confidence: f64,
    },
    /// The chance of a good fit is below 0.7.
    #[error(
        "the chance that a reader who draws the visible edge agrees with this mask (Jaccard index 0.75 or more; \
         calibrated on simulated scans) is {:.0} %: \
         edges along {:.0} % of the surface, {residual:.1} mm off in the mean, strain {:.0} %, the \
         wall's thickness scatters by {thickness_spread:.1} mm, its distance from the axis by {:.0} %, \
         hollow by {hollowness:.2}",
        100.0 * chance, 100.0 * evidence.active, 100.0 * evidence.strain,
        100.0 * evidence.unroundness, residual = evidence.residual,
        thickness_spread = evidence.thickness_spread, hollowness = evidence.hollowness
    )]
    UncertainFit {
        /// The chance, 0..=1.
        chance: f64,
        /// The figures it comes from.
        evidence: Evidence,
    },
    /// The wall looks doubled or displaced.
    #[error(
        "the patient may have moved during the scan (chance {:.0} %): the wall looks doubled or \
         displaced{}; its thickness scatters by {thickness_spread:.1} mm, its middle lies {:.1} % of the \
         radius off the axis and scatters by {:.0} %, length over radius is {slenderness:.2}, edges show \
         along {:.0} % of the surface. The true place of the heart may be some millimetres away",
        100.0 * chance, two_places(evidence), 100.0 * evidence.offset, 100.0 * evidence.unroundness,
        100.0 * evidence.active, thickness_spread = evidence.thickness_spread,
        slenderness = evidence.slenderness
    )]
    Motion {
        /// The chance of motion, 0..=1.
        chance: f64,
        /// The figures it comes from.
        evidence: Evidence,
    },
    /// The heart moved in the projections.
    #[error(
        "the heart moved during the scan: by up to {along_mm:.1} mm along the table and {across_mm:.1} mm across it, \
         measured in the projections. {}",
        if *corrected {
            "Its views were shifted back, and slices and fit made again: compare both results"
        } else {
            "`correct_motion` shifts the views back"
        }
    )]
    Moved {
        /// Along the axis of rotation, mm.
        along_mm: f64,
        /// On the detector across it, mm.
        across_mm: f64,
        /// Whether the views were shifted back.
        corrected: bool,
    },
    /// A view has other counts than those beside it.
    #[error(
        "the counts of view {view} of the projections differ by {percent:+.0} % from those of the views beside it: it may \
         have been cut short, repeated or added up wrongly"
    )]
    OddView {
        /// Its number, from 1, in the order in which the camera turned.
        view: usize,
        /// How many more counts it has, %.
        percent: f64,
    },
    /// The model bulges towards the right ventricle.
    #[error(
        "the right ventricle's wall may have been taken for the septum: the distance of the wall from \
         the axis scatters by {:.0} % (round hearts: 9 %), the septum lies {:+.0} % farther out than \
         the free wall, and {:+.0} % outside the circle through it",
        100.0 * evidence.unroundness, 100.0 * (evidence.septal_bulge - 1.0),
        100.0 * evidence.septal_overshoot
    )]
    RightVentricle {
        /// The figures it comes from.
        evidence: Evidence,
    },
    /// The volume holds so few different values that it is a label map, not an image of uptake.
    #[error(
        "the volume holds {values} different values only: a mask or a map of labels, no image of \
         uptake; edges, uptake and confidence mean little"
    )]
    LabelMap {
        /// Number of different values.
        values: usize,
    },
    /// The values of the wall were cut off above.
    #[error(
        "{:.0} % of the wall's voxels have its greatest value, {}: values were cut off there (saturated at a greatest \
         number, clipped by a window or a percentile). The wall looks thicker and its defects shallower than they are: \
         send the scan as it was reconstructed",
        100.0 * .0.share, .0.value
    )]
    Saturated(Saturation),
    /// The background does not lie at zero.
    #[error("{}", background_text(.0))]
    Background(Background),
    /// Single voxels of the wall outshine it.
    #[error(
        "{} voxel(s) of the wall outshine all about them; the brightest, {:?} (i, j, k from 0), holds {}, those about \
         it {} at most: damaged values, by which per cent of uptake are wrong. Replace them by those of their \
         neighbours",
        .0.count, .0.index, .0.value, .0.beside
    )]
    HotVoxels(HotVoxels),
    /// The apical wall, or a part of it, is too dark to be seen.
    #[error("{}", dark_apex_text(*uptake, *part))]
    DarkApex {
        /// Uptake of what is dark of the apical wall, relative to the basal wall ([`DarkPart::Whole`]) or to the
        /// brightest.
        uptake: f64,
        /// What is dark.
        part: DarkPart,
    },
    /// The motion did not come to rest.
    #[error("the model did not come to rest: {}", reason.as_str())]
    NotAtRest {
        /// Why the motion ended.
        reason: StopReason,
    },
    /// The surface intersects itself or has inverted triangles.
    #[error("{intersections} pairs of triangles intersect, {turned} triangles are inverted")]
    Folded {
        /// Intersecting pairs.
        intersections: usize,
        /// Inverted triangles.
        turned: usize,
    },
    /// Less than half of the surface sees an edge.
    #[error("an edge is seen along only {:.0} % of the surface; the rest keeps the template's shape", 100.0 * active)]
    PoorContrast {
        /// Share of area with an edge.
        active: f64,
    },
    /// The apex points where no apex does.
    #[error("{}", mirrored_text(*towards, *degrees))]
    Mirrored {
        /// Where it points.
        towards: ApexDirection,
        /// Angle of the long axis to the plane across that direction, degrees.
        degrees: f64,
    },
    /// Bright activity as the liver's lies on the left, below an apex that hardly points to a side.
    #[error(
        "{:.0} % of the bright activity below the heart lies to the left of the body's middle, and the apex points to \
         neither side: left and right may be exchanged in the file (compare with another view: the liver lies on the \
         right). The sides of the polar map are those of the file",
        100.0 * share
    )]
    LiverOnTheLeft {
        /// Share of the bright activity below the heart that lies on the left, 0..=1.
        share: f64,
    },
    /// What surrounds the heart shows that two axes of the image were exchanged.
    #[error("{}", exchanged_text(*pair, score))]
    ExchangedAxes {
        /// The axes.
        pair: AxisPair,
        /// What speaks for it.
        score: Score,
    },
    /// The image ends in the wall.
    #[error(
        "the image ends in the wall: over {area_cm2:.0} cm² beside it, values stop at the volume's border, or at \
         voxels that hold nothing (missing, or one constant). Volumes and the polar map are wrong there by an unknown \
         part: send the whole field of view"
    )]
    FieldOfView {
        /// Area of the cut near the wall, cm².
        area_cm2: f64,
    },
    /// Nodes lie at or beyond the border of the volume.
    #[error("{share:.0} % of the model's nodes lie at or beyond the volume's border")]
    TouchesBorder {
        /// Per cent of nodes.
        share: f64,
    },
    /// A volume, thickness, length or strain outside the plausible range of left ventricles.
    #[error("implausible shape: {what} is {value:.1}; {least} to {most} is plausible")]
    ImplausibleShape {
        /// The measure.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Least plausible value.
        least: f64,
        /// Greatest plausible value.
        most: f64,
    },
    /// The wall looks thicker than blur makes usual walls look.
    #[error(
        "the wall is thick: {:.1} mm in the mean, between {:.1} and {:.1} mm in nine of ten hearts that look so; usual \
         walls that look so have {:.1} mm{}", .0.mean_mm, .0.interval_mm[0], .0.interval_mm[1], .0.look.usual_mm,
        unless_stated(.0)
    )]
    ThickWall(WallThickness),
    /// The image hardly tells the thickness of the wall.
    #[error(
        "the image hardly tells how thick the wall is: {:.1} mm is the mean of what is likely, between {:.1} and {:.1} mm \
         in nine of ten hearts that look so. Volumes of wall and cavity depend on it{}",
        .0.mean_mm, .0.interval_mm[0], .0.interval_mm[1], unless_stated(.0)
    )]
    ThicknessAssumed(WallThickness),
    /// The rim is far from a plane, so volumes depend on where the base is taken to be.
    #[error("the valve plane is unclear: {:.0} % of the basal half has no wall", 100.0 * gaps)]
    ValvePlane {
        /// Share of basal rays without wall.
        gaps: f64,
    },
}

/// What to do about a thickness that is not well known.
fn unless_stated(thickness: &WallThickness) -> &'static str {
    match thickness.look.resolution_mm {
        Some(_) => "",
        None => {
            ". A camera that blurs more than usual makes walls look thicker too: state its resolution (resolution), if it \
             is known"
        }
    }
}

/// The part of an apical wall that takes up too little to be seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DarkPart {
    /// All of it, as the search saw: the length comes from the breadth.
    Whole,
    /// All round, on the fitted wall: the length is that of the wall that shows.
    AllRound,
    /// A sector of it, on the fitted wall.
    Sector {
        /// Its angle about the axis, degrees.
        degrees: f64,
    },
}

fn dark_apex_text(uptake: f64, part: DarkPart) -> String {
    let percent = 100.0 * uptake;
    match part {
        DarkPart::Whole => format!(
            "the apical wall takes up {percent:.0} % as much as the basal one: the length of the model is that of a \
             mean heart of this breadth"
        ),
        DarkPart::AllRound => format!(
            "the apical wall takes up {percent:.0} % as much as the brightest, all round: the model may end short of \
             the apex, its cavity and wall be too small"
        ),
        DarkPart::Sector { degrees } => format!(
            "over {degrees:.0} degrees of its circumference the apical wall takes up {percent:.0} % as much as the \
             brightest: there the contours, and what they add to the volumes, follow from the wall about them"
        ),
    }
}

fn background_text(found: &Background) -> String {
    let Background {
        value,
        of_uptake,
        negative,
    } = found;
    let percent = 100.0 * of_uptake;
    if *value < 0.0 {
        format!(
            "the background is negative: it lies at {value}, {percent:.0} % of the wall's uptake, and {:.0} % of all \
             voxels are below 0: values were scaled or shifted, or padded below 0. Per cent of uptake are wrong: send \
             counts, which begin at 0 (subtract the background's value, or set padding to 0)",
            100.0 * negative
        )
    } else {
        format!(
            "no part of the volume is dark: hardly a voxel is below {value}, {percent:.0} % of the wall's uptake. A \
             constant was added, or an intercept left out: per cent of uptake are wrong. Send counts, which begin at 0"
        )
    }
}

fn exchanged_text(pair: AxisPair, score: &Score) -> String {
    let (axes, order, ends) = match pair {
        AxisPair::SidesAndLength => (
            "the axes from side to side and from feet to head",
            "z, y, x",
            "at the sides",
        ),
        AxisPair::DepthAndLength => (
            "the axes from front to back and from feet to head",
            "x, z, y",
            "in front and behind",
        ),
    };
    let liver = if score.side < 0.0 {
        format!(
            ", and {:.0} % of the bright activity about the heart lies where liver and gut would after an exchange",
            50.0 - 50.0 * score.side
        )
    } else {
        String::new()
    };
    format!(
        "{axes} are probably exchanged, which mirrors the heart (an array in {order} order with the affine of its \
         image): the body is cut off {ends} more than above and below (logarithm of the ends' areas {:.2}, usually \
         above 0){liver}. Transpose the array. The sides of the polar map are those of the file",
        score.ends
    )
}

/// The two positions in the projections, in words.
fn two_places(evidence: &Evidence) -> String {
    evidence.views.map_or_else(String::new, |views| {
        format!(
            ", with two places {:.0} mm apart along the bed in {:.0} and {:.0} % of the projections, which \
             explain {:.0} % of what one place does not",
            views.displacement,
            100.0 * (1.0 - views.share),
            100.0 * views.share,
            100.0 * views.gain
        )
    })
}

/// Directions to which the apex of a heart does not point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ApexDirection {
    /// To the patient's right.
    Right,
    /// To the back.
    Posterior,
    /// Up.
    Superior,
}

fn mirrored_text(towards: ApexDirection, degrees: f64) -> String {
    match towards {
        ApexDirection::Right => format!(
            "the apex points {degrees:.0} degrees to the patient's right: left and right may be exchanged in the file \
             (compare with another view: the liver lies on the right), or the heart lies on the right (dextrocardia). \
             The sides of the polar map are those of the file"
        ),
        ApexDirection::Posterior => format!(
            "the apex points {degrees:.0} degrees to the patient's back: front and back may be exchanged in the file \
             (compare with another view: the spine lies behind). The sides of the polar map are those of the file"
        ),
        ApexDirection::Superior => format!(
            "the apex points {degrees:.0} degrees up: up and down may be exchanged in the file (compare with another \
             view: the liver lies below the heart). The sides of the polar map are those of the file: a defect named \
             anterior may be inferior"
        ),
    }
}

impl Flag {
    /// The flag's name in reports.
    pub fn code(&self) -> &'static str {
        match self {
            Flag::UncertainPlace { .. } => "uncertain_place",
            Flag::UncertainFit { .. } => "uncertain_fit",
            Flag::Motion { .. } | Flag::Moved { .. } => "motion",
            Flag::OddView { .. } => "view_counts",
            Flag::RightVentricle { .. } => "right_ventricle",
            Flag::LabelMap { .. } => "label_map",
            Flag::Saturated(_) => "saturated",
            Flag::Background(found) if found.value < 0.0 => "negative_background",
            Flag::Background(_) => "raised_background",
            Flag::HotVoxels(_) => "hot_voxels",
            Flag::DarkApex { .. } => "dark_apex",
            Flag::NotAtRest { .. } => "not_at_rest",
            Flag::Folded { .. } => "folded",
            Flag::PoorContrast { .. } => "poor_contrast",
            Flag::Mirrored { .. } | Flag::ExchangedAxes { .. } | Flag::LiverOnTheLeft { .. } => {
                "mirrored"
            }
            Flag::FieldOfView { .. } => "field_of_view",
            Flag::TouchesBorder { .. } => "touches_border",
            Flag::ImplausibleShape { .. } => "implausible_shape",
            Flag::ThickWall(_) => "thick_wall",
            Flag::ThicknessAssumed(_) => "thickness_assumed",
            Flag::ValvePlane { .. } => "valve_plane",
        }
    }
}
