//! The priority of computing threads.

/// How much the computing threads yield to others, in steps of `nice(2)`; 5 steps leave a thread
/// that competes with an ordinary one about a quarter of a core.
#[cfg(target_os = "linux")]
const WORKER_NICENESS: i32 = 5;

/// Lowers the priority of the calling thread, so that requests are answered while every core
/// computes. A machine that does nothing else computes as fast as before.
///
/// Only Linux has priorities of single threads.
#[cfg(target_os = "linux")]
pub fn yield_to_requests() {
    if let Err(error) = rustix::process::nice(WORKER_NICENESS) {
        tracing::debug!(%error, "the priority of a computing thread stays as it is");
    }
}

/// Does nothing: only Linux has priorities of single threads.
#[cfg(not(target_os = "linux"))]
pub fn yield_to_requests() {}
