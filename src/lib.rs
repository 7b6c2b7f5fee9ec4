//! The program `ventriform`: the command line, and the service that it starts.
//!
//! ```text
//! ventriform ──> ventriform-service ──┬──> ventriform-store ───────┐
//! the library    what is done         │    rows and files          ├──> this crate
//!                                     ├──> ventriform-http-client ─┤
//!                                     └──> ventriform-http ────────┘
//! ```

pub mod cli;
pub mod server;
