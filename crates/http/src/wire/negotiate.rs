//! Content negotiation by `Accept` (RFC 9110, section 12.5.1), and `Prefer: wait` (RFC 7240).

use crate::wire::problem::{Answer, Problem};
use axum::http::{HeaderMap, StatusCode, header};
use mediatype::{MediaType, MediaTypeError, MediaTypeList, ReadParams, names};
use std::time::Duration;

/// The index of the offered media type that `Accept` rates highest, the first among equals. A
/// request without `Accept` gets the first offer; `None` if no offer is acceptable.
pub fn best_offer(headers: &HeaderMap, offers: &[&str]) -> Option<usize> {
    let accept: Vec<_> = headers
        .get_all(header::ACCEPT)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(MediaTypeList::new)
        .collect();
    if accept.is_empty() {
        return (!offers.is_empty()).then_some(0);
    }
    offers
        .iter()
        .enumerate()
        .map(|(index, offer)| (index, quality(&accept, offer)))
        .filter(|(_, quality)| *quality > 0.0)
        // max_by returns the last of equal elements: in reverse order that is the first offer.
        .rev()
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(index, _)| index)
}

/// The quality (0 to 1) that the most specific matching media range gives to an offer, 0 if no
/// range matches. Ranges that cannot be parsed match nothing; a `q` that is not a number from 0
/// to 1 counts as 0.
fn quality(accept: &[Result<MediaType<'_>, MediaTypeError>], offer: &str) -> f32 {
    let Ok(offer) = MediaType::parse(offer) else {
        return 0.0;
    };
    let specificity = |range: &MediaType<'_>| {
        if range.essence() == offer {
            Some(2)
        } else if range.subty != names::_STAR || range.suffix.is_some() {
            None
        } else if range.ty == offer.ty {
            Some(1)
        } else {
            (range.ty == names::_STAR).then_some(0)
        }
    };
    accept
        .iter()
        .flatten()
        .filter_map(|range| Some((specificity(range)?, range)))
        .max_by_key(|(specificity, _)| *specificity)
        .map_or(0.0, |(_, range)| match range.get_param(names::Q) {
            Some(q) => q
                .unquoted_str()
                .parse()
                .ok()
                .filter(|q| (0.0..=1.0).contains(q))
                .unwrap_or(0.0),
            None => 1.0,
        })
}

/// [`best_offer`], or the 406 that lists the offers.
pub fn require_offer(headers: &HeaderMap, offers: &[&str]) -> Answer<usize> {
    best_offer(headers, offers).ok_or_else(|| {
        Problem::new(
            StatusCode::NOT_ACCEPTABLE,
            "not-acceptable",
            "The service has none of the media types that `Accept` allows.",
        )
        .at("Accept")
        .fix(format!("Accept one of {}.", offers.join(", ")))
    })
}

/// The time in `Prefer: wait=SECONDS` (RFC 7240). A preference that cannot be read is ignored, as
/// the RFC demands.
pub fn preferred_wait(headers: &HeaderMap) -> Option<Duration> {
    headers
        .get_all("prefer")
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split([',', ';']))
        .find_map(|preference| {
            let (name, value) = preference.split_once('=')?;
            let seconds = value.trim().trim_matches('"').parse().ok()?;
            name.trim()
                .eq_ignore_ascii_case("wait")
                .then_some(Duration::from_secs(seconds))
        })
}

/// Whether `Prefer: return=representation` asks for a body (RFC 7240, section 4.2).
pub fn prefers_representation(headers: &HeaderMap) -> bool {
    headers
        .get_all("prefer")
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split([',', ';']))
        .filter_map(|preference| preference.split_once('='))
        .any(|(name, value)| {
            name.trim().eq_ignore_ascii_case("return")
                && value.trim().trim_matches('"') == "representation"
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(name: &'static str, value: &str) -> HeaderMap {
        [(name.parse().unwrap(), value.parse().unwrap())]
            .into_iter()
            .collect()
    }

    fn chosen(accept: &str) -> Option<usize> {
        best_offer(
            &headers("accept", accept),
            &["model/stl", "application/json"],
        )
    }

    #[test]
    fn the_best_liked_offer_is_chosen_and_the_first_of_equals() {
        assert_eq!(chosen("*/*"), Some(0));
        assert_eq!(chosen("application/json, */*;q=0.1"), Some(1));
        assert_eq!(chosen("model/*;q=0.5, application/*;q=0.6"), Some(1));
        assert_eq!(chosen("*/*, model/stl;q=0"), Some(1));
        assert_eq!(chosen("image/png"), None);
        assert_eq!(chosen("model/stl;q=nonsense"), None);
    }

    #[test]
    fn ranges_are_read_by_the_grammar_of_media_types() {
        assert_eq!(chosen("Model/STL;q=0.1, APPLICATION/JSON;Q=0.2"), Some(1));
        assert_eq!(
            chosen("text/plain;title=\"a, b\", application/json"),
            Some(1)
        );
        assert_eq!(chosen("application/json;q=2, model/stl"), Some(0));
        assert_eq!(chosen("model/stl;q=nan"), None);
        assert_eq!(chosen("stl"), None);
        let offers = ["model/gltf-binary", "model/gltf+json"];
        let gltf = headers("accept", "model/gltf+json, model/*;q=0.5");
        assert_eq!(best_offer(&gltf, &offers), Some(1));
    }

    #[test]
    fn wait_is_read_in_every_form() {
        let wait = |text: &str| preferred_wait(&headers("prefer", text)).map(|d| d.as_secs());
        assert_eq!(wait("wait=60"), Some(60));
        assert_eq!(wait("respond-async, wait=5"), Some(5));
        assert_eq!(wait("Wait = \"7\""), Some(7));
        assert_eq!(wait("wait=soon"), None);
        assert_eq!(wait("return=minimal"), None);
    }
}
