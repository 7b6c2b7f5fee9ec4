#!/usr/bin/env bash
# Backs up and restores the named volume of docker-compose.yml by the commands of docs/operations.md, which are read
# from the page: a model that was acknowledged before the backup is there after the restore, and what came later is not.
#
# Not part of scripts/test.sh: it needs docker with compose. IN_ENGINE: a command prefix for curl, for machines that
# cannot reach the published port from outside of the engine's network. IMAGE: an image that was built before, else it
# is built.
#
#   scripts/release/check_backup.sh
set -euo pipefail
cd "$(dirname "$0")/../.."
export COMPOSE_PROJECT_NAME=ventriform
page=$PWD/docs/operations.md
out=$(mktemp -d)
trap 'docker compose logs --tail 20 >&2 || true; docker compose down -v >/dev/null 2>&1 || true; rm -rf "$out"' EXIT
url=http://127.0.0.1:8080
# shellcheck disable=SC2086 # IN_ENGINE is a command with its arguments
ask() { ${IN_ENGINE:-} curl -fsS --retry 40 --retry-delay 1 --retry-all-errors "$@"; }

if [ -n "${IMAGE:-}" ]; then docker tag "$IMAGE" ventriform; else docker compose build; fi
docker compose up --detach --wait --no-build
chmod 0777 "$out"
docker run --rm -v "$out:/out" ventriform phantom -o /out >/dev/null 2>&1
auth=()
model() { # model SEED: makes one, and says its id
  ask "${auth[@]}" -o /dev/null --data-binary @"$out/spect.nii.gz" -H 'Prefer: wait=60' "$url/v1/models?points=150&seed=$1"
  ask "${auth[@]}" "$url/v1/models?limit=1" | grep -o 'mdl_[0-9a-f]*' | head -1
}
kept=$(model 1)
key=$(docker compose exec -T ventriform ventriform keys create --name kept --scope admin 2>/dev/null)
auth=(-H "Authorization: Bearer $key")
digest() { ask "${auth[@]}" "$url/v1/models/$1/mesh.stl" | sha256sum; }
before=$(digest "$kept")

# The commands of the page: the block that begins with the stop of the service.
commands() { # commands PART: those before or after the line about restoring
  awk -v part="$1" '/^```sh$/ { on = 1; text = ""; next } /^```$/ { if (on && text ~ /docker compose stop ventriform/) print text; on = 0 }
    on { text = text $0 "\n" }' "$page" |
    awk -v part="$1" '/^# Restore/ { after = 1; next } (part == "backup") == !after' | sed -e '/^$/d' -e "s/2026-11-01/$(date +%F)/"
}
cd "$out"
export COMPOSE_FILE=$OLDPWD/docker-compose.yml
echo "--- backup"; commands backup | tee backup.sh
bash -eux backup.sh
later=$(model 2)
[ "$later" != "$kept" ]
# As after a disk that was lost: nothing of the volume is left.
echo "--- restore"; commands restore | tee restore.sh
bash -eux restore.sh
ask "$url/readyz" >/dev/null
[ "$(digest "$kept")" = "$before" ] || { echo "the model is another one"; exit 1; }
code=$(${IN_ENGINE:-} curl -sS -o /dev/null -w '%{http_code}' "${auth[@]}" "$url/v1/models/$later")
[ "$code" = 404 ] || { echo "what came after the backup: $code"; exit 1; }
# It can be written, and the files belong to the image's user.
[ "$(model 3)" != "$kept" ]
owners=$(docker compose exec -T ventriform find /data ! -user 10001 | wc -l)
[ "$owners" = 0 ] || { echo "$owners files belong to somebody else"; exit 1; }
docker compose exec -T ventriform ventriform audit verify
echo "ok: backed up and restored by the page's commands"
