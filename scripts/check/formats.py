"""Reads exported meshes with trimesh and VTK and compares them with the JSON of the same name.

usage: formats.py DIR

Vertices must come back in the same order, equal to the last bit of the precision that format and
reader keep. STL stores no shared vertices; there the distinct positions and the triangles over them
are compared.

Figures of vertices (`uncertainty_mm` and `fields` of the JSON) must be the point arrays of the VTP and the VTK file,
by their names, lengths and values, and no others, and properties of the PLY file; the part of each triangle (`part`)
their cell array and face property, the groups of the OBJ file and the primitives of the glTF files; the uncertainty
also the attribute `_UNCERTAINTY` of glTF files, whose vertices have a colour where there is a field.
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
        # One geometry for each primitive; all share the vertices.
        meshes = list(scene.geometry.values())
        assert all(np.array_equal(mesh.vertices, meshes[0].vertices) for mesh in meshes)
        matrix, _ = scene.graph[scene.graph.nodes_geometry[0]]
        return meshes[0].vertices, np.concatenate([mesh.faces for mesh in meshes]), matrix
    mesh = trimesh.load(path, process=False, maintain_order=True)
    return mesh.vertices, mesh.faces, None


READERS = {
    ".stl": vtk.vtkSTLReader,
    ".ply": vtk.vtkPLYReader,
    ".obj": vtk.vtkOBJReader,
    ".vtp": vtk.vtkXMLPolyDataReader,
    ".vtk": vtk.vtkPolyDataReader,
}

PARTS = {1: "endocardium", 2: "epicardium", 3: "base"}


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


def arrays_by_vtk(path, expected, parts):
    """The first difference of the arrays of a VTP or VTK file, as text; None if there is none."""
    reader = READERS[path.suffix]()
    reader.SetFileName(str(path))
    reader.Update()
    data = reader.GetOutput().GetPointData()
    cells = reader.GetOutput().GetCellData().GetArray("Part")
    if (cells is None) != (parts is None):
        return "one of the files has no parts"
    if parts is not None and not np.array_equal(vtk_to_numpy(cells), parts):
        return "Part differs"
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
    mesh = next(iter(scene.geometry.values()))
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
    # Vertices without a figure, such as those in the valve plane, are grey together.
    known = [values[np.isfinite(values)].round() for name, values in expected.items() if name != "Uncertainty"]
    needed = min(10, *(len(np.unique(values)) for values in known))
    return None if len(np.unique(colours, axis=0)) >= needed else "all vertices have nearly the same colour"


def figures_of_ply(path, expected, parts):
    """The same of the properties of a PLY file, read by its header."""
    head, body = path.read_bytes().split(b"\nend_header\n", 1)
    types = {"double": "<f8", "uchar": "u1"}
    columns, faces = [], []
    for line in head.decode().splitlines():
        words = line.split()
        if words[:2] == ["element", "vertex"]:
            count, into = int(words[2]), columns
        elif words[:2] == ["element", "face"]:
            triangles, into = int(words[2]), faces
        elif words[:2] == ["property", "list"]:
            into += [("n", "u1"), ("corners", "<i4", 3)]
        elif words[:1] == ["property"]:
            into.append((words[2], types[words[1]]))
    points = np.frombuffer(body, columns, count)
    rows = np.frombuffer(body, faces, triangles, offset=points.nbytes)
    for name, values in expected.items():
        if not np.array_equal(points[name.lower()], values, equal_nan=True):
            return f"{name} differs"
    if ("part" in rows.dtype.names) != (parts is not None):
        return "one of the files has no parts"
    return None if parts is None or np.array_equal(rows["part"], parts) else "part differs"


def groups_of(path, document):
    """The first difference of the groups of an OBJ file, or the materials of a glTF file, to the parts of the JSON."""
    parts = document.get("part")
    if parts is None:
        return None
    counts = {name: parts.count(number) for number, name in PARTS.items() if number in parts}
    if path.suffix == ".obj":
        found, group = {}, None
        for line in path.read_text().splitlines():
            if line.startswith("g "):
                group = line[2:]
            elif line.startswith("f "):
                found[group] = found.get(group, 0) + 1
    else:
        scene = trimesh.load(path, process=False)
        found = {mesh.visual.material.name: len(mesh.faces) for mesh in scene.geometry.values()}
    return None if found == counts else f"{found} instead of {counts}"


def check_figures(path, document):
    expected = figures(document)
    parts = np.array(document["part"]) if "part" in document else None
    if path.suffix in (".obj", ".glb", ".gltf"):
        difference = groups_of(path, document)
        print(f"{path.name}: parts: {difference or 'identical'}")
        if difference or path.suffix == ".obj":
            return difference is None
    if path.suffix in (".vtp", ".vtk"):
        reader, difference = "vtk", arrays_by_vtk(path, expected, parts)
    elif path.suffix == ".ply":
        reader, difference = "header", figures_of_ply(path, expected, parts)
    elif path.suffix in (".glb", ".gltf"):
        reader, difference = "trimesh", figures_by_trimesh(path, expected, "fields" in document)
    else:
        return True
    print(f"{path.name}: {reader}: figures {sorted(expected)}: {difference or 'identical'}")
    return difference is None


def check(path, expected):
    ways = [("trimesh", by_trimesh)] if path.suffix not in (".vtp", ".vtk") else []
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
        # OBJ and glTF files have the triangles part by part.
        order = np.argsort(document["part"], kind="stable") if "part" in document else slice(None)
        by_part = expected[0], expected[1][order]
        for suffix in (".glb", ".gltf", ".stl", ".ply", ".obj", ".vtp", ".vtk"):
            path = original.with_suffix(suffix)
            grouped = suffix in (".glb", ".gltf", ".obj")
            if path.exists() and check(path, by_part if grouped else expected) and check_figures(path, document):
                passed += 1
            elif path.exists():
                failed += 1
    print(f"formats: {passed} passed, {failed} failed")
    return 0 if passed and not failed else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
