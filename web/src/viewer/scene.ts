// What the views of one scan share: the place looked at, the window, the layers.

import { Watched } from "../state";
import { Beating, gateAt } from "./beating";
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
  /** The mesh in every gate of a beat, at equal steps of the cycle. */
  gates?: Mesh[];
  mask?: Voxels;
}

export interface Window {
  low: number;
  high: number;
}

export type Tool = "cursor" | "window" | "move" | "correct";

/** A place to which somebody has pulled the contour. */
export interface Pull {
  /** Whether the outer surface of the wall passes through it, or the inner one. */
  outer: boolean;
  place: Vec;
  /** The place of the fitted surface that was pulled there. */
  from: Vec;
}

/** The wall that is corrected, as it was fitted, with the ends of its axis. */
export interface EditedWall {
  mesh: Mesh;
  base: Vec;
  apex: Vec;
  /** Whether its contour can be pulled. */
  pulled: boolean;
}

/** A correction that has not been sent: where a person put the heart. */
export interface Edit {
  base: Vec;
  apex: Vec;
  center: Vec;
  roll: number;
  /** Null where nothing was fitted. */
  wall: EditedWall | null;
  pulls: Pull[];
  /** The pulls that the wall was fitted with. */
  fitted: Pull[];
  /** What was changed by hand. */
  changed: Set<"center" | "axis" | "base" | "roll" | "contour">;
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

export class Scene extends Beating {
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
  /** The voxels of the gates, as far as they were read. */
  readonly gates = new Watched<(Voxels | null)[]>([]);
  /** The brightest place of the wall in any gate, over that of all gates together; null until all gates were read. */
  readonly gateShare = new Watched<number | null>(null);

  /** `still` are the voxels that are shown where no gate is. */
  constructor(
    readonly still: Voxels,
    lut: Lut,
    wallLut: Lut,
  ) {
    super();
    const { voxels } = this;
    this.cursor = new Watched<Vec>(voxels.middle);
    // A scale with an intercept may miss its zero by a rounding error.
    const least = voxels.lowest < -1e-6 * voxels.highest ? voxels.lowest : 0;
    this.window = new Watched<Window>({ low: Math.min(0, least), high: voxels.percentile(0.9995) || voxels.highest });
    this.lut = new Watched(lut);
    this.wallLut = new Watched(wallLut);
  }

  /** Everything that changes a slice. */
  watch(act: () => void): () => void {
    const all: { watch(act: () => void): () => void }[] = [
      this.cursor,
      this.window,
      this.lut,
      this.layers,
      this.gate,
      this.gates,
      this.gateShare,
      this.heart,
      this.edit,
      this.tool,
      this.view,
      this.difference,
      this.smooth,
    ];
    const ends = all.map(watched => watched.watch(act));
    return () => ends.forEach(end => end());
  }

  get voxels(): Voxels {
    return gateAt(this.gates.value, this.gate.value) ?? this.still;
  }

  /**
   * The window for what is shown. A gate holds its share of the counts of the whole beat; the thick wall of end systole,
   * which is the brightest, has the last colour.
   */
  get windowNow(): Window {
    const { low, high } = this.window.value;
    const share = this.voxels === this.still ? 1 : (this.gateShare.value ?? 1 / this.gates.value.length);
    return { low: low * share, high: high * share };
  }

  /** The layers at the gate that is shown. */
  get layersNow(): Layer[] {
    return this.layers.value.map(layer => {
      const mesh = gateAt(layer.gates ?? [], this.gate.value);
      return mesh ? { ...layer, mesh } : layer;
    });
  }

  /** The same views at another moment of the beat, whatever happens to this one. */
  at(turns: number): Scene {
    const scene = Object.create(this) as Scene;
    return Object.defineProperties(scene, {
      gate: { value: new Watched<number | null>(turns) },
      moment: { value: new Watched<number | null>(turns) },
    });
  }

  /** The middle of what slices show. */
  get middle(): Vec {
    const { middle } = this.view.value;
    if (middle) return middle;
    const heart = this.heart.value;
    return heart ? ([0, 1, 2].map(n => (heart.base[n]! + heart.apex[n]!) / 2) as unknown as Vec) : this.voxels.middle;
  }
}
