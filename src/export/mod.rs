//! Meshes as files: one module per format.
//!
//! STUB: the owner of this folder writes the module page.
