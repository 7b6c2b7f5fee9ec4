#!/usr/bin/env bash
# Builds compose.scale.yml, makes a model through its proxy, and takes a replica of each role away.
#
# Not part of scripts/test.sh: it needs docker with compose. IN_ENGINE: a command prefix for curl, for
# machines that cannot reach the published port from outside of the engine's network.
#
#   scripts/release/check_scale.sh
set -euo pipefail
cd "$(dirname "$0")/../.."
export COMPOSE_FILE=compose.scale.yml
out=$(mktemp -d)
trap 'docker compose logs --tail 20 >&2 || true; docker compose down -v >/dev/null 2>&1 || true; rm -rf "$out"' EXIT
url=http://127.0.0.1:8080
# shellcheck disable=SC2086 # IN_ENGINE is a command with its arguments
ask() { ${IN_ENGINE:-} curl -fsS --retry 20 --retry-delay 1 --retry-all-errors "$@"; }

started=$SECONDS
docker compose build
echo "built in $((SECONDS - started)) s"
docker compose up -d
ask "$url/readyz" >/dev/null
chmod 0777 "$out"
docker run --rm -v "$out:/out" ventriform phantom -o /out >/dev/null 2>&1
ask --data-binary @"$out/spect.nii.gz" -H 'Prefer: wait=60' -H 'Accept: model/gltf-binary' \
  "$url/v1/models?points=150" -o "$out/lv.glb"
[ "$(head -c 4 "$out/lv.glb")" = glTF ]

# Either replica of both roles can go; the other one does its work.
count() { docker compose ps -q "$1" | wc -l; }
[ "$(count api)" = 2 ] && [ "$(count worker)" = 2 ]
docker kill "$(docker compose ps -q api | head -1)" "$(docker compose ps -q worker | head -1)" >/dev/null
ask --data-binary @"$out/spect.nii.gz" -H 'Prefer: wait=60' "$url/v1/models?points=120" >"$out/job.json"
grep -q '"state":"succeeded"\|"mesh"' "$out/job.json" || { cat "$out/job.json"; exit 1; }

# Everything is still there after a restart of all of it, the database and the store too.
docker compose restart
ask "$url/v1/models" | grep mdl_ >/dev/null
for id in $(docker compose ps -q api worker); do
  [ "$(docker inspect -f '{{.Config.User}} {{.HostConfig.ReadonlyRootfs}}' "$id")" = "10001:10001 true" ]
done
echo "ok: images built, model made, replicas lost, all restarted, non-root, read-only root"
