//! Who is admitted to the service at its address, by the settings and by the keys that there are.

use crate::callers::{Gate, Issuer, IssuerSettings, Scope};
use crate::run::start::StartError;
use crate::use_cases::service::Service;
use std::net::SocketAddr;

/// The way into the service at one address.
pub struct Entrance {
    /// Tells callers by their credentials.
    pub gate: Gate,
    /// Whether only this machine reaches the address.
    pub loopback: bool,
    /// Whether callers without credentials are served.
    pub open: bool,
}

impl Service {
    /// The way into the service at that address.
    ///
    /// # Errors
    /// If strangers could use the service and the settings do not say that they shall, the issuer cannot be used, or
    /// the database fails.
    pub async fn entrance(&self, address: SocketAddr) -> Result<Entrance, StartError> {
        let settings = &self.settings;
        let loopback = address.ip().to_canonical().is_loopback();
        let text = |text: &String| Some(text.clone()).filter(|text| !text.is_empty());
        let issuer = text(&settings.oidc_issuer).map(|issuer| {
            let tokens = IssuerSettings {
                issuer,
                audience: settings.oidc_audience.clone(),
                jwks: text(&settings.oidc_jwks),
                tenant_claim: text(&settings.oidc_tenant_claim),
                scope_claim: settings.oidc_scope_claim.clone(),
                leeway: settings.oidc_leeway.0,
            };
            Issuer::new(tokens, &*self.http_clients)
        });
        if issuer.is_some() {
            // It stays closed without the setting too.
            self.access.close_access().await?;
        }
        // Whoever can reach a loopback address can usually read the data folder too.
        let anonymous = if loopback {
            Scope::Admin
        } else {
            Scope::Submit
        };
        let gate = Gate::new(
            self.access.clone(),
            self.clock().clone(),
            issuer.transpose()?,
            anonymous,
            settings.allow_anonymous,
        );
        let open = gate.is_open().await?;
        if open && !loopback && !settings.allow_anonymous {
            return Err(StartError::OpenHttp(address));
        }
        if open && !loopback {
            tracing::warn!(%address, "callers without credentials are served (allow_anonymous)");
        }
        Ok(Entrance {
            gate,
            loopback,
            open,
        })
    }
}
