# Tools that several scripts need, laid under target/test-tools so that the sources stay clean. To be sourced in the root of
# the repository.

test_tools=$PWD/target/test-tools
web_tools=$test_tools/web

# Python with what scripts/requirements.txt names. PYTHON: another interpreter that has it.
python_tools() {
  if ! cmp -s scripts/requirements.txt "$test_tools/python.done"; then
    python3 -m venv "$test_tools/python" &&
      "$test_tools/python/bin/pip" install -q -r scripts/requirements.txt &&
      cp scripts/requirements.txt "$test_tools/python.done"
  fi
}

# A copy of the page's sources, tests and packages, with the OpenAPI document $1 and what they read of the library.
web_sources() {
  local assets=crates/ventriform/assets
  rm -rf "$web_tools/src" "$web_tools/tests" "$web_tools/dist" "${test_tools:?}/$assets"
  mkdir -p "$web_tools" "$test_tools/$assets" "$test_tools/openapi"
  cp "$assets/uptake.json" "$assets/figures.json" "$test_tools/$assets/"
  cp "$1" "$test_tools/openapi/ventriform.json"
  cp -r web/package.json web/package-lock.json web/types.mjs web/tsconfig.json web/vite.config.ts web/index.html web/src web/tests "$web_tools/"
  # Not `npm ci`: it refuses a lock file without the packages for other systems, which npm leaves out where a
  # registry does not have them. What the lock file names is installed in that version.
  if ! cmp -s web/package-lock.json "$web_tools/installed"; then
    (cd "$web_tools" && npm install --silent --no-fund --no-audit)
    cp web/package-lock.json "$web_tools/installed"
  fi
}
