//! Assigns the stored frames of a tomographic acquisition to energy window, detector, rotation, gate and view.
//!
//! After PS3.3 C.8.4.8: the Frame Increment Pointer names vectors that hold one number per stored frame, counted from
//! 1: of TOMO images the Energy Window, Detector, Rotation and Angular View Vector, of GATED TOMO images also the R-R
//! Interval and the Time Slot Vector. The numbers of detectors, rotations and energy windows are those of the items of
//! their sequences; a view's number times the angular step is its angle.
//!
//! Accepted, and said: numbers that count from 0. A vector of which all numbers are 1 may be absent, except that of the
//! views.
//!
//! Guaranteed: every window, detector, rotation, gate and view has exactly one frame.

use super::ReadError;
use super::attributes::{
    ANGULAR_VIEW_VECTOR, Attribute, Attributes, DETECTOR_VECTOR, DETECTORS, ENERGY_WINDOW_VECTOR,
    ENERGY_WINDOWS, ROTATION_VECTOR, ROTATIONS, RR_INTERVAL_VECTOR, RR_INTERVALS, TIME_SLOT_VECTOR,
    TIME_SLOTS,
};
use super::frames::{check_pointer, frame_of_each};

/// The vectors, the slowest first, each with the attribute that states its greatest number.
const VECTORS: [(Attribute, Option<Attribute>); 6] = [
    (ENERGY_WINDOW_VECTOR, Some(ENERGY_WINDOWS)),
    (DETECTOR_VECTOR, Some(DETECTORS)),
    (ROTATION_VECTOR, Some(ROTATIONS)),
    (RR_INTERVAL_VECTOR, Some(RR_INTERVALS)),
    (TIME_SLOT_VECTOR, Some(TIME_SLOTS)),
    (ANGULAR_VIEW_VECTOR, None),
];

/// The stored frames of each window, detector, rotation, gate and view.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ViewOrder {
    /// As many as there are of each vector.
    counts: [usize; VECTORS.len()],
    /// Numbers of stored frames, from 0, by the vectors' numbers, the last the fastest.
    stored: Vec<usize>,
}

impl ViewOrder {
    /// Reads the vectors of `frames` frames, of which several gates may be there if `gated`.
    ///
    /// # Errors
    /// [`ReadError::Field`] for a vector that is missing, has another length or does not count from 1, for numbers of
    /// which a combination has no frame or several, and where a stated number is not that of the vector.
    pub fn new(
        a: &Attributes,
        frames: usize,
        gated: bool,
        warnings: &mut Vec<String>,
    ) -> Result<Self, ReadError> {
        check_pointer(a, &VECTORS.map(|(vector, _)| vector))?;
        let mut index = vec![0_usize; frames];
        let mut counts = [1; VECTORS.len()];
        let mut cells = 1_usize;
        for ((vector, number), count) in VECTORS.into_iter().zip(&mut counts) {
            let numbers = numbers(a, vector, frames, gated, warnings)?;
            *count = usize::from(numbers.iter().copied().max().unwrap_or(1));
            if let Some(number) = number {
                check_number(a, number, *count)?;
            }
            cells = cells.saturating_mul(*count);
            for (index, number) in index.iter_mut().zip(numbers) {
                *index = index.saturating_mul(*count) + usize::from(number) - 1;
            }
        }
        if !gated && counts[3] * counts[4] > 1 {
            let reason = "the Image Type says that the image is not gated, and the vector has \
                          several gates";
            let of = if counts[4] > 1 {
                TIME_SLOT_VECTOR
            } else {
                RR_INTERVAL_VECTOR
            };
            let number = counts[3].max(counts[4]).to_string();
            return Err(a.wrong(of.name, &number, reason.into()));
        }
        Ok(Self {
            stored: each_once(a, &index, cells, counts)?,
            counts,
        })
    }

    /// Energy windows.
    pub fn windows(&self) -> usize {
        self.counts[0]
    }

    /// Detectors.
    pub fn detectors(&self) -> usize {
        self.counts[1]
    }

    /// Rotations of each detector.
    pub fn rotations(&self) -> usize {
        self.counts[2]
    }

    /// R-R intervals and time slots; 1 each without gating.
    pub fn gating(&self) -> [usize; 2] {
        [self.counts[3], self.counts[4]]
    }

    /// Gates: time slots of all R-R intervals, those of the first interval first.
    pub fn gates(&self) -> usize {
        self.counts[3] * self.counts[4]
    }

    /// Views of each rotation of a detector.
    pub fn views(&self) -> usize {
        self.counts[5]
    }

    /// The stored frames of all views of one rotation of a detector, all counted from 0.
    pub fn views_of(
        &self,
        window: usize,
        detector: usize,
        rotation: usize,
        gate: usize,
    ) -> &[usize] {
        let run = (window * self.detectors() + detector) * self.rotations() + rotation;
        let run = run * self.gates() + gate;
        let first = run * self.views();
        self.stored
            .get(first..first + self.views())
            .unwrap_or_default()
    }
}

/// The frame of each of so many `cells`, of frames whose cells are `index`.
fn each_once(
    a: &Attributes,
    index: &[usize],
    cells: usize,
    counts: [usize; VECTORS.len()],
) -> Result<Vec<usize>, ReadError> {
    frame_of_each(index, cells).map_err(|alike| {
        let frames = index.len();
        let alike = alike.map_or(String::new(), |(first, second)| {
            format!("; frames {first} and {second} have the same numbers")
        });
        let [windows, detectors, rotations, intervals, slots, views] = counts;
        a.wrong(
            ANGULAR_VIEW_VECTOR.name,
            &views.to_string(),
            format!(
                "the {frames} frames must hold every view of every gate, rotation, detector and energy window exactly \
                 once, and the vectors have {windows} windows x {detectors} detectors x {rotations} rotations x \
                 {intervals} R-R intervals x {slots} time slots x {views} views{alike}"
            ),
        )
    })
}

/// Checks that a number that the file states is that of the vector.
fn check_number(a: &Attributes, number: Attribute, held: usize) -> Result<(), ReadError> {
    match a.shorts(number).first() {
        Some(0) | None => Ok(()),
        Some(stated) if usize::from(*stated) == held => Ok(()),
        Some(stated) => {
            let reason =
                format!("the vector of the frames has {held}; frames are missing, or too many");
            Err(a.wrong(number.name, &stated.to_string(), reason))
        }
    }
}

/// The numbers of `vector`: one for each frame, counted from 1.
fn numbers(
    a: &Attributes,
    vector: Attribute,
    frames: usize,
    gated: bool,
    warnings: &mut Vec<String>,
) -> Result<Vec<u16>, ReadError> {
    let mut numbers = a.shorts(vector);
    if numbers.is_empty() {
        let needed = vector == ANGULAR_VIEW_VECTOR || (gated && vector == TIME_SLOT_VECTOR);
        return if needed {
            Err(a.missing(vector))
        } else {
            Ok(vec![1; frames])
        };
    }
    if numbers.len() != frames {
        let reason = format!(
            "expected a number for each of the {frames} frames, and there are {}",
            numbers.len()
        );
        return Err(a.wrong(vector.name, &format!("{numbers:?}"), reason));
    }
    match numbers.iter().copied().min().unwrap_or(1) {
        0 => {
            warnings.push(format!(
                "The {} counts from 0 and not from 1: 1 is added to each.",
                vector.name
            ));
            numbers
                .iter_mut()
                .for_each(|number| *number = number.saturating_add(1));
        }
        1 => {}
        least => {
            let reason = format!(
                "expected numbers from 1 on; the least is {least}, so the frames before it are missing"
            );
            return Err(a.wrong(vector.name, &format!("{numbers:?}"), reason));
        }
    }
    Ok(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dicom_encoding::transfer_syntax::Endianness;

    /// Numbers of attributes.
    type Given<'a> = &'a [(Attribute, &'a [u16])];

    /// Attributes with these vectors and numbers.
    fn with(given: Given) -> Attributes {
        let mut a = Attributes::new("raw.dcm", Endianness::Little);
        for (attribute, numbers) in given {
            let bytes = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
            a.insert(*attribute, None, bytes);
        }
        a
    }

    fn order(given: Given, gated: bool) -> Result<ViewOrder, ReadError> {
        let frames = given[0].1.len();
        ViewOrder::new(&with(given), frames, gated, &mut Vec::new())
    }

    #[test]
    fn vectors_order_the_frames_whatever_their_stored_order() {
        let order = order(
            &[
                (ANGULAR_VIEW_VECTOR, &[2, 1, 1, 2, 1, 2, 2, 1]),
                (DETECTOR_VECTOR, &[1, 1, 2, 2, 1, 1, 2, 2]),
                (TIME_SLOT_VECTOR, &[1, 1, 1, 1, 2, 2, 2, 2]),
                (TIME_SLOTS, &[2]),
            ],
            true,
        )
        .unwrap();
        assert_eq!((order.gates(), order.detectors(), order.views()), (2, 2, 2));
        assert_eq!(order.views_of(0, 0, 0, 0), [1, 0]);
        assert_eq!(order.views_of(0, 1, 0, 0), [2, 3]);
        assert_eq!(order.views_of(0, 0, 0, 1), [4, 5]);
        assert_eq!(order.views_of(0, 1, 0, 1), [7, 6]);
    }

    #[test]
    fn numbers_from_0_are_said() {
        let mut warnings = Vec::new();
        let a = with(&[(ANGULAR_VIEW_VECTOR, &[0, 1, 2])]);
        let order = ViewOrder::new(&a, 3, false, &mut warnings).unwrap();
        assert_eq!(order.views_of(0, 0, 0, 0), [0, 1, 2]);
        assert!(warnings[0].contains("Angular View Vector"), "{warnings:?}");
    }

    #[test]
    fn contradicting_vectors_are_refused_by_name() {
        let views: (Attribute, &[u16]) = (ANGULAR_VIEW_VECTOR, &[1, 2, 1, 2]);
        let cases: [(Given, bool, Attribute); 7] = [
            (&[views], false, ANGULAR_VIEW_VECTOR),
            (
                &[(DETECTOR_VECTOR, &[1, 1, 2, 2])],
                false,
                ANGULAR_VIEW_VECTOR,
            ),
            (
                &[(ANGULAR_VIEW_VECTOR, &[2, 3, 4, 5])],
                false,
                ANGULAR_VIEW_VECTOR,
            ),
            (
                &[views, (DETECTOR_VECTOR, &[1, 1, 2])],
                false,
                DETECTOR_VECTOR,
            ),
            (
                &[views, (DETECTOR_VECTOR, &[1, 1, 2, 2]), (DETECTORS, &[3])],
                false,
                DETECTORS,
            ),
            (
                &[views, (TIME_SLOT_VECTOR, &[1, 1, 2, 2])],
                false,
                TIME_SLOT_VECTOR,
            ),
            (
                &[views, (RR_INTERVAL_VECTOR, &[1, 1, 2, 2])],
                true,
                TIME_SLOT_VECTOR,
            ),
        ];
        for (given, gated, field) in cases {
            match order(given, gated) {
                Err(ReadError::Field { field: named, .. }) => assert_eq!(named, field.name),
                other => panic!("{other:?}"),
            }
        }
    }
}
