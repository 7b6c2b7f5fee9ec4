// A mesh drawn as the smooth surface that it stands for: its vertices stay, its triangles become curved patches.
//
// Curved PN triangles (Vlachos, Peters, Boyd, Mitchell 2001): each triangle gets a cubic patch through its corners, at
// right angles to their normals there; neighbours share the curve of their edge. For pictures only: no figure is
// measured on it.

import type { Mesh } from "./mesh";
import { type Vec, add, dot, scale, sub } from "./vector";

/** Parts of each edge: pieces of a contour are then 1 to 3 mm long. */
const PARTS = 4;

const made = new WeakMap<Mesh, Mesh>();

/** The mesh with each triangle as a curved patch of 16 flat ones; made once for each mesh. */
export function smooth(mesh: Mesh): Mesh {
  let found = made.get(mesh);
  if (!found) made.set(mesh, (found = patched(mesh)));
  return found;
}

function patched({ vertices, triangles, normals }: Mesh): Mesh {
  const out: Mesh = { vertices: [], triangles: [], normals: [] };
  for (const corners of triangles) {
    const places = corners.map(at => vertices[at]!) as [Vec, Vec, Vec];
    const across = corners.map(at => normals[at]!) as [Vec, Vec, Vec];
    const at = patch(places, across);
    const first = out.vertices.length;
    // Row r has the places with the share 1 - r / PARTS of the first corner.
    const place = (r: number, c: number) => first + (r * (r + 1)) / 2 + c;
    for (let r = 0; r <= PARTS; r++)
      for (let c = 0; c <= r; c++) {
        const [v, w] = [(r - c) / PARTS, c / PARTS];
        out.vertices.push(at(1 - v - w, v, w));
        out.normals.push(across[0]);
      }
    for (let r = 0; r < PARTS; r++)
      for (let c = 0; c <= r; c++) {
        out.triangles.push([place(r, c), place(r + 1, c), place(r + 1, c + 1)]);
        if (c < r) out.triangles.push([place(r, c), place(r + 1, c + 1), place(r, c + 1)]);
      }
  }
  return out;
}

/** The patch of a triangle, by the shares of its corners. */
function patch([a, b, c]: [Vec, Vec, Vec], [na, nb, nc]: [Vec, Vec, Vec]): (u: number, v: number, w: number) => Vec {
  // A third of the way from p to q, in the plane through p across its normal.
  const beside = (p: Vec, q: Vec, normal: Vec): Vec =>
    scale(sub(add(scale(p, 2), q), scale(normal, dot(sub(q, p), normal))), 1 / 3);
  const [ab, ba] = [beside(a, b, na), beside(b, a, nb)];
  const [bc, cb] = [beside(b, c, nb), beside(c, b, nc)];
  const [ca, ac] = [beside(c, a, nc), beside(a, c, na)];
  const edges = scale([ab, ba, bc, cb, ca, ac].reduce(add), 1 / 6);
  const middle = add(edges, scale(sub(edges, scale(add(add(a, b), c), 1 / 3)), 1 / 2));
  return (u, v, w) =>
    (
      [
        [a, u * u * u],
        [b, v * v * v],
        [c, w * w * w],
        [ab, 3 * u * u * v],
        [ba, 3 * u * v * v],
        [bc, 3 * v * v * w],
        [cb, 3 * v * w * w],
        [ca, 3 * w * w * u],
        [ac, 3 * w * u * u],
        [middle, 6 * u * v * w],
      ] as [Vec, number][]
    ).reduce<Vec>((sum, [place, share]) => add(sum, scale(place, share)), [0, 0, 0]);
}
