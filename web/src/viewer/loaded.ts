// A result with all that the views draw of it.

import { type FileOfResult, type Result, type Volume, call, get } from "../api";
import type { Closeness, PolarMap, SegmentationReport } from "../generated/openapi";
import { isFit } from "../words";
import type { Mesh } from "./mesh";
import { type Shown, byVertex, heartOf, middleOf, wallNames } from "./shown";
import { type Voxels, unpackNifti } from "./volume";

export interface Loaded extends Shown {
  result: Result;
  report: SegmentationReport | null;
}

const keptVoxels = new Map<string, Promise<Voxels>>();

async function loadVoxels(path: string): Promise<Voxels> {
  const answer = await call(path);
  return unpackNifti(await answer.arrayBuffer());
}

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

/** The structure that a job compared with: of several in the file of its expert, the one that its parameters name. */
function expertOf(id: string, parameters: Result["parameters"]): Promise<Voxels> {
  const query = new URLSearchParams({ mask: "true" });
  for (const name of ["label", "mesh_unit", "mesh_frame"]) {
    const value = parameters[name];
    if (value !== null && value !== undefined) query.set(name, String(value));
  }
  return kept(`/v1/volumes/${id}/voxels.nii.gz?${query}`);
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
    get<Mesh>(meshFile.href),
    otherEdge ? get<Mesh>(otherEdge.href) : null,
    fit ? json<SegmentationReport>("report.json") : null,
    json<PolarMap>("polar.json"),
    maskFile ? kept(maskFile.href) : null,
    // The expert's mask may have been erased since; the fit is shown all the same.
    typeof expertId === "string" ? expertOf(expertId, result.parameters).catch(() => null) : null,
    fit ? null : json<Closeness>("distance.json"),
  ]);
  const heart = report && heartOf(report);
  return {
    result,
    report,
    mesh,
    otherEdge: inner,
    polar,
    heart,
    middle: middleOf(mesh, heart),
    names: wallNames(result.parameters["edge"], inner !== null, fit),
    mask,
    expert,
    displacement: report?.fit.displacement_mm ?? null,
    surface: distance ? byVertex(mesh, distance) : null,
  };
}
