//! The parts that the pages of fits have in common.

use super::input::FileFacts;
use crate::draw::document::Sign;
use crate::draw::text::{data_uri, number};
use maud::{Markup, html};
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

/// A figure's `label`, with the interval that holds the true figure of nine of ten hearts.
pub(super) fn with_interval(label: &str, interval: Option<[f64; 2]>, decimals: usize) -> String {
    match interval {
        Some([low, high]) => format!(
            "{label}; 90 %: {} to {}",
            number(low, decimals),
            number(high, decimals)
        ),
        None => label.to_owned(),
    }
}

/// The polar maps beside each other: of `titles` (file name, title) those that `maps` (file name, SVG) has.
pub(super) fn polar_maps(
    titles: &[(&'static str, &'static str)],
    maps: &[(&'static str, &[u8])],
    hint: &str,
) -> Markup {
    let titled = titles.iter().filter_map(|(name, title)| {
        let found = maps.iter().find(|(known, _)| known == name)?;
        Some((*title, found.1))
    });
    let mut titled = titled.peekable();
    html! {
        @if titled.peek().is_some() {
            section {
                h2 { "Maps of the wall" }
                p.hint { (hint) }
                div.row {
                    @for (title, svg) in titled {
                        figure.paper {
                            img src=(data_uri("image/svg+xml", svg)) alt=(format!("Polar map: {title}"));
                            figcaption { (title) }
                        }
                    }
                }
            }
        }
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
