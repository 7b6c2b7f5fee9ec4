// Geogram's remesh_smooth (centroidal Voronoi points, restricted Delaunay). Its default is 5 Lloyd and
// 30 Newton iterations, but the Python wheel's library lacks the optimiser that Newton needs. This runs
// 35 Lloyd iterations instead. That takes no longer than the default would: an iteration of either kind
// computes at least one Voronoi diagram. Returns the number of vertices.
#include <geogram/basic/command_line.h>
#include <geogram/basic/command_line_args.h>
#include <geogram/basic/common.h>
#include <geogram/basic/logger.h>
#include <geogram/basic/process.h>
#include <geogram/mesh/mesh.h>
#include <geogram/mesh/mesh_remesh.h>

#include <cstdint>

static void start() {
    static bool started = false;
    if (started) return;
    GEO::initialize(GEO::GEOGRAM_INSTALL_NONE);
    for (const char* group : {"standard", "algo", "remesh", "opt"}) GEO::CmdLine::import_arg_group(group);
    GEO::CmdLine::set_arg("sys:multithread", false);
    GEO::Process::enable_multithreading(false);
    GEO::Process::set_max_threads(1);
    GEO::Logger::instance()->set_quiet(true);
    started = true;
}

extern "C" int64_t remesh(const double* vertices, int64_t vertex_count, const int32_t* triangles,
                          int64_t triangle_count, double points) {
    start();
    GEO::Mesh in, out;
    in.vertices.set_dimension(3);
    in.vertices.create_vertices(GEO::index_t(vertex_count));
    for (int64_t k = 0; k < 3 * vertex_count; k++) in.vertices.point_ptr(0)[k] = vertices[k];
    for (int64_t t = 0; t < triangle_count; t++) {
        const int32_t* corner = triangles + 3 * t;
        in.facets.create_triangle(GEO::index_t(corner[0]), GEO::index_t(corner[1]), GEO::index_t(corner[2]));
    }
    in.facets.connect();
    GEO::remesh_smooth(in, out, GEO::index_t(points), 3, 35, 0);
    return int64_t(out.vertices.nb());
}
