//! Pairs of received scans: the scan at rest that belongs to one at stress, or the other way round.
//!
//! In: a stored volume of a study, and the rule that asks for a comparison. Out: both volumes, stress first, or `None`
//! while the other scan of the study has not come.
//!
//! 1. A scan is at stress or at rest as the rule's parts of the Series Description say; where they say neither, as its
//!    header says. The rule goes first, as the description of a whole study may name one of the two for both. Where
//!    they contradict each other, the comparison is flagged.
//! 2. Where neither does, the injections of the study decide ([`roles_of`]): those of rest and stress are two, so that
//!    scans of one injection are what any of them is told to be, and those of the other one the other. If none of the
//!    study is told, the rule may say which one is made first with the lower dose, as in protocols of one day. More
//!    than two injections, or those that contradict what is told, decide nothing.
//! 3. Candidates are the tenant's other volumes of the study that are the other of the two. One with another
//!    attenuation correction is none. Those with as many volumes (gates) go first, then the newest.
//!
//! Guaranteed: whichever scan comes first, and also if both come at once, one comparison is filed: either finds the
//! other, as volumes are stored before jobs are filed, and the key of the order names both.

use crate::base::records::{
    Catalogue, ItemFilter, ListRequest, Owned, ScanFilter, ScanIdentity, StoreError, StoredVolume,
    Tenant,
};
use crate::network::intake::Rule;
use crate::work::UploadFacts;
use ventriform::heart::comparison::WhichScan;
use ventriform::image::volume::Provenance;

/// Most volumes of a study that are looked at.
const MOST_VOLUMES: u32 = 100;

/// Both scans of a patient.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScanPair {
    /// Id of the volume at stress.
    pub stress: String,
    /// Id of the volume at rest.
    pub rest: String,
}

/// Why a scan is part of no pair.
#[derive(Debug, thiserror::Error)]
pub enum PairError {
    /// Neither its header nor the rule says whether it is at stress or at rest.
    #[error(
        "neither the header, the rule nor the injections of the study say whether the series is at stress or at rest"
    )]
    NoRole,
    /// The storage fails.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// Whether `scan` is at stress or at rest.
fn role_of(scan: &ScanIdentity, rule: &Rule) -> Option<WhichScan> {
    let description = scan.text("series_description").map(str::to_lowercase);
    let says = |part: &Option<String>| {
        let both = part.as_ref().zip(description.as_ref());
        both.is_some_and(|(part, description)| description.contains(&part.to_lowercase()))
    };
    match (says(&rule.stress), says(&rule.rest)) {
        (true, false) => return Some(WhichScan::Stress),
        (false, true) => return Some(WhichScan::Rest),
        _ => {}
    }
    match scan.text("rest_or_stress")? {
        "stress" => Some(WhichScan::Stress),
        "rest" => Some(WhichScan::Rest),
        _ => None,
    }
}

fn provenance_of(scan: &ScanIdentity) -> Option<Provenance> {
    serde_json::from_value(scan.whole().into()).ok()
}

fn attenuation_corrected(scan: &ScanIdentity) -> Option<bool> {
    provenance_of(scan)?.attenuation_corrected()
}

/// Starts of an injection that series of one scan state differ by less, seconds.
const ONE_INJECTION_SECONDS: f64 = 120.0;
/// Quotient of the doses of a protocol of one day, the later to the earlier, from which they tell which is which: usual
/// is three.
const LEAST_DOSE_QUOTIENT: f64 = 1.5;

/// An injection of a tracer.
#[derive(Debug, Clone, PartialEq)]
struct Injection {
    /// The day of the scan, `YYYYMMDD`.
    day: String,
    /// Seconds of the day.
    seconds: f64,
    /// Total dose, MBq.
    dose_mbq: Option<f64>,
}

impl Injection {
    /// That of `scan`; `None` where the header does not say when it was.
    fn from_scan(scan: &ScanIdentity) -> Option<Self> {
        let scan = provenance_of(scan)?;
        let dose = scan.injected_dose_mbq();
        Some(Self {
            seconds: seconds_of(scan.injection_time.as_deref()?)?,
            day: scan.acquisition_date.or(scan.study_date)?.trim().to_owned(),
            dose_mbq: dose.and_then(|dose| dose.trim().parse().ok()),
        })
    }

    /// Whether both are one injection.
    fn is_same_as(&self, other: &Self) -> bool {
        self.day == other.day && (other.seconds - self.seconds).abs() < ONE_INJECTION_SECONDS
    }

    /// Whether this and the `later` one are those of a protocol of one day with the lower dose first.
    fn is_lower_before(&self, later: &Self) -> bool {
        let quotient = later.dose_mbq.zip(self.dose_mbq).map(|(b, a)| b / a);
        let higher = quotient.is_some_and(|quotient| quotient >= LEAST_DOSE_QUOTIENT);
        self.day == later.day && higher
    }
}

/// Seconds of the day of a time `HHMMSS.FFFFFF` (PS3.5, 6.2), of which minutes and seconds may be left out.
fn seconds_of(time: &str) -> Option<f64> {
    let time = time.trim();
    let part = |at: usize| time.get(at..at + 2)?.parse::<u32>().ok();
    let later = |at: usize, most: u32| {
        if time.len() > at {
            part(at).filter(|n| *n <= most)
        } else {
            Some(0)
        }
    };
    let hours = part(0).filter(|hours| *hours < 24)?;
    let (minutes, seconds) = (later(2, 59)?, later(4, 60)?);
    Some(f64::from(3600 * hours + 60 * minutes + seconds))
}

fn other_than(role: WhichScan) -> WhichScan {
    match role {
        WhichScan::Stress => WhichScan::Rest,
        WhichScan::Rest => WhichScan::Stress,
    }
}

/// Whether each scan of a study is at stress or at rest, by what it says ([`role_of`]) and, where that is nothing, by
/// its injection.
fn roles_of(scans: &[&ScanIdentity], rule: &Rule) -> Vec<Option<WhichScan>> {
    let told: Vec<Option<WhichScan>> = scans.iter().map(|scan| role_of(scan, rule)).collect();
    let injections: Vec<Option<Injection>> = scans
        .iter()
        .map(|scan| Injection::from_scan(scan))
        .collect();
    let mut order: Vec<&Injection> = injections.iter().flatten().collect();
    order.sort_by(|a, b| (a.day.cmp(&b.day)).then(a.seconds.total_cmp(&b.seconds)));
    let groups: Vec<&[&Injection]> = order.chunk_by(|a, b| a.is_same_as(b)).collect();
    let [first, second] = groups[..] else {
        return told;
    };
    let in_group = |group: &[&Injection], injection: &Option<Injection>| {
        (injection.as_ref()).is_some_and(|own| group.contains(&own))
    };
    // What the scans of an injection are told to be: nothing, or one thing, or both.
    let told_of = |group: &[&Injection], role: WhichScan| {
        let mut own = injections.iter().zip(&told);
        own.any(|(injection, told)| *told == Some(role) && in_group(group, injection))
    };
    let may_be = |role: WhichScan| {
        let other = other_than(role);
        let is_told = told_of(first, role) || told_of(second, other);
        is_told && !told_of(first, other) && !told_of(second, role)
    };
    let none_told = WhichScan::ALL
        .iter()
        .all(|role| !told_of(first, *role) && !told_of(second, *role));
    let of_first = if may_be(WhichScan::Stress) {
        Some(WhichScan::Stress)
    } else if may_be(WhichScan::Rest) {
        Some(WhichScan::Rest)
    } else {
        let lower_first = first
            .iter()
            .all(|a| second.iter().all(|b| a.is_lower_before(b)));
        rule.first.filter(|_| none_told && lower_first)
    };
    let found = told.iter().zip(&injections).map(|(told, injection)| {
        let by_injection = of_first.and_then(|role| {
            if in_group(first, injection) {
                Some(role)
            } else {
                in_group(second, injection).then(|| other_than(role))
            }
        });
        told.or(by_injection)
    });
    found.collect()
}

/// The pair of which `volume` of `tenant`, of that study, is a part; `None` while its other part is not stored.
///
/// # Errors
/// [`PairError`].
pub async fn pair_of(
    catalogue: &dyn Catalogue,
    tenant: &Tenant,
    (study, volume): (&str, &str),
    rule: &Rule,
) -> Result<Option<ScanPair>, PairError> {
    let Some(own) = catalogue.volume(tenant, volume).await? else {
        return Ok(None);
    };
    let filter = ItemFilter {
        scan: ScanFilter {
            study: Some(study.to_owned()),
            ..ScanFilter::default()
        },
        ..ItemFilter::default()
    };
    let page = ListRequest {
        before: None,
        limit: MOST_VOLUMES,
    };
    let others = catalogue.volumes(tenant, &filter, page).await?.items;
    let others: Vec<&Owned<StoredVolume>> = (others.iter())
        .filter(|other| other.item.id != own.item.id)
        .collect();
    let scans: Vec<&ScanIdentity> = std::iter::once(&own)
        .chain(others.iter().copied())
        .map(|volume| &volume.ownership.scan)
        .collect();
    let roles = roles_of(&scans, rule);
    let Some(role) = roles[0] else {
        let injections: Vec<Injection> = scans
            .iter()
            .filter_map(|scan| Injection::from_scan(scan))
            .collect();
        // The other injection may yet come, and tell.
        let waits = Injection::from_scan(scans[0]).is_some_and(|own| {
            injections
                .iter()
                .all(|injection| injection.is_same_as(&own))
        });
        return if waits {
            Ok(None)
        } else {
            Err(PairError::NoRole)
        };
    };
    let corrected = attenuation_corrected(&own.ownership.scan);
    let belongs = |(other, of_other): &(&Owned<StoredVolume>, Option<WhichScan>)| {
        let scan = &other.ownership.scan;
        let alike = match (corrected, attenuation_corrected(scan)) {
            (Some(own), Some(other)) => own == other,
            _ => true,
        };
        *of_other == Some(other_than(role)) && alike
    };
    let frames =
        |volume: &StoredVolume| UploadFacts::from_volume(volume).map_or(1, |facts| facts.frames);
    let own_frames = frames(&own.item);
    // Newest first, of equals the first: those with as many volumes go first.
    let found = (others.iter().copied())
        .zip(roles[1..].iter().copied())
        .filter(belongs)
        .min_by_key(|(other, _)| frames(&other.item) != own_frames);
    Ok(found.map(|(other, _)| {
        let (own, other) = (own.item.id.clone(), other.item.id.clone());
        match role {
            WhichScan::Stress => ScanPair {
                stress: own,
                rest: other,
            },
            WhichScan::Rest => ScanPair {
                stress: other,
                rest: own,
            },
        }
    }))
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;
    use crate::base::records::ScanFields;
    use serde_json::json;

    #[test]
    fn the_rule_says_the_role_and_where_it_does_not_the_header() {
        let role = |fields: serde_json::Value, stress: Option<&str>, rest: Option<&str>| {
            let scan = ScanIdentity {
                found: Some(ScanFields(fields.as_object().unwrap().clone())),
                ..ScanIdentity::default()
            };
            let rule = json!({"kind": "comparison", "stress": stress, "rest": rest});
            let rule: Rule = serde_json::from_value(rule).unwrap();
            role_of(&scan, &rule)
        };
        let said = json!({"rest_or_stress": "stress", "series_description": "REST"});
        assert_eq!(role(said.clone(), None, None), Some(WhichScan::Stress));
        assert_eq!(role(said, None, Some("rest")), Some(WhichScan::Rest));
        let named = || json!({"series_description": "MPI BELASTUNG AC"});
        assert_eq!(role(named(), None, None), None);
        let german = (Some("belastung"), Some("ruhe"));
        assert_eq!(role(named(), german.0, german.1), Some(WhichScan::Stress));
        let both = json!({"series_description": "Ruhe / Belastung"});
        assert_eq!(role(both, german.0, german.1), None);
        assert_eq!(role(json!({}), german.0, german.1), None);
    }

    #[test]
    fn two_injections_are_rest_and_stress_where_that_is_clear() {
        let (stress, rest) = (Some(WhichScan::Stress), Some(WhichScan::Rest));
        // Time, dose, and what the header says.
        let roles = |scans: &[(&str, &str, Option<&str>)], first: Option<&str>| {
            let scan = |(time, dose, told): &(&str, &str, Option<&str>)| {
                let fields = json!({"injection_time": time, "injected_dose": dose, "modality": "NM",
                    "acquisition_date": "20260107", "rest_or_stress": told});
                let mut fields = fields.as_object().unwrap().clone();
                fields.retain(|_, value| !value.is_null());
                ScanIdentity {
                    found: Some(ScanFields(fields)),
                    ..ScanIdentity::default()
                }
            };
            let scans: Vec<ScanIdentity> = scans.iter().map(scan).collect();
            let rule = json!({"kind": "comparison", "first": first});
            let rule: Rule = serde_json::from_value(rule).unwrap();
            roles_of(&scans.iter().collect::<Vec<_>>(), &rule)
        };
        let (early, late) = ("081500", "113000.00");
        // One of both is told: the other injection is the other scan, also of several series.
        let told = [
            (late, "900", None),
            (early, "300", Some("rest")),
            ("0816", "300", None),
            (late, "900", None),
        ];
        assert_eq!(roles(&told, None), [stress, rest, rest, stress]);
        // What is told goes before the order of the rule.
        assert_eq!(roles(&told, Some("stress")), [stress, rest, rest, stress]);
        // None is told: the rule says which one is first, if the doses fit.
        let untold = [(late, "900", None), (early, "300", None)];
        assert_eq!(roles(&untold, None), [None, None]);
        assert_eq!(roles(&untold, Some("rest")), [stress, rest]);
        assert_eq!(roles(&untold, Some("stress")), [rest, stress]);
        for unclear in [
            // The later dose is lower, or as high; or a dose is not stated.
            [(late, "300", None), (early, "900", None)],
            [(late, "600", None), (early, "600", None)],
            [(late, "", None), (early, "300", None)],
            // One injection; no time; no time of a day.
            [(late, "900", None), (late, "300", None)],
            [("", "900", None), (early, "300", None)],
            [("990000", "900", None), (early, "300", None)],
        ] {
            assert_eq!(roles(&unclear, Some("rest")), [None, None], "{unclear:?}");
        }
        // Three injections, and scans of one injection that are told to be both, decide nothing.
        let three = [
            (late, "900", Some("stress")),
            (early, "300", None),
            ("170000", "300", None),
        ];
        assert_eq!(roles(&three, Some("rest")), [stress, None, None]);
        let both = [
            (early, "300", Some("stress")),
            (early, "300", Some("rest")),
            (late, "900", None),
        ];
        assert_eq!(roles(&both, Some("rest")), [stress, rest, None]);
    }
}
