//! A volume's way through every stage.
//!
//! STUB.
