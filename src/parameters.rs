//! The parameters of a model by the names that users give them.
//!
//! STUB.
