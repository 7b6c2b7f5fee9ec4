#!/usr/bin/env bash
# Changes the code that makes and fits models in one place at a time, and tells which changes no test notices.
#
#   scripts/check/mutants.sh [SIZE] [OFFSET]    SIZE mutants (100) from number OFFSET (0) on, in a random order
#   scripts/check/mutants.sh all                all of them: many hours
#   scripts/check/mutants.sh only REGEX         those whose names match
#
# Mutants come from cargo-mutants (installed if it is missing) and are made in a clone of the last commit, under
# target/mutants. All of them are in one build, each behind a switch (scripts/check/mutants.py), and each is tested by
# the library's own tests, the domain tests and the commands' tests that enter the changed function, until one fails.
# The quality gate is one of them.
#
# Prints the mutants missed, those of them that scripts/check/mutants_accepted.txt accepts, and the share caught; writes
# one JSON line for each mutant to target/mutants/results.jsonl. Exits with an error if a mutant was missed that is not
# accepted.
#
# FAST: most seconds of tests for one mutant (no limit). What they do not notice counts as missed.
set -euo pipefail
cd "$(dirname "$0")/../.."
work=$PWD/target/mutants
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$work/build}

case ${1:-100} in
all) choice=(--all) ;;
only) choice=(--only "$2") ;;
*) choice=(--size "${1:-100}" --offset "${2:-0}") ;;
esac
[ -z "${FAST:-}" ] || choice+=(--fast "$FAST")

cargo mutants --version >/dev/null 2>&1 || cargo install --quiet --locked cargo-mutants
for clone in clean tree; do
    [ -d "$work/$clone" ] || git clone --quiet --shared --no-checkout . "$work/$clone"
    git -C "$work/$clone" fetch --quiet "$PWD" HEAD
    if [ ! -f "$work/$clone/Cargo.toml" ] ||
        [ "$(git -C "$work/$clone" rev-parse HEAD)" != "$(git rev-parse HEAD)" ]; then
        git -C "$work/$clone" checkout --quiet --force --detach FETCH_HEAD
    fi
done

python3 -B scripts/check/mutants.py "$work/clean" "$work/tree" "$work/results.jsonl" "${choice[@]}"
