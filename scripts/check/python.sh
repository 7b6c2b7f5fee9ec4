#!/usr/bin/env bash
# Builds the Python package's wheel, installs it into an environment of its own and tests it there.
#
#   scripts/check/python.sh            everything
#   scripts/check/python.sh --install  only the environment of the tests
#   scripts/check/python.sh --build    only the wheel in it, which scripts/test.sh does beforehand: it needs cargo's lock
#   scripts/check/python.sh --test     only the tests: pytest, mypy, stubtest, notebooks
#   scripts/check/python.sh --notebooks    only the notebooks, whose copies with outputs scripts/release/site.sh shows
#
# The wheel has the dev profile, in which the library is optimised. VENTRIFORM_WHEEL: a wheel to test instead.
# CARGO_CONFIG: a file of further settings for cargo.
set -euo pipefail
cd "$(dirname "$0")/../.."
tools=$PWD/target/test-tools
venv=$tools/python-package
wheels=$tools/wheels
export PYTHONDONTWRITEBYTECODE=1 VENTRIFORM_PROGRAM=$PWD/target/debug/ventriform

install_environment() {
  if ! cmp -s python/requirements-test.txt "$venv/requirements.done"; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install -q -r python/requirements-test.txt
    cp python/requirements-test.txt "$venv/requirements.done"
  fi
}

build() {
  install_environment
  local wheel=${VENTRIFORM_WHEEL:-}
  if [ -z "$wheel" ]; then
    rm -rf "$wheels"
    "$venv/bin/maturin" build --quiet --profile dev --strip --auditwheel skip --interpreter "$venv/bin/python" \
      --out "$wheels" ${CARGO_CONFIG:+--config "$CARGO_CONFIG"}
    wheel=$(ls "$wheels"/*.whl)
  fi
  "$venv/bin/pip" install -q --no-deps --force-reinstall "$wheel"
}

# The repository's notebooks have no outputs; the copies are kept with the sums of what was run.
run_notebooks() {
  rm -rf "$tools/notebooks"
  mkdir -p "$tools/notebooks"
  cp python/examples/*.ipynb "$tools/notebooks"
  "$venv/bin/python" -m pytest -q -p no:cacheprovider --nbmake --overwrite "$tools/notebooks"
  sha256sum python/examples/*.ipynb >"$tools/notebooks/sources"
}

run_tests() {
  [ -x "$VENTRIFORM_PROGRAM" ] || cargo build --quiet --bins --test layering
  "$venv/bin/python" -m pytest -q -p no:cacheprovider python/tests
  "$venv/bin/python" -m mypy --strict --cache-dir "$tools/mypy" -p ventriform
  "$venv/bin/python" -m mypy.stubtest ventriform --allowlist python/stubtest_allowlist.txt
  run_notebooks
}

case ${1:-} in
  --install) install_environment ;;
  --build) build ;;
  --test) run_tests ;;
  --notebooks) run_notebooks ;;
  *)
    build
    run_tests
    ;;
esac
