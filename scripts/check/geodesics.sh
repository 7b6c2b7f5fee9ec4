#!/usr/bin/env bash
# Compares exact geodesic distances on random surfaces with pygeodesic's.
#
#   scripts/check/geodesics.sh [SURFACES]
#
# PYTHON: an interpreter that has numpy and pygeodesic.
set -euo pipefail
cd "$(dirname "$0")/../.."
cargo build --quiet --package ventriform-program --package ventriform-evaluation --bin geodesics --test layering
exec "${PYTHON:-python3}" scripts/check/geodesics.py target/debug/geodesics "$@"
