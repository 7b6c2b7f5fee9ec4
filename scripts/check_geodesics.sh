#!/usr/bin/env bash
# Compares exact geodesics on random surfaces with pygeodesic.
#
#   scripts/check_geodesics.sh [SURFACES]
#
# PYTHON: an interpreter that has numpy and pygeodesic.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --quiet --example geodesics
exec "${PYTHON:-python3}" scripts/check_geodesics.py target/debug/examples/geodesics "$@"
