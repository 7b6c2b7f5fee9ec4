#!/usr/bin/env bash
# Tests the page in Debian's Chromium: from an upload to a corrected fit, at two widths, light and dark.
#
#   scripts/check/page.sh         against a service of its own
#   scripts/check/page.sh NAME    only the checks with NAME in their name
#
# The time from a correction to its new contours, with a program built for speed and nothing else running:
#   PROGRAM=target/release/ventriform scripts/check/page.sh "fitted again"
#
# Screenshots of every view are kept in target/page. Needs node, npm and chromium.
set -euo pipefail
cd "$(dirname "$0")/../.."
. scripts/lib/tools.sh
web_sources openapi/ventriform.json
rm -rf target/page && mkdir -p target/page
export PROGRAM=$(realpath -m "${PROGRAM:-target/debug/ventriform}") SCREENSHOTS=$PWD/target/page CHROMIUM=${CHROMIUM:-/usr/bin/chromium}
[ -x "$PROGRAM" ] || cargo build --quiet --bins --test layering
"$PROGRAM" phantom -o "$SCREENSHOTS/phantom" >/dev/null
node "$web_tools/tests/page.mjs" "$@"
