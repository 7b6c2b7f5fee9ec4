#!/usr/bin/env bash
# Times ventriform against other tools for the same jobs, in turns on one core.
#
#   scripts/measure/compare_peers.sh [PART...]     PART: speed sizes reading threads memory scaling (default: all)
#
# Prints tables and writes target/compare-peers/PART.json; `scaling` also writes docs/scaling-*.svg.
# Installs the peers' Python packages under target/compare-peers and builds the C++ peers whose headers
# are on the machine (Geogram's come with its wheel; CGAL: libcgal-dev).
#
# PYTHON: an interpreter that has the packages. ROUNDS: turns of each program (15).
# CORE: the core to run on (the last one).
# NATIVE=1: ventriform and the C++ peers use all that this machine's processor has; otherwise what every x86-64 has, as
# published binaries and the wheels of the other peers do. Results then go to target/compare-peers/native.
set -euo pipefail
cd "$(dirname "$0")/../.."
work=$PWD/target/compare-peers
mkdir -p "$work"

if [ -z "${PYTHON:-}" ]; then
    PYTHON=$work/venv/bin/python
    [ -x "$PYTHON" ] || python3 -m venv "$work/venv"
    "$PYTHON" -c 'import geogram, nibabel, pyacvd' 2>/dev/null ||
        "$PYTHON" -m pip install --quiet --disable-pip-version-check \
            numpy nibabel vtk pyvista pyacvd geogram
fi

march=()
if [ -n "${NATIVE:-}" ]; then
    work=$work/native march=(-march=native)
    mkdir -p "$work"
    export CARGO_TARGET_DIR=$work/target RUSTFLAGS="-C target-cpu=native ${RUSTFLAGS:-}"
fi

cpp() { # cpp NAME FLAGS...: builds scripts/measure/peers/NAME.cpp if it can
    local name=$1
    shift
    [ "$work/$name.so" -nt "scripts/measure/peers/$name.cpp" ] && return
    g++ -O3 "${march[@]}" -DNDEBUG -std=c++17 -fPIC -shared "scripts/measure/peers/$name.cpp" \
        -o "$work/$name.so" "$@" -Wl,--no-undefined 2>"$work/$name.log" ||
        echo "skipping $name: it does not build here (see $work/$name.log)"
}
site=$("$PYTHON" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
if [ -e "$site/lib64/libgeogram.a" ]; then
    tbb=$(basename "$site"/geogram.libs/libtbb*)
    cpp geogram -fopenmp -I"$site/include/geogram1" "$site/lib64/libgeogram.a" \
        -L"$site/geogram.libs" "-l:$tbb" -Wl,-rpath,"$site/geogram.libs" -lpthread -ldl
fi
[ -d /usr/include/CGAL ] && cpp cgal -I/usr/include/eigen3 -lgmp -lmpfr

cargo build --release --quiet --package ventriform-program --package ventriform-evaluation --bin ventriform --bin stopwatch
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 VTK_SMP_MAX_THREADS=1
exec "$PYTHON" scripts/measure/compare_peers.py --work "$work" --docs docs \
    --binaries "${CARGO_TARGET_DIR:-target}/release" --rounds "${ROUNDS:-15}" ${CORE:+--core "$CORE"} "$@"
