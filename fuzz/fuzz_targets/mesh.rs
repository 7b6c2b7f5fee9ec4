#![no_main]

libfuzzer_sys::fuzz_target!(
    init: ventriform_fuzz::write_corpus("mesh"),
    |data: &[u8]| ventriform_fuzz::mesh(data)
);
