//! What is checked before a reading is signed.
//!
//! In: what a reader states, as parameters. Out: the volume that the reading belongs to, and the parameters with the volume at
//! rest of a comparison and the time. Refused: a result that is not there or was read meanwhile, and texts that name the
//! patient.

use crate::base::error::{Refusal, ServiceError, ServiceResult, invalid_field};
use crate::base::records::{Failure, Fault, Resource, ScanIdentity, Tenant, rfc3339};
use crate::use_cases::service::Service;
use serde_json::{Map, Value};

/// A reading that may be signed.
pub struct Signing {
    /// The volume of the result that was read.
    pub volume: String,
    /// All parameters.
    pub parameters: Map<String, Value>,
}

/// Parameters that hold free text.
const TEXT_FIELDS: [&str; 2] = ["impression", "limits"];

/// Fields of a scan that say who the patient is.
const PATIENT_FIELDS: [&str; 2] = ["patient_name", "patient_id"];

/// Shortest part of a name or an ID that a text must not hold, characters: shorter ones are words by chance.
const SHORTEST_NAME: usize = 3;

impl Service {
    /// Checks a reading that is about to be signed, and completes its parameters.
    ///
    /// # Errors
    /// `invalid-field` that names what cannot be used; `already-read` if the newest reading of the result is not the one that
    /// is amended; if the storage fails.
    pub async fn signing(
        &self,
        tenant: &Tenant,
        mut parameters: Map<String, Value>,
    ) -> ServiceResult<Signing> {
        let text = |name: &str| Some(parameters.get(name)?.as_str()?.to_owned());
        let id = text("result").unwrap_or_default();
        let result = self.product(tenant, &id).await?;
        let result = result.and_then(|own| Some((own.item.volume.clone()?, own.item)));
        let Some((volume, result)) = result else {
            return Err(self.names_nothing(tenant, "result", &id).await?);
        };
        let amends = text("amends");
        let newest = self.newest_reading(tenant, &volume, &id).await?;
        if amends != newest {
            return Err(already_read(newest.as_deref()));
        }
        let rest = result.other_scans().next();
        for scanned in std::iter::once(volume.as_str()).chain(rest) {
            let scan = self.scan(tenant, scanned).await?;
            refuse_names(scan.as_ref(), &parameters)?;
        }
        if let Some(rest) = rest {
            parameters.insert("rest".into(), rest.into());
        }
        parameters.insert(
            "read_at".into(),
            to_the_second(&rfc3339(self.items().now())).into(),
        );
        Ok(Signing { volume, parameters })
    }

    /// The id of the newest reading of a result of that volume.
    async fn newest_reading(
        &self,
        tenant: &Tenant,
        volume: &str,
        result: &str,
    ) -> ServiceResult<Option<String>> {
        let made = self.items().catalogue().made_of(tenant, volume).await?;
        let mut newest = None;
        for id in made {
            if Resource::from_id(&id) != Some(Resource::Reading) {
                continue;
            }
            let Some(reading) = self.product(tenant, &id).await? else {
                continue;
            };
            let reading = reading.item;
            let read = reading.parameters.get("result").and_then(Value::as_str);
            if read == Some(result) {
                newest = newest.max(Some((reading.sequence, reading.id)));
            }
        }
        Ok(newest.map(|(_, id)| id))
    }
}

/// `2026-11-30T22:15:00.123Z` without the part of the second.
fn to_the_second(at: &str) -> String {
    match at.split_once('.') {
        Some((whole, _)) => format!("{whole}Z"),
        None => at.to_owned(),
    }
}

fn already_read(newest: Option<&str>) -> ServiceError {
    let (detail, fix) = match newest {
        Some(newest) => (
            format!("The newest reading of this result is `{newest}`."),
            format!("Look at it, then give `{newest}` as `amends` to replace it."),
        ),
        None => (
            "The result has no reading that could be amended.".to_owned(),
            "Leave `amends` out.".to_owned(),
        ),
    };
    let failure = Failure::new(Fault::Request, "already-read", detail).at("amends");
    ServiceError::new(Refusal::Conflict, failure.fix(fix))
}

/// Refuses texts that name the patient of a scan.
fn refuse_names(scan: Option<&ScanIdentity>, parameters: &Map<String, Value>) -> ServiceResult<()> {
    let known = scan
        .into_iter()
        .flat_map(|scan| [&scan.found, &scan.stated]);
    let known = known.flatten().flat_map(|fields| {
        let named = PATIENT_FIELDS
            .iter()
            .filter_map(|name| fields.0.get(*name)?.as_str());
        named.map(str::to_owned).collect::<Vec<_>>()
    });
    let parts: Vec<String> = known
        .flat_map(|name| {
            let parts = name.split(['^', '=', ' ', ',']).map(str::to_lowercase);
            parts.collect::<Vec<_>>()
        })
        .filter(|part| part.chars().count() >= SHORTEST_NAME)
        .collect();
    for field in TEXT_FIELDS {
        let text = parameters
            .get(field)
            .and_then(Value::as_str)
            .unwrap_or_default();
        let text = text.to_lowercase();
        let mut words = text.split(|c: char| !c.is_alphanumeric() && c != '-');
        if words.any(|word| parts.iter().any(|part| part == word)) {
            let detail = format!("`{field}` holds the patient's name or ID.");
            let fix = "Leave it out: every output says whose scan it is, and read-only keys see this text.";
            return Err(invalid_field(field, detail).fix(fix).into());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::records::ScanFields;
    use serde_json::json;

    #[test]
    fn a_text_that_names_the_patient_is_refused_and_others_are_not() {
        let fields = json!({"patient_name": "Müller^Ada^Jo", "patient_id": "A-4711"});
        let scan = ScanIdentity {
            found: Some(ScanFields(fields.as_object().unwrap().clone())),
            ..ScanIdentity::default()
        };
        for (impression, named) in [
            ("Mrs. MÜLLER has a defect.", true),
            ("a-4711: normal", true),
            ("Ada is well", true),
            ("Jo", false),
            ("The adaptation is normal.", false),
        ] {
            let parameters = json!({ "impression": impression });
            let checked = refuse_names(Some(&scan), parameters.as_object().unwrap());
            assert_eq!(checked.is_err(), named, "{impression}");
        }
        assert!(refuse_names(None, &Map::new()).is_ok());
        assert_eq!(
            to_the_second("2026-11-30T22:15:00.5Z"),
            "2026-11-30T22:15:00Z"
        );
    }
}
