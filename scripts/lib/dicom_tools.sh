# shellcheck shell=bash
# What the checks of DICOM have in common; sourced by them in the project's root.

as_root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi; }

# debian PACKAGE...: installs Debian packages.
debian() {
  as_root apt-get update -qq
  as_root apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

# python_with MODULES: sets PYTHON, unless it is set, to an interpreter under target/ that has these modules.
python_with() {
  [ -z "${PYTHON:-}" ] || return 0
  local tools=target/check-dicom
  PYTHON=$tools/bin/python
  [ -x "$PYTHON" ] || python3 -m venv "$tools"
  "$PYTHON" -c "import $1" 2>/dev/null ||
    "$PYTHON" -m pip install --quiet --disable-pip-version-check -r scripts/requirements.txt
}

# conform FILE...: whether dciodvfy finds no error in any of them. Its output counts, not its status.
conform() {
  local wrong=0 file found
  for file in "$@"; do
    found=$(dciodvfy "$file" 2>&1 | grep '^Error' || true)
    [ -z "$found" ] || { echo "$file: $found" && wrong=1; }
  done
  [ "$wrong" -eq 0 ] && echo "dciodvfy: no error in $# objects"
}
