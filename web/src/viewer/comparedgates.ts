// The gates of both scans of a comparison: their voxels about the heart, the wall in each, and the brightest of all.

import type { Volume } from "../api";
import type { ComparedHeart, WhichScan } from "./compared";
import { gateAt } from "./beating";
import { brightestOf } from "./drawing";
import { type Loaded, readGates } from "./loaded";
import type { Mesh } from "./mesh";
import type { Plane } from "./plane";
import type { Vec } from "./vector";
import { Voxels } from "./volume";
import { uptake } from "./wall";

/** What belongs to each of both scans. */
export type OfBoth<T> = Record<WhichScan, T>;

/** The gates of a scan, all of them. */
export interface Gates {
  voxels: Voxels[];
  /** The wall in each gate; null where no beat of the scan was stored. */
  meshes: Mesh[] | null;
  /** The brightest place of the wall, and of the image about the heart, in any gate. */
  brightestWall: number;
  highest: number;
}

/** Which volumes of a scan's files are its gates, in their order. */
export function gatesOf(volume: Volume, beat: Loaded | null): number[] {
  const known = beat?.beat?.report.gates.map(({ frame }) => frame);
  return known ?? Array.from({ length: volume.gates?.number ?? volume.frames }, (_, n) => n);
}

/** The voxels on the grid of another image, which may lie within it. */
function within(voxels: Voxels, grid: Voxels): Voxels {
  const [nx, ny, nz] = grid.shape;
  const values = new Float32Array(nx * ny * nz);
  const origin = grid.toPlace([0, 0, 0]);
  const next = grid.toPlace([1, 0, 0]);
  const step: Vec = [next[0] - origin[0], next[1] - origin[1], next[2] - origin[2]];
  for (let k = 0; k < nz; k++)
    for (let j = 0; j < ny; j++) voxels.line(grid.toPlace([0, j, k]), step, nx, values, nx * (j + ny * k));
  return new Voxels(grid.shape, grid.affine, values);
}

/** Reads the gates of a scan about its heart; `told` hears how many were read and says whether to go on. */
export async function readHeartGates(
  volume: Volume,
  region: Voxels,
  frames: number[],
  told: (read: number) => boolean,
): Promise<Voxels[] | null> {
  const near: Voxels[] = [];
  let goes = true;
  await readGates(
    volume,
    frames.length,
    read => {
      // Only what lies about the heart is kept: 32 gates of whole images are too much for a phone.
      const last = read[near.length];
      if (last) near.push(within(last, region));
      return (goes = told(near.length));
    },
    frames,
  );
  return goes ? near : null;
}

export function measured(one: ComparedHeart, voxels: Voxels[], meshes: Mesh[] | null): Gates {
  const walls = meshes?.length === voxels.length ? meshes : null;
  return {
    voxels,
    meshes: walls,
    brightestWall: Math.max(...voxels.map((gate, n) => Math.max(...uptake(gate, walls?.[n] ?? one.mesh)))),
    highest: Math.max(...voxels.map(gate => gate.highest)),
  };
}

/** What slices show of a scan: its image, its wall, and what counts as 100 per cent. */
export interface ShownHeart {
  voxels: Voxels;
  mesh: Mesh;
  full: { wall: () => number; image: () => number; slice: (plane: Plane, origin: Vec, across: number) => number };
}

/** A scan at a moment of the cycle; the sum of its gates where there is none, or where they were not read. */
export function heartAt(one: ComparedHeart, gates: Gates | null, turns: number | null): ShownHeart | null {
  const gate = gates && gateAt(gates.voxels, turns);
  if (!gates || !gate) {
    const { region } = one;
    return (
      region && {
        voxels: region,
        mesh: one.mesh,
        full: {
          wall: () => one.polar?.reference ?? one.report.polar?.reference ?? region.highest,
          image: () => region.highest,
          slice: (plane, origin, across) => brightestOf(region, plane, origin, across),
        },
      }
    );
  }
  return {
    voxels: gate,
    mesh: gateAt(gates.meshes ?? [], turns) ?? one.mesh,
    // The same in all gates: a wall that thickens gets brighter, and its brightest moment has the last colour.
    full: {
      wall: () => gates.brightestWall,
      image: () => gates.highest,
      slice: (plane, origin, across) => brightestInGates(gates.voxels, plane, origin, across),
    },
  };
}

const brightest = new WeakMap<Voxels[], Map<string, number>>();

/** The brightest place of a slice in any gate. */
function brightestInGates(gates: Voxels[], plane: Plane, origin: Vec, across: number): number {
  let known = brightest.get(gates);
  if (!known) brightest.set(gates, (known = new Map()));
  const key = [...plane.normal, ...origin, across].join();
  let found = known.get(key);
  if (found === undefined) {
    found = Math.max(...gates.map(gate => brightestOf(gate, plane, origin, across)));
    known.set(key, found);
  }
  return found;
}
