//! The Real World Value Mapping (PS3.3 C.7.6.16.2.11): how stored numbers become values.
//!
//! A file, or a frame, may have several items: the same numbers in several units, or one mapping for each range
//! of numbers. In: the items. Out: the slope and intercept that hold for every number, those of the first item
//! in its unit. Items of other units say the same in other words.
//!
//! Refused: an item with a table in place of a slope, and ranges of one unit with different slopes.

use dicom_core::{Tag, VR};
use dicom_dictionary_std::tags;
use dicom_encoding::transfer_syntax::Endianness;
use std::collections::BTreeMap;

/// Real World Value Mapping Sequence.
pub const MAPPING_SEQUENCE: Tag = tags::REAL_WORLD_VALUE_MAPPING_SEQUENCE;
/// Measurement Units Code Sequence.
pub const UNITS_SEQUENCE: Tag = tags::MEASUREMENT_UNITS_CODE_SEQUENCE;

/// Name of the sequence for error messages.
pub const MAPPING_NAME: &str = "Real World Value Mapping Sequence (0040,9096)";

/// Most items of all frames together.
const MOST_ITEMS: usize = 1 << 16;

/// One item.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct Mapping {
    slope: Option<f64>,
    intercept: Option<f64>,
    /// Number of values in the table.
    table: usize,
    /// The first and the last stored number that it is for.
    range: [Option<f64>; 2],
    unit: Option<String>,
}

/// The part of an item that an element holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Part {
    /// The slope.
    Slope,
    /// The intercept.
    Intercept,
    /// The values of a table.
    Table,
    /// The first number that it is for.
    First,
    /// The last number that it is for.
    Last,
    /// The code of the unit.
    Unit,
}

/// Whose item it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Owner {
    File,
    AllFrames,
    Frame(usize),
}

/// An item of the sequence: its owner and its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Item(Owner, usize);

impl Item {
    /// The item in which an element `tag` inside the sequences `open` lies, and what it says of it.
    pub fn find(open: &[(Tag, usize)], tag: Tag) -> Option<(Self, Part)> {
        let (owner, inner) = match open {
            [
                (tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE, frame),
                inner @ ..,
            ] => (Owner::Frame(frame.checked_sub(1)?), inner),
            [(tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE, 1), inner @ ..] => (Owner::AllFrames, inner),
            inner => (Owner::File, inner),
        };
        let (number, part) = match inner {
            [(MAPPING_SEQUENCE, number)] => (number, Part::from_tag(tag)?),
            [(MAPPING_SEQUENCE, number), (UNITS_SEQUENCE, 1)] if tag == tags::CODE_VALUE => {
                (number, Part::Unit)
            }
            _ => return None,
        };
        Some((Self(owner, *number), part))
    }
}

impl Part {
    /// The part that is the attribute `tag` of the item itself.
    fn from_tag(tag: Tag) -> Option<Self> {
        Some(match tag {
            tags::REAL_WORLD_VALUE_SLOPE => Self::Slope,
            tags::REAL_WORLD_VALUE_INTERCEPT => Self::Intercept,
            tags::REAL_WORLD_VALUE_LUT_DATA => Self::Table,
            tags::REAL_WORLD_VALUE_FIRST_VALUE_MAPPED
            | tags::DOUBLE_FLOAT_REAL_WORLD_VALUE_FIRST_VALUE_MAPPED => Self::First,
            tags::REAL_WORLD_VALUE_LAST_VALUE_MAPPED
            | tags::DOUBLE_FLOAT_REAL_WORLD_VALUE_LAST_VALUE_MAPPED => Self::Last,
            _ => return None,
        })
    }

    /// Whether only the length of its value counts.
    pub fn is_long(self) -> bool {
        self == Self::Table
    }
}

/// The value of an element of an item.
#[derive(Debug, Clone, PartialEq)]
pub enum Stated {
    /// A number.
    Number(f64),
    /// Values of a table.
    Count(usize),
    /// A text.
    Text(String),
}

impl Stated {
    /// What the bytes of `value` state, of the representation `vr`; `None` if they are no value of it.
    pub fn new(value: &[u8], vr: VR, order: Endianness) -> Option<Self> {
        let mut bytes = value.to_vec();
        let word = match vr {
            VR::US | VR::SS => 2,
            VR::FD => 8,
            _ => {
                let text = String::from_utf8_lossy(value);
                return Some(Self::Text(text.trim_matches(['\0', ' ']).to_owned()));
            }
        };
        bytes.truncate(word);
        if order == Endianness::Big {
            bytes.reverse();
        }
        Some(Self::Number(match vr {
            VR::US => u16::from_le_bytes(bytes.try_into().ok()?).into(),
            VR::SS => i16::from_le_bytes(bytes.try_into().ok()?).into(),
            _ => f64::from_le_bytes(bytes.try_into().ok()?),
        }))
    }
}

/// All items of a file.
#[derive(Debug, Default)]
pub struct Mappings(BTreeMap<Item, Mapping>);

impl Mappings {
    /// Whether one more item can be kept.
    pub fn has_room(&self) -> bool {
        self.0.len() < MOST_ITEMS
    }

    /// Notes what an element of `item` states.
    pub fn insert(&mut self, item: Item, part: Part, stated: Stated) {
        let mapping = self.0.entry(item).or_default();
        match (part, stated) {
            (Part::Slope, Stated::Number(slope)) => mapping.slope = Some(slope),
            (Part::Intercept, Stated::Number(intercept)) => mapping.intercept = Some(intercept),
            (Part::First, Stated::Number(first)) => mapping.range[0] = Some(first),
            (Part::Last, Stated::Number(last)) => mapping.range[1] = Some(last),
            (Part::Table, Stated::Count(count)) => mapping.table = count,
            (Part::Unit, Stated::Text(unit)) => mapping.unit = Some(unit),
            _ => {}
        }
    }

    /// Slope and intercept of `frame`, of all frames or of the file, the first that states them; `None` if
    /// nothing does.
    ///
    /// # Errors
    /// Why the numbers have no single slope.
    pub fn linear(&self, frame: Option<usize>) -> Result<Option<(f64, f64)>, String> {
        let owners = [
            frame.map(Owner::Frame),
            Some(Owner::AllFrames),
            Some(Owner::File),
        ];
        for owner in owners.into_iter().flatten() {
            let items: Vec<&Mapping> = (self.0)
                .range(Item(owner, 0)..=Item(owner, usize::MAX))
                .map(|(_, mapping)| mapping)
                .filter(|mapping| mapping.table > 0 || mapping.slope.is_some())
                .collect();
            if !items.is_empty() {
                return linear_of(&items).map(Some);
            }
        }
        Ok(None)
    }
}

/// The slope and intercept of `items`, of which there is at least one.
fn linear_of(items: &[&Mapping]) -> Result<(f64, f64), String> {
    // The same numbers in another unit by a slope are as good as a table.
    let has_table = |unit: &Option<String>| {
        let mut of_unit = items.iter().filter(|item| item.unit == *unit);
        of_unit.any(|item| item.table > 0)
    };
    let Some(first) = items.iter().find(|item| !has_table(&item.unit)) else {
        return Err(format!(
            "it maps values by a table of {} values (Real World Value LUT Data (0040,9212)), which is not \
             supported; expected Real World Value Slope (0040,9225), or Rescale Slope (0028,1053)",
            items.iter().map(|item| item.table).max().unwrap_or(0)
        ));
    };
    let linear = |item: &Mapping| (item.slope.unwrap_or(1.0), item.intercept.unwrap_or(0.0));
    let other = items.iter().find(|item| {
        item.unit == first.unit && item.range != first.range && linear(item) != linear(first)
    });
    match other {
        None => Ok(linear(first)),
        Some(other) => {
            let shown = |item: &Mapping| {
                let bound = |bound: Option<f64>| {
                    bound.map_or_else(|| "?".to_owned(), |bound| bound.to_string())
                };
                let (slope, intercept) = linear(item);
                let [from, to] = item.range.map(bound);
                format!("{from} to {to} by slope {slope} and intercept {intercept}")
            };
            Err(format!(
                "it maps ranges of values differently ({}; {}), which is not supported; expected one slope for \
                 all values, or Rescale Slope (0028,1053)",
                shown(first),
                shown(other)
            ))
        }
    }
}
