"""Other tools for the same jobs, each as a function of data in memory."""

import ctypes
import warnings

import numpy
import pyacvd
import pyvista
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

# pyacvd 0.4 uses a name that pyvista has deprecated.
warnings.filterwarnings("ignore", category=Warning, module="pyacvd")


def image(voxels, spacing):
    """A vtkImageData of the voxels, i fastest."""
    data = vtk.vtkImageData()
    data.SetDimensions(*voxels.shape)
    data.SetSpacing(*spacing)
    flat = numpy_to_vtk(voxels.ravel(order="F"), deep=1)
    data.GetPointData().SetScalars(flat)
    return data


def flying_edges(data, iso):
    """vtkFlyingEdges3D without normals, gradients and scalars: its fastest setting."""
    contour = vtk.vtkFlyingEdges3D()
    contour.SetInputData(data)
    contour.SetValue(0, iso)
    contour.ComputeNormalsOff()
    contour.ComputeGradientsOff()
    contour.ComputeScalarsOff()
    contour.Update()
    return contour.GetOutput()


def acvd(surface, points):
    """pyacvd on the surface, subdivided twice as its documentation recommends for few points."""
    clustering = pyacvd.Clustering(pyvista.wrap(surface))
    clustering.subdivide(2)
    clustering.cluster(points)
    return clustering.create_mesh()


def arrays(surface):
    """Vertices (float64) and triangles (int32), the types that the C++ libraries take."""
    vertices = vtk_to_numpy(surface.GetPoints().GetData()).astype(numpy.float64)
    triangles = vtk_to_numpy(surface.GetPolys().GetConnectivityArray())
    return vertices, triangles.reshape(-1, 3).astype(numpy.int32)


def area(surface):
    """The area of the surface, mm²."""
    vertices, triangles = arrays(surface)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return numpy.linalg.norm(numpy.cross(b - a, c - a), axis=1).sum() / 2


class Remesher:
    """A library built from scripts/measure/peers/*.cpp. `remesh(V, nv, F, nf, target)` returns the number of
    vertices it made."""

    def __init__(self, library):
        self.call = ctypes.CDLL(library).remesh
        self.call.restype = ctypes.c_int64

    def __call__(self, surface, target):
        vertices, triangles = arrays(surface)
        made = self.call(
            vertices.ctypes.data_as(ctypes.c_void_p),
            ctypes.c_int64(len(vertices)),
            triangles.ctypes.data_as(ctypes.c_void_p),
            ctypes.c_int64(len(triangles)),
            ctypes.c_double(target),
        )
        if made <= 0:
            raise RuntimeError("remesh returned no vertices")
        return made
