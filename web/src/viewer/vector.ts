// Points and directions in the patient's frame: x to the left, y to posterior, z to superior (LPS), millimetres.

export type Vec = readonly [number, number, number];

export const add = (a: Vec, b: Vec): Vec => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a: Vec, b: Vec): Vec => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a: Vec, s: number): Vec => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a: Vec, b: Vec): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vec, b: Vec): Vec => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const norm = (a: Vec): number => Math.hypot(a[0], a[1], a[2]);
export const unit = (a: Vec): Vec => scale(a, 1 / (norm(a) || 1));
export const mix = (a: Vec, b: Vec, t: number): Vec => add(scale(a, 1 - t), scale(b, t));

/** A unit vector across `axis`. */
export function across(axis: Vec): Vec {
  const least: Vec = Math.abs(axis[0]) < 0.6 ? [1, 0, 0] : [0, 1, 0];
  return unit(sub(least, scale(axis, dot(axis, least))));
}

/** `v` turned about the unit vector `axis`. */
export function turned(v: Vec, axis: Vec, radians: number): Vec {
  const [c, s] = [Math.cos(radians), Math.sin(radians)];
  return add(add(scale(v, c), scale(cross(axis, v), s)), scale(axis, dot(axis, v) * (1 - c)));
}
