#!/usr/bin/env bash
# Installs what the tests need and runs them all. The last line is the count:
#   N passed, N failed, N skipped
#
#   scripts/test.sh            everything
#   scripts/test.sh --quick    without the demo and the external checks (trimesh, vtk, glTF validator,
#                              pygeodesic, schemathesis, the page in a browser, the Python package, generated clients, kills, DICOM, Orthanc,
#                              commands of the docs, generated files, licences, the site of the docs)
set -uo pipefail
cd "$(dirname "$0")/.."

quick=${1:-}
. scripts/lib/tools.sh
tools=$test_tools
log=$PWD/target/test-log.txt
mkdir -p "$tools"
: >"$log"
passed=0 failed=0 skipped=0 checks=0
failures=() failed_logs=()

say() { printf '\n== %s (after %d s)\n' "$*" "$SECONDS"; }

# count NAME STATUS [LOG]: prints the result of a check and counts it as passed or failed; LOG holds what it printed.
count() {
  if [ "$2" -eq 0 ]; then
    passed=$((passed + 1)) && echo "ok: $1"
  else
    failed=$((failed + 1)) && echo "FAILED: $1"
    failures+=("$1")
    [ -z "${3:-}" ] || failed_logs+=("$3")
  fi
}

# check NAME COMMAND...: runs the command and counts it.
check() {
  say "$1"
  local printed=$tools/check-$((++checks)).log
  timed "$@" 2>&1 | tee "$printed"
  count "$1" "${PIPESTATUS[0]}" "$printed"
}
# timed NAME COMMAND...: runs the command, and prints how long it took.
timed() {
  local TIMEFORMAT="($1: %0R s, %0U + %0S s of processor time)"
  time "${@:2}"
}

# Checks in parallel. `start ID COMMAND...` runs a check in the background, as soon as fewer than AT_ONCE run: with all
# at once each would take ten times as long, and what it waits for too. `collect ID NAME` waits for it, prints its
# output and counts it.
AT_ONCE=6
declare -A running
start() {
  while [ "$(jobs -rp | wc -l)" -ge $AT_ONCE ]; do sleep 0.2; done
  timed "$@" >"$tools/$1.log" 2>&1 &
  running[$1]=$!
}
collect() {
  wait "${running[$1]}"
  local status=$?
  say "$2"
  cat "$tools/$1.log"
  count "$2" $status "$tools/$1.log"
}

# Names all that failed once more, with what it printed: the end of a long log is read first.
finish() {
  echo
  local failed_log
  for failed_log in "${failed_logs[@]}"; do tail -n 60 "$failed_log"; done
  # The second of cargo's two lists for each program, after "failures:", has names alone.
  awk '/^failures:$/ { shown = 1 } /^test result:/ { shown = 0 } shown' "$log"
  [ ${#failures[@]} -eq 0 ] || printf 'FAILED: %s\n' "${failures[@]}"
  echo "$passed passed, $failed failed, $skipped skipped"
  [ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
  exit
}

# --- tools ------------------------------------------------------------------------------
as_root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi; }

need() { # need COMMAND PACKAGE...: installs the packages if the command is missing
  command -v "$1" >/dev/null 2>&1 && return
  shift
  as_root apt-get update -qq && as_root apt-get install -y -qq --no-install-recommends "$@"
}

install_external_tools() {
  need dciodvfy dicom3tools dcmtk
  need chromium chromium fonts-dejavu-core
  need ip iproute2
  need openssl openssl
  [ -x /usr/sbin/nginx ] || need nginx nginx-light
  [ -x /usr/sbin/pgbouncer ] || need pgbouncer pgbouncer
  need promtool prometheus
  need kubectl kubernetes-client
  python3 -c 'import ensurepip, venv' 2>/dev/null || need no-such-command python3 python3-venv python3-pip
  python_tools || return
  scripts/check/python.sh --install || return
  if ! cmp -s scripts/package.json "$tools/node.done"; then
    cp scripts/package.json "$tools/package.json" &&
      npm install --silent --no-fund --no-audit --prefix "$tools" &&
      cp scripts/package.json "$tools/node.done"
  fi
}

# The library without the service compiles, and depends on none of the service's crates.
library_alone() {
  cargo clippy --quiet --package ventriform --lib -- -D warnings &&
    ! cargo tree --package ventriform --edges normal --prefix none | grep -E '^(axum|tokio|sqlx|reqwest) '
}

# Every program of tests, as FOLDER<tab>PROGRAM, with the folder in which cargo would start it.
test_programs() {
  # By targets: the programs of developers have no tests in them, and are many to link.
  cargo test --workspace --exclude ventriform-python --lib --bin ventriform --test '*' --no-run \
    --message-format=json-render-diagnostics |
    sed -nE 's/.*"manifest_path":"([^"]*)\/Cargo.toml".*"profile":\{[^}]*"test":true\}.*"executable":"([^"]+)".*/\1\t\2/p'
}
# Runs the programs named on standard input one after another.
run_programs() {
  local folder program status=0
  while IFS=$'\t' read -r folder program; do
    printf '\n     Running %s\n' "${program#"$PWD/"}"
    (cd "$folder" && exec "$program" --show-output) </dev/null || status=1
  done
  return $status
}

need cc build-essential
need npm nodejs npm
python3 -c 'import ensurepip, venv' 2>/dev/null || need no-such-command python3 python3-venv python3-pip
# The tests start a server of their own; Debian keeps its programs off the path.
ls /usr/lib/postgresql/*/bin/initdb >/dev/null 2>&1 || need no-such-command postgresql
command -v cargo >/dev/null || { echo "cargo not found: install Rust 1.95 or newer"; failed=1; finish; }
# Downloads take little processor time, so they run while the library compiles.
[ "$quick" = --quick ] || start install install_external_tools

# --- the project's own tests ------------------------------------------------------------
check "format" cargo fmt --check
check "format and lint of scripts and package (ruff)" scripts/check/style.sh python
check "format and lint of the page (biome)" scripts/check/style.sh web
check "clippy" cargo clippy --quiet --workspace --all-targets -- -D warnings
check "library without the service" library_alone
check "documentation" env RUSTDOCFLAGS="-D warnings -A rustdoc::private-intra-doc-links" cargo doc --quiet --no-deps --document-private-items

say "cargo test"
test_programs >"$tools/programs"
cargo_status=$?
# Side by side: the library's tests compute all the time, the service's wait for half of theirs.
grep -F "$PWD/crates/ventriform	" "$tools/programs" | run_programs >"$tools/library.log" 2>&1 &
library=$!
grep -vF "$PWD/crates/ventriform	" "$tools/programs" | run_programs 2>&1 | tee "$log"
[ "${PIPESTATUS[1]}" -eq 0 ] || cargo_status=1
wait "$library" || cargo_status=1
tee -a "$log" <"$tools/library.log"
cargo test --doc -- --show-output 2>&1 | tee -a "$log"
[ "${PIPESTATUS[0]}" -eq 0 ] || cargo_status=1
read -r p f i < <(awk '/^test result:/ { p += $4; f += $6; i += $8 } END { print p + 0, f + 0, i + 0 }' "$log")
# A test without its data prints `skipped: why` and returns. The harness counts it as passed.
s=$(grep -c '^skipped: ' "$log")
passed=$((passed + p - s)) failed=$((failed + f)) skipped=$((skipped + i + s))
mapfile -t -O "${#failures[@]}" failures < <(sed -n 's/^test \(.*\) \.\.\. FAILED$/\1/p' "$log")
if [ "$cargo_status" -ne 0 ] && [ "$f" -eq 0 ]; then count "cargo test" 1; fi

# --- external checks --------------------------------------------------------------------
if [ "$quick" = --quick ]; then finish; fi
if wait "${running[install]}"; then
  export PYTHON=$tools/python/bin/python NODE_PATH=$tools/node_modules
  # Build once before the checks run in parallel. Naming a test gives the libraries the same features as
  # `cargo test` does. The Python package has features of its own, and its wheel is built before the checks, which
  # would wait for cargo's lock.
  cargo build --quiet --workspace --exclude ventriform-python --bins --examples --test layering --test api
  check "wheel of the Python package" scripts/check/python.sh --build
  start python scripts/check/python.sh --test
  start formats scripts/check/formats.sh
  start geodesics scripts/check/geodesics.sh
  start codecs scripts/check/dicom_codecs.sh
  start api scripts/check/api.sh
  start generated env WHEEL_BUILT=1 scripts/generate.sh --check
  start clients scripts/check/clients.sh
  start crashes "$PYTHON" scripts/check/crash_rounds.py --program target/debug/ventriform --rounds 10
  start dicom scripts/check/dicom.sh
  start projections "$PYTHON" scripts/check/projections.py target/debug/ventriform
  start intake scripts/check/intake.sh
  start pacs scripts/check/pacs.sh
  start s3 scripts/check/s3.sh
  start chaos "$PYTHON" scripts/check/chaos.py --program target/debug/ventriform --rounds 10
  start kubernetes scripts/check/kubernetes.sh
  start proxy scripts/check/proxy.sh
  start pgbouncer scripts/check/pgbouncer.sh
  start alerts promtool test rules deploy/prometheus/alerts_test.yml
  start commands "$PYTHON" scripts/check/commands.py target/debug/ventriform
  start dependencies "$PYTHON" scripts/release/dependencies.py check
  collect python "Python package: tests, types, notebooks"
  collect formats "formats read by trimesh, vtk and the glTF validator"
  collect geodesics "geodesics against pygeodesic"
  collect codecs "codecs of compressed DICOM against libjpeg-turbo, GDCM, CharLS and OpenJPEG"
  collect api "service tested by schemathesis"
  collect generated "generated files; service answers as its document says"
  collect clients "generated Python and TypeScript clients"
  collect crashes "ten kills at random moments"
  collect dicom "DICOM objects read by dciodvfy, highdicom and dcmqi"
  collect projections "projections against a reconstruction in numpy"
  collect intake "images received from dcmtk, pynetdicom and dicomweb-client"
  collect pacs "series fetched from Orthanc, objects delivered to it"
  collect s3 "files in S3 by moto"
  collect chaos "ten faults of replicas, database and store"
  collect kubernetes "manifests against the schemas of Kubernetes"
  collect proxy "service behind nginx"
  collect pgbouncer "service on PostgreSQL behind PgBouncer"
  collect alerts "alerts of Prometheus"
  collect commands "commands of the README and the docs"
  collect dependencies "licences and sources"
else
  cat "$tools/install.log"
  echo "could not install the tools for the external checks"
  failed=$((failed + 1))
fi
# Alone, since they measure how long a request takes, and a browser on busy processors is slow.
[ -n "${PYTHON:-}" ] && check "attacks of one client under a limit of memory" \
  "$PYTHON" scripts/check/limits.py --program target/debug/ventriform --patience 3
check "page in a browser" scripts/check/page.sh
check "site of the docs: links, search, nothing from elsewhere" scripts/release/site.sh --check
check "demo" scripts/check/demo.sh
finish
