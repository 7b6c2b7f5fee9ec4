#!/usr/bin/env bash
# Tests the models' guarantees on more random surfaces of each family than CI does.
#
#   scripts/check/sweep.sh [SEEDS] [FAMILY]     default: 100 surfaces of every family
#
# Prints how many models were refused. Exits with an error if a model breaks a guarantee. All families at
# 100 seeds take hours on two cores.
#
# DUMP: a folder to write some of the models to.
set -euo pipefail
cd "$(dirname "$0")/../.."
export VENTRIFORM_SEEDS=${1:-100}
[ -z "${DUMP:-}" ] || export VENTRIFORM_DUMP=$DUMP
exec cargo test --release --package ventriform --test guarantees "${@:2}" -- --nocapture
