//! Tests of the exact geodesics against unfolded solids and a brute-force search, and of the log
//! map against the exact geodesics.

use nalgebra::Rotation2;
use rand::RngExt;

use super::{ExactMap, brute_force};
use crate::base::geometry::random::{Purpose, stream};
use crate::base::geometry::triangle::angle_between;
use crate::base::geometry::{Vec2, Vec3};
use crate::mesh::{FaceId, TriMesh, VertexId, shapes};
use crate::surface::retile::SurfacePoint;
use crate::surface::retile::domain::Domain;
use crate::surface::retile::geodesics::{GeodesicMap, Geodesics, LogMap, distances};
use crate::surface::retile::trace::{inset, walk};

fn domain(mesh: &TriMesh) -> Domain {
    Domain::new(mesh.vertices.clone(), mesh.triangles.clone()).unwrap()
}

fn point(triangle: u32, barycentric: [f64; 3]) -> SurfacePoint {
    SurfacePoint {
        triangle: FaceId(triangle),
        barycentric,
    }
}

/// Every vertex as a point of one of its triangles.
fn vertices(mesh: &TriMesh) -> Vec<SurfacePoint> {
    (0..mesh.vertices.len() as u32)
        .map(|v| {
            let mut barycentric = [0.0; 3];
            let has = |t: &[u32; 3]| t.iter().position(|c| *c == v);
            let t = mesh
                .triangles
                .iter()
                .position(|t| has(t).is_some())
                .unwrap();
            barycentric[has(&mesh.triangles[t]).unwrap()] = 1.0;
            point(t as u32, barycentric)
        })
        .collect()
}

/// Points inside triangles, on edges and close to corners.
fn scattered(mesh: &TriMesh, count: usize, seed: u64) -> Vec<SurfacePoint> {
    let mut random = stream(seed, Purpose::Placement);
    (0..count)
        .map(|n| {
            let t = random.random_range(0..mesh.triangles.len() as u32);
            let (r, s): (f64, f64) = (random.random::<f64>().sqrt(), random.random());
            let k = random.random_range(0..3);
            let mut weights = match n % 4 {
                0 => [0.0, r, 1.0 - r],
                1 => [1e-4 * r, 1.0 - 2e-4 * r, 1e-4 * r],
                _ => [1.0 - r, r * (1.0 - s), r * s],
            };
            weights.rotate_left(k);
            point(t, weights)
        })
        .collect()
}

fn jittered(mut mesh: TriMesh, share: f64, stretch: [f64; 3], seed: u64) -> TriMesh {
    let mut random = stream(seed, Purpose::PhantomShape);
    for v in &mut mesh.vertices {
        let reach = share * v.norm();
        *v += Vec3::from_fn(|_, _| reach * (2.0 * random.random::<f64>() - 1.0));
        v.component_mul_assign(&Vec3::from(stretch));
    }
    mesh
}

fn exact(mesh: &TriMesh, points: &[SurfacePoint]) -> Vec<Vec<f64>> {
    let rows = distances(mesh, Geodesics::Exact, points, points, f64::INFINITY).unwrap();
    let whole = |row: Vec<Option<f64>>| row.into_iter().map(Option::unwrap).collect();
    rows.into_iter().map(whole).collect()
}

#[test]
fn as_short_as_the_shortest_of_all_unfolded_strips() {
    let (mut pairs, mut worst) = (0, 0.0f64);
    for seed in 0..60 {
        let (base, share) = match seed % 6 {
            0 => (shapes::tetrahedron(2.0), 0.5),
            1 => (shapes::icosphere(1.0, 0), 0.3),
            2 => (shapes::torus(3.0, 1.0, 4, 3), 0.1),
            // Spikes: most vertices are saddles.
            3 => (shapes::icosphere(1.0, 0), 0.8),
            4 => (shapes::torus(2.0, 0.9, 5, 4), 0.15),
            _ => (shapes::tetrahedron(1.0), 0.05),
        };
        // Some of the triangles are thin and obtuse.
        let stretch = [[1.0; 3], [1.0, 1.0, 0.1], [8.0, 1.0, 1.0]][seed as usize / 6 % 3];
        let mesh = jittered(base, share, stretch, seed);
        let mut points = vertices(&mesh);
        points.extend(scattered(&mesh, 8, seed));
        let found = exact(&mesh, &points);
        let expected = brute_force::distances(&domain(&mesh), &points);
        for i in 0..points.len() {
            for j in (0..points.len()).filter(|&j| j != i) {
                let scale = expected[i][j].max(1e-3);
                let error = (found[i][j] - expected[i][j]).abs() / scale;
                worst = worst.max(error);
                pairs += 1;
                assert!(
                    error < 1e-9,
                    "{seed}: {i} {j}: {} {}",
                    found[i][j],
                    expected[i][j]
                );
            }
        }
    }
    println!("{pairs} pairs, worst relative error {worst:.1e}");
}

#[test]
fn opposite_corners_of_a_cube_have_distance_root_five() {
    let corner = |n: u32| Vec3::new(f64::from(n & 1), f64::from(n >> 1 & 1), f64::from(n >> 2));
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let mesh = TriMesh {
        vertices: (0..8).map(corner).collect(),
        triangles: sides
            .into_iter()
            .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
    };
    let found = exact(&mesh, &vertices(&mesh));
    for (i, j) in [(0, 7), (1, 6), (2, 5), (3, 4)] {
        assert!((found[i][j] - 5f64.sqrt()).abs() < 1e-12);
    }
    // The centres of opposite sides.
    let middles = [point(0, [0.5, 0.0, 0.5]), point(2, [0.5, 0.0, 0.5])];
    assert!((exact(&mesh, &middles)[0][1] - 2.0).abs() < 1e-12);
}

#[test]
fn a_cone_is_unfolded() {
    // Eleven flat sides around the apex: points at slant heights p and q with an angle b between
    // them have the distance sqrt(p² + q² - 2pq cos b) as long as b is below π.
    let (sides, height) = (11u32, 3.0);
    let ring = |k: u32| {
        let angle = std::f64::consts::TAU * f64::from(k) / f64::from(sides);
        Vec3::new(angle.cos(), angle.sin(), 0.0)
    };
    let mut mesh = TriMesh {
        vertices: (0..sides).map(ring).collect(),
        triangles: Vec::new(),
    };
    mesh.vertices.extend([Vec3::z() * height, Vec3::zeros()]);
    for k in 0..sides {
        let after = (k + 1) % sides;
        mesh.triangles.push([k, after, sides]);
        mesh.triangles.push([after, k, sides + 1]);
    }
    let slant = height.hypot(1.0);
    let edge = (ring(1) - ring(0)).norm();
    let side = 2.0 * (edge / (2.0 * slant)).asin();
    // Near the apex, so that no path over the base is shorter.
    let points: Vec<_> = (0..sides).map(|k| point(2 * k, [0.2, 0.0, 0.8])).collect();
    let found = exact(&mesh, &points);
    for (k, distance) in found[0].iter().enumerate() {
        let turns = k.min(sides as usize - k);
        let expected = 2.0 * 0.2 * slant * (side * turns as f64 / 2.0).sin();
        assert!((distance - expected).abs() < 1e-12 * slant, "{k}");
    }
}

#[test]
fn a_cylinder_is_unfolded() {
    // A prism with 16 sides, so long that no shortest path runs over its ends.
    let (around, rows) = (16u32, 9u32);
    let mut mesh = shapes::torus(1.0, 0.1, around, 3);
    mesh.vertices.clear();
    mesh.triangles.clear();
    for row in 0..rows {
        for k in 0..around {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(around);
            mesh.vertices
                .push(Vec3::new(angle.cos(), angle.sin(), f64::from(row)));
        }
    }
    let id = |row: u32, k: u32| row * around + k % around;
    for row in 0..rows - 1 {
        for k in 0..around {
            let [p, q, r, s] = [
                id(row, k),
                id(row, k + 1),
                id(row + 1, k + 1),
                id(row + 1, k),
            ];
            mesh.triangles.extend([[p, q, r], [p, r, s]]);
        }
    }
    let ends = mesh.vertices.len() as u32;
    mesh.vertices
        .extend([Vec3::zeros(), Vec3::z() * f64::from(rows - 1)]);
    for k in 0..around {
        mesh.triangles.push([id(0, k + 1), id(0, k), ends]);
        mesh.triangles
            .push([id(rows - 1, k), id(rows - 1, k + 1), ends + 1]);
    }
    let edge = 2.0 * (std::f64::consts::PI / f64::from(around)).sin();
    let found = exact(&mesh, &vertices(&mesh));
    let source = id(4, 0) as usize;
    for row in 2..rows - 2 {
        for k in 0..around {
            let across = edge * f64::from(k.min(around - k));
            let expected = across.hypot(f64::from(row) - 4.0);
            let error = (found[source][id(row, k) as usize] - expected).abs();
            assert!(error < 1e-12 * expected.max(1.0), "{row} {k}");
        }
    }
}

#[test]
fn distances_on_a_sphere_are_arcs() {
    let mesh = shapes::icosphere(20.0, 5);
    let points = [point(0, [0.3, 0.45, 0.25]), point(9000, [1.0, 0.0, 0.0])];
    let targets = vertices(&mesh);
    let found = distances(&mesh, Geodesics::Exact, &points, &targets, 20.0).unwrap();
    for (source, row) in points.iter().zip(found) {
        let x = source.position(&mesh.vertices, &mesh.triangles).normalize();
        for (target, distance) in mesh.vertices.iter().zip(row) {
            let arc = 20.0 * x.dot(&target.normalize()).clamp(-1.0, 1.0).acos();
            assert!(distance.is_some() || arc > 19.9);
            if let Some(distance) = distance.filter(|_| arc > 1.0) {
                assert!((distance / arc - 1.0).abs() < 2e-3, "{distance} {arc}");
            }
        }
    }
}

#[test]
fn distances_are_symmetric_and_obey_the_triangle_inequality() {
    for seed in 0..6 {
        let mesh = jittered(shapes::torus(9.0, 3.0, 14, 9), 0.05, [1.0, 1.0, 0.6], seed);
        let points = scattered(&mesh, 24, seed);
        let d = exact(&mesh, &points);
        for i in 0..24 {
            for j in 0..24 {
                assert!((d[i][j] - d[j][i]).abs() < 1e-9);
                for k in 0..24 {
                    assert!(d[i][j] <= d[i][k] + d[k][j] + 1e-9);
                }
            }
        }
    }
}

#[test]
fn straight_paths_in_the_computed_direction_arrive() {
    // The surface is convex, so no path turns at a vertex: a straight path ends at the target.
    let mesh = jittered(shapes::icosphere(20.0, 3), 0.0, [1.0, 0.7, 1.3], 1);
    let domain = domain(&mesh);
    let mut map = ExactMap::over(&domain);
    let at = |p: &SurfacePoint| p.position(&mesh.vertices, &mesh.triangles);
    let points: Vec<_> = scattered(&mesh, 40, 3)
        .into_iter()
        .filter(|p| p.barycentric.iter().all(|x| *x > 0.01)) // Paths start inside a triangle.
        .collect();
    for source in &points {
        map.spread(&domain, source, 200.0);
        for target in &points {
            let way: Vec2 = map.reach_point(&domain, target).unwrap().vector;
            let (end, _) = walk(&domain, source, way);
            // The end of a path is kept slightly away from the edges of its triangle.
            assert!((at(&end) - at(target)).norm() < 1e-2);
        }
    }
}

#[test]
fn exactly_the_distances_within_the_radius_are_known() {
    let mesh = jittered(shapes::torus(9.0, 3.0, 20, 12), 0.03, [1.0; 3], 4);
    let points = scattered(&mesh, 30, 4);
    let all = exact(&mesh, &points);
    let near = distances(&mesh, Geodesics::Exact, &points, &points, 7.0).unwrap();
    for (row, whole) in near.iter().zip(&all) {
        for (d, w) in row.iter().zip(whole) {
            assert_eq!(*d, (*w <= 7.0).then_some(*w));
        }
    }
}

#[test]
fn points_beside_the_surface_are_reported() {
    let mesh = shapes::icosphere(1.0, 1);
    let good = point(3, [0.2, 0.3, 0.5]);
    for bad in [
        point(80, [0.2, 0.3, 0.5]),
        point(3, [f64::NAN, 0.5, 0.5]),
        point(3, [-0.1, 0.6, 0.5]),
        point(3, [0.9, 0.6, 0.5]),
    ] {
        let outcome = distances(&mesh, Geodesics::Exact, &[good], &[good, bad], 1.0);
        assert!(outcome.unwrap_err().to_string().contains("point 2"));
    }
}

/// Errors of the log map within two spacings of 150 points, the largest radius of repulsion.
#[test]
fn the_log_map_is_close_to_exact_within_two_spacings() {
    let mut all = Vec::new();
    for (name, mesh) in [
        ("cup", shapes::cup(60.0, 30.0, 11.0, 64)),
        (
            "rough sphere",
            jittered(shapes::icosphere(30.0, 4), 0.01, [1.0; 3], 1),
        ),
        ("torus", shapes::torus(30.0, 10.0, 60, 24)),
        (
            "ellipsoid",
            jittered(shapes::icosphere(30.0, 4), 0.0, [1.0, 0.5, 1.5], 2),
        ),
    ] {
        let domain = domain(&mesh);
        let radius = 2.0 * (domain.area / 150.0).sqrt();
        let (mut approximate, mut exact) = (LogMap::over(&domain), ExactMap::over(&domain));
        let (mut sum, mut worst, mut count) = (0.0, 0.0f64, 0);
        for mut source in scattered(&mesh, 80, 9) {
            source.barycentric = inset(source.barycentric); // As in repulsion.
            approximate.spread(&domain, &source, radius);
            exact.spread(&domain, &source, radius);
            for v in VertexId::first(mesh.vertices.len()) {
                let (Some(a), Some(e)) = (approximate.reach(v), exact.reach(v)) else {
                    continue;
                };
                if e.distance > 0.1 * radius {
                    let error = (a.distance / e.distance - 1.0).abs();
                    (sum, worst, count) = (sum + error, worst.max(error), count + 1);
                    all.push(error);
                }
            }
        }
        println!(
            "{name}: mean {:.3} %, worst {:.2} %",
            100.0 * sum / f64::from(count),
            100.0 * worst
        );
    }
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    assert!(mean < 1e-3, "{mean}");
    assert!(all.iter().all(|e| *e < 0.02));
}

/// A source on an edge or on a vertex has the directions of one beside it, in the frame of its triangle.
#[test]
fn directions_from_an_edge_or_a_vertex_are_those_from_beside_it() {
    let mesh = jittered(shapes::icosphere(20.0, 2), 0.0, [1.0, 0.8, 1.1], 1);
    let domain = domain(&mesh);
    let mut maps = [ExactMap::over(&domain), ExactMap::over(&domain)];
    let targets = scattered(&mesh, 60, 5);
    let mut compared = 0;
    for t in [0, 41, 160, 299] {
        let defect = |on: [f64; 3]| {
            let Some(k) = on.iter().position(|x| *x == 1.0) else {
                return 0.0;
            };
            let v = mesh.triangles[t as usize][k];
            let angles = mesh.triangles.iter().filter_map(|t| {
                let k = t.iter().position(|c| *c == v)?;
                let [a, b, c] = [0, 1, 2].map(|m| mesh.vertices[t[(k + m) % 3] as usize]);
                Some(angle_between(&(b - a), &(c - a)))
            });
            std::f64::consts::TAU - angles.sum::<f64>()
        };
        for on in [
            [0.0, 0.3, 0.7],
            [0.4, 0.0, 0.6],
            [0.2, 0.8, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        ] {
            let beside = on.map(|x| x * (1.0 - 3e-7) + 1e-7);
            maps[0].spread(&domain, &point(t, on), 25.0);
            maps[1].spread(&domain, &point(t, beside), 25.0);
            for target in &targets {
                let [Some(from), Some(near)] = [0, 1].map(|k| maps[k].reach_point(&domain, target))
                else {
                    continue;
                };
                assert!((from.distance - near.distance).abs() < 1e-4);
                assert!((from.vector.norm() - from.distance).abs() < 1e-9 * from.distance);
                if from.distance > 20.0 {
                    continue; // Where two paths are nearly as short, either may be found.
                }
                // Beside a vertex the path may pass it on the other side: it is turned by what the angles there lack
                // of a full turn.
                let ways =
                    [0.0, defect(on), -defect(on)].map(|angle| Rotation2::new(angle) * from.vector);
                let off = ways.map(|way| (way - near.vector).norm());
                let least = off.into_iter().fold(f64::INFINITY, f64::min);
                assert!(least < 1e-3 * from.distance.max(0.1), "{t} {on:?} {off:?}");
                compared += 1;
            }
        }
    }
    assert!(compared > 300, "{compared}");
}

/// Vectors are as long as the paths, vertices beyond the radius are not reached, and all within it are; from points
/// inside triangles, on edges and on vertices of saddles.
#[test]
fn vectors_are_as_long_as_paths_and_no_vertex_is_reached_beyond_the_radius() {
    let mesh = jittered(shapes::torus(9.0, 3.0, 14, 9), 0.05, [1.0, 1.0, 0.6], 2);
    let domain = domain(&mesh);
    let mut sources = scattered(&mesh, 12, 7);
    sources.extend(vertices(&mesh).into_iter().step_by(9));
    let all = exact(&mesh, &[sources.clone(), vertices(&mesh)].concat());
    let mut map = ExactMap::over(&domain);
    for radius in [5.0, 12.0] {
        for (i, source) in sources.iter().enumerate() {
            map.spread(&domain, source, radius);
            let mut reached = 0;
            for v in VertexId::first(mesh.vertices.len()) {
                let distance = all[i][sources.len() + v.index()];
                let Some(reach) = map.reach(v) else {
                    assert!(distance > radius);
                    continue;
                };
                reached += 1;
                assert!(reach.distance <= radius);
                assert!((reach.distance - distance).abs() < 1e-9);
                assert!((reach.vector.norm() - reach.distance).abs() < 1e-9);
                assert!(map.visited().contains(&v));
            }
            assert!(reached > 2 && reached < mesh.vertices.len());
        }
    }
}

/// The fan of a vertex onto the opposite edge, for every corner: the vertex is as far from the edge's ends as the
/// triangle says, and the rays to the window's ends have the angles of the fan.
#[test]
fn the_fan_of_a_vertex_opens_at_its_angles() {
    let mesh = jittered(shapes::icosphere(10.0, 0), 0.15, [1.0; 3], 3);
    let domain = domain(&mesh);
    for h in domain.half_edges.half_edges() {
        let [a, b] = domain.half_edges.ends(h).map(|v| mesh.vertices[v.index()]);
        let c = mesh.vertices[domain.half_edges.origin(h.previous()).index()];
        let angle = super::corner_angle(&domain, h);
        assert!((angle - angle_between(&(b - a), &(c - a))).abs() < 1e-9);
        for shares in [[0.0, 1.0], [0.0, 0.4], [0.3, 0.7], [0.8, 1.0]] {
            let fan = shares.map(|share| share * angle);
            let window = super::fan_window(&domain, h, angle, fan, 7);
            assert_eq!(window.root, 7);
            // The window's frame runs from c to b, beyond the triangle.
            let ends = domain
                .half_edges
                .ends(window.half_edge)
                .map(|v| mesh.vertices[v.index()]);
            assert_eq!(ends, [c, b]);
            let base = Vec2::new((b - c).norm(), 0.0);
            assert!((window.source.norm() - (c - a).norm()).abs() < 1e-9);
            assert!(((window.source - base).norm() - (b - a).norm()).abs() < 1e-9);
            assert!(window.source.y < 0.0);
            for (place, expected) in window.interval.into_iter().zip([fan[1], fan[0]]) {
                let (to_b, ray) = (base - window.source, Vec2::new(place, 0.0) - window.source);
                let found = to_b.perp(&ray).atan2(to_b.dot(&ray));
                assert!((found - expected).abs() < 1e-9, "{found} {expected}");
            }
        }
    }
}
