// A result with all that the views draw of it.

import { type FileOfResult, type Result, type Volume, type Walls, get } from "../api";
import { isFit } from "../words";
import { type Mesh, loadMesh } from "./mesh";
import type { Axis } from "./plane";
import type { PolarMap } from "./polar";
import type { Layer } from "./scene";
import type { Vec } from "./vector";
import { type Voxels, loadVoxels } from "./volume";

/** Millimetres that slices show at first once the heart is known. */
export const HEART_WIDTH = 140;

type Triple = [number, number, number];

/** What the page reads of a fit's report. */
export interface FitReport {
  template: string;
  choice: string;
  localisation?: { centre: Triple; axis: Triple; confidence: number };
  posture?: { superior: Triple; source: string; confidence: number };
  fit: { confidence: number | null; long_axis?: { base: Triple; apex: Triple }; displacement_mm?: number[] };
  volumes_ml: { wall: number; cavity: number | null; apparent?: Walls; anatomical?: Walls };
  mass_g?: number | null;
  thickness_mm?: { apparent: Spread; anatomical: Spread };
  measures?: Record<string, number> | null;
  polar?: { extent_percent: number; threshold_percent: number; orientation: string };
  flags: { code: string; reason: string }[];
  warnings: string[];
}

interface Spread {
  mean: number;
  spread: number;
}

export interface Loaded {
  result: Result;
  report: FitReport | null;
  mesh: Mesh;
  otherEdge: Mesh | null;
  polar: PolarMap | null;
  heart: Axis | null;
  middle: Vec;
  mask: Voxels | null;
  expert: Voxels | null;
  displacement: number[] | null;
  surface: Float32Array | null;
}

const keptVoxels = new Map<string, Promise<Voxels>>();

function kept(path: string): Promise<Voxels> {
  let found = keptVoxels.get(path);
  if (!found) {
    if (keptVoxels.size > 5) keptVoxels.delete(keptVoxels.keys().next().value!);
    found = loadVoxels(path);
    found.catch(() => keptVoxels.delete(path));
    keptVoxels.set(path, found);
  }
  return found;
}

/** The voxels of a stored volume, whatever its files are. */
export function voxelsOf(volume: Pick<Volume, "id">, frame: number | null): Promise<Voxels> {
  return kept(`/v1/volumes/${volume.id}/voxels.nii.gz${frame === null ? "" : `?frame=${frame}`}`);
}

export async function loadLoaded(result: Result): Promise<Loaded> {
  const file = (name: string): FileOfResult | undefined => result.files.find(one => one.name === name);
  const json = async <T>(name: string): Promise<T | null> => {
    const found = file(name);
    return found ? get<T>(found.href) : null;
  };
  const meshFile = file("mesh.json");
  if (!meshFile) throw new Error("This result has no mesh.");
  const fit = isFit(result.id);
  const otherEdge = file("mesh_anatomical.json") ?? file("mesh_apparent.json");
  const maskFile = file("mask.nii.gz");
  const expertId = result.parameters["expert"];
  const [mesh, inner, report, polar, mask, expert, distance] = await Promise.all([
    loadMesh(meshFile.href),
    otherEdge ? loadMesh(otherEdge.href) : null,
    fit ? json<FitReport>("report.json") : null,
    json<PolarMap>("polar.json"),
    maskFile ? kept(maskFile.href) : null,
    // The expert's mask may have been erased since; the fit is shown all the same.
    typeof expertId === "string" ? voxelsOf({ id: expertId }, null).catch(() => null) : null,
    fit ? null : json<{ parts: number; distances_mm: number[] }>("distance.json"),
  ]);
  const axis = report?.fit.long_axis;
  const known = report?.polar?.orientation !== "unknown" && report?.posture;
  const sum = mesh.vertices.reduce<Triple>((all, vertex) => [all[0] + vertex[0], all[1] + vertex[1], all[2] + vertex[2]], [0, 0, 0]);
  const middle = axis
    ? ([0, 1, 2].map(n => (axis.base[n]! + axis.apex[n]!) / 2) as Triple)
    : (sum.map(value => value / mesh.vertices.length) as Triple);
  return {
    result,
    report,
    mesh,
    otherEdge: inner,
    polar,
    heart: axis ? { ...axis, superior: known ? (report?.posture?.superior ?? null) : null, roll: 0 } : null,
    middle,
    mask,
    expert,
    displacement: report?.fit.displacement_mm ?? null,
    surface: distance ? byVertex(mesh, distance) : null,
  };
}

/** Distances are given for equal parts of each triangle; a vertex gets the mean of its triangles. */
function byVertex(mesh: Mesh, { parts, distances_mm }: { parts: number; distances_mm: number[] }): Float32Array {
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
export function layersOf(shown: Loaded | null, other: Loaded | null): Layer[] {
  const layers: Layer[] = [];
  if (shown) {
    const isApparent = shown.result.parameters["edge"] !== "anatomical";
    const [own, second] = isApparent ? ["apparent wall", "anatomical wall"] : ["anatomical wall", "apparent wall"];
    layers.push({ name: shown.otherEdge ? own! : shown.report ? "wall" : "model", colour: "#3dffa8", shown: true, mesh: shown.mesh });
    if (shown.otherEdge) layers.push({ name: second!, colour: "#ffffff", shown: false, mesh: shown.otherEdge });
    if (shown.mask) layers.push({ name: "mask", colour: "#ffd24d", shown: false, mask: shown.mask });
    if (shown.expert) layers.push({ name: "expert", colour: "#4db8ff", shown: true, mask: shown.expert });
  }
  if (other) layers.push({ name: "compared", colour: "#d6a6ff", dashed: true, shown: true, mesh: other.mesh });
  return layers;
}
