#!/usr/bin/env bash
# Tests the running service with schemathesis: no 500, no undocumented status or body.
#
# The check positive_data_acceptance is off. The service correctly rejects some requests that satisfy the
# schema: random bytes are rarely a volume, and erased resources answer 410.
# Authentication is on: every request carries a key of the scope `admin`, and the check ignored_auth
# sends requests without it and with wrong ones.
# One worker: CPython 3.11 sometimes fails when two threads parse at once ("AST constructor recursion
# depth mismatch").
#
# PYTHON: an interpreter that has schemathesis. EXAMPLES: examples per operation (15).
set -euo pipefail
cd "$(dirname "$0")/../.."
python=${PYTHON:-python3}
[ -n "${SERVICE_URL:-}" ] || SERVICE_FLAGS='--auth-failure-limit 1000000' exec scripts/with_service.sh scripts/check/api.sh
# The service asks for credentials as soon as there is a key; schemathesis checks that it does.
key=$(target/debug/ventriform keys create --name schemathesis --scope admin \
  --requests-per-minute 1000000 --data-dir "$SERVICE_DATA/data" 2>/dev/null)
# What was erased answers 410, whatever the request.
settings=$(mktemp --suffix .toml)
trap 'rm -f "$settings"' EXIT
cat >"$settings" <<'TOML'
[checks.negative_data_rejection]
expected-statuses = ["400", "401", "403", "404", "405", "406", "409", "410", "413", "415", "422", "428", "429", "5xx"]
TOML
try() {
  "$(dirname "$python")/schemathesis" --config-file "$settings" run "$SERVICE_URL/openapi.json" \
    --header "Authorization: Bearer $key" --max-examples "${EXAMPLES:-15}" \
    --workers 1 --seed 1 --suppress-health-check all \
    --exclude-checks positive_data_acceptance --no-color "$@"
}
# Schemathesis makes no bodies of application/dicom and multipart/related, the only ones of STOW-RS;
# scripts/check/intake.sh sends these.
# Revoking keys comes last: it takes ids from answers, among them that of the key of the requests.
try --exclude-operation-id revoke_key --exclude-path-regex '^/dicom-web/studies'
try --include-operation-id revoke_key
