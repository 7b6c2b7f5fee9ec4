//! Assigns the stored frames to the slices of each gate.
//!
//! After PS3.3 C.8.4.8: the Frame Increment Pointer names vectors that hold one number per stored
//! frame, counted from 1. These numbers define the order of the slices; the order in which the
//! file stores its frames does not.
//!
//! Accepted, and said: numbers that count from 0, or from where a cropped volume begins. A study of one R-R
//! interval needs no vector of intervals, and the pointer may leave out vectors or name them in another order.

use super::ReadError;
use super::attributes::{
    Attribute, Attributes, DETECTOR_VECTOR, ENERGY_WINDOW_VECTOR, FRAME_POINTER, ROTATION_VECTOR,
    RR_INTERVAL_VECTOR, RR_INTERVALS, SLICE_VECTOR, TIME_SLOT_VECTOR,
};

/// Vectors that the pointer may name in addition if all of their numbers are the same.
const IDLE_VECTORS: [Attribute; 5] = [
    ENERGY_WINDOW_VECTOR,
    DETECTOR_VECTOR,
    ROTATION_VECTOR,
    RR_INTERVAL_VECTOR,
    TIME_SLOT_VECTOR,
];

/// The stored frames of each gate in the order of its slices.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameOrder {
    /// Slices of one gate.
    slices: usize,
    /// R-R intervals and time slots.
    gating: [usize; 2],
    /// Numbers of stored frames, from 0: gate after gate, slice after slice.
    stored: Vec<usize>,
}

/// The vectors that place the frames of a gated image.
const VECTORS_OF_GATES: &str =
    "R-R Interval Vector (0054,0060), Time Slot Vector (0054,0070), Slice Vector (0054,0080)";

impl FrameOrder {
    /// Reads the slice vector of `frames` frames, and the vectors of R-R intervals and time slots if `gated`.
    ///
    /// # Errors
    /// [`ReadError::Field`] unless every slice of every gate occurs exactly once.
    pub fn new(
        attributes: &Attributes,
        frames: usize,
        gated: bool,
        warnings: &mut Vec<String>,
    ) -> Result<Self, ReadError> {
        let vectors: &[Attribute] = if gated {
            &[RR_INTERVAL_VECTOR, TIME_SLOT_VECTOR, SLICE_VECTOR]
        } else {
            &[SLICE_VECTOR]
        };
        check_pointer(attributes, vectors)?;
        if !gated && attributes.shorts(SLICE_VECTOR).is_empty() {
            warnings.push(
                "The file has no Slice Vector: the stored order of the frames is used as the \
                 order of the slices."
                    .into(),
            );
            return Ok(Self {
                slices: frames,
                gating: [1, 1],
                stored: (0..frames).collect(),
            });
        }
        // One index over all vectors; the slice runs fastest.
        let mut index = vec![0; frames];
        let mut cells = 1_usize;
        let mut counts = Vec::with_capacity(vectors.len());
        for &vector in vectors {
            let numbers = numbers(attributes, vector, frames)?;
            let count = usize::from(numbers.iter().copied().max().unwrap_or(1));
            warnings.extend(rebased_warning(attributes, vector));
            cells = cells.saturating_mul(count);
            for (index, number) in index.iter_mut().zip(numbers) {
                *index = *index * count + usize::from(number) - 1;
            }
            counts.push(count);
        }
        let slices = counts.pop().unwrap_or(1);
        let gating = <[usize; 2]>::try_from(counts).unwrap_or([1, 1]);
        match frame_of_each(&index, cells) {
            Ok(stored) => Ok(Self {
                slices,
                gating,
                stored,
            }),
            Err(alike) => {
                let alike = match alike {
                    Some((first, second)) => {
                        format!("; frames {first} and {second} have the same numbers")
                    }
                    None => format!("; their numbers leave out {}", cells.abs_diff(frames)),
                };
                Err(attributes.wrong(
                    if gated { VECTORS_OF_GATES } else { SLICE_VECTOR.name },
                    &format!("{:?}", attributes.shorts(SLICE_VECTOR)),
                    format!(
                        "the {frames} frames must hold every slice of every gate exactly once{alike}"
                    ),
                ))
            }
        }
    }

    /// Slices of one gate.
    pub fn slices(&self) -> usize {
        self.slices
    }

    /// Number of gates; 1 without gating.
    pub fn gates(&self) -> usize {
        self.stored.len() / self.slices
    }

    /// R-R intervals and time slots; 1 each without gating.
    pub fn gating(&self) -> [usize; 2] {
        self.gating
    }

    /// The stored frames of `gate`, from its first slice to its last.
    pub fn slices_of(&self, gate: usize) -> &[usize] {
        &self.stored[gate * self.slices..(gate + 1) * self.slices]
    }
}

/// The stored frame of each of so many `cells`, of frames that lie in the cells `index`.
///
/// # Errors
/// Unless each cell has exactly one frame: the numbers, from 1, of the first two frames of one cell, if any has two.
pub(super) fn frame_of_each(
    index: &[usize],
    cells: usize,
) -> Result<Vec<usize>, Option<(usize, usize)>> {
    let frames = index.len();
    let mut stored = vec![None; if cells == frames { cells } else { 0 }];
    let mut alike = None;
    for (frame, &cell) in index.iter().enumerate() {
        match stored.get_mut(cell) {
            Some(place @ None) => *place = Some(frame),
            Some(Some(first)) => {
                alike.get_or_insert((*first + 1, frame + 1));
            }
            None => {}
        }
    }
    let complete: Option<Vec<usize>> = stored.into_iter().collect();
    complete.filter(|all| all.len() == frames).ok_or(alike)
}

/// Checks that the Frame Increment Pointer, if present, names none but `vectors`. Some writers name further
/// vectors; those are accepted if all of their numbers are the same.
pub(super) fn check_pointer(
    attributes: &Attributes,
    vectors: &[Attribute],
) -> Result<(), ReadError> {
    let pointer = attributes.shorts(FRAME_POINTER);
    let (stated, _) = pointer.as_chunks::<2>();
    let idle = |tag: &[u16; 2]| {
        let vector = IDLE_VECTORS.iter().find(|v| v.pointer() == *tag);
        vector.is_some_and(|v| is_constant(&attributes.shorts(*v)))
    };
    let is_named = |tag: &[u16; 2]| vectors.iter().any(|vector| vector.pointer() == *tag);
    if stated.iter().all(|tag| is_named(tag) || idle(tag)) {
        return Ok(());
    }
    let named = vectors.iter().map(|v| v.pointer());
    let write = |[g, e]: [u16; 2]| format!("({g:04X},{e:04X})");
    let stated: Vec<_> = stated.iter().copied().map(write).collect();
    let named: Vec<_> = named.map(write).collect();
    let reason = format!("expected {}", named.join(" "));
    Err(attributes.wrong(FRAME_POINTER.name, &stated.join(" "), reason))
}

fn is_constant(numbers: &[u16]) -> bool {
    numbers.windows(2).all(|two| two[0] == two[1])
}

/// The numbers of `vector`, counted from 1; an empty list if it is absent.
pub fn counted(attributes: &Attributes, vector: Attribute) -> Vec<u16> {
    let mut numbers = attributes.shorts(vector);
    let least = numbers.iter().copied().min().unwrap_or(1);
    for number in &mut numbers {
        // The difference fits: the least is the greatest that is taken off.
        *number = (*number - least).saturating_add(1);
    }
    numbers
}

/// A warning if the numbers of `vector` do not begin at 1.
fn rebased_warning(attributes: &Attributes, vector: Attribute) -> Option<String> {
    let least = attributes.shorts(vector).into_iter().min()?;
    let place = if vector == SLICE_VECTOR && least > 1 {
        ", and Image Position (Patient) is taken for that of the first slice in the file"
    } else {
        ""
    };
    (least != 1).then(|| {
        format!(
            "The {} counts from {least} and not from 1: the order that it gives is used{place}.",
            vector.name
        )
    })
}

/// The numbers of `vector`: one for each frame, counted from 1. Of one R-R interval they may be absent.
fn numbers(
    attributes: &Attributes,
    vector: Attribute,
    frames: usize,
) -> Result<Vec<u16>, ReadError> {
    let numbers = counted(attributes, vector);
    if numbers.is_empty() {
        let stated = attributes.shorts(RR_INTERVALS).first().copied();
        if vector == RR_INTERVAL_VECTOR && stated.is_none_or(|intervals| intervals <= 1) {
            return Ok(vec![1; frames]);
        }
        return Err(attributes.missing(vector));
    }
    if numbers.len() != frames {
        let reason = format!(
            "expected a number for each of the {frames} frames, and there are {}; a program that crops a volume \
             must crop its vectors",
            numbers.len()
        );
        let stated = attributes.shorts(vector);
        return Err(attributes.wrong(vector.name, &format!("{stated:?}"), reason));
    }
    Ok(numbers)
}
