//! The HTTP client of the service: the traits of [`ventriform_service::base::http_client`] on `reqwest`.
//!
//! In: [`ClientOptions`]. Out: clients that connect as these say, over HTTP/1.1 and TLS by rustls. The process's
//! provider of cryptography has to be installed before the first client is made.

mod client;
mod error;

use client::{PinnedResolver, ReqwestClient, redirect_policy};
use reqwest::{Certificate, Client};
use std::sync::Arc;
use ventriform_service::base::http_client::{
    ClientError, ClientFactory, ClientOptions, HttpClient,
};

/// Makes clients of `reqwest`.
#[derive(Debug, Clone, Copy, Default)]
pub struct ReqwestFactory;

impl ClientFactory for ReqwestFactory {
    fn build(&self, options: ClientOptions) -> Result<Arc<dyn HttpClient>, ClientError> {
        let mut builder = Client::builder()
            .referer(false)
            .redirect(redirect_policy(options.redirects));
        builder = if options.idle_timeout.is_zero() {
            builder.pool_max_idle_per_host(0)
        } else {
            builder.pool_idle_timeout(options.idle_timeout)
        };
        if !options.environment_proxies {
            builder = builder.no_proxy();
        }
        if let Some(pem) = &options.authorities {
            let authorities = Certificate::from_pem_bundle(pem)
                .map_err(|e| ClientError::Authorities(error::reason(e)))?;
            builder = builder.tls_certs_merge(authorities);
        }
        if let Some(limit) = options.connect_timeout {
            builder = builder.connect_timeout(limit);
        }
        if let Some(limit) = options.read_timeout {
            builder = builder.read_timeout(limit);
        }
        if let Some(limit) = options.total_timeout {
            builder = builder.timeout(limit);
        }
        if let Some(resolver) = options.resolver {
            builder = builder.dns_resolver(PinnedResolver(resolver));
        }
        if let Some(name) = options.user_agent {
            builder = builder.user_agent(name);
        }
        let client = builder.build();
        let client = client.map_err(|e| ClientError::Client(error::reason(e)))?;
        Ok(Arc::new(ReqwestClient(client)))
    }
}

/// The examples of README.md, compiled as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

#[cfg(test)]
mod tests;
