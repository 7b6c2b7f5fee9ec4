#!/usr/bin/env bash
# Checks the C-STORE SCP and STOW-RS by other programs: storescu and echoscu (dcmtk), pynetdicom, dicomweb-client.
#
#   scripts/check/intake.sh
#
# scripts/check/intake.py starts the service on a folder of its own, sends objects in every way that docs/pacs.md
# names, kills the service between objects, and sends garbage. Takes about a minute. Exits with 1 if anything is
# wrong.
#
# PYTHON: an interpreter that has numpy, pydicom, pynetdicom and dicomweb-client. Without it the script installs
# them under target/. dcmtk (Debian) is installed if it is missing.
set -euo pipefail
cd "$(dirname "$0")/../.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

# shellcheck source=scripts/lib/dicom_tools.sh
. scripts/lib/dicom_tools.sh
command -v storescu >/dev/null || debian dcmtk
python_with "pynetdicom, dicomweb_client"
[ -x target/debug/ventriform ] || cargo build --quiet --bins --test layering

"$PYTHON" scripts/check/intake.py target/debug/ventriform "$out"
