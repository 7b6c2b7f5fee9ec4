// The handles of a correction: where they stand in a slice, and what dragging one changes.

import { type Mesh, withNormals } from "./mesh";
import type { Plane } from "./plane";
import { contourAt, dotAt, pulledMesh, withPulls } from "./pulls";
import type { Edit, Pull } from "./scene";
import { type Vec, add, cross, dot, norm, scale, sub, turned, unit } from "./vector";

export type Handle = "base" | "apex" | "center" | "roll";

/** Where the knob that turns the sides stands; null where the plane does not look along the axis. */
export function rollKnob(edit: Edit, plane: Plane): Vec | null {
  const axis = unit(sub(edit.apex, edit.base));
  if (Math.abs(dot(axis, plane.normal)) < 0.9) return null;
  return add(edit.center, scale(turned(scale(plane.down, -1), axis, (edit.roll * Math.PI) / 180), 48));
}

/** The handle near a place, as seen in this plane, and how far away it is. */
function handleAt(edit: Edit, plane: Plane, place: Vec, { handle: reach, knows }: Reach): [Handle, number] | null {
  const flat = (v: Vec) => Math.hypot(dot(sub(v, place), plane.right), dot(sub(v, place), plane.down));
  const candidates: [Handle, Vec][] = [
    ["apex", edit.apex],
    ["base", edit.base],
    ["center", edit.center],
  ];
  const knob = knows ? rollKnob(edit, plane) : null;
  if (knob) candidates.unshift(["roll", knob]);
  const near = candidates
    .map(([name, at]): [Handle, number] => [name, flat(at)])
    .filter(([, distance]) => distance < reach);
  return near.sort((a, b) => a[1] - b[1])[0] ?? null;
}

/** What a press has taken: a handle, or the pull of that number with how it was and where it was pressed. */
export type Held = { handle: Handle } | { pull: number; start: Pull; pressed: Vec };

/** What can be taken in a slice, and from how far, mm. */
export interface Reach {
  handle: number;
  contour: number;
  /** Pulls so far from the slice are shown in it. */
  near: number;
  /** Whether the sides are known, so that they can be turned. */
  knows: boolean;
  /** Whether the contour is drawn where nothing was moved. */
  outlined: boolean;
}

/** Most millimetres from which the contour is taken, however small the slice is: less than from side to side. */
const MOST_REACH_MM = 8;

/** What a press at a place in a slice takes: the nearest of handles, pulls and contour. */
export function heldAt(edit: Edit, plane: Plane, place: Vec, reach: Reach): Held | null {
  const handle = handleAt(edit, plane, place, reach);
  const away = handle?.[1] ?? Infinity;
  const contour = Math.min(MOST_REACH_MM, reach.contour);
  // A pull lies on the contour, which is never farther away than it.
  const own = dotAt(edit, plane, place, contour, reach.near);
  if (own && own.away <= away) return { pull: own.number, start: edit.pulls[own.number]!, pressed: place };
  const wall = previewOf(edit) ?? (reach.outlined ? edit.wall?.mesh : null);
  // Over a handle, which may lie on the contour, the handle is meant.
  const found = wall && away > reach.handle / 2 ? contourAt(edit, wall, plane, place, contour) : null;
  if (found && found.away < away) return { pull: edit.pulls.length, start: found.pull, pressed: place };
  return handle && { handle: handle[0] };
}

/** Whether what was taken is a pull that has not begun: the contour was pressed and not dragged. */
export function isOnlyPressed(held: Held, edit: Edit): boolean {
  return "pull" in held && held.pull === edit.pulls.length;
}

/** What a hand that only trembles moves the contour by, mm. */
const STILL = 0.5;

/** The correction once what was taken was dragged to a place in a slice. */
export function draggedTo(edit: Edit, plane: Plane, held: Held, place: Vec): Edit {
  if ("handle" in held) return dragged(edit, plane, held.handle, place);
  const way = sub(place, held.pressed);
  if (isOnlyPressed(held, edit) && norm(way) < STILL) return edit;
  const inPlane = add(scale(plane.right, dot(way, plane.right)), scale(plane.down, dot(way, plane.down)));
  const pulls = [...edit.pulls];
  pulls[held.pull] = { ...held.start, place: add(held.start.place, inPlane) };
  return withPulls(edit, pulls);
}

/** The cosine of the angle at which an axis counts as another one: 3 degrees. */
const TILTED = 0.9986;

/** The correction once a handle was dragged to a place in a slice. */
export function dragged(edit: Edit, plane: Plane, handle: Handle, place: Vec): Edit {
  const inPlane = (from: Vec) => {
    const way = sub(place, from);
    return add(from, add(scale(plane.right, dot(way, plane.right)), scale(plane.down, dot(way, plane.down))));
  };
  const next = { ...edit, changed: new Set(edit.changed) };
  if (handle === "center") {
    const to = inPlane(edit.center);
    const way = sub(to, edit.center);
    Object.assign(next, { center: to, base: add(edit.base, way), apex: add(edit.apex, way) });
    next.changed.add("center");
  } else if (handle === "roll") {
    const axis = unit(sub(edit.apex, edit.base));
    const way = sub(inPlane(edit.center), edit.center);
    const top = scale(plane.down, -1);
    const side = [
      axis[1] * top[2] - axis[2] * top[1],
      axis[2] * top[0] - axis[0] * top[2],
      axis[0] * top[1] - axis[1] * top[0],
    ] as Vec;
    next.roll = Math.round((Math.atan2(dot(way, side), dot(way, top)) * 180) / Math.PI);
    next.changed.add("roll");
  } else {
    const to = inPlane(edit[handle]);
    const other = handle === "apex" ? edit.base : edit.apex;
    if (norm(sub(to, other)) < 20) return edit;
    next[handle] = to;
    const [base, apex] = handle === "apex" ? [other, to] : [to, other];
    if (handle === "base") next.changed.add("base");
    // Along the axis, the base is only put elsewhere; aside, the axis is tilted with it.
    if (handle === "apex" || dot(unit(sub(apex, base)), unit(sub(edit.apex, edit.base))) < TILTED) {
      next.center = [0, 1, 2].map(n => base[n]! + 0.45 * (apex[n]! - base[n]!)) as unknown as Vec;
      next.changed.add("axis").add("center");
    }
  }
  return next;
}

/** How places and directions of the wall move with the handles. */
function movedBy(from: Pick<Edit, "base" | "apex">, to: Pick<Edit, "base" | "apex">) {
  const [old, next] = [sub(from.apex, from.base), sub(to.apex, to.base)];
  const [before, after] = [unit(old), unit(next)];
  const about = cross(before, after);
  const sine = norm(about);
  const angle = Math.atan2(sine, dot(before, after));
  const turn = (way: Vec) => (sine > 1e-9 ? turned(way, unit(about), angle) : way);
  const stretch = norm(next) / (norm(old) || 1);
  const place = (vertex: Vec) => {
    const way = sub(vertex, from.base);
    const along = dot(way, before);
    return add(to.base, add(scale(after, along * stretch), turn(sub(way, scale(before, along)))));
  };
  return { place, turn };
}

const previews = new WeakMap<Edit, Mesh | null>();

/** The wall where somebody has put and pulled it, before it is fitted again; null where it stands as it was fitted. */
export function previewOf(edit: Edit): Mesh | null {
  let found = previews.get(edit);
  if (found === undefined) previews.set(edit, (found = preview(edit)));
  return found;
}

function preview({ wall, base, apex, pulls, changed }: Edit): Mesh | null {
  const put = changed.has("center") || changed.has("axis") || changed.has("base");
  if (!wall || !(put || pulls.some(pull => norm(sub(pull.place, pull.from)) > 0))) return null;
  const { place, turn } = put
    ? movedBy(wall, { base, apex })
    : { place: (vertex: Vec) => vertex, turn: (way: Vec) => way };
  const { vertices, triangles, normals } = wall.mesh;
  const moved = { vertices: vertices.map(place), triangles, normals: normals.map(turn) };
  if (pulls.length === 0) return moved;
  return withNormals(
    pulledMesh(
      wall,
      moved.vertices,
      pulls.map(pull => ({ ...pull, from: place(pull.from) })),
    ),
    triangles,
  );
}
