#!/usr/bin/env bash
# Compares the codecs of compressed DICOM with other decoders, over the options of each.
#
#   scripts/check/dicom_codecs.sh       some hundred frames, under a minute
#
# scripts/check/dicom_codecs.py encodes images (RLE, JPEG, JPEG-LS, JPEG 2000, deflated), reads the files by
# target/debug/voxels, and compares the voxels with the image or with what GDCM, CharLS, OpenJPEG and
# libjpeg-turbo decode. Frames that contradict their transfer syntax must be refused. Exits with 1 if anything
# is wrong.
#
# PYTHON: an interpreter that has the packages of scripts/requirements.txt. Without it the script installs those
# it needs under target/. PROGRAM: the example `voxels`.
set -euo pipefail
cd "$(dirname "$0")/../.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

if [ -z "${PYTHON:-}" ]; then
  tools=$PWD/target/check-codecs
  PYTHON=$tools/bin/python
  [ -x "$PYTHON" ] || python3 -m venv "$tools"
  "$PYTHON" -c 'import pydicom, gdcm, imagecodecs, PIL, openjpeg' 2>/dev/null ||
    grep -E '^(numpy|pydicom|python-gdcm|imagecodecs|pillow|pylibjpeg-openjpeg)==' scripts/requirements.txt |
      xargs "$PYTHON" -m pip install --quiet --disable-pip-version-check
fi
PROGRAM=${PROGRAM:-target/debug/voxels}
[ -x "$PROGRAM" ] || cargo build --quiet --package ventriform-program --package ventriform-evaluation --bin voxels --test layering
"$PYTHON" scripts/check/dicom_codecs.py "$PROGRAM" "$out"
