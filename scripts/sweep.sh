#!/usr/bin/env bash
# The long form of the tests on random surfaces: more seeds of each family than CI takes.
#
#   scripts/sweep.sh [SEEDS] [FAMILY]     100 surfaces of every family by default
#
# Prints how many models were refused. Ends with 1 if any model breaks a promise. Takes hours for
# all families at 100 seeds on two cores; DUMP=DIR writes some of the models there.
set -euo pipefail
cd "$(dirname "$0")/.."
export VENTRIFORM_SEEDS=${1:-100}
[ -z "${DUMP:-}" ] || export VENTRIFORM_DUMP=$DUMP
exec cargo test --release --test guarantees "${@:2}" -- --nocapture
