//! Sockets and other systems: webhooks, the hospital's archive, what others send, work items.

pub mod archive;
pub mod hooks;
pub mod intake;
pub mod listen;
pub mod worklist;
