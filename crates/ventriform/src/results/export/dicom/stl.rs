//! The mesh as Encapsulated STL Storage (PS3.3 A.85.1).

use super::{DicomError, DicomResults};
use crate::results::export::{Format, Metadata, encode};
use crate::results::figures::Unit;
use ventriform_dicom::write::data_set::DataSet;
use ventriform_dicom::{PrimitiveValue, VR, tags};

/// Puts everything that is particular to this object.
pub(super) fn put(results: &DicomResults<'_>, set: &mut DataSet) -> Result<(), DicomError> {
    let scan = results.scan;
    let metadata = Metadata {
        frame_of_reference_uid: Some(scan.frame_of_reference()),
        ..Metadata::new(results.structure.label)
    };
    let bytes = encode(Format::Stl, results.mesh, &metadata)?;
    scan.put_frame_of_reference(set);
    results.scan.put_made(set);
    results.put_referenced_series(set);
    set.empty(tags::ACQUISITION_DATE_TIME);
    set.text(tags::BURNED_IN_ANNOTATION, "NO");
    set.text(tags::DOCUMENT_TITLE, results.structure.label);
    set.items(tags::CONCEPT_NAME_CODE_SEQUENCE, Vec::new());
    if let Some(images) = scan.images() {
        set.items(tags::SOURCE_INSTANCE_SEQUENCE, images.processed());
    }
    set.text(tags::MIME_TYPE_OF_ENCAPSULATED_DOCUMENT, "model/stl");
    set.put(
        tags::ENCAPSULATED_DOCUMENT_LENGTH,
        VR::UL,
        PrimitiveValue::from(bytes.len() as u32),
    );
    set.bytes(tags::ENCAPSULATED_DOCUMENT, bytes);
    set.code(tags::MEASUREMENT_UNITS_CODE_SEQUENCE, Unit::MILLIMETRE.code);
    set.text(tags::MODEL_MODIFICATION, "NO");
    set.text(tags::MODEL_MIRRORING, "NO");
    set.text(tags::CONTENT_DESCRIPTION, results.structure.label);
    Ok(())
}
