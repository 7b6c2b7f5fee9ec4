#!/usr/bin/env bash
# Lets every single write of the service fail in turn, and simulates 40 power cuts. About half an
# hour on two cores; CI runs a sample (tests/api/faults.rs). Stops by itself.
set -euo pipefail
cd "$(dirname "$0")/../.."
VENTRIFORM_TEST_FAULTS=all timeout 7200 cargo test --test api -- faults --nocapture
