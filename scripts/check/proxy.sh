#!/usr/bin/env bash
# Checks the service behind nginx with nginx's defaults: no answer is lost on the way, and addresses are right.
#
#   scripts/check/proxy.sh
#
# scripts/check/proxy.py starts nginx and services of its own on loopback. Takes half a minute. Exits with 1 if anything
# is wrong. nginx (Debian's nginx-light) and openssl are installed if they are missing.
set -euo pipefail
cd "$(dirname "$0")/../.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
# The workers of nginx, which are not root, keep bodies there.
chmod 711 "$out"

# shellcheck source=scripts/lib/dicom_tools.sh
. scripts/lib/dicom_tools.sh
command -v nginx >/dev/null || [ -x /usr/sbin/nginx ] || debian nginx-light
command -v openssl >/dev/null || debian openssl
program=${PROGRAM:-target/debug/ventriform}
[ -x "$program" ] || cargo build --quiet --bins --test layering

PATH=$PATH:/usr/sbin "${PYTHON:-python3}" scripts/check/proxy.py "$program" "$out"
