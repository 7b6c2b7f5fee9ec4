//! Damage at random with a fixed seed, for tests that drive the targets without libFuzzer.

use base64::Engine as _;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Bytes at which readers go wrong: signs, extremes, and the letters of formats.
const TELLING: [u8; 12] = [
    0, 1, 2, 0x7f, 0x80, 0xff, b'\\', b'-', b'"', b'\r', b'\n', b'=',
];

/// One to four damages to a file of the corpus.
fn damaged(corpus: &[Vec<u8>], random: &mut Pcg64Mcg) -> Vec<u8> {
    let pick = |random: &mut Pcg64Mcg| corpus[random.random_range(0..corpus.len())].clone();
    let mut file = pick(random);
    for _ in 0..random.random_range(1..=4) {
        let at = random.random_range(0..=file.len());
        let end = file.len().min(at + random.random_range(0..=16));
        match random.random_range(0..7) {
            0 => file.truncate(at),
            1 => drop(file.drain(at..end)),
            2 => drop(file.splice(at..at, file[at..end].to_vec())),
            3 => {
                let other = pick(random);
                let from = random.random_range(0..=other.len());
                file.splice(
                    at..end,
                    other[from..other.len().min(from + 64)].iter().copied(),
                );
            }
            4 => file[at..end].iter_mut().for_each(|byte| *byte = 0xff),
            5 => {
                if let Some(byte) = file.get_mut(at) {
                    *byte ^= 1 << random.random_range(0..8);
                }
            }
            _ => {
                if let Some(byte) = file.get_mut(at) {
                    *byte = TELLING[random.random_range(0..TELLING.len())];
                }
            }
        }
    }
    file
}

/// Runs the target called `name` over its `corpus` and over `rounds` damaged files of it.
pub fn drive(name: &str, corpus: &[Vec<u8>], rounds: usize, target: impl Fn(&[u8])) {
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let damaged = (0..rounds).map(|_| damaged(corpus, &mut random));
    for file in corpus.iter().cloned().chain(damaged) {
        let tried = catch_unwind(AssertUnwindSafe(|| target(&file)));
        let shown = || base64::prelude::BASE64_STANDARD.encode(&file);
        assert!(
            tried.is_ok(),
            "{name} fails on these bytes (base64): {}",
            shown()
        );
    }
}
