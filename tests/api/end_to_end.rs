//! The real work, from file to mesh.
