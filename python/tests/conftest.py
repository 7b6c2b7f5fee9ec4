"""What the tests share: the command, a simulated scan in files, and the package's own results of it."""

from __future__ import annotations

import os
import pathlib
import re
import subprocess
import time
from collections.abc import Callable, Iterator

import pytest

import ventriform as vf

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("VENTRIFORM_PROGRAM", ROOT / "target/debug/ventriform"))
DATA = ROOT / "../shared/data"

Command = Callable[..., str]


@pytest.fixture(scope="session")
def command() -> Command:
    """Runs the command and gives its standard output."""
    assert PROGRAM.is_file(), f"no program at {PROGRAM}: cargo build --bins"

    def run(*arguments: object) -> str:
        made = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
        assert made.returncode == 0, made.stderr
        return made.stdout

    return run


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory, command: Command) -> pathlib.Path:
    """Two phantoms of the command, in `rest` and `stress`."""
    folder = tmp_path_factory.mktemp("phantoms")
    size = ["--size", 64, "--spacing", 6.4]
    command("phantom", "-o", folder / "rest", *size, "--seed", 2)
    command("phantom", "-o", folder / "stress", *size, "--seed", 3, "--defect", "8:0.7")
    return folder


@pytest.fixture(scope="session")
def scan(folder: pathlib.Path) -> pathlib.Path:
    """The file of a scan."""
    return folder / "rest/spect.nii.gz"


@pytest.fixture(scope="session")
def fit(scan: pathlib.Path) -> vf.Fit:
    """A fit to it."""
    return vf.segment(scan)


@pytest.fixture(scope="session")
def model(scan: pathlib.Path) -> vf.Model:
    """A model of it."""
    return vf.generate(scan, points=100)


@pytest.fixture(scope="session")
def gated(folder: pathlib.Path) -> pathlib.Path:
    """The file of a beat."""
    import sys

    sys.path.insert(0, str(ROOT / "scripts"))
    import nibabel
    import numpy as np

    from lib import gated_phantom  # type: ignore[import-not-found]

    voxels, affine = gated_phantom.beat(str(folder / "rest"))
    image = nibabel.Nifti1Image(voxels.astype(np.int16), affine)
    image.header.set_xyzt_units("mm", "sec")
    nibabel.save(image, folder / "gated.nii.gz")
    return folder / "gated.nii.gz"


@pytest.fixture(scope="session")
def raw(folder: pathlib.Path) -> pathlib.Path:
    """Projections of the scan."""
    import sys

    sys.path.insert(0, str(ROOT / "scripts"))
    import nibabel

    from lib.nm import projections  # type: ignore[import-not-found]

    image = nibabel.as_closest_canonical(nibabel.load(folder / "rest/spect.nii.gz"))
    projections(folder / "raw.dcm", image.get_fdata()[::-1, ::-1], 6.4, 1)
    return folder / "raw.dcm"


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a service of its own."""
    folder = tmp_path_factory.mktemp("service")
    log = folder / "log"
    with log.open("wb") as out:
        arguments = ["serve", "--listen", "127.0.0.1:0", "--data-dir", folder / "data"]
        process = subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=out, stderr=out)
    try:
        found = None
        for _ in range(600):
            found = re.search(r"http://127[0-9.:]*", log.read_text())
            if found or process.poll() is not None:
                break
            time.sleep(0.1)
        assert found, log.read_text()
        yield found[0]
    finally:
        process.terminate()
        process.wait(30)
