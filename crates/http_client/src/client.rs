//! One client, its rule for redirects and its resolver.

use crate::error::{body_error, send_error};
use async_trait::async_trait;
use bytes::Bytes;
use futures::{StreamExt, TryStreamExt};
use http::{Request, Response};
use reqwest::Client;
use reqwest::Url;
use reqwest::dns::{Addrs, Name, Resolve, Resolving};
use reqwest::redirect::{Action, Attempt, Policy};
use std::sync::Arc;
use ventriform_service::base::http_client::{
    ByteStream, HttpClient, Redirects, Resolver, SendError,
};

/// A client of `reqwest`.
#[derive(Debug)]
pub struct ReqwestClient(pub Client);

#[async_trait]
impl HttpClient for ReqwestClient {
    async fn send(&self, request: Request<Bytes>) -> Result<Response<ByteStream>, SendError> {
        let (parts, body) = request.into_parts();
        let url = Url::parse(&parts.uri.to_string());
        let url = url.map_err(|error| SendError::Request(error.to_string()))?;
        let mut request = self.0.request(parts.method, url).headers(parts.headers);
        if !body.is_empty() {
            request = request.body(body);
        }
        let mut answer = request.send().await.map_err(send_error)?;
        let mut response = Response::new(());
        *response.status_mut() = answer.status();
        *response.version_mut() = answer.version();
        *response.headers_mut() = std::mem::take(answer.headers_mut());
        let body = answer.bytes_stream().map_err(body_error).boxed();
        Ok(response.map(|()| body))
    }
}

/// The policy of a rule for redirects.
pub fn redirect_policy(redirects: Redirects) -> Policy {
    match redirects {
        Redirects::Never => Policy::none(),
        Redirects::WithinOrigin(most) => {
            Policy::custom(move |attempt| within_origin(attempt, most))
        }
        Redirects::Anywhere(most) => Policy::limited(most),
    }
}

/// Follows redirects to the same scheme, host and port.
fn within_origin(attempt: Attempt<'_>, most: usize) -> Action {
    let origin = attempt.previous().first().map(Url::origin);
    if origin == Some(attempt.url().origin()) && attempt.previous().len() <= most {
        attempt.follow()
    } else {
        attempt.stop()
    }
}

/// The only names that a client resolves.
pub struct PinnedResolver(pub Arc<dyn Resolver>);

impl Resolve for PinnedResolver {
    fn resolve(&self, name: Name) -> Resolving {
        let found = self.0.resolve(name.as_str());
        Box::pin(async move {
            match found {
                Some(addresses) => Ok(Box::new(addresses.into_iter()) as Addrs),
                None => Err("the name was not checked".into()),
            }
        })
    }
}
