#!/usr/bin/env bash
# Reads exported meshes with other programs and compares the result.
#
#   scripts/check_formats.sh [DIR]      default: target/tmp/formats, where `cargo test` writes one
#                                       file of each format
#
# For every NAME.json in DIR, Khronos' glTF validator, trimesh and VTK read NAME.{glb,gltf,stl,ply,obj,vtp}
# and the result is compared with NAME.json. Prints the number of files that passed and failed; exits with
# 1 if any failed.
#
# PYTHON: an interpreter that has numpy, trimesh and vtk. NODE_PATH: a folder that has gltf-validator.
# Without these variables the script installs the packages under target/.
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
folder=${1:-$root/target/tmp/formats}
tools=$root/target/check-formats
mkdir -p "$tools"

if [ -z "${PYTHON:-}" ]; then
    PYTHON=$tools/venv/bin/python
    [ -x "$PYTHON" ] || python3 -m venv "$tools/venv"
    "$PYTHON" -c 'import numpy, trimesh, vtk' 2>/dev/null ||
        "$PYTHON" -m pip install --quiet --disable-pip-version-check numpy trimesh vtk
fi
if [ -z "${NODE_PATH:-}" ]; then
    export NODE_PATH=$tools/node_modules
    [ -d "$NODE_PATH/gltf-validator" ] ||
        npm install --silent --no-fund --no-audit --prefix "$tools" gltf-validator
fi

status=0
node "$root/scripts/check_formats.js" "$folder" || status=1
"$PYTHON" "$root/scripts/check_formats.py" "$folder" || status=1
exit $status
