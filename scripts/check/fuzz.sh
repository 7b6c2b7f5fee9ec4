#!/usr/bin/env bash
# Runs the fuzzers of fuzz/ with libFuzzer and the address sanitiser, one after the other, on one core.
#
#   scripts/check/fuzz.sh [SECONDS] [TARGET...]     60 seconds each of nifti, dicom, mesh, parameters, multipart and
#                                                   association
#
# Needs cargo-fuzz's compiler flags, which only a nightly compiler takes; RUSTC_BOOTSTRAP=1 makes the stable one
# take them. New inputs go to fuzz/corpus/, inputs that fail to fuzz/artifacts/; neither is committed.
set -euo pipefail
cd "$(dirname "$0")/../../fuzz"
seconds=${1:-60}
shift || true
targets=("$@")
[ ${#targets[@]} -gt 0 ] || targets=(nifti dicom mesh parameters multipart association)
host=$(rustc -vV | sed -n 's/^host: //p')
features=()
case " ${targets[*]} " in *" multipart "* | *" association "*) features=(--features service) ;; esac
export RUSTC_BOOTSTRAP=1
export RUSTFLAGS="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
-Cllvm-args=-sanitizer-coverage-trace-compares --cfg fuzzing -Zsanitizer=address -Cdebug-assertions"
for target in "${targets[@]}"; do
  cargo build --quiet --release --target "$host" --bin "$target" "${features[@]}"
  mkdir -p "corpus/$target" "artifacts/$target"
  "target/$host/release/$target" "corpus/$target" -artifact_prefix="artifacts/$target/" \
    -max_total_time="$seconds" -max_len=4096 -rss_limit_mb=2048 -timeout=20 -print_final_stats=1
done
