"""What type checkers, `help` and `inspect` tell."""

from __future__ import annotations

import inspect
import pydoc
import re
import subprocess
import sys

import pytest

import ventriform as vf
from ventriform import _tables

SCRIPT = """
import ventriform as vf

scan = vf.read("rest.dcm")
model: vf.Model = vf.generate(scan, points=150, seed=1)
points: int = model.report.mesh.vertices
fit = vf.segment(scan, model=[model, "auto"], edge="anatomical")
share: float = fit.confidence
wall: float = fit.report.volumes_ml.wall
for flag in fit.flags:
    print(flag.code.upper(), fit.mask.sum(), fit.polar[0, 0])
beat = vf.beat("gated.nii.gz", mass_g=130.0)
ef: float | None = beat.report.ef_percent
with vf.Client("http://127.0.0.1:8080", "key") as service:
    job: str = service.submit("model", "vol_1", points=100).id
"""


MISTAKES = [
    'vf.generate("a", points="many")',
    'vf.generate("a", pointz=3)',
    'vf.segment("a", edge="inner")',
    'vf.segment("a").masks',
]


@pytest.fixture(scope="module")
def errors(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """The errors that the checker finds, by the name of the script. One run: each reads the types of NumPy anew."""
    folder = tmp_path_factory.mktemp("typed")
    scripts = {"right": SCRIPT} | {
        f"mistake{n}": f"import ventriform as vf\n{text}\n" for n, text in enumerate(MISTAKES)
    }
    for name, script in scripts.items():
        (folder / f"{name}.py").write_text(script)
    command = [sys.executable, "-m", "mypy", "--strict", "--no-incremental", "--cache-dir", folder / "cache"]
    made = subprocess.run([*command, *(f"{name}.py" for name in scripts)], capture_output=True, text=True, cwd=folder)
    lines = made.stdout.splitlines()
    assert lines and lines[-1].startswith("Found "), made.stdout + made.stderr
    found = {name: [line for line in lines if line.startswith(f"{name}.py:")] for name in scripts}
    # An error in the package itself is one of every script.
    found["right"] = [line for line in lines[:-1] if not line.startswith("mistake")]
    return found


def test_a_users_script_is_well_typed(errors: dict[str, list[str]]) -> None:
    assert errors["right"] == []


@pytest.mark.parametrize("number", range(len(MISTAKES)), ids=MISTAKES)
def test_a_mistake_is_seen_by_the_checker(number: int, errors: dict[str, list[str]]) -> None:
    found = errors[f"mistake{number}"]
    assert any(line.startswith(f"mistake{number}.py:2: error: ") for line in found), found


@pytest.mark.parametrize("name", ["generate", "segment", "beat", "compare", "calibrate", "build_normals"])
def test_help_shows_every_parameter_with_its_range(name: str) -> None:
    function = getattr(vf, name)
    signature, text = inspect.signature(function), pydoc.render_doc(function, renderer=pydoc.plaintext)
    rows = _tables.rows(name.removeprefix("build_"))
    assert len(rows) > 20
    for row in rows:
        parameter = signature.parameters[row["name"]]
        assert parameter.default == _tables.default(row)
        if row["name"] in ("label", "reader") and f"    {row['name']} : " not in text:
            continue
        assert f"{row['name']} : {_tables.values(row)}" in text, row["name"]
        assert " ".join(_tables.summary(row).split()) in text


@pytest.mark.parametrize(
    "name", ["generate", "segment", "beat", "compare", "calibrate", "build_normals", "measure", "evaluate"]
)
def test_the_command_has_the_same_parameters(name: str, command: object) -> None:
    """Every flag of the command is a parameter here, but those that name files, limits and DICOM objects."""
    from conftest import PROGRAM

    words = ["normals", "build"] if name == "build_normals" else [name]
    told = subprocess.run([PROGRAM, *words, "--help"], capture_output=True, text=True, check=True).stdout
    # The example at the end has flags of other commands.
    told = told.partition("\nExample")[0]
    flags = set(re.findall(r"^ +(?:-\w, )?--([a-z0-9-]+)", told, re.MULTILINE))
    elsewhere = {
        "output",
        "report",
        "part",
        "format",
        "quiet",
        "help",
        "version",
        "dicom",
        "patient-id",
        "patient-name",
        "patient-birth-date",
        "patient-sex",
        "study-uid",
        "study-date",
        "study-id",
        "accession-number",
        "referring-physician",
        "frame-of-reference-uid",
        "deidentify",
        "deidentify-secret",
        "made-at",
        "file-limit",
        "folder-limit",
        "mesh-limit",
        "model",
        "expert",
        "reader",
        "cohort",
        "out",
        "stress",
        "rest",
        # To study the effect of support springs, not to fit.
        "support",
        "support-radius",
        "support-scaling",
        "no-align",
    }
    ours = {parameter.replace("_", "-") for parameter in inspect.signature(getattr(vf, name)).parameters}
    assert len(flags) > 5
    assert flags - elsewhere - ours == set()
