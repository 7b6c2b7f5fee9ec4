#!/usr/bin/env bash
# Shows exported meshes to the programs that people use.
#
#   scripts/check_formats.sh [DIR]      DIR: target/tmp/formats, where `cargo test` leaves one
#                                       file of each format
#
# For every NAME.json in DIR its siblings NAME.{glb,gltf,stl,ply,obj,vtp} are read by Khronos'
# glTF validator, trimesh and VTK, and compared with it. Ends with the number of files that
# passed and failed; exits with 1 if any failed.
#
# PYTHON: an interpreter that has numpy, trimesh and vtk already; NODE_PATH: a folder that has
# gltf-validator already. Without them both are installed under target/.
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
