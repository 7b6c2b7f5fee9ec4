//! The scans that requests for comparisons name.

use crate::app::App;
use crate::wire::problem::{Answer, Problem};
use serde_json::{Map, Value};
use ventriform_service::base::records::{Resource, Tenant};

/// What to give in a field that names a scan.
pub const SCAN_ID_FIX: &str = "Give the id of a stored volume, segmentation or beat.";

/// A scan that a request names.
pub struct NamedScan {
    /// The id of its volume.
    pub volume: String,
    /// The parameters of the fit by which the request names it; none of a volume.
    pub fit: Map<String, Value>,
}

/// The scan that a field names: a volume, or that of the segmentation or the beat which the field names.
pub async fn named_scan(app: &App, tenant: &Tenant, field: &str, id: &str) -> Answer<NamedScan> {
    match Resource::from_id(id) {
        Some(Resource::Segmentation | Resource::Beat) => {
            let product = app.service.product(tenant, id).await?;
            let made = product.map(|product| (product.item.volume, product.item.parameters));
            match made {
                Some((Some(volume), fit)) => Ok(NamedScan { volume, fit }),
                _ => Err(app.service.names_nothing(tenant, field, id).await?.into()),
            }
        }
        Some(Resource::Volume) => Ok(NamedScan {
            volume: id.to_owned(),
            fit: Map::new(),
        }),
        _ => {
            let other = format!("`{field}` is not the id of a volume, a segmentation or a beat.");
            Err(Problem::invalid_field(field, other).fix(SCAN_ID_FIX))
        }
    }
}

/// Adds a field of the request to the parameters.
pub fn add(parameters: &mut Map<String, Value>, name: &str, value: String) -> Answer<()> {
    match parameters.insert(name.to_owned(), value.into()) {
        None => Ok(()),
        Some(_) => {
            let twice = format!("`{name}` is given in the body and in `parameters`.");
            Err(Problem::invalid_field(name, twice).fix("Leave it out of `parameters`."))
        }
    }
}
