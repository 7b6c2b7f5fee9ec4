//! One row for each figure of a report: where it stands, its name, unit and digits, and how DICOM codes it.
//!
//! In: a report as JSON, or a part of one, such as a segment. Out: the figures that it has, in the order of the rows. The
//! rows are the only place that names a figure for people: pages, pictures of pages, structured reports, the command, the
//! web page, the Python package and the table in docs/figures.md read them ([`TABLES`]; `x-figures` of the OpenAPI
//! document). A test finds the place of every row in the schema of its report.
//!
//! A figure that is added: a field of the report, and a row here.

pub mod beat;
pub mod code;
pub mod comparison;
pub mod model;
pub mod perfusion;
pub mod segmentation;
pub mod serial;
mod unit;

pub use crate::image::draw::document::HeadlineFigure;
pub use unit::Unit;

use crate::heart::comparison::Verdict;
use crate::image::draw::table::{Table, TableColumn};
use crate::image::draw::text::{number, signed};
use serde::Serialize;
use serde_json::{Value, json};
use ventriform_dicom::write::code::Code;

/// A figure of a report, or of one of its parts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figure {
    /// Its place in the JSON of the report: the names of the fields that lead to it, with `/` between them.
    pub place: &'static str,
    /// Its name.
    pub label: &'static str,
    /// What is measured, in one sentence.
    pub about: &'static str,
    /// The usual abbreviation, for short lines.
    pub short: Option<&'static str>,
    /// Its unit.
    pub unit: Unit,
    /// Digits after the point.
    pub digits: usize,
    /// Whether a positive figure is written with its sign.
    pub signed: bool,
    /// The place of the interval that holds the true figure of nine of ten hearts.
    pub interval: Option<&'static str>,
    /// The place of what may be said of it: `yes`, `no` or `cannot_tell`.
    pub verdict: Option<&'static str>,
    /// The heading that it stands under; empty for the main figures.
    pub section: &'static str,
    /// Whether it is among those that a report begins with.
    pub headline: bool,
    /// A place that has to hold something other than `null` and `false`: the figure means nothing otherwise.
    pub needs: Option<&'static str>,
    /// A place that must not: another figure then says more.
    pub unless: Option<&'static str>,
    /// The same where people read; the structured report has the figure all the same.
    pub not_shown_beside: Option<&'static str>,
    /// Its name in lists without nesting, which are summaries of results and normal limits; otherwise its place with `_` for
    /// `/`.
    pub flat_name: Option<&'static str>,
    /// How a structured report codes it.
    pub coded: Option<Coded>,
}

/// How a structured report has a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Coded {
    /// The concept.
    pub concept: Code,
    /// What the measurement group is about.
    pub group: Group,
    /// Whether it is the mean of single values.
    pub is_mean: bool,
}

/// What the measurement groups of structured reports are about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// The whole of what the report, or this part of it, is of.
    Whole,
    /// The cavity.
    Cavity,
    /// The wall as the blurred image shows it.
    ApparentWall,
    /// The cavity within it.
    ApparentCavity,
    /// The wall without the image's blur.
    AnatomicalWall,
    /// The cavity within it.
    AnatomicalCavity,
    /// End diastole.
    EndDiastole,
    /// End systole.
    EndSystole,
    /// The scan at stress.
    Stress,
    /// The scan at rest.
    Rest,
}

/// A figure at a `place` of the report.
pub const fn figure(
    place: &'static str,
    label: &'static str,
    unit: Unit,
    digits: usize,
    about: &'static str,
) -> Figure {
    Figure {
        place,
        label,
        about,
        short: None,
        unit,
        digits,
        signed: false,
        interval: None,
        verdict: None,
        section: "",
        headline: true,
        needs: None,
        unless: None,
        not_shown_beside: None,
        flat_name: None,
        coded: None,
    }
}

impl Figure {
    const fn short(mut self, short: &'static str) -> Self {
        self.short = Some(short);
        self
    }

    const fn signed(mut self) -> Self {
        self.signed = true;
        self
    }

    const fn within(mut self, interval: &'static str) -> Self {
        self.interval = Some(interval);
        self
    }

    const fn answered(mut self, verdict: &'static str) -> Self {
        self.verdict = Some(verdict);
        self
    }

    const fn under(mut self, section: &'static str) -> Self {
        self.section = section;
        self
    }

    const fn detail(mut self) -> Self {
        self.headline = false;
        self
    }

    const fn needs(mut self, place: &'static str) -> Self {
        self.needs = Some(place);
        self
    }

    const fn unless(mut self, place: &'static str) -> Self {
        self.unless = Some(place);
        self
    }

    const fn not_shown_beside(mut self, place: &'static str) -> Self {
        self.not_shown_beside = Some(place);
        self
    }

    const fn flat_name(mut self, field: &'static str) -> Self {
        self.flat_name = Some(field);
        self
    }

    const fn coded(mut self, group: Group, concept: Code) -> Self {
        self.coded = Some(Coded {
            concept,
            group,
            is_mean: false,
        });
        self
    }

    const fn coded_mean(mut self, group: Group, concept: Code) -> Self {
        self.coded = Some(Coded {
            concept,
            group,
            is_mean: true,
        });
        self
    }

    /// The figure of `report`; `None` where it has none, or one that means nothing.
    pub fn value(&self, report: &Value) -> Option<f64> {
        let holds = |place| at(report, place).is_some_and(|found| *found != Value::Bool(false));
        let counts = self.needs.is_none_or(holds) && !self.unless.is_some_and(holds);
        at(report, self.place)?.as_f64().filter(|_| counts)
    }

    /// The figure of `report` where people read; `None` where another figure says more.
    pub fn shown_value(&self, report: &Value) -> Option<f64> {
        let beside = |place| at(report, place).is_some();
        let hidden = self.not_shown_beside.is_some_and(beside);
        self.value(report).filter(|_| !hidden)
    }

    /// The ends of the interval about the figure of `report`.
    pub fn interval(&self, report: &Value) -> Option<[f64; 2]> {
        let ends = at(report, self.interval?)?;
        Some([ends.get(0)?.as_f64()?, ends.get(1)?.as_f64()?])
    }

    /// What may be said of the figure of `report`, in words.
    pub fn verdict(&self, report: &Value) -> Option<&'static str> {
        let name = at(report, self.verdict?)?;
        let verdict: Verdict = serde_json::from_value(name.clone()).ok()?;
        Some(verdict.as_str())
    }

    /// `value` with the digits of the figure, without its unit.
    pub fn written(&self, value: f64) -> String {
        if self.signed {
            signed(value, self.digits)
        } else {
            number(value, self.digits)
        }
    }

    /// A change of the figure with its digits and its sign, without its unit.
    pub fn written_change(&self, change: f64) -> String {
        signed(change, self.digits)
    }

    /// The head of a table's column: the name with the unit.
    pub fn column(&self) -> String {
        match self.unit.symbol {
            "" => self.label.to_owned(),
            symbol => format!("{}, {symbol}", self.label),
        }
    }

    /// The figure of `report` for the top of a page.
    fn headline(&self, report: &Value) -> Option<HeadlineFigure> {
        let value = self.written(self.shown_value(report)?);
        let label = match self.interval(report) {
            Some(ends) => {
                let [low, high] = ends.map(|end| self.written(end));
                format!("{}; 90 %: {low} to {high}", self.label)
            }
            None => self.label.to_owned(),
        };
        let label = match self.verdict(report) {
            Some(verdict) => format!("{label}; {verdict}"),
            None => label,
        };
        let unit = self.unit.symbol;
        Some(HeadlineFigure { value, unit, label })
    }

    /// The row as it stands in the OpenAPI document.
    fn row(&self) -> Value {
        let mut row = json!({
            "place": self.place,
            "label": self.label,
            "about": self.about,
            "unit": self.unit.symbol,
            "digits": self.digits,
        });
        let texts = [
            ("short", self.short),
            (
                "section",
                Some(self.section).filter(|name| !name.is_empty()),
            ),
            ("interval", self.interval),
            ("verdict", self.verdict),
            ("needs", self.needs),
            ("unless", self.unless.or(self.not_shown_beside)),
            ("flat_name", self.flat_name),
        ];
        for (name, text) in texts {
            if let Some(text) = text {
                row[name] = text.into();
            }
        }
        for (name, is_set) in [("signed", self.signed), ("headline", self.headline)] {
            if is_set {
                row[name] = true.into();
            }
        }
        if let Some(coded) = self.coded {
            row["code"] = format!("{}, {}", coded.concept.value, coded.concept.scheme).into();
        }
        row
    }
}

/// What stands at a `place`; `None` for nothing and for `null`.
fn at<'a>(report: &'a Value, place: &str) -> Option<&'a Value> {
    let found = place
        .split('/')
        .try_fold(report, |value, name| value.get(name));
    found.filter(|value| !value.is_null())
}

/// A report, or a part of one, as the rows read it.
///
/// # Panics
/// If it has keys that are no text.
pub fn readable(report: &impl Serialize) -> Value {
    serde_json::to_value(report).expect("reports are JSON")
}

/// The figures that the page of `report` begins with.
pub fn headlines(rows: &[Figure], report: &impl Serialize) -> Vec<HeadlineFigure> {
    let report = readable(report);
    let rows = rows.iter().filter(|row| row.headline);
    rows.filter_map(|row| row.headline(&report)).collect()
}

/// The rows under the heading `section` that `report` has: name, figure, unit.
pub fn section(rows: &[Figure], section: &str, report: &impl Serialize) -> Vec<[String; 3]> {
    let report = readable(report);
    let rows = rows.iter().filter(|row| row.section == section);
    rows.filter_map(|row| {
        let value = row.written(row.shown_value(&report)?);
        Some([row.label.to_owned(), value, row.unit.symbol.to_owned()])
    })
    .collect()
}

/// A table of parts of a report: the names of each under `columns`, then its figures, a dash where it has none.
pub fn table(
    columns: impl IntoIterator<Item = TableColumn>,
    rows: &[Figure],
    parts: impl IntoIterator<Item = (Vec<String>, Value)>,
) -> Table {
    let heads = rows.iter().map(|row| TableColumn::number(row.column()));
    let cell = |row: &Figure, part: &Value| row.written(row.shown_value(part).unwrap_or(f64::NAN));
    Table {
        columns: columns.into_iter().chain(heads).collect(),
        rows: (parts.into_iter())
            .map(|(mut names, part)| {
                names.extend(rows.iter().map(|row| cell(row, &part)));
                names
            })
            .collect(),
    }
}

/// A line with the figures of `report` that have an abbreviation, such as `EDV 141 ml, ESV 42 ml`.
pub fn line(rows: &[Figure], report: &impl Serialize) -> String {
    let report = readable(report);
    let parts = rows.iter().filter_map(|row| {
        let value = row.written(row.shown_value(&report)?);
        let symbol = row.unit.symbol;
        let space = if symbol.is_empty() { "" } else { " " };
        Some(format!("{} {value}{space}{symbol}", row.short?))
    });
    parts.collect::<Vec<_>>().join(", ")
}

/// The rows of every report and part, by the name of its schema in the OpenAPI document.
pub const TABLES: &[(&str, &[Figure])] = &[
    ("SegmentationReport", segmentation::FIGURES),
    ("PolarSegment", segmentation::SEGMENT_FIGURES),
    ("BeatReport", beat::FIGURES),
    ("SegmentMotionReport", beat::SEGMENT_FIGURES),
    ("ComparisonReport", comparison::FIGURES),
    ("ComparedScan", comparison::SCAN_FIGURES),
    ("ComparedTerritory", comparison::TERRITORY_FIGURES),
    ("ComparedSegment", comparison::SEGMENT_FIGURES),
    ("SerialScan", serial::SCAN_FIGURES),
    ("SerialPair", serial::PAIR_FIGURES),
    ("SerialSegment", serial::SEGMENT_FIGURES),
    ("Perfusion", perfusion::FIGURES),
    ("TerritoryScore", perfusion::TERRITORY_FIGURES),
    ("SegmentScore", perfusion::SEGMENT_FIGURES),
    ("ModelReport", model::FIGURES),
];

/// The rows as JSON: the name of each schema with its list.
pub fn tables() -> impl Iterator<Item = (&'static str, Value)> {
    let row = |(schema, rows): &(&'static str, &[Figure])| {
        let list = rows.iter().map(Figure::row).collect();
        (*schema, Value::Array(list))
    };
    TABLES.iter().map(row)
}
