#!/usr/bin/env bash
# Runs the demo to its end in a temporary folder and checks the files it writes.
set -euo pipefail
cd "$(dirname "$0")/../.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
cargo build --quiet --bins --test layering # same features as `cargo test`, see api.sh
said=$(target/debug/ventriform demo --exit --listen 127.0.0.1:0 --output "$out")
echo "$said"
grep -q '^Gated: .*ejection fraction' <<<"$said"
grep -q '^Stress and rest: .*reversible defect' <<<"$said"
[ "$(head -c 4 "$out/lv.glb")" = glTF ]
for page in segmentation beat comparison; do
    grep -q '</html>' "$out/$page.html"
done
