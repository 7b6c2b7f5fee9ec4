#!/usr/bin/env bash
# Makes the README's pictures anew: the page with a fitted phantom, and the fitted wall in three dimensions.
#
#   scripts/release/pictures.sh        writes docs/pictures/page.png and docs/pictures/wall.png
#
# PROGRAM: a program that is built already; CHROMIUM: a browser. Needs node, npm, chromium and pngquant (Debian
# packages).
set -euo pipefail
cd "$(dirname "$0")/../.."
missing=()
for name in node npm chromium pngquant; do
  command -v "$name" >/dev/null || missing+=("${name/#node/nodejs}")
done
[ ${#missing[@]} -eq 0 ] || { apt-get update -qq && apt-get install -y -qq "${missing[@]}"; } >/dev/null
tools=$PWD/target/test-tools/pictures
mkdir -p "$tools" docs/pictures
cp web/package.json web/package-lock.json scripts/release/pictures.mjs web/tests/service.mjs "$tools/"
[ -d "$tools/node_modules/playwright-core" ] || (cd "$tools" && npm install --silent --no-fund --no-audit)
export PROGRAM=$(realpath -m "${PROGRAM:-target/debug/ventriform}") CHROMIUM=${CHROMIUM:-/usr/bin/chromium} PICTURES=$PWD/docs/pictures
[ -x "$PROGRAM" ] || cargo build --quiet --bins
node "$tools/pictures.mjs"
# 64 colours are enough for both, and a picture stays below 150 kB.
for name in page wall; do
  pngquant --force --skip-if-larger --strip --output "$PICTURES/$name.png" 96 "$PICTURES/$name.png"
done
ls -l "$PICTURES"
