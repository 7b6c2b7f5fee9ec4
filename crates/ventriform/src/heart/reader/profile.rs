//! A reader's profile and its JSON.

use crate::base::text::{at_most, hex};
use crate::heart::deform::WallEdge;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::ops::RangeInclusive;

/// Distances of a reader's wall from the fitted one, mm.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ReaderOffsets {
    /// Distance of the inner surface, positive outward.
    pub endocardium: f64,
    /// Distance of the outer surface, positive outward.
    pub epicardium: f64,
    /// Distance of the rim, positive towards the base.
    pub rim: f64,
}

impl ReaderOffsets {
    /// The three numbers in the order of the fields.
    pub fn to_array(self) -> [f64; 3] {
        [self.endocardium, self.epicardium, self.rim]
    }

    /// The reverse of [`ReaderOffsets::to_array`].
    pub fn from_array([endocardium, epicardium, rim]: [f64; 3]) -> Self {
        Self {
            endocardium,
            epicardium,
            rim,
        }
    }
}

/// How a reader's wall is drawn on a fitted one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ReaderDrawing {
    /// By distances from the fitted edge.
    Edge(ReaderOffsets),
    /// Where the image has this share of the polar map's reference.
    Level(f64),
}

impl ReaderDrawing {
    /// Whether it leaves a wall as it is.
    pub fn is_none(&self) -> bool {
        *self == Self::Edge(ReaderOffsets::default())
    }

    /// The distances, mm, of a reader who draws by them.
    pub fn offsets(&self) -> Option<ReaderOffsets> {
        match self {
            Self::Edge(offsets) => Some(*offsets),
            Self::Level(_) => None,
        }
    }

    /// The level, a share of the reference, of a reader who draws by one.
    pub fn level(&self) -> Option<f64> {
        match self {
            Self::Edge(_) => None,
            Self::Level(level) => Some(*level),
        }
    }
}

/// The kind of a reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReaderKind {
    /// Draws the edge that the image shows, some distance off.
    Edge,
    /// Draws where the image has a level.
    Level,
}

impl ReaderKind {
    /// `edge` or `level`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Edge => "edge",
            Self::Level => "level",
        }
    }
}

/// One distance of a reader's profile, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = LearntOffset))]
#[serde(deny_unknown_fields)]
pub struct ReaderOffset {
    /// The applied offset: the mean, drawn towards zero.
    pub value: f64,
    /// Mean over the masks.
    pub mean: f64,
    /// Standard deviation over the masks; 0 for one mask.
    pub spread: f64,
}

/// The level of a reader's profile, a share of the polar map's reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = LearntLevel))]
#[serde(deny_unknown_fields)]
pub struct ReaderLevel {
    /// The applied level: the mean, drawn towards the usual level.
    pub value: f64,
    /// Mean over the masks.
    pub mean: f64,
    /// Standard deviation over the masks; 0 for one mask.
    pub spread: f64,
}

/// The part of a reader's drawing that was learnt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Learnt {
    /// The distances, in the order of [`ReaderOffsets`].
    Edge([ReaderOffset; 3]),
    /// The level.
    Level(ReaderLevel),
}

impl Learnt {
    /// The kind of the reader.
    pub fn kind(&self) -> ReaderKind {
        match self {
            Self::Edge(_) => ReaderKind::Edge,
            Self::Level(_) => ReaderKind::Level,
        }
    }

    /// The drawing that is applied.
    pub fn drawing(&self) -> ReaderDrawing {
        match self {
            Self::Edge(offsets) => {
                ReaderDrawing::Edge(ReaderOffsets::from_array(offsets.map(|o| o.value)))
            }
            Self::Level(level) => ReaderDrawing::Level(level.value),
        }
    }
}

/// A scan and its mask that a profile was learnt on.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LearntOn {
    /// SHA-256 of the scan's file, hexadecimal.
    pub scan: String,
    /// SHA-256 of the mask's file, hexadecimal.
    pub mask: String,
}

/// A reader's profile.
#[derive(Debug, Clone, PartialEq)]
pub struct ReaderProfile {
    /// The wall that is drawn from.
    pub edge: WallEdge,
    /// The reader's distances or level.
    pub learnt: Learnt,
    /// The masks it was learnt on, one entry each.
    pub learnt_on: Vec<LearntOn>,
}

/// Why a text is no profile that can be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProfileError {
    /// It is no JSON, or has other fields.
    #[error("this is not a reader's profile: {0}")]
    Syntax(String),
    /// It was written by a program that knows more.
    #[error("the profile has version {0}; this program reads version {PROFILE_VERSION}")]
    Version(u32),
    /// A field holds something that no profile can hold.
    #[error("`{field}`: {reason}")]
    Field {
        /// The field.
        field: String,
        /// The problem.
        reason: String,
    },
}

/// The version of the JSON.
const PROFILE_VERSION: u32 = 2;
/// The JSON's statement of its format.
const PROFILE_FORMAT: &str = "ventriform-reader-profile";
/// The names of the distances and the greatest that are believed, mm.
const MAX_OFFSETS_MM: [(&str, f64); 3] = [("endocardium", 8.0), ("epicardium", 8.0), ("rim", 20.0)];
/// The levels that are believed.
const PLAUSIBLE_LEVELS: RangeInclusive<f64> = 0.1..=0.95;
/// Longest JSON that is read, bytes.
pub const MOST_BYTES: usize = 1 << 20;
/// Most masks of a profile.
const MOST_MASKS: usize = 5000;

/// A reader's profile, as `ventriform calibrate` writes it.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = ReaderProfile))]
#[serde(deny_unknown_fields)]
pub struct ProfileDocument {
    /// `ventriform-reader-profile`.
    format: String,
    /// 2.
    #[cfg_attr(feature = "schema", schema(value_type = u64))]
    version: u32,
    /// `edge`: the reader draws the edge that the image shows, by the distances `offsets_mm` off. `level`: where the image
    /// has a share of the polar map's reference.
    kind: String,
    /// The wall that is drawn from: `apparent` or `anatomical`.
    edge: String,
    /// Number of masks that it was learnt on: the length of `learnt_on`.
    masks: usize,
    /// The distances of a reader of kind `edge`, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    offsets_mm: Option<LearntOffsets>,
    /// The level of a reader of kind `level`, a share of the polar map's reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    level: Option<ReaderLevel>,
    /// The masks it was learnt on.
    #[serde(deserialize_with = "at_most::<_, _, { MOST_MASKS + 1 }>")]
    learnt_on: Vec<LearntOn>,
}

/// The first fields of a profile, which are read before all of it.
#[derive(Deserialize)]
struct Head {
    #[serde(default)]
    format: String,
    #[serde(default)]
    version: u64,
}

/// The distances of a reader's profile.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
struct LearntOffsets {
    /// Inner surface, outward.
    endocardium: ReaderOffset,
    /// Outer surface, outward.
    epicardium: ReaderOffset,
    /// Rim, towards the base.
    rim: ReaderOffset,
}

impl ReaderProfile {
    /// The drawing that is applied.
    pub fn drawing(&self) -> ReaderDrawing {
        self.learnt.drawing()
    }

    /// Number of masks that it was learnt on.
    pub fn masks(&self) -> usize {
        self.learnt_on.len()
    }

    /// The JSON, ending with a line feed.
    pub fn to_json(&self) -> String {
        let (offsets_mm, level) = match self.learnt {
            Learnt::Edge([endocardium, epicardium, rim]) => {
                let offsets = LearntOffsets {
                    endocardium,
                    epicardium,
                    rim,
                };
                (Some(offsets), None)
            }
            Learnt::Level(level) => (None, Some(level)),
        };
        let document = ProfileDocument {
            format: PROFILE_FORMAT.into(),
            version: PROFILE_VERSION,
            kind: self.learnt.kind().as_str().into(),
            edge: self.edge.as_str().into(),
            masks: self.masks(),
            offsets_mm,
            level,
            learnt_on: self.learnt_on.clone(),
        };
        let mut text = serde_json::to_string_pretty(&document).expect("finite numbers and texts");
        text.push('\n');
        text
    }

    /// SHA-256 of [`ReaderProfile::to_json`], hexadecimal: the same for the same profile, however
    /// its file is spaced.
    pub fn sha256(&self) -> String {
        hex(&Sha256::digest(self.to_json()))
    }

    /// Reads and checks the JSON.
    ///
    /// # Errors
    /// [`ProfileError`].
    pub fn from_json(text: &[u8]) -> Result<Self, ProfileError> {
        if text.len() > MOST_BYTES {
            let reason = format!("it has more than {MOST_BYTES} bytes");
            return Err(ProfileError::Syntax(reason));
        }
        let syntax = |error: serde_json::Error| ProfileError::Syntax(error.to_string());
        // Neither is a tree of JSON values, which has up to 50 times as many bytes as its text.
        let head: Head = serde_json::from_slice(text).map_err(syntax)?;
        if head.format != PROFILE_FORMAT {
            let reason = format!("`format` is not {PROFILE_FORMAT}");
            return Err(ProfileError::Syntax(reason));
        }
        let version = head.version;
        if version != u64::from(PROFILE_VERSION) {
            let version = u32::try_from(version).unwrap_or(u32::MAX);
            return Err(ProfileError::Version(version));
        }
        let document: ProfileDocument = serde_json::from_slice(text).map_err(syntax)?;
        let edge = WallEdge::parse(&document.edge)
            .ok_or_else(|| refused("edge", "it must be apparent or anatomical"))?;
        let learnt = document.learnt()?;
        if document.masks != document.learnt_on.len() || !(1..=MOST_MASKS).contains(&document.masks)
        {
            let reason = format!("it must count the entries of `learnt_on`, 1 to {MOST_MASKS}");
            return Err(refused("masks", reason));
        }
        let hash = |h: &String| h.len() == 64 && h.bytes().all(|b| b.is_ascii_hexdigit());
        if !document
            .learnt_on
            .iter()
            .all(|l| hash(&l.scan) && hash(&l.mask))
        {
            let reason = "every scan and mask is a SHA-256 of 64 hexadecimal digits";
            return Err(refused("learnt_on", reason));
        }
        Ok(Self {
            edge,
            learnt,
            learnt_on: document.learnt_on,
        })
    }
}

impl ProfileDocument {
    /// The distances or the level, as the kind says.
    fn learnt(&self) -> Result<Learnt, ProfileError> {
        let (missing, other) = (
            "it must be there, and is not",
            "a reader of this kind has none",
        );
        match self.kind.as_str() {
            "edge" => {
                if self.level.is_some() {
                    return Err(refused("level", other));
                }
                let given = self.offsets_mm.as_ref();
                checked_offsets(given.ok_or_else(|| refused("offsets_mm", missing))?)
            }
            "level" => {
                if self.offsets_mm.is_some() {
                    return Err(refused("offsets_mm", other));
                }
                let level = self.level.ok_or_else(|| refused("level", missing))?;
                let within = PLAUSIBLE_LEVELS.contains(&level.value)
                    && PLAUSIBLE_LEVELS.contains(&level.mean);
                if !(within && (0.0..=1.0).contains(&level.spread)) {
                    let (least, most) = (PLAUSIBLE_LEVELS.start(), PLAUSIBLE_LEVELS.end());
                    let reason =
                        format!("it must lie from {least} to {most}, its spread from 0 to 1");
                    return Err(refused("level", reason));
                }
                Ok(Learnt::Level(level))
            }
            _ => Err(refused("kind", "it must be edge or level")),
        }
    }
}

fn checked_offsets(given: &LearntOffsets) -> Result<Learnt, ProfileError> {
    let offsets = [given.endocardium, given.epicardium, given.rim];
    for ((name, most), offset) in MAX_OFFSETS_MM.iter().zip(&offsets) {
        let within = |x: f64| x.abs() <= *most;
        if !(within(offset.value) && within(offset.mean) && (0.0..=20.0).contains(&offset.spread)) {
            let reason = format!("it must lie within {most} mm, its spread from 0 to 20 mm");
            return Err(refused(&format!("offsets_mm.{name}"), reason));
        }
    }
    Ok(Learnt::Edge(offsets))
}

fn refused(field: &str, reason: impl Into<String>) -> ProfileError {
    ProfileError::Field {
        field: field.into(),
        reason: reason.into(),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A profile with these distances, as if learnt on one mask.
    pub fn profile(offsets: [f64; 3]) -> ReaderProfile {
        ReaderProfile {
            edge: WallEdge::Apparent,
            learnt: Learnt::Edge(offsets.map(|value| ReaderOffset {
                value,
                mean: value,
                spread: 0.0,
            })),
            learnt_on: vec![LearntOn {
                scan: "a".repeat(64),
                mask: "b".repeat(64),
            }],
        }
    }

    #[test]
    fn a_profile_reads_back_unchanged() {
        let written = profile([0.5, -1.25, 3.0]);
        let text = written.to_json();
        assert_eq!(
            ReaderProfile::from_json(text.as_bytes()),
            Ok(written.clone())
        );
        let respaced = text.replace('\n', "");
        let read = ReaderProfile::from_json(respaced.as_bytes()).unwrap();
        assert_eq!(read.sha256(), written.sha256());
    }

    /// A profile of this level, as if learnt on one mask.
    fn level(value: f64) -> ReaderProfile {
        ReaderProfile {
            learnt: Learnt::Level(ReaderLevel {
                value,
                mean: value,
                spread: 0.0,
            }),
            ..profile([0.0; 3])
        }
    }

    #[test]
    fn a_level_reads_back_unchanged_and_has_no_distances() {
        let written = level(0.5);
        let text = written.to_json();
        assert!(text.contains("\"kind\": \"level\"") && !text.contains("offsets"));
        assert_eq!(ReaderProfile::from_json(text.as_bytes()), Ok(written));
        for (from, to, field) in [
            ("\"kind\": \"level\"", "\"kind\": \"edge\"", "level"),
            ("\"kind\": \"level\"", "\"kind\": \"both\"", "kind"),
            ("\"value\": 0.5", "\"value\": 1.5", "level"),
        ] {
            let changed = text.replacen(from, to, 1);
            assert_ne!(changed, text);
            let error = ReaderProfile::from_json(changed.as_bytes()).unwrap_err();
            let named = format!("`{field}`");
            assert!(error.to_string().contains(&named), "{error} for {to}");
        }
    }

    #[test]
    fn what_no_profile_can_hold_is_refused_by_name() {
        let text = profile([0.5, -1.25, 3.0]).to_json();
        for (from, to, field) in [
            ("\"version\": 2", "\"version\": 3", "version 3"),
            ("\"version\": 2", "\"version\": 1", "version 1"),
            ("-1.25", "-9.25", "offsets_mm.epicardium"),
            ("-1.25", "1e999", "profile"),
            ("\"masks\": 1", "\"masks\": 2", "masks"),
            ("apparent", "blurred", "edge"),
            ("aaaa", "zzzz", "learnt_on"),
            ("ventriform-reader", "other", "format"),
            ("\"edge\": ", "\"patient\": \"x\", \"edge\": ", "patient"),
        ] {
            let changed = text.replacen(from, to, 1);
            assert_ne!(changed, text);
            let error = ReaderProfile::from_json(changed.as_bytes()).unwrap_err();
            assert!(error.to_string().contains(field), "{error} for {to}");
        }
        assert!(ReaderProfile::from_json(b"").is_err());
    }

    /// A parsed list of JSON values has many times the bytes of its text.
    #[test]
    fn a_list_longer_than_that_of_any_profile_is_refused_before_it_is_all_read() {
        let text = profile([0.5, -1.25, 3.0]).to_json();
        let start = text.find("\"learnt_on\"").unwrap();
        let many = vec![r#"["",""]"#; MOST_MASKS + 2].join(",");
        let many = format!("{}\"learnt_on\":[{many}]}}", &text[..start]);
        let error = ReaderProfile::from_json(many.as_bytes()).unwrap_err();
        assert!(matches!(error, ProfileError::Syntax(_)), "{error}");
        assert!(error.to_string().contains("5001"), "{error}");
    }
}
