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
mod marks;
mod owners;
mod pages;
mod peers;
mod rows;
mod scan_erasure;
mod scan_search;
mod scans;
mod times;
mod totals;
mod worklist;

pub(crate) use access::append;
pub(crate) use marks::{Access, Marks, anchor_of};
pub(crate) use owners::{Holder, Holding, REPAIRER, repaired};
pub(super) use rows::to_json;
pub(crate) use totals::RECOUNT;
