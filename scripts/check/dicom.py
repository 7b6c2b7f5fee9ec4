"""Writes NM files of one scan, segments them with ventriform and reads the DICOM objects back.

usage: dicom.py VENTRIFORM DIR [--orientations]

DIR/phantom/spect.nii.gz is the scan; with --orientations it is stored along the axes in each of the 48
orders and directions instead of in the cases of cases(). For every case below the file's geometry is computed here,
after PS3.3 C.8.4.15, and the objects are compared with mask.nii.gz and mesh.json of the same run:

- mask.dcm, read by highdicom and by dcmqi: every voxel of segment 1, by its place in the patient; segment 2, the
  cavity, has the volume of report.json and shares no voxel;
- contours.dcm: voxel centres inside the polygons of every slice;
- mesh.dcm: every vertex of the STL within 0.01 mm, also of the glTF's; surface.dcm: points and triangles;
- measurements.dcm, read by highdicom and by dcmqi: the volumes of report.json, each of wall, cavity, and the apparent
  and anatomical ones in a group whose site and method say which it is;
- of a beat of 16 gates: mask_ed.dcm and mask_es.dcm, as mask.dcm, whose frames refer to the frames of their own gate;
  measurements.dcm, read by highdicom and by dcmqi: the figures of beat.json;
- fhir.json of a beat and of a comparison, read by the models of fhir.resources: patient, study, the same figures;
- of a comparison of two studies: measurements.dcm, read likewise: the figures of comparison.json, the images of both
  studies; pictures, which belong to the study of the scan at stress;
- all: patient, study, Frame of Reference, source; no private attribute, none that is not of the IOD, none
  missing that it asks for (tables of highdicom); codes have the meaning of PS3.16 (tables of pydicom).
"""

import glob
import itertools
import json
import struct
import subprocess
import sys
from pathlib import Path

import highdicom
import nibabel
import numpy as np
import pydicom
from fhir.resources.R4B.bundle import Bundle
from highdicom import _standard_utils as standard
from pydicom.sr._concepts_dict import concepts

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from lib import gated_phantom
from lib.nm import LPS, nm

NAMES = ["mask", "contours", "mesh", "surface", "measurements", "polar", "page"]


def cases(voxels, affine):
    """Name, voxels, affine and number of gates: the same patient, stored in different ways."""
    yield "plain", voxels, affine, 1
    last = np.eye(4)
    last[2, 2], last[2, 3] = -1, voxels.shape[2] - 1
    yield "negative", voxels[:, :, ::-1], affine @ last, 1
    # Sagittal slices, turned a little.
    turn = np.eye(4)
    a, b = np.radians([8, -11])
    turn[:3, :3] = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]) @ np.array(
        [[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]]
    )
    swap = np.eye(4)[:, [1, 2, 0, 3]]
    yield "oblique", voxels.transpose(1, 2, 0), turn @ affine @ swap, 1
    yield "gated", voxels, affine, 2


def orientations(voxels, affine):
    """As cases(): rows, columns and slices along each axis of the grid in each direction, half of them with a
    negative spacing."""
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1, -1), repeat=3):
            stored = voxels.transpose(order)[tuple(slice(None, None, sign) for sign in signs)]
            turn = np.eye(4)
            turn[:3, :3] = 0
            for column, (axis, sign) in enumerate(zip(order, signs)):
                turn[axis, column] = sign
                turn[axis, 3] = 0 if sign > 0 else voxels.shape[axis] - 1
            name = "".join(f"{'+' if sign > 0 else '-'}{'ijk'[axis]}" for axis, sign in zip(order, signs))
            yield name, stored, affine @ turn, 1


def same_voxels(found, found_affine, mask, affine):
    """Whether the voxels of two masks lie at the same places; the affines map indices to LPS mm."""
    points = np.argwhere(found) @ found_affine[:3, :3].T + found_affine[:3, 3]
    indices = (points - affine[:3, 3]) @ np.linalg.inv(affine[:3, :3]).T
    nearest = np.rint(indices).astype(int)
    truth = np.argwhere(mask)
    return (
        len(nearest) == len(truth)
        and np.abs(indices - nearest).max() < 0.01
        and {*map(tuple, nearest)} == {*map(tuple, truth)}
    )


def check_mask(out, mask, affine, cavity_ml):
    seg = highdicom.seg.segread(out / "mask.dcm")
    assert seg.number_of_segments == 2 and seg.NumberOfFrames == 2 * mask.shape[2]
    volume = seg.get_volume(combine_segments=True)
    assert same_voxels(volume.array == 1, volume.affine, mask, affine), "highdicom: other voxels"
    folder = out / "dcmqi"
    folder.mkdir()
    program = Path(sys.executable).parent / "segimage2itkimage"
    subprocess.run(
        [
            program,
            "--inputDICOM",
            out / "mask.dcm",
            "--outputDirectory",
            folder,
            "--outputType",
            "nii",
            "--mergeSegments",
        ],
        check=True,
        capture_output=True,
    )
    image = nibabel.load(glob.glob(str(folder / "*.nii*"))[0])
    labels = np.asarray(image.dataobj)
    assert same_voxels(labels == 1, LPS @ image.affine, mask, affine), "dcmqi: other voxels"
    cavity = (volume.array == 2).sum() * abs(np.linalg.det(affine[:3, :3])) / 1000
    assert (labels == 2).sum() == (volume.array == 2).sum()
    assert abs(cavity / cavity_ml - 1) < 0.1, f"the cavity has {cavity} ml, not {cavity_ml}"
    return seg


def inside(polygon, points):
    """Which points (n, 2) lie inside the polygon, by parity."""
    result = np.zeros(len(points), bool)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0)):
        crosses = (a[1] > points[:, 1]) != (b[1] > points[:, 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            x = a[0] + (b[0] - a[0]) * (points[:, 1] - a[1]) / (b[1] - a[1])
        result ^= crosses & (points[:, 0] < x)
    return result


def check_contours(out, mask, affine):
    data = pydicom.dcmread(out / "contours.dcm")
    back = np.linalg.inv(affine)
    found = np.zeros(mask.shape, bool)
    grid = np.argwhere(np.ones(mask.shape[:2], bool))
    for contour in data.ROIContourSequence[0].ContourSequence:
        points = np.array(contour.ContourData, float).reshape(-1, 3) @ back[:3, :3].T + back[:3, 3]
        k = round(points[0, 2])
        assert np.abs(points[:, 2] - k).max() < 1e-3, "a contour leaves its slice"
        found[:, :, k] ^= inside(points[:, :2], grid).reshape(mask.shape[:2])
    # Polygons are rounded to the thousandth of a millimetre.
    assert (found != mask).sum() <= 2, "contours: other voxels"


def check_meshes(out, mesh):
    vertices, triangles = np.array(mesh["vertices"]), np.array(mesh["triangles"])
    data = pydicom.dcmread(out / "mesh.dcm")
    stl = data.EncapsulatedDocument[: data.EncapsulatedDocumentLength]
    count = struct.unpack("<I", stl[80:84])[0]
    facets = np.frombuffer(stl[84:], dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    assert count == len(triangles) == len(facets)
    assert np.abs(facets["v"] - vertices[triangles]).max() < 0.01, "STL: other vertices"
    points = gltf_points((out / "mesh.glb").read_bytes())
    apart = np.linalg.norm(facets["v"].reshape(-1, 1, 3) - points, axis=2)
    assert max(apart.min(0).max(), apart.min(1).max()) < 0.01, "STL and glTF: other vertices"
    surface = pydicom.dcmread(out / "surface.dcm").SurfaceSequence[0]
    points = np.frombuffer(surface.SurfacePointsSequence[0].PointCoordinatesData, "<f4").reshape(-1, 3)
    assert np.abs(points - vertices).max() < 0.01, "surface: other points"
    lists = surface.SurfaceMeshPrimitivesSequence[0].LongTrianglePointIndexList
    assert (np.frombuffer(lists, "<u4").reshape(-1, 3) == triangles + 1).all(), "surface: other triangles"


def gltf_points(glb):
    """The vertices of a binary glTF as it stores them: millimetres, LPS."""
    length = struct.unpack("<I", glb[12:16])[0]
    content, buffer = json.loads(glb[20 : 20 + length]), glb[20 + length + 8 :]
    accessor = content["accessors"][content["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    view = content["bufferViews"][accessor["bufferView"]]
    first = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    return np.frombuffer(buffer, "<f4", 3 * accessor["count"], first).reshape(-1, 3)


def check_attributes(data):
    """What the modules of the object's IOD ask for is there, and nothing else."""
    allowed, wrong = set(), []
    for module in standard.get_iod_module_map()[standard.get_sop_class_iod_map()[data.SOPClassUID]]:
        for attribute in standard.get_module_attribute_map().get(module["key"], []):
            path, name = attribute["path"], attribute["keyword"]
            if not path:
                allowed.add(name)
            # Content items are alternatives, and functional groups may be shared or of each frame.
            apart = {"SharedFunctionalGroupsSequence", "PerFrameFunctionalGroupsSequence"} & {*path}
            content = module["key"].startswith("sr-document-content")
            if module["usage"] != "M" or attribute["type"] not in ("1", "2") or apart or content:
                continue
            items = [data]
            for step in path:
                items = [inner for item in items for inner in item.get(step) or []]
            for item in items:
                if name not in item or (attribute["type"] == "1" and item[name].is_empty):
                    wrong.append("/".join([*path, name]))
    wrong += [e.keyword for e in data if e.keyword not in allowed]
    assert not wrong, f"{data.SOPClassUID.name}: {wrong}"


MEANINGS = {}
for scheme, named in concepts.items():
    for codes in named.values():
        for code, (meaning, _) in codes.items():
            MEANINGS.setdefault((scheme, code), set()).add(meaning.lower())


def check_codes(data):
    """Every code that PS3.16 has carries one of its meanings."""
    for item in [data, *(i for e in data.iterall() if e.VR == "SQ" for i in e.value)]:
        if "CodeValue" in item:
            known = MEANINGS.get((item.CodingSchemeDesignator, item.CodeValue))
            meaning = item.CodeMeaning.lower()
            # A Code Meaning has at most 64 characters, and some of PS3.16 have more.
            cut = [of for of in known or [] if len(of) > 64 and of.startswith(meaning)]
            assert known is None or meaning in known or cut, f"{item.CodeValue}: {meaning}, not {known}"


def check_measurements(out, report, seg):
    sr = highdicom.sr.srread(out / "measurements.dcm")
    (group,) = sr.content.get_volumetric_roi_measurement_groups()
    assert group.referenced_segment is not None
    assert group.tracking_uid == seg.SegmentSequence[0].TrackingUID
    volumes = [float(m.value) for m in group.get_measurements() if m.name.meaning == "Volume"]
    assert np.allclose(volumes, [report["volumes_ml"]["wall"]]), volumes
    groups = {g.tracking_identifier: g for g in sr.content.get_image_measurement_groups()}
    program = Path(sys.executable).parent / "tid1500reader"
    read = out / "measurements.json"
    subprocess.run(
        [program, "--inputDICOM", out / "measurements.dcm", "--outputMetadata", read], check=True, capture_output=True
    )
    named = {g["TrackingIdentifier"]: g for g in json.loads(read.read_text())["Measurements"]}
    parts = {"cavity": report["volumes_ml"]["cavity"]}
    for way in "apparent", "anatomical":
        parts |= {f"{way} {part}": report["volumes_ml"][way][part] for part in ("wall", "cavity")}
    assert len(groups) == 17 + len(parts), sorted(groups)
    for part, wanted in parts.items():
        name = f"{group.tracking_identifier}, {part}"
        found = [float(m.value) for m in groups[name].get_measurements() if m.name.meaning == "Volume"]
        assert np.allclose(found, [wanted]), (part, found, wanted)
        other = named[name]
        found = [float(m["value"]) for m in other["measurementItems"] if m["quantity"]["CodeMeaning"] == "Volume"]
        assert np.allclose(found, [wanted]), (part, found, wanted)
        cavity = part.endswith("cavity")
        assert (other["FindingSite"]["CodeValue"] == "LV-CAVITY") == cavity, other["FindingSite"]
        if " " in part:
            method = part.split()[0].upper()
            assert groups[name].method.value == method, part
            assert other["measurementMethod"]["CodeValue"] == method, other


def check_beat(program, folder):
    """The objects of a beat, beside beat.json and the labels of its gates."""
    here = folder / "beat"
    here.mkdir()
    voxels, affine = gated_phantom.beat(folder / "phantom", gates=16)
    affine = LPS @ affine
    nm(here / "nm.dcm", voxels, affine, 99, gates=16)
    out = here / "out"
    subprocess.run([program, "beat", here / "nm.dcm", "-o", out, "--dicom"], check=True, capture_output=True)
    report = json.loads((out / "beat.json").read_text())
    source = pydicom.dcmread(here / "nm.dcm")
    for name, gate in ("ed", report["end_diastole_gate"]), ("es", report["end_systole_gate"]):
        check_object(pydicom.dcmread(out / f"mask_{name}.dcm"))
        seg = highdicom.seg.segread(out / f"mask_{name}.dcm")
        labels = np.asarray(nibabel.load(out / f"labels_gate{gate:02}.nii.gz").dataobj)
        volume = seg.get_volume(combine_segments=True)
        for label in 1, 2:
            assert same_voxels(volume.array == label, volume.affine, labels == label, affine), name
        own = {n + 1 for n, slot in enumerate(source.TimeSlotVector) if slot == gate}
        named = {
            frame.DerivationImageSequence[0].SourceImageSequence[0].ReferencedFrameNumber
            for frame in seg.PerFrameFunctionalGroupsSequence
        }
        assert named == own, (name, named, own)
    check_object(pydicom.dcmread(out / "measurements.dcm"))
    wanted = {
        "8821-1": report["edv_ml"],
        "8823-7": report["esv_ml"],
        "90096001": report["sv_ml"],
        "70822001": report["ef_percent"],
        "122447": report["mass_g"],
        "122616": report["rates"]["peak_ejection_edv_per_s"],
        "122618": report["rates"]["peak_filling_edv_per_s"],
        "PHASE-SD": report["phase"]["sd_degrees"],
        "PHASE-BANDWIDTH": report["phase"]["bandwidth_degrees"],
    }
    check_fhir(out, wanted)
    sr = highdicom.sr.srread(out / "measurements.dcm")
    groups = sr.content.get_image_measurement_groups()
    ends = {
        g.tracking_identifier.split(", ")[-1]: {
            c.value.value for c in g[0].ContentSequence if c.name.value == "246092007"
        }
        for g in groups
        if ", " in g.tracking_identifier
    }
    assert ends == {"end diastole": {"416190007"}, "end systole": {"416430001"}}, ends
    assert len(groups) == 3 + len(report["segments"]), len(groups)
    found = {m.name.value: float(m.value) for g in groups[:3] for m in g.get_measurements()}
    program = Path(sys.executable).parent / "tid1500reader"
    read = out / "measurements.json"
    subprocess.run(
        [program, "--inputDICOM", out / "measurements.dcm", "--outputMetadata", read], check=True, capture_output=True
    )
    named = json.loads(read.read_text())["Measurements"]
    other = {m["quantity"]["CodeValue"]: float(m["value"]) for g in named[:3] for m in g["measurementItems"]}
    for code, value in wanted.items():
        assert np.isclose(found[code], value) and np.isclose(other[code], value), (code, found, other, value)
    # The ranges of uncertainty are properties of their measurements.
    for code, value, (low, high) in [
        ("8821-1", report["edv_ml"], report["edv_interval_ml"]),
        ("8823-7", report["esv_ml"], report["esv_interval_ml"]),
        ("70822001", report["ef_percent"], report["ef_interval_percent"]),
    ]:
        [of_figure] = [m for g in groups[:3] for m in g.get_measurements() if m.name.value == code]
        ranges = {
            c.name.value: float(c.value)
            for c in of_figure[0].ContentSequence
            if c.relationship_type.value == "HAS PROPERTIES"
        }
        assert np.isclose(ranges["371885007"], value - low) and np.isclose(ranges["371886008"], high - value), ranges
    for group, segment in zip(groups[3:], report["segments"]):
        found = {m.name.value: float(m.value) for m in group.get_measurements()}
        assert np.isclose(found["59092-7"], segment["thickening_percent"]), segment
        assert np.isclose(found["60797005"], segment["motion_mm"]), segment
    print(f"beat: EF {report['ef_percent']} %, 3 objects as they must be")


def check_comparison(program, folder):
    """The objects of a comparison of two studies of one patient, beside comparison.json."""
    here = folder / "comparison"
    here.mkdir()
    made = {"rest": folder / "phantom", "stress": here / "phantom"}
    options = ["--size", "64", "--spacing", "6.4", "--seed", "5"]
    for segment in 7, 8, 13, 14:
        options += ["--defect", f"{segment}:0.6"]
    subprocess.run([program, "phantom", "-o", made["stress"], *options], check=True, capture_output=True)
    for number, (name, phantom) in enumerate(made.items()):
        image = nibabel.load(phantom / "spect.nii.gz")
        nm(here / f"{name}.dcm", np.asarray(image.dataobj).clip(0), LPS @ image.affine, 70 + number)
        data = pydicom.dcmread(here / f"{name}.dcm")
        data.PatientID, data.SeriesDescription = "PH70", name
        data.save_as(here / f"{name}.dcm")
    out = here / "out"
    scans = ["--stress", here / "stress.dcm", "--rest", here / "rest.dcm"]
    subprocess.run([program, "compare", *scans, "-o", out, "--dicom"], check=True, capture_output=True)
    report = json.loads((out / "comparison.json").read_text())
    stress, rest = (pydicom.dcmread(here / f"{name}.dcm") for name in ("stress", "rest"))
    check_fhir(out, {"428832008": report["tid"], "REVERSIBLE": report["reversible_percent"]})
    for name in "measurements", "page", "polar_stress", "polar_rest", "polar_difference":
        data = pydicom.dcmread(out / f"{name}.dcm")
        check_object(data)
        assert data.StudyInstanceUID == stress.StudyInstanceUID and data.PatientID == stress.PatientID, name
        if name != "measurements":
            assert stress.SOPInstanceUID in str(data), name
            assert data.pixel_array.shape == (data.Rows, data.Columns, 3), name
            assert data.BurnedInAnnotation == ("YES" if name == "page" else "NO"), name
    sr = highdicom.sr.srread(out / "measurements.dcm")
    evidence = {
        s.StudyInstanceUID
        for name in ("CurrentRequestedProcedureEvidenceSequence", "PertinentOtherEvidenceSequence")
        for s in sr[name].value
    }
    assert evidence == {stress.StudyInstanceUID, rest.StudyInstanceUID}, evidence
    groups = sr.content.get_image_measurement_groups()
    states = {
        g.tracking_identifier: c.value.value for g in groups for c in g[0].ContentSequence if c.name.value == "109054"
    }
    assert states["Left ventricle myocardium at stress"] == "432655005" and states["Segment 7, rest"] == "128975004", (
        states
    )
    whole = next(g for g in groups if g.tracking_identifier == "Left ventricle myocardium, rest and stress")
    comments = " ".join(c.value for c in whole[0].ContentSequence if c.name.value == "121106")
    verdict = report["reversible_verdict"].replace("_", " ")
    assert f"Reversible: {verdict}" in comments, comments
    share = next(m for m in whole.get_measurements() if m.name.value == "REVERSIBLE")
    ends = {c.name.value: float(c.value) for c in share[0].ContentSequence if c.value_type.value == "NUM"}
    low, high = report["reversible_interval_percent"]
    assert np.isclose(share.value - ends["371885007"], low) and np.isclose(share.value + ends["371886008"], high), ends
    read = out / "measurements.json"
    subprocess.run(
        [
            Path(sys.executable).parent / "tid1500reader",
            "--inputDICOM",
            out / "measurements.dcm",
            "--outputMetadata",
            read,
        ],
        check=True,
        capture_output=True,
    )
    named = {
        m["TrackingIdentifier"]: {i["quantity"]["CodeValue"]: float(i["value"]) for i in m["measurementItems"]}
        for m in json.loads(read.read_text())["Measurements"]
    }
    found = {g.tracking_identifier: {m.name.value: float(m.value) for m in g.get_measurements()} for g in groups}
    assert found.keys() == named.keys(), found.keys() ^ named.keys()
    for figures in found, named:
        both = figures["Left ventricle myocardium, rest and stress"]
        assert np.isclose(both["428832008"], report["tid"]) and np.isclose(
            both["REVERSIBLE"], report["reversible_percent"]
        )
        for segment in report["segments"]:

            def of(state):
                return figures[f"Segment {segment['segment']}, {state}"]

            assert np.isclose(of("stress")["251053005"], segment["stress_percent"]), segment
            assert np.isclose(of("rest")["251053005"], segment["rest_percent"]), segment
            assert np.isclose(of("change")["DIFFERENCE"], segment["difference_points"]), segment
    print(f"comparison: {report['reversible_percent']} % reversible, 5 objects as they must be")


def check_fhir(out, report):
    """The structured report as FHIR resources, by the models of R4."""
    bundle = Bundle.model_validate(json.loads((out / "fhir.json").read_text()))
    resources = [entry.resource for entry in bundle.entry]
    diagnostic = resources[0]
    assert (diagnostic.get_resource_type(), diagnostic.status) == ("DiagnosticReport", "preliminary")
    data = pydicom.dcmread(out / "measurements.dcm")
    patient = next(own for own in resources if own.get_resource_type() == "Patient")
    assert patient.identifier[0].value == data.PatientID
    studies = {own.identifier[0].value for own in resources if own.get_resource_type() == "ImagingStudy"}
    assert f"urn:oid:{data.StudyInstanceUID}" in studies
    found = {}
    for own in resources:
        if own.get_resource_type() == "Observation" and own.valueQuantity:
            found.setdefault(own.code.coding[0].code, []).append(float(own.valueQuantity.value))
    for code, value in report.items():
        assert any(abs(one - value) < 1e-3 for one in found[code]), (code, value, found.get(code))


def check_object(data):
    assert not any(e.tag.is_private for e in data.iterall()), data.SOPClassUID.name
    check_attributes(data)
    check_codes(data)


def check_results(out, mask, affine):
    """The objects in `out` beside mesh.json, mesh.glb and report.json of the same result."""
    report = json.loads((out / "report.json").read_text())
    seg = check_mask(out, mask, affine, report["volumes_ml"]["cavity"])
    check_contours(out, mask, affine)
    check_meshes(out, json.loads((out / "mesh.json").read_text()))
    check_measurements(out, report, seg)


def main():
    program, folder = sys.argv[1], Path(sys.argv[2])
    image = nibabel.load(folder / "phantom/spect.nii.gz")
    voxels = np.asarray(image.dataobj).clip(0)
    stored_as = orientations if "--orientations" in sys.argv else cases
    for number, (name, stored, affine, gates) in enumerate(stored_as(voxels, LPS @ image.affine)):
        here = folder / name
        here.mkdir()
        nm(here / "nm.dcm", stored, affine, number, gates)
        out = here / "out"
        command = [program, "segment", here / "nm.dcm", "--model", "auto", "-o", out, "--dicom"]
        command += ["--frame", "1"] if gates > 1 else []
        subprocess.run(command, check=True, capture_output=True)
        image = nibabel.load(out / "mask.nii.gz")
        mask = np.asarray(image.dataobj) > 0
        assert mask.shape == stored.shape and mask.sum() > 100
        source = pydicom.dcmread(here / "nm.dcm")
        for kind in NAMES:
            data = pydicom.dcmread(out / f"{kind}.dcm")
            for attribute in ("PatientName", "PatientID", "StudyInstanceUID", "AccessionNumber"):
                assert data[attribute].value == source[attribute].value, (kind, attribute)
            frame = data.get("FrameOfReferenceUID", source.FrameOfReferenceUID)
            assert frame == source.FrameOfReferenceUID, kind
            text = str(data)
            assert source.SOPInstanceUID in text, f"{kind} does not name its source"
            check_object(data)
        check_results(out, mask, affine)
        print(f"{name}: {mask.sum()} voxels, 7 objects as they must be")
    check_beat(program, folder)
    check_comparison(program, folder)


if __name__ == "__main__":
    main()
