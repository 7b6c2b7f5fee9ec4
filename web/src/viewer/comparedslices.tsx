// Slices of stress above those of rest, at the same levels, in the same colours; one of them, chosen, is shown large.

import { useRef } from "preact/hooks";
import { useWatched } from "../state";
import { useCanvas } from "./canvas";
import {
  type Compared,
  type ComparedHeart,
  KINDS,
  type Row,
  type WhichScan,
  sliceAt,
  spacingOf,
  wallFrameOf,
} from "./compared";
import { type ShownHeart, heartAt } from "./comparedgates";
import type { ComparedScene } from "./comparedscene";
import { type Look, PREVIEW, drawHandles, drawPulls, label, outlineOf, paintVoxels, strokeOutline } from "./drawing";
import { type Held, dragged, draggedTo, heldAt, isOnlyPressed, previewOf } from "./handles";
import type { Mesh } from "./mesh";
import { type Axis, type Plane, point } from "./plane";
import { placeOnMap, onMap } from "./polar";
import { NEAR_SLICE } from "./pulls";
import type { Edit } from "./scene";
import { type Vec, dot, mix, norm, sub } from "./vector";

/** CSS pixels left of the slices for the name of the scan, and above each kind for its own. */
const [ASIDE, ABOVE] = [52, 19];
const GROUND = "#0a0e11";
const MARK = "#4de3ff";

export interface Laid {
  cell: number;
  left: number;
  top: (kind: number, row: number) => number;
  height: number;
}

/** Where the cells of `rows` lie in a picture of this size. */
export function laid(width: number, height: number, rows: Row[]): Laid {
  const aside = width < 500 ? 38 : ASIDE;
  const most = Math.max(...rows.map(row => row.count));
  const cell = Math.max(8, Math.min((width - aside) / most, (height - 3 * ABOVE) / 6));
  const left = aside + Math.max(0, (width - aside - most * cell) / 2);
  const top = (kind: number, row: number) => (kind + 1) * ABOVE + (2 * kind + row) * cell;
  return { cell, left, top, height: 3 * ABOVE + 6 * cell };
}

/** The place of the cursor on a heart's wall; null where there is none. */
function cursorPlace(one: ComparedHeart, cursor: [number, number] | null): Vec | null {
  const frame = cursor && wallFrameOf(one);
  const place = cursor && one.polar && placeOnMap(one.polar, cursor[0], cursor[1], 1);
  return frame && place ? frame.at(...place) : null;
}

/** How a slice of a scan is painted: `window` in per cent of its wall, its whole image, or the slice itself. */
function lookAt({ voxels, full }: ShownHeart, scene: ComparedScene, plane: Plane, origin: Vec): Look {
  const hundred = full[scene.normalisation.value](plane, origin, scene.across.value);
  const [low, high] = scene.window.value.map(percent => (hundred * percent) / 100) as [number, number];
  return { voxels, lut: scene.lut.value, low, high, smooth: scene.smooth.value };
}

const cut = new WeakMap<Mesh, Map<string, Float32Array>>();
/** Slices of one wall whose contours are kept: those of all rows, as they are and as they were. */
const MOST_CUT = 100;

/** The contour of a wall in a slice; a beat shows each many times. */
function contourOf(mesh: Mesh, plane: Plane, origin: Vec): Float32Array {
  const key = [...plane.normal, ...plane.right, ...origin].join();
  const known = cut.get(mesh) ?? new Map<string, Float32Array>();
  const found = known.get(key);
  if (found) return found;
  const made = outlineOf(mesh, plane, origin);
  if (known.size >= MOST_CUT) known.clear();
  cut.set(mesh, known.set(key, made));
  return made;
}

/** The colour of the wall's contour. */
const WALL = { colour: "#3dffa8" };

export interface SlicesStyle {
  width: number;
  height: number;
  ratio: number;
  /** The moment of the beat, in turns of its cycle; null: the sum of all gates. */
  moment: number | null;
}

export function drawSlices(
  element: HTMLCanvasElement,
  compared: Compared,
  scene: ComparedScene,
  { width, height, ratio, moment }: SlicesStyle,
): void {
  const context = element.getContext("2d");
  if (!context) return;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.fillStyle = GROUND;
  context.fillRect(0, 0, width, height);
  const rows = scene.rows.value;
  const across = scene.across.value;
  const { cell, left, top } = laid(width, height, rows);
  const factor = cell / across;
  const small = width < 500;
  const gates = scene.gates.value;
  for (const [kind, { name, short, way }] of KINDS.entries()) {
    label(
      context,
      small ? `${short}: ${way}` : `${name}: ${way}`,
      left,
      top(kind, 0) - ABOVE / 2,
      "left",
      small ? 10 : 12,
    );
    for (const [row, one] of [compared.stress, compared.rest].entries()) {
      const { heart } = one;
      const shown = heartAt(one, gates[one.scan], moment);
      const y = top(kind, row);
      label(context, row === 0 ? "Stress" : "Rest", left - 5, y + cell / 2, "right", small ? 9 : 12);
      if (!heart || !shown) continue;
      for (let n = 0; n < rows[kind]!.count; n++) {
        const { plane, origin } = sliceAt({ heart, scan: one.scan }, kind, n, rows);
        const box = { x: left + n * cell + 0.5, y: y + 0.5, width: cell - 1, height: cell - 1 };
        context.save();
        context.beginPath();
        context.rect(box.x, box.y, box.width, box.height);
        context.clip();
        paintVoxels(context, lookAt(shown, scene, plane, origin), plane, origin, box, factor);
        context.translate(box.x + box.width / 2, box.y + box.height / 2);
        if (scene.contours.value) strokeOutline(context, contourOf(shown.mesh, plane, origin), factor, WALL);
        context.restore();
      }
    }
  }
}

/** Marks the place of the cursor and the chosen slice on drawn slices. */
function markSlices(
  context: CanvasRenderingContext2D,
  compared: Compared,
  scene: ComparedScene,
  width: number,
  height: number,
): void {
  const rows = scene.rows.value;
  const { cell, left, top } = laid(width, height, rows);
  const factor = cell / scene.across.value;
  for (const [row, one] of [compared.stress, compared.rest].entries()) {
    const { heart } = one;
    const place = cursorPlace(one, scene.place);
    if (!heart || !place) continue;
    for (const kind of KINDS.keys()) {
      for (let n = 0; n < rows[kind]!.count; n++) {
        const { plane, origin } = sliceAt({ heart, scan: one.scan }, kind, n, rows);
        const from = sub(place, origin);
        if (Math.abs(dot(from, plane.normal)) > spacingOf(heart, kind, rows) / 2) continue;
        const [x, y] = [dot(from, plane.right) * factor, dot(from, plane.down) * factor];
        if (Math.max(Math.abs(x), Math.abs(y)) > cell / 2) continue;
        ring(context, left + (n + 0.5) * cell + x, top(kind, row) + cell / 2 + y, Math.max(3, cell / 22));
      }
    }
  }
  markCorrection(context, compared, scene, { cell, left, top }, factor);
  const { kind, number } = scene.chosen.value;
  context.strokeStyle = MARK;
  context.lineWidth = 1.5;
  context.strokeRect(left + number * cell + 1, top(kind, 0) + 1, cell - 2, 2 * cell - 2);
}

/** Cells of at least so many CSS pixels have room for the names of handles. */
const NAMED_CELL = 190;

/** The slice of a row that is nearest to a place: that with the handles. */
function nearestSlice(
  { heart, scan }: { heart: Axis; scan: WhichScan },
  kind: number,
  rows: Row[],
  place: Vec,
): number {
  const away = Array.from({ length: rows[kind]!.count }, (_, n) => {
    const { plane, origin } = sliceAt({ heart, scan }, kind, n, rows);
    return Math.abs(dot(sub(place, origin), plane.normal));
  });
  return away.indexOf(Math.min(...away));
}

/** Millimetres from a slice within which a pull is shown in it: each in one slice of a row at least. */
const nearOf = (heart: Axis, kind: number, scene: ComparedScene) =>
  Math.max(NEAR_SLICE, spacingOf(heart, kind, scene.rows.value) / 2);

/** Handles and preview of a correction on the rows of its scan, and what goes to the other scan with it. */
function markCorrection(
  context: CanvasRenderingContext2D,
  compared: Compared,
  scene: ComparedScene,
  laid: Pick<Laid, "cell" | "left" | "top">,
  factor: number,
): void {
  const now = scene.edit.value;
  if (!now) return;
  markEdit(context, compared[now.scan], now.edit, scene, laid, factor, true);
  if (now.other) markEdit(context, compared[now.scan === "stress" ? "rest" : "stress"], now.other, scene, laid, factor);
}

function markEdit(
  context: CanvasRenderingContext2D,
  one: ComparedHeart,
  edit: Edit,
  scene: ComparedScene,
  { cell, left, top }: Pick<Laid, "cell" | "left" | "top">,
  factor: number,
  handles = false,
): void {
  if (!one.heart) return;
  const heart = { heart: one.heart, scan: one.scan };
  const rows = scene.rows.value;
  const wall = previewOf(edit);
  // What can be pulled is seen.
  const still = handles && edit.wall?.pulled && !scene.contours.value ? edit.wall.mesh : null;
  for (const kind of KINDS.keys()) {
    const held = nearestSlice(heart, kind, rows, edit.center);
    const near = nearOf(one.heart, kind, scene);
    for (let n = 0; n < rows[kind]!.count; n++) {
      const { plane, origin } = sliceAt(heart, kind, n, rows);
      const flat = (place: Vec): [number, number] => {
        const way = sub(place, origin);
        return [dot(way, plane.right) * factor, dot(way, plane.down) * factor];
      };
      context.save();
      context.beginPath();
      context.rect(left + n * cell, top(kind, one.scan === "stress" ? 0 : 1), cell, cell);
      context.clip();
      context.translate(left + (n + 0.5) * cell, top(kind, one.scan === "stress" ? 0 : 1) + cell / 2);
      if (wall) strokeOutline(context, contourOf(wall, plane, origin), factor, PREVIEW);
      else if (still) strokeOutline(context, contourOf(still, plane, origin), factor, WALL);
      const first = scene.valve.value?.first;
      if (handles && first?.kind === kind) ring(context, ...flat(first.place), 3);
      if (handles && n === held)
        drawHandles(context, edit, plane, flat, { knows: one.oriented, names: cell >= NAMED_CELL });
      drawPulls(context, edit, plane, origin, flat, near, cell >= NAMED_CELL ? 6 : 4);
      context.restore();
    }
  }
}

function ring(context: CanvasRenderingContext2D, x: number, y: number, radius: number): void {
  for (const [width, stroke] of [
    [3, "#000"],
    [1.5, MARK],
  ] as const) {
    context.lineWidth = width;
    context.strokeStyle = stroke;
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.stroke();
  }
}

/** Millimetres from the middle of the wall within which the mouse points to it. */
const NEAR_WALL = 18;

/** The place of the wall of a heart nearest to one in a slice, on its polar map; null where it is farther than `reach`. */
function onWall(
  scene: ComparedScene,
  one: ComparedHeart,
  { kind, number }: { kind: number; number: number },
  right: number,
  down: number,
  reach = Infinity,
): [number, number] | null {
  const frame = wallFrameOf(one);
  if (!one.heart || !one.polar || !frame) return null;
  const { plane, origin } = sliceAt({ heart: one.heart, scan: one.scan }, kind, number, scene.rows.value);
  const place = point(plane, origin, right, down);
  const [rows, columns] = frame.place(place);
  if (norm(sub(place, frame.at(rows, columns))) > reach) return null;
  return onMap(one.polar, rows, columns);
}

/** The slice under the pointer, and the place in it, mm from its middle. */
interface Hit {
  one: ComparedHeart;
  kind: number;
  number: number;
  right: number;
  down: number;
}

function hitOf(
  { offsetX, offsetY, currentTarget }: PointerEvent & { currentTarget: HTMLCanvasElement },
  compared: Compared,
  scene: ComparedScene,
): Hit | null {
  const rows = scene.rows.value;
  const { cell, left, top } = laid(currentTarget.clientWidth, currentTarget.clientHeight, rows);
  const number = Math.floor((offsetX - left) / cell);
  const mm = scene.across.value / cell;
  for (const kind of KINDS.keys()) {
    if (number < 0 || number >= rows[kind]!.count) continue;
    for (const [row, one] of [compared.stress, compared.rest].entries()) {
      const [x, y] = [offsetX - left - (number + 0.5) * cell, offsetY - top(kind, row) - cell / 2];
      if (Math.abs(y) <= cell / 2) return { one, kind, number, right: x * mm, down: y * mm };
    }
  }
  return null;
}

/** CSS pixels from a handle within which a press takes it, and from the contour: of a finger as from a handle. */
const [HANDLE_REACH, CONTOUR_REACH] = [14, 6];

/** The slice under a pointer, and the place there. */
function placeOfHit(
  scene: ComparedScene,
  { one, kind, number, right, down }: Hit,
): { plane: Plane; place: Vec } | null {
  if (!one.heart) return null;
  const { plane, origin } = sliceAt({ heart: one.heart, scan: one.scan }, kind, number, scene.rows.value);
  return { plane, place: point(plane, origin, right, down) };
}

/** What of a correction a press would take; `mm` are those of a CSS pixel. */
function heldBy(scene: ComparedScene, hit: Hit, mm: number, touch: boolean): Held | null {
  const now = scene.edit.value;
  const found = placeOfHit(scene, hit);
  if (!now || !found || hit.one.scan !== now.scan || scene.valve.value) return null;
  return heldAt(now.edit, found.plane, found.place, {
    handle: HANDLE_REACH * mm,
    contour: (touch ? HANDLE_REACH : CONTOUR_REACH) * mm,
    near: nearOf(hit.one.heart!, hit.kind, scene),
    knows: hit.one.oriented,
    outlined: true,
  });
}

/** What a press does to a correction: it takes a handle or the contour, or places a point of the valve plane. */
function correct(scene: ComparedScene, hit: Hit, mm: number, touch: boolean): Held | "placed" | null {
  const now = scene.edit.value;
  const found = placeOfHit(scene, hit);
  if (!now || !found || hit.one.scan !== now.scan) return null;
  const { plane, place } = found;
  const valve = scene.valve.value;
  if (!valve) return heldBy(scene, hit, mm, touch);
  // In the short axis, the valve plane is no line.
  if (hit.kind === 0) return null;
  if (valve.first?.kind !== hit.kind) scene.valve.value = { first: { kind: hit.kind, place } };
  else {
    scene.edit.value = { ...now, edit: dragged(now.edit, plane, "base", mix(valve.first.place, place, 0.5)) };
    scene.valve.value = null;
  }
  return "placed";
}

function drag(scene: ComparedScene, held: Held, hit: Hit): void {
  const now = scene.edit.value;
  const found = placeOfHit(scene, hit);
  if (now && found) scene.edit.value = { ...now, edit: draggedTo(now.edit, found.plane, held, found.place) };
}

export function ComparedSlices({ compared, scene }: { compared: Compared; scene: ComparedScene }) {
  const { kind, number } = useWatched(scene.chosen);
  const rows = useWatched(scene.rows);
  const correcting = useWatched(scene.edit) !== null;
  // The slices without marks: these follow the mouse, and slices are slow to paint.
  const painted = useRef<{ canvas: HTMLCanvasElement; fresh: boolean } | null>(null);
  const draw = (element: HTMLCanvasElement) => {
    const context = element.getContext("2d");
    if (!context) return;
    const { clientWidth: width, clientHeight: height } = element;
    const ratio = element.width / width;
    painted.current ??= { canvas: document.createElement("canvas"), fresh: false };
    const { canvas } = painted.current;
    const same = canvas.width === element.width && canvas.height === element.height;
    if (!painted.current.fresh || !same) {
      if (!same) Object.assign(canvas, { width: element.width, height: element.height });
      drawSlices(canvas, compared, scene, { width, height, ratio, moment: scene.gate.value });
      painted.current.fresh = true;
    }
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(canvas, 0, 0);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    markSlices(context, compared, scene, width, height);
  };
  const { canvas } = useCanvas(
    draw,
    act => {
      const again = () => {
        if (painted.current) painted.current.fresh = false;
        act();
      };
      again();
      const ends = [scene.watchPictures(again), scene.watchMarks(act)];
      return () => ends.forEach(end => end());
    },
    compared,
  );
  const held = useRef<{ took: Held; hit: Hit } | null>(null);
  const press = (event: PointerEvent & { currentTarget: HTMLCanvasElement }) => {
    const hit = hitOf(event, compared, scene);
    if (!hit) return;
    const mm = scene.across.value / laid(event.currentTarget.clientWidth, event.currentTarget.clientHeight, rows).cell;
    const took = correct(scene, hit, mm, event.pointerType === "touch");
    if (took) {
      event.currentTarget.setPointerCapture(event.pointerId);
      held.current = took === "placed" ? null : { took, hit };
      return;
    }
    choose(hit);
  };
  const choose = (hit: Hit) => {
    scene.chosen.value = { kind: hit.kind, number: hit.number };
    scene.cursor.value = onWall(scene, hit.one, hit, hit.right, hit.down) ?? scene.cursor.value;
  };
  const release = () => {
    const edit = scene.edit.value?.edit;
    if (held.current && edit && isOnlyPressed(held.current.took, edit)) choose(held.current.hit);
    held.current = null;
  };
  const pointTo = (event: PointerEvent & { currentTarget: HTMLCanvasElement }) => {
    if (held.current) {
      const { took, hit } = held.current;
      const { clientWidth: width, clientHeight: height } = event.currentTarget;
      const { cell, left, top } = laid(width, height, rows);
      const mm = scene.across.value / cell;
      const row = hit.one.scan === "stress" ? 0 : 1;
      const right = (event.offsetX - left - (hit.number + 0.5) * cell) * mm;
      const down = (event.offsetY - top(hit.kind, row) - cell / 2) * mm;
      drag(scene, took, { ...hit, right, down });
      return;
    }
    if (event.pointerType === "touch") return;
    const hit = hitOf(event, compared, scene);
    const { clientWidth: width, clientHeight: height } = event.currentTarget;
    const takes = hit && heldBy(scene, hit, scene.across.value / laid(width, height, rows).cell, false);
    event.currentTarget.style.cursor = takes ? "grab" : "";
    scene.pointed.value = hit && onWall(scene, hit.one, hit, hit.right, hit.down, NEAR_WALL);
  };
  const move = (along: number, over: number) => {
    const next = Math.max(0, Math.min(KINDS.length - 1, kind + over));
    const last = rows[next]!.count - 1;
    scene.chosen.value = { kind: next, number: Math.max(0, Math.min(last, number + along)) };
  };
  return (
    <canvas
      ref={canvas}
      class={`compared-slices${correcting ? " correcting" : ""}`}
      tabIndex={0}
      role="slider"
      aria-label="Slices of stress above those of rest; arrow keys choose a level"
      aria-valuemin={1}
      aria-valuemax={rows.reduce((sum, row) => sum + row.count, 0)}
      aria-valuenow={rows.slice(0, kind).reduce((sum, row) => sum + row.count, 0) + number + 1}
      aria-valuetext={`${KINDS[kind]!.name}, slice ${number + 1} of ${rows[kind]!.count}`}
      onPointerDown={press}
      onPointerUp={release}
      onPointerCancel={() => (held.current = null)}
      onPointerMove={pointTo}
      onPointerLeave={() => (scene.pointed.value = null)}
      onKeyDown={event => {
        const by: Record<string, [number, number]> = {
          ArrowLeft: [-1, 0],
          ArrowRight: [1, 0],
          ArrowUp: [0, -1],
          ArrowDown: [0, 1],
          PageUp: [1, 0],
          PageDown: [-1, 0],
        };
        const step = by[event.key];
        if (!step) return;
        event.preventDefault();
        move(...step);
      }}
    />
  );
}

/** The chosen slice of both scans, large. */
export function LargePair({ compared, scene }: { compared: Compared; scene: ComparedScene }) {
  const { kind, number } = useWatched(scene.chosen);
  return (
    <div class="pair">
      {[compared.stress, compared.rest].map(one => (
        <Large key={one.scan} one={one} scene={scene} kind={kind} number={number} />
      ))}
    </div>
  );
}

function Large({
  one,
  scene,
  kind,
  number,
}: {
  one: ComparedHeart;
  scene: ComparedScene;
  kind: number;
  number: number;
}) {
  const title = one.scan === "stress" ? "Stress" : "Rest";
  const rows = useWatched(scene.rows);
  const draw = (element: HTMLCanvasElement) => {
    const context = element.getContext("2d");
    const { clientWidth: width, clientHeight: height } = element;
    if (!context) return;
    const ratio = element.width / width;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = GROUND;
    context.fillRect(0, 0, width, height);
    const shown = heartAt(one, scene.gates.value[one.scan], scene.gate.value);
    if (!one.heart || !shown) return;
    const { plane, origin } = sliceAt({ heart: one.heart, scan: one.scan }, kind, number, rows);
    const factor = Math.min(width, height) / scene.across.value;
    paintVoxels(context, lookAt(shown, scene, plane, origin), plane, origin, { x: 0, y: 0, width, height }, factor);
    context.save();
    context.translate(width / 2, height / 2);
    if (scene.contours.value) strokeOutline(context, contourOf(shown.mesh, plane, origin), factor, WALL);
    const place = cursorPlace(one, scene.place);
    if (place && Math.abs(dot(sub(place, origin), plane.normal)) <= spacingOf(one.heart, kind, rows) / 2) {
      const from = sub(place, origin);
      ring(context, dot(from, plane.right) * factor, dot(from, plane.down) * factor, 6);
    }
    context.restore();
    label(context, `${title}, ${KINDS[kind]!.short} ${number + 1}`, 8, 12, "left", 12);
    if (!one.oriented || !plane.sides) return;
    const [west, east, north, south] = plane.sides;
    label(context, west, 8, height / 2, "left", 11);
    label(context, east, width - 8, height / 2, "right", 11);
    label(context, north, width / 2, 11, "center", 11);
    label(context, south, width / 2, height - 11, "center", 11);
  };
  const { canvas } = useCanvas(draw, act => scene.watch(act), one);
  const placeOf = (event: PointerEvent & { currentTarget: HTMLCanvasElement }, reach?: number) => {
    const { clientWidth: width, clientHeight: height } = event.currentTarget;
    const factor = Math.min(width, height) / scene.across.value;
    const [x, y] = [(event.offsetX - width / 2) / factor, (event.offsetY - height / 2) / factor];
    return onWall(scene, one, { kind, number }, x, y, reach);
  };
  return (
    <figure class="slice">
      <canvas
        ref={canvas}
        role="img"
        aria-label={`${title}: ${KINDS[kind]!.name}, slice ${number + 1} of ${rows[kind]!.count}`}
        onPointerDown={event => (scene.cursor.value = placeOf(event) ?? scene.cursor.value)}
        onPointerMove={event => event.pointerType !== "touch" && (scene.pointed.value = placeOf(event, NEAR_WALL))}
        onPointerLeave={() => (scene.pointed.value = null)}
      />
    </figure>
  );
}
