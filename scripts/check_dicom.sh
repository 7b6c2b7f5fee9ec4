#!/usr/bin/env bash
# Checks the DICOM objects of `ventriform segment --dicom` by other programs.
#
#   scripts/check_dicom.sh
#
# scripts/check_dicom.py writes NM files of one simulated scan (both signs of Spacing Between Slices, oblique,
# gated), segments them and reads the objects with pydicom, highdicom and dcmqi. dciodvfy (dicom3tools) checks
# every object, dcmdump (dcmtk) reads it. Takes about a minute. Exits with 1 if anything is wrong.
#
# PYTHON: an interpreter that has numpy, nibabel, pydicom, highdicom and dcmqi. Without it the script installs
# them under target/. Debian packages that are missing are installed.
set -euo pipefail
cd "$(dirname "$0")/.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

as_root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi; }
if ! command -v dciodvfy >/dev/null || ! command -v dcmdump >/dev/null; then
  as_root apt-get update -qq
  as_root apt-get install -y -qq --no-install-recommends dicom3tools dcmtk >/dev/null
fi
if [ -z "${PYTHON:-}" ]; then
  tools=target/check-dicom
  PYTHON=$tools/bin/python
  [ -x "$PYTHON" ] || python3 -m venv "$tools"
  "$PYTHON" -c 'import nibabel, highdicom' 2>/dev/null ||
    "$PYTHON" -m pip install --quiet --disable-pip-version-check -r scripts/requirements.txt
fi
[ -x target/debug/ventriform ] || cargo build --quiet --bins --test layering

target/debug/ventriform phantom -o "$out/phantom" --size 64 --spacing 6.4 --seed 2 2>/dev/null
"$PYTHON" scripts/check_dicom.py target/debug/ventriform "$out"

# Output of dciodvfy counts, not its status.
wrong=0
for file in "$out"/*/out/*.dcm; do
  dcmdump -q "$file" >/dev/null || { echo "dcmdump cannot read $file" && wrong=1; }
  found=$(dciodvfy "$file" 2>&1 | grep '^Error' || true)
  [ -z "$found" ] || { echo "$file: $found" && wrong=1; }
done
[ "$wrong" -eq 0 ]
echo "dciodvfy: no error in $(ls "$out"/*/out/*.dcm | wc -l) objects"
