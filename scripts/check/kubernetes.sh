#!/usr/bin/env bash
# Renders deploy/kubernetes as kubectl does, and checks it against the schemas of Kubernetes and the rules below.
#
#   scripts/check/kubernetes.sh
#
# PYTHON: an interpreter that has kubernetes_validate. Takes seconds. Exits with 1 if something is wrong.
set -euo pipefail
cd "$(dirname "$0")/../.."

# shellcheck source=scripts/lib/dicom_tools.sh
. scripts/lib/dicom_tools.sh
python_with kubernetes_validate
command -v kubectl >/dev/null || debian kubernetes-client
program=${PROGRAM:-target/debug/ventriform}
[ -x "$program" ] || cargo build --quiet --bins
kubectl kustomize deploy/kubernetes | "$PYTHON" scripts/check/kubernetes.py "$program"
