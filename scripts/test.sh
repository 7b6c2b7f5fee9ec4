#!/usr/bin/env bash
# Installs what the tests need and passes them all. The last line counts:
#   N passed, N failed, N skipped
#
#   scripts/test.sh            everything
#   scripts/test.sh --quick    without the outside judges (trimesh, vtk, glTF validator, pygeodesic, schemathesis)
set -uo pipefail
cd "$(dirname "$0")/.."

quick=${1:-}
tools=$PWD/target/test-tools
log=$PWD/target/test-log.txt
mkdir -p "$tools"
: >"$log"
passed=0 failed=0 skipped=0

say() { printf '\n== %s\n' "$*"; }

# tell NAME STATUS: counts one check.
tell() {
  if [ "$2" -eq 0 ]; then
    passed=$((passed + 1)) && echo "ok: $1"
  else
    failed=$((failed + 1)) && echo "FAILED: $1"
  fi
}

# check NAME COMMAND...: one counted check.
check() {
  say "$1"
  "${@:2}"
  tell "$1" $?
}

# A check that runs beside others: `start ID COMMAND...` begins it, `settle ID NAME` waits for it,
# shows what it printed and counts it.
declare -A running
start() {
  "${@:2}" >"$tools/$1.log" 2>&1 &
  running[$1]=$!
}
settle() {
  wait "${running[$1]}"
  local status=$?
  say "$2"
  cat "$tools/$1.log"
  tell "$2" $status
}

finish() {
  echo
  echo "$passed passed, $failed failed, $skipped skipped"
  [ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
  exit
}

# --- what the machine needs -------------------------------------------------------------
as_root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi; }

need() { # need COMMAND PACKAGE...: installs the packages where the command is missing
  command -v "$1" >/dev/null 2>&1 && return
  shift
  as_root apt-get update -qq && as_root apt-get install -y -qq --no-install-recommends "$@"
}

install_judges() {
  need node nodejs npm
  need npm npm
  python3 -c 'import ensurepip, venv' 2>/dev/null || need no-such-command python3 python3-venv python3-pip
  if ! cmp -s scripts/requirements.txt "$tools/python.done"; then
    python3 -m venv "$tools/python" &&
      "$tools/python/bin/pip" install -q -r scripts/requirements.txt &&
      cp scripts/requirements.txt "$tools/python.done"
  fi
  [ -e "$tools/node_modules/gltf-validator" ] ||
    npm install --silent --no-fund --no-audit --prefix "$tools" gltf-validator@2.0.0-dev.3.10
}

need cc build-essential
command -v cargo >/dev/null || { echo "cargo is missing: install Rust 1.95 or newer"; failed=1; finish; }
# Downloads need little of the processor: they run while the library compiles.
[ "$quick" = --quick ] || start install install_judges

# --- the project's own tests ------------------------------------------------------------
check "format" cargo fmt --check
check "clippy" cargo clippy --quiet --all-targets -- -D warnings
check "documentation" env RUSTDOCFLAGS="-D warnings -A rustdoc::private-intra-doc-links" cargo doc --quiet --no-deps --document-private-items

say "cargo test"
cargo test --no-fail-fast -- --show-output 2>&1 | tee "$log"
cargo_status=${PIPESTATUS[0]}
read -r p f i < <(awk '/^test result:/ { p += $4; f += $6; i += $8 } END { print p + 0, f + 0, i + 0 }' "$log")
# A test that lacks its data says `skipped: why` and returns; the harness counts it as passed.
s=$(grep -c '^skipped: ' "$log")
passed=$((passed + p - s)) failed=$((failed + f)) skipped=$((skipped + i + s))
if [ "$cargo_status" -ne 0 ] && [ "$f" -eq 0 ]; then failed=$((failed + 1)); fi

# --- outside judges ---------------------------------------------------------------------
if [ "$quick" = --quick ]; then finish; fi
if wait "${running[install]}"; then
  export PYTHON=$tools/python/bin/python NODE_PATH=$tools/node_modules
  # Built once, with the features that `cargo test` gives the libraries: the judges run side by side.
  cargo build --quiet --bins --examples --test layering
  start formats scripts/check_formats.sh
  start geodesics scripts/check_geodesics.sh
  start api scripts/check_api.sh
  settle formats "formats read back by trimesh, vtk and the glTF validator"
  settle geodesics "geodesics compared with pygeodesic"
  settle api "schemathesis against the running service"
else
  cat "$tools/install.log"
  echo "the outside judges could not be installed"
  failed=$((failed + 1))
fi
check "the demo runs through" scripts/check_demo.sh
finish
