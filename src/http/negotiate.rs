//! `Accept` and `Prefer`.

use super::problem::{Answer, Problem};
use axum::http::{HeaderMap, StatusCode, header};
use std::time::Duration;

/// The index of the offer that the client likes best; the first of equals. Without an
/// `Accept` header that is the first offer.
pub fn best_offer(headers: &HeaderMap, offers: &[&str]) -> Option<usize> {
    let accept: Vec<&str> = headers
        .get_all(header::ACCEPT)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .map(str::trim)
        .filter(|range| !range.is_empty())
        .collect();
    if accept.is_empty() {
        return (!offers.is_empty()).then_some(0);
    }
    offers
        .iter()
        .enumerate()
        .map(|(index, offer)| (index, quality(&accept, offer)))
        .filter(|(_, quality)| *quality > 0.0)
        // max_by takes the last of equals; reversed, that is the first offer.
        .rev()
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(index, _)| index)
}

/// The quality that the most specific matching range gives an offer.
fn quality(accept: &[&str], offer: &str) -> f64 {
    let group = offer.split('/').next().unwrap_or_default();
    accept
        .iter()
        .filter_map(|range| {
            let mut parts = range.split(';').map(str::trim);
            let name = parts.next()?.to_ascii_lowercase();
            let specificity = match name.as_str() {
                "*/*" => 0,
                _ if name == offer => 2,
                _ if name.strip_suffix("/*") == Some(group) => 1,
                _ => return None,
            };
            let quality = parts
                .find_map(|p| p.strip_prefix("q="))
                .map_or(1.0, |q| q.parse().unwrap_or(0.0));
            Some((specificity, quality))
        })
        .max_by_key(|(specificity, _)| *specificity)
        .map_or(0.0, |(_, quality): (i32, f64)| quality)
}

/// Like [`best_offer`], or the refusal that lists the offers.
pub fn require_offer(headers: &HeaderMap, offers: &[&str]) -> Answer<usize> {
    best_offer(headers, offers).ok_or_else(|| {
        Problem::new(
            StatusCode::NOT_ACCEPTABLE,
            "not-acceptable",
            "None of the media types in `Accept` can be given.",
        )
        .at("Accept")
        .fix(format!("Accept one of {}.", offers.join(", ")))
    })
}

/// The patience of `Prefer: wait=SECONDS` (RFC 7240), where there is one that can be read.
/// A preference is no condition: what cannot be read is ignored.
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
    fn wait_is_read_in_every_form() {
        let wait = |text: &str| preferred_wait(&headers("prefer", text)).map(|d| d.as_secs());
        assert_eq!(wait("wait=60"), Some(60));
        assert_eq!(wait("respond-async, wait=5"), Some(5));
        assert_eq!(wait("Wait = \"7\""), Some(7));
        assert_eq!(wait("wait=soon"), None);
        assert_eq!(wait("return=minimal"), None);
    }
}
