//! What attenuation may have to do with the extent of a map.
//!
//! In: a summary, and whether attenuation was corrected. Out: a note where nothing says that it was and wall below the
//! threshold lies in inferior segments. Not guaranteed: which part of that wall is attenuated and which malperfused;
//! only limits of scans without correction tell them apart.

use super::document::{PolarAttenuation, PolarSummary, round};

impl PolarSummary {
    /// The summary with a note on attenuation, if no normal `limits` stand beside the map, it has sides, attenuation was
    /// not `corrected` for sure, and inferior wall lies below the threshold.
    #[must_use]
    pub fn with_attenuation(self, corrected: Option<bool>, limits: bool) -> Self {
        let attenuation = self.attenuation_of(corrected).filter(|_| !limits);
        Self {
            attenuation,
            ..self
        }
    }

    fn attenuation_of(&self, corrected: Option<bool>) -> Option<PolarAttenuation> {
        if corrected == Some(true) || self.first_column.is_none() {
            return None;
        }
        let wall: f64 = self.segments.iter().map(|segment| segment.area_mm2).sum();
        let inferior = self
            .segments
            .iter()
            .filter(|segment| segment.name.contains("infer"));
        let below: f64 = inferior
            .map(|segment| segment.extent_percent * segment.area_mm2)
            .sum();
        if wall <= 0.0 || below <= 0.0 {
            return None;
        }
        let part = round(below / wall);
        let said = match corrected {
            None => "Nothing says that attenuation was corrected",
            Some(_) => "Attenuation was not corrected",
        };
        let note = format!(
            "{said}. Without correction the inferior wall of healthy hearts shows less uptake, its basal segments \
             most (54 to 62 % in 7 of 11 scans of rotating cameras). Of {:.1} % of the wall below the threshold, \
             {part:.1} % lie in inferior segments: this map alone cannot tell whether they are attenuated or \
             malperfused. Normal limits of scans without correction can.",
            self.extent_percent
        );
        Some(PolarAttenuation {
            corrected,
            inferior_extent_percent: part,
            note,
        })
    }
}
