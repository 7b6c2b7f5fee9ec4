#!/usr/bin/env bash
# Generates a Python and a TypeScript client from openapi/ventriform.json and uses both against a service.
#
# PYTHON: an interpreter that has openapi-python-client. NODE_PATH: a folder with openapi-typescript,
# openapi-fetch, typescript and @types/node.
set -euo pipefail
cd "$(dirname "$0")/../.."
[ -n "${SERVICE_URL:-}" ] || exec scripts/with_service.sh scripts/check/clients.sh
python=${PYTHON:-python3}
modules=${NODE_PATH:-node_modules}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
target/debug/ventriform phantom -o "$out/phantom" --size 64 --spacing 6.4 --seed 2 >/dev/null 2>&1
scan=$out/phantom/spect.nii.gz
gated=$out/gated.nii.gz
"$python" scripts/lib/gated_phantom.py "$out/phantom" "$gated"

# The generator has no bodies of multipart/related, and says so for each. They are left out: the same
# operations take bytes.
"$python" - "$out/document.json" <<'PY'
import json, sys
document = json.load(open("openapi/ventriform.json"))
for item in document["paths"].values():
    for operation in item.values():
        if isinstance(operation, dict) and "requestBody" in operation:
            operation["requestBody"]["content"].pop("multipart/related", None)
json.dump(document, open(sys.argv[1], "w"))
PY
"$(dirname "$python")/openapi-python-client" generate --path "$out/document.json" \
  --config scripts/check/clients/openapi-python-client.yaml --meta none --output-path "$out/ventriform_client" >"$out/log" 2>&1
# The generator drops what it cannot read, with a message, and carries on.
if grep -iE 'unable|warning|error|removal|unsupported' "$out/log"; then cat "$out/log"; exit 1; fi
echo "Python:"
PYTHONPATH=$out "$python" scripts/check/clients/try_client.py "$scan" "$gated"

cp scripts/check/clients/try_client.ts "$out/"
ln -s "$modules" "$out/node_modules"
echo '{"type": "module"}' >"$out/package.json"
"$modules/.bin/openapi-typescript" openapi/ventriform.json --default-non-nullable false \
  -o "$out/schema.d.ts" >"$out/log" 2>&1 || { cat "$out/log"; exit 1; }
(cd "$out" && "$modules/.bin/tsc" --strict --noUncheckedIndexedAccess --target es2022 --module esnext \
  --moduleResolution bundler --skipLibCheck --types node --typeRoots "$modules/@types" try_client.ts)
echo "TypeScript:"
node "$out/try_client.js" "$scan" "$gated"
