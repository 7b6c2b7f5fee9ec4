//! Whether the volumes of a file with a fourth dimension are gates of one heart beat.
//!
//! NIfTI has no field that says so. What its header can say is the opposite: that the fourth dimension
//! is not time (`intent_code`, the unit of `pixdim[4]`), that the file has further dimensions, that there
//! are more volumes than a study is gated into, or that they last longer than a heart beat. Where
//! nothing contradicts, the volumes are taken for gates, whose sum is what the camera counted over
//! the whole beat, and a warning says what was taken for what. A time that it states is the length of a gate.

use super::super::gate_timing::GateTiming;
use super::header::Header;
use crate::image::grid::gates::GATE_COUNTS;

/// Longest R-R interval, seconds: 24 beats per minute.
const LONGEST_BEAT: f64 = 2.5;

/// `intent_code` of a time series.
const TIME_SERIES: i32 = 2001;

/// Why the volumes of a file with `header` cannot be gates of one heart beat, in words that continue a
/// sentence; `None` if nothing contradicts it.
pub(super) fn contradiction(header: &Header) -> Option<String> {
    let along = |axis: usize| header.dim.get(axis).copied().unwrap_or(1);
    let volumes = along(3);
    if header.frames != volumes {
        return Some(format!(
            "dim is {:?}: the volumes differ in more than time",
            header.dim
        ));
    }
    if !matches!(header.intent_code, 0 | TIME_SERIES) {
        return Some(format!(
            "intent_code {} says that the fourth dimension is not time",
            header.intent_code
        ));
    }
    let most = *GATE_COUNTS.end();
    if volumes > most {
        return Some(format!(
            "dim[4] is {volumes}, more than the {most} gates of a heart beat"
        ));
    }
    let seconds = match step_seconds(header) {
        Ok(seconds) => seconds?,
        Err(unit) => {
            return Some(format!(
                "xyzt_units states the unit {unit} for the fourth dimension, which is not one of time"
            ));
        }
    };
    let whole = seconds * volumes as f64;
    (whole > LONGEST_BEAT).then(|| {
        format!(
            "{volumes} volumes of {seconds} s (pixdim[4], xyzt_units) last {whole} s, longer than a \
             heart beat"
        )
    })
}

/// The length of a gate as the header states it; `None` if it states no time.
pub(super) fn timing(header: &Header) -> Option<GateTiming> {
    let seconds = step_seconds(header).ok()??;
    Some(GateTiming {
        frame_time_ms: Some(1000.0 * seconds),
        ..GateTiming::default()
    })
}

/// Seconds from one volume to the next, if the header states them; the unit that is none of time otherwise.
fn step_seconds(header: &Header) -> Result<Option<f64>, i32> {
    let step = header.pixdim[4].abs();
    let of_unit = match header.xyzt_units & 0x38 {
        0 => return Ok(None),
        8 => 1.0,
        16 => 1e-3,
        24 => 1e-6,
        other => return Err(other),
    };
    // A step of one unit is what writers state who know of none.
    let stated = step > 0.0 && step != 1.0 && step.is_finite();
    Ok(stated.then_some(step * of_unit))
}
