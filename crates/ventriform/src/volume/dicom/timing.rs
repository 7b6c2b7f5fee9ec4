//! What a gated NM image says of the beats: PS3.3 C.8.4.9, Gated Information Sequence.

use super::super::VolumeError;
use super::super::gate_timing::GateTiming;
use super::attributes::{
    Attribute, Attributes, GATE_FRAME_TIME, GATE_HIGH_RR, GATE_INTERVALS_ACQUIRED,
    GATE_INTERVALS_REJECTED, GATE_LOW_RR, GATE_NOMINAL_INTERVAL, TIME_SLOT_VECTOR, TIME_SLOTS,
};

/// The timing of the first R-R interval; parts that the file leaves out are `None`.
///
/// # Errors
/// [`VolumeError::Field`] if a part is not a number, or is negative.
pub(super) fn of(attributes: &Attributes) -> Result<GateTiming, VolumeError> {
    let number = |attribute: Attribute| -> Result<Option<f64>, VolumeError> {
        match attributes.decimals::<1>(attribute)? {
            Some([number]) if number < 0.0 => {
                let reason = "a duration or a count is 0 or more".to_owned();
                Err(attributes.wrong(attribute.name, &number.to_string(), reason))
            }
            Some([number]) => Ok(Some(number)),
            None => Ok(None),
        }
    };
    // Some writers leave 0 where they know nothing.
    let duration = |attribute| Ok::<_, VolumeError>(number(attribute)?.filter(|ms| *ms > 0.0));
    let slots = attributes.shorts(TIME_SLOT_VECTOR).into_iter().max();
    let stated = attributes.shorts(TIME_SLOTS).first().copied();
    Ok(GateTiming {
        frame_time_ms: duration(GATE_FRAME_TIME)?,
        rr_ms: duration(GATE_NOMINAL_INTERVAL)?,
        low_rr_ms: duration(GATE_LOW_RR)?,
        high_rr_ms: duration(GATE_HIGH_RR)?,
        beats_accepted: number(GATE_INTERVALS_ACQUIRED)?,
        beats_rejected: number(GATE_INTERVALS_REJECTED)?,
        gates_per_interval: slots.or(stated).map(usize::from),
    })
}
