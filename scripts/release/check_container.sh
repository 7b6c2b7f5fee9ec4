#!/usr/bin/env bash
# Builds the image, starts the service with docker compose and makes a model through it.
#
#   scripts/release/check_container.sh [TARBALL]      TARBALL: an image of scripts/release.sh, which is loaded and not
#                                                     built
#
# Not part of scripts/test.sh: it needs docker with compose. IN_ENGINE: a command prefix for curl, for
# machines that cannot reach the published port from outside of the engine's network.
set -euo pipefail
tarball=${1:+$(realpath "$1")}
cd "$(dirname "$0")/../.."
out=$(mktemp -d)
trap 'docker compose logs --tail 20 >&2 || true; docker compose down -v >/dev/null 2>&1 || true; rm -rf "$out"' EXIT
url=http://127.0.0.1:8080
# Not `grep -q` after a pipe: it ends at the first match, and whoever still writes then fails.

started=$SECONDS
if [ -n "$tarball" ]; then
  docker tag "$(docker load --quiet --input "$tarball" | sed -n 's/^Loaded image: //p')" ventriform
  echo "loaded in $((SECONDS - started)) s"
else
  docker compose build
  echo "built in $((SECONDS - started)) s"
fi
docker compose up -d --wait --no-build
# The image's own program makes the scan.
chmod 0777 "$out"
docker run --rm -v "$out:/out" ventriform phantom -o /out >/dev/null 2>&1
# shellcheck disable=SC2086 # IN_ENGINE is a command with its arguments
${IN_ENGINE:-} curl -fsS --data-binary @"$out/spect.nii.gz" -H 'Prefer: wait=60' \
  -H 'Accept: model/gltf-binary' "$url/v1/models?points=150" -o "$out/lv.glb"
[ "$(head -c 4 "$out/lv.glb")" = glTF ]

# The model survives a restart of the container.
docker compose restart
docker compose up -d --wait
# shellcheck disable=SC2086
${IN_ENGINE:-} curl -fsS "$url/v1/models" | grep mdl_ >/dev/null

id=$(docker compose ps -q ventriform)
user=$(docker inspect -f '{{.Config.User}}' "$id")
readonly_root=$(docker inspect -f '{{.HostConfig.ReadonlyRootfs}}' "$id")
[ "$user" = 10001:10001 ] && [ "$readonly_root" = true ]
# Without a health check of the image, --wait above would wait for nothing but the start.
[ "$(docker inspect -f '{{.State.Health.Status}}' "$id")" = healthy ]
# Nothing but the volume and /tmp can be written.
docker compose exec -T ventriform sh -c '! touch /usr/local/bin/x 2>/dev/null && touch /data/x && rm /data/x'
docker compose exec -T ventriform cat /usr/share/doc/ventriform/ventriform.cdx.json | grep CycloneDX >/dev/null
if [ -n "$tarball" ]; then docker compose exec -T ventriform grep -q Apache-2.0 /usr/share/doc/ventriform/THIRD-PARTY; fi

# With keys, callers without one are refused, and the container is still healthy.
key=$(docker compose exec -T ventriform ventriform keys create --name check --scope read 2>/dev/null)
VENTRIFORM_ALLOW_ANONYMOUS=false docker compose up -d --wait
# shellcheck disable=SC2086
code=$(${IN_ENGINE:-} curl -sS -o /dev/null -w '%{http_code}' "$url/v1/models")
[ "$code" = 401 ] || { echo "without a key: $code"; exit 1; }
# shellcheck disable=SC2086
${IN_ENGINE:-} curl -fsS -H "Authorization: Bearer $key" "$url/v1/models" | grep mdl_ >/dev/null
docker image ls ventriform
echo "ok: image ready, model made, restarted, non-root, read-only root, keys"
