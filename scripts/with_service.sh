#!/usr/bin/env bash
# Runs a command while a service of its own listens, and fails if the service did not survive it.
#
#   scripts/with_service.sh COMMAND...      SERVICE_URL and SERVICE_DATA (its folder) are set for the command
#
# SERVICE_FLAGS: further flags of `ventriform serve`. PROGRAM: a program that is built already.
set -euo pipefail
cd "$(dirname "$0")/.."
SERVICE_DATA=$(mktemp -d)
# Naming a test gives the libraries the same features as `cargo test` does. Without it cargo would
# compile them and the program a second time.
[ -n "${PROGRAM:-}" ] || cargo build --quiet --bins --test layering
# shellcheck disable=SC2086 # several flags
"${PROGRAM:-target/debug/ventriform}" serve --listen 127.0.0.1:0 --data-dir "$SERVICE_DATA/data" ${SERVICE_FLAGS:-} \
  >"$SERVICE_DATA/log" 2>&1 &
service=$!
trap 'kill $service 2>/dev/null; wait $service 2>/dev/null; rm -rf "$SERVICE_DATA"' EXIT
for _ in $(seq 600); do
  SERVICE_URL=$(grep -o 'http://127[0-9.:]*' "$SERVICE_DATA/log" | head -n 1 || true)
  [ -n "$SERVICE_URL" ] && break
  sleep 0.1
done
[ -n "$SERVICE_URL" ] || { cat "$SERVICE_DATA/log"; exit 1; }
export SERVICE_URL SERVICE_DATA
"$@"
kill -0 "$service"
