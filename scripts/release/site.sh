#!/usr/bin/env bash
# Builds the site of the docs into target/site/html: README and docs/, the notebooks, the references of the HTTP API and of
# the Python package, with a search. Nothing in it is loaded from elsewhere.
#
# The reference has the parameters of the installed package, whose wheel scripts/check/python.sh builds where there is none; the
# notebooks have the outputs of their last run there, or are run.
#
#   scripts/release/site.sh            builds it
#   scripts/release/site.sh --check    and checks it: links and anchors of the sources and of the pages, parameters of the reference and
#                              outputs of the notebooks, and every page in Chromium, which must not ask any other host; what the search finds, from a web server and from the disk
#   scripts/release/site.sh --serve    builds it and shows it on 127.0.0.1:8000
#
# Needs python3 with venv, and npm; --check needs chromium. The packages are laid under target/.
set -euo pipefail
cd "$(dirname "$0")/../.."
tools=$PWD/target/test-tools/site
source=target/site/source
mkdir -p "$tools"
if ! cmp -s site/requirements.txt "$tools/requirements.done"; then
  python3 -m venv "$tools/python"
  "$tools/python/bin/pip" install -q -r site/requirements.txt
  cp site/requirements.txt "$tools/requirements.done"
fi
if ! cmp -s site/package.json "$tools/package.done"; then
  cp site/package.json "$tools/package.json"
  npm install --silent --no-fund --no-audit --prefix "$tools"
  cp site/package.json "$tools/package.done"
fi
package=$PWD/target/test-tools/python-package/bin/python
"$package" -c 'import ventriform' 2>/dev/null || scripts/check/python.sh --build

# A copy of the pages laid out as in this folder: the links between them are those of the repository.
rm -rf target/site
mkdir -p "$source/python" "$source/openapi" "$source/crates/ventriform" "$source/site"
cp -r README.md ARCHITECTURE.md CONTRIBUTING.md CHANGELOG.md SECURITY.md docs "$source/"
cp -r python/examples "$source/python/"
ran=$PWD/target/test-tools/notebooks
sha256sum --status -c "$ran/sources" 2>/dev/null || scripts/check/python.sh --notebooks
cp "$ran"/*.ipynb "$source/python/examples/"
"$package" scripts/release/python_types.py reference target/site/reference.json
cp -r crates/ventriform/examples "$source/crates/ventriform/"
cp openapi/ventriform.json "$source/openapi/"
cp site/*.md "$source/site/"
cp "$tools/node_modules/iframe-worker/shim/index.js" "$source/site/iframe-worker.js"
# The theme tells of a coming version of mkdocs at every build.
# It runs in the copy, where mkdocs-jupyter leaves a cache.
config=$PWD/site/mkdocs.yml
(cd "$source" && NO_MKDOCS_2_WARNING=1 "$tools/python/bin/mkdocs" build --quiet --strict --config-file "$config")

case ${1:-} in
  --check)
    "$tools/python/bin/python" site/check_links.py target/site/html
    "$tools/python/bin/python" site/check_reference.py target/site
    cp site/check_pages.mjs "$tools/"
    CHROMIUM=${CHROMIUM:-/usr/bin/chromium} node "$tools/check_pages.mjs" target/site/html
    ;;
  --serve) python3 -m http.server --bind 127.0.0.1 --directory target/site/html 8000 ;;
esac
