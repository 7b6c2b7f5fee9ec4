"""Repeated work keeps no memory.

VENTRIFORM_LEAK_FITS: the number of fits (40; 1000 take seven minutes).
"""

from __future__ import annotations

import json
import os
import subprocess
import sys

FITS = int(os.environ.get("VENTRIFORM_LEAK_FITS", "40"))
#: Before the first measurement: threads, caches and the arenas of the allocator come with the first fits.
WARMING_FITS = 20
#: The growth allowed however many fits there are. One array of the scan kept by each of 40 fits would be 20 MB.
MOST_RESIDENT_BYTES = 12_000_000
MOST_TRACED_BYTES = 300_000

# In a process of its own: what other tests have freed would hide what is kept here.
WORK = """
import gc, json, os, sys, tracemalloc
import ventriform as vf

warming, fits = map(int, sys.argv[1:])
phantom = vf.phantom(size=40, spacing_mm=8.0)
array, affine, truth = phantom.volume.array, phantom.volume.affine, phantom.truth

def work():
    scan = vf.Volume(array, affine)
    model = vf.generate(scan, points=67)
    fit = vf.segment(scan, model=model, expert=truth, progress=lambda stage, fraction: None)
    assert fit.mask.any() and fit.polar.size and fit.report.volumes_ml.cavity > 0 and len(fit.files)
    vf.measure(fit, truth)
    for wrong in ({"points": 3}, {"iso": "nothing"}):
        try:
            vf.generate(scan, **wrong)
        except vf.InputError:
            continue
        raise AssertionError(wrong)

def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

for _ in range(warming):
    work()
gc.collect()
tracemalloc.start()
work()
gc.collect()
before = resident(), tracemalloc.get_traced_memory()[0]
for _ in range(fits):
    work()
gc.collect()
traced = tracemalloc.get_traced_memory()[0] - before[1]
print(json.dumps({"resident": resident() - before[0], "traced": traced, "at": before[0]}))
"""


def test_fits_keep_no_memory() -> None:
    made = subprocess.run(
        [sys.executable, "-c", WORK, str(WARMING_FITS), str(FITS)],
        capture_output=True,
        text=True,
        timeout=60 + 5 * FITS,
    )
    assert made.returncode == 0, made.stderr
    grown = json.loads(made.stdout)
    print(f"{FITS} fits: {grown}")
    assert grown["resident"] < MOST_RESIDENT_BYTES, grown
    assert grown["traced"] < MOST_TRACED_BYTES, grown
