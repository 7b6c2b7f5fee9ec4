//! Meshes and fits to what is handed out: figures and documents ([`report`]), files and DICOM objects ([`export`]).

pub mod report;

pub mod export;
