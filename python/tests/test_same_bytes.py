"""The files of the package are those of the command, byte for byte."""

from __future__ import annotations

import json
import pathlib
import pickle

import pytest
from conftest import DATA, Command

import ventriform as vf

FORMATS = ["glb", "gltf", "stl", "ply", "obj", "vtp", "vtk", "json"]


def assert_same(ours: vf.Files, folder: pathlib.Path) -> None:
    theirs = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert sorted(ours) == sorted(theirs)
    for name, content in theirs.items():
        assert ours[name] == content, name


def test_a_model_in_every_format_and_its_parts(
    scan: pathlib.Path, model: vf.Model, command: Command, tmp_path: pathlib.Path
) -> None:
    outputs = [argument for name in FORMATS for argument in ("-o", tmp_path / f"lv.{name}")]
    command("generate", scan, *outputs, "--points", 100, "--report", tmp_path / "report.json")
    for name in FORMATS:
        model.save(tmp_path / f"ours.{name}")
        assert (tmp_path / f"ours.{name}").read_bytes() == (tmp_path / f"lv.{name}").read_bytes(), name
    command("generate", scan, "-o", tmp_path / "part.stl", "--points", 100, "--part", "endocardium")
    assert model.to_bytes("stl", "endocardium") == (tmp_path / "part.stl").read_bytes()
    theirs = json.loads((tmp_path / "report.json").read_text())
    ours = model.report.to_dict()
    assert theirs.pop("timings_ms").keys() == ours.pop("timings_ms").keys()
    assert ours == theirs


def test_a_fit(scan: pathlib.Path, fit: vf.Fit, command: Command, tmp_path: pathlib.Path) -> None:
    command("segment", scan, "--model", "auto", "-o", tmp_path / "out")
    assert_same(fit.files, tmp_path / "out")
    fit.save(tmp_path / "ours")
    assert_same(fit.files, tmp_path / "ours")


def test_a_fit_with_a_model_an_expert_parts_and_parameters(
    scan: pathlib.Path, model: vf.Model, folder: pathlib.Path, command: Command, tmp_path: pathlib.Path
) -> None:
    model.save(tmp_path / "lv.json")
    truth = folder / "rest/lv_truth.nii.gz"
    command(
        "segment",
        scan,
        "--model",
        tmp_path / "lv.json",
        "--model",
        "auto",
        "-o",
        tmp_path / "out",
        "--expert",
        truth,
        "--format",
        "ply",
        "--part",
        "base",
        "--edge",
        "anatomical",
        "--polar-blur",
        2,
    )
    ours = vf.segment(
        scan,
        model=[tmp_path / "lv.json", "auto"],
        expert=truth,
        formats=["ply"],
        parts=["base"],
        edge="anatomical",
        polar_blur=2,
    )
    assert_same(ours.files, tmp_path / "out")
    assert ours.report.measures is not None and ours.report.measures.jaccard > 0.6


def test_a_beat(gated: pathlib.Path, command: Command, tmp_path: pathlib.Path) -> None:
    command("beat", gated, "-o", tmp_path / "out")
    ours = vf.beat(gated)
    assert_same(ours.files, tmp_path / "out")
    assert ours.vertices.shape == (8, len(ours.surfaces[0].vertices), 3)


def test_a_comparison(folder: pathlib.Path, command: Command, tmp_path: pathlib.Path) -> None:
    stress, rest = (folder / name / "spect.nii.gz" for name in ("stress", "rest"))
    command("compare", "--stress", stress, "--rest", rest, "-o", tmp_path / "out")
    ours = vf.compare(stress=stress, rest=rest)
    assert_same(ours.files, tmp_path / "out")
    assert ours.polar("difference").shape == (32, 60)
    assert ours.report.to_dict() == json.loads((tmp_path / "out/comparison.json").read_text())
    assert [segment.segment for segment in ours.report.segments] == list(range(1, 18))
    assert ours.report.segments[7].reversible_percent > 20


def test_scans_over_the_years(folder: pathlib.Path, command: Command, tmp_path: pathlib.Path) -> None:
    stress, rest = (folder / name / "spect.nii.gz" for name in ("stress", "rest"))
    command("serial", stress, rest, "-o", tmp_path / "out")
    ours = vf.serial(stress, rest)
    assert_same(ours.files, tmp_path / "out")
    assert ours.polar_change(1, 2).shape == ours.polar(2).shape == (32, 60)
    assert ours.report.to_dict() == json.loads((tmp_path / "out/serial.json").read_text())
    # The first one has the defect.
    assert ours.report.pairs[0].better_verdict == "yes"
    assert ours.change("cavity_ml").verdict in ("no", "cannot_tell")


def test_normal_limits(command: Command, tmp_path: pathlib.Path) -> None:
    healthy = tmp_path / "healthy"
    command("phantom", "--normal", "--cases", 14, "-o", healthy)
    command("normals", "build", healthy, "--mixed", "-o", tmp_path / "limits.json")
    limits = vf.build_normals(healthy, mixed=True)
    assert limits.to_bytes() == (tmp_path / "limits.json").read_bytes()
    group = limits.groups[0]
    assert len(group.cases) + len(limits.excluded) == 14 and limits.document.simulated
    scan = next(healthy.rglob("*.nii.gz"))
    command("segment", scan, "--model", "auto", "--normals", tmp_path / "limits.json", "-o", tmp_path / "out")
    ours = vf.segment(scan, normals=pickle.loads(pickle.dumps(limits)))
    assert_same(ours.files, tmp_path / "out")
    assert ours.report.perfusion is not None and ours.report.perfusion.summed_score < 10


def test_measured_masks(
    scan: pathlib.Path, fit: vf.Fit, folder: pathlib.Path, command: Command, tmp_path: pathlib.Path
) -> None:
    fit.save(tmp_path)
    truth = folder / "rest/lv_truth.nii.gz"
    theirs = json.loads(command("measure", tmp_path / "mask.nii.gz", truth))
    assert vf.measure(tmp_path / "mask.nii.gz", truth).to_dict() == theirs
    assert vf.measure(fit, vf.read(truth)).to_dict() == theirs
    labelled = json.loads(command("measure", tmp_path / "labels.nii.gz", truth, "--label", 1))
    assert vf.measure(tmp_path / "labels.nii.gz", truth, label=1).to_dict() == labelled


def test_a_calibration_and_an_evaluation(folder: pathlib.Path, command: Command, tmp_path: pathlib.Path) -> None:
    cohort = tmp_path / "cohort"
    for number, case in enumerate(("rest", "stress")):
        (cohort / f"p{number}").mkdir(parents=True)
        for theirs, ours in (("spect", "spect"), ("lv_truth", "lv_expert_img"), ("lv_truth", "lv_truth")):
            (cohort / f"p{number}/{ours}.nii.gz").write_bytes((folder / case / f"{theirs}.nii.gz").read_bytes())
    command("calibrate", cohort, "-o", tmp_path / "reader.json")
    made = vf.calibrate(cohort)
    assert made.profile.to_bytes() == (tmp_path / "reader.json").read_bytes()
    assert [case["case"] for case in made.cases] == ["p0", "p1"]
    pairs = [(cohort / f"{case}/spect.nii.gz", cohort / f"{case}/lv_expert_img.nii.gz") for case in ("p0", "p1")]
    named = {case: pair for case, pair in zip(("p0", "p1"), pairs, strict=True)}
    contents = [(scan.read_bytes(), vf.read(mask)) for scan, mask in pairs]
    for cases in (named, pairs, iter(pairs), reversed(pairs), contents):
        assert vf.calibrate(cases).profile.to_bytes() == made.profile.to_bytes()
    assert vf.calibrate(named).cases == made.cases
    assert [case["case"] for case in vf.calibrate(pairs).cases] == ["case1", "case2"]
    # Arrays have hashes of their own, and teach the same.
    volumes = [vf.read(scan) for scan, _ in pairs]
    masks = [vf.read(mask) for _, mask in pairs]
    arrays = [tuple(vf.Volume(one.array, one.affine) for one in pair) for pair in zip(volumes, masks, strict=True)]
    ours, theirs = (json.loads(one.profile.to_bytes()) for one in (vf.calibrate(arrays), made))
    assert ours.pop("learnt_on") != theirs.pop("learnt_on") and ours == theirs
    assert vf.calibrate(arrays).profile.to_bytes() == vf.calibrate(arrays).profile.to_bytes()
    read_back = vf.segment(cohort / "p0/spect.nii.gz", reader=made.profile)
    command(
        "segment",
        cohort / "p0/spect.nii.gz",
        "--model",
        "auto",
        "--reader",
        tmp_path / "reader.json",
        "-o",
        tmp_path / "out",
    )
    assert_same(read_back.files, tmp_path / "out")

    (cohort / "p0").rename(cohort / "t0")
    evaluation = vf.evaluate(cohort, tmp_path / "ours", points=[67], models=["optimised", "auto"])
    arguments = ["--points", 67, "--models", "optimised,auto", "--output", tmp_path / "theirs"]
    command("evaluate", cohort, *arguments)
    for name in ("table1.csv", "figure3.csv"):
        assert (tmp_path / "ours" / name).read_bytes() == (tmp_path / "theirs" / name).read_bytes()
    assert evaluation.table("table1") and evaluation.to_dict()
    kept = vf.evaluate(cohort, points=[67], models=["optimised", "auto"])
    assert kept.to_dict() == evaluation.to_dict() and kept.table("fits") == evaluation.table("fits")
    temporary = pathlib.Path(kept.folder)
    del kept
    assert not temporary.exists()


@pytest.mark.skipif(not (DATA / "cohort").is_dir(), reason="../shared/data/cohort is absent")
@pytest.mark.parametrize("case", sorted(path.name for path in (DATA / "cohort").glob("*") if path.is_dir()))
def test_a_case_of_the_cohort(case: str, command: Command, tmp_path: pathlib.Path) -> None:
    scan = DATA / "cohort" / case / "spect.nii.gz"
    command("segment", scan, "--model", "auto", "-o", tmp_path / "out", "--format", "stl")
    assert_same(vf.segment(scan, formats=["stl"]).files, tmp_path / "out")
