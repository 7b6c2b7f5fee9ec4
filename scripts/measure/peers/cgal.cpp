// CGAL's isotropic remeshing, tuned: 10 iterations with 3 relaxation steps, projected onto the surface.
// It takes an edge length; the caller chooses the one that gives the wanted number of points. Returns
// the number of vertices.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/remesh.h>
#include <CGAL/Surface_mesh.h>

#include <cstdint>
#include <vector>

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;

extern "C" int64_t remesh(const double* vertices, int64_t vertex_count, const int32_t* triangles,
                          int64_t triangle_count, double edge) {
    Mesh mesh;
    mesh.reserve(vertex_count, 3 * triangle_count / 2, triangle_count);
    std::vector<Mesh::Vertex_index> id(vertex_count);
    for (int64_t v = 0; v < vertex_count; v++) {
        const double* p = vertices + 3 * v;
        id[v] = mesh.add_vertex(Kernel::Point_3(p[0], p[1], p[2]));
    }
    for (int64_t t = 0; t < triangle_count; t++) {
        const int32_t* corner = triangles + 3 * t;
        mesh.add_face(id[corner[0]], id[corner[1]], id[corner[2]]);
    }
    CGAL::Polygon_mesh_processing::isotropic_remeshing(
        mesh.faces(), edge, mesh,
        CGAL::parameters::number_of_iterations(10).number_of_relaxation_steps(3).do_project(true));
    mesh.collect_garbage();
    return int64_t(mesh.number_of_vertices());
}
