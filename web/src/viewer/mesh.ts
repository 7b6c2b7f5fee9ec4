// Triangle meshes: their outline in a plane, and figures for every vertex to colour them by.

import type { Plane } from "./plane";
import { type Vec, add, cross, dot, mix, norm, scale, sub, unit } from "./vector";

/** Shares of the corners of a triangle. */
type Weights = [number, number, number];

export interface Mesh {
  vertices: Vec[];
  triangles: [number, number, number][];
  normals: Vec[];
  /** Standard deviation of the distance of every vertex from the wall, mm, where it is known. */
  uncertainty_mm?: number[];
}

/** A mesh with the normals of its vertices: the mean of those of the triangles about each, by their areas. */
export function withNormals(vertices: Vec[], triangles: Mesh["triangles"]): Mesh {
  const normals = vertices.map((): Vec => [0, 0, 0]);
  for (const [a, b, c] of triangles) {
    const normal = cross(sub(vertices[b]!, vertices[a]!), sub(vertices[c]!, vertices[a]!));
    for (const at of [a, b, c]) normals[at] = add(normals[at]!, normal);
  }
  return { vertices, triangles, normals: normals.map(unit) };
}

/** The mean of meshes with the same triangles. */
export function meanOf(meshes: Mesh[]): Mesh {
  const vertices = meshes[0]!.vertices.map((_, at) =>
    scale(
      meshes.reduce<Vec>((sum, mesh) => add(sum, mesh.vertices[at]!), [0, 0, 0]),
      1 / meshes.length,
    ),
  );
  return withNormals(vertices, meshes[0]!.triangles);
}

/** The mesh at a moment of the cycle, between those in the middle of its gates. */
export function between(gates: Mesh[], turns: number): Mesh {
  const place = turns * gates.length - 0.5 + gates.length;
  const [from, to] = [Math.floor(place), Math.floor(place) + 1].map(n => gates[n % gates.length]!) as [Mesh, Mesh];
  const share = place - Math.floor(place);
  const mixed = (a: Vec[], b: Vec[]) => a.map((one, at) => mix(one, b[at]!, share));
  return {
    vertices: mixed(from.vertices, to.vertices),
    triangles: from.triangles,
    normals: mixed(from.normals, to.normals).map(unit),
  };
}

/** Where the mesh cuts the plane through `origin`: pairs of points in the plane's own millimetres. */
export function outline(mesh: Mesh, plane: Plane, origin: Vec): Float32Array {
  const n = mesh.vertices.length;
  const side = new Float32Array(n);
  const flat = new Float32Array(2 * n);
  mesh.vertices.forEach((vertex, at) => {
    const r = sub(vertex, origin);
    side[at] = dot(r, plane.normal) || 1e-9;
    flat[2 * at] = dot(r, plane.right);
    flat[2 * at + 1] = dot(r, plane.down);
  });
  const out: number[] = [];
  for (const corners of mesh.triangles) {
    const ends: number[] = [];
    for (let e = 0; e < 3; e++) {
      const [a, b] = [corners[e]!, corners[(e + 1) % 3]!];
      const [p, q] = [side[a]!, side[b]!];
      if (p < 0 === q < 0) continue;
      const t = p / (p - q);
      ends.push(
        flat[2 * a]! + t * (flat[2 * b]! - flat[2 * a]!),
        flat[2 * a + 1]! + t * (flat[2 * b + 1]! - flat[2 * a + 1]!),
      );
    }
    if (ends.length === 4) out.push(...ends);
  }
  return new Float32Array(out);
}

/** 2r/R of every triangle's corners, the least of those that meet at a vertex. */
export function triangleShape(mesh: Mesh): Float32Array {
  const out = new Float32Array(mesh.vertices.length).fill(1);
  for (const corners of mesh.triangles) {
    const [p, q, r] = corners.map(at => mesh.vertices[at]!) as [Vec, Vec, Vec];
    const [a, b, c] = [norm(sub(q, r)), norm(sub(r, p)), norm(sub(p, q))];
    const area = norm(cross(sub(q, p), sub(r, p))) / 2;
    const ratio = (16 * area * area) / (a * b * c * (a + b + c)); // 2r/R with r = 2A/(a+b+c), R = abc/4A
    for (const at of corners) out[at] = Math.min(out[at]!, ratio);
  }
  return out;
}

/** Thickness of the wall at every vertex: the way inward to the other side, mm; NaN where there is none. */
export function thickness(mesh: Mesh, longest = 40): Float32Array {
  return Float32Array.from(mesh.vertices, (vertex, at) => {
    const normal = mesh.normals[at]!;
    let nearest = Infinity;
    for (const corners of mesh.triangles) {
      if (corners.includes(at)) continue;
      const [p, q, r] = corners.map(other => mesh.vertices[other]!) as [Vec, Vec, Vec];
      const hit = crossing(vertex, [-normal[0], -normal[1], -normal[2]], p, q, r);
      if (hit > 0.5 && hit < nearest) nearest = hit;
    }
    return nearest < longest ? nearest : NaN;
  });
}

/** Distance along a ray to a triangle (Möller and Trumbore 1997); NaN if it misses. */
function crossing(start: Vec, way: Vec, p: Vec, q: Vec, r: Vec): number {
  const [e, f] = [sub(q, p), sub(r, p)];
  const h = cross(way, f);
  const a = dot(e, h);
  if (Math.abs(a) < 1e-9) return NaN;
  const s = sub(start, p);
  const u = dot(s, h) / a;
  if (u < 0 || u > 1) return NaN;
  const k = cross(s, e);
  const v = dot(way, k) / a;
  return v < 0 || u + v > 1 ? NaN : dot(f, k) / a;
}

/** Distance from every vertex to the nearest vertex plane of another mesh, with sign: positive outside it. */
export function apart(mesh: Mesh, other: Mesh): Float32Array {
  return Float32Array.from(mesh.vertices, vertex => {
    const near = nearestOn(other, vertex, () => true);
    if (!near) return Infinity;
    const [p, q, r] = other.triangles[near.triangle]!.map(at => other.vertices[at]!) as [Vec, Vec, Vec];
    const away = sub(vertex, near.place);
    return dot(away, cross(sub(q, p), sub(r, p))) < 0 ? -norm(away) : norm(away);
  });
}

/** The triangle of a mesh that is nearest to a place, and the place there; null where `accepts` takes none. */
export function nearestOn(
  mesh: Pick<Mesh, "vertices" | "triangles">,
  place: Vec,
  accepts: (triangle: number) => boolean,
): { triangle: number; weights: Weights; place: Vec } | null {
  let [best, found] = [Infinity, null as ReturnType<typeof nearestOn>];
  for (let triangle = 0; triangle < mesh.triangles.length; triangle++) {
    if (!accepts(triangle)) continue;
    const corners = mesh.triangles[triangle]!.map(at => mesh.vertices[at]!) as [Vec, Vec, Vec];
    const weights = nearest(place, ...corners);
    const near = weighted(corners, weights);
    const distance = norm(sub(place, near));
    if (distance < best) [best, found] = [distance, { triangle, weights, place: near }];
  }
  return found;
}

export const weighted = ([a, b, c]: [Vec, Vec, Vec], [u, v, w]: Weights): Vec =>
  add(scale(a, u), add(scale(b, v), scale(c, w)));

/** The place of a triangle that is nearest to `x` (Ericson, Real-Time Collision Detection, 5.1.5). */
function nearest(x: Vec, a: Vec, b: Vec, c: Vec): Weights {
  const [ab, ac, ap] = [sub(b, a), sub(c, a), sub(x, a)];
  const at = (v: number, w: number): Weights => [1 - v - w, v, w];
  const [d1, d2] = [dot(ab, ap), dot(ac, ap)];
  if (d1 <= 0 && d2 <= 0) return at(0, 0);
  const bp = sub(x, b);
  const [d3, d4] = [dot(ab, bp), dot(ac, bp)];
  if (d3 >= 0 && d4 <= d3) return at(1, 0);
  const vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return at(d1 / (d1 - d3), 0);
  const cp = sub(x, c);
  const [d5, d6] = [dot(ab, cp), dot(ac, cp)];
  if (d6 >= 0 && d5 <= d6) return at(0, 1);
  const vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return at(0, d2 / (d2 - d6));
  const va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const w = (d4 - d3) / (d4 - d3 + (d5 - d6));
    return at(1 - w, w);
  }
  const whole = 1 / (va + vb + vc);
  return at(vb * whole, vc * whole);
}
