#!/usr/bin/env bash
# Runs the tests where they waver: on busy processors, on one thread, and in shuffled order.
#
#   scripts/check/steady.sh                 ten rounds beside a busy loop for each processor, one on one thread,
#                                           one in shuffled order: three hours on two processors
#   scripts/check/steady.sh 3 contract::    three rounds, of the tests with `contract::` in their names
#
# Not part of CI, whose machine has no time for it. Prints a line for each run and the names of tests that failed;
# exits with 1 if any did. A shuffled run prints the seed that repeats it: SEED=N scripts/check/steady.sh 0.
set -uo pipefail
cd "$(dirname "$0")/../.."
rounds=${1:-10}
shift || true
out=$(mktemp -d)
busy=()
trap 'kill "${busy[@]}" 2>/dev/null; rm -rf "$out"' EXIT

# Cargo tells the programs that hold the tests; each is run in the folder of its package, as cargo runs it.
cargo test --no-run --message-format=json |
  python3 -c '
import json, os, sys
for line in sys.stdin:
    message = json.loads(line)
    if message.get("profile", {}).get("test") and message.get("executable"):
        print(os.path.dirname(message["manifest_path"]), message["executable"], sep="\t")
' >"$out/programs"
[ -s "$out/programs" ] || { echo "no test was built"; exit 1; }

failed=0
# run NAME FLAG...: every test once.
run() {
  local name=$1 begin=$SECONDS status=0
  shift
  while IFS=$'\t' read -r folder program; do
    (cd "$folder" && exec "$program" "$@") </dev/null >>"$out/$name" 2>&1 || status=1
  done <"$out/programs"
  echo "$name: $(grep -c '\.\.\. ok$' "$out/$name") passed, $(grep -c '\.\.\. FAILED$' "$out/$name") failed, $((SECONDS - begin)) s"
  if [ "$status" -ne 0 ]; then
    failed=1
    grep '\.\.\. FAILED$' "$out/$name"
    sed -n '/^failures:$/,/^test result/p' "$out/$name" | head -n 200
  fi
}

for _ in $(seq "$(nproc)"); do
  while :; do :; done &
  busy+=($!)
done
for round in $(seq "$rounds"); do
  run "busy-$round" "$@"
done
kill "${busy[@]}" 2>/dev/null
wait "${busy[@]}" 2>/dev/null
busy=()
run one-thread --test-threads=1 "$@"
# The harness takes the flags of unreleased compilers when it is told that it may.
export RUSTC_BOOTSTRAP=1
seed=${SEED:-$RANDOM}
echo "shuffled with seed $seed"
run shuffled -Z unstable-options --shuffle-seed "$seed" "$@"
exit "$failed"
