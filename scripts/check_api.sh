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
cd "$(dirname "$0")/.."
python=${PYTHON:-python3}
data=$(mktemp -d)
# Naming a test gives the libraries the same features as `cargo test` does. Without it cargo would
# compile them and the program a second time.
cargo build --quiet --bins --test layering
# The service asks for credentials as soon as there is a key; schemathesis checks that it does.
key=$(target/debug/ventriform keys create --name schemathesis --scope admin \
  --requests-per-minute 1000000 --data-dir "$data" 2>/dev/null)
target/debug/ventriform serve --auth-failure-limit 1000000 --listen 127.0.0.1:0 --data-dir "$data" >"$data/log" 2>&1 &
service=$!
trap 'kill $service 2>/dev/null; wait $service 2>/dev/null; rm -rf "$data"' EXIT
for _ in $(seq 100); do
  url=$(grep -o 'http://127[0-9.:]*' "$data/log" | head -n 1 || true)
  [ -n "$url" ] && break
  sleep 0.1
done
[ -n "$url" ] || { cat "$data/log"; exit 1; }
try() {
  "$(dirname "$python")/schemathesis" run "$url/openapi.json" \
    --header "Authorization: Bearer $key" --max-examples "${EXAMPLES:-15}" \
    --workers 1 --seed 1 --suppress-health-check all \
    --exclude-checks positive_data_acceptance --no-color "$@"
}
# Revoking keys comes last: it takes ids from answers, among them that of the key of the requests.
try --exclude-operation-id revoke_key
try --include-operation-id revoke_key
kill -0 "$service"
