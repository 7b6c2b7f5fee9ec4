// How a slice is drawn: the resampled voxels, what lies over them, and what a reader needs to know of the picture.

import { counts } from "../words";
import type { Lut } from "./colours";
import { type Mesh, outline } from "./mesh";
import { smooth as smoothSurface } from "./smooth";
import { previewOf, rollKnob } from "./handles";
import { type Plane, letters, point } from "./plane";
import { NEAR_SLICE } from "./pulls";
import type { Edit, Layer, Scene } from "./scene";
import { type Vec, add, dot, scale, sub, unit } from "./vector";
import type { Voxels } from "./volume";

export interface SliceStyle {
  width: number;
  height: number;
  /** Pixels for one CSS pixel. */
  ratio: number;
  letters: boolean;
  cursor: boolean;
}

/** The place in the middle of the picture, in the slice through the cursor, and CSS pixels for one millimetre. */
export function sliceOrigin(scene: Scene, plane: Plane, width: number, height: number): { origin: Vec; scale: number } {
  const middle = scene.middle;
  const origin = add(middle, scale(plane.normal, dot(sub(scene.cursor.value, middle), plane.normal)));
  return { origin, scale: Math.min(width, height) / (scene.view.value.width || 200) };
}

/** Values on a grid of `nx` by `ny` places, `step` millimetres apart, with `origin` in the middle. */
function sample(voxels: Voxels, plane: Plane, origin: Vec, nx: number, ny: number, step: number): Float32Array {
  const out = new Float32Array(nx * ny);
  const right = scale(plane.right, step);
  for (let y = 0; y < ny; y++) {
    const start = point(plane, origin, (0.5 - nx / 2) * step, (y + 0.5 - ny / 2) * step);
    voxels.line(start, right, nx, out, y * nx);
  }
  return out;
}

/** The brightest place of a slice, within a square of `across` millimetres about `origin`; 0 where none is brighter. */
export function brightestOf(voxels: Voxels, plane: Plane, origin: Vec, across: number): number {
  const n = Math.max(2, Math.ceil(across / voxels.spacing));
  // What lies outside of the voxels is no number, and no place is brighter than it.
  return sample(voxels, plane, origin, n, n, across / n).reduce((most, value) => (value > most ? value : most), 0);
}

const scratch = document.createElement("canvas");

/** What is painted of voxels, and how. */
export interface Look {
  voxels: Voxels;
  lut: Lut;
  /** The values of the first and the last colour. */
  low: number;
  high: number;
  smooth: boolean;
}

/** A grid of places in a slice, `step` millimetres apart. */
interface Grid {
  nx: number;
  ny: number;
  step: number;
}

export interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}

/** Paints the slice through `origin` into a rectangle of the context; `tint` changes the pixels of its grid. */
export function paintVoxels(
  context: CanvasRenderingContext2D,
  { voxels, lut, low, high, smooth }: Look,
  plane: Plane,
  origin: Vec,
  box: Box,
  factor: number,
  tint?: (pixels: Uint8ClampedArray, grid: Grid) => void,
): void {
  const finest = voxels.spacing / (smooth ? 3 : 1);
  const step = Math.max(finest, 1 / factor);
  const [nx, ny] = [
    Math.max(1, Math.ceil(box.width / factor / step)),
    Math.max(1, Math.ceil(box.height / factor / step)),
  ];
  const values = sample(voxels, plane, origin, nx, ny, step);
  const image = new ImageData(nx, ny);
  const gain = 255 / (high - low || 1);
  const pixels = image.data;
  for (let n = 0; n < values.length; n++) {
    const value = values[n]!;
    const outside = Number.isNaN(value);
    const at = outside ? 0 : 3 * Math.max(0, Math.min(255, Math.round((value - low) * gain)));
    pixels[4 * n] = outside ? 10 : lut[at]!;
    pixels[4 * n + 1] = outside ? 14 : lut[at + 1]!;
    pixels[4 * n + 2] = outside ? 17 : lut[at + 2]!;
    pixels[4 * n + 3] = 255;
  }
  tint?.(pixels, { nx, ny, step });
  if (scratch.width < nx || scratch.height < ny)
    Object.assign(scratch, { width: Math.max(nx, scratch.width), height: Math.max(ny, scratch.height) });
  scratch.getContext("2d")?.putImageData(image, 0, 0);
  context.imageSmoothingEnabled = smooth;
  const [width, height] = [nx * step * factor, ny * step * factor];
  context.drawImage(
    scratch,
    0,
    0,
    nx,
    ny,
    box.x + (box.width - width) / 2,
    box.y + (box.height - height) / 2,
    width,
    height,
  );
}

/** Paints the slice of a scene. */
export function paint(
  context: CanvasRenderingContext2D,
  scene: Scene,
  plane: Plane,
  origin: Vec,
  box: Box,
  factor: number,
): void {
  const look = { voxels: scene.voxels, lut: scene.lut.value, ...scene.windowNow, smooth: scene.smooth.value };
  const difference = scene.difference.value;
  paintVoxels(
    context,
    look,
    plane,
    origin,
    box,
    factor,
    difference
      ? (pixels, { nx, ny, step }) => {
          const [fit, other] = [difference.fit, difference.other].map(voxels =>
            sample(voxels, plane, origin, nx, ny, step),
          );
          for (let n = 0; n < nx * ny; n++) {
            const [a, b] = [fit![n]! > 0.5, other![n]! > 0.5];
            if (a === b) continue;
            const tint = a ? [255, 140, 0] : [40, 170, 255];
            for (let channel = 0; channel < 3; channel++)
              pixels[4 * n + channel] = 0.4 * pixels[4 * n + channel]! + 0.6 * tint[channel]!;
          }
        }
      : undefined,
  );
}

/** Strokes the contours of the layers; the context's origin is the slice's, in CSS pixels. */
export function contours(
  context: CanvasRenderingContext2D,
  layers: Layer[],
  plane: Plane,
  origin: Vec,
  factor: number,
  reach: number,
): void {
  for (const layer of layers) {
    if (!layer.shown) continue;
    const ends = layer.mesh
      ? outlineOf(layer.mesh, plane, origin)
      : layer.mask
        ? marched(layer.mask, plane, origin, reach)
        : null;
    if (ends) strokeOutline(context, ends, factor, layer);
  }
}

/** Where the smooth surface through a mesh cuts a plane. */
export function outlineOf(mesh: Mesh, plane: Plane, origin: Vec): Float32Array {
  return outline(smoothSurface(mesh), plane, origin);
}

/** Strokes pairs of points of a slice, mm. */
export function strokeOutline(
  context: CanvasRenderingContext2D,
  ends: Float32Array,
  factor: number,
  { colour, dashed = false }: Pick<Layer, "colour" | "dashed">,
): void {
  if (ends.length === 0) return;
  context.beginPath();
  for (let n = 0; n < ends.length; n += 4) {
    context.moveTo(ends[n]! * factor, ends[n + 1]! * factor);
    context.lineTo(ends[n + 2]! * factor, ends[n + 3]! * factor);
  }
  context.lineCap = "round";
  context.setLineDash(dashed ? [2, 4] : []);
  context.strokeStyle = "rgba(0,0,0,.55)";
  context.lineWidth = 3.2;
  context.stroke();
  context.strokeStyle = colour;
  context.lineWidth = 1.7;
  context.stroke();
  context.setLineDash([]);
}

/** The border of a mask in a plane, by Marching Squares at one half. */
function marched(mask: Voxels, plane: Plane, origin: Vec, reach: number): Float32Array {
  const step = mask.spacing / 2;
  const n = Math.min(400, Math.ceil((2 * reach) / step));
  const values = sample(mask, plane, origin, n, n, step);
  const out: number[] = [];
  const value = (x: number, y: number) => values[y * n + x]! || 0;
  const at = (x: number) => (x + 0.5 - n / 2) * step;
  for (let y = 0; y + 1 < n; y++) {
    for (let x = 0; x + 1 < n; x++) {
      const corners: [number, number, number][] = [
        [x, y, value(x, y)],
        [x + 1, y, value(x + 1, y)],
        [x + 1, y + 1, value(x + 1, y + 1)],
        [x, y + 1, value(x, y + 1)],
      ];
      const ends: number[] = [];
      for (let e = 0; e < 4; e++) {
        const [a, b] = [corners[e]!, corners[(e + 1) % 4]!];
        if (a[2] > 0.5 === b[2] > 0.5) continue;
        const t = (0.5 - a[2]) / (b[2] - a[2]);
        ends.push(at(a[0] + t * (b[0] - a[0])), at(a[1] + t * (b[1] - a[1])));
      }
      if (ends.length >= 4) out.push(...ends.slice(0, 4));
      if (ends.length === 8) out.push(...ends.slice(4));
    }
  }
  return new Float32Array(out);
}

export function label(
  context: CanvasRenderingContext2D,
  text: string,
  x: number,
  y: number,
  align: CanvasTextAlign = "center",
  size = 12,
): void {
  context.font = `600 ${size}px system-ui, sans-serif`;
  context.textAlign = align;
  context.textBaseline = "middle";
  context.lineJoin = "round";
  context.lineWidth = 3;
  context.strokeStyle = "rgba(0,0,0,.8)";
  context.strokeText(text, x, y);
  context.fillStyle = "#f4f7f8";
  context.fillText(text, x, y);
}

export function drawSlice(element: HTMLCanvasElement, scene: Scene, plane: Plane, style: SliceStyle): void {
  const context = element.getContext("2d");
  const { width, height, ratio } = style;
  if (!context || width < 2 || height < 2) return;
  const { origin, scale: factor } = sliceOrigin(scene, plane, width, height);
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.fillStyle = "#0a0e11";
  context.fillRect(0, 0, width, height);
  paint(context, scene, plane, origin, { x: 0, y: 0, width, height }, factor);
  context.save();
  context.translate(width / 2, height / 2);
  contours(context, scene.layersNow, plane, origin, factor, Math.hypot(width, height) / 2 / factor);
  const flat = (place: Vec): [number, number] => {
    const r = sub(place, origin);
    return [dot(r, plane.right) * factor, dot(r, plane.down) * factor];
  };
  if (style.cursor) {
    const [x, y] = flat(scene.cursor.value);
    context.strokeStyle = "rgba(77,227,255,.75)";
    context.lineWidth = 1;
    context.beginPath();
    for (const [a, b] of [
      [-width, x - 9],
      [x + 9, width],
    ] as const) {
      context.moveTo(a, y);
      context.lineTo(b, y);
    }
    for (const [a, b] of [
      [-height, y - 9],
      [y + 9, height],
    ] as const) {
      context.moveTo(x, a);
      context.lineTo(x, b);
    }
    context.stroke();
  }
  const edit = style.cursor && scene.tool.value === "correct" ? scene.edit.value : null;
  if (edit) {
    const wall = previewOf(edit);
    if (wall) strokeOutline(context, outlineOf(wall, plane, origin), factor, PREVIEW);
    drawHandles(context, edit, plane, flat, { knows: scene.heart.value !== null, names: true });
    drawPulls(context, edit, plane, origin, flat, NEAR_SLICE, 6);
  }
  context.restore();
  if (!style.letters) return;
  const [left, right, top, bottom] = plane.sides ?? [
    letters(scale(plane.right, -1)),
    letters(plane.right),
    letters(scale(plane.down, -1)),
    letters(plane.down),
  ];
  const patient = plane.sides
    ? [letters(scale(plane.right, -1)), letters(plane.right), letters(scale(plane.down, -1)), letters(plane.down)]
    : ["", "", "", ""];
  label(context, left, 8, height / 2, "left");
  label(context, right, width - 8, height / 2, "right");
  label(context, top, width / 2, 11);
  label(context, bottom, width / 2, height - 11);
  if (plane.sides && width > 200) {
    label(context, patient[0] ?? "", 8, height / 2 + 14, "left", 9);
    label(context, patient[1] ?? "", width - 8, height / 2 + 14, "right", 9);
  }
  label(context, width < 260 ? plane.short : plane.name, 8, 12, "left", 12);
  const value = style.cursor ? scene.voxels.at(scene.cursor.value) : NaN;
  label(context, Number.isNaN(value) ? "" : counts(value), width - 8, 12, "right", 12);
  // A bar of a round length, at most a third of the picture.
  const length = [100, 50, 20, 10, 5, 2, 1].find(mm => mm * factor < width / 3.2) ?? 1;
  const [from, to, y] = [10, 10 + length * factor, height - 12];
  context.strokeStyle = "rgba(0,0,0,.8)";
  context.lineWidth = 5;
  context.beginPath();
  context.moveTo(from, y);
  context.lineTo(to, y);
  context.stroke();
  context.strokeStyle = "#f4f7f8";
  context.lineWidth = 2;
  context.stroke();
  label(context, `${length} mm`, from, y - 11, "left", 11);
}

/** The colour of what a correction shows before it is fitted. */
export const PREVIEW = { colour: "#5cc8ff" };

/** Draws the pulls of the contour that are near a slice: diamonds, unlike the round handles. */
export function drawPulls(
  context: CanvasRenderingContext2D,
  edit: Edit,
  plane: Plane,
  origin: Vec,
  flat: (place: Vec) => [number, number],
  near: number,
  radius: number,
): void {
  for (const { place } of edit.pulls) {
    if (Math.abs(dot(sub(place, origin), plane.normal)) > near) continue;
    const [x, y] = flat(place);
    context.beginPath();
    context.moveTo(x, y - radius);
    context.lineTo(x + radius, y);
    context.lineTo(x, y + radius);
    context.lineTo(x - radius, y);
    context.closePath();
    context.lineJoin = "round";
    context.lineWidth = 5;
    context.strokeStyle = "#000";
    context.stroke();
    context.lineWidth = 1.5;
    context.strokeStyle = "#fff";
    context.stroke();
    context.fillStyle = PREVIEW.colour;
    context.fill();
  }
}

/** Half the length of the line that stands for the plane of the base, mm. */
const HALF_BASE = 32;

export interface HandlesStyle {
  /** Whether the sides are known, so that they can be turned. */
  knows: boolean;
  /** Whether there is room for large handles with their names. */
  names: boolean;
}

/** Draws the handles of a correction; `flat` is where a place lies in the slice. */
export function drawHandles(
  context: CanvasRenderingContext2D,
  edit: Edit,
  plane: Plane,
  flat: (place: Vec) => [number, number],
  { knows, names }: HandlesStyle,
): void {
  const radius = names ? 7 : 5;
  const knob = knows ? rollKnob(edit, plane) : null;
  const [base, apex, center] = [flat(edit.base), flat(edit.apex), flat(edit.center)];
  const line = (a: [number, number], b: [number, number]) => {
    for (const [stroke, width] of [
      ["rgba(0,0,0,.7)", 4],
      ["#ffe45c", 2],
    ] as const) {
      context.strokeStyle = stroke;
      context.lineWidth = width;
      context.beginPath();
      context.moveTo(...a);
      context.lineTo(...b);
      context.stroke();
    }
  };
  line(base, apex);
  const dot_ = ([x, y]: [number, number], fill: string, name: string) => {
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fillStyle = fill;
    context.fill();
    context.lineWidth = 2;
    context.strokeStyle = "#000";
    context.stroke();
    if (names) label(context, name, x + 11, y, "left", 11);
  };
  if (knob) {
    line(center, flat(knob));
    dot_(flat(knob), "#ff8bd1", "turn");
  } else {
    // The plane of the base, as it lies across this slice.
    const axis = unit(sub(edit.apex, edit.base));
    const along = [dot(axis, plane.right), dot(axis, plane.down)] as const;
    const length = Math.hypot(...along);
    if (length > 0.2) {
      const half =
        HALF_BASE *
        (Math.hypot(apex[0] - base[0], apex[1] - base[1]) / length / Math.hypot(...sub(edit.apex, edit.base)));
      const [x, y] = [(-along[1] / length) * half, (along[0] / length) * half];
      line([base[0] - x, base[1] - y], [base[0] + x, base[1] + y]);
    }
    dot_(base, "#ffe45c", "base");
    dot_(apex, "#ffe45c", "apex");
  }
  dot_(center, "#7dff9c", "centre");
}
