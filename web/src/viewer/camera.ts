// How meshes are looked at and lit, whatever draws them.

import type { Mesh } from "./mesh";
import { type Vec, cross, dot, sub, turned, unit } from "./vector";

/** A parallel view of `target` along `-toward`, with `up` at the top. */
export interface Camera {
  toward: Vec;
  up: Vec;
  target: Vec;
  /** Millimetres along the shorter side of the picture. */
  span: number;
}

/** What draws meshes on a canvas. */
export interface MeshPainter {
  camera: Camera;
  /** A mesh as a closed surface with a colour (red, green, blue from 0 to 1) for every vertex. */
  setSurface(name: string, mesh: Mesh, colours: Float32Array): void;
  /** A mesh by its edges in one colour. */
  setWire(name: string, mesh: Mesh, colour: Vec): void;
  setPoint(name: string, place: Vec, colour: Vec): void;
  remove(name: string): void;
  draw(): void;
  end(): void;
}

/** From in front of the patient, a little to the left and above. */
export function usualCamera(): Camera {
  return { toward: unit([0.35, -0.9, 0.25]), up: [0, 0, 1], target: [0, 0, 0], span: 135 };
}

/** The direction to the right of the picture. */
export function rightOf({ up, toward }: Camera): Vec {
  return unit(cross(up, toward));
}

/** Turns the scene by a drag of so many pixels. */
export function turn(camera: Camera, dx: number, dy: number): void {
  const right = rightOf(camera);
  const toward = turned(turned(camera.toward, camera.up, -dx * 0.01), right, -dy * 0.01);
  camera.up = unit(turned(camera.up, right, -dy * 0.01));
  camera.toward = unit(toward);
}

/** Millimetres from the lower to the upper edge of a picture; `ratio` is width by height. */
export function heightOf({ span }: Camera, ratio: number): number {
  return span / Math.min(ratio, 1);
}

/** The share of the picture's width and height at which a place appears; `ratio` is width by height. */
export function project(camera: Camera, place: Vec, ratio: number): [number, number] {
  const r = sub(place, camera.target);
  const height = heightOf(camera, ratio);
  return [0.5 + dot(r, rightOf(camera)) / (height * ratio), 0.5 - dot(r, camera.up) / height];
}

/** The share of its colour that a surface with this unit normal shows. The program of `glview.ts` counts the same. */
export function light(camera: Camera, normal: Vec): number {
  return 0.35 + 0.55 * Math.abs(dot(normal, camera.toward)) + 0.18 * (0.5 + 0.5 * dot(normal, camera.up));
}

/** The middle of the box about a mesh, and half of its longest diagonal. */
export function boundsOf(mesh: Mesh): { middle: Vec; reach: number } {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (const vertex of mesh.vertices) {
    for (let n = 0; n < 3; n++) {
      low[n] = Math.min(low[n]!, vertex[n]!);
      high[n] = Math.max(high[n]!, vertex[n]!);
    }
  }
  const middle = [0, 1, 2].map(n => (low[n]! + high[n]!) / 2) as unknown as Vec;
  const reach = Math.max(...mesh.vertices.map(vertex => Math.hypot(...sub(vertex, middle))));
  return { middle, reach };
}
