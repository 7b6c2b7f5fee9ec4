#!/usr/bin/env bash
# Reads exported meshes with other programs and compares the result.
#
#   scripts/check/formats.sh [DIR...]      default: target/tmp/formats, where `cargo test` writes one
#                                          file of each format, and a fit and a model made here
#
# For every NAME.json in a folder, Khronos' glTF validator, trimesh and VTK read
# NAME.{glb,gltf,stl,ply,obj,vtp,vtk} and the result is compared with NAME.json: the mesh, the figures of
# its vertices and the parts of its triangles. SimpleITK, nibabel and pynrrd must find mask and labels of the fit where
# the scan is (scripts/check/masks.py). The validator also reads a beat's mesh.glb, which moves. Meshes that trimesh and
# VTK write in every way must be the masks they enclose (scripts/check/meshes.py). Prints the number of files that
# passed and failed; exits with 1 if any failed.
#
# PROGRAM: the program that makes fit and model (default: target/debug/ventriform).
# PYTHON: an interpreter that has nibabel, numpy, pynrrd, SimpleITK, trimesh and vtk. NODE_PATH: a folder that has
# gltf-validator. Without these variables the script installs the packages under target/.
set -euo pipefail

root=$(cd "$(dirname "$0")/../.." && pwd)
tools=$root/target/check-formats
mkdir -p "$tools"

if [ -z "${PYTHON:-}" ]; then
    PYTHON=$tools/venv/bin/python
    [ -x "$PYTHON" ] || python3 -m venv "$tools/venv"
    "$PYTHON" -c 'import nibabel, nrrd, numpy, SimpleITK, trimesh, vtk' 2>/dev/null ||
        "$PYTHON" -m pip install --quiet --disable-pip-version-check nibabel==5.4.2 numpy==2.4.6 pynrrd==1.1.3 scipy==1.17.1 SimpleITK==2.5.7 trimesh==5.2.0 vtk==9.7.2
fi
if [ -z "${NODE_PATH:-}" ]; then
    export NODE_PATH=$tools/node_modules
    [ -d "$NODE_PATH/gltf-validator" ] ||
        npm install --silent --no-fund --no-audit --prefix "$tools" gltf-validator
fi

if [ $# -eq 0 ]; then
    program=${PROGRAM:-$root/target/debug/ventriform}
    made=$tools/made
    rm -rf "$made" && mkdir -p "$made/model"
    formats="glb gltf stl ply obj vtp vtk json"
    "$program" phantom -o "$made/scan" --size 64 --spacing 5 >/dev/null
    # shellcheck disable=SC2046 # each word is an argument
    "$program" segment "$made/scan/spect.nii.gz" --model auto -o "$made/fit" \
        $(printf -- '--format %s ' $formats) --part endocardium --part epicardium --part base >/dev/null
    # shellcheck disable=SC2046
    "$program" generate "$made/scan/spect.nii.gz" --points 150 $(printf -- "-o $made/model/lv.%s " $formats) >/dev/null
    "$PYTHON" "$root/scripts/lib/gated_phantom.py" "$made/scan" "$made/gated.nii.gz"
    "$program" beat "$made/gated.nii.gz" -o "$made/beat" --format glb --format gltf 2>/dev/null
    set -- "$root/target/tmp/formats" "$made/fit" "$made/model"
fi

status=0
if [ -n "${made:-}" ]; then
    "$PYTHON" "$root/scripts/check/masks.py" "$program" "$tools/masks" || status=1
    "$PYTHON" "$root/scripts/check/meshes.py" "$program" "$made/fit" "$tools/meshes" || status=1
    node "$root/scripts/check/formats.js" "$made/beat" || status=1
fi
for folder; do
    node "$root/scripts/check/formats.js" "$folder" || status=1
    "$PYTHON" "$root/scripts/check/formats.py" "$folder" || status=1
done
exit $status
