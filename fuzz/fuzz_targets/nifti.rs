#![no_main]

libfuzzer_sys::fuzz_target!(
    init: ventriform_fuzz::write_corpus("nifti"),
    |data: &[u8]| ventriform_fuzz::nifti(data)
);
