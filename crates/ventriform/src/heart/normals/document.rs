//! The file of normal limits, `ventriform normals build` writes it.

use super::error::NormalsError;
use super::kind::{GroupSex, ScanKind, yes_or_no};
use super::pattern::PATTERN_TERMS;
use super::sizes::{FEWEST_CASES, NORMALS_SCHEMA_VERSION};
use crate::base::text::{at_most, hex};
use crate::heart::polar::{RAY_COLUMNS, RAY_ROWS};
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::fmt;

/// The file's statement of its format.
const NORMALS_FORMAT: &str = "ventriform-normal-limits";
/// Longest JSON that is read, bytes.
pub const MOST_NORMALS_BYTES: usize = 16 << 20;
/// Most groups of a file.
const MOST_GROUPS: usize = 64;
/// Most people of a group, and most cases that are in none: as many as a cohort's table may have.
const MOST_PEOPLE: usize = 5000;
/// Most figures of a group: each of the heart's and of its segments' once, and room for later ones.
const MOST_FIGURES: usize = 256;
/// Most parameters of the fits.
const MOST_PARAMETERS: usize = 1024;

/// Normal limits, as `ventriform normals build` writes them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct NormalLimits {
    /// `ventriform-normal-limits`.
    pub format: String,
    /// 1.
    #[cfg_attr(feature = "schema", schema(value_type = u64))]
    pub schema_version: u32,
    /// The version of the program that built the limits.
    pub program_version: String,
    /// SHA-256 of everything else in this file, hexadecimal.
    pub sha256: String,
    /// Whether the people are simulated. Such limits are for tests, not for patients.
    pub simulated: bool,
    /// What the people are, in words.
    pub people: String,
    /// One group for each kind of scan.
    // What is beyond a limit by one is read, to be refused by its name.
    #[serde(deserialize_with = "at_most::<_, _, { MOST_GROUPS + 1 }>")]
    pub groups: Vec<NormalGroup>,
    /// Cases that are in no group.
    #[serde(deserialize_with = "at_most::<_, _, MOST_PEOPLE>")]
    pub excluded: Vec<ExcludedCase>,
    /// Every parameter of the fits, defaults written out.
    #[serde(deserialize_with = "flat")]
    pub parameters: Map<String, Value>,
}

/// The limits of one kind of scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct NormalGroup {
    /// `M`, `F` or `mixed`.
    pub sex: GroupSex,
    /// The protocol.
    pub protocol: String,
    /// The tracer.
    pub tracer: String,
    /// Whether attenuation was corrected.
    pub attenuation_corrected: bool,
    /// The people, in the order of the table.
    #[serde(deserialize_with = "at_most::<_, _, MOST_PEOPLE>")]
    pub cases: Vec<NormalCase>,
    /// Mean and standard deviation of the uptake.
    pub map: LimitMap,
    /// Limits of figures of the whole heart.
    #[serde(deserialize_with = "at_most::<_, _, MOST_FIGURES>")]
    pub figures: Vec<GlobalLimit>,
    /// The people, each judged by the limits of the others.
    pub leave_one_out: Specificity,
}

/// A healthy person of a group.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct NormalCase {
    /// The name in the table.
    pub case: String,
    /// `M` or `F`.
    pub sex: GroupSex,
    /// SHA-256 of the scan's file, hexadecimal.
    pub sha256: String,
}

/// A case that is in no group.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ExcludedCase {
    /// The name in the table.
    pub case: String,
    /// Why.
    pub reason: String,
}

/// Normal uptake at every place of the polar map: 32 rows from apex to base, 60 columns from lateral over anterior, septal and inferior. The
/// area-weighted mean of `mean` over the places that have one is 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct LimitMap {
    /// Mean; null where too few of the people have muscle.
    #[serde(deserialize_with = "rows")]
    pub mean: Vec<Vec<Option<f64>>>,
    /// Standard deviation, the uncertainty of so small a sample's mean and deviation included.
    #[serde(deserialize_with = "rows")]
    pub sd: Vec<Vec<Option<f64>>>,
    /// Covariance of the coefficients by which healthy people differ from the mean as a whole: of 2 r - 1, r cos a, r sin a, (2 r - 1)² - 1/3, r cos 2a,
    /// r sin 2a, with the way r from apex (0) to base (1) and the angle a from lateral over anterior. `sd` is what is left beside these.
    pub pattern_covariance: [[f64; PATTERN_TERMS]; PATTERN_TERMS],
}

/// Limits of a figure of the whole heart, or of a segment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct GlobalLimit {
    /// `cavity_ml`, `wall_ml`, `tid`, `ef_percent`, `edv_ml`, `esv_ml`, `phase_sd_degrees`, `phase_bandwidth_degrees`, `motion_mm` or `thickening_percent`.
    pub figure: String,
    /// The segment of motion or thickening, 1 to 17; null for the whole heart.
    pub segment: Option<usize>,
    /// Number of people.
    pub n: usize,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
    /// Quantile of 2.5 per cent, linear between the people.
    pub low: f64,
    /// Quantile of 97.5 per cent.
    pub high: f64,
}

/// The people of a group, each judged by the limits of the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Specificity {
    /// Mean share of the wall beyond the limit, per cent.
    pub mean_extent_percent: f64,
    /// Mean deficit score, per cent.
    pub mean_deficit_percent: f64,
    /// The deficit score that 95 of 100 people stay below, per cent: quantile of 95 per cent.
    pub deficit_percent_of_95: f64,
    /// Each person's figures.
    #[serde(deserialize_with = "at_most::<_, _, MOST_PEOPLE>")]
    pub cases: Vec<LeftOut>,
}

/// A person judged by the limits of the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct LeftOut {
    /// The name in the table.
    pub case: String,
    /// Share of the wall beyond the limit, per cent.
    pub extent_percent: f64,
    /// Deficit score, per cent.
    pub deficit_percent: f64,
    /// Sum of the segments' scores.
    pub summed_score: u32,
}

/// The first fields of a file, which are read before all of it.
#[derive(Deserialize)]
struct Head {
    #[serde(default)]
    format: String,
    #[serde(default)]
    schema_version: u64,
}

/// The rows of a polar map, of which there are not many more than it has.
fn rows<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Vec<Option<f64>>>, D::Error> {
    #[derive(Deserialize)]
    #[serde(transparent)]
    struct Row(
        #[serde(deserialize_with = "at_most::<_, _, { RAY_COLUMNS + 1 }>")] Vec<Option<f64>>,
    );
    let rows = at_most::<Row, D, { RAY_ROWS + 1 }>(deserializer)?;
    Ok(rows.into_iter().map(|row| row.0).collect())
}

/// Parameters: texts, numbers, `true`, `false` and `null`, and nothing that has values in it.
fn flat<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Map<String, Value>, D::Error> {
    struct Plain(Value);
    impl<'de> Deserialize<'de> for Plain {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            deserializer.deserialize_any(PlainVisitor).map(Plain)
        }
    }
    struct PlainVisitor;
    impl Visitor<'_> for PlainVisitor {
        type Value = Value;
        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a text, a number, true, false or null")
        }
        fn visit_unit<E>(self) -> Result<Value, E> {
            Ok(Value::Null)
        }
        fn visit_bool<E>(self, flag: bool) -> Result<Value, E> {
            Ok(flag.into())
        }
        fn visit_i64<E>(self, number: i64) -> Result<Value, E> {
            Ok(number.into())
        }
        fn visit_u64<E>(self, number: u64) -> Result<Value, E> {
            Ok(number.into())
        }
        fn visit_f64<E>(self, number: f64) -> Result<Value, E> {
            Ok(number.into())
        }
        fn visit_str<E>(self, text: &str) -> Result<Value, E> {
            Ok(text.into())
        }
    }
    struct Flat;
    impl<'de> Visitor<'de> for Flat {
        type Value = Map<String, Value>;
        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("an object of parameters")
        }
        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut parameters = Map::new();
            while let Some((name, value)) = map.next_entry::<String, Plain>()? {
                if parameters.len() == MOST_PARAMETERS {
                    let reason = format!("there are more than {MOST_PARAMETERS} parameters");
                    return Err(A::Error::custom(reason));
                }
                parameters.insert(name, value.0);
            }
            Ok(parameters)
        }
    }
    deserializer.deserialize_map(Flat)
}

/// Whether the name of a protocol has the word `role`, `stress` or `rest`, in it.
pub(crate) fn names_protocol(protocol: &str, role: &str) -> bool {
    let mut words = protocol.split(|c: char| !c.is_alphanumeric());
    words.any(|word| word.eq_ignore_ascii_case(role))
}

impl NormalLimits {
    /// Limits of these groups with the SHA-256 of their content.
    pub fn new(
        program_version: &str,
        simulated: bool,
        groups: Vec<NormalGroup>,
        excluded: Vec<ExcludedCase>,
        parameters: Map<String, Value>,
    ) -> Self {
        let people = if simulated {
            "simulated, not patients"
        } else {
            "as the cohort's table states"
        };
        let mut limits = Self {
            format: NORMALS_FORMAT.to_owned(),
            schema_version: NORMALS_SCHEMA_VERSION,
            program_version: program_version.to_owned(),
            sha256: String::new(),
            simulated,
            people: people.to_owned(),
            groups,
            excluded,
            parameters,
        };
        limits.sha256 = limits.content_sha256();
        limits
    }

    /// The JSON, ending with a line feed.
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string(self).expect("finite numbers and texts");
        text.push('\n');
        text
    }

    /// Reads and checks the JSON.
    ///
    /// # Errors
    /// [`NormalsError`].
    pub fn from_json(text: &[u8]) -> Result<Self, NormalsError> {
        if text.len() > MOST_NORMALS_BYTES {
            let reason = format!("it has more than {MOST_NORMALS_BYTES} bytes");
            return Err(NormalsError::Syntax(reason));
        }
        let syntax = |error: serde_json::Error| NormalsError::Syntax(error.to_string());
        // Neither is a tree of JSON values, which has up to 50 times as many bytes as its text.
        let head: Head = serde_json::from_slice(text).map_err(syntax)?;
        if head.format != NORMALS_FORMAT {
            let reason = format!("`format` is not {NORMALS_FORMAT}");
            return Err(NormalsError::Syntax(reason));
        }
        let version = head.schema_version;
        if version != u64::from(NORMALS_SCHEMA_VERSION) {
            return Err(NormalsError::SchemaVersion(version));
        }
        let limits: Self = serde_json::from_slice(text).map_err(syntax)?;
        let found = limits.content_sha256();
        if found != limits.sha256 {
            return Err(NormalsError::Edited {
                stated: limits.sha256,
                found,
            });
        }
        limits.check()?;
        Ok(limits)
    }

    /// The group that a scan of this kind belongs to. What is not known of the scan matches, if only one group is left.
    ///
    /// # Errors
    /// [`NormalsError::OtherKind`], [`NormalsError::Ambiguous`].
    pub fn group(&self, kind: &ScanKind) -> Result<&NormalGroup, NormalsError> {
        let groups: Vec<&NormalGroup> = self
            .groups
            .iter()
            .filter(|group| group.suits(kind))
            .collect();
        let known = || self.groups.iter().map(ToString::to_string).collect();
        match groups[..] {
            [group] => Ok(group),
            [] => Err(NormalsError::OtherKind {
                scan: kind.clone(),
                groups: known(),
            }),
            _ => Err(NormalsError::Ambiguous {
                scan: kind.clone(),
                groups: groups.iter().map(ToString::to_string).collect(),
            }),
        }
    }

    /// The protocol for scans at `stress` or `rest`: the only one whose name has that word in it, or the word itself where
    /// all names have that of the other kind of scan, so that no group suits. `None` if names do not tell.
    pub fn protocol_of(&self, role: &str) -> Option<String> {
        let protocols: BTreeSet<&str> = (self.groups.iter())
            .map(|group| group.protocol.as_str())
            .collect();
        let own: Vec<&str> = (protocols.iter().copied())
            .filter(|protocol| names_protocol(protocol, role))
            .collect();
        let other = if role == "stress" { "rest" } else { "stress" };
        match own[..] {
            [only] => Some(only.to_owned()),
            [] => (protocols.iter())
                .all(|protocol| names_protocol(protocol, other))
                .then(|| role.to_owned()),
            _ => None,
        }
    }

    /// The tracer of the groups that a header's text names: the only one whose name stands in the text, or that the
    /// text is a part of. Headers spell tracers freely ("Tc-99m Tetrofosmin", "TETROFOSMIN").
    pub fn tracer_named(&self, text: &str) -> Option<&str> {
        let text = text.trim().to_lowercase();
        let named = |tracer: &&str| {
            let name = tracer.trim().to_lowercase();
            !name.is_empty() && !text.is_empty() && (text.contains(&name) || name.contains(&text))
        };
        let tracers = self.groups.iter().map(|group| group.tracer.as_str());
        let found: BTreeSet<&str> = tracers.filter(named).collect();
        (found.len() == 1)
            .then(|| found.into_iter().next())
            .flatten()
    }

    /// The hash of everything but itself, however numbers are spelt: programs that write `1.0` as `1` change nothing.
    fn content_sha256(&self) -> String {
        let as_decimal = |(name, value): (&String, &Value)| {
            let decimal = value.as_f64().map(Value::from);
            (name.clone(), decimal.unwrap_or_else(|| value.clone()))
        };
        let content = Self {
            sha256: String::new(),
            parameters: self.parameters.iter().map(as_decimal).collect(),
            ..self.clone()
        };
        hex(&Sha256::digest(content.to_json()))
    }

    /// Checks sizes and numbers.
    fn check(&self) -> Result<(), NormalsError> {
        let field = |field: String, reason: &str| NormalsError::Field {
            field,
            reason: reason.to_owned(),
        };
        if self.groups.is_empty() || self.groups.len() > MOST_GROUPS {
            return Err(field("groups".to_owned(), "there must be 1 to 64"));
        }
        for (index, group) in self.groups.iter().enumerate() {
            let at = |name: &str| format!("groups[{index}].{name}");
            if group.cases.len() < FEWEST_CASES {
                return Err(NormalsError::TooFewCases {
                    group: group.to_string(),
                    cases: group.cases.len(),
                });
            }
            let complete = |rows: &[Vec<Option<f64>>]| {
                rows.len() == RAY_ROWS && rows.iter().all(|row| row.len() == RAY_COLUMNS)
            };
            for (name, rows) in [("map.mean", &group.map.mean), ("map.sd", &group.map.sd)] {
                if !complete(rows) {
                    return Err(field(at(name), "it must have 32 rows of 60 numbers"));
                }
                if rows
                    .iter()
                    .flatten()
                    .flatten()
                    .any(|x| !(*x > 0.0 && x.is_finite()))
                {
                    return Err(field(at(name), "its numbers must be above 0"));
                }
            }
            let mut covariance = group.map.pattern_covariance.iter().flatten();
            if covariance.any(|x| !x.is_finite())
                || (0..PATTERN_TERMS).any(|n| group.map.pattern_covariance[n][n] < 0.0)
            {
                return Err(field(
                    at("map.pattern_covariance"),
                    "its numbers must be finite, those of the diagonal not below 0",
                ));
            }
        }
        Ok(())
    }
}

impl NormalGroup {
    /// Whether a scan of this kind can be compared, as far as the kind is known.
    pub fn suits(&self, kind: &ScanKind) -> bool {
        let same = |known: &Option<String>, own: &str| {
            known
                .as_ref()
                .is_none_or(|known| known.trim().eq_ignore_ascii_case(own.trim()))
        };
        kind.sex.is_none_or(|sex| self.sex.holds(sex))
            && same(&kind.protocol, &self.protocol)
            && same(&kind.tracer, &self.tracer)
            && (kind.attenuation_corrected)
                .is_none_or(|corrected| corrected == self.attenuation_corrected)
    }
}

/// "sex M, protocol rest, tracer Tc-99m sestamibi, attenuation corrected no, 31 cases".
impl fmt::Display for NormalGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "sex {}, protocol {}, tracer {}, attenuation corrected {}, {} cases",
            self.sex.as_str(),
            self.protocol,
            self.tracer,
            yes_or_no(self.attenuation_corrected),
            self.cases.len()
        )
    }
}
