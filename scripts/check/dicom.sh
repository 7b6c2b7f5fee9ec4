#!/usr/bin/env bash
# Checks the DICOM objects of `ventriform segment --dicom` and `ventriform beat --dicom` by other programs.
#
#   scripts/check/dicom.sh                    four ways to store the scan, about a minute
#   scripts/check/dicom.sh --orientations     all 48 orders and directions of the axes
#
# scripts/check/dicom.py writes NM files of one simulated scan (both signs of Spacing Between Slices, oblique,
# gated) and of one simulated beat, segments them and reads the objects with pydicom, highdicom and dcmqi. dciodvfy
# (dicom3tools) checks every object, dcmdump (dcmtk) reads it. scripts/check/names.py compares every character set with
# pydicom. Exits with 1 if anything is wrong.
#
# PYTHON: an interpreter that has numpy, nibabel, pydicom, highdicom and dcmqi. Without it the script installs
# them under target/. Debian packages that are missing are installed.
set -euo pipefail
cd "$(dirname "$0")/../.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

# shellcheck source=scripts/lib/dicom_tools.sh
. scripts/lib/dicom_tools.sh
if ! command -v dciodvfy >/dev/null || ! command -v dcmdump >/dev/null; then
  debian dicom3tools dcmtk
fi
python_with "nibabel, highdicom, fhir.resources"
[ -x target/debug/ventriform ] || cargo build --quiet --bins --test layering

target/debug/ventriform phantom -o "$out/phantom" --size 64 --spacing 6.4 --seed 2 2>/dev/null
"$PYTHON" scripts/check/dicom.py target/debug/ventriform "$out" "$@"
"$PYTHON" scripts/check/names.py target/debug/ventriform "$out/names"

mkdir -p "$out/raw/out"
target/debug/ventriform phantom -o "$out/raw/out" --size 64 --spacing 6.4 --projections --heads 2 2>/dev/null
target/debug/ventriform reconstruct "$out/raw/out/raw.dcm" -o "$out/raw/out/slices.dcm" 2>/dev/null

wrong=0
for file in "$out"/*/out/*.dcm; do
  dcmdump -q "$file" >/dev/null || { echo "dcmdump cannot read $file" && wrong=1; }
done
conform "$out"/*/out/*.dcm || wrong=1
[ "$wrong" -eq 0 ]
