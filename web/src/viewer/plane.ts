// Planes through the patient and through the heart, and what a picture of them says about sides.

import { type Vec, across, add, cross, dot, mix, scale, sub, unit } from "./vector";

/** A plane to look at: `right` and `down` run along the picture, `normal` from slice to slice. */
export interface Plane {
  name: string;
  /** The name where there is little room. */
  short: string;
  right: Vec;
  down: Vec;
  normal: Vec;
  /** What lies left, right, at the top and at the bottom of the picture, if other than the patient's letters. */
  sides?: [string, string, string, string];
}

export const PATIENT: Plane[] = [
  { name: "Axial", short: "Ax", right: [1, 0, 0], down: [0, 1, 0], normal: [0, 0, 1] },
  { name: "Coronal", short: "Cor", right: [1, 0, 0], down: [0, 0, -1], normal: [0, 1, 0] },
  { name: "Sagittal", short: "Sag", right: [0, 1, 0], down: [0, 0, -1], normal: [1, 0, 0] },
];

/** The heart as it lies in the patient. */
export interface Axis {
  base: Vec;
  apex: Vec;
  /** The patient's superior direction; null if nothing tells it. */
  superior: Vec | null;
  /** Degrees about the long axis by which the sides were turned. */
  roll: number;
}

export interface Frame {
  axis: Vec;
  anterior: Vec;
  lateral: Vec;
  length: number;
  middle: Vec;
}

/** As the service counts: anterior is where superior lies across the axis, lateral follows from both. */
export function frameOf({ base, apex, superior }: Axis): Frame {
  const way = sub(apex, base);
  const axis = unit(way);
  const up = superior ? sub(superior, scale(axis, dot(axis, superior))) : across(axis);
  const anterior = Math.hypot(...up) > 1e-6 ? unit(up) : across(axis);
  return { axis, anterior, lateral: cross(anterior, axis), length: Math.hypot(...way), middle: mix(base, apex, 0.5) };
}

/** Short axis seen from the apex, horizontal and vertical long axis, as the nuclear societies lay them. */
export function heartPlanes(heart: Axis): Plane[] {
  const { axis, anterior, lateral } = frameOf(heart);
  const known = heart.superior !== null;
  const sides = (names: [string, string, string, string]): { sides?: [string, string, string, string] } =>
    known ? { sides: names } : {};
  return [
    {
      name: "Short axis",
      short: "SA",
      right: lateral,
      down: scale(anterior, -1),
      normal: axis,
      ...sides(["Sept", "Lat", "Ant", "Inf"]),
    },
    {
      name: "Horizontal long axis",
      short: "HLA",
      right: lateral,
      down: scale(axis, -1),
      normal: anterior,
      ...sides(["Sept", "Lat", "Apex", "Base"]),
    },
    {
      name: "Vertical long axis",
      short: "VLA",
      right: axis,
      down: scale(anterior, -1),
      normal: lateral,
      ...sides(["Base", "Apex", "Ant", "Inf"]),
    },
  ];
}

/** The patient's letters for a direction: the main one, and a second if it counts as well. */
export function letters(direction: Vec): string {
  const names = [
    ["L", "R"],
    ["P", "A"],
    ["S", "I"],
  ];
  return direction
    .map((part, axis): [number, string] => [Math.abs(part), names[axis]![part < 0 ? 1 : 0]!])
    .filter(([size]) => size > 0.4)
    .sort((a, b) => b[0] - a[0])
    .map(([, letter]) => letter)
    .slice(0, 2)
    .join("");
}

export function point(plane: Plane, origin: Vec, x: number, y: number): Vec {
  return add(origin, add(scale(plane.right, x), scale(plane.down, y)));
}
