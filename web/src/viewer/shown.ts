// What the views draw of a result, whether the service or a self-contained report holds it.

import type { Closeness, Fit, PolarFigure, PolarMap, PolarSummary, Posture } from "../generated/openapi";
import type { Mesh } from "./mesh";
import type { Axis } from "./plane";
import type { Layer } from "./scene";
import type { Vec } from "./vector";
import type { Voxels } from "./volume";

/** Millimetres that slices show at first once the heart is known. */
export const HEART_WIDTH = 140;

/** A point or a direction in a document, whose type does not say that it has three numbers. */
export type Triple = [number, number, number];

/** What a fit's report says of the place of the heart. */
export interface Placed {
  fit: Pick<Fit, "long_axis">;
  posture?: Pick<Posture, "superior"> | null;
  polar?: Pick<PolarSummary, "orientation"> | null;
}

export interface Shown {
  mesh: Mesh;
  /** The same wall by the other edge. */
  otherEdge: Mesh | null;
  /** What these two are called. */
  names: [string, string];
  polar: PolarMap | null;
  heart: Axis | null;
  middle: Vec;
  mask: Voxels | null;
  expert: Voxels | null;
  displacement: number[] | null;
  /** Distance of a model to the surface it was made of, at every vertex, mm. */
  surface: Float32Array | null;
  /** The wall in every gate of a beat, with the same triangles as `mesh`, their mean. */
  gates: Mesh[] | null;
  /** Figures of the wall, laid flat: of a beat, and beside normal limits. */
  figures: PolarFigure[];
}

/** The heart's axis; it has no superior direction where nothing tells which side is anterior. */
export function heartOf({ fit, posture, polar }: Placed): Axis | null {
  const axis = fit.long_axis;
  const known = polar?.orientation !== "unknown";
  return axis
    ? {
        base: axis.base as Triple,
        apex: axis.apex as Triple,
        superior: (known && (posture?.superior as Triple)) || null,
        roll: 0,
      }
    : null;
}

/** The middle of the heart's axis, or else of the vertices. */
export function middleOf(mesh: Mesh, heart: Axis | null): Vec {
  const all = heart ? [heart.base, heart.apex] : mesh.vertices;
  return [0, 1, 2].map(n => all.reduce((sum, place) => sum + place[n]!, 0) / all.length) as unknown as Vec;
}

/** The names of the wall that was asked for, and of the other one. */
export function wallNames(edge: unknown, both: boolean, fit: boolean): [string, string] {
  const names: [string, string] = ["apparent wall", "anatomical wall"];
  if (!both) return [fit ? "wall" : "model", ""];
  return edge === "anatomical" ? [names[1], names[0]] : names;
}

/** Distances are given for equal parts of each triangle; a vertex gets the mean of its triangles. */
export function byVertex(mesh: Mesh, { parts, distances_mm }: Closeness): Float32Array {
  const each = parts * parts;
  const sums = new Float32Array(mesh.vertices.length);
  const counts = new Float32Array(mesh.vertices.length);
  mesh.triangles.forEach((corners, n) => {
    let sum = 0;
    for (let part = 0; part < each; part++) sum += distances_mm[n * each + part] ?? 0;
    for (const at of corners) {
      sums[at] = sums[at]! + sum / each;
      counts[at] = counts[at]! + 1;
    }
  });
  return sums.map((sum, at) => sum / (counts[at] || 1));
}

/** The contours of a result, and of what it is compared with. */
export function layersOf(shown: Shown | null, other: Shown | null): Layer[] {
  const layers: Layer[] = [];
  if (shown) {
    const [own, second] = shown.names;
    layers.push({ name: own, colour: "#3dffa8", shown: true, mesh: shown.mesh, ...gatesOf(shown) });
    if (shown.otherEdge) layers.push({ name: second, colour: "#ffffff", shown: false, mesh: shown.otherEdge });
    if (shown.mask) layers.push({ name: "mask", colour: "#ffd24d", shown: false, mask: shown.mask });
    if (shown.expert) layers.push({ name: "expert", colour: "#4db8ff", shown: true, mask: shown.expert });
  }
  if (other)
    layers.push({
      name: "compared",
      colour: "#d6a6ff",
      dashed: true,
      shown: true,
      mesh: other.mesh,
      ...gatesOf(other),
    });
  return layers;
}

function gatesOf({ gates }: Shown): { gates?: Mesh[] } {
  return gates ? { gates } : {};
}
