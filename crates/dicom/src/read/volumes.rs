//! Tells which frames at the same positions belong to one volume.
//!
//! In: for every position of a slice, the frames that lie there, and what each file or frame says of
//! itself: its marks. Out: the frames of each volume, slice after slice, or the two frames that nothing
//! tells apart. The order of the files and of the stored frames has no part in it.
//!
//! A *criterion* is an attribute by which PS3.3 tells images of one position apart: temporal position,
//! cardiac and respiratory delay and phase, R-R interval, echo, diffusion, kind of image, dimension index
//! values, and times and numbers of acquisition. It deals the frames out if its values have as many
//! levels as there are volumes, each level with one frame at every position, and no level overlaps the
//! next. Times that rise through a volume therefore count as well as indices that are equal all over it.
//! Steps, of which the first that deals all frames out counts:
//!
//! 1. One criterion alone. Where several do, they must name the same volumes.
//! 2. Several: one whose values are the same at every position divides the frames into parts, and
//!    the others divide each part, as time slots in R-R intervals.
//! 3. Cardiac delays with even steps at every position, although the heart rate, and with it the step,
//!    differs between positions.
//! 4. Numbers that only count images: Image Index, then Instance Number and the time of the content. They
//!    count if all images of one volume come before those of the next, in the same order of slices.
//!    Numbers that run through the volumes at each position say nothing of which belong together, because
//!    every order of writing the files gives such numbers.

use super::attributes::{
    ACQUISITION_DATE, ACQUISITION_DATE_TIME, ACQUISITION_NUMBER, ACQUISITION_TIME, Attribute,
    Attributes, B_VALUE, CARDIAC_PHASE, CONTENT_DATE, CONTENT_TIME, CONVOLUTION_KERNEL,
    ECHO_NUMBERS, ECHO_TIME, FLIP_ANGLE, FRAME_ACQUISITION_NUMBER, FRAME_ACTUAL_DELAY,
    FRAME_B_VALUE, FRAME_CARDIAC_PHASE, FRAME_CT_TYPE, FRAME_DATE_TIME, FRAME_DIMENSIONS,
    FRAME_ECHO_TIME, FRAME_KVP, FRAME_MR_TYPE, FRAME_PET_TYPE, FRAME_REFERENCE_DATE_TIME,
    FRAME_REFERENCE_TIME, FRAME_RESPIRATORY_DELAY, FRAME_RESPIRATORY_PHASE, FRAME_STACK,
    FRAME_TEMPORAL_INDEX, FRAME_TIME_OFFSET, FRAME_TRIGGER_DELAY, IMAGE_INDEX, IMAGE_TYPE,
    INSTANCE_NUMBER, INVERSION_TIME, KVP, LOW_RR_VALUE, OLD_ACQUISITION_TIME, OLD_ECHO_TIME,
    OLD_IMAGE_INDEX, OLD_INSTANCE_NUMBER, OLD_REFERENCE_TIME, OLD_TEMPORAL_POSITION,
    OLD_TRIGGER_TIME, RR_INTERVAL_VECTOR, TEMPORAL_POSITION, TIME_SLOT_VECTOR, TRIGGER_DELAY,
    TRIGGER_TIME,
};
use std::cmp::Ordering;

/// Most numbers of Dimension Index Values that are compared.
const MOST_DIMENSIONS: usize = 16;

/// Largest deviation of a step of cardiac delays from the mean step.
const MAX_DELAY_DEVIATION: f64 = 0.25;

/// Stored form of a criterion's value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// One decimal number as text.
    Decimal,
    /// 16-bit number.
    Short,
    /// 32-bit numbers, each a criterion of its own.
    Longs,
    /// 64-bit floating-point number.
    Double,
    /// Text, all values together.
    Text,
    /// A moment.
    Moment,
    /// A time of day, after the date in another attribute.
    TimeOn(Attribute),
}

/// Reliability of a criterion, from the most to the least.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Standing {
    /// Cardiac delay, which says what a frame shows.
    Delay,
    /// Says what a frame shows.
    Meaning,
    /// Image Index, which counts the images of a volume before those of the next (PS3.3 C.8.9.4.1.9).
    Index,
    /// Counts images.
    Count,
}

/// An attribute that tells frames apart.
struct Criterion {
    attribute: Attribute,
    form: Form,
    standing: Standing,
}

const fn by(attribute: Attribute, form: Form, standing: Standing) -> Criterion {
    Criterion {
        attribute,
        form,
        standing,
    }
}

use Form::{Decimal, Double, Longs, Moment, Short, Text, TimeOn};
use Standing::{Count, Delay, Index, Meaning};

/// Criteria of frames of one file; the first of several gives the order of the volumes.
const OF_FRAMES: &[Criterion] = &[
    by(FRAME_TEMPORAL_INDEX, Longs, Meaning),
    by(OLD_TEMPORAL_POSITION, Decimal, Meaning),
    by(FRAME_TRIGGER_DELAY, Double, Delay),
    by(OLD_TRIGGER_TIME, Decimal, Delay),
    by(FRAME_ACTUAL_DELAY, Double, Delay),
    by(FRAME_CARDIAC_PHASE, Double, Meaning),
    by(FRAME_RESPIRATORY_DELAY, Double, Meaning),
    by(FRAME_RESPIRATORY_PHASE, Double, Meaning),
    by(FRAME_TIME_OFFSET, Double, Meaning),
    by(OLD_REFERENCE_TIME, Decimal, Meaning),
    by(FRAME_ECHO_TIME, Double, Meaning),
    by(OLD_ECHO_TIME, Decimal, Meaning),
    by(FRAME_B_VALUE, Double, Meaning),
    by(FRAME_KVP, Decimal, Meaning),
    by(FRAME_MR_TYPE, Text, Meaning),
    by(FRAME_CT_TYPE, Text, Meaning),
    by(FRAME_PET_TYPE, Text, Meaning),
    by(FRAME_STACK, Text, Meaning),
    by(FRAME_DIMENSIONS, Longs, Meaning),
    by(FRAME_REFERENCE_DATE_TIME, Moment, Meaning),
    by(FRAME_DATE_TIME, Moment, Meaning),
    by(OLD_ACQUISITION_TIME, Moment, Meaning),
    by(FRAME_ACQUISITION_NUMBER, Short, Meaning),
    by(OLD_IMAGE_INDEX, Short, Index),
    by(OLD_INSTANCE_NUMBER, Decimal, Count),
];

/// Criteria of the files of a series.
const OF_FILES: &[Criterion] = &[
    by(TEMPORAL_POSITION, Decimal, Meaning),
    by(TRIGGER_TIME, Decimal, Delay),
    by(TRIGGER_DELAY, Double, Delay),
    by(CARDIAC_PHASE, Double, Meaning),
    by(LOW_RR_VALUE, Decimal, Meaning),
    by(FRAME_REFERENCE_TIME, Decimal, Meaning),
    by(ECHO_NUMBERS, Decimal, Meaning),
    by(ECHO_TIME, Decimal, Meaning),
    by(INVERSION_TIME, Decimal, Meaning),
    by(FLIP_ANGLE, Decimal, Meaning),
    by(B_VALUE, Double, Meaning),
    by(KVP, Decimal, Meaning),
    by(IMAGE_TYPE, Text, Meaning),
    by(CONVOLUTION_KERNEL, Text, Meaning),
    by(ACQUISITION_DATE_TIME, Moment, Meaning),
    by(ACQUISITION_TIME, TimeOn(ACQUISITION_DATE), Meaning),
    by(ACQUISITION_NUMBER, Decimal, Meaning),
    by(IMAGE_INDEX, Short, Index),
    by(INSTANCE_NUMBER, Decimal, Count),
    by(CONTENT_TIME, TimeOn(CONTENT_DATE), Count),
    by(RR_INTERVAL_VECTOR, Short, Meaning),
    by(TIME_SLOT_VECTOR, Short, Meaning),
];

/// A value, by which frames are ordered.
#[derive(Debug, Clone, PartialEq)]
enum Value {
    Number(f64),
    Text(String),
}

impl Value {
    fn order(a: Option<&Self>, b: Option<&Self>) -> Ordering {
        let rank = |value: Option<&Self>| match value {
            None => 0,
            Some(Self::Number(_)) => 1,
            Some(Self::Text(_)) => 2,
        };
        match (a, b) {
            (Some(Self::Number(a)), Some(Self::Number(b))) => a.total_cmp(b),
            (Some(Self::Text(a)), Some(Self::Text(b))) => a.cmp(b),
            _ => rank(a).cmp(&rank(b)),
        }
    }
}

/// A value by one criterion.
#[derive(Debug, Clone)]
pub struct Mark {
    key: Key,
    value: Value,
}

/// A criterion: whether of frames or of files, its number there, and the number of the value in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    of_frames: bool,
    criterion: u8,
    part: u8,
}

impl Key {
    fn criterion(self) -> &'static Criterion {
        if self.of_frames {
            &OF_FRAMES[usize::from(self.criterion)]
        } else {
            &OF_FILES[usize::from(self.criterion)]
        }
    }

    fn name(self) -> &'static str {
        self.criterion().attribute.name
    }
}

impl Mark {
    /// A Trigger Time, ms.
    pub fn trigger_time(value: f64) -> Self {
        let key = Key {
            of_frames: false,
            criterion: 1,
            part: 0,
        };
        Self {
            key,
            value: Value::Number(value),
        }
    }
}

/// The statements of one frame.
#[derive(Debug, Clone, Default)]
pub struct Marks(Vec<Mark>);

impl<const N: usize> From<[Mark; N]> for Marks {
    fn from(marks: [Mark; N]) -> Self {
        Self(marks.into())
    }
}

impl Marks {
    /// The marks of the file with attributes `a`.
    pub fn of_file(a: &Attributes) -> Self {
        Self::new(a, None, OF_FILES)
    }

    /// The marks of stored frame number `frame`, from 0. What holds for all frames is none.
    pub fn of_frame(a: &Attributes, frame: usize) -> Self {
        Self::new(a, Some(frame), OF_FRAMES)
    }

    fn new(a: &Attributes, frame: Option<usize>, criteria: &[Criterion]) -> Self {
        let mut marks = Vec::new();
        for (number, criterion) in criteria.iter().enumerate() {
            if !a.states(criterion.attribute, frame) {
                continue;
            }
            let values = criterion.values(a, frame).into_iter();
            marks.extend(values.enumerate().map(|(part, value)| Mark {
                key: Key {
                    of_frames: frame.is_some(),
                    criterion: number as u8,
                    part: part as u8,
                },
                value,
            }));
        }
        Self(marks)
    }

    fn value(&self, key: Key) -> Option<&Value> {
        let mark = self.0.iter().find(|mark| mark.key == key);
        mark.map(|mark| &mark.value)
    }
}

impl Criterion {
    /// The values of the file or of `frame`; what cannot be read as such is compared as text.
    fn values(&self, a: &Attributes, frame: Option<usize>) -> Vec<Value> {
        let text = || a.texts_of(self.attribute, frame).join("\\");
        match self.form {
            Decimal => match a.decimals_of::<1>(self.attribute, frame) {
                Ok(number) => number
                    .map(|[n]| Value::Number(n + 0.0))
                    .into_iter()
                    .collect(),
                Err(_) => vec![Value::Text(text())],
            },
            Short => {
                let numbers = a.shorts_of(self.attribute, frame);
                let first = numbers.first().map(|n| Value::Number(f64::from(*n)));
                first.into_iter().collect()
            }
            Longs => {
                let numbers = a.longs_of(self.attribute, frame).into_iter();
                let numbers = numbers.map(|n| Value::Number(f64::from(n)));
                numbers.take(MOST_DIMENSIONS).collect()
            }
            Double => {
                let number = a.double(self.attribute, frame);
                let number = number.map(|n| Value::Number(n + 0.0));
                number.into_iter().collect()
            }
            Text => vec![Value::Text(text())],
            Moment => vec![Value::Text(moment(&text()))],
            TimeOn(date) => {
                let date = a.text(date).unwrap_or_default();
                let date: String = date.chars().filter(char::is_ascii_digit).collect();
                vec![Value::Text(format!("{date:0>8} {}", moment(&text())))]
            }
        }
    }
}

/// A time or moment without trailing zeros of its fraction and without its zone, so that equal ones are
/// equal texts and later ones later texts.
fn moment(text: &str) -> String {
    let time = text.split(['+', '-']).next().unwrap_or_default();
    let (whole, fraction) = time.split_once('.').unwrap_or((time, ""));
    // Old files write colons.
    let mut whole: String = whole.chars().filter(char::is_ascii_digit).collect();
    let digits = if whole.len() > 6 { 14 } else { 6 };
    while whole.len() < digits {
        whole.push('0');
    }
    format!("{whole}.{}", fraction.trim_end_matches('0'))
}

/// Parts of the frames in order, each with its frames by position.
type Parts = Vec<Vec<Vec<usize>>>;

/// Deals the frames of each of `groups`, of which every one lies at one position and holds equally many,
/// out to volumes: for each volume its frame in each group. `marks` are those of all frames; `name` says
/// for error messages which frame that of an index is.
///
/// # Errors
/// Which frames nothing tells apart, or which attributes contradict each other.
pub fn deal(
    groups: &[Vec<usize>],
    marks: &[&Marks],
    name: &dyn Fn(usize) -> String,
) -> Result<Vec<Vec<usize>>, String> {
    if groups.iter().all(|group| group.len() <= 1) {
        return Ok(vec![groups.iter().flatten().copied().collect()]);
    }
    let mut keys: Vec<Key> = groups
        .iter()
        .flatten()
        .flat_map(|frame| marks[*frame].0.iter().map(|mark| mark.key))
        .collect();
    keys.sort_unstable();
    keys.dedup();
    let dealer = Dealer { marks, keys, name };
    dealer.deal(groups)
}

struct Dealer<'a> {
    marks: &'a [&'a Marks],
    /// The criteria by which any frame has a value, in order.
    keys: Vec<Key>,
    name: &'a dyn Fn(usize) -> String,
}

impl Dealer<'_> {
    fn deal(&self, groups: &[Vec<usize>]) -> Result<Vec<Vec<usize>>, String> {
        if groups[0].len() == 1 {
            return Ok(vec![groups.iter().map(|group| group[0]).collect()]);
        }
        let meaning = |key: &&Key| key.criterion().standing <= Meaning;
        if let Some(volumes) = self.one_criterion(groups, self.keys.iter().filter(meaning))? {
            return Ok(volumes);
        }
        for key in self.keys.iter().filter(meaning) {
            if let Some(parts) = self.divide(groups, *key) {
                let dealt = parts.iter().map(|part| self.deal(part));
                let dealt: Result<Vec<_>, _> = dealt.collect();
                return Ok(dealt?.into_iter().flatten().collect());
            }
        }
        let delays = self.keys.iter();
        for key in delays.filter(|key| key.criterion().standing == Delay) {
            if let Some(volumes) = self.even_steps(groups, *key) {
                return Ok(volumes);
            }
        }
        for standing in [Index, Count] {
            let keys = self.keys.iter();
            let keys = keys.filter(|key| key.criterion().standing == standing);
            if let Some(volumes) = self.one_criterion(groups, keys)? {
                return Ok(volumes);
            }
        }
        Err(self.untold(groups))
    }

    fn value(&self, frame: usize, key: Key) -> Option<&Value> {
        self.marks[frame].value(key)
    }

    /// The volumes that one of `keys` deals out.
    ///
    /// # Errors
    /// If another deals out others.
    fn one_criterion<'k>(
        &self,
        groups: &[Vec<usize>],
        keys: impl Iterator<Item = &'k Key>,
    ) -> Result<Option<Vec<Vec<usize>>>, String> {
        let mut found: Option<(Key, Vec<Vec<usize>>)> = None;
        for key in keys {
            let Some(volumes) = self.levels(groups, *key) else {
                continue;
            };
            let Some((first, known)) = &found else {
                found = Some((*key, volumes));
                continue;
            };
            let mut same = known.clone();
            let mut other = volumes;
            same.sort_unstable();
            other.sort_unstable();
            if same != other {
                return Err(format!(
                    "{} and {} contradict each other on which of them belong to one volume",
                    first.name(),
                    key.name()
                ));
            }
        }
        Ok(found.map(|(_, volumes)| volumes))
    }

    /// The frames of each group in the order of their values, if no two are equal.
    fn ranked(&self, groups: &[Vec<usize>], key: Key) -> Option<Vec<Vec<usize>>> {
        let order = |a: &usize, b: &usize| Value::order(self.value(*a, key), self.value(*b, key));
        let each = groups.iter().map(|group| {
            let mut group = group.clone();
            group.sort_by(order);
            let rises = group
                .windows(2)
                .all(|pair| order(&pair[0], &pair[1]).is_lt());
            rises.then_some(group)
        });
        each.collect()
    }

    /// The volumes by the levels of the values: each above all values of the one before.
    fn levels(&self, groups: &[Vec<usize>], key: Key) -> Option<Vec<Vec<usize>>> {
        let ranked = self.ranked(groups, key)?;
        let order = |a: usize, b: usize| Value::order(self.value(a, key), self.value(b, key));
        let volumes = transposed(&ranked);
        for pair in volumes.windows(2) {
            let highest = pair[0].iter().copied().max_by(|a, b| order(*a, *b))?;
            let lowest = pair[1].iter().copied().min_by(|a, b| order(*a, *b))?;
            if order(highest, lowest).is_ge() {
                return None;
            }
        }
        let counts = key.criterion().standing >= Index;
        (!counts || self.counts_through(&volumes, key)).then_some(volumes)
    }

    /// Whether every frame has a value, several positions are there, and the values of every volume run
    /// through the positions in the same order.
    fn counts_through(&self, volumes: &[Vec<usize>], key: Key) -> bool {
        let mut all = volumes.iter().flatten();
        let stated = all.all(|f| self.value(*f, key).is_some());
        let compare = |volume: &[usize], a: usize, b: usize| {
            Value::order(self.value(volume[a], key), self.value(volume[b], key))
        };
        let first = &volumes[0];
        let mut places: Vec<usize> = (0..first.len()).collect();
        places.sort_by(|a, b| compare(first, *a, *b));
        let runs = |volume: &Vec<usize>| {
            let mut pairs = places.windows(2);
            pairs.all(|p| compare(volume, p[0], p[1]) == compare(first, p[0], p[1]))
        };
        stated && first.len() > 1 && volumes.iter().all(runs)
    }

    /// Two or more parts with equal values each, if every group has the same values equally often.
    fn divide(&self, groups: &[Vec<usize>], key: Key) -> Option<Parts> {
        let order = |a: usize, b: usize| Value::order(self.value(a, key), self.value(b, key));
        let mut parts: Parts = Vec::new();
        for (number, group) in groups.iter().enumerate() {
            let mut group = group.clone();
            group.sort_by(|a, b| order(*a, *b));
            let levels: Vec<&[usize]> = group.chunk_by(|a, b| order(*a, *b).is_eq()).collect();
            if number == 0 {
                parts = vec![Vec::new(); levels.len()];
            }
            if levels.len() < 2 || levels.len() != parts.len() {
                return None;
            }
            for (part, level) in parts.iter_mut().zip(levels) {
                if let Some(first) = part.first()
                    && (first.len() != level.len() || order(first[0], level[0]).is_ne())
                {
                    return None;
                }
                part.push(level.to_vec());
            }
        }
        Some(parts)
    }

    /// The volumes by delays that rise in even steps at every position.
    fn even_steps(&self, groups: &[Vec<usize>], key: Key) -> Option<Vec<Vec<usize>>> {
        let ranked = self.ranked(groups, key)?;
        let even = |group: &Vec<usize>| {
            let delays = group.iter().map(|frame| match self.value(*frame, key) {
                Some(Value::Number(delay)) => Some(*delay),
                _ => None,
            });
            let delays: Option<Vec<f64>> = delays.collect();
            let Some([first, .., last]) = delays.as_deref() else {
                return false;
            };
            let step = (last - first) / (group.len() as f64 - 1.0);
            let steps = delays.iter().flat_map(|delays| delays.windows(2));
            let mut steps = steps.map(|pair| pair[1] - pair[0]);
            // A cycle begins at the trigger.
            *first <= step && steps.all(|each| (each - step).abs() <= MAX_DELAY_DEVIATION * step)
        };
        let told = groups[0].len() > 2 && ranked.iter().all(even);
        told.then(|| transposed(&ranked))
    }

    /// Why nothing deals `groups` out, with two frames that are not told apart.
    fn untold(&self, groups: &[Vec<usize>]) -> String {
        let mut lowest = groups[0].clone();
        lowest.sort_by_cached_key(|frame| (self.name)(*frame));
        let differ = |a: usize, b: usize| {
            let keys = self.keys.iter();
            let keys =
                keys.filter(|k| Value::order(self.value(a, **k), self.value(b, **k)).is_ne());
            let mut names: Vec<&str> = keys.map(|key| key.name()).collect();
            names.dedup();
            names
        };
        // The two that differ least.
        let first = lowest[0];
        let rest = lowest[1..].iter();
        let pairs = rest.map(|other| (differ(first, *other), *other));
        let (names, other) = pairs
            .min_by_key(|(names, _)| names.len())
            .unwrap_or((Vec::new(), first));
        let how = if names.is_empty() {
            "no attribute tells apart which volume each belongs to".to_owned()
        } else {
            format!(
                "they cannot be told apart: {} differ, but not alike at every place of a slice",
                names.join(", ")
            )
        };
        format!(
            "of {} and {}, which lie at the same place, {how}; send the images of one volume alone",
            (self.name)(first),
            (self.name)(other)
        )
    }
}

/// The frames by rank and group, of frames by group and rank.
fn transposed(ranked: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let ranks = 0..ranked[0].len();
    ranks
        .map(|rank| ranked.iter().map(|group| group[rank]).collect())
        .collect()
}
