//! Whether files are of one scan: what may lie in one volume, or be gates of one beat, by all that their headers say.
//!
//! In: the header of each file. Out: the first attribute of [`TABLE`] of which two files state different values, with
//! both values and one file of each. A row says how values are compared and how far they must agree:
//!
//! - [`Reach::Series`]: in all files of one series, whatever volumes they make up: whose scan it is, and its unit.
//! - [`Reach::Volume`]: in all slices of one volume, and in all gates of one beat: how it was made. Volumes of one
//!   series may differ, as those of two filters do.
//! - [`Reach::Gates`]: in all gates of one beat that are files of their own: when it was acquired. Slices are acquired
//!   one after the other.
//!
//! What differs from slice to slice of one scan is in no row: times and numbers of images, scaling, frame times, decay
//! factors. A value that a file leaves out contradicts nothing. Neither do other spellings of one value: padding,
//! capitals and trailing parts of a name, digits of a number.
//!
//! Guaranteed: the order of the files changes neither the verdict nor which two files an error names.

use super::rest_stress::rest_or_stress;
use std::collections::BTreeMap;
use ventriform_dicom::read::attributes::{
    ACQUISITION_DATE, ACQUISITION_TIME, ATTENUATION_METHOD, Attribute, Attributes,
    CONVOLUTION_KERNEL, CORRECTED_IMAGE, COUNTS_SOURCE, DECAY_CORRECTION, ENERGY_LOWER,
    ENERGY_UPPER, FRAME_OF_REFERENCE, IMAGE_TYPE, INJECTED_DOSE, INJECTION_TIME, INSTANCE_NUMBER,
    MANUFACTURER, MODALITY, MODEL_NAME, NUCLIDE_MEANING, PATIENT_BIRTH_DATE, PATIENT_ID,
    PATIENT_ID_ISSUER, PATIENT_NAME, PATIENT_POSITION, PATIENT_SEX, PET_ENERGY_LOWER,
    PET_ENERGY_UPPER, PHARMACEUTICAL_MEANING, PHARMACEUTICAL_NAME, RANDOMS_METHOD,
    RECONSTRUCTION_METHOD, RESCALE_TYPE, SCATTER_METHOD, SERIES_DESCRIPTION, SERIES_TYPE,
    SOP_CLASS, STUDY_DATE, STUDY_UID, SUV_TYPE, UNITS, clip,
};

/// Farthest that the Acquisition Times of gates of one beat may lie apart, which are acquired together, s.
const SAME_ACQUISITION_S: f64 = 60.0;

/// Largest relative difference of equal decimal numbers, of which writers keep six digits or more.
const SAME_NUMBER: f64 = 1e-5;

/// Most different values of an attribute that are compared each with each.
const MOST_COMPARED: usize = 256;

/// How two values are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rule {
    /// Character for character, without padding.
    Exact,
    /// Words, whatever their capitals and the spaces between them.
    Words,
    /// The components of a person's name that both state, in each of its representations.
    Name,
    /// The values that both state, in their order.
    Values,
    /// The values in any order.
    Set,
    /// A decimal number.
    Number,
    /// The digits of a date as far as both go.
    Date,
    /// A time of day to the second.
    Time,
    /// A time of day to [`SAME_ACQUISITION_S`].
    Acquisition,
}

/// How far values must agree.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Reach {
    /// In the files of one series.
    Series,
    /// In the slices of one volume, and in the gates of one beat.
    Volume,
    /// In the files of one gate each.
    Gates,
}

/// An attribute that says whose scan it is, or what of.
struct Row {
    attribute: Attribute,
    /// Its name where that of the attribute does not tell.
    called: Option<&'static str>,
    rule: Rule,
    reach: Reach,
}

impl Row {
    fn name(&self) -> &'static str {
        self.called.unwrap_or(self.attribute.name)
    }
}

const fn row(attribute: Attribute, rule: Rule, reach: Reach) -> Row {
    Row {
        attribute,
        called: None,
        rule,
        reach,
    }
}

const fn named(called: &'static str, row: Row) -> Row {
    Row {
        called: Some(called),
        ..row
    }
}

use Reach::{Gates, Series, Volume};
use Rule::{Acquisition, Date, Exact, Name, Number, Set, Time, Values, Words};

/// What the files of one scan must agree on, the most telling first.
const TABLE: &[Row] = &[
    row(PATIENT_ID, Exact, Series),
    row(PATIENT_NAME, Name, Series),
    row(PATIENT_ID_ISSUER, Words, Series),
    row(PATIENT_BIRTH_DATE, Date, Series),
    row(PATIENT_SEX, Words, Series),
    row(STUDY_UID, Exact, Series),
    row(STUDY_DATE, Date, Series),
    row(FRAME_OF_REFERENCE, Exact, Series),
    row(MODALITY, Words, Series),
    row(SOP_CLASS, Exact, Series),
    row(UNITS, Words, Series),
    row(SUV_TYPE, Words, Series),
    row(COUNTS_SOURCE, Words, Series),
    row(MANUFACTURER, Words, Series),
    row(MODEL_NAME, Words, Series),
    row(SERIES_TYPE, Values, Volume),
    row(IMAGE_TYPE, Values, Volume),
    row(RESCALE_TYPE, Words, Volume),
    row(PATIENT_POSITION, Words, Volume),
    row(CORRECTED_IMAGE, Set, Volume),
    row(ATTENUATION_METHOD, Words, Volume),
    row(SCATTER_METHOD, Words, Volume),
    row(RANDOMS_METHOD, Words, Volume),
    row(DECAY_CORRECTION, Words, Volume),
    row(RECONSTRUCTION_METHOD, Words, Volume),
    row(CONVOLUTION_KERNEL, Values, Volume),
    named(
        "Radiopharmaceutical Code (0054,0304)",
        row(PHARMACEUTICAL_MEANING, Words, Volume),
    ),
    row(PHARMACEUTICAL_NAME, Words, Volume),
    named(
        "Radionuclide Code (0054,0300)",
        row(NUCLIDE_MEANING, Words, Volume),
    ),
    row(INJECTED_DOSE, Number, Volume),
    row(INJECTION_TIME, Time, Volume),
    row(ENERGY_LOWER, Number, Volume),
    row(ENERGY_UPPER, Number, Volume),
    row(PET_ENERGY_LOWER, Number, Volume),
    row(PET_ENERGY_UPPER, Number, Volume),
    row(ACQUISITION_DATE, Date, Gates),
    row(ACQUISITION_TIME, Acquisition, Gates),
    REST_OR_STRESS,
];

/// What protocol and descriptions say together.
const REST_OR_STRESS: Row = named(
    "rest or stress (by protocol and descriptions)",
    row(SERIES_DESCRIPTION, Words, Gates),
);

/// What one file says of the scan: a text for each row, if the file states one.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct ScanStatement {
    /// Name of the file, and its Instance Number, by which others know it.
    file: String,
    values: Vec<Option<String>>,
}

impl ScanStatement {
    /// What the file with attributes `a` says.
    pub(super) fn from_attributes(a: &Attributes) -> Self {
        let stated = |row: &Row| {
            if row.name() == REST_OR_STRESS.name() {
                return rest_or_stress(a);
            }
            let text = a.prose(row.attribute)?;
            let text = text.trim_matches(['\0', ' ', '\\']);
            (!text.is_empty()).then(|| text.to_owned())
        };
        Self {
            file: match a.text(INSTANCE_NUMBER) {
                Some(number) => format!("{} (Instance Number {})", a.file, clip(&number)),
                None => a.file.clone(),
            },
            values: TABLE.iter().map(stated).collect(),
        }
    }

    /// The attributes by name, with what the file states.
    pub(super) fn stated(&self) -> impl Iterator<Item = (&'static str, Option<&str>)> {
        let rows = TABLE.iter().map(Row::name);
        rows.zip(self.values.iter().map(Option::as_deref))
    }
}

/// A value and the files that state it.
struct Held<'a> {
    value: &'a str,
    /// The first file by name.
    file: &'a str,
    files: usize,
}

/// Two values of one attribute.
struct Contradiction<'a> {
    row: &'static Row,
    values: [Held<'a>; 2],
}

/// The different texts that `files` state for the row of number `number`, in the order of the files' names.
fn held<'a>(files: &[&'a ScanStatement], number: usize) -> Vec<Held<'a>> {
    let mut all: BTreeMap<&str, Held<'a>> = BTreeMap::new();
    for file in files {
        let Some(value) = file.values.get(number).and_then(Option::as_deref) else {
            continue;
        };
        let held = all.entry(value).or_insert(Held {
            value,
            file: &file.file,
            files: 0,
        });
        held.files += 1;
        held.file = held.file.min(&file.file);
    }
    let mut all: Vec<Held> = all.into_values().collect();
    all.sort_by(|a, b| (a.file, a.value).cmp(&(b.file, b.value)));
    all
}

/// The contradictions between `files`, of each row up to `reach` the first.
fn contradictions<'a>(files: &[&'a ScanStatement], reach: Reach) -> Vec<Contradiction<'a>> {
    let of_row = |(number, row): (usize, &'static Row)| {
        let mut all = held(files, number);
        all.truncate(MOST_COMPARED);
        let pairs = (0..all.len()).flat_map(|a| (a + 1..all.len()).map(move |b| (a, b)));
        let (a, b) = { pairs }.find(|(a, b)| row.rule.contradict(all[*a].value, all[*b].value))?;
        let second = all.swap_remove(b);
        let first = all.swap_remove(a);
        Some(Contradiction {
            row,
            values: [first, second],
        })
    };
    let wanted = TABLE
        .iter()
        .enumerate()
        .filter(|(_, row)| row.reach <= reach);
    wanted.filter_map(of_row).collect()
}

/// Why `files` are not of one scan, in words that continue a sentence: the first attribute that they contradict each
/// other on, both values and one file of each, and the names of the others.
pub(crate) fn contradiction(files: &[&ScanStatement], reach: Reach) -> Option<String> {
    let all = contradictions(files, reach);
    let (first, others) = all.split_first()?;
    let part = |held: &Held| {
        let value = clip(held.value);
        match held.files {
            1 => format!("\"{value}\" in {}", held.file),
            files => format!("\"{value}\" in {files} files, such as {}", held.file),
        }
    };
    let [one, other] = first.values.each_ref().map(part);
    let mut text = format!("{} is {one}, and {other}", first.row.name());
    let mut names: Vec<&str> = others.iter().map(|other| other.row.name()).collect();
    names.dedup();
    if !names.is_empty() {
        text.push_str("; they differ in ");
        text.push_str(&names.join(", "));
        text.push_str(" too");
    }
    Some(text)
}

/// The values of each of `scans` by which they differ from another, with the attributes' names, at most `most` for
/// each.
pub(super) fn differing(scans: &[&ScanStatement], most: usize) -> Vec<String> {
    let all = contradictions(scans, Gates);
    let named: Vec<usize> = (TABLE.iter().enumerate())
        .filter(|(_, row)| all.iter().any(|c| c.row.name() == row.name()))
        .map(|(number, _)| number)
        .take(most)
        .collect();
    let of_scan = |scan: &&ScanStatement| {
        let stated = named.iter().filter_map(|number| {
            let value = scan.values.get(*number)?.as_deref()?;
            let row = TABLE.get(*number)?;
            Some(format!("{} {}", row.name(), clip(value)))
        });
        stated.collect::<Vec<_>>().join(", ")
    };
    scans.iter().map(of_scan).collect()
}

impl Rule {
    /// Whether a scan cannot have both values.
    fn contradict(self, a: &str, b: &str) -> bool {
        match self {
            Exact => a != b,
            Words => !words(a).eq(words(b)),
            Name => names_differ(a, b),
            Values => {
                let pairs = a.split('\\').zip(b.split('\\'));
                let stated = |text: &str| words(text).next().is_some();
                { pairs }.any(|(a, b)| stated(a) && stated(b) && Words.contradict(a, b))
            }
            Set => sorted_values(a) != sorted_values(b),
            Number => match (a.parse::<f64>(), b.parse::<f64>()) {
                (Ok(a), Ok(b)) => (a - b).abs() > SAME_NUMBER * a.abs().max(b.abs()),
                _ => Words.contradict(a, b),
            },
            Date => {
                let [a, b] = [digits(a), digits(b)];
                !(a.starts_with(&b) || b.starts_with(&a))
            }
            Time => seconds_apart(a, b).is_some_and(|apart| apart >= 1.0),
            Acquisition => seconds_apart(a, b).is_some_and(|apart| apart > SAME_ACQUISITION_S),
        }
    }
}

/// The words of `text`, in lower case.
fn words(text: &str) -> impl Iterator<Item = String> {
    let words = text.split(|c: char| c.is_whitespace() || c == '\0');
    words.filter(|word| !word.is_empty()).map(str::to_lowercase)
}

fn sorted_values(text: &str) -> Vec<String> {
    let values = text.split('\\').map(|value| value.trim().to_lowercase());
    let mut values: Vec<String> = values.filter(|value| !value.is_empty()).collect();
    values.sort_unstable();
    values.dedup();
    values
}

fn digits(text: &str) -> String {
    text.chars().filter(char::is_ascii_digit).collect()
}

/// Whether two names are of different persons: in a representation that both have, they have different words, and a
/// component that both have differs.
fn names_differ(a: &str, b: &str) -> bool {
    let differ = |a: &str, b: &str| {
        let of = |text: &str| -> Vec<String> {
            let parts = text
                .split(['^', ',', ' '])
                .map(|part| part.trim_matches('\0'));
            let parts = parts.filter(|part| !part.is_empty());
            parts.map(str::to_lowercase).collect()
        };
        let components = a.split('^').zip(b.split('^'));
        let stated = |text: &str| words(text).next().is_some();
        stated(a) && stated(b) && of(a) != of(b) && { components }
            .any(|(a, b)| stated(a) && stated(b) && Words.contradict(a, b))
    };
    a.split('=').zip(b.split('=')).any(|(a, b)| differ(a, b))
}

/// Seconds between two times of a day; `None` if one is no time.
fn seconds_apart(a: &str, b: &str) -> Option<f64> {
    /// Seconds of a day, after which times begin again.
    const DAY_S: f64 = 86_400.0;
    let seconds = |text: &str| {
        let text: String = text.chars().filter(|c| *c != ':').collect();
        let two = |at: usize| {
            text.get(at..at + 2)
                .map_or(Some(0.0), |two| two.parse().ok())
        };
        let hours: f64 = text.get(..2)?.parse().ok()?;
        let fraction = text.get(6..).map_or(Some(0.0), |rest| match rest {
            "" => Some(0.0),
            rest => format!("0{rest}").parse().ok(),
        });
        let seconds: f64 = 3600.0 * hours + 60.0 * two(2)? + two(4)?;
        Some(seconds + fraction?)
    };
    let apart = (seconds(a)? - seconds(b)?).abs();
    Some(apart.min(DAY_S - apart))
}
