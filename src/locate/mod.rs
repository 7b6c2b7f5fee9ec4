//! The search for the heart: where it is, which way it points, and how sure that is.
//!
//! - [`cavity`] (with [`coarse`] and [`component_tree`]): the ventricle's cavity by rays cast into
//!   the grey values;
//! - [`localisation`] (with [`cavity_candidates`] and [`cup`]): the ventricle's place, long axis
//!   and size by correlation with a cup;
//! - [`body`]: one bright body, for organs that are no ventricle;
//! - [`patient_orientation`]: which way is up in the patient.

pub mod body;
pub mod cavity;
mod cavity_candidates;
pub mod coarse;
pub mod component_tree;
pub mod cup;
pub mod localisation;
pub mod patient_orientation;
