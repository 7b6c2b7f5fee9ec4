//! Pairs of received scans: the scan at rest that belongs to one at stress, or the other way round.
//!
//! In: a stored volume of a study, and the rule that asks for a comparison. Out: both volumes, stress first, or `None`
//! while the other scan of the study has not come.
//!
//! 1. A scan is at stress or at rest as the rule's parts of the Series Description say; where they say neither, as its header
//!    says. The rule goes first, as the description of a whole study may name one of the two for both. Where they
//!    contradict each other, the comparison is flagged.
//! 2. Candidates are the tenant's other volumes of the study that are the other of the two. One with another attenuation
//!    correction is none. Those with as many volumes (gates) go first, then the newest.
//!
//! Guaranteed: whichever scan comes first, and also if both come at once, one comparison is filed: either finds the other,
//! as volumes are stored before jobs are filed, and the key of the order names both.

use crate::intake::Rule;
use crate::records::{
    Catalogue, ItemFilter, ListRequest, Owned, ScanFilter, ScanIdentity, StoreError, StoredVolume,
    Tenant,
};
use crate::work::UploadFacts;
use ventriform::comparison::WhichScan;
use ventriform::volume::Provenance;

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
    #[error("neither the header nor the rule says whether the series is at stress or at rest")]
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

fn attenuation_corrected(scan: &ScanIdentity) -> Option<bool> {
    let provenance: Provenance = serde_json::from_value(scan.whole().into()).ok()?;
    provenance.attenuation_corrected()
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
    let role = role_of(&own.ownership.scan, rule).ok_or(PairError::NoRole)?;
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
    let corrected = attenuation_corrected(&own.ownership.scan);
    let belongs = |other: &&Owned<StoredVolume>| {
        let scan = &other.ownership.scan;
        let alike = match (corrected, attenuation_corrected(scan)) {
            (Some(own), Some(other)) => own == other,
            _ => true,
        };
        let is_other = role_of(scan, rule).is_some_and(|other| other != role);
        other.item.id != own.item.id && is_other && alike
    };
    let frames = |volume: &StoredVolume| UploadFacts::of(volume).map_or(1, |facts| facts.frames);
    let own_frames = frames(&own.item);
    // Newest first, of equals the first: those with as many volumes go first.
    let found = others
        .iter()
        .filter(belongs)
        .min_by_key(|other| frames(&other.item) != own_frames);
    Ok(found.map(|other| {
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
    use crate::records::ScanFields;
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
}
