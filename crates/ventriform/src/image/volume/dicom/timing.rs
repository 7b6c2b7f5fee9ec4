//! The timing of the beats that gated images state, and whether volumes are gates.
//!
//! In: the attributes of a file. Out: [`GateTiming`] of each R-R interval, of which the file may leave out any part.
//! Nuclear Medicine images have it in the Gated Information Sequence (PS3.3 C.8.4.9), with an item of the Data
//! Information Sequence for each interval, images of a PET series beside the slice (C.8.9.4), Enhanced images in the
//! Cardiac Synchronization functional group (C.7.6.16.2.7).

use super::super::VolumeError;
use super::super::gate_timing::GateTiming;
use ventriform_dicom::read::ReadError;
use ventriform_dicom::read::attributes::{
    Attribute, Attributes, FRAME_ACTUAL_DELAY, FRAME_CARDIAC_PHASE, FRAME_HIGH_RR,
    FRAME_INTERVALS_ACQUIRED, FRAME_INTERVALS_REJECTED, FRAME_LOW_RR, FRAME_RR_NOMINAL, FRAME_TIME,
    FRAME_TRIGGER_DELAY, GATE_FRAME_TIME, GATE_HIGH_RR, GATE_INTERVALS_ACQUIRED,
    GATE_INTERVALS_REJECTED, GATE_LOW_RR, GATE_NOMINAL_INTERVAL, HEART_RATE, HIGH_RR_VALUE,
    INTERVALS_ACQUIRED, INTERVALS_REJECTED, LOW_RR_VALUE, MODALITY, NOMINAL_INTERVAL,
    OLD_TRIGGER_TIME, RR_INTERVAL_VECTOR, RR_INTERVALS, SERIES_TYPE, TIME_SLOT_VECTOR, TIME_SLOTS,
    TRIGGER_TIME,
};
use ventriform_dicom::read::frames::counted;
use ventriform_dicom::read::kind::Kind;

/// Milliseconds of a minute.
const MINUTE_MS: f64 = 60_000.0;

/// The timing of each R-R interval of a Nuclear Medicine image, in their order.
///
/// # Errors
/// [`VolumeError::Field`] if a part is not a number, or is negative.
pub(super) fn gate_timings(a: &Attributes) -> Result<Vec<GateTiming>, VolumeError> {
    let slots = counted(a, TIME_SLOT_VECTOR).into_iter().max();
    let stated = a.shorts(TIME_SLOTS).first().copied();
    let intervals = counted(a, RR_INTERVAL_VECTOR).into_iter().max();
    let of_interval = |interval| {
        let own = Some(usize::from(interval));
        Ok(GateTiming {
            frame_time_ms: duration(a, GATE_FRAME_TIME, own)?,
            rr_ms: duration(a, GATE_NOMINAL_INTERVAL, own)?,
            low_rr_ms: duration(a, GATE_LOW_RR, own)?,
            high_rr_ms: duration(a, GATE_HIGH_RR, own)?,
            beats_accepted: number(a, GATE_INTERVALS_ACQUIRED, own)?,
            beats_rejected: number(a, GATE_INTERVALS_REJECTED, own)?,
            gates_per_interval: slots.or(stated).map(usize::from),
        })
    };
    (0..intervals.unwrap_or(1)).map(of_interval).collect()
}

/// The timing that a slice of a gated PET series states.
///
/// # Errors
/// As for [`gate_timings`].
pub(super) fn of_slice(a: &Attributes) -> Result<GateTiming, VolumeError> {
    let first = |attribute| a.shorts(attribute).first().copied().map(usize::from);
    let slots = first(TIME_SLOTS);
    let several = first(RR_INTERVALS).is_some_and(|intervals| intervals > 1);
    let of_rate = duration(a, HEART_RATE, None)?.map(|rate| MINUTE_MS / rate);
    Ok(GateTiming {
        frame_time_ms: duration(a, FRAME_TIME, None)?,
        rr_ms: duration(a, NOMINAL_INTERVAL, None)?.or(of_rate),
        low_rr_ms: duration(a, LOW_RR_VALUE, None)?,
        high_rr_ms: duration(a, HIGH_RR_VALUE, None)?,
        beats_accepted: number(a, INTERVALS_ACQUIRED, None)?,
        beats_rejected: number(a, INTERVALS_REJECTED, None)?,
        gates_per_interval: several.then_some(slots).flatten(),
    })
}

/// The timing that the first frame of a gated Enhanced image states.
///
/// # Errors
/// As for [`gate_timings`].
pub(super) fn of_frames(a: &Attributes) -> Result<GateTiming, VolumeError> {
    let first = Some(0);
    let nominal = a.double(FRAME_RR_NOMINAL, first);
    Ok(GateTiming {
        frame_time_ms: None,
        rr_ms: nominal.filter(|ms| ms.is_finite() && *ms > 0.0),
        low_rr_ms: duration(a, FRAME_LOW_RR, first)?,
        high_rr_ms: duration(a, FRAME_HIGH_RR, first)?,
        beats_accepted: number(a, FRAME_INTERVALS_ACQUIRED, first)?,
        beats_rejected: number(a, FRAME_INTERVALS_REJECTED, first)?,
        gates_per_interval: None,
    })
}

/// Whether a slice says that it belongs to a gated series: PET by its Series Type, or by several time slots.
pub(super) fn is_of_gates(a: &Attributes) -> bool {
    match a.texts(SERIES_TYPE).first().map(String::as_str) {
        Some("GATED") => true,
        Some("DYNAMIC" | "STATIC" | "WHOLE BODY") => false,
        _ => a.shorts(TIME_SLOTS).first().is_some_and(|slots| *slots > 1),
    }
}

/// Whether a slice says that the series it belongs to is one gate of several: as one of a gated series, or by its
/// moment after the R wave.
pub(super) fn is_slice_of_a_gate(a: &Attributes) -> bool {
    let uptake = matches!(a.text(MODALITY).as_deref(), Some("NM" | "PT"));
    let kind = a.texts(SERIES_TYPE).into_iter().next();
    let other = matches!(kind.as_deref(), Some("DYNAMIC" | "WHOLE BODY"));
    let moment = matches!(a.decimals::<1>(TRIGGER_TIME), Ok(Some(_)));
    is_of_gates(a) || (uptake && moment && !other)
}

/// Whether an image of one volume says that it is one gate of several: a gated Nuclear Medicine image whose frames are
/// of one R-R interval and one time slot, or an image of a moment after the R wave.
pub(super) fn is_one_gate(a: &Attributes, kind: Kind) -> bool {
    let one = |vector| counted(a, vector).iter().all(|number| *number == 1);
    match kind {
        Kind::Nuclear { gated: true } => one(RR_INTERVAL_VECTOR) && one(TIME_SLOT_VECTOR),
        Kind::Nuclear { gated: false } | Kind::Enhanced => {
            matches!(a.decimals::<1>(TRIGGER_TIME), Ok(Some(_)))
        }
        Kind::Slice | Kind::Segmentation | Kind::Projections { .. } => false,
    }
}

/// Whether the `frames` of an Enhanced image of uptake show several moments of the beat.
pub(super) fn has_gates(a: &Attributes, frames: usize) -> bool {
    let uptake = matches!(a.text(MODALITY).as_deref(), Some("NM" | "PT"));
    let differ = |value: &dyn Fn(usize) -> Option<f64>| {
        let first = value(0);
        first.is_some() && (1..frames).any(|frame| value(frame).is_some_and(|v| Some(v) != first))
    };
    let moments = [FRAME_TRIGGER_DELAY, FRAME_ACTUAL_DELAY, FRAME_CARDIAC_PHASE];
    let of_groups =
        || (moments.iter()).any(|moment| differ(&|frame| a.double(*moment, Some(frame))));
    // Images that were made of single ones keep their Trigger Time.
    let of_old = |frame| {
        let time = a.decimals_of::<1>(OLD_TRIGGER_TIME, Some(frame));
        time.ok().flatten().map(|[ms]| ms)
    };
    uptake && (of_groups() || differ(&of_old))
}

fn number(
    a: &Attributes,
    attribute: Attribute,
    frame: Option<usize>,
) -> Result<Option<f64>, ReadError> {
    match a.decimals_of::<1>(attribute, frame)? {
        Some([number]) if number < 0.0 => {
            let reason = "a duration or a count is 0 or more".to_owned();
            Err(a.wrong(attribute.name, &number.to_string(), reason))
        }
        Some([number]) => Ok(Some(number)),
        None => Ok(None),
    }
}

/// Some writers leave 0 where they know nothing.
fn duration(
    a: &Attributes,
    attribute: Attribute,
    frame: Option<usize>,
) -> Result<Option<f64>, VolumeError> {
    Ok(number(a, attribute, frame)?.filter(|ms| *ms > 0.0))
}
