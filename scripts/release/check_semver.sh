#!/usr/bin/env bash
# Compares the public interfaces of the crates `ventriform` and `ventriform-dicom` with those of the newest release: a
# change that breaks their users fails unless the version in Cargo.toml says so.
#
#   scripts/release/check_semver.sh [REVISION]      the newest tag v* unless given
#
# In: the work tree and a revision. Out: the changes that break, by cargo-semver-checks. Guaranteed: 0 if it found none,
# or there is no release yet, which is said. It knows many kinds of breaking changes, not all.
#
# crates.io has the tool as sources only: it is compiled once, under target/test-tools.
set -euo pipefail
cd "$(dirname "$0")/../.."
# A release is compared with the one before, also when its own tag is there already.
revision=${1:-$(git tag --list 'v[0-9]*' --no-contains HEAD --sort=-version:refname | head -n 1)}
if [ -z "$revision" ]; then
  echo "no release yet: no tag v*"
  exit
fi
version=0.51.0
tool=$PWD/target/test-tools/semver-$version
# Without optimisation it compiles in a third of the time, and what takes long here is rustdoc.
[ -x "$tool/bin/cargo-semver-checks" ] ||
  cargo install --quiet --locked --debug --root "$tool" "cargo-semver-checks@$version"
"$tool/bin/cargo-semver-checks" semver-checks --package ventriform --package ventriform-dicom \
  --baseline-rev "$revision"
