"""Work beside the interpreter: progress, Ctrl-C, threads, processes."""

from __future__ import annotations

import concurrent.futures
import multiprocessing
import os
import pathlib
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest

import ventriform as vf

#: Ctrl-C ends a run within this.
MOST_SECONDS_TO_END = 0.2


def test_progress_never_decreases_and_ends_at_one(scan: pathlib.Path) -> None:
    told: list[tuple[str, float]] = []
    threads = set()

    def progress(stage: str, fraction: float) -> None:
        told.append((stage, fraction))
        threads.add(threading.get_ident())

    vf.segment(scan, progress=progress)
    fractions = [fraction for _, fraction in told]
    assert fractions == sorted(fractions) and fractions[-1] == 1.0
    # Stages shorter than the time between two calls are not told.
    stages = [stage for stage, _ in told]
    assert stages[-1] == "export" and len(set(stages)) > 1
    assert threads == {threading.get_ident()}


def test_a_bar_of_tqdm_is_filled(scan: pathlib.Path) -> None:
    from tqdm import tqdm

    with tqdm(total=100, disable=False, file=open(os.devnull, "w")) as bar:
        vf.generate(scan, progress=bar)
        assert bar.n == pytest.approx(100)
    vf.generate(scan, progress=True)


def test_an_exception_of_the_callback_ends_the_work(scan: pathlib.Path) -> None:
    def progress(stage: str, fraction: float) -> None:
        raise LookupError(stage)

    with pytest.raises(LookupError):
        vf.generate(scan, points=3000, progress=progress)


INTERRUPTED = """
import os, signal, sys, threading, time
import ventriform as vf
path, work = sys.argv[1:]
# A shell's background jobs, such as this test in CI, ignore the signal.
signal.signal(signal.SIGINT, signal.default_int_handler)
volume = vf.read(path)
sent = 0.0
def interrupt():
    global sent
    time.sleep(1.0)
    sent = time.monotonic()
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=interrupt).start()
try:
    if work == "generate":
        vf.generate(volume, points=5000, starts=16)
    elif work == "beat":
        for _ in range(200):
            vf.beat(volume)
    else:
        for _ in range(200):
            vf.segment(volume)
except KeyboardInterrupt:
    print(time.monotonic() - sent)
"""


@pytest.mark.parametrize("work", ["generate", "segment", "beat"])
def test_ctrl_c_ends_a_run_soon(work: str, scan: pathlib.Path, gated: pathlib.Path) -> None:
    path = gated if work == "beat" else scan
    made = subprocess.run([sys.executable, "-c", INTERRUPTED, path, work], capture_output=True, text=True, timeout=120)
    assert made.stdout, made.stderr
    # On a busy machine the thread that looks for signals may have to wait for a processor.
    assert float(made.stdout) < MOST_SECONDS_TO_END * (3 if os.getloadavg()[0] > (os.cpu_count() or 1) else 1)


def test_other_threads_run_while_a_fit_is_made(scan: pathlib.Path) -> None:
    ended = threading.Event()
    ticks = 0

    def tick() -> None:
        nonlocal ticks
        while not ended.is_set():
            ticks += 1
            time.sleep(0.005)

    thread = threading.Thread(target=tick)
    thread.start()
    begin = time.monotonic()
    vf.beat(vf.read(scan.parent.parent / "gated.nii.gz")) if (
        scan.parent.parent / "gated.nii.gz"
    ).exists() else vf.segment(scan)
    seconds = time.monotonic() - begin
    ended.set()
    thread.join()
    assert ticks > seconds / 0.005 * 0.1


def test_threads_that_share_a_volume_and_a_model_get_equal_results(
    scan: pathlib.Path, model: vf.Model, fit: vf.Fit
) -> None:
    volume = vf.read(scan)
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        fits = list(pool.map(lambda _: vf.segment(volume), range(4)))
        files = list(pool.map(lambda _: model.to_bytes("glb"), range(4)))
    assert all(dict(one.files) == dict(fit.files) for one in fits)
    assert len(set(files)) == 1


def confidence(path: str) -> float:
    return vf.segment(path).confidence


@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
def test_processes_fit_too(method: str, scan: pathlib.Path, fit: vf.Fit) -> None:
    # The parent has threads of its own by now, which a fork does not copy.
    context = multiprocessing.get_context(method)
    with context.Pool(2) as pool:
        made = pool.map_async(confidence, [str(scan)] * 3).get(timeout=120)
    assert made == [fit.confidence] * 3


def test_a_fit_travels_from_a_process(scan: pathlib.Path, fit: vf.Fit) -> None:
    with concurrent.futures.ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        made = pool.submit(vf.segment, str(scan)).result(timeout=120)
    assert dict(made.files) == dict(fit.files)


def test_the_import_is_quick_and_brings_no_numpy() -> None:
    code = textwrap.dedent("""
        import sys, time
        begin = time.perf_counter()
        import ventriform
        seconds = time.perf_counter() - begin
        assert "numpy" not in sys.modules and "httpx" not in sys.modules, sorted(sys.modules)
        print(seconds)
    """)
    made = [
        float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
        for _ in range(5)
    ]
    assert min(made) < 0.15


def test_arrays_outlive_what_made_them(scan: pathlib.Path) -> None:
    mask = vf.segment(scan).mask
    voxels = vf.read(scan).array
    for _ in range(3):
        vf.phantom(size=32)
    assert 0 < mask.sum() < mask.size and np.isfinite(voxels).all()


def test_signals_have_their_handlers_back(scan: pathlib.Path) -> None:
    before = signal.getsignal(signal.SIGINT)
    vf.generate(scan)
    assert signal.getsignal(signal.SIGINT) is before
