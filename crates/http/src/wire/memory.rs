//! The memory of answers: an answer holds its own size until it has been read.
//!
//! The memory that a request holds before is charged by [`charge`]; see [`ventriform_service::base::memory`].

use crate::wire::held_body::HeldBody;
use crate::wire::problem::Answer;
use axum::body::{Body, HttpBody};
use axum::response::Response;
pub use ventriform_service::base::memory::{Ledger, charge, charge_page, end_rows};

/// Bytes of an answer that are not charged: the system's buffers hold as many.
const SMALL_ANSWER_BYTES: u64 = 16 << 10;

/// The answer, which holds its own size until it is read; one that is not in memory as a whole holds what the
/// request holds.
///
/// # Errors
/// 503 if there is no memory for it.
pub async fn answered(ledger: &Ledger, response: Response) -> Answer<Response> {
    // What was needed to make an answer that is in memory as a whole is no longer needed.
    match response.body().size_hint().exact() {
        Some(size) if size <= SMALL_ANSWER_BYTES => ledger.settle(0).await?,
        Some(size) => ledger.settle(size).await?,
        None => ledger.end_rows().await,
    }
    if ledger.bytes().await == 0 {
        return Ok(response);
    }
    let ledger = ledger.clone();
    Ok(response.map(|body| Body::new(HeldBody::new(body, ledger))))
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;
    use ventriform_service::base::memory::MemoryBudget;

    #[tokio::test]
    async fn an_answer_holds_its_memory_until_it_is_gone() {
        let ledger = Ledger::new(&MemoryBudget::new(1 << 20), None);
        let answer = ledger.clone().scope(async {
            charge(300_000).await.unwrap();
            Response::new(Body::from(vec![0; 200_000]))
        });
        let answer = answer.await;
        assert_eq!(ledger.bytes().await, 300_000);
        let answer = answered(&ledger, answer).await.unwrap();
        assert_eq!(ledger.bytes().await, 200_000);
        assert_eq!(answer.body().size_hint().exact(), Some(200_000));
    }
}
