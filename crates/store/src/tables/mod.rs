//! The statements, one file for each table or trait, for both engines.

mod access;
mod archives;
mod catalogue;
mod custody;
mod erasure;
mod errands;
mod figures;
mod hooks;
mod intake;
mod jobs;
mod pages;
mod peers;
mod rows;
mod scans;
mod times;
mod worklist;

pub(super) use catalogue::insert_content;
pub(super) use rows::to_json;
