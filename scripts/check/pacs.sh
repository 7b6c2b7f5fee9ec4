#!/usr/bin/env bash
# Checks fetching from and delivering to a real archive: Orthanc with its DICOMweb plug-in.
#
#   scripts/check/pacs.sh
#
# scripts/check/pacs.py starts Orthanc and the service on loopback, stores NM files of one simulated scan
# there, lets the service fetch them, compute and deliver, kills both in between, and compares what the
# archive has. Then it lets Orthanc send to the service. dciodvfy (dicom3tools) checks every delivered object.
# Takes about a minute. Exits with 1 if anything is wrong.
#
# PYTHON: an interpreter that has numpy, nibabel, pydicom, highdicom and dcmqi. Without it the script installs
# them under target/. Debian packages that are missing are installed.
set -euo pipefail
cd "$(dirname "$0")/../.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

# shellcheck source=scripts/lib/dicom_tools.sh
. scripts/lib/dicom_tools.sh
plugin=/usr/share/orthanc/plugins/libOrthancDicomWeb.so
if ! command -v Orthanc >/dev/null || [ ! -e $plugin ] || ! command -v storescu >/dev/null ||
  ! command -v dciodvfy >/dev/null; then
  debian orthanc orthanc-dicomweb dcmtk dicom3tools
  # The package starts one of its own.
  as_root service orthanc stop >/dev/null 2>&1 || true
fi
python_with "nibabel, highdicom, fhir.resources"
program=${VENTRIFORM:-target/debug/ventriform}
[ -x "$program" ] || cargo build --quiet --bins --test layering

"$program" phantom -o "$out/phantom" --size 64 --spacing 6.4 --seed 2 2>/dev/null
"$PYTHON" scripts/check/pacs.py "$program" "$out"

conform "$out"/*/out/*.dcm
