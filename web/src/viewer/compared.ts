// A comparison of rest and stress with all that its view draws, and the planes in which both hearts are cut at the same
// levels.

import { type FileOfResult, type Result, call, get } from "../api";
import type { ComparedScan, ComparisonReport, PolarFigure, PolarMap } from "../generated/openapi";
import { DIVERGING, type Lut, STRESS_LESS_REST } from "./colours";
import type { Loaded } from "./loaded";
import type { Mesh } from "./mesh";
import { type Axis, type Plane, frameOf, heartPlanes } from "./plane";
import { type DrawnMap, FIGURES, WallFrame, differenceMap, figureMap, turnedMap, uptakeMap } from "./polar";
import type { Triple } from "./shown";
import { type Vec, add, mix, scale, sub, turned, unit } from "./vector";
import { type Voxels, unpackNifti } from "./volume";

export type WhichScan = "stress" | "rest";

/** One of both scans. */
export interface ComparedHeart {
  scan: WhichScan;
  report: ComparedScan;
  mesh: Mesh;
  /** The image about the heart; null where no file has it. */
  region: Voxels | null;
  polar: PolarMap | null;
  z: PolarFigure | null;
  score: PolarFigure | null;
  /** Its axis, with the stress heart turned as its polar map is. */
  heart: Axis | null;
  /** Whether the sides of the wall are known. */
  oriented: boolean;
}

export interface Compared {
  result: Result;
  report: ComparisonReport;
  stress: ComparedHeart;
  rest: ComparedHeart;
  difference: PolarFigure | null;
}

/** Where nothing tells the superior direction, the service takes that of the frame. */
const FRAME_SUPERIOR: Vec = [0, 0, 1];

function axisOf({ long_axis: ends, posture }: ComparedScan, turnDegrees: number): Axis | null {
  if (!ends) return null;
  const [base, apex] = [ends.base as Triple, ends.apex as Triple];
  const superior = (posture?.superior as Triple | undefined) ?? FRAME_SUPERIOR;
  return { base, apex, superior: turned(superior, unit(sub(apex, base)), (turnDegrees * Math.PI) / 180), roll: 0 };
}

export async function loadComparison(result: Result): Promise<Compared> {
  const file = (name: string): FileOfResult | undefined => result.files.find(one => one.name === name);
  const json = async <T>(name: string): Promise<T | null> => {
    const found = file(name);
    return found ? get<T>(found.href) : null;
  };
  const report = await json<ComparisonReport>("comparison.json");
  if (!report) throw new Error("This comparison has no report.");
  const heart = async (scan: WhichScan): Promise<ComparedHeart> => {
    const image = file(`region_${scan}.nii.gz`);
    const [mesh, region, polar, z, score] = await Promise.all([
      json<Mesh>(`mesh_${scan}.json`),
      image ? call(image.href).then(async answer => unpackNifti(await answer.arrayBuffer())) : null,
      json<PolarMap>(`polar_${scan}.json`),
      json<PolarFigure>(`polar_z_${scan}.json`),
      json<PolarFigure>(`polar_score_${scan}.json`),
    ]);
    if (!mesh) throw new Error(`This comparison has no mesh of the heart at ${scan}.`);
    const own = report[scan];
    return {
      scan,
      report: own,
      mesh,
      region,
      polar,
      z,
      score,
      heart: axisOf(own, scan === "stress" ? report.turn_degrees : 0),
      oriented: (polar?.orientation ?? "unknown") !== "unknown",
    };
  };
  const [stress, rest, difference] = await Promise.all([
    heart("stress"),
    heart("rest"),
    json<PolarFigure>("polar_difference.json"),
  ]);
  return { result, report, stress, rest, difference };
}

/** A row of slices of one kind. */
export interface Row {
  /** Slices beside each other. */
  count: number;
  /**
   * Where the first and the last one lie: of the short axis the share of the long axis from the apex on, of the others
   * the distance from the long axis as a share of its length.
   */
  ends: [number, number];
  /** Millimetres by which the slices of rest are moved along the row. */
  restShift: number;
}

/** The rows of the service's picture of both scans (`runs/rest_stress/slices.rs`), in the order of `KINDS`. */
export const STANDARD_ROWS: Row[] = [
  { count: 8, ends: [0.06, 0.94], restShift: 0 },
  { count: 8, ends: [-0.28, 0.28], restShift: 0 },
  { count: 8, ends: [-0.28, 0.28], restShift: 0 },
];
/** Millimetres that a slice shows at first, as in that picture. */
export const SLICE_MM = 114.4;

export interface SliceKind {
  name: string;
  short: string;
  /** From where to where its levels lie. */
  way: string;
}

export const KINDS: SliceKind[] = [
  { name: "Short axis", short: "SA", way: "apex to base" },
  { name: "Vertical long axis", short: "VLA", way: "septum to lateral wall" },
  { name: "Horizontal long axis", short: "HLA", way: "inferior to anterior wall" },
];

/** The plane of a slice of a row, and the place in its middle. */
export function sliceAt(
  { heart, scan }: { heart: Axis; scan: WhichScan },
  kind: number,
  number: number,
  rows: Row[],
): { plane: Plane; origin: Vec } {
  const { length, middle } = frameOf(heart);
  const [short, horizontal, vertical] = heartPlanes(heart) as [Plane, Plane, Plane];
  const { count, ends, restShift } = rows[kind]!;
  const at = ends[0] + ((ends[1] - ends[0]) * number) / Math.max(1, count - 1);
  const shift = scan === "rest" ? restShift : 0;
  if (kind === 0) return { plane: short, origin: add(mix(heart.apex, heart.base, at), scale(short.normal, -shift)) };
  const plane = kind === 1 ? vertical : horizontal;
  return { plane, origin: add(middle, scale(plane.normal, at * length + shift)) };
}

/** Millimetres between neighbouring slices of a kind. */
export function spacingOf(heart: Axis, kind: number, rows: Row[]): number {
  const { count, ends } = rows[kind]!;
  return (Math.abs(ends[1] - ends[0]) * frameOf(heart).length) / Math.max(1, count - 1);
}

/** The lines of a heart's polar map on its wall. */
export function wallFrameOf({ mesh, heart, polar }: ComparedHeart): WallFrame | null {
  return heart && polar ? new WallFrame(mesh, heart, polar.rows, polar.columns) : null;
}

export interface NamedMap {
  name: string;
  /** The name under a small map. */
  short: string;
  map: DrawnMap;
  /** The scan, of what is shown of one. */
  scan: WhichScan | null;
  /** The figure; uptake is shown in colours that a person chooses. */
  figure: PolarFigure["figure"] | "uptake";
  /** Its colours, where they are not those of the figure. */
  lut?: Lut;
}

/** Half of the range of differences of a figure of the beat. */
const BEAT_DIFFERENCE = { motion: 6, thickening: 40, phase: 90 } as const;

/** Motion, thickening and phase of two beats: at stress, at rest, and what stress has more. */
export function beatRowsOf({ report }: Compared, stress: Loaded, rest: Loaded): NamedMap[][] {
  return (["motion", "thickening", "phase"] as const).flatMap(figure => {
    const [atStress, atRest] = [stress, rest].map(({ figures }) => figures.find(map => map.figure === figure));
    if (!atStress || !atRest) return [];
    const { name } = FIGURES[figure];
    const [one, other] = [turnedMap(figureMap(atStress), report.turn_degrees), figureMap(atRest)];
    const less = differenceMap(one, other, BEAT_DIFFERENCE[figure]);
    return [
      [
        { name: `${name}, stress`, short: "Stress", map: one, scan: "stress", figure },
        { name: `${name}, rest`, short: "Rest", map: other, scan: "rest", figure },
        {
          name: `${name}, stress less rest`,
          short: "Stress less rest",
          map: less,
          scan: null,
          figure,
          lut: figure === "phase" ? DIVERGING : STRESS_LESS_REST,
        },
      ] satisfies NamedMap[],
    ];
  });
}

/** The map of every figure, in the order in which they are shown. */
export function mapsOf({ report, stress, rest, difference }: Compared): NamedMap[] {
  // That of stress as the heart at stress is turned, so that one place is the same on all maps and slices.
  const asTurned = (one: ComparedHeart, map: DrawnMap) =>
    one.scan === "stress" ? turnedMap(map, report.turn_degrees) : map;
  const maps: NamedMap[] = [];
  for (const one of [stress, rest])
    if (one.polar)
      maps.push({
        name: `Uptake, ${one.scan}`,
        short: one.scan === "stress" ? "Stress" : "Rest",
        map: asTurned(one, uptakeMap(one.polar)),
        scan: one.scan,
        figure: "uptake",
      });
  if (difference)
    maps.push({
      name: "Rest less stress",
      short: "Rest less stress",
      map: figureMap(difference),
      scan: null,
      figure: "difference",
    });
  for (const one of [stress, rest])
    if (one.z)
      maps.push({
        name: `z, ${one.scan}`,
        short: `z, ${one.scan}`,
        map: asTurned(one, figureMap(one.z)),
        scan: one.scan,
        figure: "z",
      });
  for (const one of [stress, rest])
    if (one.score)
      maps.push({
        name: `Score, ${one.scan}`,
        short: `Score, ${one.scan}`,
        map: asTurned(one, figureMap(one.score)),
        scan: one.scan,
        figure: "score",
      });
  return maps;
}

/** Reasons to look closer, those against comparing at all first. */
export function flagsOf({ flags }: Pick<ComparisonReport, "flags">): ComparisonReport["flags"] {
  return [...flags].sort((a, b) => Number(b.code === "not_comparable") - Number(a.code === "not_comparable"));
}

/** Whether what it was scored by is of simulated people. */
export function isSimulated({ stress, rest }: ComparisonReport): boolean {
  return [stress, rest].some(({ perfusion }) => perfusion?.normals.simulated);
}
