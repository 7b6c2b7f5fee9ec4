#!/usr/bin/env bash
# Checks fetching from and delivering to a real archive: Orthanc with its DICOMweb plug-in.
#
#   scripts/check_pacs.sh
#
# scripts/check_pacs.py starts Orthanc and the service on loopback, stores NM files of one simulated scan
# there, lets the service fetch them, compute and deliver, kills both in between, and compares what the
# archive has. dciodvfy (dicom3tools) checks every delivered object. Takes about a minute. Exits with 1 if
# anything is wrong.
#
# PYTHON: an interpreter that has numpy, nibabel, pydicom, highdicom and dcmqi. Without it the script installs
# them under target/. Debian packages that are missing are installed.
set -euo pipefail
cd "$(dirname "$0")/.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

as_root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi; }
plugin=/usr/share/orthanc/plugins/libOrthancDicomWeb.so
if ! command -v Orthanc >/dev/null || [ ! -e $plugin ] || ! command -v storescu >/dev/null ||
  ! command -v dciodvfy >/dev/null; then
  as_root apt-get update -qq
  as_root apt-get install -y -qq --no-install-recommends orthanc orthanc-dicomweb dcmtk dicom3tools >/dev/null
  # The package starts one of its own.
  as_root service orthanc stop >/dev/null 2>&1 || true
fi
if [ -z "${PYTHON:-}" ]; then
  tools=target/check-dicom
  PYTHON=$tools/bin/python
  [ -x "$PYTHON" ] || python3 -m venv "$tools"
  "$PYTHON" -c 'import nibabel, highdicom' 2>/dev/null ||
    "$PYTHON" -m pip install --quiet --disable-pip-version-check -r scripts/requirements.txt
fi
program=${VENTRIFORM:-target/debug/ventriform}
[ -x "$program" ] || cargo build --quiet --bins --test layering

"$program" phantom -o "$out/phantom" --size 64 --spacing 6.4 --seed 2 2>/dev/null
"$PYTHON" scripts/check_pacs.py "$program" "$out"

# Output of dciodvfy counts, not its status.
wrong=0
for file in "$out"/*/out/*.dcm; do
  found=$(dciodvfy "$file" 2>&1 | grep '^Error' || true)
  [ -z "$found" ] || { echo "$file: $found" && wrong=1; }
done
[ "$wrong" -eq 0 ]
echo "dciodvfy: no error in $(ls "$out"/*/out/*.dcm | wc -l) objects from the archive"
