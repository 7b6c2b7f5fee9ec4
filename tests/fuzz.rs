//! A short run of the fuzz targets that need the service (`fuzz/`) without libFuzzer: the same functions over the same
//! corpus, damaged at random with a fixed seed. `scripts/check/fuzz.sh` runs the real fuzzers.

#![allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]

#[path = "../fuzz/src/damage.rs"]
mod damage;

#[allow(dead_code, reason = "the library's tests drive its own targets")]
#[path = "../fuzz/src/targets.rs"]
mod targets;

#[path = "../fuzz/src/service.rs"]
mod service;

use damage::drive;

#[test]
fn damaged_forms_are_answered() {
    let service = service::Target::start();
    drive("multipart", &targets::corpus("multipart"), 400, |file| {
        service.multipart(file)
    });
}

#[test]
fn damaged_associations_end_and_harm_nobody() {
    let service = service::Target::start();
    drive(
        "association",
        &targets::corpus("association"),
        400,
        |file| service.association(file),
    );
}
