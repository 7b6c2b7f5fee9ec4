#!/usr/bin/env bash
# Runs the tests of the S3 store over moto, a second S3 server; `cargo test` runs them over s3s-fs.
#
#   scripts/check/s3.sh            the contract, the service over S3, a failing network
#   scripts/check/s3.sh --all      every test of the service, its files in S3
#
# PYTHON: an interpreter that has moto. Without it the script installs moto under target/. Takes seconds, with
# --all minutes. Exits with 1 if a test fails.
set -euo pipefail
cd "$(dirname "$0")/../.."

# shellcheck source=scripts/lib/dicom_tools.sh
. scripts/lib/dicom_tools.sh
python_with moto

port=$("$PYTHON" -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
"$PYTHON" -m moto.server -H 127.0.0.1 -p "$port" >/dev/null 2>&1 &
moto=$!
trap 'kill $moto' EXIT
export VENTRIFORM_TEST_S3=http://127.0.0.1:$port
for _ in $(seq 300); do
  if curl -fs -X PUT "$VENTRIFORM_TEST_S3/hearts" >/dev/null; then break; fi
  sleep 0.2
done
if [ "${1:-}" = --all ]; then
  export VENTRIFORM_TEST_BLOBS=s3
  cargo test --test api
else
  cargo test --test api s3::
fi
