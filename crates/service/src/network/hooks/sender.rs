//! One attempt to deliver.

use super::guard::PinnedNames;
use super::{AttemptOutcome, DueDelivery, SigningSecret, UrlGuard, message_body, signature_header};
use crate::base::http_client::{
    ClientFactory, ClientOptions, HttpClient, Redirects, USER_AGENT, build_client, request_uri,
};
use crate::base::records::Timestamp;
use bytes::Bytes;
use futures::StreamExt;
use http::header::{CONTENT_TYPE, HeaderMap, RETRY_AFTER};
use http::{Request, StatusCode};
use std::sync::Arc;
use std::time::Duration;
use time::OffsetDateTime;
use time::format_description::well_known::Rfc2822;
use tokio::sync::OnceCell;

/// Most of an answer's body that is read, bytes. Nothing is done with it.
const ANSWER_BYTES: usize = 16 << 10;

/// Longest `Retry-After` that is followed.
const LONGEST_WAIT: Duration = Duration::from_secs(24 * 3600);

/// Sends deliveries.
pub struct Sender {
    guard: UrlGuard,
    names: PinnedNames,
    /// Made for the first delivery: reading the system's certificates takes time and memory.
    client: OnceCell<Arc<dyn HttpClient>>,
    clients: Arc<dyn ClientFactory>,
    limit: Duration,
    base_path: String,
}

impl Sender {
    /// A sender that lets pass what the guard does, and gives each attempt that much time. Paths in
    /// messages begin with `base_path`.
    pub fn new(
        clients: Arc<dyn ClientFactory>,
        guard: UrlGuard,
        limit: Duration,
        base_path: String,
    ) -> Self {
        Self {
            clients,
            guard,
            names: PinnedNames::default(),
            client: OnceCell::new(),
            limit,
            base_path,
        }
    }

    /// Makes one attempt, signed by each of the secrets. Returns how it ended, and how long the
    /// receiver asks to wait.
    pub async fn attempt(
        &self,
        delivery: &DueDelivery,
        secrets: &[SigningSecret],
        now: Timestamp,
    ) -> (AttemptOutcome, Option<Duration>) {
        let attempt = self.send(delivery, secrets, now);
        let ended = tokio::time::timeout(self.limit, attempt).await;
        ended.unwrap_or((AttemptOutcome::TimedOut, None))
    }

    async fn send(
        &self,
        delivery: &DueDelivery,
        secrets: &[SigningSecret],
        now: Timestamp,
    ) -> (AttemptOutcome, Option<Duration>) {
        let Ok(checked) = self.guard.resolve(&delivery.url).await else {
            return (AttemptOutcome::Refused, None);
        };
        let Some(client) = self.client().await else {
            return (AttemptOutcome::Unreachable, None);
        };
        let _pin = self.names.pin(&checked);
        let body = message_body(delivery, &self.base_path);
        let seconds = now / 1000;
        let Ok(uri) = request_uri(checked.url.as_str()) else {
            return (AttemptOutcome::Unreachable, None);
        };
        let request = Request::post(uri)
            .header(CONTENT_TYPE, "application/json")
            .header("webhook-id", &delivery.id)
            .header("webhook-timestamp", seconds)
            .header(
                "webhook-signature",
                signature_header(secrets, &delivery.id, seconds, &body),
            )
            .body(Bytes::from(body));
        let Ok(request) = request else {
            return (AttemptOutcome::Unreachable, None);
        };
        let Ok(answer) = client.send(request).await else {
            return (AttemptOutcome::Unreachable, None);
        };
        let asked = retry_after(answer.headers(), now);
        let status = answer.status();
        let mut body = answer.into_body();
        let mut read = 0;
        while let Some(Ok(piece)) = body.next().await {
            read += piece.len();
            if read >= ANSWER_BYTES {
                break;
            }
        }
        match status {
            StatusCode::GONE => (AttemptOutcome::Gone, None),
            status if status.is_success() => (AttemptOutcome::Delivered(status.as_u16()), None),
            status => (AttemptOutcome::Rejected(status.as_u16()), asked),
        }
    }

    /// The client: it follows no redirects, uses no proxy, keeps no connections, and resolves no
    /// names.
    async fn client(&self) -> Option<&Arc<dyn HttpClient>> {
        let options = ClientOptions {
            redirects: Redirects::Never,
            idle_timeout: Duration::ZERO,
            connect_timeout: Some(self.limit),
            resolver: Some(Arc::new(self.names.clone())),
            user_agent: Some(USER_AGENT),
            ..ClientOptions::default()
        };
        let made = self
            .client
            .get_or_try_init(|| build_client(self.clients.clone(), options));
        made.await
            .inspect_err(|error| tracing::error!(%error, "webhooks cannot be sent"))
            .ok()
    }
}

/// How long the receiver asks to wait, in seconds or until a time.
pub fn retry_after(headers: &HeaderMap, now: Timestamp) -> Option<Duration> {
    let value = headers.get(RETRY_AFTER)?.to_str().ok()?.trim();
    let wait = match value.parse() {
        Ok(seconds) => Duration::from_secs(seconds),
        Err(_) => {
            // `GMT` is the zone of HTTP's times; RFC 2822 writes it as an offset.
            let until = OffsetDateTime::parse(&value.replace("GMT", "+0000"), &Rfc2822).ok()?;
            let wait = until.unix_timestamp().saturating_mul(1000) - now;
            Duration::from_millis(u64::try_from(wait).unwrap_or(0))
        }
    };
    Some(wait.min(LONGEST_WAIT))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn retry_after_is_read_in_both_forms() {
        let read = |value: &str, now| {
            let mut headers = HeaderMap::new();
            headers.insert(RETRY_AFTER, value.parse().unwrap());
            retry_after(&headers, now)
        };
        assert_eq!(read("120", 0), Some(Duration::from_secs(120)));
        assert_eq!(read("soon", 0), None);
        assert_eq!(read("99999999999", 0), Some(LONGEST_WAIT));
        let at = "Tue, 14 Nov 2023 22:13:20 GMT";
        assert_eq!(read(at, 1_699_999_990_000), Some(Duration::from_secs(10)));
        assert_eq!(read(at, 1_700_000_001_000), Some(Duration::ZERO));
    }
}
