//! What users get: figures, documents and pages ([`report`]), mesh files and DICOM objects ([`export`]).

pub mod export;
pub mod figures;
pub mod report;
