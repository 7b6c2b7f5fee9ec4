//! The headings that the forms of the page put parameters under.

/// The parameters that a form begins with.
pub const MAIN: &str = "";
/// Of a model: what is made how often.
pub const REPEATS: &str = "Repeat and choose";
/// Of a model: which part of the volume is meant.
pub const OBJECT: &str = "Object";
/// Of a model: how its points are spread.
pub const POINTS: &str = "Points";
/// Of a model: the least-squares fit.
pub const FIT: &str = "Fit to the surface";
/// Of a model: the flips of edges.
pub const TRIANGLES: &str = "Triangles";
/// What the expert's mask holds.
pub const EXPERT_MASK: &str = "The expert's mask";
/// What both scans of a comparison have in common.
pub const BOTH_SCANS: &str = "Both scans";
/// Where the organ lies and how it is turned.
pub const PLACE: &str = "Where the heart is";
/// What the sensors look for.
pub const EDGE: &str = "Edge of the wall";
/// How the image was made, and the grid of what is written.
pub const IMAGE: &str = "Image";
/// How slices are made of projections.
pub const PROJECTIONS: &str = "Projections";
/// Springs and motion of the model.
pub const SPRINGS: &str = "Springs";
/// The polar map.
pub const POLAR_MAP: &str = "Polar map";
/// What chooses the group of the normal limits, once limits are chosen.
pub const LIMITS_GROUP: &str = "Group of the normal limits";
