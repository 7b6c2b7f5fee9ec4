// Pulling the contour: which place of the wall is taken, how the wall follows until it is fitted again, and what the
// service is told.

import { type Mesh, nearestOn, outline, weighted } from "./mesh";
import { type Frame, type Plane, point } from "./plane";
import type { Edit, EditedWall, Pull } from "./scene";
import { smooth } from "./smooth";
import { type Vec, add, cross, dot, mix, norm, scale, sub, unit } from "./vector";

/** Most pulls of one side that the service takes. */
const MOST_PULLS = 16;
/** Millimetres from a slice within which a pull is shown in it. */
export const NEAR_SLICE = 4;

/** The share of the axis, from the base, that surely lies in the cavity: the inner side of the apex faces its end. */
const CAVITY_SHARE = 0.6;

/** The place of the cavity that a place of the wall faces, or faces away from. */
function cavityAt({ base, apex }: EditedWall, place: Vec): Vec {
  const way = sub(apex, base);
  return mix(base, apex, Math.max(0, Math.min(CAVITY_SHARE, dot(sub(place, base), way) / dot(way, way))));
}

/** Whether the wall's outer side is where it has this normal; null on its rim, which is neither. */
function isOuter(wall: EditedWall, place: Vec, normal: Vec): boolean | null {
  const way = sub(wall.apex, wall.base);
  const basal = dot(sub(place, wall.base), way) < 0.5 * dot(way, way);
  if (basal && dot(normal, way) < -0.6 * norm(way)) return null;
  return dot(normal, sub(cavityAt(wall, place), place)) <= 0;
}

type Side = boolean | null;

const known = new WeakMap<EditedWall, { triangles: Side[]; vertices: Side[] }>();

/** The sides of all triangles and vertices of a wall. */
function sidesOf(wall: EditedWall): { triangles: Side[]; vertices: Side[] } {
  let found = known.get(wall);
  if (!found) {
    const { vertices, triangles, normals } = wall.mesh;
    const ofTriangle = ([a, b, c]: Mesh["triangles"][number]) => {
      const corners: [Vec, Vec, Vec] = [vertices[a]!, vertices[b]!, vertices[c]!];
      const normal = unit(cross(sub(corners[1], corners[0]), sub(corners[2], corners[0])));
      return isOuter(wall, weighted(corners, [1 / 3, 1 / 3, 1 / 3]), normal);
    };
    found = {
      triangles: triangles.map(ofTriangle),
      vertices: vertices.map((vertex, at) => isOuter(wall, vertex, normals[at]!)),
    };
    known.set(wall, found);
  }
  return found;
}

/**
 * What pulls the wall at a place of `shown`, which is the wall itself or what was made of it so far: from where the
 * wall was fitted. Null where there is no such side, or where it has all the pulls that it may have.
 */
function pullAt(edit: Edit, shown: Mesh, place: Vec, outer?: boolean): Pull | null {
  const { wall } = edit;
  if (!wall) return null;
  const sides = sidesOf(wall).triangles;
  const near = nearestOn(shown, place, at => (outer === undefined ? sides[at] !== null : sides[at] === outer));
  if (!near) return null;
  const side = sides[near.triangle] === true;
  if (edit.pulls.filter(pull => pull.outer === side).length >= MOST_PULLS) return null;
  const corners = wall.mesh.triangles[near.triangle]!.map(at => wall.mesh.vertices[at]!) as [Vec, Vec, Vec];
  return { outer: side, place: near.place, from: weighted(corners, near.weights) };
}

/** The pull that takes the contour of `shown` near a place in a slice, and how far away the contour is. */
export function contourAt(
  edit: Edit,
  shown: Mesh,
  plane: Plane,
  place: Vec,
  reach: number,
): { away: number; pull: Pull } | null {
  if (!edit.wall?.pulled) return null;
  const ends = outline(smooth(shown), plane, place);
  let [away, right, down] = [reach, NaN, NaN];
  for (let n = 0; n < ends.length; n += 4) {
    const [x, y] = [ends[n]!, ends[n + 1]!];
    const [dx, dy] = [ends[n + 2]! - x, ends[n + 3]! - y];
    const share = Math.max(0, Math.min(1, -(x * dx + y * dy) / (dx * dx + dy * dy || 1)));
    const distance = Math.hypot(x + share * dx, y + share * dy);
    if (distance < away) [away, right, down] = [distance, x + share * dx, y + share * dy];
  }
  if (Number.isNaN(right)) return null;
  const on = point(plane, place, right, down);
  const pull = pullAt(edit, shown, on);
  // The contour that is drawn is smooth; the flat triangles lie beside it.
  return pull && { away, pull: { ...pull, place: on, from: add(pull.from, sub(on, pull.place)) } };
}

/** The pull near a place in a slice, by its number, and how far away it is; `near`: those so far from it are shown. */
export function dotAt(
  edit: Edit,
  plane: Plane,
  place: Vec,
  reach: number,
  near: number,
): { away: number; number: number } | null {
  if (!edit.wall?.pulled) return null;
  const all = edit.pulls.map((pull, number) => {
    const way = sub(pull.place, place);
    const away = Math.hypot(dot(way, plane.right), dot(way, plane.down));
    return { number, away: Math.abs(dot(way, plane.normal)) > near ? Infinity : away };
  });
  return all.filter(({ away }) => away < reach).sort((a, b) => a.away - b.away)[0] ?? null;
}

/** Farthest that the service lets a contour be pulled, mm. */
const MOST_MM = 40;

/** The pull of the side of the wall that is nearest to a place, there. */
export function pullTo(edit: Edit, shown: Mesh, place: Vec): Pull | null {
  const pull = pullAt(edit, shown, place);
  return pull && norm(sub(place, pull.from)) < MOST_MM ? { ...pull, place } : null;
}

const same = (one: Pull[], other: Pull[]) =>
  one.length === other.length &&
  one.every(({ outer, place }, n) => outer === other[n]!.outer && norm(sub(place, other[n]!.place)) < 0.005);

export function withPulls(edit: Edit, pulls: Pull[]): Edit {
  const changed = new Set(edit.changed);
  if (same(pulls, edit.fitted)) changed.delete("contour");
  else changed.add("contour");
  return { ...edit, pulls, changed };
}

/** How far from a pull the wall follows by 60 per cent, mm. */
const FOLLOWS_MM = 12;
/** By how much the other side of the wall follows. */
const OTHER_SIDE = 0.5;
/** Rounds after which pulls that are near to each other agree. */
const ROUNDS = 10;

/** The vertices of a wall, moved to `vertices`, with its contour pulled: a preview of what its springs will do. */
export function pulledMesh(wall: EditedWall, vertices: Vec[], pulls: Pull[]): Vec[] {
  const sides = sidesOf(wall).vertices;
  const follows = (place: Vec, side: Side, pull: Pull) => {
    const way = sub(place, pull.from);
    return (side === pull.outer ? 1 : OTHER_SIDE) * Math.exp(-dot(way, way) / (2 * FOLLOWS_MM ** 2));
  };
  const ways = pulls.map((): Vec => [0, 0, 0]);
  const wayAt = (place: Vec, side: Side) =>
    pulls.reduce<Vec>((sum, pull, n) => add(sum, scale(ways[n]!, follows(place, side, pull))), [0, 0, 0]);
  // What one pull moves at another one is taken off it, so that the contour passes through each.
  for (let round = 0; round < ROUNDS; round++)
    for (const [n, { outer, place, from }] of pulls.entries())
      ways[n] = add(ways[n]!, sub(sub(place, from), wayAt(from, outer)));
  return vertices.map((vertex, at) => add(vertex, wayAt(vertex, sides[at]!)));
}

/** The pulls that a fit was made with, by its parameters. */
export function fittedPulls(inner: unknown, outer: unknown): Pull[] {
  return [inner, outer].flatMap((list, side) => {
    const numbers = Array.isArray(list) ? (list as number[]) : [];
    return Array.from({ length: Math.floor(numbers.length / 3) }, (_, n): Pull => {
      const place: Vec = [numbers[3 * n]!, numbers[3 * n + 1]!, numbers[3 * n + 2]!];
      return { outer: side === 1, place, from: place };
    });
  });
}

/** The places of the pulls of one side, one after the other; null where there is none. */
export function throughOf({ pulls }: Edit, outer: boolean): number[] | null {
  const numbers = pulls.filter(pull => pull.outer === outer).flatMap(({ place }) => [...place]);
  return numbers.length > 0 ? numbers.map(part => Math.round(part * 100) / 100) : null;
}

/** A pull in words. */
export function pullWords(pull: Pull, { wall }: Edit): string {
  const way = sub(pull.place, pull.from);
  const length = norm(way);
  const name = pull.outer ? "outer wall" : "inner wall";
  if (!wall || length < 0.05) return `${name}, pulled before`;
  const outward = dot(way, sub(pull.from, cavityAt(wall, pull.from))) >= 0;
  return `${name}, ${length.toFixed(1)} mm ${outward ? "out" : "in"}`;
}

/** Pulls of the same place and side are one, mm. */
const SAME_PLACE = 0.5;

/** The pulls of one heart at the same places of another one, beside those that it has. */
export function repeatedPulls(pulls: Pull[], own: Frame, edit: Edit, other: Frame): Edit {
  const carried = (place: Vec): Vec => {
    const way = sub(place, own.middle);
    return (["axis", "anterior", "lateral"] as const).reduce<Vec>(
      (sum, side) => add(sum, scale(other[side], dot(way, own[side]))),
      other.middle,
    );
  };
  return pulls.reduce((next, { outer, place }) => {
    const to = carried(place);
    if (next.pulls.some(pull => pull.outer === outer && norm(sub(pull.place, to)) < SAME_PLACE)) return next;
    const pull = next.wall && pullAt(next, next.wall.mesh, to, outer);
    return pull ? withPulls(next, [...next.pulls, { ...pull, place: to }]) : next;
  }, edit);
}
