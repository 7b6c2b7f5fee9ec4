//! Measurements over any mesh, and the report for machines and people.
//!
//! STUB: the owner of this folder writes the module page.
