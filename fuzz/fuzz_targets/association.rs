#![no_main]

use std::sync::OnceLock;
use ventriform_fuzz::service::Target;

static TARGET: OnceLock<Target> = OnceLock::new();

libfuzzer_sys::fuzz_target!(
    init: ventriform_fuzz::write_corpus("association"),
    |data: &[u8]| TARGET.get_or_init(Target::start).association(data)
);
