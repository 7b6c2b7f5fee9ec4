#!/usr/bin/env bash
# Writes every generated file of the repository, or checks that the committed ones are those that would be written.
#
#   scripts/generate.sh [PART...]            writes them
#   scripts/generate.sh --check [PART...]    checks them; changes nothing
#
# Parts, in this order (all, if none is named):
#   examples   crates/http/src/openapi/examples.json, recorded from a service; checked: they and every answer of the service
#              are what the OpenAPI document says
#   documents  openapi/ventriform.json, the tables of settings in docs/operations.md and of figures in docs/figures.md
#   web        web/src/generated, web/dist, crates/ventriform/assets/report.*
#   python     python/ventriform/reports.py and _functions.pyi
#   bill       ventriform.cdx.json
#
# The files are made below target/generated. .gitattributes marks those that are generated as a whole, and the check compares
# its list with what was made. The pictures of the README are no part: a browser draws them, never twice the same bytes
# (scripts/release/pictures.sh).
#
# PYTHON: an interpreter that has what scripts/requirements.txt names. WHEEL_BUILT: set if scripts/check/python.sh --build has
# just been run.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/lib/tools.sh
check=
if [ "${1:-}" = --check ]; then
  check=1
  shift
fi
all=(examples documents web python bill)
parts=("${@:-${all[@]}}")
for part in "${parts[@]}"; do
  [[ " ${all[*]} " == *" $part "* ]] || { echo "no part $part; there are: ${all[*]}"; exit 2; }
done
out=$PWD/target/generated
document=$out/openapi/ventriform.json
rm -rf "$out"
mkdir -p "$out/openapi"
[ -n "${PYTHON:-}" ] || { python_tools; PYTHON=$test_tools/python/bin/python; }
# As scripts/test.sh builds them, so that nothing is compiled twice.
cargo_flags=(--quiet --workspace --exclude ventriform-python)

wanted() { [[ " ${parts[*]} " == *" $1 "* ]]; }

# The document and the pages of docs/ of the code as it is.
write_documents() {
  GENERATED_FOLDER=$out cargo test "${cargo_flags[@]}" --test api -- \
    the_committed_document_matches_the_code the_page_for_operators_lists_every_setting the_page_of_figures_lists_every_figure >"$out/log" || { cat "$out/log"; exit 1; }
  rm "$out/log"
}

make_examples() {
  local examples=crates/http/src/openapi/examples.json
  cargo build "${cargo_flags[@]}" --bins --examples --test layering --test api
  export PROGRAM=target/debug/ventriform SERVICE_FLAGS='--webhook-allow 127.0.0.1 --wait-limit 10m'
  if [ -n "$check" ]; then
    scripts/with_service.sh "$PYTHON" scripts/check/contract.py
  else
    scripts/with_service.sh "$PYTHON" scripts/check/contract.py --record "$out/examples.json"
    # The document is made of them.
    cmp -s "$out/examples.json" "$examples" || cp "$out/examples.json" "$examples"
    rm "$out/examples.json"
  fi
}

make_web() {
  web_sources "$document"
  (cd "$web_tools" && npm run --silent types && npx tsc --noEmit && npm run --silent build)
  mkdir -p "$out/web/src" "$out/crates/ventriform/assets"
  cp -r "$web_tools/src/generated" "$out/web/src/"
  cp -r "$web_tools/dist" "$out/web/"
  cp "$test_tools"/crates/ventriform/assets/report.* "$out/crates/ventriform/assets/"
}

make_python() {
  [ -n "${WHEEL_BUILT:-}" ] || scripts/check/python.sh --build
  mkdir -p "$out/python/ventriform"
  DOCUMENT=$document python3 scripts/release/python_types.py reports >"$out/python/ventriform/reports.py"
  "$test_tools/python-package/bin/python" scripts/release/python_types.py functions >"$out/python/ventriform/_functions.pyi"
}

# The generated files among those whose names are on standard input, by .gitattributes.
marked() { git check-attr --stdin linguist-generated | sed -n 's/: linguist-generated: \(set\|true\)$//p' | sort; }

if wanted examples; then make_examples; fi
if wanted documents || wanted web || wanted python; then write_documents; fi
if wanted web; then make_web; fi
if wanted python; then make_python; fi
if wanted bill; then "$PYTHON" scripts/release/dependencies.py program >"$out/ventriform.cdx.json"; fi

made=$(cd "$out" && find . -type f | sed 's,^\./,,' | sort)
if [ -z "$check" ]; then
  # Files of the page that are no longer made.
  if wanted web; then rm -rf web/dist; fi
  cp -r "$out/." .
  git status --short -- $made web/dist crates/http/src/openapi/examples.json
  exit
fi
wrong=0
for file in $made; do
  cmp -s "$out/$file" "$file" && continue
  wrong=$((wrong + 1))
  echo "$file is not what its sources give"
  diff -u "$file" "$out/$file" | head -n 20 | cut -c1-200 || true
done
if [ ${#parts[@]} -eq ${#all[@]} ]; then
  # Those that are generated as a whole: of docs/operations.md it is one table; examples are recorded.
  diff <(marked <<<"$made") <(git ls-files --cached --others --exclude-standard | marked | grep -v '/examples\.json$') ||
    { wrong=$((wrong + 1)); echo "the generated files that git has are not those that are made"; }
fi
[ $wrong -eq 0 ] || { echo "write them anew: scripts/generate.sh"; exit 1; }
echo "$(wc -w <<<"$made") generated files are up to date"
