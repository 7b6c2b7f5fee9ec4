//! Assigns the stored frames to the slices of each gate.
//!
//! After PS3.3 C.8.4.8: the Frame Increment Pointer names vectors that hold one number per stored
//! frame, counted from 1. These numbers define the order of the slices; the order in which the
//! file stores its frames does not.

use super::super::VolumeError;
use super::attributes::{
    Attribute, Attributes, DETECTOR_VECTOR, ENERGY_WINDOW_VECTOR, FRAME_POINTER, ROTATION_VECTOR,
    RR_INTERVAL_VECTOR, SLICE_VECTOR, TIME_SLOT_VECTOR,
};

/// Vectors that the pointer may name in addition if all of their numbers are 1.
const IDLE_VECTORS: [Attribute; 3] = [ENERGY_WINDOW_VECTOR, DETECTOR_VECTOR, ROTATION_VECTOR];

/// The stored frames of each gate in the order of its slices.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct FrameOrder {
    /// Slices of one gate.
    slices: usize,
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
    /// [`VolumeError::Field`] unless every slice of every gate occurs exactly once.
    pub(super) fn of(
        attributes: &Attributes,
        frames: usize,
        gated: bool,
        warnings: &mut Vec<String>,
    ) -> Result<Self, VolumeError> {
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
                stored: (0..frames).collect(),
            });
        }
        // One index over all vectors; the slice runs fastest.
        let mut index = vec![0; frames];
        let mut cells = 1_usize;
        let mut slices = 1;
        for &vector in vectors {
            let numbers = numbers(attributes, vector, frames)?;
            slices = usize::from(numbers.iter().copied().max().unwrap_or(1));
            cells = cells.saturating_mul(slices);
            for (index, number) in index.iter_mut().zip(numbers) {
                *index = *index * slices + usize::from(number) - 1;
            }
        }
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
        match complete.filter(|all| all.len() == frames) {
            Some(stored) => Ok(Self { slices, stored }),
            None => {
                let alike = alike.map_or_else(String::new, |(first, second)| {
                    format!("; frames {first} and {second} have the same numbers")
                });
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
    pub(super) fn slices(&self) -> usize {
        self.slices
    }

    /// Number of gates; 1 without gating.
    pub(super) fn gates(&self) -> usize {
        self.stored.len() / self.slices
    }

    /// The stored frames of `gate`, from its first slice to its last.
    pub(super) fn slices_of(&self, gate: usize) -> &[usize] {
        &self.stored[gate * self.slices..(gate + 1) * self.slices]
    }
}

/// Checks that the Frame Increment Pointer, if present, names exactly `vectors`. Some writers name
/// further vectors; those are accepted if all of their numbers are 1.
fn check_pointer(attributes: &Attributes, vectors: &[Attribute]) -> Result<(), VolumeError> {
    let pointer = attributes.shorts(FRAME_POINTER);
    let (stated, _) = pointer.as_chunks::<2>();
    let idle = |tag: &[u16; 2]| {
        let vector = IDLE_VECTORS.iter().find(|v| v.pointer() == *tag);
        vector.is_some_and(|v| attributes.shorts(*v).iter().all(|&n| n == 1))
    };
    let counting = stated.iter().filter(|tag| !idle(tag));
    let named = vectors.iter().map(|v| v.pointer());
    if stated.is_empty() || counting.copied().eq(named.clone()) {
        return Ok(());
    }
    let write = |[g, e]: [u16; 2]| format!("({g:04X},{e:04X})");
    let stated: Vec<_> = stated.iter().copied().map(write).collect();
    let named: Vec<_> = named.map(write).collect();
    let reason = format!("expected {}", named.join(" "));
    Err(attributes.wrong(FRAME_POINTER.name, &stated.join(" "), reason))
}

/// The numbers of `vector`: one for each frame, each at least 1.
fn numbers(
    attributes: &Attributes,
    vector: Attribute,
    frames: usize,
) -> Result<Vec<u16>, VolumeError> {
    let numbers = attributes.shorts(vector);
    if numbers.is_empty() {
        return Err(attributes.missing(vector));
    }
    if numbers.len() != frames || numbers.contains(&0) {
        let reason = format!("expected {frames} numbers, each at least 1");
        return Err(attributes.wrong(vector.name, &format!("{numbers:?}"), reason));
    }
    Ok(numbers)
}
