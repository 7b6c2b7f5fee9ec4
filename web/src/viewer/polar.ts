// The polar map of the service, drawn, and the places of the wall that its pixels show.

import type { PolarFigure, PolarMap, WallFigure } from "../generated/openapi";
import {
  CYCLE,
  DIFFERENCE,
  LUTS,
  type Lut,
  NO_WALL,
  OUTWARD,
  UPTAKE,
  VALVE_PLANE,
  colour,
  thresholdOn,
} from "./colours";
import { number } from "../words";
import type { Mesh } from "./mesh";
import { type Axis, frameOf } from "./plane";
import { type Vec, add, dot, scale, sub } from "./vector";

/** The place of every pixel of a map. */
type Laid = Pick<PolarMap, "rows" | "columns" | "segment_of" | "level_ends" | "rings"> & Stated;

/** What lies at every pixel, in maps of uptake. */
type Stated = Pick<PolarFigure, "states">;

/** A map of one figure of the wall. */
export interface DrawnMap extends Laid {
  orientation: string;
  values: (number | null)[][];
  segments: { number: number; name: string; mean: number | null; territory?: string }[];
  /** Below it, the wall is enclosed by a line; null: nowhere. */
  threshold: number | null;
  /** The values of the first and the last colour. */
  range: [number, number];
  unit: string;
  /** The colour of values below the range; null: the first colour. */
  below: [number, number, number] | null;
  /** Whether the range closes to a ring, so that nothing lies between two values. */
  cyclic: boolean;
  /** Digits of the segments' means where they are written. */
  digits: number;
}

/** What the figures are called, and how their units are written. */
export const FIGURES: Record<WallFigure, { name: string; unit: string }> = {
  motion: { name: "Motion inward", unit: "mm" },
  thickening: { name: "Thickening", unit: "%" },
  phase: { name: "Phase", unit: "°" },
  difference: { name: "Less at stress than at rest", unit: "%" },
  z: { name: "Against normal limits", unit: "SD" },
  score: { name: "Score against normal limits", unit: "" },
};

export function figureLut(figure: WallFigure): Lut {
  if (figure === "phase") return CYCLE;
  return figure === "difference" ? DIFFERENCE : LUTS[UPTAKE]!;
}

export function figureMap(map: PolarFigure): DrawnMap {
  const cyclic = map.figure === "phase";
  const [least = 0, most = 1] = map.range;
  const segments = map.segments.map(({ number, name, mean }) => ({ number, name, mean: mean ?? null }));
  return {
    ...map,
    segments,
    range: [least, most],
    unit: FIGURES[map.figure].unit,
    threshold: null,
    below: ["motion", "thickening"].includes(map.figure) ? OUTWARD : null,
    cyclic,
    digits: map.figure === "z" ? 1 : 0,
  };
}

/**
 * An uptake as it is shown: the reference is a mean of the brightest wall, so that some places lie a little above it.
 */
export function shown(percent: number | null | undefined): number | null {
  return percent == null ? null : Math.min(100, percent);
}

export function uptakeMap(map: PolarMap): DrawnMap {
  return {
    ...map,
    values: map.values_percent.map(row => row.map(value => shown(value))),
    segments: map.segments.map(({ number, name, mean_percent, territory }) => ({
      number,
      name,
      mean: shown(mean_percent),
      territory: territory ?? "",
    })),
    threshold: map.threshold_percent,
    range: [0, 100],
    unit: "%",
    below: null,
    cyclic: false,
    digits: 0,
  };
}

/** Whether a map has places beyond the muscle's end. */
export function hasValvePlane({ states }: Stated): boolean {
  return states?.some(row => row.includes("valve_plane")) ?? false;
}

/** Whether a place `rows` from the apex and `columns` from lateral lies beyond the muscle's end. */
export function isInValvePlane(map: Laid, rows: number, columns: number): boolean {
  return isValvePlane(map, Math.max(0, Math.min(map.rows - 1, Math.floor(rows))), columnAt(map, columns));
}

/** Whether a place lies beyond the muscle's end. */
function isValvePlane(map: Laid, row: number, column: number): boolean {
  return map.states?.[row]?.[column] === "valve_plane";
}

/** The colour of a value; grey where there is no wall. */
export function colourOn(
  { range: [low, high], below }: Pick<DrawnMap, "range" | "below">,
  lut: Lut,
  value: number,
): [number, number, number] {
  if (Number.isNaN(value)) return NO_WALL;
  return below && value < low ? below : colour(lut, (value - low) / (high - low));
}

/** The rows at which the levels of a column end. */
function ends(map: Laid, column: number): number[] {
  return map.level_ends[column]!;
}

/** Share of the radius of a place `rows` from the apex. */
export function radiusOf(map: Laid, rows: number, column: number): number {
  let [from, inner] = [0, 0];
  const all = ends(map, column);
  for (const [n, outer] of map.rings.entries()) {
    const to = all[n]!;
    if (rows <= to) return inner + ((outer - inner) * (rows - from)) / Math.max(1e-6, to - from);
    [from, inner] = [to, outer];
  }
  return 1;
}

function rowsAt(map: Laid, radius: number, column: number): number {
  const all = ends(map, column);
  const { rings } = map;
  const found = rings.findIndex(outer => radius < outer);
  const n = found < 0 ? rings.length - 1 : found;
  const [from, inner] = n === 0 ? [0, 0] : [all[n - 1]!, rings[n - 1]!];
  return from + ((radius - inner) / (rings[n]! - inner)) * (all[n]! - from);
}

/** The column of a place so many columns from lateral; the ray of column n lies at n + 0.5, as that of row n does. */
function columnAt(map: Laid, columns: number): number {
  return ((Math.floor(columns) % map.columns) + map.columns) % map.columns;
}

/** The value between the rays; NaN where there is no wall. */
export function valueAt(map: DrawnMap, rows: number, columns: number): number {
  if (map.cyclic)
    return map.values[Math.max(0, Math.min(map.rows - 1, Math.floor(rows)))]![columnAt(map, columns)] ?? NaN;
  const row = Math.max(0, Math.min(map.rows - 1, rows - 0.5));
  const column = (((columns - 0.5) % map.columns) + map.columns) % map.columns;
  const [r, c] = [Math.floor(row), Math.floor(column)];
  const [fr, fc] = [row - r, column - c];
  let [sum, weight] = [0, 0];
  for (const [dr, wr] of [
    [0, 1 - fr],
    [1, fr],
  ] as const) {
    for (const [dc, wc] of [
      [0, 1 - fc],
      [1, fc],
    ] as const) {
      const value = map.values[Math.min(map.rows - 1, r + dr)]![(c + dc) % map.columns];
      if (value == null) continue;
      sum += value * wr * wc;
      weight += wr * wc;
    }
  }
  return weight > 0.3 ? sum / weight : NaN;
}

/** A map turned about its middle by so many degrees, as the service turns that of a scan: its segments stay in place. */
export function turnedMap(map: DrawnMap, degrees: number): DrawnMap {
  if (degrees === 0) return map;
  const by = (degrees / 360) * map.columns;
  const nearest = (column: number) => columnAt(map, column + 0.5 + by);
  const columns = Array.from({ length: map.columns }, (_, column) => column);
  const value = (row: number, column: number) => {
    const found = valueAt(map, row + 0.5, column + 0.5 + by);
    return Number.isNaN(found) ? null : found;
  };
  return {
    ...map,
    values: map.values.map((_, row) => columns.map(column => value(row, column))),
    level_ends: columns.map(column => map.level_ends[nearest(column)]!),
    states: map.states?.map(row => columns.map(column => row[nearest(column)]!)) ?? null,
  };
}

/**
 * What `one` has more than `other` at the same places of the drawn maps, from `-range` to `range`; on the ring of
 * `other` for those of phases.
 */
export function differenceMap(one: DrawnMap, other: DrawnMap, range: number): DrawnMap {
  const less = (a: number, b: number) => (one.cyclic ? ((a - b + 540) % 360) - 180 : a - b);
  const value = (row: number, column: number) => {
    const [rows, columns] = [row + 0.5, column + 0.5];
    const place = placeOnMap(one, ...onMap(other, rows, columns), 1);
    const found = place ? less(valueAt(one, ...place), valueAt(other, rows, columns)) : NaN;
    return Number.isNaN(found) ? null : found;
  };
  const means = new Map(one.segments.map(segment => [segment.number, segment.mean]));
  return {
    ...other,
    values: other.values.map((row, at) => row.map((_, column) => value(at, column))),
    segments: other.segments.map(segment => {
      const mean = means.get(segment.number);
      return { ...segment, mean: mean == null || segment.mean === null ? null : less(mean, segment.mean) };
    }),
    range: [-range, range],
    below: null,
    cyclic: false,
  };
}

/** The lines of the wall's coordinates, as the service lays them through a mesh. */
export class WallFrame {
  private readonly frame;
  private readonly rim: number;
  private readonly focus: number;
  private readonly apex: number;
  readonly radius: number;

  constructor(
    mesh: Mesh,
    axis: Axis,
    private readonly rows: number,
    private readonly columns: number,
  ) {
    this.frame = frameOf(axis);
    const sectors = new Array<number>(12).fill(Infinity);
    let [apex, radius] = [-Infinity, 0];
    for (const vertex of mesh.vertices) {
      const [along, angle, across] = this.parts(vertex);
      const at = Math.min(11, Math.floor((angle / (2 * Math.PI)) * 12));
      sectors[at] = Math.min(sectors[at]!, along);
      apex = Math.max(apex, along);
      radius += across / mesh.vertices.length;
    }
    const known = sectors.filter(Number.isFinite);
    this.rim = known.reduce((sum, value) => sum + value, 0) / known.length;
    this.apex = apex;
    this.radius = radius;
    this.focus = Math.max(this.rim, apex - radius);
  }

  /** The middle of the rim. */
  get base(): Vec {
    const { axis, middle } = this.frame;
    return add(middle, scale(axis, this.rim));
  }

  private parts(place: Vec): [number, number, number] {
    const { axis, anterior, lateral, middle } = this.frame;
    const r = sub(place, middle);
    const along = dot(r, axis);
    const [x, y] = [dot(r, lateral), dot(r, anterior)];
    return [along, (Math.atan2(y, x) + 2 * Math.PI) % (2 * Math.PI), Math.hypot(x, y)];
  }

  private get arc(): number {
    return (Math.PI / 2) * (this.apex - this.focus);
  }

  private get spacing(): number {
    return (this.arc + this.focus - this.rim) / this.rows;
  }

  /** Rows from the apex and columns from lateral of a place. */
  place(place: Vec): [number, number] {
    const [along, angle, across] = this.parts(place);
    const way =
      along > this.focus
        ? Math.atan2(across, along - this.focus) * (this.apex - this.focus)
        : this.arc + this.focus - along;
    return [way / this.spacing, (angle / (2 * Math.PI)) * this.columns];
  }

  /** The place in the middle of the wall, `distance` from the axis. */
  at(rows: number, columns: number): Vec {
    const { axis, anterior, lateral, middle } = this.frame;
    const angle = (columns / this.columns) * 2 * Math.PI;
    const side = add(scale(lateral, Math.cos(angle)), scale(anterior, Math.sin(angle)));
    const way = rows * this.spacing;
    const distance = this.radius;
    if (way < this.arc) {
      const tilt = way / (this.apex - this.focus);
      const start = add(middle, scale(axis, this.focus));
      return add(start, add(scale(axis, distance * Math.cos(tilt)), scale(side, distance * Math.sin(tilt))));
    }
    return add(add(middle, scale(axis, this.arc + this.focus - way)), scale(side, distance));
  }
}

/** Share of the radius and turns from lateral, counter-clockwise, of a place on the drawn map. */
function polarOf(x: number, y: number, size: number): [number, number] {
  const [dx, dy] = [x - size / 2, size / 2 - y];
  const radius = Math.hypot(dx, dy) / (size / 2 - MARGIN * size);
  return [radius, (Math.atan2(dy, dx) / (2 * Math.PI) + 1) % 1];
}

const MARGIN = 0.07;

/** The share of a drawn map's width and height at which a place lies; inverse of `placeOnMap`. */
export function onMap(map: Laid, rows: number, columns: number): [number, number] {
  const radius = Math.min(1, radiusOf(map, Math.max(0, rows), columnAt(map, columns))) * (0.5 - MARGIN);
  const angle = (2 * Math.PI * columns) / map.columns;
  return [0.5 + radius * Math.cos(angle), 0.5 - radius * Math.sin(angle)];
}

export function placeOnMap(map: Laid, x: number, y: number, size: number): [number, number] | null {
  const [radius, turns] = polarOf(x, y, size);
  if (radius > 1) return null;
  const columns = turns * map.columns;
  return [rowsAt(map, radius, columnAt(map, columns)), columns];
}

export function segmentAt<T extends { number: number }>(
  map: Laid & { segments: T[] },
  rows: number,
  columns: number,
): T | undefined {
  const row = Math.max(0, Math.min(map.rows - 1, Math.floor(rows)));
  const number = map.segment_of[row]![columnAt(map, columns)];
  return map.segments.find(segment => segment.number === number);
}

export interface PolarStyle {
  lut: Lut;
  /** What is painted: the uptake of every ray, the means of the segments. */
  segments: boolean;
  threshold: boolean;
  territories: boolean;
  cursor: [number, number] | null;
  /** What is written on the segments: their means unless given. */
  labels?: PolarLabels;
}

/** What may be written on the segments of a map. */
export type PolarLabels = "means" | "numbers" | "nothing";

const TERRITORY: Record<string, string> = { LAD: "#7ee0ff", LCX: "#b6ff8a", RCA: "#ffb3f0" };

/** Draws the map into a square of `size` CSS pixels. */
export function drawPolar(
  context: CanvasRenderingContext2D,
  map: DrawnMap,
  size: number,
  ratio: number,
  style: PolarStyle,
): void {
  const pixels = Math.round(size * ratio);
  const image = context.createImageData(pixels, pixels);
  const means = new Map(map.segments.map(segment => [segment.number, segment.mean]));
  for (let y = 0; y < pixels; y++) {
    for (let x = 0; x < pixels; x++) {
      const [radius, turns] = polarOf(x + 0.5, y + 0.5, pixels);
      if (radius > 1) continue;
      const columns = turns * map.columns;
      const nearest = columnAt(map, columns);
      const rows = rowsAt(map, radius, nearest);
      const row = Math.min(map.rows - 1, Math.floor(rows));
      const painted = style.segments ? (means.get(map.segment_of[row]![nearest]!) ?? NaN) : valueAt(map, rows, columns);
      const value = isValvePlane(map, row, nearest) ? NaN : painted;
      const at = 4 * (y * pixels + x);
      image.data.set([...colourOn(map, style.lut, value), 255], at);
    }
  }
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, pixels, pixels);
  context.putImageData(image, 0, 0);
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  const middle = size / 2;
  const full = size / 2 - MARGIN * size;
  const at = (radius: number, turns: number): [number, number] => [
    middle + full * radius * Math.cos(2 * Math.PI * turns),
    middle - full * radius * Math.sin(2 * Math.PI * turns),
  ];
  const oriented = map.orientation !== "unknown";
  context.lineWidth = 1;
  context.strokeStyle = VALVE_PLANE;
  context.beginPath();
  for (let row = 0; row < map.rows; row++) {
    for (let column = 0; column < map.columns; column++) {
      if (!isValvePlane(map, row, column)) continue;
      context.moveTo(...at(radiusOf(map, row, column), column / map.columns));
      context.lineTo(...at(radiusOf(map, row + 1, column), (column + 1) / map.columns));
    }
  }
  context.stroke();
  context.strokeStyle = "rgba(255,255,255,.55)";
  const { rings } = map;
  for (const ring of rings) {
    context.beginPath();
    context.arc(middle, middle, full * ring, 0, 2 * Math.PI);
    context.stroke();
  }
  const spokes: [number, number, number[]][] = [
    [rings[0]!, rings[1]!, [1, 3, 5, 7].map(n => n / 8)],
    [rings[1]!, 1, [0, 1, 2, 3, 4, 5].map(n => n / 6)],
  ];
  for (const [from, to, turns] of spokes) {
    for (const turn of turns) {
      context.beginPath();
      context.moveTo(...at(from, turn));
      context.lineTo(...at(to, turn));
      context.stroke();
    }
  }
  const { threshold } = map;
  if (style.threshold && threshold !== null) {
    // The border between wall below and above the threshold.
    context.strokeStyle = thresholdOn(style.lut);
    context.lineWidth = 2;
    const below = (row: number, column: number) => {
      const value = map.values[row]?.[column % map.columns];
      return value == null ? null : value < threshold;
    };
    const parts = (one: boolean | null, other: boolean | null) => one !== null && other !== null && one !== other;
    context.beginPath();
    for (let row = 0; row < map.rows; row++) {
      for (let column = 0; column < map.columns; column++) {
        const [low, high] = [column / map.columns, (column + 1) / map.columns];
        if (row + 1 < map.rows && parts(below(row, column), below(row + 1, column))) {
          const radius = radiusOf(map, row + 1, column);
          context.moveTo(...at(radius, low));
          context.lineTo(...at(radius, high));
        }
        if (parts(below(row, column), below(row, column + 1))) {
          context.moveTo(...at(radiusOf(map, row, column), high));
          context.lineTo(...at(radiusOf(map, row + 1, column), high));
        }
      }
    }
    context.stroke();
  }
  if (style.territories && oriented) {
    const territory = new Map(map.segments.map(segment => [segment.number, segment.territory]));
    const of = (row: number, column: number) =>
      territory.get(map.segment_of[row]![(column + map.columns) % map.columns]!);
    context.lineWidth = 3;
    for (let row = 0; row < map.rows; row++) {
      for (let column = 0; column < map.columns; column++) {
        const name = of(row, column);
        if (!name || name === of(row, column + 1)) continue;
        context.strokeStyle = TERRITORY[name] ?? "#fff";
        context.beginPath();
        context.moveTo(...at(radiusOf(map, row, column), (column + 1) / map.columns));
        context.lineTo(...at(radiusOf(map, row + 1, column), (column + 1) / map.columns));
        context.stroke();
      }
    }
  }
  context.textAlign = "center";
  context.textBaseline = "middle";
  const write = (text: string, x: number, y: number, font: string) => {
    context.font = font;
    context.lineWidth = size < 180 ? 2 : 3;
    context.lineJoin = "round";
    context.strokeStyle = "rgba(0,0,0,.85)";
    context.strokeText(text, x, y);
    context.fillStyle = "#fff";
    context.fillText(text, x, y);
  };
  // Small maps have the room for small figures only.
  const text = size < 180 ? 8 : Math.max(10, Math.min(14, size / 26));
  const cursor = style.cursor && cursorOn(map, style.cursor, at);
  const places = map.segments.map(({ number }) => at(...labelPlace(map, number)));
  const labels = style.labels ?? "means";
  for (const [n, segment] of (labels === "nothing" ? [] : map.segments).entries()) {
    const others = places.filter((_, other) => other !== n);
    const [x, y] = cursor ? besideRing(places[n]!, cursor, others, text) : places[n]!;
    write(
      labels === "numbers" ? String(segment.number) : number(segment.mean, map.digits),
      x,
      y,
      `600 ${text}px system-ui, sans-serif`,
    );
  }
  if (oriented) {
    for (const [name, turns] of [
      ["A", 0.25],
      ["S", 0.5],
      ["I", 0.75],
      ["L", 0],
    ] as const) {
      write(name, ...at(1.075, turns), `600 ${text}px system-ui, sans-serif`);
    }
  }
  if (cursor) {
    const [x, y] = cursor;
    for (const [width, stroke] of [
      [4, "#000"],
      [2, "#4de3ff"],
    ] as const) {
      context.lineWidth = width;
      context.strokeStyle = stroke;
      context.beginPath();
      context.arc(x, y, CURSOR_RADIUS, 0, 2 * Math.PI);
      context.stroke();
    }
  }
}

/** Radius of the cursor's ring, CSS pixels. */
const CURSOR_RADIUS = 6;

/** Where the cursor is drawn. */
function cursorOn(
  map: Laid,
  [rows, columns]: [number, number],
  at: (radius: number, turns: number) => [number, number],
): [number, number] {
  return at(Math.min(1, radiusOf(map, Math.max(0, rows), columnAt(map, columns))), columns / map.columns);
}

/**
 * The place of a number of this height, moved where the cursor's ring would cover it: to the side with the most room.
 */
function besideRing(
  place: [number, number],
  [x, y]: [number, number],
  others: [number, number][],
  height: number,
): [number, number] {
  const [aside, above] = [CURSOR_RADIUS + 4 + height, CURSOR_RADIUS + 2 + height / 2];
  if (Math.abs(place[0] - x) >= aside || Math.abs(place[1] - y) >= above) return place;
  const sides: [number, number][] = [
    [x + aside, y],
    [x - aside, y],
    [x, y - above],
    [x, y + above],
  ];
  // A number is about twice as wide as high.
  const room = (side: [number, number]) =>
    Math.min(...others.map(other => Math.max(Math.abs(other[0] - side[0]) / 2, Math.abs(other[1] - side[1]))));
  return sides.reduce((best, side) => (room(side) > room(best) ? side : best));
}

/** The middle of a segment: rows from the apex, columns from lateral. */
export function middleOfSegment(map: Laid, number: number): [number, number] {
  const [radius, turns] = labelPlace(map, number);
  const columns = turns * map.columns;
  return [rowsAt(map, radius, columnAt(map, columns)), columns];
}

function labelPlace(map: Laid, number: number): [number, number] {
  if (number === 17) return [0, 0];
  const { rings } = map;
  const between = (n: number) => (rings[n - 1]! + rings[n]!) / 2;
  const turn = (first: number, of: number, from: number) => (first + (number - from) / of) % 1;
  if (number <= 6) return [between(3), turn(0.25, 6, 1)];
  if (number <= 12) return [between(2), turn(0.25, 6, 7)];
  return [between(1), turn(0.25, 4, 13)];
}
