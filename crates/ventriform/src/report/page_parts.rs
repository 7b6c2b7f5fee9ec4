//! The parts that the pages of fits have in common.

use super::input::FileFacts;
use crate::draw::document::Sign;
use crate::draw::text::number;
use serde_json::{Map, Value};

/// Format, voxels and spacing of a volume, for the line below the title.
pub(super) fn volume_line(input: &FileFacts) -> [String; 3] {
    let times = |numbers: [f64; 3], decimals| numbers.map(|x| number(x, decimals)).join(" × ");
    [
        format!("volume: {}", input.format),
        format!("{} voxels", times(input.shape.map(|n| n as f64), 0)),
        format!("{} mm", times(input.spacing_mm, 2)),
    ]
}

/// The headline of a result with so many flags, by its name.
pub(super) fn flags_headline(flags: usize, result: &str) -> (Sign, String) {
    match flags {
        0 => (
            Sign::Good,
            format!("Nothing gives reason to doubt this {result}."),
        ),
        1 => (Sign::Flag, "There is one reason to look closer.".to_owned()),
        n => (Sign::Flag, format!("There are {n} reasons to look closer.")),
    }
}

/// A table of a report without lists of an entry for each node, step or moment, and without matrices.
pub(super) fn short(mut table: Map<String, Value>) -> Value {
    table.retain(|name, value| {
        let long = value.as_array().is_some_and(|list| list.len() > 4);
        !long && !name.starts_with("affine")
    });
    Value::Object(table)
}
