#!/usr/bin/env bash
# Format and lint of what is not Rust, by tools of the versions that are pinned: scripts/requirements.txt,
# web/package.json.
#
#   scripts/check/style.sh python            Python of scripts, tests, site and package, by ruff (settings:
#                                            pyproject.toml)
#   scripts/check/style.sh web               the page and its tests, by biome (settings: web/biome.json)
#   scripts/check/style.sh python --write    formats instead, and mends what the linter can
#
# Exits with 1 and what is wrong. The tools are laid under target/.
set -euo pipefail
cd "$(dirname "$0")/../.."
tools=$PWD/target/test-tools/style
mkdir -p "$tools"

case ${1:-} in
  python)
    wanted=$(grep '^ruff==' scripts/requirements.txt)
    if [ "$("$tools/python/bin/ruff" --version 2>/dev/null)" != "ruff ${wanted#ruff==}" ]; then
      python3 -m venv "$tools/python"
      "$tools/python/bin/pip" install -q "$wanted"
    fi
    ruff() { "$tools/python/bin/ruff" "$@"; }
    if [ "${2:-}" = --write ]; then
      ruff format --quiet .
      ruff check --output-format concise --fix .
      ruff format --quiet .
    else
      ruff check --output-format concise . && ruff format --check .
    fi
    ;;
  web)
    wanted=$(sed -n 's/.*"@biomejs\/biome": "\(.*\)".*/\1/p' web/package.json)
    biome=$tools/web/node_modules/.bin/biome
    if [ "$("$biome" --version 2>/dev/null)" != "Version: $wanted" ]; then
      npm install --silent --no-fund --no-audit --no-save --prefix "$tools/web" "@biomejs/biome@$wanted"
    fi
    cd web
    # What it has joined it may join with more: it is done when it changes nothing.
    if [ "${2:-}" = --write ]; then "$biome" check --diagnostic-level=error --write .; fi
    "$biome" check --diagnostic-level=error ${2:+"$2"} .
    ;;
  *) sed -n '2,7s/^# *//p' "$0" && exit 2 ;;
esac
