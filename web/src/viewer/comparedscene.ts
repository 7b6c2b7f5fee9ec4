// What the views of a comparison share: colours, window, rows of slices, the chosen slice, the cursor on both walls, the
// moment of the beat, from where the walls are seen.

import { Watched, useWatched } from "../state";
import { Beating } from "./beating";
import { LUTS, type Lut, UPTAKE, WALL_LUT, kept } from "./colours";
import { type Row, type WhichScan, SLICE_MM, STANDARD_ROWS } from "./compared";
import type { Gates, OfBoth } from "./comparedgates";
import type { Loaded } from "./loaded";
import type { Edit } from "./scene";
import type { PolarLabels } from "./polar";
import { type Vec, unit } from "./vector";

/** What is written on the segments of the polar maps of uptake. */
export type Written = PolarLabels | "scores";

/** What counts as 100 per cent in the slices. */
export type Normalisation = "wall" | "image" | "slice";

/** A correction of one heart that has not been sent. */
export interface ComparedEdit {
  scan: WhichScan;
  edit: Edit;
  /** What goes to the other heart with it; null where nothing was changed there. */
  other: Edit | null;
}

export class ComparedScene extends Beating {
  /** Colours of the uptake in slices, polar maps and walls. */
  readonly lut = new Watched<Lut>(kept(WALL_LUT, UPTAKE) ?? LUTS[UPTAKE]!);
  readonly normalisation = new Watched<Normalisation>("wall");
  /** Uptake in slices that has the first and the last colour, per cent. */
  readonly window = new Watched<[number, number]>([0, 100]);
  /** The rows of slices, in the order of `KINDS`. */
  readonly rows = new Watched<Row[]>(STANDARD_ROWS);
  /** Millimetres that a slice shows. */
  readonly across = new Watched<number>(SLICE_MM);
  readonly smooth = new Watched<boolean>(true);
  readonly contours = new Watched<boolean>(false);
  /** The slice of both scans that is marked and shown large. */
  readonly chosen = new Watched<{ kind: number; number: number }>({ kind: 0, number: 3 });
  /** The place on both walls: shares of width and height of a drawn polar map. */
  readonly cursor = new Watched<[number, number] | null>(null);
  /** The place under the mouse, which goes before the cursor as long as it is there. */
  readonly pointed = new Watched<[number, number] | null>(null);
  /** The gates of both scans, once all of them were read. */
  readonly gates = new Watched<OfBoth<Gates | null>>({ stress: null, rest: null });
  /** The stored beats of both scans that belong to the comparison. */
  readonly beats = new Watched<OfBoth<Loaded | null>>({ stress: null, rest: null });
  /** The heart that somebody corrects, as far as it was moved. */
  readonly edit = new Watched<ComparedEdit | null>(null);
  /** Whether the valve plane is being put through two points, and the first of them with the kind of its slice. */
  readonly valve = new Watched<{ first: { kind: number; place: Vec } | null } | null>(null);
  readonly written = new Watched<Written>("means");
  /** From where both walls are seen, in directions of the heart: lateral, anterior, apex. */
  readonly seen = new Watched<{ toward: Vec; up: Vec }>(FROM_FRONT);

  /** Everything that changes the picture of a slice. */
  watchPictures(act: () => void): () => void {
    return watchAll(
      [
        this.lut,
        this.normalisation,
        this.window,
        this.rows,
        this.across,
        this.smooth,
        this.contours,
        this.gate,
        this.gates,
      ],
      act,
    );
  }

  /** Everything that is marked on slices. */
  watchMarks(act: () => void): () => void {
    return watchAll([this.chosen, this.cursor, this.pointed, this.edit, this.valve], act);
  }

  watch(act: () => void): () => void {
    const ends = [this.watchPictures(act), this.watchMarks(act)];
    return () => ends.forEach(end => end());
  }

  /** The place that all views mark. */
  get place(): [number, number] | null {
    return this.pointed.value ?? this.cursor.value;
  }

  /** Changes the row of the marked slice, which stays within it. */
  changeRow(change: Partial<Row>): void {
    const { kind } = this.chosen.value;
    this.showRows(this.rows.value.map((row, at) => (at === kind ? { ...row, ...change } : row)));
  }

  /** Window, zoom and rows as they were at first. */
  showAsAtFirst(): void {
    const first = new ComparedScene();
    this.window.value = first.window.value;
    this.normalisation.value = first.normalisation.value;
    this.across.value = first.across.value;
    this.showRows(first.rows.value);
  }

  private showRows(rows: Row[]): void {
    const { kind, number } = this.chosen.value;
    this.rows.value = rows;
    const last = rows[kind]!.count - 1;
    if (number > last) this.chosen.value = { kind, number: last };
  }
}

function watchAll(all: { watch(act: () => void): () => void }[], act: () => void): () => void {
  const ends = all.map(watched => watched.watch(act));
  return () => ends.forEach(end => end());
}

/** The place that all views mark; the component is drawn again when it changes. */
export function usePlace(scene: ComparedScene): [number, number] | null {
  useWatched(scene.pointed);
  useWatched(scene.cursor);
  return scene.place;
}

/** Anterior and lateral wall, apex down. */
export const FROM_FRONT = seenFrom([0.65, 0.55, 0.52]);

function seenFrom(direction: Vec): { toward: Vec; up: Vec } {
  const toward = unit(direction);
  return { toward, up: unit([toward[0] * toward[2], toward[1] * toward[2], toward[2] ** 2 - 1]) };
}
