#![no_main]

libfuzzer_sys::fuzz_target!(
    init: ventriform_fuzz::write_corpus("dicom"),
    |data: &[u8]| ventriform_fuzz::dicom(data)
);
