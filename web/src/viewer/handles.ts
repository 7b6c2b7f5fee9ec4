// The handles of a correction: where they stand in a slice, and what dragging one changes.

import type { Mesh } from "./mesh";
import type { Plane } from "./plane";
import type { Edit } from "./scene";
import { type Vec, add, cross, dot, norm, scale, sub, turned, unit } from "./vector";

export type Handle = "base" | "apex" | "center" | "roll";

/** Where the knob that turns the sides stands; null where the plane does not look along the axis. */
export function rollKnob(edit: Edit, plane: Plane): Vec | null {
  const axis = unit(sub(edit.apex, edit.base));
  if (Math.abs(dot(axis, plane.normal)) < 0.9) return null;
  return add(edit.center, scale(turned(scale(plane.down, -1), axis, (edit.roll * Math.PI) / 180), 48));
}

/** The handle near a place, as seen in this plane; `knows`: whether the sides are known, so that they can be turned. */
export function handleAt(edit: Edit, plane: Plane, place: Vec, reach: number, knows: boolean): Handle | null {
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
  return near.sort((a, b) => a[1] - b[1])[0]?.[0] ?? null;
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

/** The wall moved as the handles were: a preview of where it will be looked for. */
export function movedMesh(mesh: Mesh, from: Edit, to: Edit): Mesh {
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
  return { vertices: mesh.vertices.map(place), triangles: mesh.triangles, normals: mesh.normals.map(turn) };
}
