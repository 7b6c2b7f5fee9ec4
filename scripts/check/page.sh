#!/usr/bin/env bash
# Tests the page in Debian's Chromium: from an upload to a corrected fit, at two widths, light and dark.
#
#   scripts/check/page.sh             against a service of its own
#   scripts/check/page.sh --bundle    also makes web/src/generated, web/dist and the script of reports anew and compares
#                                     them with what is committed
#   scripts/check/page.sh NAME        only the checks with NAME in their name
#
# The time from a correction to its new contours, with a program built for speed and nothing else running:
#   PROGRAM=target/release/ventriform scripts/check/page.sh "fitted again"
#
# Screenshots of every view are kept in target/page. Needs node, npm and chromium.
set -euo pipefail
cd "$(dirname "$0")/../.."
# The packages are laid under target/, so that the sources stay clean.
tools=$PWD/target/test-tools/web
mkdir -p "$tools"
assets=crates/ventriform/assets
built=$tools/../$assets
rm -rf "$tools/src" "$tools/tests" "$built"
mkdir -p "$built"
cp "$assets/uptake.json" "$assets/figures.json" "$built/"
mkdir -p "$tools/../openapi"
cp openapi/ventriform.json "$tools/../openapi/"
cp -r web/package.json web/package-lock.json web/types.mjs web/tsconfig.json web/vite.config.ts web/index.html web/src web/tests "$tools/"
# Not `npm ci`: it refuses a lock file without the packages for other systems, which npm leaves out where a
# registry does not have them. What the lock file names is installed in that version.
if ! cmp -s web/package-lock.json "$tools/installed"; then
  (cd "$tools" && npm install --silent --no-fund --no-audit)
  cp web/package-lock.json "$tools/installed"
fi
if [ "${1:-}" = --bundle ]; then
  (cd "$tools" && npm run --silent types)
  diff -r "$tools/src/generated" web/src/generated ||
    { echo "web/src/generated is not what openapi/ventriform.json gives: cd web && npm ci && npm run types"; exit 1; }
  (cd "$tools" && rm -rf dist && npx tsc --noEmit && npm run --silent build)
  shift
  diff -r "$tools/dist" web/dist && diff -r "$built" "$assets" ||
    { echo "web/dist and $assets are not what web/src gives: cd web && npm ci && npm run build"; exit 1; }
fi
rm -rf target/page && mkdir -p target/page
export PROGRAM=$(realpath -m "${PROGRAM:-target/debug/ventriform}") SCREENSHOTS=$PWD/target/page CHROMIUM=${CHROMIUM:-/usr/bin/chromium}
[ -x "$PROGRAM" ] || cargo build --quiet --bins --test layering
"$PROGRAM" phantom -o "$SCREENSHOTS/phantom" >/dev/null
node "$tools/tests/page.mjs" "$@"
