#!/usr/bin/env bash
# Builds an older revision and this one, and upgrades replicas from one to the other under load.
#
#   scripts/check/upgrade.sh REVISION
#
# Not part of scripts/test.sh, which has a test without a second build: a process goes on while the next version adds to
# the tables. PYTHON: one with scripts/requirements.txt. PROFILE: release unless given.
set -euo pipefail
cd "$(dirname "$0")/../.."
revision=${1:?give the older revision, such as a tag}
profile=${PROFILE:-release}
tree=target/upgrade/tree
programs=target/upgrade
built=target/$([ "$profile" = dev ] && echo debug || echo "$profile")/ventriform
rm -rf "$tree"
mkdir -p "$programs"
git worktree prune
git worktree add --detach "$tree" "$revision"
trap 'git worktree remove --force "$tree"' EXIT

# Both share the compiled dependencies.
(cd "$tree" && CARGO_TARGET_DIR="$OLDPWD/target" cargo build --profile "$profile" --bin ventriform)
cp "$built" "$programs/old"
cargo build --profile "$profile" --bin ventriform
cp "$built" "$programs/new"
"${PYTHON:-python3}" scripts/check/upgrade.py --old "$programs/old" --new "$programs/new"
