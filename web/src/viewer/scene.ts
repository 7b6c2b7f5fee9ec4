// What the views of one scan share: the place looked at, the window, the layers.

import { Watched } from "../state";
import type { Camera } from "./camera";
import type { Lut } from "./colours";
import type { Mesh } from "./mesh";
import type { Axis } from "./plane";
import type { Vec } from "./vector";
import type { Voxels } from "./volume";

export interface Layer {
  name: string;
  /** Drawn as this colour. */
  colour: string;
  dashed?: boolean;
  shown: boolean;
  mesh?: Mesh;
  mask?: Voxels;
}

export interface Window {
  low: number;
  high: number;
}

export type Tool = "cursor" | "window" | "move" | "correct";

/** A correction that has not been sent: where a person put the heart. */
export interface Edit {
  base: Vec;
  apex: Vec;
  center: Vec;
  roll: number;
  /** Which of them were changed by hand. */
  changed: Set<"center" | "axis" | "base" | "roll">;
}

export interface Difference {
  fit: Voxels;
  other: Voxels;
}

export interface View {
  /** Millimetres across the shorter side of a slice. */
  width: number;
  /** Where the picture's middle lies; null: at the heart or the middle of the volume. */
  middle: Vec | null;
}

export class Scene {
  readonly cursor: Watched<Vec>;
  readonly window: Watched<Window>;
  readonly lut: Watched<Lut>;
  /** Colours of polar map and wall. */
  readonly wallLut: Watched<Lut>;
  readonly layers = new Watched<Layer[]>([]);
  readonly heart = new Watched<Axis | null>(null);
  readonly edit = new Watched<Edit | null>(null);
  readonly tool = new Watched<Tool>("cursor");
  readonly view = new Watched<View>({ width: 0, middle: null });
  readonly difference = new Watched<Difference | null>(null);
  readonly smooth = new Watched<boolean>(true);
  /** From where the walls are seen, the same for all; `turned` counts its changes. */
  camera: Camera | null = null;
  readonly turned = new Watched<number>(0);

  constructor(readonly voxels: Voxels, lut: Lut, wallLut: Lut) {
    this.cursor = new Watched<Vec>(voxels.middle);
    this.window = new Watched<Window>({ low: Math.min(0, voxels.lowest), high: voxels.percentile(0.9995) || voxels.highest });
    this.lut = new Watched(lut);
    this.wallLut = new Watched(wallLut);
  }

  /** Everything that changes a slice. */
  watch(act: () => void): () => void {
    const all: { watch(act: () => void): () => void }[] = [this.cursor, this.window, this.lut, this.layers, this.heart, this.edit, this.tool, this.view, this.difference, this.smooth];
    const ends = all.map(watched => watched.watch(act));
    return () => ends.forEach(end => end());
  }

  /** The middle of what slices show. */
  get middle(): Vec {
    const { middle } = this.view.value;
    if (middle) return middle;
    const heart = this.heart.value;
    return heart ? [0, 1, 2].map(n => (heart.base[n]! + heart.apex[n]!) / 2) as unknown as Vec : this.voxels.middle;
  }
}
