// A result with all that the views draw of it.

import { type FileOfResult, type Result, type Volume, call, fieldOf, get } from "../api";
import type { BeatReport, Closeness, PolarFigure, PolarMap, SegmentationReport } from "../generated/openapi";
import { isBeat, isFit } from "../words";
import { type Mesh, meanOf } from "./mesh";
import { type Shown, byVertex, heartOf, middleOf, wallNames } from "./shown";
import { type Voxels, unpackNifti } from "./volume";

export interface Loaded extends Shown {
  result: Result;
  report: SegmentationReport | null;
  beat: LoadedBeat | null;
}

/** What belongs to a beat beside its wall. */
export interface LoadedBeat {
  report: BeatReport;
  /** Uptake of end diastole and of end systole. */
  ends: [PolarMap, PolarMap] | null;
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

/**
 * The voxels of a stored volume, whatever its files are; of frames that are no gates, and of which none is chosen, the
 * first.
 */
export function voxelsOf(volume: Pick<Volume, "id" | "frames">, frame: number | null): Promise<Voxels> {
  const path = `/v1/volumes/${volume.id}/voxels.nii.gz`;
  if (frame !== null) return kept(`${path}?frame=${frame}`);
  return kept(path).catch(error => {
    if (volume.frames > 1 && fieldOf(error) === "frame") return kept(`${path}?frame=0`);
    throw error;
  });
}

/**
 * The voxels of every gate of a volume, one after the other; `told` has those that were read. `frames` says which volume
 * of the files each gate is, where that is not its own number.
 */
export async function readGates(
  { id }: Pick<Volume, "id">,
  gates: number,
  told: (read: (Voxels | null)[]) => boolean,
  frames?: number[],
): Promise<void> {
  const read: (Voxels | null)[] = new Array<null>(gates).fill(null);
  for (let gate = 0; gate < gates; gate++) {
    read[gate] = await loadVoxels(`/v1/volumes/${id}/voxels.nii.gz?frame=${frames?.[gate] ?? gate}`);
    if (!told([...read])) return;
  }
}

async function loadBeat(result: Result): Promise<Loaded> {
  const { file, json } = filesOf(result);
  const report = await json<BeatReport>("beat.json");
  if (!report) throw new Error("This beat has no report.");
  const [meshes, polar, ed, es, ...figures] = await Promise.all([
    Promise.all(
      report.gates.map(({ gate }) => get<Mesh>(file(`mesh_gate${String(gate).padStart(2, "0")}.json`)?.href ?? "")),
    ),
    json<PolarMap>("polar.json"),
    json<PolarMap>("polar_ed.json"),
    json<PolarMap>("polar_es.json"),
    json<PolarFigure>("polar_motion.json"),
    json<PolarFigure>("polar_thickening.json"),
    json<PolarFigure>("polar_phase.json"),
    json<PolarFigure>("polar_z.json"),
    json<PolarFigure>("polar_score.json"),
  ]);
  const heart = heartOf({ fit: report, posture: report.posture ?? null, polar });
  const mesh = meanOf(meshes);
  return {
    result,
    report: null,
    beat: { report, ends: ed && es && [ed, es] },
    mesh,
    gates: meshes,
    figures: figures.filter(map => map !== null),
    otherEdge: null,
    polar,
    heart,
    middle: middleOf(mesh, heart),
    names: ["wall", ""],
    mask: null,
    expert: null,
    displacement: null,
    surface: null,
  };
}

function filesOf(result: Result) {
  const file = (name: string): FileOfResult | undefined => result.files.find(one => one.name === name);
  const json = async <T>(name: string): Promise<T | null> => {
    const found = file(name);
    return found ? get<T>(found.href) : null;
  };
  return { file, json };
}

export async function loadLoaded(result: Result): Promise<Loaded> {
  if (isBeat(result.id)) return loadBeat(result);
  const { file, json } = filesOf(result);
  const meshFile = file("mesh.json");
  if (!meshFile) throw new Error("This result has no mesh.");
  const fit = isFit(result.id);
  const otherEdge = file("mesh_anatomical.json") ?? file("mesh_apparent.json");
  const maskFile = file("mask.nii.gz");
  const expertId = result.parameters["expert"];
  const [mesh, inner, report, polar, mask, expert, distance, ...figures] = await Promise.all([
    get<Mesh>(meshFile.href),
    otherEdge ? get<Mesh>(otherEdge.href) : null,
    fit ? json<SegmentationReport>("report.json") : null,
    json<PolarMap>("polar.json"),
    maskFile ? kept(maskFile.href) : null,
    // The expert's mask may have been erased since; the fit is shown all the same.
    typeof expertId === "string" ? expertOf(expertId, result.parameters).catch(() => null) : null,
    fit ? null : json<Closeness>("distance.json"),
    json<PolarFigure>("polar_z.json"),
    json<PolarFigure>("polar_score.json"),
  ]);
  const heart = report && heartOf(report);
  return {
    result,
    report,
    beat: null,
    gates: null,
    figures: figures.filter(map => map !== null),
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
