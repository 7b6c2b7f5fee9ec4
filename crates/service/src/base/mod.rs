//! What the whole service shares: the records and the traits of a store, errors, addresses of clients, memory under a
//! budget, requests to other programs.

pub mod client;
pub mod dicom_tags;
pub mod error;
pub mod http_client;
pub mod memory;
pub mod pem;
pub mod records;
