//! The work of the ventriform service, whoever asks for it: the queue of jobs and its workers, what is stored
//! and for whom, objects received from other systems, archives, webhooks, worklists, settings.
//!
//! It knows no HTTP and no database: [`stores::Stores`] holds the traits of what stores, and the crate
//! `ventriform-http` answers requests with it.

pub mod access;
pub mod archive;
pub mod background;
pub mod config;
pub mod hooks;
pub mod intake;
pub mod items;
pub mod jobs;
pub mod pem;
pub mod records;
pub mod stores;
pub mod work;
pub mod worklist;
