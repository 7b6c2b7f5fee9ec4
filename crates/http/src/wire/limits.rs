//! Limits on request bodies, as layers around the routes that take one.
//!
//! A body has a largest size, a longest pause between two pieces, and a longest time from the
//! first to the last piece. A `Content-Length` over the limit is answered 413 before the handler
//! runs; the other limits end the body with an error, which [`problem::body`] translates. The
//! layers also put [`BodyLimits`] into the request's extensions, for the messages.
//!
//! [`problem::body`]: crate::wire::problem::body

use crate::wire::problem::{Answer, MEDIA_TYPE, Problem, body};
use axum::Extension;
use axum::body::Body;
use axum::extract::Request;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::Route;
use std::convert::Infallible;
use std::time::Duration;
use tower::{Layer, Service, ServiceBuilder};
use tower_http::limit::{RequestBodyLimitLayer, ResponseBody};
use tower_http::timeout::{RequestBodyDeadlineLayer, RequestBodyTimeoutLayer};
use ventriform_service::config::{Settings, Size};

/// The limits on one body.
#[derive(Debug, Clone, Copy)]
pub struct BodyLimits {
    /// Largest size.
    pub size: Size,
    /// Longest pause between two pieces.
    pub pause: Duration,
    /// Longest time from the first to the last piece.
    pub total: Duration,
}

impl BodyLimits {
    /// The limits on an uploaded file.
    pub fn of_uploads(settings: &Settings) -> Self {
        Self {
            size: settings.body_limit,
            pause: settings.body_timeout.0,
            total: settings.upload_time_limit.0,
        }
    }

    /// The limits on a JSON document of at most `size`, which is held in memory.
    pub fn of_json(settings: &Settings, size: Size) -> Self {
        Self {
            size,
            pause: settings.body_timeout.0,
            total: settings.body_timeout.0,
        }
    }

    /// The limits that the layers of a route enforce on this request.
    ///
    /// # Errors
    /// 500 if the route has no such layers.
    pub fn from_request(request: &Request) -> Answer<Self> {
        let limits = request.extensions().get::<Self>().copied();
        limits.ok_or_else(|| Problem::internal("this route has no limits on its body"))
    }

    /// The layers that enforce the limits.
    pub fn layers(
        self,
    ) -> impl Layer<
        Route,
        Service = impl Service<Request, Response = Response, Error = Infallible, Future: Send>
                  + Clone
                  + Send
                  + Sync
                  + 'static,
    > + Clone
    + Send
    + Sync
    + 'static {
        ServiceBuilder::new()
            .map_response(move |response| self.word(response))
            .layer(Extension(self))
            .layer(RequestBodyLimitLayer::new(self.size.as_usize()))
            .layer(RequestBodyDeadlineLayer::new(self.total))
            .layer(RequestBodyTimeoutLayer::new(self.pause))
    }

    /// The answer, with the plain text by which the layer refuses a `Content-Length` replaced by
    /// a problem object.
    fn word(self, response: Response<ResponseBody<Body>>) -> Response {
        let is_problem =
            |value: &axum::http::HeaderValue| value.as_bytes() == MEDIA_TYPE.as_bytes();
        let worded = response
            .headers()
            .get(header::CONTENT_TYPE)
            .is_some_and(is_problem);
        if response.status() == StatusCode::PAYLOAD_TOO_LARGE && !worded {
            return body::too_large(self.size).into_response();
        }
        response.map(Body::new)
    }
}
