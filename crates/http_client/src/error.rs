//! Errors of `reqwest` in the service's words, without URLs: these may hold names, tokens and other secrets.

use std::error::Error;
use ventriform_service::base::http_client::SendError;

/// The kind of an error before the response's headers have come.
pub fn send_error(error: reqwest::Error) -> SendError {
    if error.is_timeout() {
        SendError::Timeout
    } else if error.is_redirect() {
        SendError::Redirect
    } else if error.is_connect() {
        SendError::Connect(reason(error))
    } else if error.is_body() {
        SendError::Body(reason(error))
    } else {
        SendError::Request(reason(error))
    }
}

/// The kind of an error within the response's body.
pub fn body_error(error: reqwest::Error) -> SendError {
    if error.is_timeout() {
        SendError::Timeout
    } else {
        SendError::Body(reason(error))
    }
}

/// The causes of an error from the first to the last, without those that may name a URL.
pub fn reason(error: reqwest::Error) -> String {
    let error = error.without_url();
    let mut causes = Vec::new();
    let mut next = error.source();
    while let Some(cause) = next {
        if !cause.is::<reqwest::Error>() {
            causes.push(cause.to_string());
        }
        next = cause.source();
    }
    if causes.is_empty() {
        error.to_string()
    } else {
        causes.join(": ")
    }
}
