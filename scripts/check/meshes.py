"""Meshes that trimesh and VTK write, read as experts' masks: the mask of a fit is what lies inside its mesh.

usage: meshes.py PROGRAM FIT DIR

FIT is a folder of `ventriform segment` with mesh.json (and other formats of it) and mask.nii.gz. Each of its meshes,
and its mesh written by trimesh and VTK in every way they know, must agree with the mask in every voxel, in LPS and RAS,
in millimetres, centimetres and metres where that is stated; without a statement, other units and open surfaces must be
refused.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import trimesh
import vtk
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

program, fit, out = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
out.mkdir(parents=True, exist_ok=True)
passed = failed = 0


def measure(path, *flags):
    """What `measure` says of a mesh and the mask: Jaccard, or the message."""
    done = subprocess.run([program, "measure", path, fit / "mask.nii.gz", *flags], capture_output=True, text=True)
    return (json.loads(done.stdout)["jaccard"] if done.returncode == 0 else None), done.stderr


def check(name, path, *flags, least=1.0):
    global passed, failed
    jaccard, message = measure(path, *flags)
    good = jaccard is not None and jaccard >= least
    passed, failed = passed + good, failed + (not good)
    if not good:
        print(f"FAILED {name}: Jaccard {jaccard}: {message.strip()}")


def check_refused(name, path, word, *flags):
    global passed, failed
    jaccard, message = measure(path, *flags)
    good = jaccard is None and word in message and "panicked" not in message
    passed, failed = passed + good, failed + (not good)
    if not good:
        print(f"FAILED {name}: not refused with `{word}`: {jaccard} {message.strip()}")


def poly_data(vertices, triangles):
    data, points, cells = vtk.vtkPolyData(), vtk.vtkPoints(), vtk.vtkCellArray()
    points.SetData(numpy_to_vtk(vertices, deep=True))
    fours = np.hstack([np.full((len(triangles), 1), 3), triangles]).astype(np.int64).ravel()
    cells.ImportLegacyFormat(numpy_to_vtkIdTypeArray(fours, deep=True))
    data.SetPoints(points)
    data.SetPolys(cells)
    return data


def write(writer, path, data, **settings):
    writer.SetFileName(str(path))
    writer.SetInputData(data)
    for name, value in settings.items():
        getattr(writer, name)(value) if value is not None else getattr(writer, name)()
    assert writer.Write() == 1, path


def written(vertices, triangles, stem, every=True):
    """The files that the two programs write of the mesh; of VTP in every encoding only if `every`."""
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    for name, options in [("stl", {}), ("ply", {}), ("obj", {})]:
        path = out / f"{stem}_trimesh.{name}"
        mesh.export(path, **options)
        yield path
    mesh.export(out / f"{stem}_trimesh_text.stl", file_type="stl_ascii")
    yield out / f"{stem}_trimesh_text.stl"
    mesh.export(out / f"{stem}_trimesh_text.ply", encoding="ascii")
    yield out / f"{stem}_trimesh_text.ply"
    data = poly_data(vertices, triangles)
    for kind, make in [("text", "SetFileTypeToASCII"), ("binary", "SetFileTypeToBinary")]:
        for ending, writer in [("stl", vtk.vtkSTLWriter()), ("ply", vtk.vtkPLYWriter())]:
            path = out / f"{stem}_vtk_{kind}.{ending}"
            write(writer, path, data, **{make: None})
            yield path
        for version in [42, 51]:
            path = out / f"{stem}_vtk_{kind}_{version}.vtk"
            write(vtk.vtkPolyDataWriter(), path, data, SetFileVersion=version, **{make: None})
            yield path
    big = out / f"{stem}_vtk_big.ply"
    write(vtk.vtkPLYWriter(), big, data, SetDataByteOrderToBigEndian=None)
    yield big
    path = out / f"{stem}_vtk.obj"
    write(vtk.vtkOBJWriter(), path, data)
    yield path
    for mode in ["Ascii", "Binary", "Appended"] if every else []:
        for compressor in ["None", "ZLib"]:
            for header in [32, 64]:
                for encode in [0, 1]:
                    for order in ["LittleEndian", "BigEndian"]:
                        path = out / f"{stem}_{mode}_{compressor}_{header}_{encode}_{order}.vtp"
                        writer = vtk.vtkXMLPolyDataWriter()
                        getattr(writer, f"SetCompressorTypeTo{compressor}")()
                        getattr(writer, f"SetDataModeTo{mode}")()
                        getattr(writer, f"SetByteOrderTo{order}")()
                        getattr(writer, f"SetHeaderTypeToUInt{header}")()
                        writer.SetEncodeAppendedData(encode)
                        write(writer, path, data)
                        yield path


source = json.loads((fit / "mesh.json").read_text())
vertices, triangles = np.array(source["vertices"]), np.array(source["triangles"])
for path in sorted(fit.glob("mesh.*")):
    # Single precision moves a surface by less than a hundred-thousandth of a voxel: no centre is as near as that.
    check(f"our {path.name}", path)
for path in written(vertices, triangles, "lps"):
    check(path.name, path, least=0.999)
for path in written(vertices * [-1, -1, 1], triangles, "ras", every=False):
    check(path.name, path, "--mesh-frame", "ras", least=0.999)
for unit, scale, factor in [("cm", 0.1, "10"), ("m", 0.001, "1000")]:
    for path in written(vertices * scale, triangles, unit, every=False):
        check(path.name, path, "--mesh-unit", unit, least=0.98)
        check_refused(path.name, path, f"factor {factor}")
for path in written(vertices, triangles[:-1], "open", every=False):
    check_refused(path.name, path, "open: 3 edges")
glb = out / "trimesh.glb"
trimesh.Trimesh(vertices, triangles, process=False).export(glb)
check("trimesh.glb", glb, "--mesh-unit", "mm", "--mesh-frame", "lps", least=0.999)
check_refused("trimesh.glb", glb, "m across")
print(f"meshes: {passed} passed, {failed} failed")
sys.exit(failed > 0)
