//! The input of a beat.

use crate::parameters::FitParameters;
use crate::segmentation::NamedMesh;
use crate::volume::VolumeFile;
use serde_json::{Map, Value, json};
use std::ops::RangeInclusive;

/// Masses that a left ventricle's muscle can have, g.
pub const MASS_G: RangeInclusive<f64> = 20.0..=600.0;
/// R-R intervals that a heart can have, ms: 200 to 24 beats per minute.
pub const RR_MS: RangeInclusive<f64> = 300.0..=2500.0;

/// The parameters of a beat beside those of the fit to the gates' sum.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BeatChoice {
    /// Whether the volumes are gates although the file does not say so. Default `false`.
    pub gated: bool,
    /// Mass of the left ventricle's muscle, g, where it is known; within [`MASS_G`]. Default: the wall's usual
    /// thickness is assumed.
    pub mass_g: Option<f64>,
    /// The R-R interval, ms, within [`RR_MS`]. Default: as the file states it.
    pub rr_ms: Option<f64>,
}

impl BeatChoice {
    /// Every parameter by its name.
    pub fn to_json(self) -> Map<String, Value> {
        let values = json!({"gated": self.gated, "mass_g": self.mass_g, "rr_ms": self.rr_ms});
        match values {
            Value::Object(map) => map,
            _ => Map::new(),
        }
    }

    /// The first parameter that lies outside of its range: name, value, least and greatest.
    pub fn out_of_range(&self) -> Option<(&'static str, f64, [f64; 2])> {
        [
            ("mass_g", self.mass_g, MASS_G),
            ("rr_ms", self.rr_ms, RR_MS),
        ]
        .into_iter()
        .find_map(|(name, value, range)| {
            let value = value?;
            (!range.contains(&value)).then_some((name, value, [*range.start(), *range.end()]))
        })
    }
}

/// The files, models and parameters of a beat.
#[derive(Debug, Clone)]
pub struct GatedOrder<'a> {
    /// The files of the gates: one file with all, or one for each in their order.
    pub gates: &'a [VolumeFile],
    /// Whether the built-in hearts are fitted to the gates' sum.
    pub auto: bool,
    /// Further models to fit.
    pub models: Vec<NamedMesh>,
    /// The parameters of the fit to the gates' sum.
    pub parameters: &'a FitParameters,
    /// The parameters of the beat.
    pub choice: BeatChoice,
}
