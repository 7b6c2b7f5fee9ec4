#!/usr/bin/env bash
# Changes the code that makes and fits models in one place at a time, and tells which changes no test notices.
#
#   scripts/mutants.sh [SIZE] [OFFSET]    about SIZE mutants (40): of all, every n-th from number OFFSET (0) on
#   scripts/mutants.sh all                all of them: days
#
# Mutants come from cargo-mutants (installed if it is missing) and are made in a clone of the last commit, under
# target/mutants. Each is tested by the library's own tests of its folder and the domain tests of that stage, without
# the service. The quality gate counts as a test of re-tiling and optimisation.
#
# Prints the mutants missed, those of them that scripts/mutants_accepted.txt accepts, and the share caught. Exits with
# an error if a mutant was missed that is not accepted.
set -euo pipefail
cd "$(dirname "$0")/.."
size=${1:-40} offset=${2:-0}
work=$PWD/target/mutants
tree=$work/tree
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$work/build}

cargo mutants --version >/dev/null 2>&1 || cargo install --quiet --locked cargo-mutants
[ -d "$tree" ] || git clone --quiet --shared --no-checkout . "$tree"
git -C "$tree" fetch --quiet "$PWD" HEAD
git -C "$tree" checkout --quiet --force FETCH_HEAD

mutants() { # mutants FILES OPTIONS...: cargo-mutants on these files of the clone
    cargo mutants --dir "$tree" --file "$1" --no-default-features --colors never "${@:2}"
}

# FILES and the names of the tests that are to notice changes in them.
groups=(
    'src/optimise/** optimise quality'
    'src/retile/** retile quality'
    'src/deform/** deform'
    'src/grid/agreement.rs agreement'
)
every=1
if [ "$size" != all ]; then
    total=0
    for group in "${groups[@]}"; do
        total=$((total + $(mutants "${group%% *}" --list | wc -l)))
    done
    every=$(((total + size - 1) / size))
fi

rm -rf "$work"/results && mkdir -p "$work/results"
for number in "${!groups[@]}"; do
    read -r files tests <<<"${groups[$number]}"
    # It ends with 2 after a missed mutant and with 3 after one that ran too long.
    # shellcheck disable=SC2086
    mutants "$files" --in-place --shard "$((offset % every))/$every" --sharding round-robin \
        --no-times --minimum-test-timeout 120 --output "$work/results/$number" \
        -- --lib --test domain -- $tests || [[ $? =~ [23] ]]
done

list() { cat "$work"/results/*/mutants.out/"$1".txt 2>/dev/null | sort; }
# A mutant is accepted by its file and its change, wherever in the file it is.
place() { sed -E 's/:[0-9]+:[0-9]+: /: /'; }
accepted=$(grep -v '^ *\(#\|$\)' scripts/mutants_accepted.txt || true)
missed=$(list missed)
open=$(while read -r mutant; do
    [ -z "$mutant" ] || grep -qxF -- "$(place <<<"$mutant")" <<<"$accepted" || echo "$mutant"
done <<<"$missed")
count() { grep -c . <<<"$1" || true; }
caught=$(($(count "$(list caught)") + $(count "$(list timeout)")))

echo
echo "caught $caught, missed $(count "$missed"), of these accepted $(($(count "$missed") - $(count "$open"))), not compiling $(count "$(list unviable)")"
if [ -n "$open" ]; then
    echo "missed and not accepted:"
    echo "$open"
    exit 1
fi
