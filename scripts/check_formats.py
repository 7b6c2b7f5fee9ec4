"""Reads exported meshes with trimesh and VTK and compares them with the JSON of the same name.

usage: check_formats.py DIR

Vertices must come back in the same order, equal to the last bit of the precision that format and
reader keep. STL stores no shared vertices; there the distinct positions and the triangles over them
are compared.

Figures of vertices (`uncertainty_mm` and `fields` of the JSON) must be the point arrays of the VTP file,
by their names, lengths and values, and no others; the uncertainty also the attribute `_UNCERTAINTY` of
glTF files, whose vertices have a colour where there is a field.
"""
import json
import sys
from pathlib import Path

import numpy as np
import trimesh
import vtk
from vtk.util.numpy_support import vtk_to_numpy

# Node matrix: LPS millimetres to glTF's world (metres, Y up).
WORLD = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1000]]) / 1000


def by_trimesh(path):
    """Vertices and triangles as stored, and the node's matrix (None except for glTF)."""
    if path.suffix in (".glb", ".gltf"):
        scene = trimesh.load(path, process=False)
        (name,) = scene.graph.nodes_geometry
        matrix, geometry = scene.graph[name]
        mesh = scene.geometry[geometry]
        return mesh.vertices, mesh.faces, matrix
    mesh = trimesh.load(path, process=False, maintain_order=True)
    return mesh.vertices, mesh.faces, None


READERS = {
    ".stl": vtk.vtkSTLReader,
    ".ply": vtk.vtkPLYReader,
    ".obj": vtk.vtkOBJReader,
    ".vtp": vtk.vtkXMLPolyDataReader,
}


def by_vtk(path):
    reader = READERS[path.suffix]()
    reader.SetFileName(str(path))
    reader.Update()
    poly = reader.GetOutput()
    vertices = vtk_to_numpy(poly.GetPoints().GetData())
    triangles = vtk_to_numpy(poly.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return vertices, triangles, None


def places(vertices, triangles):
    """A triangle soup as sorted distinct vertices and sorted triangles over them."""
    distinct, index = np.unique(vertices, axis=0, return_inverse=True)
    triangles = index.ravel()[triangles]
    first = triangles.argmin(axis=1)
    turned = np.stack([np.roll(t, -k) for t, k in zip(triangles, first)])
    return distinct, turned[np.lexsort(turned.T[::-1])]


def compare(name, reader, expected, got):
    """The first difference found, as text; None if there is none."""
    vertices, triangles = expected
    found, faces, matrix = got
    found, faces = np.asarray(found), np.asarray(faces, np.int64)
    if reader == "vtk" and name.endswith((".ply", ".obj")):
        found = found.astype(np.float32)  # these VTK readers store single precision
    single = name.endswith((".stl", ".glb", ".gltf")) or found.dtype == np.float32
    if single:
        vertices = vertices.astype(np.float32)
    if name.endswith(".stl"):
        vertices, triangles = places(vertices, triangles)
        found, faces = places(found.astype(np.float32), faces)
    if found.shape != vertices.shape:
        return f"{len(found)} vertices instead of {len(vertices)}"
    if not np.array_equal(found.astype(np.float64), vertices.astype(np.float64)):
        worst = np.abs(found.astype(np.float64) - vertices.astype(np.float64)).max()
        return f"vertices differ by up to {worst:.3g} mm"
    if not np.array_equal(faces, triangles):
        return "triangles differ"
    if matrix is not None and not np.allclose(matrix, WORLD, rtol=0, atol=1e-15):
        return f"the node's matrix is {matrix.tolist()}"
    return None


def figures(document):
    """Figures of the vertices by their names in VTP files; NaN where one is not known."""
    named = dict(document.get("fields", {}))
    if "uncertainty_mm" in document:
        named["Uncertainty"] = document["uncertainty_mm"]
    return {name: np.array(values, np.float64) for name, values in named.items()}


def arrays_by_vtk(path, expected):
    """The first difference of the point arrays of a VTP file, as text; None if there is none."""
    reader = vtk.vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    data = reader.GetOutput().GetPointData()
    names = {data.GetArrayName(n) for n in range(data.GetNumberOfArrays())}
    if names != {"Normals", *expected}:
        return f"arrays {sorted(names)} instead of {sorted({'Normals', *expected})}"
    for name, values in expected.items():
        found = vtk_to_numpy(data.GetArray(name))
        if found.shape != values.shape:
            return f"{name} has {found.shape} values instead of {values.shape}"
        if not np.array_equal(found, values, equal_nan=True):
            return f"{name} differs"
    return None


def figures_by_trimesh(path, expected, painted):
    """The same of the attributes of a glTF file."""
    scene = trimesh.load(path, process=False)
    (mesh,) = scene.geometry.values()
    if "Uncertainty" in expected:
        found = mesh.vertex_attributes.get("_UNCERTAINTY")
        if found is None or not np.array_equal(np.ravel(found), expected["Uncertainty"].astype(np.float32)):
            return "_UNCERTAINTY differs"
    if not painted:
        return None
    # trimesh keeps them beside the material.
    colours = np.asarray(mesh.visual.vertex_attributes.get("color", np.empty((0, 4))))
    if colours.shape != (len(mesh.vertices), 4):
        return f"{len(colours)} colours for {len(mesh.vertices)} vertices"
    return None if len(np.unique(colours, axis=0)) > 9 else "all vertices have nearly the same colour"


def check_figures(path, document):
    expected = figures(document)
    if path.suffix == ".vtp":
        reader, difference = "vtk", arrays_by_vtk(path, expected)
    elif path.suffix in (".glb", ".gltf"):
        reader, difference = "trimesh", figures_by_trimesh(path, expected, "fields" in document)
    else:
        return True
    print(f"{path.name}: {reader}: figures {sorted(expected)}: {difference or 'identical'}")
    return difference is None


def check(path, expected):
    ways = [("trimesh", by_trimesh)] if path.suffix != ".vtp" else []
    ways += [("vtk", by_vtk)] if path.suffix in READERS else []
    passed = True
    for reader, read in ways:
        difference = compare(path.name, reader, expected, read(path))
        print(f"{path.name}: {reader}: {difference or 'identical'}")
        passed &= difference is None
    return passed


def main(folder):
    passed = failed = 0
    for original in sorted(Path(folder).glob("*.json")):
        document = json.loads(original.read_text())
        if "vertices" not in document:
            continue  # a report, not a mesh
        assert document["frame"] == "LPS" and document["unit"] == "mm", original.name
        expected = np.array(document["vertices"]), np.array(document["triangles"])
        for suffix in (".glb", ".gltf", ".stl", ".ply", ".obj", ".vtp"):
            path = original.with_suffix(suffix)
            if path.exists() and check(path, expected) and check_figures(path, document):
                passed += 1
            elif path.exists():
                failed += 1
    print(f"formats: {passed} passed, {failed} failed")
    return 0 if passed and not failed else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
